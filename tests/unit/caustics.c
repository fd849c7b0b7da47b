/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light that virtual mirrors and glass throw onto real surfaces, at reference quality. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/stage.h"

enum { WIDTH = 120, HEIGHT = 90, MAP_WIDTH = 512, MAP_HEIGHT = 256 };

static const float grey[3] = {0.6f, 0.5f, 0.4f};
static const float white[3] = {1, 1, 1};
static const float silver[3] = {0.9f, 0.8f, 0.7f};

/** A sun of one texel, 0.7 degrees wide; the rest is black. */
static void paint_sun(void *context, const double dir[static 3], float out_rgb[static 3])
{
    const double *sun = context;
    double c = dir[0] * sun[0] + dir[1] * sun[1] + dir[2] * sun[2];
    for (int k = 0; k < 3; k++)
        out_rgb[k] = c > 1 - 1e-9 ? (float)(1e4 * (1 + k)) : 0;
}

/** The direction of a texel's centre, and the map of that sun. */
static void set_sun(struct gn_test_stage *stage, int x, int y, double out_dir[static 3])
{
    double theta = M_PI * (y + 0.5) / MAP_HEIGHT;
    double phi = M_PI - 2 * M_PI * (x + 0.5) / MAP_WIDTH;
    out_dir[0] = sin(theta) * cos(phi);
    out_dir[1] = sin(theta) * sin(phi);
    out_dir[2] = cos(theta);
    gn_test_stage_set_map(stage, MAP_WIDTH, MAP_HEIGHT, paint_sun, out_dir);
}

/** Irradiance of all of the map at normal incidence, W/m^2. */
static double get_irradiance(const struct gn_test_stage *stage, int k)
{
    double sum = 0;
    for (int i = 0; i < MAP_WIDTH * MAP_HEIGHT; i++)
        sum += (double)stage->map->radiance.data[3 * i + k] * stage->map->solid_angle[i];
    return sum;
}

static const struct gn_plan_entry *get_line(const struct gn_test_stage *stage, const char *pass)
{
    for (int i = 0; i < stage->report.n_plan; i++) {
        if (strcmp(stage->report.plan[i].pass, pass) == 0)
            return &stage->report.plan[i];
    }
    fail_msg("no line %s", pass);
    return NULL;
}

static void add_floor(struct gn_test_stage *stage)
{
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(12, 3), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
}

/** A virtual mirror of 1 m at (0, 0, 1) that throws the light of dir straight down. */
static void add_panel(struct gn_test_stage *stage, const double dir[static 3])
{
    double n[3] = {dir[0], dir[1], dir[2] - 1};
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_plane(1, 2), 0, 0, 0, GN_MATERIAL_MIRROR,
                      silver);
    double *m = stage->objects[stage->n_objects - 1].world_from_object;
    double flat = hypot(n[0], n[1]) / length;
    const double z[3] = {n[0] / length, n[1] / length, n[2] / length};
    const double x[3] = {-z[1] / flat, z[0] / flat, 0};
    const double y[3] = {z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2],
                         z[0] * x[1] - z[1] * x[0]};
    for (int k = 0; k < 3; k++) {
        m[4 * k] = x[k];
        m[4 * k + 1] = y[k];
        m[4 * k + 2] = z[k];
    }
    m[11] = 1;
}

static void init_panel(struct gn_test_stage *stage, int n_threads)
{
    static const double eye[3] = {3, -4, 3};
    static const double target[3] = {0, 0, 0.2};
    double dir[3];
    add_floor(stage);
    // The texel's direction must be known before the scene is: a stage of its own for it.
    struct gn_test_stage other = {0};
    add_floor(&other);
    gn_test_stage_commit(&other, 0);
    set_sun(&other, MAP_WIDTH / 2 + 10, MAP_HEIGHT / 2 - 20, dir);
    gn_test_stage_finish(&other);
    add_panel(stage, dir);
    gn_test_stage_commit(stage, n_threads);
    set_sun(stage, MAP_WIDTH / 2 + 10, MAP_HEIGHT / 2 - 20, dir);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 120, eye, target);
}

static void test_a_panel_throws_all_its_light_down(void **state)
{
    (void)state;
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = true, .paths_per_pixel = 256};
    struct gn_test_stage stage = {0};
    double sums[3] = {0};
    int n = 0;
    init_panel(&stage, 2);
    gn_test_stage_render(&stage, &options);
    assert_true(get_line(&stage, "caustics")->ran);
    assert_true(get_line(&stage, "added")->ran);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double p[3];
        const float *added = gn_image_at(&stage.layers.added, i % WIDTH, i / WIDTH);
        bool is_open = gn_image_at(&stage.layers.virtual_rgba, i % WIDTH, i / WIDTH)[3] == 0;
        gn_test_stage_get_point(&stage, i % WIDTH + 0.5, i / WIDTH + 0.5, 0, p);
        // The spot is the panel's outline on the floor, 1 m one way and about 0.65 m the other.
        if (is_open && fabs(p[0]) > 0.75 && fabs(p[1]) > 0.75)
            assert_true(added[0] == 0);
        if (!is_open || hypot(p[0], p[1]) > 0.25)
            continue;
        n++;
        for (int k = 0; k < 3; k++)
            sums[k] += (double)added[k];
    }
    assert_true(n > 10);
    for (int k = 0; k < 3; k++) {
        double expected = grey[k] / M_PI * silver[k] * get_irradiance(&stage, k);
        print_message("# %d pixels: %.4f, expected %.4f\n", n, sums[k] / n, expected);
        assert_float_equal(sums[k] / n / expected, 1, 0.005);
    }
    gn_test_stage_finish(&stage);
}

