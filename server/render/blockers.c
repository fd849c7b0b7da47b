/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>

int gn_blockers_make(const struct gn_scene *scene, struct blockers *out)
{
    struct movers *movers = &out->movers;
    int n_real = 0;
    int ret = gn_movers_make(scene, GN_RT_REAL, movers);
    for (int i = 0; i < scene->n_objects; i++)
        n_real += scene->objects[i].role == GN_RT_REAL;
    out->n = n_real < MAX_BLOCKERS ? n_real : MAX_BLOCKERS;
    for (int i = 0, real = 0; i < scene->n_objects && ret == 0; i++) {
        const struct gn_scene_object *object = &scene->objects[i];
        if (object->role != GN_RT_REAL)
            continue;
        // More objects than boxes: neighbours in the list share one.
        int group = (int)((int64_t)real++ * out->n / n_real);
        if (object->is_movable)
            movers->mover[gn_movers_find(movers, i)].group = group;
        for (int v = 0; v < object->mesh.n_vertices && !object->is_movable; v++) {
            float p[3];
            gn_movers_get_vertex(object, object->mesh.positions + 3 * (size_t)v, p);
            gn_box_grow(&movers->resting[group], p);
        }
    }
    if (ret == 0)
        gn_blockers_pose(out, scene);
    return ret;
}

void gn_blockers_finish(struct blockers *blockers)
{
    gn_movers_finish(&blockers->movers);
}

void gn_blockers_pose(struct blockers *blockers, const struct gn_scene *scene)
{
    const struct movers *movers = &blockers->movers;
    for (int i = 0; i < blockers->n; i++)
        blockers->boxes[i] = movers->resting[i];
    for (int i = 0; i < movers->n; i++)
        (void)gn_movers_grow_box(&movers->mover[i], scene,
                                 &blockers->boxes[movers->mover[i].group]);
}

/** True where the box lies under the planes through all wanted receivers' ray origins: no ray that
 * leaves upwards meets it. */
static bool is_box_under(const struct receivers *r, const struct box *box)
{
    for (int j = 0; j < r->n; j++) {
        if (!(r->wanted[j / LANES] >> (j % LANES) & 1))
            continue;
        double highest = 0;
        for (int k = 0; k < 3; k++) {
            double n = r->geometric[k][j];
            highest += n * ((double)(n > 0 ? box->max[k] : box->min[k]) - r->org[k][j]);
        }
        if (highest > 0)
            return false;
    }
    return true;
}

int gn_blockers_list_above(const struct frame *frame, const struct receivers *receivers,
                           const struct box *out_boxes[static MAX_BLOCKERS])
{
    int n = 0;
    for (int i = 0; i < frame->n_blockers; i++) {
        if (!is_box_under(receivers, &frame->blockers[i]))
            out_boxes[n++] = &frame->wide_blockers[i];
    }
    return n;
}
