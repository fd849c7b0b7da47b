/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's path tracer and the server's reference renderer, written apart, agree within 3 standard
 * errors: the same demo room, the same texels, no device between; so only the renderers differ.
 *
 * Both take the map as constant over each texel; the rig integrates within a texel, the reference
 * takes its centre (bright ones in parts). So the maps are smooth and their texels small against
 * the penumbras. The reference's 4 x 4 grid is not random: each of its pictures has the grid moved
 * within its cell, so that together they cover the pixel's box evenly, as the rig's paths do.
 *
 * Two views of it:
 *   whole   the server takes all objects as virtual: its virtual layer is the picture itself.
 *           Compared with the rig's truth at every pixel, silhouettes too.
 *   layers  the teapot alone is virtual: the paper's composite of the rig's background,
 *             shadow background + added, or the virtual radiance where the teapot fills the pixel,
 *           against the rig's truth, where that differs from the background by more than 1/255 of
 *           it. Silhouettes are left out: there a composite multiplies what the teapot hides, too.
 *
 * In the glossy scenarios the teapot is of ggx or glass. Both renderers mean the same surfaces but
 * have other formulas for them (tests/rig/gloss.h), and other ways to find their light.
 *
 * The near room is black around, lit by what stands in it: a lamp and a screen of the room, a
 * virtual lamp and a virtual screen. The server has each piece's irradiance exactly and one ray for
 * its visibility, the rig points chosen evenly over the emitters and nothing else. Silhouettes
 * are left out of its whole view, too: the mean over the rest is sharper.
 *
 * PAIRS independent pairs of pictures, one of each renderer, give PAIRS differences: their mean and
 * its standard error need no model of either's noise, nor of how truth and background go together.
 * For normal noise mean / error follows Student's t with PAIRS - 1 = 7 degrees, which passes 3 with
 * probability BEYOND. The channels of a pixel see the same paths, so the number of values beyond 3
 * may be as far from that as four deviations of a binomial of one trial for each pixel.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/emitters.h"
#include "server/render/render.h"
#include "tests/rig/tracer.h"
#include "tests/rig/vec.h"
#include "tests/truth/near_room.h"

enum { WIDTH = 14, HEIGHT = 10, PAIRS = 8, VALUES = 3 * WIDTH * HEIGHT };

/* P(|t| > 3), 7 degrees of freedom. */
#define BEYOND 0.01994
/* The mean over the pixels is this sharp, or the test would show nothing. */
#define MAX_MEAN_ERROR 3e-3

/* Light from a unit direction. */
typedef void (*paint_fn)(const double dir[static 3], float out_rgb[static 3]);

/* One light in both worlds. */
struct light {
    struct gn_rig_environment env;
    struct gn_radiance_map *map;
    struct gn_lighting_state state;
    struct gn_emitters *emitters; // of the near room
    struct gn_lighting_state *near;
};

/* One case. */
struct scenario {
    paint_fn paint;
    int map_height;
    int bounces;
    int n_paths;   // of the reference, for each pixel
    bool is_whole; // all objects are virtual
    bool is_near;  // the near room instead of the demo room
    double bound;  // > 0: quality interactive, off by no more than this share of the truth's mean
    enum gn_rig_finish finish; // of the teapot; ggx's or glass's numbers:
    double roughness, metallic;
};

/* Differences, reference less rig, and what they are differences of. */
struct findings {
    double difference[PAIRS][VALUES];
    double truth[VALUES], background[VALUES]; // the rig's, means
    bool is_mixed[VALUES];                    // a silhouette, in some pair
};

/* A sky brighter and bluer at its top, warmer towards one side. */
static void paint_sky(const double dir[static 3], float out_rgb[static 3])
{
    double up = 0.5 + 0.5 * dir[2], side = 0.5 + 0.5 * (0.8 * dir[0] - 0.6 * dir[1]);
    out_rgb[0] = (float)(0.2 + 0.5 * up + 1.5 * side * side);
    out_rgb[1] = (float)(0.2 + 0.8 * up + 0.9 * side * side);
    out_rgb[2] = (float)(0.3 + 1.4 * up + 0.3 * side);
}

