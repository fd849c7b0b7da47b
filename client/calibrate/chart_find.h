/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Finds the colour chart in a picture by its grid and its order of brightness: in colour, in gray,
 * and under light of one narrow band.
 */
#ifndef GN_CLIENT_CALIBRATE_CHART_FIND_H
#define GN_CLIENT_CALIBRATE_CHART_FIND_H

#include "client/calibrate/chart.h"
#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

/**
 * Looks for a chart of patches brighter than what is between them, 12 of the 24 seen at least, any
 * way it lies but mirrored, its patches some 6 px wide or more. image: 1 or 3 channels, any
 * response that rises. Returns 1, 0 where there is none, -EDOM where it may lie in two ways,
 * -ENOMEM, and a sentence. Thread-safety: safe.
 */
GN_MUST_USE int gn_chart_find(const struct gn_image *image, struct gn_chart_place *out_place,
                              struct gn_error *out_error);

#endif
