/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Parts of a probe's picture that show no light of the room, such as the camera mirrored in a
 * ball: they are filled from what surrounds them, before the picture is used.
 */
#ifndef GN_COMMON_PROBE_MASK_H
#define GN_COMMON_PROBE_MASK_H

#include "proto/attr.h"

#define GN_PROBE_MASK_MAX 8

/** A disc that is masked. */
struct gn_probe_mask {
    double center[2]; // px
    double radius;    // px, > 0
};

/** How the numbers of a picture are stored. */
enum gn_probe_mask_sample { GN_PROBE_MASK_U8, GN_PROBE_MASK_U16, GN_PROBE_MASK_F32 };

/**
 * Replaces the pixels whose centres lie in a mask by the harmonic continuation of the codes around
 * it (Poisson's integral over 96 points of a circle 1.5 px outside): smooth, between the least and
 * the largest of them, and equal to them at the edge. Points outside the picture do not count; a
 * mask with no point inside becomes 0. pixels[height][width][channels], native byte order.
 * Thread-safety: safe for different pictures.
 */
void gn_probe_mask_fill(const struct gn_probe_mask *masks, int n_masks, void *pixels, int width,
                        int height, int channels, enum gn_probe_mask_sample sample);

#endif
