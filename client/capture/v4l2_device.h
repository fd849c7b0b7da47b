/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One camera of V4L2 that is open: what it offers, and setting it as asked for. What it does not
 * have is refused, naming what it has.
 */
#ifndef GN_CLIENT_CAPTURE_V4L2_DEVICE_H
#define GN_CLIENT_CAPTURE_V4L2_DEVICE_H

#include "client/capture/v4l2_io.h"
#include "client/capture/v4l2_pixels.h"

/** An open camera. Caller's memory; fd -1: none. Thread-safety: unsafe. */
struct gn_v4l2_device {
    const struct gn_v4l2_io *io; // borrowed
    int fd;
    char path[64];
    char card[33]; // what the camera calls itself, printable
    /** Its driver fills buffers that it was not given back, as v4l2loopback does: what writes there
     * goes round the buffers and waits for nobody. */
    bool is_careless;
};

/**
 * Opens the node and checks that it captures single-plane video into mapped buffers. Returns 0, or
 * a negative errno and a sentence; *out has fd -1 then.
 */
GN_MUST_USE int gn_v4l2_device_open(const struct gn_v4l2_io *io, const char *path,
                                    struct gn_v4l2_device *out, struct gn_error *out_error);
/** Closes it if it is open. */
void gn_v4l2_device_close(struct gn_v4l2_device *device);

/** One call of the driver. Returns 0 or a negative errno. */
int gn_v4l2_device_call(const struct gn_v4l2_device *device, unsigned long request, void *argument);

/**
 * Sets pixel format, size and rate as asked for. out_frame_ns: time of a frame, 0 where the driver
 * does not say. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_v4l2_device_set_format(const struct gn_v4l2_device *device,
                                          const struct gn_live_options *options,
                                          struct gn_v4l2_layout *out_layout, int64_t *out_frame_ns,
                                          struct gn_error *out_error);

/**
 * Sets exposure, gain, white balance and the controls named in the options, and reads each back.
 * Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_v4l2_device_set_controls(const struct gn_v4l2_device *device,
                                            const struct gn_live_options *options,
                                            struct gn_error *out_error);

/** Exposure set by hand. Caller's memory; zeroed: not held. */
struct gn_v4l2_exposure {
    uint32_t id;    // of the control that sets it; 0: not held
    double unit_us; // of its values; 0: counts
    int n_noted;
    struct {
        uint32_t id;
        int32_t value;
    } noted[5]; // what was changed, in order, and what it was
};

/** As gn_source_hold_exposure, _set_ and _restore_. */
GN_MUST_USE int gn_v4l2_exposure_hold(const struct gn_v4l2_device *device,
                                      enum gn_exposure_unit unit, struct gn_v4l2_exposure *exposure,
                                      struct gn_exposure *out, struct gn_error *out_error);
GN_MUST_USE int gn_v4l2_exposure_set(const struct gn_v4l2_device *device,
                                     const struct gn_v4l2_exposure *exposure, double value,
                                     double *out_value, struct gn_error *out_error);
GN_MUST_USE int gn_v4l2_exposure_restore(const struct gn_v4l2_device *device,
                                         struct gn_v4l2_exposure *exposure,
                                         struct gn_error *out_error);

/** One word of a list that is made for people. */
typedef void (*gn_v4l2_word_fn)(void *context, const char *word);
/** Pixel formats: "YUYV". */
void gn_v4l2_device_list_formats(const struct gn_v4l2_device *device, gn_v4l2_word_fn word,
                                 void *context);
/** Sizes of a format, each with its fastest rate: "640x480@30". */
void gn_v4l2_device_list_sizes(const struct gn_v4l2_device *device, uint32_t fourcc,
                               gn_v4l2_word_fn word, void *context);
/** Controls that can be set: "gain=10 (0 to 255)". */
void gn_v4l2_device_list_controls(const struct gn_v4l2_device *device, gn_v4l2_word_fn word,
                                  void *context);

/** Words with ", " between them, cut with "..." where they do not fit. A gn_v4l2_word_fn. */
struct gn_v4l2_words {
    char text[256];
    size_t n;
};
void gn_v4l2_words_add(void *words, const char *word);

#endif
