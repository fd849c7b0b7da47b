/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * scene.json: {"objects": [{"mesh", "role", "name", "material", "world_from_object", "movable"}],
 * "lights": [...]}; materials are read in manifest_material.c, what sends light in
 * manifest_light.c.
 */
#include "server/scene/manifest.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/log.h"
#include "common/pose.h"

GN_LOG_TOPIC("scene");

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

// Longest "name".
#define MAX_NAME 255

/** path of the mesh: as it is where absolute, else beside the manifest. */
static int join_path(const char *manifest, const char *mesh, char out[static PATH_MAX])
{
    const char *slash = strrchr(manifest, '/');
    int n_folder = mesh[0] != '/' && slash ? (int)(slash - manifest) + 1 : 0;
    int n = snprintf(out, PATH_MAX, "%.*s%s", n_folder, manifest, mesh);
    return n < 0 || n >= PATH_MAX ? -ENAMETOOLONG : 0;
}

static int read_name(const struct gn_json *item, const char *mesh, struct gn_scene_object *object,
                     struct gn_error *out_error)
{
    const char *slash = strrchr(mesh, '/');
    const char *name = slash ? slash + 1 : mesh;
    int ret = 0;
    if (gn_json_has(item, "name"))
        ret = gn_json_get_string(item, "name", &name, out_error);
    if (ret < 0)
        return ret;
    if (!name[0] || strlen(name) > MAX_NAME)
        return gn_json_refuse(item, gn_json_has(item, "name") ? "name" : "mesh", out_error,
                              "a name has 1 to %d bytes", MAX_NAME);
    object->name = strdup(name);
    return object->name ? 0 : gn_error_set(out_error, -ENOMEM, "%s: out of memory", item->file);
}

static int read_transform(const struct gn_json *item, struct gn_scene_object *object,
                          struct gn_error *out_error)
{
    double *m = object->world_from_object;
    gn_mat4_identity(m);
    if (!gn_json_has(item, "world_from_object"))
        return 0;
    int ret = gn_json_get_numbers(item, "world_from_object", 16, m, out_error);
    if (ret < 0)
        return ret;
    double inverse[16];
    if (m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
        return gn_json_refuse(item, "world_from_object", out_error,
                              "row-major, so the last four numbers must be 0, 0, 0, 1");
    if (!gn_mat4_invert(m, inverse))
        return gn_json_refuse(item, "world_from_object", out_error, "the matrix is singular");
    return 0;
}

static int read_mesh(const struct gn_json *item, const char *mesh, struct gn_scene_object *object,
                     struct gn_error *out_error)
{
    char path[PATH_MAX];
    if (!mesh[0] || join_path(item->file, mesh, path) < 0)
        return gn_json_refuse(item, "mesh", out_error, "not a file's path");
    struct gn_error reason = {0};
    int ret = gn_mesh_read_file(path, &object->mesh, &reason);
    if (ret < 0) {
        (void)gn_json_refuse(item, "mesh", out_error, "%s", reason.text);
        return ret;
    }
    if (object->mesh.ignored)
        gn_log(GN_LOG_WARN, "%s: asks for what is not done: %s", path, object->mesh.ignored);
    return 0;
}

static int read_object(const struct gn_json *item, struct gn_scene_object *object,
                       struct gn_error *out_error)
{
    static const char *const keys[] = {"mesh",   "role", "name", "material", "world_from_object",
                                       "movable"};
    static const char *const roles[] = {"real", "virtual"};
    static const enum gn_rt_set role_sets[] = {GN_RT_REAL, GN_RT_VIRTUAL};
    const char *mesh = NULL;
    int role = 0;
    int ret = gn_json_check_keys(item, keys, LENGTH(keys), out_error);
    if (ret == 0)
        ret = gn_json_get_string(item, "mesh", &mesh, out_error);
    if (ret == 0)
        ret = gn_json_get_enum(item, "role", roles, LENGTH(roles), &role, out_error);
    if (ret == 0)
        ret = read_name(item, mesh, object, out_error);
    if (ret == 0)
        ret = gn_manifest_read_material(item, object, out_error);
    if (ret == 0)
        ret = read_transform(item, object, out_error);
    if (ret == 0 && gn_json_has(item, "movable"))
        ret = gn_json_get_bool(item, "movable", &object->is_movable, out_error);
    if (ret < 0)
        return ret;
    object->role = role_sets[role];
    return read_mesh(item, mesh, object, out_error); // last: the slow one
}

static int read_objects(const struct gn_json *array, struct gn_scene_object *objects, int n_objects,
                        struct gn_error *out_error)
{
    for (int i = 0; i < n_objects; i++) {
        struct gn_json item = {0};
        int ret = gn_json_get_item(array, (size_t)i, &item, out_error);
        if (ret == 0)
            ret = read_object(&item, &objects[i], out_error);
        if (ret < 0)
            return ret;
    }
    return 0;
}

int gn_scene_read_file(const char *path, struct gn_pool *pool, struct gn_scene **out_scene,
                       struct gn_error *out_error)
{
    static const char *const keys[] = {"objects", "lights", "model"};
    static const char *const models[] = {"local", "global"}; // as enum gn_scene_model
    int model = GN_MODEL_LOCAL;
    struct gn_json root = {0};
    struct gn_json array = {0};
    struct gn_scene_object *objects = NULL;
    struct gn_scene_light *lights = NULL;
    int n_objects = 0;
    int n_lights = 0;
    *out_scene = NULL;
    int ret = gn_json_load_file(path, &root, out_error);
    if (ret == 0)
        ret = gn_json_check_keys(&root, keys, LENGTH(keys), out_error);
    if (ret == 0)
        ret = gn_manifest_read_lights(&root, &lights, &n_lights, out_error);
    if (ret == 0 && gn_json_has(&root, "model"))
        ret = gn_json_get_enum(&root, "model", models, LENGTH(models), &model, out_error);
    if (ret == 0)
        ret = gn_json_get_array(&root, "objects", 1, GN_SCENE_MAX_OBJECTS, &array, out_error);
    if (ret < 0)
        goto out;
    n_objects = (int)json_array_size(array.value);
    objects = calloc((size_t)n_objects, sizeof(*objects));
    if (!objects) {
        ret = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
        goto out;
    }
    ret = read_objects(&array, objects, n_objects, out_error);
    if (ret < 0)
        goto out;
    struct gn_error reason = {0};
    ret = gn_scene_create(objects, n_objects, pool, out_scene, &reason);
    if (ret == 0)
        ret = gn_scene_set_lights(*out_scene, lights, n_lights, &reason);
    if (ret == 0)
        ret = gn_scene_set_model(*out_scene, (enum gn_scene_model)model, &reason);
    if (ret < 0)
        gn_scene_destroy(out_scene);
    if (ret < 0)
        (void)gn_error_set(out_error, ret, "%s: %s", path, reason.text);
out:
    for (int i = 0; objects && i < n_objects; i++) { // zeroed where the scene took them
        free(objects[i].name);
        free(objects[i].emission_stream);
        gn_mesh_finish(&objects[i].mesh);
    }
    free(objects);
    free(lights);
    gn_json_finish(&root);
    return ret;
}
