/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Movable objects for conservative tests: boxes in mesh coordinates, taken to where they stand.
 */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void gn_box_grow(struct box *box, const float p[static 3])
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = fminf(box->min[k], p[k]);
        box->max[k] = fmaxf(box->max[k], p[k]);
    }
}

int gn_movers_make(const struct gn_scene *scene, enum gn_rt_set role, struct movers *out)
{
    memset(out, 0, sizeof(*out));
    for (int i = 0; i < MAX_CLUSTERS; i++)
        out->resting[i] = EMPTY_BOX;
    if (scene->n_movable == 0)
        return 0;
    out->mover = malloc((size_t)scene->n_movable * sizeof(*out->mover));
    if (!out->mover)
        return -ENOMEM;
    for (int i = 0; i < scene->n_movable; i++) {
        const struct gn_scene_object *object = &scene->objects[scene->movable[i]];
        struct mover mover = {.object = scene->movable[i], .group = -1, .own = EMPTY_BOX};
        if (object->role != role)
            continue;
        for (int v = 0; v < object->mesh.n_vertices; v++)
            gn_box_grow(&mover.own, object->mesh.positions + 3 * (size_t)v);
        out->mover[out->n++] = mover;
    }
    return 0;
}

void gn_movers_finish(struct movers *movers)
{
    free(movers->mover);
    movers->mover = NULL;
    movers->n = 0;
}

int gn_movers_find(const struct movers *movers, int object)
{
    for (int i = 0; i < movers->n; i++) {
        if (movers->mover[i].object == object)
            return i;
    }
    return -1;
}

void gn_movers_get_vertex(const struct gn_scene_object *object, const float p[static 3],
                          float out[static 3])
{
    const double *m = object->world_from_object;
    for (int k = 0; k < 3; k++) {
        const double *row = m + 4 * k;
        out[k] = (float)(row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
    }
}

float gn_movers_grow_box(const struct mover *mover, const struct gn_scene *scene, struct box *box)
{
    struct box world = EMPTY_BOX;
    float reach = 0;
    for (int corner = 0; corner < 8; corner++) {
        float p[3];
        float q[3];
        for (int k = 0; k < 3; k++)
            p[k] = corner >> k & 1 ? mover->own.max[k] : mover->own.min[k];
        gn_movers_get_vertex(&scene->objects[mover->object], p, q);
        gn_box_grow(&world, q);
        for (int k = 0; k < 3; k++)
            reach = fmaxf(reach, fabsf(q[k]));
    }
    // What is traced, and these corners themselves, are that well rounded.
    float slack = 2 * GN_RT_MOVED_ROUNDING * reach;
    for (int k = 0; k < 3; k++) {
        box->min[k] = fminf(box->min[k], world.min[k] - slack);
        box->max[k] = fmaxf(box->max[k], world.max[k] + slack);
    }
    return slack;
}
