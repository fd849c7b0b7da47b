/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/scene.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/pose.h"
#include "server/scene/emission.h"
#include "server/scene/motion.h"

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
    free(self->movable);
    free(self);
}

static int check_material(struct gn_scene_object *object, int index, struct gn_error *out_error)
{
    struct gn_error reason = {0};
    if (object->role != GN_RT_REAL && object->role != GN_RT_VIRTUAL)
        return gn_error_set(out_error, -EINVAL, "object %d: its role is neither real nor virtual",
                            index);
    if (object->has_material && gn_material_check(&object->material, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "object %d: %s", index, reason.text);
    return 0;
}

/** Inverse transpose of the 3x3 part; gn_rt_add_mesh has refused singular matrices. */
void gn_scene_fill_normal_matrix(struct gn_scene_object *object)
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

/** Bits of the types that the object's triangles are of. */
static unsigned get_types(const struct gn_scene_object *object)
{
    const struct gn_mesh *mesh = &object->mesh;
    unsigned types = 0;
    if (object->has_material)
        return 1u << object->material.type;
    if (!mesh->material)
        return 1u << GN_MATERIAL_DIFFUSE;
    for (int i = 0; i < mesh->n_triangles; i++)
        types |= 1u << mesh->materials[mesh->material[i]].factors.type;
    return types;
}

static int add_object(struct gn_scene *scene, int index, struct gn_error *out_error)
{
    struct gn_scene_object *object = &scene->objects[index];
    struct gn_error reason = {0};
    int ret = object->is_movable ? gn_motion_split_matrix(object, &reason) : 0;
    if (ret == 0)
        ret = object->is_movable
                  ? gn_rt_add_mover(scene->rt, object->role, (uint32_t)index, &object->mesh,
                                    object->object_from_mesh, &object->pose, &reason)
                  : gn_rt_add_mesh(scene->rt, object->role, (uint32_t)index, &object->mesh,
                                   object->world_from_object, &reason);
    if (ret < 0)
        return gn_error_set(out_error, ret, "object %d (%s): %s", index,
                            object->name ? object->name : "no name", reason.text);
    gn_scene_fill_normal_matrix(object);
    unsigned *types =
        object->role == GN_RT_REAL ? &scene->real_materials : &scene->virtual_materials;
    *types |= get_types(object);
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
    ret = gn_motion_list_movable(scene, n_objects, out_error);
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

int gn_scene_set_model(struct gn_scene *scene, enum gn_scene_model model,
                       struct gn_error *out_error)
{
    for (int i = 0; i < scene->n_movable && model == GN_MODEL_GLOBAL; i++) {
        const struct gn_scene_object *object = &scene->objects[scene->movable[i]];
        if (object->role == GN_RT_REAL)
            return gn_error_set(out_error, -EINVAL,
                                "object %d (%s): real objects cannot move in the global model, "
                                "where their light starts at them: take \"local\"",
                                scene->movable[i], object->name);
    }
    scene->model = model;
    return 0;
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
