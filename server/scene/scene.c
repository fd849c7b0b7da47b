/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/scene.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/pose.h"
#include "server/scene/emission.h"

// Reflectance of a diffuse object whose file and manifest say nothing.
#define DEFAULT_ALBEDO 0.5f

static void finish_objects(struct gn_scene_object *objects, int n_objects)
{
    for (int i = 0; i < n_objects; i++) {
        free(objects[i].name);
        free(objects[i].emission_stream);
        gn_mesh_finish(&objects[i].mesh);
    }
}

void gn_scene_destroy(struct gn_scene **scene)
{
    struct gn_scene *self = *scene;
    *scene = NULL;
    if (!self)
        return;
    gn_rt_destroy(&self->rt);
    if (self->objects)
        finish_objects(self->objects, self->n_objects);
    free(self->objects);
    free(self->lights);
    free(self);
}

static int check_material(const struct gn_scene_object *object, int index,
                          struct gn_error *out_error)
{
    if (object->role != GN_RT_REAL && object->role != GN_RT_VIRTUAL)
        return gn_error_set(out_error, -EINVAL, "object %d: its role is neither real nor virtual",
                            index);
    if (!object->has_material)
        return 0;
    if (object->material.type != GN_MATERIAL_DIFFUSE && object->material.type != GN_MATERIAL_MIRROR)
        return gn_error_set(out_error, -EINVAL, "object %d: unknown material type %d", index,
                            (int)object->material.type);
    for (int k = 0; k < 3; k++) {
        if (!(object->material.albedo[k] >= 0.0f && object->material.albedo[k] <= 1.0f))
            return gn_error_set(out_error, -EINVAL, "object %d: albedo must lie in [0, 1]", index);
    }
    return 0;
}

/** Inverse transpose of the 3x3 part; gn_rt_add_mesh has refused singular matrices. */
static void fill_normal_matrix(struct gn_scene_object *object)
{
    double inverse[16] = {0};
    if (!gn_mat4_invert(object->world_from_object, inverse))
        return;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            object->normal_matrix[3 * i + k] = inverse[4 * k + i];
    }
}

static int check_object(struct gn_scene_object *object, int index, struct gn_error *out_error)
{
    int ret = check_material(object, index, out_error);
    if (ret < 0)
        return ret;
    struct gn_error reason = {0};
    ret = gn_mesh_check(&object->mesh, NULL, &reason);
    if (ret < 0)
        return gn_error_set(out_error, ret, "object %d (%s): %s", index,
                            object->name ? object->name : "no name", reason.text);
    return gn_scene_check_emission(object, index, out_error);
}

static int check_emitter_count(const struct gn_scene_object *objects, int n_objects,
                               struct gn_error *out_error)
{
    int n = 0;
    for (int i = 0; i < n_objects; i++)
        n += gn_scene_is_emitter(&objects[i]);
    return n <= GN_SCENE_MAX_EMITTERS
               ? 0
               : gn_error_set(out_error, -E2BIG, "%d objects with emission; at most %d are taken",
                              n, GN_SCENE_MAX_EMITTERS);
}

static int add_object(struct gn_scene *scene, int index, struct gn_error *out_error)
{
    struct gn_scene_object *object = &scene->objects[index];
    struct gn_error reason = {0};
    int ret = gn_rt_add_mesh(scene->rt, object->role, (uint32_t)index, &object->mesh,
                             object->world_from_object, &reason);
    if (ret < 0)
        return gn_error_set(out_error, ret, "object %d (%s): %s", index,
                            object->name ? object->name : "no name", reason.text);
    fill_normal_matrix(object);
    int *count =
        object->role == GN_RT_REAL ? &scene->n_real_triangles : &scene->n_virtual_triangles;
    if (object->mesh.n_triangles > GN_SCENE_MAX_TRIANGLES - *count)
        return gn_error_set(out_error, -EFBIG, "more than %d triangles in one scene",
                            GN_SCENE_MAX_TRIANGLES);
    *count += object->mesh.n_triangles;
    return 0;
}

int gn_scene_create(struct gn_scene_object *objects, int n_objects, struct gn_pool *pool,
                    struct gn_scene **out_scene, struct gn_error *out_error)
{
    *out_scene = NULL;
    if (n_objects < 1 || n_objects > GN_SCENE_MAX_OBJECTS)
        return gn_error_set(out_error, -EINVAL, "%d objects; a scene has 1 to %d", n_objects,
                            GN_SCENE_MAX_OBJECTS);
    struct gn_scene *scene = calloc(1, sizeof(*scene));
    if (!scene)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int ret = gn_rt_create(&scene->rt, out_error);
    if (ret < 0)
        goto out;
    scene->objects = calloc((size_t)n_objects, sizeof(*scene->objects));
    if (!scene->objects) {
        ret = gn_error_set(out_error, -ENOMEM, "out of memory");
        goto out;
    }
    for (int i = 0; i < n_objects && ret == 0; i++)
        ret = check_object(&objects[i], i, out_error);
    if (ret == 0)
        ret = check_emitter_count(objects, n_objects, out_error);
    if (ret < 0)
        goto out;
    // A plain copy while it may still fail: the arrays stay the caller's till the end.
    memcpy(scene->objects, objects, (size_t)n_objects * sizeof(*objects));
    for (int i = 0; i < n_objects && ret == 0; i++)
        ret = add_object(scene, i, out_error);
    if (ret == 0)
        ret = gn_rt_commit(scene->rt, pool, out_error);
    if (ret < 0)
        goto out;
    scene->n_objects = n_objects;
    memset(objects, 0, (size_t)n_objects * sizeof(*objects));
    *out_scene = scene;
    scene = NULL;
out:
    gn_scene_destroy(&scene); // n_objects is still 0: nothing of the caller's is freed
    return ret;
}

