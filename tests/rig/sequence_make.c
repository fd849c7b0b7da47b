/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/exr.h"
#include "common/file.h"
#include "common/image_file.h"
#include "common/png.h"
#include "tests/rig/random.h"
#include "tests/rig/room.h"
#include "tests/rig/sensor.h"
#include "tests/rig/sequence.h"
#include "tests/rig/tracer.h"
#include "tests/rig/vec.h"

/* Changes whenever the same options give other pictures. */
#define RECIPE "gnomon-rig 2"
#define BATCHES 4
#define MAP_WIDTH 1024
#define PATH_MAX_BYTES 4096

static const char *const probe_names[2] = {"fisheye", "angular"};
static const char *const projection_names[2] = {"fisheye-equidistant", "angular"};
static const char *const picture_folders[GN_RIG_PICTURES] = {"camera", "camera_bounces", "truth",
                                                             "truth_bounces"};

struct maker {
    const struct gn_rig_sequence_options *o;
    struct gn_pool *pool;
    FILE *progress;
    char key[17];
    struct gn_rig_room room;
    int n_lights, n_frames;
    struct gn_rig_environment lights[GN_RIG_LAMPS];
    struct gn_rig_log_sensor sensor;
    double scale; // radiance per linear unit of the camera
    json_t *frames;
};

static void make_path(const struct maker *m, char out[static PATH_MAX_BYTES], const char *format,
                      ...) GN_PRINTF(3, 4);

static void make_path(const struct maker *m, char out[static PATH_MAX_BYTES], const char *format,
                      ...)
{
    va_list args;
    int n = snprintf(out, PATH_MAX_BYTES, "%s/", m->o->directory);
    va_start(args, format);
    vsnprintf(out + n, (size_t)(PATH_MAX_BYTES - n), format, args);
    va_end(args);
}

/* FNV-1a, 64 bits (Fowler, Noll, Vo). */
static uint64_t hash_bytes(uint64_t hash, const void *data, size_t n)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

static double get_zoom(const struct gn_rig_sequence_options *o)
{
    return o->zoom > 0 ? o->zoom : 1;
}

static int make_key(struct maker *m, struct gn_error *error)
{
    const struct gn_rig_sequence_options *o = m->o;
    char text[512];
    uint64_t hash = 0xcbf29ce484222325u;
    int n = snprintf(text, sizeof(text),
                     "%s %.17g %.17g %d %d %.17g %d %d %d %d %d %d %d %" PRIu64
                     " %.17g %.17g %.17g %d %d",
                     RECIPE, o->turn_deg, o->light_distance, o->width, o->height, get_zoom(o),
                     o->frames_per_light, o->probe_size, (int)o->probe, o->is_float, o->bounces,
                     o->paths, o->direct_paths, o->seed, o->noise, o->jitter_mm, o->jitter_deg,
                     o->is_distorted, o->is_smooth);
    hash = hash_bytes(hash, text, (size_t)n);
    if (strcmp(o->light, "lamps")) {
        uint8_t *data = NULL;
        size_t size = 0;
        int result = gn_file_read(o->light, (size_t)1 << 30, &data, &size, error);
        if (result)
            return result;
        hash = hash_bytes(hash, data, size);
        free(data);
    }
    snprintf(m->key, sizeof(m->key), "%016" PRIx64, hash);
    return 0;
}

static int make_folders(const struct maker *m, struct gn_error *error)
{
    static const char *const folders[] = {
        "", "env", "camera", "camera_bounces", "truth", "truth_bounces", "object", "exr", "done"};
    for (size_t i = 0; i < GN_ARRAY_LEN(folders); i++) {
        char path[PATH_MAX_BYTES];
        make_path(m, path, "%s", folders[i]);
        if (mkdir(path, 0777) && errno != EEXIST)
            return gn_error_set(error, -errno, "%s: cannot make this folder: %s", path,
                                strerror(errno));
    }
    return 0;
}

