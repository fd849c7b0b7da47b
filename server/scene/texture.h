/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures laid over meshes: 8-bit RGBA with a pyramid of halved pictures, sampled with linear
 * interpolation within a level and between levels.
 */
#ifndef GN_SERVER_SCENE_TEXTURE_H
#define GN_SERVER_SCENE_TEXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "proto/attr.h"

/** Most levels of a pyramid: sides up to GN_IMAGE_MAX_SIDE. */
#define GN_TEXTURE_MAX_LEVELS 15

/** What lies beyond the picture's edges. */
enum gn_texture_wrap {
    GN_WRAP_REPEAT = 0, // glTF's default
    GN_WRAP_MIRROR = 1, // each other copy mirrored
    GN_WRAP_CLAMP = 2,  // the edge's colour goes on
};

/** Thread-safety: immutable after create. */
struct gn_texture {
    int width, height;
    bool is_srgb;      // R, G, B are sRGB codes; else linear. Alpha is linear
    float linear[256]; // what the codes of R, G, B stand for
    int n_levels;
    uint8_t *levels[GN_TEXTURE_MAX_LEVELS]; // [max(1, height >> l)][max(1, width >> l)][4], owned
};

/**
 * Decodes a PNG or JPEG. max_texels bounds width * height and is looked at before memory is taken.
 * Returns 0, -EINVAL (neither, damaged, too large), -ENOMEM and a sentence; *out_texture is zeroed
 * then. End it with gn_texture_finish.
 */
GN_MUST_USE int gn_texture_read_memory(const void *data, size_t size, bool is_srgb, long max_texels,
                                       struct gn_texture *out_texture, struct gn_error *out_error);
/** Takes a copy of rgba[height][width][4]. Returns 0, -EINVAL (a side out of range), -ENOMEM. */
GN_MUST_USE int gn_texture_init(struct gn_texture *texture, const uint8_t *rgba, int width,
                                int height, bool is_srgb);
/** Frees and zeroes. A zeroed one is fine. */
void gn_texture_finish(struct gn_texture *texture);

/** Where a material's picture is and how it goes on. */
struct gn_texture_slot {
    const struct gn_texture *texture; // NULL: none; one of the mesh's
    enum gn_texture_wrap wrap_u, wrap_v;
};

/**
 * Linear RGBA at uv: u to the right, v upwards, the picture in [0, 1]; the centre of the lower left
 * texel lies at (0.5 / width, 0.5 / height). texels: side of the footprint in texels of the finest
 * level; up to 1 that level alone counts. uv may be anything finite. Thread-safety: safe.
 */
void gn_texture_sample(const struct gn_texture_slot *slot, const float uv[static 2], float texels,
                       float out_rgba[static 4]);

#endif
