/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/emitters.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/vec.h"

int gn_rig_emitters_add(struct gn_rig_emitters *emitters, const struct gn_rig_emitter *emitter)
{
    size_t n = (size_t)emitters->n;
    struct gn_rig_emitter e = *emitter, *list = realloc(emitters->list, (n + 1) * sizeof(*list));
    double sides[2][3];
    if (!list)
        return -ENOMEM;
    emitters->list = list;
    double *cdf = realloc(emitters->cdf, (n + 1) * sizeof(*cdf));
    if (!cdf)
        return -ENOMEM;
    emitters->cdf = cdf;
    vec_subtract(e.corners[1], e.corners[0], sides[0]);
    vec_subtract(e.corners[2], e.corners[0], sides[1]);
    vec_cross(sides[0], sides[1], e.normal);
    e.area = vec_length(e.normal) / 2;
    vec_normalize(e.normal);
    list[n] = e;
    cdf[n] = (n ? cdf[n - 1] : 0) + e.area * (e.emission[0] + e.emission[1] + e.emission[2]);
    emitters->n++;
    return 0;
}

void gn_rig_emitters_finish(struct gn_rig_emitters *emitters)
{
    free(emitters->list);
    free(emitters->cdf);
    memset(emitters, 0, sizeof(*emitters));
}

/* Radiance of a point with unit normal, chosen with that density over the area, as the light of a
 * sample: radiance cos / (distance^2 density). */
static bool see_point(const double from[static 3], const double at[static 3],
                      const double normal[static 3], const double radiance[static 3],
                      double density, struct gn_rig_near_sample *out_sample)
{
    vec_subtract(at, from, out_sample->dir);
    out_sample->distance = vec_length(out_sample->dir);
    vec_normalize(out_sample->dir);
    double cosine = -vec_dot(normal, out_sample->dir);
    if (!(cosine > 0) || !(out_sample->distance > 0))
        return false;
    vec_scale(radiance, cosine / (out_sample->distance * out_sample->distance * density),
              out_sample->given);
    return true;
}

bool gn_rig_emitters_sample(const struct gn_rig_emitters *emitters, const double point[static 3],
                            const double uv[static 2], struct gn_rig_near_sample *out_sample)
{
    double total = emitters->n > 0 ? emitters->cdf[emitters->n - 1] : 0, at[3];
    int i = 0;
    if (!(total > 0))
        return false;
    while (i < emitters->n - 1 && emitters->cdf[i] <= uv[0] * total)
        i++;
    const struct gn_rig_emitter *e = &emitters->list[i];
    double before = i > 0 ? emitters->cdf[i - 1] : 0, share = emitters->cdf[i] - before;
    // Evenly over a triangle: Turk, "Generating random points in triangles", Graphics Gems, 1990.
    double root = sqrt((uv[0] * total - before) / share);
    for (int k = 0; k < 3; k++)
        at[k] = (1 - root) * e->corners[0][k] + root * (1 - uv[1]) * e->corners[1][k] +
                root * uv[1] * e->corners[2][k];
    out_sample->is_virtual = e->is_virtual;
    return see_point(point, at, e->normal, e->emission, share / (total * e->area), out_sample);
}

bool gn_rig_lamp_sample(const struct gn_rig_lamp *lamp, const double point[static 3],
                        const double uv[static 2], struct gn_rig_near_sample *out_sample)
{
    out_sample->is_virtual = lamp->is_virtual;
    if (lamp->radius == 0) {
        vec_subtract(lamp->position, point, out_sample->dir);
        out_sample->distance = vec_length(out_sample->dir);
        vec_normalize(out_sample->dir);
        vec_scale(lamp->intensity, 1 / (out_sample->distance * out_sample->distance),
                  out_sample->given);
        return out_sample->distance > 0;
    }
    // A sphere of radiance I / (pi r^2), its points with density 1 / (4 pi r^2).
    double z = 1 - 2 * uv[0], r = sqrt(fmax(0, 1 - z * z)), phi = 2 * GN_RIG_PI * uv[1], at[3];
    double area = GN_RIG_PI * lamp->radius * lamp->radius, radiance[3];
    const double normal[3] = {r * cos(phi), r * sin(phi), z};
    for (int k = 0; k < 3; k++)
        at[k] = lamp->position[k] + lamp->radius * normal[k];
    vec_scale(lamp->intensity, 1 / area, radiance);
    return see_point(point, at, normal, radiance, 1 / (4 * area), out_sample);
}
