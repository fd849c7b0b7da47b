/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/room.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/vec.h"

int gn_rig_room_add(struct gn_rig_room *room, struct gn_rig_object *object)
{
    if (room->n_objects == GN_RIG_MAX_OBJECTS)
        return -ENOSPC;
    room->objects[room->n_objects++] = *object;
    memset(&object->mesh, 0, sizeof(object->mesh));
    return 0;
}

/* Takes the object's triangles as emitters. */
static int add_emitters(struct gn_rig_emitters *emitters, const struct gn_rig_object *o)
{
    struct gn_rig_emitter e = {.is_virtual = o->role == GN_RT_VIRTUAL};
    const double *m = o->world_from_object;
    int result = 0;
    memcpy(e.emission, o->emission, sizeof(e.emission));
    if (!(e.emission[0] + e.emission[1] + e.emission[2] > 0))
        return 0;
    for (int t = 0; result == 0 && t < o->mesh.n_triangles; t++) {
        for (int i = 0; i < 3; i++) {
            const float *p = o->mesh.positions + 3 * (size_t)o->mesh.triangles[3 * t + i];
            for (int k = 0; k < 3; k++)
                e.corners[i][k] =
                    m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3];
        }
        result = gn_rig_emitters_add(emitters, &e);
    }
    return result;
}

int gn_rig_room_commit(struct gn_rig_room *room, struct gn_pool *pool, struct gn_error *out_error)
{
    int result = gn_rt_create(&room->rt, out_error);
    for (int i = 0; result == 0 && i < room->n_objects; i++) {
        struct gn_rig_object *o = &room->objects[i];
        if (o->finish == GN_RIG_GGX && !o->gloss &&
            !(o->gloss = gn_rig_gloss_create(o->roughness, o->metallic, o->ior)))
            return gn_error_set(out_error, -ENOMEM, "rig: no memory for a finish");
        result = gn_rt_add_mesh(room->rt, o->role, (uint32_t)i, &o->mesh, o->world_from_object,
                                out_error);
        if (result == 0 && add_emitters(&room->emitters, o) != 0)
            result = gn_error_set(out_error, -ENOMEM, "rig: no memory for the emitters");
    }
    return result ? result : gn_rt_commit(room->rt, pool, out_error);
}

void gn_rig_room_finish(struct gn_rig_room *room)
{
    for (int i = 0; i < room->n_objects; i++) {
        gn_mesh_finish(&room->objects[i].mesh);
        free(room->objects[i].gloss);
    }
    gn_rt_destroy(&room->rt);
    gn_rig_emitters_finish(&room->emitters);
    memset(room, 0, sizeof(*room));
}

int gn_rig_room_count_triangles(const struct gn_rig_room *room)
{
    int sum = 0;
    for (int i = 0; i < room->n_objects; i++)
        sum += room->objects[i].mesh.n_triangles;
    return sum;
}

/* The interpolated normal in world coordinates. The matrix turns and scales alike, so its 3x3 part
 * turns normals too. */
static void get_shading_normal(const struct gn_rig_object *object, const struct gn_rt_hit *hit,
                               double out_normal[static 3])
{
    const uint32_t *tri = object->mesh.triangles + 3 * (size_t)hit->triangle;
    const double weight[3] = {1.0 - hit->u - hit->v, hit->u, hit->v},
                 *m = object->world_from_object;
    double n[3] = {0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            n[k] += weight[i] * object->mesh.normals[3 * (size_t)tri[i] + (size_t)k];
    for (int k = 0; k < 3; k++)
        out_normal[k] = m[4 * k] * n[0] + m[4 * k + 1] * n[1] + m[4 * k + 2] * n[2];
    vec_normalize(out_normal);
}

/* How far the point lies under each corner's tangent plane, taken back along that corner's normal,
 * weighed as the point weighs the corners (Hanika, Ray Tracing Gems II, 2021, chapter 4). */
static void get_lift(const struct gn_rig_object *object, const struct gn_rt_hit *hit, double side,
                     double out_lift[static 3])
{
    const double *m = object->world_from_object;
    const double share[3] = {1.0 - hit->u - hit->v, hit->u, hit->v};
    double corner[3][3], normal[3][3], point[3] = {0};
    for (int i = 0; i < 3; i++) {
        size_t v = 3 * (size_t)object->mesh.triangles[3 * (size_t)hit->triangle + (size_t)i];
        for (int k = 0; k < 3; k++) {
            corner[i][k] = normal[i][k] = 0;
            for (int j = 0; j < 3; j++) {
                corner[i][k] += m[4 * k + j] * object->mesh.positions[v + (size_t)j];
                normal[i][k] += side * m[4 * k + j] * object->mesh.normals[v + (size_t)j];
            }
            point[k] += share[i] * corner[i][k];
        }
        vec_normalize(normal[i]);
    }
    for (int i = 0; i < 3; i++) {
        double under = 0;
        for (int k = 0; k < 3; k++)
            under += (corner[i][k] - point[k]) * normal[i][k];
        for (int k = 0; k < 3 && under > 0; k++)
            out_lift[k] += share[i] * under * normal[i][k];
    }
}

void gn_rig_room_get_surface(const struct gn_rig_room *room, const double dir[static 3],
                             const struct gn_rt_hit *hit, struct gn_rig_surface *out_surface)
{
    const struct gn_rig_object *object = &room->objects[hit->object];
    struct gn_rig_surface s = {.clearance = hit->clearance,
                               .is_mirror = object->finish == GN_RIG_MIRROR,
                               .is_glass = object->finish == GN_RIG_GLASS,
                               .is_front = true,
                               .ior = object->ior,
                               .gloss = object->gloss,
                               .is_virtual = object->role == GN_RT_VIRTUAL};
    for (int k = 0; k < 3; k++) {
        s.point[k] = hit->point[k];
        s.normal_geometric[k] = hit->normal[k];
        s.albedo[k] = object->mesh.albedos
                          ? object->mesh.albedos[3 * (size_t)hit->triangle + (size_t)k]
                          : object->albedo[k];
    }
    gn_rig_finish_get_albedo(object->finish, s.point, s.albedo);
    s.is_front = vec_dot(s.normal_geometric, dir) <= 0;
    if (!s.is_front)
        vec_scale(s.normal_geometric, -1, s.normal_geometric);
    else
        memcpy(s.emission, object->emission, sizeof(s.emission));
    memcpy(s.normal_shading, s.normal_geometric, sizeof(s.normal_shading));
    if (object->mesh.normals) {
        get_shading_normal(object, hit, s.normal_shading);
        double side = vec_dot(s.normal_shading, s.normal_geometric) < 0 ? -1 : 1;
        vec_scale(s.normal_shading, side, s.normal_shading);
        get_lift(object, hit, side, s.lift);
    }
    *out_surface = s;
}
