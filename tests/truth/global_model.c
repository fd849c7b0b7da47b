/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the global model is for. A box without a lid; light falls over one wall onto the opposite
 * one, which lights all the rest. The probe stands 0.5 m from the object, farther from the bright
 * wall than that. The rig's path tracer renders what the probe sees, and the truth; the server
 * lights the object by that capture alone,
 *   local   all light distant, the floor modelled or nothing at all,
 *   global  the box modelled, each texel's light from the surface that it shows.
 * Errors are of the object's pixels: root mean square over that of the truth.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/render.h"
#include "tests/rig/tracer.h"
#include "tests/rig/vec.h"
#include "tests/stage.h"

enum { WIDTH = 20, HEIGHT = 15, FACE = 24, MAP_HEIGHT = 96 };

static const double probe_position[3] = {0.1, 0.1, 0.35};
static const double object_position[3] = {-0.38, 0, 0.13};

struct part {
    const char *name;
    enum gn_rt_set role;
    double size[3], middle[3], albedo[3];
};

/* The object first, then the floor. */
static const struct part parts[] = {
    {"object", GN_RT_VIRTUAL, {0.16, 0.16, 0.16}, {-0.38, 0, 0.13}, {0.5, 0.5, 0.5}},
    {"floor", GN_RT_REAL, {2, 2, 0.05}, {0, 0, -0.025}, {0.5, 0.45, 0.4}},
    {"bright wall", GN_RT_REAL, {0.05, 2, 1.2}, {-1.025, 0, 0.6}, {0.7, 0.65, 0.5}},
    {"lid's wall", GN_RT_REAL, {0.05, 2, 1.2}, {1.025, 0, 0.6}, {0.3, 0.4, 0.6}},
    {"left", GN_RT_REAL, {2, 0.05, 1.2}, {0, 1.025, 0.6}, {0.6, 0.3, 0.3}},
    {"right", GN_RT_REAL, {2, 0.05, 1.2}, {0, -1.025, 0.6}, {0.3, 0.6, 0.3}},
};
enum { N_PARTS = sizeof(parts) / sizeof(parts[0]) };

struct world {
    struct gn_rig_room room;
    struct gn_rig_environment env;
    struct gn_image capture; // cube map, as the probe sees the room
    struct gn_projection projection;
    struct gn_rig_view view;
    struct gn_rig_pictures truth;
};

static void make_matrix(const double middle[static 3], double out[static 16])
{
    const double m[16] = {1, 0, 0, middle[0], 0, 1, 0, middle[1], 0, 0, 1, middle[2], 0, 0, 0, 1};
    memcpy(out, m, sizeof(m));
}

static struct gn_mesh make_mesh(const struct part *part)
{
    return gn_test_make_box((float)part->size[0], (float)part->size[1], (float)part->size[2]);
}

/* A dim sky and a broad lamp, low over the wall at +x. */
static void init_environment(struct gn_rig_environment *env)
{
    struct gn_image map;
    const double lamp[3] = {0.8660, 0, 0.5};
    assert_int_equal(gn_image_init(&map, 2 * MAP_HEIGHT, MAP_HEIGHT, 3), 0);
    for (int y = 0; y < map.height; y++)
        for (int x = 0; x < map.width; x++) {
            double theta = GN_RIG_PI * (y + 0.5) / map.height;
            double phi = GN_RIG_PI - 2 * GN_RIG_PI * (x + 0.5) / map.width;
            const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            bool is_lamp = vec_dot(lamp, dir) > cos(0.06);
            float *rgb = gn_image_at(&map, x, y);
            rgb[0] = is_lamp ? 360 : 0.05f;
            rgb[1] = is_lamp ? 330 : 0.06f;
            rgb[2] = is_lamp ? 270 : 0.08f;
        }
    assert_int_equal(gn_rig_environment_init(&map, 0, env, NULL), 0);
}

static void init_room(struct gn_rig_room *room)
{
    memset(room, 0, sizeof(*room));
    for (int i = 0; i < N_PARTS; i++) {
        struct gn_rig_object o = {
            .name = parts[i].name, .role = parts[i].role, .mesh = make_mesh(&parts[i])};
        memcpy(o.albedo, parts[i].albedo, sizeof(o.albedo));
        make_matrix(parts[i].middle, o.world_from_object);
        assert_int_equal(gn_rig_room_add(room, &o), 0);
    }
    assert_int_equal(gn_rig_room_commit(room, NULL, NULL), 0);
}

