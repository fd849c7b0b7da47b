/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The light of a frame as the passes take it: distant directions, in groups where there are many,
 * and the modelled surfaces that a map shows.
 */
#ifndef GN_SERVER_RENDER_LIGHTS_H
#define GN_SERVER_RENDER_LIGHTS_H

#include "server/light/blend.h"
#include "server/render/clusters.h"
#include "server/render/kernels/kernels.h"

struct frame;
struct light_merge;
struct placed_lights;
struct sample;
struct scratch;

/** Receivers of a block, neighbours in the picture: as many as a packet's rays. */
#define LANES GN_RT_PACKET
/** Directions of a group: 16 blocks of 16. */
#define GROUP (LANES * LANES)

/** 16 blocks of 16 lights each, all near each other. */
struct light_group {
    struct direction_boxes blocks;
    uint16_t lit[LANES];              // per block, bit i: lane i has light
    double block_moment[LANES][3][3]; // per block and channel: sum of irradiance times direction
    double moment[3][3];              // of the group
};

/** Directions that carry light, in structure-of-arrays form; the reference's in groups, filled up
 * with dark ones. */
struct light_list {
    int n, capacity;
    int n_lit;               // without the dark ones
    int ends[GN_PROBES_MAX]; // of each probe's lights, which begin where the one's before end
    float *dir[3];           // unit, world
    float *irradiance[3];    // at normal incidence, W/m^2
    double total[3];         // sum of irradiance
    double *cdf;             // [n] of luminance, rising to 1; the reference's choice of lights
    int n_groups;            // reference only: n / GROUP
    struct light_group *groups;
    struct direction_boxes *group_boxes; // of the groups, 16 together
};

/** A piece of a modelled real surface that the probe sees (places.c). */
struct place {
    float position[3];  // m, world
    float normal[3];    // unit, to the probe's side
    float intensity[3]; // W/sr along the normal
    float radius2;      // m^2, of the disc of equal area
};

/** What the reference's covered texels are in the global model. */
struct places {
    int n;
    int64_t capacity;
    int ends[GN_PROBES_MAX]; // of each probe's
    struct place *lights;    // [n], owned
    double *cdf;             // [n] of luminance, rising to 1; for walks
};

/* light_list.c */

GN_MUST_USE int gn_render_lights_reserve(struct light_list *list, int64_t capacity);
void gn_render_lights_finish(struct light_list *list);
void gn_render_lights_add(struct light_list *list, const double dir[static 3],
                          const double irradiance[static 3]);
/** Adds dark lights up to the next multiple. */
void gn_render_lights_pad(struct light_list *list, int multiple);
/** Fills list from the states' lights; dark ones are left out. Of more than `limit` together (0:
 * GN_LIGHTS_MAX) each probe has its share, merged from all its lights. */
GN_MUST_USE int gn_render_lights_from_blend(const struct gn_blend *blend, int limit,
                                            struct light_merge *merge, struct light_list *list,
                                            struct placed_lights *placed);
/** The light that u in [0, 1) chooses by luminance, where cdf is filled and some light is lit. */
int gn_render_lights_choose(const struct light_list *list, double u);
/** Sets the weights of samples that see a surface. */
void gn_render_weigh_probes(const struct frame *frame, struct sample *samples, int n);

static inline void gn_render_lights_get_dir(const struct light_list *lights, int l,
                                            float out_dir[static 3])
{
    for (int k = 0; k < 3; k++)
        out_dir[k] = lights->dir[k][l];
}

/** Which probe's light l is. */
static inline int get_probe(const struct light_list *lights, int l)
{
    int probe = 0;
    while (l >= lights->ends[probe])
        probe++;
    return probe;
}

/* directions.c */

/** Makes the groups of a list whose lights are in their order. */
void gn_directions_fill_groups(struct light_list *list);
/** Sets one of 16; box may be empty (min > max). */
void gn_directions_set_box(struct direction_boxes *boxes, int lane, const struct box *box);
/** Bit i: unless all rays from the origin with a direction of box i surely miss `box`. */
unsigned gn_directions_meet(const struct direction_boxes *boxes, const struct box *box);
/** Bit i: unless the outline surely crosses no direction of box i. */
unsigned gn_directions_cross(const struct direction_boxes *boxes, const struct outline *outline);
/** Bit i: box i may hold a direction above the plane across n; surely holds no other. */
void gn_directions_split(const struct direction_boxes *boxes, const float n[static 3],
                         unsigned *out_some, unsigned *out_all);

/* reference_lights.c */

/** Fills list from the whole map of each probe: every texel, bright ones in parts, and what it does
 * not show. No 16 groups are of two probes. */
GN_MUST_USE int gn_reference_make_lights(const struct gn_blend *blend, struct light_list *list,
                                         struct places *places);

/* places.c */

/** Empties the list. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_places_reserve(struct places *places, int64_t capacity);
void gn_places_finish(struct places *places);
/** Adds what the map's probe sees in a unit direction, of irradiance across it. False: it sees no
 * modelled surface there; nothing is added. */
bool gn_places_add(struct places *places, const struct gn_radiance_map *map,
                   const double dir[static 3], double solid_angle,
                   const double irradiance[static 3]);
/** After the last: fills cdf. */
void gn_places_fill_cdf(struct places *places);
/** Irradiance of a surface by one place, chosen by `random` [0, 1), over its probability. */
void gn_places_try(const struct frame *frame, const struct gn_surface *surface,
                   const float org[static 3], enum gn_rt_set set, double random,
                   double out_irradiance[static 3], uint64_t *rays);
/** Marks those that the set hides from the sample. True where there is one. */
bool gn_places_find_hidden(const struct frame *frame, struct scratch *scratch,
                           const struct sample *s, enum gn_rt_set set, uint8_t *hidden,
                           uint64_t *rays);
/** Adds what those send that hidden does not mark to sums[0], and of that what cut marks to
 * sums[1]; even: without the surface's cosine. */
void gn_places_sum(const struct frame *frame, const struct sample *s, const uint8_t *hidden,
                   const uint8_t *cut, bool even, double sums[static 2][3]);

#endif