static int read_map(const struct maker *m, struct gn_image *out_map, struct gn_error *error)
{
    struct gn_image_file file;
    int result = gn_image_read_file(m->o->light, &file, error);
    if (result)
        return result;
    if (file.kind != GN_IMAGE_LINEAR || file.linear.channels != 3 ||
        file.linear.width != 2 * file.linear.height)
        result = gn_error_set(error, -EINVAL,
                              "%s: a light map is a lat-long EXR or Radiance picture"
                              " in colour, twice as wide as high",
                              m->o->light);
    else if (gn_rig_turn_map(&file.linear, m->o->turn_deg * GN_RIG_PI / 180, out_map))
        result = gn_error_set(error, -ENOMEM, "%s: no memory to turn it", m->o->light);
    gn_image_file_finish(&file);
    return result;
}

static int make_lights(struct maker *m, struct gn_error *error)
{
    for (int i = 0; i < m->n_lights; i++) {
        struct gn_image map = {0};
        int result = strcmp(m->o->light, "lamps")
                         ? read_map(m, &map, error)
                         : gn_rig_paint_lamp_room(MAP_WIDTH, MAP_WIDTH / 2, i + 1, m->pool, &map);
        if (result == 0)
            result = gn_rig_environment_init(&map, m->o->light_distance, &m->lights[i], error);
        gn_image_finish(&map);
        if (result)
            return result;
    }
    return 0;
}

static double get_luminance(const double rgb[static 3])
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; // Rec.709
}

/* One exposure for the sequence, from its brightest light: white paper on the table comes to 0.8,
 * and what stands obliquely towards the light to 1.1 at most. */
static int expose(struct maker *m, struct gn_error *error)
{
    const struct gn_rig_environment *env = &m->lights[m->n_lights - 1];
    size_t n = (size_t)env->map.width * (size_t)env->map.height;
    double rgb[3], sum = 0, highest = 0, up[3] = {0, 0, 1};
    gn_rig_environment_get_irradiance(env, up, rgb);
    m->scale = get_luminance(rgb) / GN_RIG_PI / 0.8;
    for (int i = 0; i < 8; i++) {
        double a = i * GN_RIG_PI / 4, side[3] = {0.8 * cos(a), 0.8 * sin(a), 0.6};
        gn_rig_environment_get_irradiance(env, side, rgb);
        m->scale = fmax(m->scale, get_luminance(rgb) / GN_RIG_PI / 1.1);
    }
    for (size_t i = 0; i < 3 * n; i++) {
        sum += env->map.data[i];
        highest = fmax(highest, env->map.data[i]);
    }
    if (!(m->scale > 0))
        return gn_error_set(error, -EINVAL, "%s: no light comes from above", m->o->light);
    m->sensor = gn_rig_make_log_sensor(sum / (3.0 * (double)n), highest);
    return 0;
}

/* Pixels of 3 channels as layer.R, G, B; layer may be "". */
static void list_channels(const struct gn_image *image, const char *const names[static 3],
                          struct gn_exr_channel out_channels[static 3])
{
    for (int k = 0; k < 3; k++)
        out_channels[k] =
            (struct gn_exr_channel){.name = names[k], .data = image->data + k, .stride = 3};
}

static int write_probe(const struct maker *m, int light, enum gn_rig_probe probe,
                       struct gn_error *error)
{
    static const char *const names[3] = {"R", "G", "B"};
    struct gn_image linear = {0};
    struct gn_image16 codes = {0};
    struct gn_exr_channel channels[3];
    char path[PATH_MAX_BYTES];
    int size = m->o->probe_size;
    int result = gn_rig_take_probe(&m->lights[light], probe, size, gn_rig_world_from_probe[probe],
                                   gn_rig_probe_position, m->pool, &linear);
    if (result == 0)
        result = gn_image16_init(&codes, size, size, 3);
    if (result) {
        gn_error_set(error, result, "no memory for a probe of %d px", size);
        goto out;
    }
    for (size_t i = 0; i < 3 * (size_t)size * (size_t)size; i++)
        codes.data[i] = (uint16_t)gn_rig_encode_log12(&m->sensor, linear.data[i]);
    list_channels(&linear, names, channels);
    make_path(m, path, "env/%s-%d.exr", probe_names[probe], light);
    result = gn_exr_write_file(path, size, size, channels, 3, error);
    make_path(m, path, "env/%s-%d.png", probe_names[probe], light);
    if (result == 0)
        result = gn_png_write_file16(path, &codes, error);
out:
    gn_image16_finish(&codes);
    gn_image_finish(&linear);
    return result;
}