/** Where a ball of radius 1 of glass sends a ray at height h > 0 of a parallel beam: the height a
 * distance z behind the ball's centre; and the share of its light that goes straight through. */
static double bend(double h, double ior, double z, double *out_passed)
{
    double in = asin(h);
    double inside = asin(h / ior);
    double exit = 2 * inside - in; // of the point where it leaves, from the axis
    double s = sin(in - inside) / sin(in + inside);
    double p = tan(in - inside) / tan(in + inside);
    double passed = 1 - 0.5 * (s * s + p * p);
    *out_passed = passed * passed;
    return sin(exit) - (z - cos(exit)) * tan(2 * (in - inside));
}

/** Flux through the disc of the radius at z, of a beam of 1 W/m^2. */
static double get_expected_flux(double radius, double z)
{
    enum { STEPS = 20000 };
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        double h = (i + 0.5) / STEPS;
        double passed;
        if (fabs(bend(h, 1.5, z, &passed)) < radius)
            sum += passed * 2 * M_PI * h / STEPS;
    }
    return sum;
}

/** What the picture's position sees of the wall x = -2. */
static void get_wall_point(const struct gn_test_stage *stage, double x, double y,
                           double out[static 3])
{
    double dir[3];
    const double *eye = stage->camera.world_from_camera.translation;
    assert_true(gn_camera_get_ray(&stage->camera, x, y, dir));
    gn_pose_rotate(&stage->camera.world_from_camera, dir, dir);
    for (int k = 0; k < 3; k++)
        out[k] = eye[k] + dir[k] * (-2 - eye[0]) / dir[0];
}

/** The area of the wall that a pixel sees, m^2. */
static double get_area(const struct gn_test_stage *stage, int x, int y)
{
    double p[4][3];
    get_wall_point(stage, x, y + 0.5, p[0]);
    get_wall_point(stage, x + 1, y + 0.5, p[1]);
    get_wall_point(stage, x + 0.5, y, p[2]);
    get_wall_point(stage, x + 0.5, y + 1, p[3]);
    return fabs((p[1][1] - p[0][1]) * (p[3][2] - p[2][2]) -
                (p[1][2] - p[0][2]) * (p[3][1] - p[2][1]));
}

static void init_ball(struct gn_test_stage *stage)
{
    static const double turned[16] = {0, 0, 1, -2, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1};
    static const double eye[3] = {-0.5, -3.5, 0.4};
    static const double target[3] = {-2, 0, 0};
    double dir[3];
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(12, 3), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    memcpy(stage->objects[0].world_from_object, turned, sizeof(turned));
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(1, 128), 0, 0, 0, GN_MATERIAL_GLASS,
                      white);
    gn_test_stage_commit(stage, 2);
    // The texel beside the map's middle: half of one, 0.35 degrees, off the x axis both ways.
    set_sun(stage, MAP_WIDTH / 2, MAP_HEIGHT / 2, dir);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, 280, eye, target);
}

static void test_a_ball_of_glass_gathers_sunlight(void **state)
{
    (void)state;
    static const double radii[2] = {0.25, 0.5};
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = true, .paths_per_pixel = 256};
    struct gn_test_stage stage = {0};
    double flux[2] = {0};
    init_ball(&stage);
    gn_test_stage_render(&stage, &options);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH;
        int y = i / WIDTH;
        double p[3];
        get_wall_point(&stage, x + 0.5, y + 0.5, p);
        // The beam's middle, at twice the sine of 0.35 degrees.
        double r = hypot(p[1] - 0.0123, p[2] - 0.0123);
        double irradiance =
            (double)gn_image_at(&stage.layers.added, x, y)[0] * M_PI / (double)grey[0];
        for (int j = 0; j < 2; j++)
            flux[j] += r < radii[j] ? irradiance * get_area(&stage, x, y) : 0;
    }
    for (int j = 0; j < 2; j++) {
        double expected = get_irradiance(&stage, 0) * get_expected_flux(radii[j], 2);
        print_message("# within %.2f: %.4f W, expected %.4f W\n", radii[j], flux[j], expected);
        assert_float_equal(flux[j] / expected, 1, 0.01);
    }
    gn_test_stage_finish(&stage);
}

static void paint_black(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 0;
}

