/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where pictures come from: one interface, one file per kind of source. Recordings (file.c) give
 * every picture in turn, and who reads them paces them. Live sources (cameras) give the newest and
 * count what they left out. Whether pictures are camera frames or environment frames is their
 * user's business.
 */
#ifndef GN_CLIENT_CAPTURE_SOURCE_H
#define GN_CLIENT_CAPTURE_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/pose.h"
#include "proto/attr.h"

/** Longest wait of gn_source_read for a live source, ms. */
#define GN_SOURCE_WAIT_MS 50
/** A live source without a whole picture for so many frame times opens its camera again. */
#define GN_SOURCE_MISSING_FRAMES 5

/** How the pixels of a capture lie in memory: rows from the top, no padding, little-endian. */
enum gn_capture_format {
    GN_CAPTURE_RGB_F32 = 0, // linear R, G, B float32; all others are codes of some response
    GN_CAPTURE_MONO12,      // codes [0, 4095] in 16 bits
    GN_CAPTURE_RGB12,
    GN_CAPTURE_MONO16, // codes [0, 65535]
    GN_CAPTURE_RGB16,
    GN_CAPTURE_RGB8,
    GN_CAPTURE_JPEG, // a JPEG file as it is
};

/** One picture. */
struct gn_capture {
    const char *name;   // what files written about it are called; borrowed until the next read
    double time_s;      // recordings: since the source's first picture
    int64_t time_ns;    // live: when it was taken, CLOCK_MONOTONIC; 0 in recordings
    double exposure_us; // as the camera says with the picture; 0: it does not
    int bits;           // significant bits of the camera's codes; 0: those of format
    int width;          // px
    int height;         // px
    enum gn_capture_format format;
    const uint8_t *data; // borrowed until the next read
    size_t data_bytes;
    bool has_pose; // the source knows where the camera was
    struct gn_pose world_from_camera;
};

/** What a live source has counted since it was opened. */
struct gn_source_counts {
    uint64_t n_complete;       // whole pictures that came from the camera
    uint64_t n_incomplete;     // pictures with parts missing: never given out
    uint64_t n_lost;           // pictures that never came: gaps in the camera's numbers
    uint64_t n_skipped;        // whole pictures that a newer one replaced before they were read
    uint64_t n_lost_packets;   // that never came
    uint64_t n_resent_packets; // that came when asked for again
    uint64_t n_reopened;       // times the camera came back
    uint64_t n_read;           // pictures given out
    uint64_t read_bytes;       // of `data` of these
    uint64_t copied_bytes;     // of these, how many we wrote: once each, or not at all
};

/** The exposure of a live source, in the unit that it is held in. */
struct gn_exposure {
    double now, least, most;
};

/** How a live source's exposure is held: by its time, us, or by the camera's own counts (lines). */
enum gn_exposure_unit { GN_EXPOSURE_US = 0, GN_EXPOSURE_COUNTS };

struct gn_source;

/** What a kind of source does; see the functions below. */
struct gn_source_ops {
    int (*read)(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error);
    void (*get_counts)(const struct gn_source *source, struct gn_source_counts *out); // or NULL
    int (*hold_exposure)(struct gn_source *source, enum gn_exposure_unit unit,
                         struct gn_exposure *out,
                         struct gn_error *out_error); // or these three NULL
    int (*set_exposure)(struct gn_source *source, double value, double *out_value,
                        struct gn_error *out_error);
    int (*restore_exposure)(struct gn_source *source, struct gn_error *out_error);
    void (*close)(struct gn_source *source);
};

/** Head of every kind's own struct. Thread-safety: unsafe. */
struct gn_source {
    const struct gn_source_ops *ops;
    bool is_live;
    int fd; // live: poll() finds it readable when a read may have something; -1: read now and then
};

/** What is asked of a camera; all-zero leaves it as it is. Strings are borrowed for the opening
 * call. */
struct gn_live_options {
    const char *id;    // which camera, as its kind names them
    bool is_8_bit;     // give RGB8 or JPEG: what camera frames are on the wire; default: all bits
    int width, height; // px; 0: as it is
    double frame_rate_hz;
    double exposure_us; // > 0: fixed, automatic exposure off
    bool has_gain;
    double gain;              // in the camera's own unit, dB with GenICam; automatic gain off
    const char *pixel_format; // the camera's own name; NULL: the best that we can read
    bool is_white_balance_locked;
    const char *controls; // "NAME=VALUE,..." by the camera's own names; NULL: none
};

/**
 * The next picture. Returns 1, 0 at the end, or a negative errno and a sentence. A recording blocks
 * until it has read it. A live source gives the newest whole picture; where there is none within
 * GN_SOURCE_WAIT_MS it returns -EAGAIN, and *out_error then holds one line of news (the camera is
 * lost, or back again), each once, or "". Any other error of a live source is final.
 */
GN_MUST_USE int gn_source_read(struct gn_source *source, struct gn_capture *out,
                               struct gn_error *out_error);

/** What a live source has counted; zeros for recordings. */
void gn_source_get_counts(const struct gn_source *source, struct gn_source_counts *out);

/**
 * Begins to set a live source's exposure by hand: notes what it is set to and switches automatic
 * exposure, gain and white balance off. Returns 0; -ENOTSUP (a recording, or a camera whose
 * exposure cannot be set in this unit) or another negative errno, and a sentence: all is as it was.
 */
GN_MUST_USE int gn_source_hold_exposure(struct gn_source *source, enum gn_exposure_unit unit,
                                        struct gn_exposure *out, struct gn_error *out_error);
/**
 * Sets an exposure that is held. *out_value: what the camera says that it took, which may be a step
 * off. Pictures that come at once may still have the one before. Returns 0, -ERANGE (not in what
 * gn_source_hold_exposure told) or another negative errno, and a sentence.
 */
GN_MUST_USE int gn_source_set_exposure(struct gn_source *source, double value, double *out_value,
                                       struct gn_error *out_error);
/** Puts back what gn_source_hold_exposure has noted, as far as it can; nothing where nothing is
 * held. Returns 0, or a negative errno and a sentence on the first setting that stays. */
GN_MUST_USE int gn_source_restore_exposure(struct gn_source *source, struct gn_error *out_error);

/** NULL-safe; nulls *source. */
void gn_source_close(struct gn_source **source);

#endif