/* The camera drifts round the marker at 500 mm, at t in [0, 1] of the sequence. */
static void place_camera(const struct maker *m, double t, struct gn_rig_view *out_view)
{
    const struct gn_rig_sequence_options *o = m->o;
    const double target[3] = {0.006, 0.050, 0.012};
    double focal = 1.32 * o->width * get_zoom(o);
    double azimuth = (-99 + 14 * t) * GN_RIG_PI / 180;
    double elevation = (35 + 2.5 * sin(GN_RIG_PI * t)) * GN_RIG_PI / 180, distance = 0.5;
    const double position[3] = {distance * cos(elevation) * cos(azimuth),
                                distance * cos(elevation) * sin(azimuth),
                                distance * sin(elevation)};
    *out_view = (struct gn_rig_view){.width = o->width,
                                     .height = o->height,
                                     .fx = focal,
                                     .fy = focal,
                                     .cx = o->width / 2.0,
                                     .cy = o->height / 2.0};
    if (o->is_distorted)
        memcpy(out_view->distortion, (const double[5]){-0.11, 0.04, 0.0006, -0.0004, 0},
               sizeof(out_view->distortion));
    gn_rig_look_at(position, target, out_view->world_from_camera);
}

/* What the tracker says: the true pose moved and turned by normal deviates. */
static void jitter_pose(const struct maker *m, int frame, const double pose[static 16],
                        double out_pose[static 16])
{
    const uint32_t key[2] = {(uint32_t)m->o->seed, (uint32_t)(m->o->seed >> 32)};
    double v[6], turn[9], column[3];
    for (uint32_t i = 0; i < 6; i++) {
        uint32_t words[4];
        gn_rig_philox((const uint32_t[4]){i, (uint32_t)frame, 0, 0x706f7365}, key, words);
        v[i] = gn_rig_get_normal(words[0], words[1]);
    }
    memcpy(out_pose, pose, 16 * sizeof(*out_pose));
    double angle = vec_length(v) * m->o->jitter_deg * GN_RIG_PI / 180;
    double c = cos(angle), s = sin(angle), length = vec_length(v);
    const double a[3] = {v[0] / length, v[1] / length, v[2] / length};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) // Rodrigues
            turn[3 * i + j] = (i == j ? c : 0) + (1 - c) * a[i] * a[j] +
                              (i == j ? 0 : s * ((j - i + 3) % 3 == 1 ? -1 : 1) * a[3 - i - j]);
    for (int j = 0; j < 3; j++) {
        const double axis[3] = {pose[j], pose[4 + j], pose[8 + j]};
        vec_transform(turn, axis, column);
        for (int i = 0; i < 3; i++)
            out_pose[4 * i + j] = column[i];
    }
    for (int i = 0; i < 3; i++)
        out_pose[4 * i + 3] += v[3 + i] * m->o->jitter_mm / 1000;
}

/* The camera's 8-bit codes; its own pictures have its noise. */
static int write_picture(const struct maker *m, int frame, int which, const struct gn_image *image,
                         struct gn_error *error)
{
    const uint32_t key[2] = {(uint32_t)m->o->seed, (uint32_t)(m->o->seed >> 32)};
    double noise = which <= GN_RIG_BACKGROUND_BOUNCES ? m->o->noise : 0;
    struct gn_image8 codes;
    char path[PATH_MAX_BYTES];
    int result = gn_image8_init(&codes, image->width, image->height, 3);
    if (result)
        return gn_error_set(error, result, "no memory for a picture");
    for (uint32_t i = 0; i < 3 * (uint32_t)image->width * (uint32_t)image->height; i++) {
        double code = gn_rig_encode_srgb8(image->data[i] / m->scale);
        if (noise > 0) {
            uint32_t words[4];
            gn_rig_philox((const uint32_t[4]){i, (uint32_t)frame, (uint32_t)which, 0x6e6f6973}, key,
                          words);
            code += noise * gn_rig_get_normal(words[0], words[1]);
        }
        codes.data[i] = (uint8_t)fmin(255, fmax(0, floor(code + 0.5)));
    }
    make_path(m, path, "%s/%04d.png", picture_folders[which], frame);
    result = gn_png_write_file(path, &codes, error);
    gn_image8_finish(&codes);
    return result;
}

