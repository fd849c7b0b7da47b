/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Normal deviates that are counted, not drawn: three for each pixel of each frame, the same ones on
 * any thread. Fast rather than fine: 2048 values, none beyond 3.6.
 */
#ifndef GN_COMMON_NOISE_H
#define GN_COMMON_NOISE_H

#include <stdint.h>

#define GN_NOISE_BITS 11
#define GN_NOISE_VALUES (1 << GN_NOISE_BITS)

/** As many equally likely values, mean 0 and variance 1. Immutable after init. */
struct gn_noise {
    float deviate[GN_NOISE_VALUES];
};

/** Each value is the normal distribution's mean over one of its 2048 equal parts; their variance,
 * which that lessens, is made 1. */
void gn_noise_init(struct gn_noise *noise);

/** The frame's key of its number; take another number for each view. */
uint32_t gn_noise_get_key(uint64_t number);

/**
 * Three deviates of pixel (x, y), independent of each other and of all other pixels and keys.
 * The hash is pcg3d: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020.
 */
static inline void gn_noise_get(const struct gn_noise *noise, uint32_t key, uint32_t x, uint32_t y,
                                float out[static 3])
{
    const uint32_t a = 1664525u, b = 1013904223u;
    uint32_t v0 = x * a + b, v1 = y * a + b, v2 = key * a + b;
    v0 += v1 * v2;
    v1 += v2 * v0;
    v2 += v0 * v1;
    v0 ^= v0 >> 16;
    v1 ^= v1 >> 16;
    v2 ^= v2 >> 16;
    v0 += v1 * v2;
    v1 += v2 * v0;
    v2 += v0 * v1;
    out[0] = noise->deviate[v0 >> (32 - GN_NOISE_BITS)];
    out[1] = noise->deviate[v1 >> (32 - GN_NOISE_BITS)];
    out[2] = noise->deviate[v2 >> (32 - GN_NOISE_BITS)];
}

#endif
