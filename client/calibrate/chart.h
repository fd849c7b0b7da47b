/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The 24-patch colour chart (ColorChecker Classic): its reflectances, its patches in a picture, and
 * the matrix from a device's linear RGB to Rec.709 that it gives. Patches count from 0, row by row,
 * from dark skin; the last row is grey, white to black. Thread-safety of all functions: safe.
 */
#ifndef GN_CLIENT_CALIBRATE_CHART_H
#define GN_CLIENT_CALIBRATE_CHART_H

#include <stdbool.h>

#include "common/error.h"
#include "common/image.h"
#include "proto/attr.h"

#define GN_CHART_PATCHES 24
#define GN_CHART_COLUMNS 6
/** The first of the six grey patches. */
#define GN_CHART_WHITE 18

/** "dark skin", ... for patch [0, 24). */
const char *gn_chart_get_name(int patch);

/**
 * Reflectance of a patch as linear Rec.709 of a perfect white of 1 under D65: from X-Rite's
 * published L*a*b* (D50, 2 degrees, charts made before November 2014), by Bradford's adaptation.
 * Out-of-gamut cyan has a negative red.
 */
void gn_chart_get_reflectance(int patch, double out_rgb[static 3]);

/** Where the chart is: the centres of patches 1, 6, 24, 19 in px (dark skin, bluish green, black,
 * white): x0 y0 x1 y1 ... */
struct gn_chart_place {
    double corners[8];
};

/** What a picture shows of a patch, per channel, in codes as a share of full scale. */
struct gn_chart_patch {
    double code[3];    // median; a mono picture gives all three the same
    double spread[3];  // robust deviation of single pixels
    double clipped[3]; // share of pixels within the rails
    int n_pixels;
};

/**
 * Measures the middle of each patch (60 % of its width). image: 1 or 3 channels of codes in [0, 1]
 * of full scale. rail: codes below it and above 1 - rail count as clipped. Returns 0, or -EINVAL
 * and a sentence: the place leaves the picture, its corners do not span a chart, patches under 5
 * pixels.
 */
GN_MUST_USE int gn_chart_measure(const struct gn_image *image, const struct gn_chart_place *place,
                                 double rail, struct gn_chart_patch out_patches[static 24],
                                 struct gn_error *out_error);

/** The corners of what gn_chart_measure measures of a patch, px: x0 y0 x1 y1 ... in turn. */
void gn_chart_get_outline(const struct gn_chart_place *place, int patch, double out_xy[static 8]);

/**
 * How like the chart what lies at a place is: the rank correlation (Spearman's) of the codes of a
 * channel with the patches' luminance or reflectance in red, green or blue, where it is best: light
 * of one band does as well as white, and a channel that is clipped does no harm. 1 at best, below
 * 0.8 it is no such chart; -1 where it cannot be measured.
 */
double gn_chart_get_likeness(const struct gn_image *image, const struct gn_chart_place *place);

/**
 * Which of the chart's four ways to lie (turned by 180 degrees, mirrored) is most like it; *place
 * becomes that. Returns the likeness.
 */
double gn_chart_orient(const struct gn_image *image, struct gn_chart_place *place);

/** A fitted matrix and how well it does. */
struct gn_chart_matrix {
    double to_rec709[9];
    double condition; // of the device's colours, weighted as in the fit
    double error[24]; // |A x - rho| over the patch's luminance, relative; NaN: not measured
    bool is_outlier[24];
    double rms;        // of error over those used
    double worst_grey; // largest error of a grey patch that was used
};

/** Largest condition number a matrix may have. */
#define GN_CHART_MAX_CONDITION 1e3
/** Largest error of a matrix, RMS over its patches: colours under white light are within a few
 * percent. */
#define GN_CHART_MAX_ERROR 0.25

/**
 * Minimises sum w |A x_j - rho_j|^2, w = 1 / (rho_Y + 0.02)^2, by QR, such that white stays white
 * (A x = rho for the mean of the greys) where keeps_white. device[24][3] in units in which the
 * greys' green is their reflectance; NaN: a patch not measured. Patches that lie off by more than 4
 * robust deviations are left out and marked. Returns 0, or -EDOM and a sentence: fewer than 6
 * patches, condition too large.
 */
GN_MUST_USE int gn_chart_fit_matrix(const double device[static 72], bool keeps_white,
                                    struct gn_chart_matrix *out_matrix, struct gn_error *out_error);

#endif