/** A lamp under a mirror lights the floor a second time, from where its image is. */
static void test_a_mirror_shows_the_floor_a_lamp(void **state)
{
    (void)state;
    static const double eye[3] = {2.5, -2.5, 0.8};
    static const double target[3] = {0, 0, 0};
    struct gn_near_light lamp = {.position_world = {0, 0, 0.5},
                                 .intensity = {3, 2, 1},
                                 .role = GN_RT_REAL,
                                 .object = GN_NEAR_NO_OBJECT,
                                 .id = 1};
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = true, .paths_per_pixel = 128};
    struct gn_test_stage stage = {0};
    double sums[3] = {0};
    double expected[3] = {0};
    add_floor(&stage);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(1, 2), 0, 0, 1, GN_MATERIAL_MIRROR,
                      silver);
    gn_test_stage_commit(&stage, 2);
    gn_test_stage_set_map(&stage, 16, 8, paint_black, NULL);
    stage.state.n_near = 1;
    stage.state.near = &lamp;
    gn_test_stage_aim(&stage, WIDTH, HEIGHT, 120, eye, target);
    gn_test_stage_render(&stage, &options);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double p[3];
        gn_test_stage_get_point(&stage, i % WIDTH + 0.5, i / WIDTH + 0.5, 0, p);
        if (gn_image_at(&stage.layers.virtual_rgba, i % WIDTH, i / WIDTH)[3] > 0 ||
            fabs(p[0]) > 1.4 || fabs(p[1]) > 1.4)
            continue;
        double distance2 = p[0] * p[0] + p[1] * p[1] + 1.5 * 1.5;
        for (int k = 0; k < 3; k++) {
            sums[k] += (double)gn_image_at(&stage.layers.added, i % WIDTH, i / WIDTH)[k];
            expected[k] += grey[k] / M_PI * silver[k] * lamp.intensity[k] * 1.5 /
                           (distance2 * sqrt(distance2));
        }
    }
    for (int k = 0; k < 3; k++) {
        print_message("# %.4f, expected %.4f\n", sums[k], expected[k]);
        assert_float_equal(sums[k] / expected[k], 1, 0.005);
    }
    gn_test_stage_finish(&stage);
}

static void test_the_same_bits_on_any_number_of_threads(void **state)
{
    (void)state;
    const struct gn_render_options options = {
        .quality = GN_QUALITY_REFERENCE, .single_ray = true, .paths_per_pixel = 256};
    const struct gn_render_options all = {.quality = GN_QUALITY_REFERENCE,
                                          .single_ray = true,
                                          .paths_per_pixel = 256, // many chunks, two rounds
                                          .all_passes = true};
    struct gn_test_stage stages[3] = {{0}};
    size_t n = (size_t)WIDTH * HEIGHT * 3 * sizeof(float);
    for (int i = 0; i < 3; i++) {
        init_panel(&stages[i], i == 2 ? 3 : i);
        gn_test_stage_render(&stages[i], i == 2 ? &all : &options);
    }
    assert_memory_equal(stages[0].layers.added.data, stages[1].layers.added.data, n);
    assert_memory_equal(stages[0].layers.added.data, stages[2].layers.added.data, n);
    assert_memory_equal(stages[0].layers.shadow.data, stages[2].layers.shadow.data, n);
    for (int i = 0; i < 3; i++)
        gn_test_stage_finish(&stages[i]);
}

static void test_the_plan_says_why_not(void **state)
{
    (void)state;
    static const double up[3] = {0, 0, 9};
    static const double eye[3] = {3, -4, 3};
    struct gn_render_options options = {.single_ray = true};
    struct gn_test_stage stage = {0};
    init_panel(&stage, 2);
    gn_test_stage_set_lights_from_map(&stage, 4);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage, "caustics")->ran);
    assert_string_equal(get_line(&stage, "caustics")->why, "caustics are of the reference quality");
    options.quality = GN_QUALITY_REFERENCE;
    options.paths_per_pixel = 1;
    gn_test_stage_aim(&stage, WIDTH, HEIGHT, 120, eye, up);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage, "caustics")->ran);
    assert_string_equal(get_line(&stage, "caustics")->why, "the camera sees none");
    gn_test_stage_finish(&stage);

    double dir[3];
    add_floor(&stage);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 12), 0, 0, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    set_sun(&stage, MAP_WIDTH / 2, MAP_HEIGHT / 4, dir);
    gn_test_stage_aim(&stage, WIDTH, HEIGHT, 20, eye, up);
    gn_test_stage_render(&stage, &options);
    assert_false(get_line(&stage, "caustics")->ran);
    assert_string_equal(get_line(&stage, "caustics")->why,
                        "no mirror or glass among the virtual objects");
    assert_int_equal(stage.report.rays_shade, 0);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_panel_throws_all_its_light_down),
        cmocka_unit_test(test_a_mirror_shows_the_floor_a_lamp),
        cmocka_unit_test(test_the_same_bits_on_any_number_of_threads),
        cmocka_unit_test(test_the_plan_says_why_not),
        cmocka_unit_test(test_a_ball_of_glass_gathers_sunlight),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
