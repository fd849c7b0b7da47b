/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One opened GigE Vision camera, set up and streaming: what gige.c keeps open. Aravis' types stay
 * incomplete here.
 */
#ifndef GN_CLIENT_CAPTURE_GIGE_DEVICE_H
#define GN_CLIENT_CAPTURE_GIGE_DEVICE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "client/capture/gige_place.h"
#include "client/capture/pixels.h"
#include "client/capture/source.h"
#include "common/error.h"
#include "proto/attr.h"

struct _ArvBuffer; // ArvBuffer

/** Values. The objects are owned; all NULL: not open. */
struct gn_gige_device {
    struct _ArvCamera *camera;      // ArvCamera
    struct _ArvStream *stream;      // ArvStream
    struct _ArvChunkParser *chunks; // ArvChunkParser; NULL: it sends no stamps in chunks
    atomic_int *receiver;           // atomic: id of Aravis' thread that takes packets
    double ns_per_tick;             // of the stamps in chunks
    const struct gn_pixels_format *format;
    int width, height;
    size_t picture_bytes; // of one picture as the camera sends it
    size_t payload_bytes; // of a buffer: the picture and what follows it
    double frame_rate_hz; // 0: it does not say
    double exposure_us;   // 0: it does not say
    bool is_triggered;    // pictures come when a trigger does, or never
};

/**
 * Opens, takes control, sets everything that options ask for and starts the stream. patience_ms:
 * how long another program's (or a dead client's) control is waited for. Returns 0, -EBUSY, or
 * another negative errno, and a sentence.
 */
GN_MUST_USE int gn_gige_device_open(struct gn_gige_place *place,
                                    const struct gn_live_options *options, int patience_ms,
                                    struct gn_gige_device *out_device, struct gn_error *out_error);

/** When the camera says that it took a picture, its own clock, ns: the stamp in the picture's
 * chunk, else that of its leader; 0: it does not say. */
uint64_t gn_gige_device_get_stamp(const struct gn_gige_device *device, struct _ArvBuffer *buffer);

/** The exposure time that the camera says with a picture, us, in its chunk; 0: it does not. */
double gn_gige_device_get_exposure(const struct gn_gige_device *device, struct _ArvBuffer *buffer);

/** What was noted of a camera whose exposure is held; all-zero: it is not. "": it has no such. */
struct gn_gige_noted {
    bool is_held;
    double exposure_us;
    char automatics[3][32]; // ExposureAuto, GainAuto, BalanceWhiteAuto
};

/** As gn_source_hold_exposure, _set_ and _restore_; id: what the camera is called in sentences. */
GN_MUST_USE int gn_gige_exposure_hold(struct gn_gige_device *device, const char *id,
                                      enum gn_exposure_unit unit, struct gn_gige_noted *noted,
                                      struct gn_exposure *out, struct gn_error *out_error);
GN_MUST_USE int gn_gige_exposure_set(struct gn_gige_device *device, const char *id,
                                     double exposure_us, double *out_exposure_us,
                                     struct gn_error *out_error);
GN_MUST_USE int gn_gige_exposure_restore(struct gn_gige_device *device, const char *id,
                                         struct gn_gige_noted *noted, struct gn_error *out_error);

/** Reads the exposure time again: an automatic one changes. */
void gn_gige_device_read_exposure(struct gn_gige_device *device);

/** Whether the camera is still under our control, as far as its heartbeat has told by now: each
 * second, and 5 s more where it does not answer at all. */
bool gn_gige_device_is_ours(const struct gn_gige_device *device);

/** Whether Aravis has read every packet that came: its thread sleeps until there are more. */
bool gn_gige_device_has_read_all(const struct gn_gige_device *device);

/** Packets of pictures that have come since it was opened. */
uint64_t gn_gige_device_count_packets(const struct gn_gige_device *device);

/** Ends the stream and gives the camera up; takes seconds where it does not answer any more. */
void gn_gige_device_close(struct gn_gige_device *device);

#endif
