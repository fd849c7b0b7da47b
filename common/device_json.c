/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/device_json.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "common/image.h"

/*
 * Keeps a table for the rest of the process: responses are values that are copied at will and only
 * borrow it. The same numbers are kept once, so that reading a file again costs nothing.
 */
static int keep_table(const struct gn_json *object, float *table, int n,
                      struct gn_response *out_response, struct gn_error *out_error)
{
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    static struct {
        float *values;
        int n;
    } kept[GN_RESPONSE_JSON_TABLES]; // guarded by mutex; what the values say never changes
    int i = 0, err = 0;
    pthread_mutex_lock(&mutex);
    while (i < GN_RESPONSE_JSON_TABLES && kept[i].values &&
           !(kept[i].n == n && memcmp(kept[i].values, table, (size_t)n * sizeof(*table)) == 0))
        i++;
    if (i == GN_RESPONSE_JSON_TABLES) {
        err = -E2BIG;
    } else if (!kept[i].values) {
        kept[i].values = table;
        kept[i].n = n;
        table = NULL;
    }
    if (!err) {
        out_response->table = kept[i].values;
        out_response->table_size = n;
    }
    pthread_mutex_unlock(&mutex);
    free(table);
    return err ? gn_error_set(out_error, err, "%s: more than %d different response tables",
                              object->file, GN_RESPONSE_JSON_TABLES)
               : 0;
}

static int read_table(const struct gn_json *object, struct gn_response *out,
                      struct gn_error *out_error)
{
    struct gn_json array;
    int ret = gn_json_get_array(object, "table", 2, 4096, &array, out_error);
    if (ret < 0)
        return ret;
    size_t n = json_array_size(array.value);
    double *numbers = malloc(n * sizeof(*numbers));
    float *table = malloc(n * sizeof(*table));
    if (!numbers || !table)
        ret = gn_error_set(out_error, -ENOMEM, "%s: out of memory", object->file);
    if (ret == 0)
        ret = gn_json_get_numbers(object, "table", n, numbers, out_error);
    struct gn_response tried = {.type = GN_RESPONSE_TABLE, .table = table, .table_size = (int)n};
    const char *reason = NULL;
    for (size_t i = 0; ret == 0 && i < n; i++)
        table[i] = (float)numbers[i];
    if (ret == 0 && gn_response_check(&tried, &reason) < 0)
        ret = gn_json_refuse(object, "table", out_error, "%s", reason);
    free(numbers);
    if (ret == 0)
        return keep_table(object, table, (int)n, out, out_error);
    free(table);
    return ret;
}

static int read_curve(const struct gn_json *root, struct gn_response *out,
                      struct gn_error *out_error)
{
    /* The types that a file can describe; their order is the enum's. */
    static const char *const types[] = {"linear", "srgb", "gamma", "log", "table"};
    static const char *const keys[][4] = {
        {"type"}, {"type"}, {"type", "gamma"}, {"type", "a", "b", "c"}, {"type", "table"}};
    static const size_t n_keys[] = {1, 1, 2, 4, 2};
    struct gn_json object;
    int type = 0;
    int ret = gn_json_get_object(root, "response", &object, out_error);
    if (ret == 0)
        ret = gn_json_get_enum(&object, "type", types, GN_ARRAY_LEN(types), &type, out_error);
    if (ret < 0)
        return ret;
    out->type = (enum gn_response_type)type;
    ret = gn_json_check_keys(&object, keys[type], n_keys[type], out_error);
    if (ret == 0 && out->type == GN_RESPONSE_GAMMA)
        ret = gn_json_get_double(&object, "gamma", 0.1, 10.0, &out->gamma, out_error);
    if (ret == 0 && out->type == GN_RESPONSE_TABLE)
        ret = read_table(&object, out, out_error);
    if (ret < 0 || out->type != GN_RESPONSE_LOG)
        return ret;
    ret = gn_json_get_double(&object, "a", -1e6, 1e6, &out->log_a, out_error);
    if (ret == 0)
        ret = gn_json_get_double(&object, "b", DBL_MIN, 1e6, &out->log_b, out_error);
    if (ret == 0)
        ret = gn_json_get_double(&object, "c", 0.0, 1e6, &out->log_c, out_error);
    return ret;
}

