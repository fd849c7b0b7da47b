/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Luminance of linear Rec.709 light. */
#ifndef GN_SERVER_LIGHT_LUMINANCE_H
#define GN_SERVER_LIGHT_LUMINANCE_H

/** Y of linear Rec.709 RGB, in double. Source: ITU-R BT.709-6, item 3.2. */
static inline double gn_luminance(const float rgb[static 3])
{
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

#endif