/* The pictures in floats, with their standard errors. */
static int write_floats(const struct maker *m, int frame, const struct gn_rig_pictures *p,
                        struct gn_error *error)
{
    static const char *const names[GN_RIG_PICTURES][2][3] = {
        {{"camera.R", "camera.G", "camera.B"},
         {"camera_error.R", "camera_error.G", "camera_error.B"}},
        {{"camera_bounces.R", "camera_bounces.G", "camera_bounces.B"},
         {"camera_bounces_error.R", "camera_bounces_error.G", "camera_bounces_error.B"}},
        {{"R", "G", "B"}, {"error.R", "error.G", "error.B"}},
        {{"bounces.R", "bounces.G", "bounces.B"},
         {"bounces_error.R", "bounces_error.G", "bounces_error.B"}},
    };
    struct gn_exr_channel channels[6 * GN_RIG_PICTURES + 1];
    char path[PATH_MAX_BYTES];
    for (int i = 0; i < GN_RIG_PICTURES; i++) {
        list_channels(&p->mean[i], names[i][0], channels + 6 * i);
        list_channels(&p->error[i], names[i][1], channels + 6 * i + 3);
    }
    channels[6 * GN_RIG_PICTURES] =
        (struct gn_exr_channel){.name = "object.A", .data = p->object.data, .stride = 1};
    make_path(m, path, "exr/%04d.exr", frame);
    return gn_exr_write_file(path, m->o->width, m->o->height, channels, 6 * GN_RIG_PICTURES + 1,
                             error);
}

static int write_mask(const struct maker *m, int frame, const struct gn_image *object,
                      struct gn_error *error)
{
    struct gn_image8 codes;
    char path[PATH_MAX_BYTES];
    int result = gn_image8_init(&codes, object->width, object->height, 1);
    if (result)
        return gn_error_set(error, result, "no memory for a mask");
    for (int i = 0; i < object->width * object->height; i++) // any part at all is seen in the code
        codes.data[i] = (uint8_t)ceil(255 * (double)object->data[i]);
    make_path(m, path, "object/%04d.png", frame);
    result = gn_png_write_file(path, &codes, error);
    gn_image8_finish(&codes);
    return result;
}

static bool is_done(const struct maker *m, int frame)
{
    char path[PATH_MAX_BYTES];
    uint8_t *data = NULL;
    size_t size = 0;
    make_path(m, path, "done/%04d", frame);
    bool done = gn_file_read(path, sizeof(m->key), &data, &size, NULL) == 0 &&
                size == strlen(m->key) && !memcmp(data, m->key, size);
    free(data);
    return done;
}

/* All pictures of a frame; those in direct light from paths of their own where more are asked for.
 */
static int render_pictures(const struct maker *m, int frame, const struct gn_rig_view *view,
                           struct gn_rig_pictures *out, struct gn_error *error)
{
    const struct gn_rig_environment *light = &m->lights[frame / m->o->frames_per_light];
    struct gn_rig_render_options options = {.bounces = m->o->bounces,
                                            .batches = BATCHES,
                                            .batch_size = m->o->paths / BATCHES,
                                            .seed = m->o->seed,
                                            .frame = frame};
    int result = gn_rig_render(&m->room, light, view, &options, m->pool, out, error);
    if (result || !m->o->direct_paths || m->o->direct_paths == m->o->paths)
        return result;
    static const int direct[2] = {GN_RIG_BACKGROUND, GN_RIG_TRUTH};
    struct gn_rig_pictures more;
    options.bounces = 0;
    options.batch_size = m->o->direct_paths / BATCHES;
    result = gn_rig_render(&m->room, light, view, &options, m->pool, &more, error);
    if (result) {
        gn_rig_pictures_finish(out);
        return result;
    }
    for (int i = 0; i < 2; i++) {
        struct gn_image mean = out->mean[direct[i]], deviation = out->error[direct[i]];
        out->mean[direct[i]] = more.mean[direct[i]];
        out->error[direct[i]] = more.error[direct[i]];
        more.mean[direct[i]] = mean;
        more.error[direct[i]] = deviation;
    }
    gn_rig_pictures_finish(&more);
    return 0;
}