static int read_intrinsics(const struct gn_json *root, struct gn_camera *out,
                           struct gn_error *out_error)
{
    int ret = gn_json_get_int(root, "width", 1, GN_IMAGE_MAX_SIDE, &out->width, out_error);
    if (ret == 0)
        ret = gn_json_get_int(root, "height", 1, GN_IMAGE_MAX_SIDE, &out->height, out_error);
    if (ret == 0)
        ret = gn_json_get_double(root, "fx", 1e-6, 1e6, &out->fx, out_error);
    if (ret == 0)
        ret = gn_json_get_double(root, "fy", 1e-6, 1e6, &out->fy, out_error);
    if (ret == 0)
        ret = gn_json_get_double(root, "cx", -1e6, 1e6, &out->cx, out_error);
    if (ret == 0)
        ret = gn_json_get_double(root, "cy", -1e6, 1e6, &out->cy, out_error);
    if (ret == 0)
        ret = gn_json_get_numbers(root, "distortion", 5, out->distortion, out_error);
    return ret;
}

int gn_response_read_json(const struct gn_json *object, struct gn_response *response,
                          struct gn_error *out_error)
{
    struct gn_response r = *response;
    int ret = 0;
    if (gn_json_has(object, "response"))
        ret = read_curve(object, &r, out_error);
    if (ret == 0 && gn_json_has(object, "to_rec709"))
        ret = gn_json_get_numbers(object, "to_rec709", 9, r.to_rec709, out_error);
    if (ret == 0 && gn_json_has(object, "scale"))
        ret = gn_json_get_double(object, "scale", 1e-12, 1e12, &r.scale, out_error);
    const char *reason = NULL;
    if (ret == 0 && gn_response_check(&r, &reason) < 0)
        ret = gn_json_refuse(object, "response", out_error, "%s", reason);
    if (ret == 0)
        *response = r;
    return ret;
}

int gn_pose_read_json(const struct gn_json *object, const char *key, struct gn_pose *out_pose,
                      struct gn_error *out_error)
{
    double m[16];
    const char *reason = NULL;
    int ret = gn_json_get_numbers(object, key, 16, m, out_error);
    if (ret == 0 && gn_pose_from_matrix(m, out_pose, &reason) < 0)
        ret = gn_json_refuse(object, key, out_error, "not a pose: %s", reason);
    return ret;
}

/* noise {slope [3], offset [3]} and blur. */
static int read_match(const struct gn_json *object, struct gn_match *out,
                      struct gn_error *out_error)
{
    static const char *const keys[] = {"slope", "offset"};
    struct gn_json noise;
    int ret = 0;
    if (gn_json_has(object, "noise")) {
        ret = gn_json_get_object(object, "noise", &noise, out_error);
        if (ret == 0)
            ret = gn_json_check_keys(&noise, keys, GN_ARRAY_LEN(keys), out_error);
        if (ret == 0 && gn_json_has(&noise, "slope"))
            ret = gn_json_get_numbers(&noise, "slope", 3, out->noise_slope, out_error);
        if (ret == 0 && gn_json_has(&noise, "offset"))
            ret = gn_json_get_numbers(&noise, "offset", 3, out->noise_offset, out_error);
        const char *reason = NULL;
        if (ret == 0 && gn_match_check(out, &reason) < 0)
            ret = gn_json_refuse(object, "noise", out_error, "%s", reason);
    }
    if (ret == 0 && gn_json_has(object, "blur"))
        ret = gn_json_get_double(object, "blur", 0, GN_MATCH_MAX_BLUR_PX, &out->blur_px, out_error);
    return ret;
}

