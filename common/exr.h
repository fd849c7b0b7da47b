/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * OpenEXR pictures to linear float and back, through OpenEXRCore. Its 3.1.5 decodes no DWA and no
 * chroma-subsampled picture: such files go through OpenEXR's older C interface, which opens files
 * by name only and gives half floats; from memory they are refused with that reason.
 */
#ifndef GN_COMMON_EXR_H
#define GN_COMMON_EXR_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/** What an EXR file holds, from its header alone. */
struct gn_exr_info {
    int width, height;
    int channels; // 3 for R, G, B; 1 for Y; of what gn_exr_read_* makes of it
    bool is_core; // false: read by name only (DWA, subsampled chroma)
};

/** True where data starts with the magic number. */
bool gn_exr_is_exr(const void *data, size_t size);

/**
 * Size and channels of an EXR in memory, for checks before anything is decoded. Returns 0, or
 * -EINVAL, -ENOTSUP and a sentence as gn_exr_read_memory.
 */
GN_MUST_USE int gn_exr_get_info(const void *data, size_t size, struct gn_exr_info *out_info,
                                struct gn_error *out_error);

/**
 * Decodes R, G, B to [height][width][3], or Y alone to [height][width][1], of the data window of
 * the first part; scanlines or level 0 of tiles; half, float and uint samples. Values come as they
 * are: NaN, infinite and negative ones too. *out_saturated (may be NULL) says that half samples
 * reach 65504 or more (62016 in DWA, whose loss hides the limit), so that light may be missing.
 * Sizes are checked against GN_IMAGE_MAX_* and 4 GiB of decompressed samples before memory is
 * taken. Returns 0, -EINVAL (damaged, too large, no such channels), -ENOTSUP (deep; DWA or
 * subsampled from memory), -ENOMEM, and a sentence. Thread-safety: safe.
 */
GN_MUST_USE int gn_exr_read_memory(const void *data, size_t size, struct gn_image *out_image,
                                   bool *out_saturated, struct gn_error *out_error);

/**
 * As gn_exr_read_memory, from a file, DWA and subsampled chroma too. Thread-safety: safe, but that
 * OpenEXR keeps one message for all threads that fail on such files.
 */
GN_MUST_USE int gn_exr_read_file(const char *path, struct gn_image *out_image, bool *out_saturated,
                                 struct gn_error *out_error);

/**
 * Reads some channels of a file to [height][width][strlen(letters)]: layer "virtual" and letters
 * "RGBA" are the channels virtual.R, virtual.G, virtual.B, virtual.A; an empty layer is no prefix.
 * -ENOENT and a sentence where one is missing.
 */
GN_MUST_USE int gn_exr_read_layer(const char *path, const char *layer, const char *letters,
                                  struct gn_image *out_image, struct gn_error *out_error);

/** One channel to write. */
struct gn_exr_channel {
    const char *name;  // "virtual.R"; at most 31 bytes, borrowed during the call
    const float *data; // the first sample, borrowed during the call
    int stride;        // floats from one pixel to the next; rows follow without a gap
    bool is_half;      // write 16-bit floats, default 32-bit
};

/**
 * Writes channels of one size, ZIP compression, all or nothing. Names must differ. Returns 0,
 * -EINVAL, -ENOMEM or a negative errno, and a sentence.
 */
GN_MUST_USE int gn_exr_write_file(const char *path, int width, int height,
                                  const struct gn_exr_channel *channels, int n_channels,
                                  struct gn_error *out_error);

#endif
