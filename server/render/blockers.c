/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>

/** World box of an object's vertices, rounded as rt rounds them. */
static void grow_by_object(const struct gn_scene_object *object, struct box *box)
{
    const double *m = object->world_from_object;
    for (int i = 0; i < object->mesh.n_vertices; i++) {
        const float *p = object->mesh.positions + 3 * (size_t)i;
        for (int k = 0; k < 3; k++) {
            const double *row = m + 4 * k;
            float x = (float)(row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
            box->min[k] = fminf(box->min[k], x);
            box->max[k] = fmaxf(box->max[k], x);
        }
    }
}

int gn_blockers_make(const struct gn_scene *scene, struct box out_boxes[static MAX_BLOCKERS])
{
    int n_real = 0;
    for (int i = 0; i < scene->n_objects; i++)
        n_real += scene->objects[i].role == GN_RT_REAL;
    int n = n_real < MAX_BLOCKERS ? n_real : MAX_BLOCKERS;
    for (int i = 0; i < n; i++)
        out_boxes[i] =
            (struct box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0, real = 0; i < scene->n_objects; i++) {
        if (scene->objects[i].role != GN_RT_REAL)
            continue;
        // More objects than boxes: neighbours in the list share one.
        grow_by_object(&scene->objects[i], &out_boxes[(int64_t)real * n / n_real]);
        real++;
    }
    return n;
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
