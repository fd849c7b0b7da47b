/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What the files sh*.c share; for them only. */
#ifndef GN_SERVER_LIGHT_SH_INTERNAL_H
#define GN_SERVER_LIGHT_SH_INTERNAL_H

#include <string.h>

#include "common/vec4.h"
#include "server/light/scratch.h"
#include "server/light/sh.h"

/** The harmonics are polynomials of the direction times these. */
extern const double gn_sh_factor[GN_SH_MAX];

/** The polynomials p[0 ... 8] in the direction (x, y, z) of squares xx, yy, zz, for numbers and for
 * vectors of them. */
#define GN_SH_POLYNOMIALS_2(p, one, x, y, z, xx, yy, zz)                                           \
    do {                                                                                           \
        (p)[0] = (one);                                                                            \
        (p)[1] = (y);                                                                              \
        (p)[2] = (z);                                                                              \
        (p)[3] = (x);                                                                              \
        (p)[4] = (x) * (y);                                                                        \
        (p)[5] = (y) * (z);                                                                        \
        (p)[6] = 3.0f * (zz) - (one);                                                              \
        (p)[7] = (x) * (z);                                                                        \
        (p)[8] = (xx) - (yy);                                                                      \
    } while (0)

/** p[9 ... 24], from p[0 ... 8]. */
#define GN_SH_POLYNOMIALS_4(p, x, y, z, xx, yy, zz)                                                \
    do {                                                                                           \
        (p)[9] = (y) * (3.0f * (xx) - (yy));                                                       \
        (p)[10] = (p)[4] * (z);                                                                    \
        (p)[11] = (y) * (5.0f * (zz) - (p)[0]);                                                    \
        (p)[12] = (z) * (5.0f * (zz)-3.0f);                                                        \
        (p)[13] = (x) * (5.0f * (zz) - (p)[0]);                                                    \
        (p)[14] = (p)[8] * (z);                                                                    \
        (p)[15] = (x) * ((xx)-3.0f * (yy));                                                        \
        (p)[16] = (p)[4] * (p)[8];                                                                 \
        (p)[17] = (p)[9] * (z);                                                                    \
        (p)[18] = (p)[4] * (7.0f * (zz) - (p)[0]);                                                 \
        (p)[19] = (p)[5] * (7.0f * (zz)-3.0f);                                                     \
        (p)[20] = (35.0f * (zz)-30.0f) * (zz) + 3.0f;                                              \
        (p)[21] = (p)[7] * (7.0f * (zz)-3.0f);                                                     \
        (p)[22] = (p)[8] * (7.0f * (zz) - (p)[0]);                                                 \
        (p)[23] = (p)[15] * (z);                                                                   \
        (p)[24] = (p)[15] * (x) - (p)[9] * (y);                                                    \
    } while (0)

/** Vectors that are summed in float before the sum goes to double. */
enum { GN_SH_LANES = 4, GN_SH_BLOCK = 16 };

/** Integrals of light times the polynomials, in the probe's axes. */
struct gn_sh_sums {
    double p[GN_SH_MAX][3];
};

/** The columns' waves of a lat-long of that width, of the scratch. NULL: no memory. */
GN_MUST_USE float *gn_sh_make_columns(int width, int order, struct gn_scratch *scratch);
/** Adds row y of a lat-long. */
void gn_sh_add_latlong_row(const struct gn_image *image, int y, int order, const float *columns,
                           struct gn_sh_sums *sums);

#endif
