/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the commands share that take poses from markers in the pictures: their options, the tracker
 * that these describe, what is written about it.
 */
#ifndef GN_CLIENT_POSES_H
#define GN_CLIENT_POSES_H

#include <stdbool.h>
#include <stdio.h>

#include "client/capture/source.h"
#include "client/track/tracker.h"
#include "common/camera.h"
#include "common/error.h"
#include "common/options.h"
#include "proto/attr.h"

/** Rows of the option table that every command which looks for markers has. */
#define GN_POSES_OPTIONS                                                                           \
    {.key = "markers",                                                                             \
     .flag = "markers",                                                                            \
     .type = GN_OPTION_STRING,                                                                     \
     .value_name = "FILE",                                                                         \
     .help = "Take the poses from markers in the pictures: markers.json says which there are and " \
             "where (docs/frames.md)."},                                                           \
        {.key = "marker",                                                                          \
         .flag = "marker",                                                                         \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "DICT:ID:SIZE",                                                             \
         .help = "Instead of --markers: one marker, its middle the world's origin; of gnomon "     \
                 "track, the object's. Such as 4x4_50:7:0.05 (its side in metres)."},              \
        {.key = "steady",                                                                          \
         .flag = "steady",                                                                         \
         .type = GN_OPTION_BOOL,                                                                   \
         .default_value = "true",                                                                  \
         .help = "Make the poses steady: what rests is still, what moves lags little. "            \
                 "--no-steady: each as it was measured."},                                         \
    {                                                                                              \
        .key = "debug-markers", .flag = "debug-markers", .type = GN_OPTION_STRING,                 \
        .value_name = "DIR",                                                                       \
        .help = "Write each picture with the markers found and the axes of their bodies drawn "    \
                "into it (x red, y green, z blue)."                                                \
    }

/** Thread-safety: unsafe. */
struct gn_poses;

/** Whether markers are asked for. */
bool gn_poses_is_asked(const struct gn_options *options);
/** What is wrong with the options of GN_POSES_OPTIONS together; NULL: nothing. */
const char *gn_poses_find_misuse(const struct gn_options *options);

/** Says on stderr where a marker is so large that its side is rather meant in millimetres. source:
 * what lists the bodies. */
void gn_poses_doubt_sizes(const struct gn_bodies *bodies, const char *source);

/** Reads camera.json, which need not say where the camera is (out_has_place): markers do. Returns
 * 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_poses_read_camera(const char *path, struct gn_camera *out_camera,
                                     bool *out_has_place, struct gn_error *out_error);

/**
 * Opens what the options describe; camera is copied. object: --marker is on it, and poses are not
 * made steady, whatever the options say; NULL: --marker is the world. Returns 0, or a negative
 * errno and a sentence: -ENOSYS where the build has no OpenCV.
 */
GN_MUST_USE int gn_poses_open(const struct gn_options *options, const struct gn_camera *camera,
                              const char *object, struct gn_poses **out_poses,
                              struct gn_error *out_error);

/** From now on each picture's poses are written to DIR/poses.jsonl, a line of JSON each
 * (docs/frames.md). Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_poses_write_to(struct gn_poses *poses, const char *dir,
                                  struct gn_error *out_error);

/** When a picture was taken: own monotonic clock, or a recording's own time. */
int64_t gn_poses_get_time_ns(const struct gn_capture *capture);

/**
 * Looks at the picture. Where some in a row speak against the list of the markers, a line on
 * stderr says what does not fit, seldom. A camera's picture that comes damaged shows no body, which
 * the first one tells on stderr; such a file is an error. Returns how many bodies are seen in it,
 * or a negative errno and a sentence.
 */
GN_MUST_USE int gn_poses_take(struct gn_poses *poses, const struct gn_capture *capture,
                              struct gn_error *out_error);

/** What the last pictures say against the list of the markers, as it was told; NULL: nothing.
 * Borrowed until the next picture. */
const char *gn_poses_get_doubt(const struct gn_poses *poses);

/** Where the camera of the last picture was. False where the world's markers were not seen. */
bool gn_poses_get_camera(const struct gn_poses *poses, struct gn_pose *out_world_from_camera);
/** Where the body of that index was. False where it or the world was not seen. */
bool gn_poses_get_body(const struct gn_poses *poses, int body, struct gn_pose *out_world_from_body);
/** Where it was in the camera's frame. False where it was not seen. */
bool gn_poses_get_in_camera(const struct gn_poses *poses, int body,
                            struct gn_pose *out_camera_from_body);
/** The index of a body, -1: there is none of the name. */
int gn_poses_find_body(const struct gn_poses *poses, const char *name);

/** A line or two about what was seen, how still, how late and how dear. NULL-safe. */
void gn_poses_print(struct gn_poses *poses, FILE *out);

/** NULL-safe; nulls *poses. */
void gn_poses_close(struct gn_poses **poses);

#endif
