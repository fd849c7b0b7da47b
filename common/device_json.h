/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Devices described in JSON: what camera.json, sequence.json and a probe's setup have in common.
 * The formats are documented in docs/frames.md. Thread-safety: as the JSON's, unsafe.
 */
#ifndef GN_COMMON_DEVICE_JSON_H
#define GN_COMMON_DEVICE_JSON_H

#include <stdbool.h>

#include "common/camera.h"
#include "common/error.h"
#include "common/json.h"
#include "common/probe_mask.h"
#include "common/projection.h"
#include "common/response.h"
#include "proto/attr.h"

/** How the environment frames of a probe come in. A value. */
struct gn_probe_setup {
    struct gn_projection projection; // width, height 0: those of the pictures; not yet initialised
    struct gn_response response;
    bool has_response; // said, not just the default (linear): codes need one
    struct gn_pose world_from_probe;
    bool is_12_bit; // 16-bit files hold codes [0, 4095]
    int n_masks;    // of masks, to be filled with gn_probe_mask_fill
    struct gn_probe_mask masks[GN_PROBE_MASK_MAX];
};

/** A lat-long map of linear radiance in the world's axes, at the marker. */
void gn_probe_setup_init(struct gn_probe_setup *setup);

/**
 * Reads a probe's setup: projection (needed), width, height, center, radius, theta_max, k,
 * vignetting, pixel_format ("float32", "log12", "linear16"), response, to_rec709, scale,
 * orientation, position, mask. Returns 0, or -EINVAL and a sentence that names file and key.
 */
GN_MUST_USE int gn_probe_setup_read_json(const struct gn_json *object,
                                         struct gn_probe_setup *out_setup,
                                         struct gn_error *out_error);

/** The same from a file of its own. */
GN_MUST_USE int gn_probe_setup_read_file(const char *path, struct gn_probe_setup *out_setup,
                                         struct gn_error *out_error);

/** Different tables of responses that one process reads: a device has one. */
#define GN_RESPONSE_JSON_TABLES 64

/**
 * Reads an object's optional members response, to_rec709 and scale into *response, which keeps what
 * they do not say. A table stays in memory as long as the process does; there are at most
 * GN_RESPONSE_JSON_TABLES different ones. Returns 0, -EINVAL, -E2BIG, -ENOMEM and a sentence.
 */
GN_MUST_USE int gn_response_read_json(const struct gn_json *object, struct gn_response *response,
                                      struct gn_error *out_error);

/** Reads a camera; needs_pose: its world_from_camera must be there, and must not be otherwise. */
GN_MUST_USE int gn_camera_read_json(const struct gn_json *object, bool needs_pose,
                                    struct gn_camera *out_camera, struct gn_error *out_error);

/** Reads 16 numbers, row-major, that must be a pose or nearly. Returns 0, or -EINVAL and a
 * sentence. */
GN_MUST_USE int gn_pose_read_json(const struct gn_json *object, const char *key,
                                  struct gn_pose *out_pose, struct gn_error *out_error);

#endif
