/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Exact means of a picture over triangles laid on it.
 */
#ifndef GN_SERVER_LIGHT_PICTURE_MEAN_H
#define GN_SERVER_LIGHT_PICTURE_MEAN_H

#include "common/image.h"
#include "proto/attr.h"

/** A triangle laid on a picture: u to the right, v up, in [0, 1]; of either winding. */
struct gn_picture_triangle {
    double uvs[3][2];
};

/** What a picture shows in a triangle. */
struct gn_picture_mean {
    double rgb[3];
    double centroid_uv[2]; // of the luminance; of the area where it is black
};

/**
 * Means of image[h][w][3] over triangles[n]. The picture is constant over each pixel; the means are
 * exact but for rounding: the integral over a triangle is, by Green's theorem, that of F(x, y) dy
 * round it, with F the integral of the row from the left, which is linear within a pixel. A
 * triangle of less than 1e-6 of a pixel takes the pixel at its centre. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_picture_get_means(const struct gn_image *image,
                                     const struct gn_picture_triangle *triangles, int n,
                                     struct gn_picture_mean *out_means);

#endif
