/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Silhouettes: what a set of triangles looks like from a distant light, as 64 x 64 cells of the
 * plane across its direction. Outlines (edges.c) cut the plane into regions in which all lines
 * along the direction are stopped or none is: cells that no outline comes near are settled, without
 * a ray for each receiver; rays are left for the cells along the outlines.
 */
#ifndef GN_SERVER_RENDER_SILHOUETTE_H
#define GN_SERVER_RENDER_SILHOUETTE_H

#include "common/pool.h"
#include "server/render/internal.h"

/** Cells of a side. */
#define SILHOUETTE_SIDE 64

/** Bit x of row y is a cell; what is neither edge nor dark, and all beyond the cells, is free: no
 * line of the light's direction meets the set there. */
struct silhouette {
    float axis[2][3]; // cells per metre, world; cell = axis . p + offset
    float offset[2];
    float dir[3];                   // the light's, unit
    uint64_t edge[SILHOUETTE_SIDE]; // an outline may pass
    uint64_t dark[SILHOUETTE_SIDE]; // every line meets the set
};

/** A set's silhouettes, one for each light. Kept from frame to frame. */
struct silhouettes {
    int n, capacity;
    struct silhouette *of;       // [n], owned
    float margin;                // that they were made with
    float *planes;               // [8][capacity] their axes (6) and offsets (2), owned
    struct projected *projected; // [workers of the pool] working memory, owned
};

/** Whether lines from somewhere meet the set. */
enum silhouette_state { SILHOUETTE_FREE, SILHOUETTE_DARK, SILHOUETTE_EDGE };

/** Forgets all: the set's triangles have changed. */
void gn_silhouettes_forget(struct silhouettes *silhouettes);
void gn_silhouettes_finish(struct silhouettes *silhouettes);
/** One for each of the lights; those whose light has the direction that it had are kept. Clusters
 * of flat objects are left out where without_flat is set. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_silhouettes_make(struct silhouettes *silhouettes,
                                    const struct clusters *clusters, bool without_flat,
                                    const struct light_list *lights, float margin,
                                    struct gn_pool *pool);

/** Lists the lights of which lines through points of the box may meet the set. Returns their
 * number.
 */
int gn_silhouettes_list(const struct frame *frame, const struct silhouettes *silhouettes,
                        const struct box *box, int16_t out_lights[static GN_LIGHTS_MAX]);
/** Of all lines through points of the box. */
enum silhouette_state gn_silhouette_get_box(const struct silhouette *s, const struct box *box);
/** Of a block's 16 receivers. bits: of *out_dark, *out_edge; the others are free. */
void gn_silhouette_get_block(const struct frame *frame, const struct silhouette *s,
                             const struct receivers *r, int block, unsigned *out_dark,
                             unsigned *out_edge);

#endif
