/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The reference's light in the global model: each texel that shows a modelled real surface is a
 * piece of that surface, and shines from there by Lambert's law. A texel of radiance L and solid
 * angle W that sees the surface at distance r0 under the cosine c0 is taken for a disc of equal
 * area, of radius s: W = pi s^2 c0 / (r0^2 + s^2), exact on the disc's axis. At distance d, under
 * the cosine c of the piece, a surface across the ray has the irradiance
 *   E = L W (r0^2 + s^2) / c0  c / (d^2 + s^2),
 * at the probe what was measured, L W. One ray for each piece; there is no shorter way.
 */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_geometry.h"

// Share of the way to a piece that a ray leaves out: the piece's own surface hides nothing.
#define STOP_SHORT 1e-3f
// A surface seen more nearly edge-on than that is taken for one so seen.
#define LEAST_COSINE 0.05

void gn_places_finish(struct places *places)
{
    free(places->lights);
    free(places->cdf);
    memset(places, 0, sizeof(*places));
}

int gn_places_reserve(struct places *places, int64_t capacity)
{
    places->n = 0;
    memset(places->ends, 0, sizeof(places->ends));
    if (capacity <= places->capacity)
        return 0;
    gn_places_finish(places);
    places->lights = malloc((size_t)capacity * sizeof(*places->lights));
    places->cdf = malloc((size_t)capacity * sizeof(*places->cdf));
    if (!places->lights || !places->cdf)
        return -ENOMEM;
    places->capacity = capacity;
    return 0;
}

bool gn_places_add(struct places *places, const struct gn_radiance_map *map,
                   const double dir[static 3], double solid_angle,
                   const double irradiance[static 3])
{
    const float narrow[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
    struct place *place = &places->lights[places->n];
    float distance;
    if (!map->geometry)
        return false;
    gn_map_geometry_look(map->geometry, narrow, &distance, place->normal);
    if (!(distance < INFINITY))
        return false;
    double c0 = 0;
    for (int k = 0; k < 3; k++) {
        place->position[k] = (float)(map->geometry->position[k] + (double)distance * dir[k]);
        c0 -= (double)place->normal[k] * dir[k];
    }
    c0 = fmax(c0, fmax(LEAST_COSINE, 2 * solid_angle / M_PI));
    double r2 = (double)distance * (double)distance;
    double s2 = r2 * solid_angle / (M_PI * c0 - solid_angle);
    place->radius2 = (float)s2;
    for (int k = 0; k < 3; k++)
        place->intensity[k] = (float)(irradiance[k] * (r2 + s2) / c0);
    places->n++;
    return true;
}

/** Direction and distance of the place; returns what of its intensity reaches the surface, 1/m^2,
 * 0 where either faces away. */
static float aim(const struct place *place, const struct gn_surface *surface,
                 const float org[static 3], float out_dir[static 3], float *out_distance)
{
    float to[3];
    for (int k = 0; k < 3; k++)
        to[k] = place->position[k] - org[k];
    float d2 = dot3(to, to);
    float d = sqrtf(d2);
    *out_distance = d;
    if (!(d > 0))
        return 0;
    for (int k = 0; k < 3; k++)
        out_dir[k] = to[k] / d;
    float sent = -dot3(out_dir, place->normal);
    return sent > 0 ? surface_cosine(surface, out_dir) * sent / (d2 + place->radius2) : 0;
}

/** Traces the packet's n lanes, the places lane_light[]; marks those that are hidden. */
static bool flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                  uint8_t *hidden, uint64_t *rays)
{
    int n;
    uint32_t lanes = gn_packet_trace(frame, scratch, set, &n, rays);
    for (int i = 0; i < n; i++) {
        if (lanes >> i & 1)
            hidden[scratch->lane_light[i]] = 1;
    }
    return lanes != 0;
}

bool gn_places_find_hidden(const struct frame *frame, struct scratch *scratch,
                           const struct sample *s, enum gn_rt_set set, uint8_t *hidden,
                           uint64_t *rays)
{
    bool found = false;
    memset(hidden, 0, (size_t)frame->places->n);
    for (int i = 0; i < frame->places->n; i++) {
        float dir[3];
        float distance;
        if (!(aim(&frame->places->lights[i], &s->surface, s->org, dir, &distance) > 0))
            continue;
        if (frame->cull && set == GN_RT_VIRTUAL &&
            !gn_box_may_meet(&frame->virtual_box, s->org, dir))
            continue;
        if (gn_packet_add(scratch, s->org, dir, 0, i, 0, distance * (1 - STOP_SHORT)))
            found |= flush(frame, scratch, set, hidden, rays);
    }
    found |= flush(frame, scratch, set, hidden, rays);
    return found;
}

void gn_places_sum(const struct frame *frame, const struct sample *s, const uint8_t *hidden,
                   const uint8_t *cut, bool even, double sums[static 2][3])
{
    int i = 0;
    for (int p = 0; p < frame->blend.n; p++) {
        double weight = frame->blend.n > 1 ? (double)s->weights[p] : 1;
        for (; i < frame->places->ends[p]; i++) {
            const struct place *place = &frame->places->lights[i];
            float dir[3];
            float distance;
            double share = (double)aim(place, &s->surface, s->org, dir, &distance);
            if (!(share > 0) || hidden[i])
                continue;
            if (even)
                share /= (double)surface_cosine(&s->surface, dir);
            for (int k = 0; k < 3; k++) {
                sums[0][k] += weight * share * (double)place->intensity[k];
                sums[1][k] += cut[i] ? weight * share * (double)place->intensity[k] : 0;
            }
        }
    }
}

void gn_places_fill_cdf(struct places *places)
{
    double sum = 0;
    for (int i = 0; i < places->n; i++)
        places->cdf[i] = sum += gn_luminance(places->lights[i].intensity);
    for (int i = 0; i < places->n && sum > 0; i++)
        places->cdf[i] /= sum;
}

void gn_places_try(const struct frame *frame, const struct gn_surface *surface,
                   const float org[static 3], enum gn_rt_set set, double random,
                   double out_irradiance[static 3], uint64_t *rays)
{
    const struct places *places = frame->places;
    int lo = 0;
    int hi = places->n - 1;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (places->cdf[mid] > random)
            hi = mid;
        else
            lo = mid + 1;
    }
    float dir[3];
    float distance;
    double weights[GN_PROBES_MAX] = {1};
    double probability = places->cdf[lo] - (lo > 0 ? places->cdf[lo - 1] : 0);
    double share = (double)aim(&places->lights[lo], surface, org, dir, &distance);
    int probe = 0;
    memset(out_irradiance, 0, 3 * sizeof(*out_irradiance));
    if (!(share > 0) || !(probability > 0))
        return;
    ++*rays;
    if (gn_rt_is_occluded(frame->rt, set, org, dir, 0, distance * (1 - STOP_SHORT)))
        return;
    while (lo >= places->ends[probe])
        probe++;
    if (frame->blend.n > 1)
        gn_blend_get_weights(&frame->blend, surface->point, weights);
    for (int k = 0; k < 3; k++)
        out_irradiance[k] =
            weights[probe] * share * (double)places->lights[lo].intensity[k] / probability;
}