/* A pinhole for one face of the cube map: its axes are those of the face's pixels. */
static struct gn_rig_view make_face(const struct gn_projection *projection, int face)
{
    struct gn_rig_view view = {.width = FACE,
                               .height = FACE,
                               .fx = FACE / 2.0,
                               .fy = FACE / 2.0,
                               .cx = FACE / 2.0,
                               .cy = FACE / 2.0};
    double middle[3], right[3], down[3], *m = view.world_from_camera;
    double y = (face + 0.5) * FACE;
    assert_true(gn_projection_get_direction(projection, FACE / 2.0, y, middle));
    assert_true(gn_projection_get_direction(projection, FACE / 2.0 + 1, y, right));
    assert_true(gn_projection_get_direction(projection, FACE / 2.0, y + 1, down));
    for (int k = 0; k < 3; k++) { // to the axes exactly
        m[4 * k] = round(2 * (right[k] - middle[k]) * FACE / 2);
        m[4 * k + 1] = round(2 * (down[k] - middle[k]) * FACE / 2);
        m[4 * k + 2] = round(middle[k]);
        m[4 * k] = fmax(-1, fmin(1, m[4 * k]));
        m[4 * k + 1] = fmax(-1, fmin(1, m[4 * k + 1]));
        m[4 * k + 3] = probe_position[k];
    }
    m[15] = 1;
    return view;
}

static void take_capture(struct world *w)
{
    w->projection =
        (struct gn_projection){.type = GN_PROJECTION_CUBE, .width = FACE, .height = 6 * FACE};
    assert_int_equal(gn_projection_init(&w->projection, NULL), 0);
    assert_int_equal(gn_image_init(&w->capture, FACE, 6 * FACE, 3), 0);
    for (int face = 0; face < 6; face++) {
        const struct gn_rig_render_options options = {
            .bounces = 6, .batches = 2, .batch_size = 128, .frame = face};
        struct gn_rig_view view = make_face(&w->projection, face);
        struct gn_rig_pictures pictures;
        assert_int_equal(gn_rig_render(&w->room, &w->env, &view, &options, NULL, &pictures, NULL),
                         0);
        memcpy(gn_image_at(&w->capture, 0, face * FACE),
               pictures.mean[GN_RIG_BACKGROUND_BOUNCES].data, sizeof(float) * FACE * FACE * 3);
        gn_rig_pictures_finish(&pictures);
    }
}

static int setup(void **state)
{
    static struct world w;
    const double eye[3] = {-0.15, -0.75, 0.5};
    init_environment(&w.env);
    init_room(&w.room);
    take_capture(&w);
    w.view = (struct gn_rig_view){.width = WIDTH,
                                  .height = HEIGHT,
                                  .fx = 3 * WIDTH,
                                  .fy = 3 * WIDTH,
                                  .cx = WIDTH / 2.0,
                                  .cy = HEIGHT / 2.0};
    gn_rig_look_at(eye, object_position, w.view.world_from_camera);
    const struct gn_rig_render_options options = {
        .bounces = 6, .batches = 2, .batch_size = 512, .frame = 100};
    assert_int_equal(gn_rig_render(&w.room, &w.env, &w.view, &options, NULL, &w.truth, NULL), 0);
    *state = &w;
    return 0;
}

static int teardown(void **state)
{
    struct world *w = *state;
    gn_rig_pictures_finish(&w->truth);
    gn_image_finish(&w->capture);
    gn_rig_room_finish(&w->room);
    gn_rig_environment_finish(&w->env);
    return 0;
}

/* The first n parts as a server's scene. */
static struct gn_scene *make_scene(int n)
{
    struct gn_scene_object *objects = calloc((size_t)n, sizeof(*objects));
    struct gn_scene *scene;
    assert_non_null(objects);
    for (int i = 0; i < n; i++) {
        objects[i] = (struct gn_scene_object){
            .role = parts[i].role, .has_material = true, .mesh = make_mesh(&parts[i])};
        for (int k = 0; k < 3; k++)
            objects[i].material.albedo[k] = (float)parts[i].albedo[k];
        make_matrix(parts[i].middle, objects[i].world_from_object);
    }
    assert_int_equal(gn_scene_create(objects, n, NULL, &scene, NULL), 0);
    free(objects);
    return scene;
}