static int check_light(const struct gn_scene_light *light, int index, struct gn_error *out_error)
{
    if (light->role != GN_RT_REAL && light->role != GN_RT_VIRTUAL)
        return gn_error_set(out_error, -EINVAL, "light %d: its role is neither real nor virtual",
                            index);
    if (!(light->radius >= 0.0f && light->radius <= (float)GN_RT_MAX_COORDINATE))
        return gn_error_set(out_error, -EINVAL, "light %d: radius must lie in [0, 1e11] m", index);
    for (int k = 0; k < 3; k++) {
        if (!(fabs(light->position[k]) <= GN_RT_MAX_COORDINATE))
            return gn_error_set(out_error, -EINVAL, "light %d: position must lie within 1e11 m",
                                index);
        if (!(light->intensity[k] >= 0.0f && light->intensity[k] <= (float)GN_SCENE_MAX_EMISSION))
            return gn_error_set(out_error, -EINVAL, "light %d: intensity must lie in [0, 1e12]",
                                index);
    }
    return 0;
}

int gn_scene_set_lights(struct gn_scene *scene, const struct gn_scene_light *lights, int n_lights,
                        struct gn_error *out_error)
{
    if (n_lights < 0 || n_lights > GN_SCENE_MAX_LIGHTS)
        return gn_error_set(out_error, -EINVAL, "%d lights; a scene has at most %d", n_lights,
                            GN_SCENE_MAX_LIGHTS);
    for (int i = 0; i < n_lights; i++) {
        int ret = check_light(&lights[i], i, out_error);
        if (ret < 0)
            return ret;
    }
    struct gn_scene_light *copy = NULL;
    if (n_lights > 0) {
        copy = malloc((size_t)n_lights * sizeof(*copy));
        if (!copy)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
        memcpy(copy, lights, (size_t)n_lights * sizeof(*copy));
    }
    free(scene->lights);
    scene->lights = copy;
    scene->n_lights = n_lights;
    return 0;
}

static float dot(const float a[static 3], const float b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The interpolated normal in world, unit; false where it has no direction. */
static bool get_shading_normal(const struct gn_scene_object *object, const struct gn_rt_hit *hit,
                               float out_normal[static 3])
{
    const struct gn_mesh *mesh = &object->mesh;
    if (!mesh->normals)
        return false;
    const uint32_t *index = mesh->triangles + 3 * (size_t)hit->triangle;
    const float weights[3] = {1.0f - hit->u - hit->v, hit->u, hit->v};
    double n[3] = {0};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            n[k] += (double)weights[i] * mesh->normals[3 * (size_t)index[i] + (size_t)k];
    }
    const double *m = object->normal_matrix;
    double world[3];
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        world[k] = m[3 * k] * n[0] + m[3 * k + 1] * n[1] + m[3 * k + 2] * n[2];
        sum += world[k] * world[k];
    }
    if (!(sum > 0.0))
        return false;
    double scale = 1.0 / sqrt(sum);
    for (int k = 0; k < 3; k++)
        out_normal[k] = (float)(world[k] * scale);
    return true;
}

static void get_uv(const struct gn_mesh *mesh, const struct gn_rt_hit *hit, float out_uv[static 2])
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)hit->triangle;
    for (int k = 0; k < 2 && mesh->uvs; k++)
        out_uv[k] = (1.0f - hit->u - hit->v) * mesh->uvs[2 * (size_t)index[0] + (size_t)k] +
                    hit->u * mesh->uvs[2 * (size_t)index[1] + (size_t)k] +
                    hit->v * mesh->uvs[2 * (size_t)index[2] + (size_t)k];
}

void gn_scene_get_surface(const struct gn_scene *scene, const float dir[static 3],
                          const struct gn_rt_hit *hit, struct gn_surface *out_surface)
{
    const struct gn_scene_object *object = &scene->objects[hit->object];
    struct gn_surface s = {
        .clearance = hit->clearance, .role = object->role, .object = hit->object};
    float side = dot(hit->normal, dir) > 0.0f ? -1.0f : 1.0f;
    s.is_front = side > 0.0f; // rt's normal is the outside's, also where the matrix mirrors
    get_uv(&object->mesh, hit, s.uv);
    for (int k = 0; k < 3; k++) {
        s.point[k] = hit->point[k];
        s.normal_geometric[k] = side * hit->normal[k];
    }
    memcpy(s.normal_shading, s.normal_geometric, sizeof(s.normal_shading));
    float shading[3];
    if (get_shading_normal(object, hit, shading)) {
        // To the side of the geometric normal: files have normals and windings that disagree.
        float same = dot(shading, s.normal_geometric) < 0.0f ? -1.0f : 1.0f;
        for (int k = 0; k < 3; k++)
            s.normal_shading[k] = same * shading[k];
    }
    const float *albedos = object->mesh.albedos;
    for (int k = 0; k < 3; k++) {
        s.albedo[k] = DEFAULT_ALBEDO;
        if (object->has_material)
            s.albedo[k] = object->material.albedo[k];
        else if (albedos)
            s.albedo[k] = albedos[3 * (size_t)hit->triangle + (size_t)k];
    }
    s.material = object->has_material ? object->material.type : GN_MATERIAL_DIFFUSE;
    *out_surface = s;
}