/* Three broad lamps with soft rims, the rest black. */
static void paint_lamps(const double dir[static 3], float out_rgb[static 3])
{
    static const struct {
        double dir[3], radius; // rad
        double rgb[3];
    } lamps[] = {
        {{0.6428, 0.4924, 0.5868}, 0.35, {30, 24, 16}},
        {{-0.7660, 0.3214, 0.5567}, 0.30, {14, 22, 36}},
        {{0.1000, -0.5000, 0.8602}, 0.25, {20, 20, 20}},
    };
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
    for (size_t i = 0; i < sizeof(lamps) / sizeof(lamps[0]); i++) {
        double angle = acos(fmin(1, vec_dot(lamps[i].dir, dir) / vec_length(lamps[i].dir)));
        double share = angle / lamps[i].radius;
        for (int k = 0; k < 3 && share < 1; k++)
            out_rgb[k] += (float)(lamps[i].rgb[k] * (1 - share * share) * (1 - share * share));
    }
}

static void paint_both(const double dir[static 3], float out_rgb[static 3])
{
    float lamps[3];
    paint_sky(dir, out_rgb);
    paint_lamps(dir, lamps);
    for (int k = 0; k < 3; k++)
        out_rgb[k] += lamps[k];
}

static void paint_black(const double dir[static 3], float out_rgb[static 3])
{
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
}

