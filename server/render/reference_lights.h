/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The parts of the reference's list of light, one by one. */
#ifndef GN_SERVER_RENDER_REFERENCE_LIGHTS_H
#define GN_SERVER_RENDER_REFERENCE_LIGHTS_H

#include "server/render/internal.h"

/** Groups of GROUP cells that the sphere is cut into for what a map does not show. */
#define GN_FILL_GROUPS 144
/** Most lights of one texel or cell. */
#define GN_TEXEL_PARTS_MAX 16

/** Sum of radiance times solid angle of the texels, W/m^2. */
void gn_reference_sum_map(const struct gn_radiance_map *map, double out_total[static 3]);
/** Adds the lights of one texel, bright ones in parts; luminance: that of the map's sum. */
void gn_reference_add_texel(const struct gn_radiance_map *map, int x, int y, double luminance,
                            struct light_list *list, struct places *places);
/** By which the cells' solid angles are the map's own figure of what is not shown; 0: no fill. */
double gn_reference_get_fill_scale(const struct gn_radiance_map *map);
/** Solid angle of cell i [0, GROUP), sr; 0: the map shows it. */
double gn_reference_get_fill_cell(const struct gn_radiance_map *map, int group, int i);
/** Adds the cell's light. */
void gn_reference_add_fill_cell(const struct gn_radiance_map *map, int group, int i, double scale,
                                struct light_list *list, struct places *places);
/** The list's running sum of luminance, from 0 to 1. */
void gn_reference_fill_cdf(struct light_list *list);

#endif