static int render_frame(const struct maker *m, int frame, const struct gn_rig_view *view,
                        struct gn_error *error)
{
    struct gn_rig_pictures pictures = {0};
    char path[PATH_MAX_BYTES];
    int result = render_pictures(m, frame, view, &pictures, error);
    for (int i = 0; result == 0 && i < GN_RIG_PICTURES; i++)
        result = write_picture(m, frame, i, &pictures.mean[i], error);
    if (result == 0)
        result = write_mask(m, frame, &pictures.object, error);
    if (result == 0)
        result = write_floats(m, frame, &pictures, error);
    make_path(m, path, "done/%04d", frame);
    if (result == 0)
        result = gn_file_write(path, m->key, strlen(m->key), error);
    gn_rig_pictures_finish(&pictures);
    return result;
}

static json_t *list_numbers(const double *numbers, int n)
{
    json_t *list = json_array();
    for (int i = 0; i < n; i++)
        json_array_append_new(list, json_real(numbers[i]));
    return list;
}

static void add_text(json_t *object, const char *key, const char *format, ...) GN_PRINTF(3, 4);

static void add_text(json_t *object, const char *key, const char *format, ...)
{
    char text[256];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof(text), format, args);
    va_end(args);
    json_object_set_new(object, key, json_string(text));
}

/* 25 frames a second. */
static json_t *describe_frame(const struct maker *m, int frame, const struct gn_rig_view *view)
{
    json_t *f = json_object();
    double delivered[16];
    int light = frame / m->o->frames_per_light;
    jitter_pose(m, frame, view->world_from_camera, delivered);
    json_object_set_new(f, "time_s", json_real(frame / 25.0));
    add_text(f, "picture", "camera/%04d.png", frame);
    add_text(f, "environment", "env/%s-%d.%s", probe_names[m->o->probe], light,
             m->o->is_float ? "exr" : "png");
    json_object_set_new(f, "world_from_camera", list_numbers(delivered, 16));
    json_object_set_new(f, "world_from_camera_true", list_numbers(view->world_from_camera, 16));
    add_text(f, "truth", "truth/%04d.png", frame);
    add_text(f, "truth_exr", "exr/%04d.exr", frame);
    add_text(f, "object", "object/%04d.png", frame);
    if (m->n_lights > 1)
        add_text(f, "label", "%d lamp%s", light + 1, light ? "s" : "");
    else {
        const char *slash = strrchr(m->o->light, '/'), *name = slash ? slash + 1 : m->o->light;
        add_text(f, "label", "%.*s", (int)strcspn(name, "."), name);
    }
    return f;
}

static json_t *describe_camera(const struct maker *m, const struct gn_rig_view *view)
{
    json_t *c = json_object(), *response = json_object();
    json_object_set_new(c, "width", json_integer(view->width));
    json_object_set_new(c, "height", json_integer(view->height));
    json_object_set_new(c, "fx", json_real(view->fx));
    json_object_set_new(c, "fy", json_real(view->fy));
    json_object_set_new(c, "cx", json_real(view->cx));
    json_object_set_new(c, "cy", json_real(view->cy));
    json_object_set_new(c, "distortion", list_numbers(view->distortion, 5));
    json_object_set_new(response, "type", json_string("srgb"));
    json_object_set_new(c, "response", response);
    json_object_set_new(c, "scale", json_real(m->scale));
    return c;
}

