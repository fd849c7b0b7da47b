/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Sequences on disk: what the rig's camera, tracker and probe deliver, and the truth beside it.
 * The format is docs/frames.md, "Sequences".
 */
#ifndef GN_TESTS_RIG_SEQUENCE_H
#define GN_TESTS_RIG_SEQUENCE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include <jansson.h>

#include "common/error.h"
#include "common/pool.h"
#include "proto/attr.h"
#include "tests/rig/view.h"

#define GN_RIG_MAX_FRAMES 1000

/** What to make: DIRECTORY holds the sequence in direct light, DIRECTORY/bounces the same with
 * bounces, on the same files. Strings are borrowed. */
struct gn_rig_sequence_options {
    const char *directory;
    const char *light;       // "lamps", or a lat-long EXR or Radiance file
    double turn_deg;         // turns a map about +z
    double light_distance;   // m, 0: infinitely far
    int width, height;       // px, of the camera, [16, 4096]
    double zoom;             // of its focal length, [0.25, 16]; 0: 1
    int frames_per_light;    // [1, 250]; the lamp room has four lights, a map is one
    int probe_size;          // px, [16, 2048]
    enum gn_rig_probe probe; // that sequence.json names
    bool is_float;           // sequence.json names float frames, not log codes
    int bounces;             // [0, 8], of the pictures with bounces
    int paths;               // a pixel: 4 batches; a power of two, [8, 16384]
    int direct_paths;        // the same for the pictures in direct light; 0: paths
    uint64_t seed;
    double noise;      // standard deviation of the sensor's noise, 8-bit codes; 0: none
    double jitter_mm;  // standard deviation of the delivered camera position, each axis
    double jitter_deg; // and of its direction, about each axis
    bool is_distorted; // a lens with k1 -0.11, k2 0.04, p1 0.0006, p2 -0.0004
    bool is_smooth;    // a teapot of 18,296 triangles
};

/**
 * Makes the sequence, skipping the frames that are there already with the same parameters; the
 * sequence.json files come last, so a folder that has them is complete. progress may be NULL.
 * Returns 0 or a negative errno and a sentence.
 */
GN_MUST_USE int gn_rig_make_sequence(const struct gn_rig_sequence_options *options,
                                     struct gn_pool *pool, FILE *progress,
                                     struct gn_error *out_error);

/** A sequence that was read back: its JSON and its folder. End it with gn_rig_sequence_finish. */
struct gn_rig_sequence {
    json_t *root;   // owned
    json_t *frames; // borrowed from root, an array of objects
    char directory[2048];
};

/** Reads DIR/sequence.json. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_rig_sequence_read(const char *directory, struct gn_rig_sequence *out_sequence,
                                     struct gn_error *out_error);
void gn_rig_sequence_finish(struct gn_rig_sequence *sequence);

/** Reads the 8-bit RGB picture DIRECTORY/NAME. 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_rig_read_picture(const char *directory, const char *name,
                                    struct gn_image8 *out_image, struct gn_error *out_error);
/** Member `key` of frame `index`, a string; NULL where it has none. Borrowed. */
const char *gn_rig_sequence_get_text(const struct gn_rig_sequence *sequence, int index,
                                     const char *key);
/** "0000.png" of the frame's picture: the name that composites go by. Borrowed. */
const char *gn_rig_sequence_get_name(const struct gn_rig_sequence *sequence, int index);

/** How composites differ from the truth, over the pixels that the object changes by more than 1/255
 * in any channel: mean absolute differences in 8-bit codes, over pixels and channels. */
struct gn_rig_errors {
    long pixels;
    double composite; // |composite - truth|
    double untouched; // |camera frame - truth|
    double noise;     // standard error of the truth's own values
};

/** One frame, or all: [0 object, 1 shadow]. */
struct gn_rig_verdict {
    struct gn_rig_errors errors[2];
};

/**
 * Judges DIRECTORY/NAME for each frame of the sequence: object pixels are those of which a virtual
 * object covers any part, shadow pixels the other changed ones. Prints a table to `table` (may be
 * NULL) and gives a report that the caller decrefs. Returns 0, -ENOENT where a composite is
 * missing, -EINVAL where its size differs, and a sentence.
 */
GN_MUST_USE int gn_rig_judge(const struct gn_rig_sequence *sequence, const char *composites,
                             FILE *table, json_t **out_report, struct gn_error *out_error);

/** What a contact sheet shows. Strings are borrowed and may be NULL: no such column. */
struct gn_rig_sheet_options {
    const char *title;
    const char *composites; // folder of NAME.png
    const char *light;      // folder of NAME.png: light maps with their lights
    const char *shadow;     // folder of NAME.png or NAME.exr (channels shadow.R, G, B)
    int n_rows;             // frames shown, spread evenly; 0: all
};

/** Draws the sheet. The caller finishes *out_sheet. 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_rig_draw_sheet(const struct gn_rig_sequence *sequence,
                                  const struct gn_rig_sheet_options *options,
                                  struct gn_image8 *out_sheet, struct gn_error *out_error);

#endif