/* The same texels as the rig's environment and as the server's radiance map. */
static void init_light(const struct scenario *scenario, const struct gn_scene *scene,
                       struct light *light)
{
    struct gn_image texels;
    struct gn_environment_frame frame = {
        .codes = &texels,
        .projection = {.type = GN_PROJECTION_LATLONG,
                       .width = 2 * scenario->map_height,
                       .height = scenario->map_height},
        .world_from_probe = {1, 0, 0, 0},
    };
    memset(light, 0, sizeof(*light));
    assert_int_equal(gn_image_init(&texels, 2 * scenario->map_height, scenario->map_height, 3), 0);
    for (int y = 0; y < texels.height; y++)
        for (int x = 0; x < texels.width; x++) {
            double theta = GN_RIG_PI * (y + 0.5) / texels.height;
            double phi = GN_RIG_PI - 2 * GN_RIG_PI * (x + 0.5) / texels.width;
            const double dir[3] = {sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
            scenario->paint(dir, gn_image_at(&texels, x, y));
        }
    assert_int_equal(gn_projection_init(&frame.projection, NULL), 0);
    assert_int_equal(gn_radiance_map_create(&frame, NULL, NULL, &light->map, NULL), 0);
    light->state.map = light->map;
    assert_int_equal(gn_pyramid_create(light->map, &light->state.pyramid), 0);
    assert_int_equal(gn_rig_environment_init(&texels, 0, &light->env, NULL), 0);
    if (scenario->is_near) {
        assert_int_equal(gn_emitters_create(scene, NULL, &light->emitters, NULL), 0);
        struct gn_emission *emission = gn_emitters_get_emission(light->emitters);
        assert_int_equal(gn_lighting_state_create_dark(emission, NULL, 0, &light->near, NULL), 0);
        gn_emission_unref(&emission);
        light->state.n_near = light->near->n_near;
        light->state.near = light->near->near;
        light->state.emission = light->near->emission;
    }
}

static void finish_light(struct light *light)
{
    gn_rig_environment_finish(&light->env);
    gn_lighting_state_unref(&light->near);
    gn_emitters_destroy(&light->emitters);
    gn_pyramid_unref(&light->state.pyramid);
    gn_radiance_map_unref(&light->map);
}

/* The demo room in plain colours: the server has no planks and no printed marker. For bounces it is
 * whitewashed, so that each of them brings much. */
static void init_demo_room(bool is_white, struct gn_rig_room *room)
{
    assert_int_equal(gn_rig_room_init_demo(false, room, NULL), 0);
    for (int i = 0; i < room->n_objects; i++) {
        struct gn_rig_object *o = &room->objects[i];
        o->finish = GN_RIG_DIFFUSE;
        for (int k = 0; k < 3 && is_white; k++)
            o->albedo[k] = 0.8 + 0.2 * o->albedo[k];
        for (int k = 0; o->mesh.albedos && k < 3 * o->mesh.n_triangles && is_white; k++)
            o->mesh.albedos[k] = 0.8f + 0.2f * o->mesh.albedos[k];
    }
}

/* Makes the teapot glossy. */
static void polish(const struct scenario *scenario, struct gn_rig_room *room)
{
    for (int i = 0; i < room->n_objects; i++) {
        struct gn_rig_object *o = &room->objects[i];
        if (strcmp(o->name, "teapot") != 0)
            continue;
        o->finish = scenario->finish;
        o->roughness = scenario->roughness;
        o->metallic = scenario->metallic;
        o->ior = 1.5;
        return;
    }
    fail_msg("no teapot");
}

static void init_room(const struct scenario *scenario, struct gn_rig_room *room)
{
    if (scenario->is_near)
        gn_near_room_init(room);
    else
        init_demo_room(scenario->bounces > 0, room);
    if (scenario->finish != GN_RIG_DIFFUSE)
        polish(scenario, room);
}

/* The same room as a server's scene. */
static struct gn_scene *make_scene(const struct scenario *scenario)
{
    struct gn_rig_room room;
    struct gn_scene_object *objects = calloc(GN_RIG_MAX_OBJECTS, sizeof(*objects));
    struct gn_scene *scene;
    assert_non_null(objects);
    init_room(scenario, &room);
    for (int i = 0; i < room.n_objects; i++) {
        struct gn_rig_object *o = &room.objects[i];
        objects[i] = (struct gn_scene_object){.name = strdup(o->name),
                                              .role = scenario->is_whole ? GN_RT_VIRTUAL : o->role,
                                              .has_material = !o->mesh.albedos,
                                              .mesh = o->mesh};
        if (o->finish == GN_RIG_GGX || o->finish == GN_RIG_GLASS)
            objects[i].material = (struct gn_material){
                .type = o->finish == GN_RIG_GGX ? GN_MATERIAL_GGX : GN_MATERIAL_GLASS,
                .roughness = (float)o->roughness,
                .metallic = (float)o->metallic,
                .ior = (float)o->ior};
        for (int k = 0; k < 3; k++) {
            objects[i].material.albedo[k] = (float)o->albedo[k];
            objects[i].emission[k] = (float)o->emission[k];
        }
        memcpy(objects[i].world_from_object, o->world_from_object, sizeof(o->world_from_object));
        memset(&o->mesh, 0, sizeof(o->mesh));
    }
    assert_int_equal(gn_scene_create(objects, room.n_objects, NULL, &scene, NULL), 0);
    free(objects);
    gn_near_room_set_lamps(&room, scene);
    gn_rig_room_finish(&room);
    return scene;
}

/* Teapot, its shadow and the boxes beside it. */
static struct gn_rig_view make_view(void)
{
    struct gn_rig_view view = {.width = WIDTH,
                               .height = HEIGHT,
                               .fx = 1.3 * WIDTH,
                               .fy = 1.3 * WIDTH,
                               .cx = WIDTH / 2.0,
                               .cy = HEIGHT / 2.0};
    const double position[3] = {0.04, -0.22, 0.22}, target[3] = {0, 0.085, 0.02};
    gn_rig_look_at(position, target, view.world_from_camera);
    return view;
}

/* The same camera, its grid of rays moved within the cell by the pair's share of it. */
static struct gn_camera make_camera(const struct gn_rig_view *view, int pair)
{
    struct gn_camera camera = {.width = view->width,
                               .height = view->height,
                               .fx = view->fx,
                               .fy = view->fy,
                               .response = {.type = GN_RESPONSE_SRGB}};
    // A lattice with one point in each eighth of both axes: evener than random, so that the spread
    // overstates its error rather than not.
    camera.cx = view->cx + ((pair + 0.5) / PAIRS - 0.5) / 4;
    camera.cy = view->cy + ((3 * pair % PAIRS + 0.5) / PAIRS - 0.5) / 4;
    assert_int_equal(gn_pose_from_matrix(view->world_from_camera, &camera.world_from_camera, NULL),
                     0);
    return camera;
}

/* What the server's layers make of the rig's background; false at a silhouette. */
static bool composite(const struct gn_layers *layers, int x, int y, const float *background,
                      double out[static 3])
{
    const float *rgba = gn_image_at(&layers->virtual_rgba, x, y);
    for (int k = 0; k < 3; k++) {
        double shadow = gn_image_at(&layers->shadow, x, y)[k];
        double added = gn_image_at(&layers->added, x, y)[k];
        out[k] = rgba[3] > 0 ? rgba[k] : shadow * background[k] + added;
    }
    return rgba[3] == 0 || rgba[3] == 1;
}

/* One pair's differences. */
static void compare(const struct scenario *scenario, const struct gn_rig_pictures *rig,
                    const struct gn_layers *layers, int pair, struct findings *findings)
{
    bool has_bounces = scenario->bounces > 0;
    const struct gn_image *truth = &rig->mean[has_bounces ? GN_RIG_TRUTH_BOUNCES : GN_RIG_TRUTH];
    const struct gn_image *background =
        &rig->mean[has_bounces ? GN_RIG_BACKGROUND_BOUNCES : GN_RIG_BACKGROUND];
    for (int i = 0; i < VALUES; i++) {
        int x = i / 3 % WIDTH, y = i / 3 / WIDTH, k = i % 3;
        double composed[3], covered = *gn_image_at(&rig->object, x, y);
        bool is_clear = composite(layers, x, y, gn_image_at(background, x, y), composed);
        double found =
            scenario->is_whole ? gn_image_at(&layers->virtual_rgba, x, y)[k] : composed[k];
        findings->is_mixed[i] |= !is_clear || (covered > 0 && covered < 1);
        findings->difference[pair][i] = found - gn_image_at(truth, x, y)[k];
        findings->truth[i] += gn_image_at(truth, x, y)[k] / PAIRS;
        findings->background[i] += gn_image_at(background, x, y)[k] / PAIRS;
    }
}

/* Mean of PAIRS numbers and its standard error. */
static double get_mean(const double values[static PAIRS], double *out_error)
{
    double mean = 0, squares = 0;
    for (int p = 0; p < PAIRS; p++)
        mean += values[p] / PAIRS;
    for (int p = 0; p < PAIRS; p++)
        squares += (values[p] - mean) * (values[p] - mean);
    *out_error = sqrt(squares / (PAIRS - 1) / PAIRS);
    return mean;
}

/* No more values beyond 3 standard errors than chance puts there, and in each channel the mean over
 * all within 3 of its own. */
static void judge(const struct scenario *scenario, const char *name,
                  const struct findings *findings)
{
    double total[3][PAIRS] = {{0}}, signal[3] = {0}, off[3] = {0};
    int n = 0, n_beyond = 0, n_mixed = 0;
    for (int i = 0; i < VALUES; i++) {
        double values[PAIRS], error;
        double change = fabs(findings->truth[i] - findings->background[i]);
        bool is_shown = scenario->is_whole || change > findings->background[i] / 255;
        if (!is_shown || (findings->is_mixed[i] && !(scenario->is_whole && !scenario->is_near)))
            continue;
        for (int p = 0; p < PAIRS; p++) {
            values[p] = findings->difference[p][i];
            total[i % 3][p] += values[p];
        }
        signal[i % 3] += findings->truth[i];
        n++;
        n_mixed += findings->is_mixed[i];
        double mean = get_mean(values, &error);
        off[i % 3] += fabs(mean);
        n_beyond += fabs(mean) > 3 * error;
    }
    print_message("# %s: %d values (%d at silhouettes), %.1f %% beyond 3 standard errors\n", name,
                  n, n_mixed, 100.0 * n_beyond / n);
    for (int k = 0; k < 3; k++) {
        double error, mean = get_mean(total[k], &error);
        print_message("# %s: mean difference %+.3f %% +- %.3f %%, off by %.3f %%\n", name,
                      100 * mean / signal[k], 100 * error / signal[k], 100 * off[k] / signal[k]);
        if (scenario->bound > 0) {
            assert_true(off[k] <= scenario->bound * signal[k]);
            continue;
        }
        assert_true(error < MAX_MEAN_ERROR * signal[k]);
        assert_true(fabs(mean) <= 3 * error);
    }
    assert_true(n >= VALUES / 4);
    double n_pixels = n / 3.0;
    assert_true(scenario->bound > 0 ||
                n_beyond / 3.0 <= BEYOND * n_pixels + 4 * sqrt(BEYOND * (1 - BEYOND) * n_pixels));
}

/* PAIRS pictures of each renderer, each pair with random numbers of its own. */
static void run(const struct scenario *scenario, const char *name)
{
    struct findings *findings = calloc(1, sizeof(*findings));
    struct gn_rig_room room;
    struct light light;
    struct gn_scene *scene = make_scene(scenario);
    struct gn_renderer *renderer;
    struct gn_layers layers;
    struct gn_render_report report;
    struct gn_rig_view view = make_view();
    assert_non_null(findings);
    init_room(scenario, &room);
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    init_light(scenario, scene, &light);
    assert_int_equal(gn_renderer_create(scene, NULL, &renderer, NULL), 0);
    assert_int_equal(gn_layers_init(&layers, WIDTH, HEIGHT), 0);
    for (int pair = 0; pair < PAIRS; pair++) {
        struct gn_rig_render_options rig_options = {
            .bounces = scenario->bounces,
            .batches = 2,
            // Its glossy paths meet the lamps by chance alone.
            .batch_size = scenario->finish != GN_RIG_DIFFUSE ? 1024 : 256,
            .frame = pair};
        struct gn_render_options options = {.quality = scenario->bound > 0 ? GN_QUALITY_INTERACTIVE
                                                                           : GN_QUALITY_REFERENCE,
                                            .supersample_all = true,
                                            .bounces = scenario->bounces,
                                            .paths_per_pixel = scenario->n_paths,
                                            .seed = (uint64_t)pair};
        struct gn_camera camera = make_camera(&view, pair);
        struct gn_rig_pictures rig;
        assert_int_equal(gn_rig_render(&room, &light.env, &view, &rig_options, NULL, &rig, NULL),
                         0);
        assert_int_equal(
            gn_renderer_render(renderer, &camera, &light.state, &options, &layers, &report, NULL),
            0);
        compare(scenario, &rig, &layers, pair, findings);
        gn_rig_pictures_finish(&rig);
    }
    judge(scenario, name, findings);
    gn_layers_finish(&layers);
    gn_renderer_destroy(&renderer);
    finish_light(&light);
    gn_rig_room_finish(&room);
    gn_scene_destroy(&scene);
    free(findings);
}

static void test_whole_sky(void **state)
{
    const struct scenario s = {.paint = paint_sky, .map_height = 56, .is_whole = true};
    (void)state;
    run(&s, "whole, sky");
}

static void test_whole_lamps(void **state)
{
    const struct scenario s = {.paint = paint_lamps, .map_height = 96, .is_whole = true};
    (void)state;
    run(&s, "whole, lamps");
}

static void test_whole_bounces(void **state)
{
    const struct scenario s = {
        .paint = paint_both, .map_height = 48, .bounces = 2, .n_paths = 512, .is_whole = true};
    (void)state;
    run(&s, "whole, 2 bounces");
}

static void test_layers_sky(void **state)
{
    const struct scenario s = {.paint = paint_sky, .map_height = 56};
    (void)state;
    run(&s, "layers, sky");
}

static void test_layers_lamps(void **state)
{
    const struct scenario s = {.paint = paint_lamps, .map_height = 96};
    (void)state;
    run(&s, "layers, lamps");
}

static void test_layers_bounces(void **state)
{
    const struct scenario s = {.paint = paint_both, .map_height = 48, .bounces = 2, .n_paths = 512};
    (void)state;
    run(&s, "layers, 2 bounces");
}

static void test_near_whole(void **state)
{
    const struct scenario s = {
        .paint = paint_black, .map_height = 4, .is_near = true, .is_whole = true};
    (void)state;
    run(&s, "near, whole");
}

static void test_near_whole_bounces(void **state)
{
    const struct scenario s = {.paint = paint_black,
                               .map_height = 4,
                               .bounces = 2,
                               .n_paths = 512,
                               .is_near = true,
                               .is_whole = true};
    (void)state;
    run(&s, "near, whole, 2 bounces");
}

static void test_near_layers(void **state)
{
    const struct scenario s = {.paint = paint_black, .map_height = 4, .is_near = true};
    (void)state;
    run(&s, "near, layers");
}

static void test_near_layers_bounces(void **state)
{
    const struct scenario s = {
        .paint = paint_black, .map_height = 4, .bounces = 2, .n_paths = 512, .is_near = true};
    (void)state;
    run(&s, "near, layers, 2 bounces");
}

static void test_near_layers_interactive(void **state)
{
    const struct scenario s = {
        .paint = paint_black, .map_height = 4, .is_near = true, .bound = 0.01};
    (void)state;
    run(&s, "near, layers, interactive");
}

static void test_glossy_metal(void **state)
{
    const struct scenario s = {.paint = paint_both,
                               .map_height = 64,
                               .n_paths = 512,
                               .is_whole = true,
                               .finish = GN_RIG_GGX,
                               .roughness = 0.5,
                               .metallic = 1};
    (void)state;
    run(&s, "glossy, metal");
}

static void test_glossy_lacquer(void **state)
{
    const struct scenario s = {.paint = paint_sky,
                               .map_height = 56,
                               .bounces = 1,
                               .n_paths = 512,
                               .is_whole = true,
                               .finish = GN_RIG_GGX,
                               .roughness = 0.3,
                               .metallic = 0.25};
    (void)state;
    run(&s, "glossy, lacquer, 1 bounce");
}

static void test_glass(void **state)
{
    const struct scenario s = {.paint = paint_sky,
                               .map_height = 56,
                               .bounces = 1,
                               .n_paths = 512,
                               .is_whole = true,
                               .finish = GN_RIG_GLASS};
    (void)state;
    run(&s, "glass, 1 bounce");
}

/* Caustics: photons and walks here, walks alone in the rig. */
static void test_glass_layers(void **state)
{
    const struct scenario s = {.paint = paint_both,
                               .map_height = 64,
                               .bounces = 1,
                               .n_paths = 512,
                               .finish = GN_RIG_GLASS};
    (void)state;
    run(&s, "glass, layers, 1 bounce");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_glossy_metal),
        cmocka_unit_test(test_glossy_lacquer),
        cmocka_unit_test(test_glass),
        cmocka_unit_test(test_glass_layers),
        cmocka_unit_test(test_whole_sky),
        cmocka_unit_test(test_whole_lamps),
        cmocka_unit_test(test_whole_bounces),
        cmocka_unit_test(test_layers_sky),
        cmocka_unit_test(test_layers_lamps),
        cmocka_unit_test(test_layers_bounces),
        cmocka_unit_test(test_near_whole),
        cmocka_unit_test(test_near_whole_bounces),
        cmocka_unit_test(test_near_layers),
        cmocka_unit_test(test_near_layers_bounces),
        cmocka_unit_test(test_near_layers_interactive),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
