/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What ggx.h needs integrals for; printed at build time by ggx_table_make.c. tests/unit/ggx.c holds
 * it against sums of its own. Rows lie evenly in sqrt(alpha), over [0, 1].
 */
#ifndef GN_SERVER_RENDER_GGX_TABLE_H
#define GN_SERVER_RENDER_GGX_TABLE_H

#define GGX_NODES 72

/** E, at columns that lie evenly in cos_o (1 + alpha) / (cos_o + alpha) over [0, 1]: it is cos_o
 * over alpha that counts where both are small. */
extern const float ggx_table_whole[GGX_NODES][GGX_NODES];
/** The mean of (1 - wo . m)^5 over what makes up E, at columns evenly in sqrt(cos_o). */
extern const float ggx_table_fifth[GGX_NODES][GGX_NODES];

#endif