/* The error of the object's pixels, lit in a scene of the first n parts. */
static double get_error(const struct world *w, int n_parts, bool is_global,
                        const struct gn_render_options *options, const char *name)
{
    struct gn_scene *scene = make_scene(n_parts);
    struct gn_camera camera = {.width = WIDTH,
                               .height = HEIGHT,
                               .fx = w->view.fx,
                               .fy = w->view.fy,
                               .cx = w->view.cx,
                               .cy = w->view.cy,
                               .response = {.type = GN_RESPONSE_SRGB}};
    struct gn_environment_frame frame = {
        .codes = &w->capture, .projection = w->projection, .world_from_probe = {1, 0, 0, 0}};
    const struct gn_radiance_map_options map_options = {.model = is_global ? scene : NULL};
    const struct gn_light_options light_options = {.n_lights = 64};
    struct gn_lighting_state *light;
    struct gn_renderer *renderer;
    struct gn_layers layers;
    struct gn_render_report report;
    struct gn_error error = {0};
    double squares = 0, squares_truth = 0, bias = 0, sum_truth = 0;
    memcpy(frame.position, probe_position, sizeof(frame.position));
    assert_int_equal(
        gn_pose_from_matrix(w->view.world_from_camera, &camera.world_from_camera, NULL), 0);
    if (gn_lighting_state_create(&frame, &map_options, &light_options, NULL, &light, &error) < 0)
        fail_msg("%s", error.text);
    assert_int_equal(gn_renderer_create(scene, NULL, &renderer, NULL), 0);
    assert_int_equal(gn_layers_init(&layers, WIDTH, HEIGHT), 0);
    assert_int_equal(
        gn_renderer_render(renderer, &camera, light, options, &layers, &report, &error), 0);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const float *rgba = layers.virtual_rgba.data + (size_t)4 * i;
        if (rgba[3] < 1 || w->truth.object.data[i] < 1)
            continue;
        for (int k = 0; k < 3; k++) {
            double truth = (double)w->truth.mean[GN_RIG_TRUTH_BOUNCES].data[3 * i + k];
            double difference = (double)rgba[k] - truth;
            squares += difference * difference;
            squares_truth += truth * truth;
            bias += difference;
            sum_truth += truth;
        }
    }
    assert_true(squares_truth > 0);
    double relative = sqrt(squares / squares_truth);
    print_message("# %s: error %.1f %%, bias %+.1f %%, %d lights, %.0f ms\n", name, 100 * relative,
                  100 * bias / sum_truth, report.n_lights, report.ms_total);
    gn_layers_finish(&layers);
    gn_renderer_destroy(&renderer);
    gn_lighting_state_unref(&light);
    gn_scene_destroy(&scene);
    return relative;
}

static void test_reference(void **state)
{
    const struct gn_render_options plain = {.quality = GN_QUALITY_REFERENCE, .no_shadow = true};
    const struct gn_render_options bounces = {
        .quality = GN_QUALITY_REFERENCE, .no_shadow = true, .bounces = 4, .paths_per_pixel = 64};
    double bare = get_error(*state, 1, false, &plain, "reference, local, nothing modelled");
    double floor_ = get_error(*state, 2, false, &bounces, "reference, local, floor, 4 bounces");
    double global = get_error(*state, N_PARTS, true, &plain, "reference, global");
    double walks = get_error(*state, N_PARTS, true, &bounces, "reference, global, 4 bounces");
    assert_true(global < 0.05 && walks < 0.05);
    assert_true(fmin(bare, floor_) > 0.25);
}

static void test_interactive(void **state)
{
    const struct gn_render_options plain = {.no_shadow = true};
    double bare = get_error(*state, 1, false, &plain, "64 lights, local, nothing modelled");
    double floor_ = get_error(*state, 2, false, &plain, "64 lights, local, floor");
    double global = get_error(*state, N_PARTS, true, &plain, "64 lights, global");
    // How the lights are divided moves it between 7 and 12 %.
    assert_true(global < fmin(bare, floor_) / 2.5);
    assert_true(fmin(bare, floor_) > 0.25);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reference),
        cmocka_unit_test(test_interactive),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
