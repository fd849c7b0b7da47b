/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * LDR-FLIP: how different two pictures look to an observer who flips between them.
 * Source: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference
 * Evaluator for Alternating Images", HPG 2020; written from its description, with its constants.
 */
#ifndef GN_TESTS_BENCH_ERROR_TIME_FLIP_H
#define GN_TESTS_BENCH_ERROR_TIME_FLIP_H

#include "common/image.h"

/** The paper's observer: a monitor 0.7 m wide of 3840 px, seen from 0.7 m. */
#define GN_FLIP_PIXELS_PER_DEGREE 67.0

/**
 * Mean over the picture of the FLIP difference, 0: the same, at most 1. Pictures of one size, 3
 * channels, linear Rec.709 of the display, clamped to [0, 1] here. out_map (may be NULL) is inited
 * by the call: one channel. pixels_per_degree in [1, 1000]. Symmetric in its pictures. Returns 0,
 * -EINVAL (sizes, channels), -ENOMEM.
 */
GN_MUST_USE int gn_flip_compare(const struct gn_image *reference, const struct gn_image *test,
                                double pixels_per_degree, struct gn_image *out_map,
                                double *out_mean);

#endif