int gn_camera_read_json(const struct gn_json *object, bool needs_pose, struct gn_camera *out_camera,
                        struct gn_error *out_error)
{
    static const char *const keys[] = {"width",
                                       "height",
                                       "fx",
                                       "fy",
                                       "cx",
                                       "cy",
                                       "response",
                                       "to_rec709",
                                       "scale",
                                       "noise",
                                       "blur",
                                       "distortion",
                                       "world_from_camera"};
    struct gn_camera camera = {.response = {.type = GN_RESPONSE_SRGB},
                               .world_from_camera = {.rotation = {1.0}}};
    int ret = gn_json_check_keys(object, keys, GN_ARRAY_LEN(keys), out_error);
    if (ret == 0 && !needs_pose && gn_json_has(object, "world_from_camera"))
        ret = gn_json_refuse(object, "world_from_camera", out_error,
                             "not here: each frame says its own");
    if (ret == 0)
        ret = read_intrinsics(object, &camera, out_error);
    if (ret == 0 && needs_pose)
        ret = gn_pose_read_json(object, "world_from_camera", &camera.world_from_camera, out_error);
    if (ret == 0)
        ret = gn_response_read_json(object, &camera.response, out_error);
    if (ret == 0)
        ret = read_match(object, &camera.match, out_error);
    const char *reason = NULL;
    if (ret == 0 && gn_camera_check(&camera, &reason) < 0)
        ret = gn_json_refuse(object, NULL, out_error, "%s", reason);
    if (ret == 0)
        *out_camera = camera;
    return ret;
}

void gn_probe_setup_init(struct gn_probe_setup *setup)
{
    memset(setup, 0, sizeof(*setup));
    setup->projection.type = GN_PROJECTION_LATLONG;
    setup->world_from_probe.rotation[0] = 1.0;
}

static int read_vignetting(const struct gn_json *object, struct gn_projection *out,
                           struct gn_error *out_error)
{
    int ret = gn_json_get_numbers(object, "vignetting", 3, out->vignetting, out_error);
    if (ret == 0 && !gn_projection_is_radial(out->type))
        ret = gn_json_refuse(object, "vignetting", out_error,
                             "only fisheyes, angular maps and mirror balls have a circle to fall "
                             "off in, not %s",
                             gn_projection_get_name(out->type));
    return ret;
}

static int read_projection(const struct gn_json *object, struct gn_projection *out,
                           struct gn_error *out_error)
{
    const char *name = NULL;
    int ret = gn_json_get_string(object, "projection", &name, out_error);
    if (ret == 0 && gn_projection_from_name(name, &out->type) < 0)
        ret = gn_json_refuse(object, "projection", out_error,
                             "'%s' is none; right would be one of " GN_PROJECTION_NAMES, name);
    if (ret == 0 && gn_json_has(object, "width"))
        ret = gn_json_get_int(object, "width", 1, GN_IMAGE_MAX_SIDE, &out->width, out_error);
    if (ret == 0 && gn_json_has(object, "height"))
        ret = gn_json_get_int(object, "height", 1, GN_IMAGE_MAX_SIDE, &out->height, out_error);
    if (ret == 0 && gn_json_has(object, "center"))
        ret = gn_json_get_numbers(object, "center", 2, out->center, out_error);
    if (ret == 0 && gn_json_has(object, "radius"))
        ret = gn_json_get_double(object, "radius", 1e-3, 1e6, &out->radius, out_error);
    if (ret == 0 && gn_json_has(object, "theta_max"))
        ret =
            gn_json_get_double(object, "theta_max", -DBL_MAX, DBL_MAX, &out->theta_max, out_error);
    if (ret == 0 && gn_json_has(object, "theta_max") &&
        !(out->theta_max >= 1e-3 && out->theta_max <= GN_PROJECTION_MAX_THETA))
        ret = gn_json_refuse(object, "theta_max", out_error,
                             "expected radians in [0.001, %.10g], found %.10g",
                             GN_PROJECTION_MAX_THETA, out->theta_max);
    if (ret == 0 && gn_json_has(object, "k"))
        ret = gn_json_get_numbers(object, "k", 4, out->k, out_error);
    if (ret == 0 && gn_json_has(object, "vignetting"))
        ret = read_vignetting(object, out, out_error);
    return ret;
}

