/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Reads a picture of any format we know, picked by its content, not by its name.
 */
#ifndef GN_COMMON_IMAGE_FILE_H
#define GN_COMMON_IMAGE_FILE_H

#include <stdbool.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** What the numbers of a picture are. */
enum gn_image_kind {
    GN_IMAGE_LINEAR = 0,  // EXR, Radiance: linear radiance, unbounded, maybe NaN or negative
    GN_IMAGE_CODES8 = 1,  // PNG, JPEG: codes of some response, sRGB unless known better
    GN_IMAGE_CODES16 = 2, // 16-bit PNG: codes as they are; 12-bit sensors use [0, 4095]
};

/** A picture from a file; the member that kind names has pixels. End it with _finish. */
struct gn_image_file {
    enum gn_image_kind kind;
    bool is_saturated;         // linear: half floats reach 65504; light may be missing
    struct gn_image linear;    // 1 or 3 channels
    struct gn_image8 codes8;   // 1, 3 or 4
    struct gn_image16 codes16; // 1 or 3
};

/**
 * Reads EXR, Radiance, PNG or JPEG, up to 1 GiB. Returns 0, or a negative errno and one sentence
 * with the path; *out_file is zeroed then. Thread-safety: as gn_exr_read_file.
 */
GN_MUST_USE int gn_image_read_file(const char *path, struct gn_image_file *out_file,
                                   struct gn_error *out_error);
/** Frees the pixels and zeroes *file. A zeroed one is fine. */
void gn_image_file_finish(struct gn_image_file *file);

/**
 * The picture as floats for gn_response_to_radiance: linear values as they are, codes over their
 * full scale: 255, or full_scale16 (4095 for 12-bit sensors, 0: 65535). Alpha is dropped: 1 or 3
 * channels. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_image_file_to_float(const struct gn_image_file *file, int full_scale16,
                                       struct gn_image *out_image);

#endif
