/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "server/light/emitters.h"
#include "server/light/emitters_internal.h"

void gn_emission_picture_unref(struct gn_emission_picture **picture)
{
    struct gn_emission_picture *p = *picture;
    *picture = NULL;
    if (!p || atomic_fetch_sub_explicit(&p->references, 1, memory_order_acq_rel) != 1)
        return;
    gn_image_finish(&p->image);
    free(p);
}

struct gn_emission *gn_emission_ref(struct gn_emission *emission)
{
    atomic_fetch_add_explicit(&emission->references, 1, memory_order_relaxed);
    return emission;
}

void gn_emission_unref(struct gn_emission **emission)
{
    struct gn_emission *e = *emission;
    *emission = NULL;
    if (!e || atomic_fetch_sub_explicit(&e->references, 1, memory_order_acq_rel) != 1)
        return;
    for (int i = 0; i < e->n_objects && e->pictures; i++)
        gn_emission_picture_unref(&e->pictures[i]);
    free(e->pictures);
    free(e->lights);
    free(e);
}

/** Bilinear between pixel centres, held at the edges. */
static void look_up(const struct gn_image *image, const float uv[static 2], float out[static 3])
{
    float x = fminf(fmaxf(uv[0], 0), 1) * (float)image->width - 0.5f;
    float y = (1 - fminf(fmaxf(uv[1], 0), 1)) * (float)image->height - 0.5f;
    float at_x = floorf(x);
    float at_y = floorf(y);
    for (int k = 0; k < 3; k++)
        out[k] = 0;
    for (int i = 0; i < 4; i++) {
        int px = (int)at_x + i % 2;
        int py = (int)at_y + i / 2;
        float weight = (i % 2 ? x - at_x : 1 - (x - at_x)) * (i / 2 ? y - at_y : 1 - (y - at_y));
        px = px < 0 ? 0 : px >= image->width ? image->width - 1 : px;
        py = py < 0 ? 0 : py >= image->height ? image->height - 1 : py;
        const float *p = gn_image_at(image, px, py);
        for (int k = 0; k < 3; k++)
            out[k] += weight * p[k];
    }
}

void gn_emission_get_radiance(const struct gn_emission *emission, const struct gn_scene *scene,
                              const struct gn_surface *surface, float out_radiance[static 3])
{
    const struct gn_scene_object *object = &scene->objects[surface->object];
    const struct gn_emission_picture *picture =
        emission && object->emission_stream ? emission->pictures[surface->object] : NULL;
    for (int k = 0; k < 3; k++)
        out_radiance[k] = surface->is_front ? object->emission[k] : 0;
    if (!picture || !surface->is_front)
        return;
    look_up(&picture->image, surface->uv, out_radiance);
    for (int k = 0; k < 3; k++)
        out_radiance[k] *= object->emission_scale;
}