static int read_masks(const struct gn_json *object, struct gn_probe_setup *out,
                      struct gn_error *out_error)
{
    static const char *const keys[] = {"center", "radius"};
    struct gn_json array;
    int ret = gn_json_get_array(object, "mask", 0, GN_PROBE_MASK_MAX, &array, out_error);
    int n = ret == 0 ? (int)json_array_size(array.value) : 0;
    for (int i = 0; ret == 0 && i < n; i++) {
        struct gn_json item;
        ret = gn_json_get_item(&array, (size_t)i, &item, out_error);
        if (ret == 0)
            ret = gn_json_check_keys(&item, keys, GN_ARRAY_LEN(keys), out_error);
        if (ret == 0)
            ret = gn_json_get_numbers(&item, "center", 2, out->masks[i].center, out_error);
        for (int k = 0; ret == 0 && k < 2; k++)
            if (!(fabs(out->masks[i].center[k]) <= GN_IMAGE_MAX_SIDE))
                ret = gn_json_refuse(&item, "center", out_error, "must lie within %d px",
                                     GN_IMAGE_MAX_SIDE);
        if (ret == 0)
            ret = gn_json_get_double(&item, "radius", 1e-3, GN_IMAGE_MAX_SIDE,
                                     &out->masks[i].radius, out_error);
    }
    out->n_masks = n;
    return ret;
}

static int read_place(const struct gn_json *object, struct gn_pose *out, struct gn_error *out_error)
{
    int ret = 0;
    if (gn_json_has(object, "orientation"))
        ret = gn_json_get_numbers(object, "orientation", 4, out->rotation, out_error);
    if (ret == 0 && gn_pose_normalize(out) < 0)
        ret = gn_json_refuse(object, "orientation", out_error,
                             "not a unit quaternion w, x, y, z (norm within 10 %% of 1)");
    if (ret == 0 && gn_json_has(object, "position"))
        ret = gn_json_get_numbers(object, "position", 3, out->translation, out_error);
    return ret;
}

int gn_probe_setup_read_json(const struct gn_json *object, struct gn_probe_setup *out_setup,
                             struct gn_error *out_error)
{
    static const char *const keys[] = {"projection",   "width",     "height",    "center",
                                       "radius",       "theta_max", "k",         "vignetting",
                                       "pixel_format", "response",  "to_rec709", "scale",
                                       "orientation",  "position",  "mask"};
    static const char *const formats[] = {"float32", "log12", "linear16"};
    struct gn_probe_setup setup;
    gn_probe_setup_init(&setup);
    int format = 0;
    int ret = gn_json_check_keys(object, keys, GN_ARRAY_LEN(keys), out_error);
    if (ret == 0)
        ret = read_projection(object, &setup.projection, out_error);
    if (ret == 0 && gn_json_has(object, "pixel_format"))
        ret = gn_json_get_enum(object, "pixel_format", formats, GN_ARRAY_LEN(formats), &format,
                               out_error);
    setup.is_12_bit = format == 1;
    setup.has_response = gn_json_has(object, "response");
    if (ret == 0)
        ret = gn_response_read_json(object, &setup.response, out_error);
    if (ret == 0)
        ret = read_place(object, &setup.world_from_probe, out_error);
    if (ret == 0 && gn_json_has(object, "mask"))
        ret = read_masks(object, &setup, out_error);
    if (ret == 0)
        *out_setup = setup;
    return ret;
}

int gn_probe_setup_read_file(const char *path, struct gn_probe_setup *out_setup,
                             struct gn_error *out_error)
{
    struct gn_json root;
    int ret = gn_json_load_file(path, &root, out_error);
    if (ret < 0)
        return ret;
    ret = gn_probe_setup_read_json(&root, out_setup, out_error);
    gn_json_finish(&root);
    return ret;
}
