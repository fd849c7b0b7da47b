/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Linear values of the 256 sRGB codes (IEC 61966-2-1). Checked by tests/unit/texture.c.
 */
#ifndef GN_SERVER_SCENE_SRGB_TABLE_H
#define GN_SERVER_SCENE_SRGB_TABLE_H

extern const float gn_srgb_table[256];

#endif