static json_t *describe_probe(const struct maker *m, enum gn_rig_probe probe, bool is_float)
{
    json_t *e = json_object(), *response = json_object();
    double q[4];
    gn_rig_get_quaternion(gn_rig_world_from_probe[probe], q);
    json_object_set_new(e, "projection", json_string(projection_names[probe]));
    json_object_set_new(e, "width", json_integer(m->o->probe_size));
    json_object_set_new(e, "height", json_integer(m->o->probe_size));
    json_object_set_new(e, "theta_max",
                        json_real(probe == GN_RIG_FISHEYE ? GN_RIG_PI / 2 : GN_RIG_PI));
    json_object_set_new(e, "pixel_format", json_string(is_float ? "float32" : "log12"));
    json_object_set_new(response, "type", json_string(is_float ? "linear" : "log"));
    if (!is_float) {
        json_object_set_new(response, "a", json_real(m->sensor.a));
        json_object_set_new(response, "b", json_real(m->sensor.b));
        json_object_set_new(response, "c", json_real(m->sensor.c));
    }
    json_object_set_new(e, "response", response);
    json_object_set_new(e, "scale", json_real(1));
    json_object_set_new(e, "orientation", list_numbers(q, 4));
    json_object_set_new(e, "position", list_numbers(gn_rig_probe_position, 3));
    return e;
}

