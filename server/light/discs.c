/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/discs.h"

#include "server/light/compact.h"

/* A disc of the last frame within this chord is the same. */
static const double same_disc = 0.05;

/* Apart from what methods use: they count from 1, or have the lowest bit set. */
static uint64_t get_disc_id(int i)
{
    return (UINT64_C(1) << 63) + 2 * (uint64_t)i;
}

static bool has_id(const struct gn_light_list *list, uint64_t id)
{
    for (int i = 0; i < list->n; i++)
        if (list->lights[i].id == id)
            return true;
    return false;
}

/* That of the nearest disc of the last state that is not taken; 0: there is none. */
static uint64_t find_last_id(const struct gn_compact_light *spot,
                             const struct gn_lighting_state *previous,
                             const struct gn_light_list *list)
{
    double best = same_disc * same_disc;
    uint64_t id = 0;
    for (int i = 0; previous && i < previous->n_lights; i++) {
        const struct gn_light *last = &previous->lights[i];
        double distance = 0;
        for (int c = 0; c < 3; c++) {
            double d = (double)last->dir_world[c] - spot->dir_world[c];
            distance += d * d;
        }
        if (last->is_disc && distance < best && !has_id(list, last->id)) {
            best = distance;
            id = last->id;
        }
    }
    return id;
}

static uint64_t find_free_id(const struct gn_light_list *list)
{
    int i = 0;
    while (has_id(list, get_disc_id(i)))
        i++;
    return get_disc_id(i);
}

int gn_discs_take(const struct gn_radiance_map *map, const struct gn_lighting_state *previous,
                  struct gn_pool *pool, struct gn_light_list *list,
                  struct gn_radiance_map **out_rest)
{
    static const double max_fresh_radius = 0.0175, min_fresh_share = 0.05;
    static const struct gn_compact_options kept = {.max_radius = 0.01925, .min_share = 0.04};
    struct gn_compact_lights spots;
    *out_rest = NULL;
    int rc = gn_compact_find(map, &kept, &spots), n_found = spots.n;
    if (rc < 0)
        return rc;
    spots.n = 0;
    for (int i = 0; i < n_found && rc == 0; i++) {
        const struct gn_compact_light *spot = &spots.light[i];
        struct gn_light disc = {.angular_radius = (float)spot->angular_radius, .is_disc = true};
        disc.id = find_last_id(spot, previous, list);
        if (disc.id == 0) {
            if (spot->angular_radius > max_fresh_radius || spot->share < min_fresh_share)
                continue;
            disc.id = find_free_id(list);
        }
        for (int c = 0; c < 3; c++) {
            disc.dir_world[c] = (float)spot->dir_world[c];
            disc.irradiance[c] = (float)spot->irradiance[c];
        }
        rc = gn_light_list_add(list, &disc);
        spots.light[spots.n++] = *spot;
    }
    if (rc == 0 && spots.n > 0)
        rc = gn_compact_get_rest(&spots, map, pool, out_rest);
    gn_compact_finish(&spots);
    return rc;
}
