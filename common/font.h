/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Letters for pictures that programs draw: the viewer's overlay, the rig's contact sheet.
 */
#ifndef GN_COMMON_FONT_H
#define GN_COMMON_FONT_H

/** Pixels of a letter, and from one to the next. */
#define GN_FONT_WIDTH 5
#define GN_FONT_ADVANCE 6
/** Rows of capitals, and with what hangs below the line of j or q. */
#define GN_FONT_CAPITAL_ROWS 7
#define GN_FONT_ROWS 9

/** Rows of GN_FONT_WIDTH pixels, bit 4 on the left, indexed by ASCII. What is missing is a gap. */
extern const unsigned char gn_font_rows[128][GN_FONT_ROWS];

#endif
