/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The contact sheet's letters.
 */
#ifndef GN_TESTS_RIG_FONT_H
#define GN_TESTS_RIG_FONT_H

/** Rows of 5 pixels, bit 4 on the left, indexed by ASCII capital. */
extern const unsigned char gn_rig_font[128][7];

#endif
