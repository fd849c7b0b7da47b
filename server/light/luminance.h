/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Luminance of linear Rec.709 light. */
#ifndef GN_SERVER_LIGHT_LUMINANCE_H
#define GN_SERVER_LIGHT_LUMINANCE_H

/** Shares of R, G, B in Y. Source: ITU-R BT.709-6, item 3.2. */
#define GN_LUMINANCE_R 0.2126
#define GN_LUMINANCE_G 0.7152
#define GN_LUMINANCE_B 0.0722

/** Y of linear Rec.709 RGB, in double. */
static inline double gn_luminance(const float rgb[static 3])
{
    return GN_LUMINANCE_R * (double)rgb[0] + GN_LUMINANCE_G * (double)rgb[1] +
           GN_LUMINANCE_B * (double)rgb[2];
}

/** Y of sums, which are kept in double. */
static inline double gn_luminance_of_sum(const double rgb[static 3])
{
    return GN_LUMINANCE_R * rgb[0] + GN_LUMINANCE_G * rgb[1] + GN_LUMINANCE_B * rgb[2];
}

#endif