static int write_json(const struct maker *m, const char *name, const json_t *value,
                      struct gn_error *error)
{
    char path[PATH_MAX_BYTES], *text = json_dumps(value, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
    if (!text)
        return gn_error_set(error, -ENOMEM, "%s: no memory to write it", name);
    make_path(m, path, "%s", name);
    int result = gn_file_write(path, text, strlen(text), error);
    free(text);
    return result;
}

/* DIR/bounces/sequence.json: the same files, but pictures and truth with bounces. */
static int write_bounces(const struct maker *m, const json_t *direct, struct gn_error *error)
{
    static const char *const shared[] = {"environment", "truth_exr", "object"};
    json_t *s = json_deep_copy(direct), *f;
    char text[PATH_MAX_BYTES];
    size_t i;
    make_path(m, text, "bounces");
    if (mkdir(text, 0777) && errno != EEXIST)
        return gn_error_set(error, -errno, "%s: %s", text, strerror(errno));
    json_object_set_new(s, "scene", json_string("../scene.json"));
    json_array_foreach(json_object_get(s, "frames"), i, f)
    {
        for (size_t k = 0; k < GN_ARRAY_LEN(shared); k++)
            add_text(f, shared[k], "../%s", json_string_value(json_object_get(f, shared[k])));
        add_text(f, "picture", "../camera_bounces/%04zu.png", i);
        add_text(f, "truth", "../truth_bounces/%04zu.png", i);
        add_text(f, "truth_layer", "bounces");
    }
    int result = write_json(m, "bounces/sequence.json", s, error);
    json_decref(s);
    return result;
}

static int write_description(const struct maker *m, struct gn_error *error)
{
    struct gn_rig_view view;
    place_camera(m, 0, &view);
    json_t *camera = describe_camera(m, &view), *still = json_deep_copy(camera);
    json_t *probe = describe_probe(m, m->o->probe, m->o->is_float);
    json_object_set(still, "world_from_camera",
                    json_object_get(json_array_get(m->frames, 0), "world_from_camera_true"));
    int result = write_json(m, "camera.json", still, error);
    json_decref(still);

    json_t *s = json_object();
    const char *slash = strrchr(m->o->light, '/');
    json_object_set_new(s, "format", json_string("gnomon-sequence 1"));
    json_object_set_new(s, "name", json_string(slash ? slash + 1 : m->o->light));
    json_object_set_new(s, "seed", json_integer((json_int_t)m->o->seed));
    json_object_set_new(s, "key", json_string(m->key));
    json_object_set_new(s, "scene", json_string("scene.json"));
    json_object_set_new(s, "triangles", json_integer(gn_rig_room_count_triangles(&m->room)));
    json_object_set_new(s, "bounces", json_integer(m->o->bounces));
    json_object_set_new(s, "paths", json_integer(m->o->paths));
    json_object_set_new(s, "camera", camera);
    json_object_set_new(s, "environment", probe);
    json_object_set(s, "frames", m->frames);
    if (result == 0)
        result = write_json(m, "probe.json", probe, error);
    if (result == 0)
        result = write_bounces(m, s, error);
    if (result == 0)
        result = write_json(m, "sequence.json", s, error);
    json_decref(s);
    return result;
}

static int make_frames(struct maker *m, struct gn_error *error)
{
    struct timespec start, now;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (int frame = 0; frame < m->n_frames; frame++) {
        struct gn_rig_view view;
        int result = 0;
        place_camera(m, m->n_frames > 1 ? frame / (m->n_frames - 1.0) : 0.4, &view);
        json_array_append_new(m->frames, describe_frame(m, frame, &view));
        bool done = is_done(m, frame);
        if (!done)
            result = render_frame(m, frame, &view, error);
        if (result)
            return result;
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (m->progress)
            fprintf(m->progress, "frame %2d of %d  %s  %.0f s\n", frame + 1, m->n_frames,
                    done ? "is there" : "made", difftime(now.tv_sec, start.tv_sec));
    }
    return 0;
}

/* True where sequence.json is there with this key. */
static bool is_complete(const struct maker *m)
{
    struct gn_rig_sequence s;
    if (gn_rig_sequence_read(m->o->directory, &s, NULL))
        return false;
    const char *key = json_string_value(json_object_get(s.root, "key"));
    bool same = key && !strcmp(key, m->key);
    gn_rig_sequence_finish(&s);
    return same;
}

static int make_all(struct maker *m, struct gn_error *error)
{
    char path[PATH_MAX_BYTES];
    int result = make_folders(m, error);
    make_path(m, path, "sequence.json");
    if (result == 0 && unlink(path) && errno != ENOENT)
        result = gn_error_set(error, -errno, "%s: cannot replace it: %s", path, strerror(errno));
    if (result == 0)
        result = gn_rig_room_init_demo(m->o->is_smooth, &m->room, error);
    if (result == 0 && m->progress)
        fprintf(m->progress, "scene     %d triangles\n", gn_rig_room_count_triangles(&m->room));
    if (result == 0)
        result = gn_rig_room_commit(&m->room, m->pool, error);
    if (result == 0)
        result = gn_rig_room_write(&m->room, m->o->directory, error);
    if (result == 0)
        result = make_lights(m, error);
    if (result == 0)
        result = expose(m, error);
    for (int i = 0; result == 0 && i < 2 * m->n_lights; i++)
        result = write_probe(m, i / 2, i % 2 ? GN_RIG_ANGULAR : GN_RIG_FISHEYE, error);
    if (result == 0)
        result = make_frames(m, error);
    return result ? result : write_description(m, error);
}

int gn_rig_make_sequence(const struct gn_rig_sequence_options *options, struct gn_pool *pool,
                         FILE *progress, struct gn_error *out_error)
{
    struct maker m = {.o = options, .pool = pool, .progress = progress};
    m.n_lights = strcmp(options->light, "lamps") ? 1 : GN_RIG_LAMPS;
    m.n_frames = m.n_lights * options->frames_per_light;
    if (strlen(options->directory) > 2000 || m.n_frames > GN_RIG_MAX_FRAMES)
        return gn_error_set(out_error, -EINVAL, "the folder's name or the sequence is too long");
    int result = make_key(&m, out_error);
    if (result)
        return result;
    if (is_complete(&m)) {
        if (progress)
            fprintf(progress, "%s is there already, made with the same parameters\n",
                    options->directory);
        return 0;
    }
    m.frames = json_array();
    result = m.frames ? make_all(&m, out_error)
                      : gn_error_set(out_error, -ENOMEM, "no memory for a list of frames");
    json_decref(m.frames);
    for (int i = 0; i < GN_RIG_LAMPS; i++)
        gn_rig_environment_finish(&m.lights[i]);
    gn_rig_room_finish(&m.room);
    return result;
}
