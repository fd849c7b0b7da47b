/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The rig's path tracer against closed forms, its error bars against its spread, and the same bits
 * on any number of threads. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/rig/tracer.h"
#include "tests/rig/vec.h"

static const double at_origin[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

static void add(struct gn_rig_room *room, enum gn_rt_set role, enum gn_rig_finish finish,
                struct gn_mesh mesh, double height, double albedo)
{
    struct gn_rig_object o = {.name = "thing",
                              .role = role,
                              .finish = finish,
                              .mesh = mesh,
                              .albedo = {albedo, albedo, albedo}};
    memcpy(o.world_from_object, at_origin, sizeof(at_origin));
    o.world_from_object[11] = height;
    assert_int_equal(gn_rig_room_add(room, &o), 0);
}

/* A real plane of 200 m at z = 0 and a virtual sphere of radius 0.25 with its middle at 0.5. */
static struct gn_rig_room make_sphere_room(enum gn_rig_finish finish, double albedo)
{
    struct gn_rig_room room = {0};
    add(&room, GN_RT_REAL, finish, gn_test_make_plane(200, 1), 0, albedo);
    add(&room, GN_RT_VIRTUAL, GN_RIG_DIFFUSE, gn_test_make_sphere(0.25f, 64), 0.5, albedo);
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    return room;
}

static struct gn_rig_environment make_constant(float radiance)
{
    struct gn_rig_environment env;
    struct gn_image map;
    assert_int_equal(gn_image_init(&map, 64, 32, 3), 0);
    for (int i = 0; i < 3 * 64 * 32; i++)
        map.data[i] = radiance;
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    return env;
}

static struct gn_rig_view make_view(int size, double focal, double x, double z)
{
    struct gn_rig_view view = {.width = size,
                               .height = size,
                               .fx = focal,
                               .fy = focal,
                               .cx = size / 2.0,
                               .cy = size / 2.0};
    const double position[3] = {x, 0, z}, target[3] = {0};
    gn_rig_look_at(position, target, view.world_from_camera);
    return view;
}

/* Mean over the picture and its standard error, green. */
static double get_mean(const struct gn_image *mean, const struct gn_image *error, double *out_error)
{
    double sum = 0, squares = 0, n = (double)mean->width * mean->height;
    for (int i = 0; i < mean->width * mean->height; i++) {
        sum += mean->data[3 * i + 1];
        squares += error->data[3 * i + 1] * (double)error->data[3 * i + 1];
    }
    *out_error = sqrt(squares) / n;
    return sum / n;
}

/* Under a constant sky the foot of a sphere keeps 1 - (a / h)^2 of its light. */
static void test_sphere_shadow(void **state)
{
    struct gn_rig_room room = make_sphere_room(GN_RIG_DIFFUSE, 0.5);
    struct gn_rig_environment env = make_constant(2);
    struct gn_rig_view view = make_view(8, 4000, 3, 0.2); // 6 mm of plane across the picture
    struct gn_rig_render_options options = {.batch_size = 256, .seed = 4};
    struct gn_rig_pictures p;
    double error;
    (void)state;
    assert_int_equal(gn_rig_render(&room, &env, &view, &options, NULL, &p, NULL), 0);
    double lit = get_mean(&p.mean[GN_RIG_BACKGROUND], &p.error[GN_RIG_BACKGROUND], &error);
    assert_true(fabs(lit - 1) < 3e-3); // albedo / pi * E, E = pi L, but for the horizon's sliver
    double shadowed = get_mean(&p.mean[GN_RIG_TRUTH], &p.error[GN_RIG_TRUTH], &error);
    print_message("# foot of the sphere: %.5f +- %.5f of 0.75\n", shadowed / lit, error);
    assert_true(error < 1e-3 && fabs(shadowed / lit - 0.75) < 3 * error + 5e-4);
    gn_rig_pictures_finish(&p);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

/* White surfaces in a white furnace: nothing is brighter than the sky, and after eight bounces
 * little is missing. */
static void test_furnace(void **state)
{
    struct gn_rig_room room = make_sphere_room(GN_RIG_DIFFUSE, 1);
    struct gn_rig_environment env = make_constant(1);
    struct gn_rig_view view = make_view(16, 20, 1.2, 0.8);
    struct gn_rig_render_options options = {.bounces = 8, .batch_size = 64};
    struct gn_rig_pictures p;
    double error, direct_error;
    (void)state;
    assert_int_equal(gn_rig_render(&room, &env, &view, &options, NULL, &p, NULL), 0);
    double all = get_mean(&p.mean[GN_RIG_TRUTH_BOUNCES], &p.error[GN_RIG_TRUTH_BOUNCES], &error);
    double direct = get_mean(&p.mean[GN_RIG_TRUTH], &p.error[GN_RIG_TRUTH], &direct_error);
    print_message("# furnace: %.5f +- %.5f of 1 with 8 bounces, %.3f with none\n", all, error,
                  direct);
    assert_true(all < 1 + 3 * error + 1e-6 && all > 0.998); // pictures are floats
    assert_true(direct < 0.95);
    gn_rig_pictures_finish(&p);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

/* Lamps and walls on a bare plane: albedo / pi times the irradiance that the map's sum gives. */
static void test_lamps(void **state)
{
    struct gn_rig_room room = {0};
    struct gn_rig_environment env;
    struct gn_image map;
    struct gn_rig_view view = make_view(8, 4000, 0.5, 0.5);
    struct gn_rig_render_options options = {.batch_size = 256};
    struct gn_rig_pictures p;
    const double up[3] = {0, 0, 1};
    double rgb[3], error;
    (void)state;
    assert_int_equal(gn_rig_paint_lamp_room(512, 256, 3, NULL, &map), 0);
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    add(&room, GN_RT_REAL, GN_RIG_DIFFUSE, gn_test_make_plane(200, 1), 0, 0.5);
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    assert_int_equal(gn_rig_render(&room, &env, &view, &options, NULL, &p, NULL), 0);
    gn_rig_environment_get_irradiance(&env, up, rgb);
    double found = get_mean(&p.mean[GN_RIG_TRUTH], &p.error[GN_RIG_TRUTH], &error);
    double expected = 0.5 / GN_RIG_PI * rgb[1];
    print_message("# lamps: %.5f +- %.5f of %.5f\n", found, error, expected);
    assert_true(error < 1e-3 * expected);
    assert_true(fabs(found - expected) < 3 * error + 1e-3 * expected);
    gn_rig_pictures_finish(&p);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

/* A mirror shows the sky times its reflectance, with no noise. */
static void test_mirror(void **state)
{
    struct gn_rig_room room = {0};
    struct gn_rig_environment env = make_constant(3);
    struct gn_rig_view view = make_view(4, 50, 1, 1);
    struct gn_rig_render_options options = {.batch_size = 4};
    struct gn_rig_pictures p;
    (void)state;
    add(&room, GN_RT_REAL, GN_RIG_MIRROR, gn_test_make_plane(4, 1), 0, 0.5);
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    assert_int_equal(gn_rig_render(&room, &env, &view, &options, NULL, &p, NULL), 0);
    for (int i = 0; i < 3 * 4 * 4; i++)
        assert_true(p.mean[GN_RIG_TRUTH].data[i] == 1.5f && p.error[GN_RIG_TRUTH].data[i] == 0);
    gn_rig_pictures_finish(&p);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

static void render_lamps(const struct gn_rig_room *room, const struct gn_rig_environment *env,
                         uint64_t seed, int threads, struct gn_rig_pictures *out)
{
    struct gn_rig_view view = make_view(40, 45, -0.1, 0.3);
    struct gn_rig_render_options options = {.bounces = 4, .batch_size = 16, .seed = seed};
    struct gn_pool *pool;
    const double position[3] = {0.05, -0.4, 0.3}, target[3] = {0.01, 0.06, 0};
    gn_rig_look_at(position, target, view.world_from_camera);
    assert_int_equal(gn_pool_create(threads, &pool), 0);
    assert_int_equal(gn_rig_render(room, env, &view, &options, pool, out, NULL), 0);
    gn_pool_destroy(&pool);
}

/* One thread or three: the same bits. Another seed: as far away as the error bars say. And where
 * the teapot changes nothing, background and truth agree to the bit. */
static void test_demo_room(void **state)
{
    struct gn_rig_room room;
    struct gn_rig_environment env;
    struct gn_rig_pictures a, b, c;
    struct gn_image map;
    double spread = 0, claimed = 0;
    int same = 0, n = 40 * 40;
    (void)state;
    assert_int_equal(gn_rig_room_init_demo(false, &room, NULL), 0);
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    assert_int_equal(gn_rig_paint_lamp_room(256, 128, 3, NULL, &map), 0);
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    render_lamps(&room, &env, 1, 1, &a);
    render_lamps(&room, &env, 1, 3, &b);
    render_lamps(&room, &env, 2, 2, &c);
    for (int p = 0; p < GN_RIG_PICTURES; p++) {
        size_t bytes = 3 * (size_t)n * sizeof(float);
        assert_memory_equal(a.mean[p].data, b.mean[p].data, bytes);
        assert_memory_equal(a.error[p].data, b.error[p].data, bytes);
        for (int i = 0; i < 3 * n; i++) {
            spread += pow((double)a.mean[p].data[i] - c.mean[p].data[i], 2);
            claimed += pow(a.error[p].data[i], 2) + pow(c.error[p].data[i], 2);
        }
    }
    print_message("# spread over claimed variance: %.3f\n", spread / claimed);
    assert_true(spread / claimed > 0.8 && spread / claimed < 1.25);
    for (int i = 0; i < 3 * n; i++)
        same += a.mean[GN_RIG_TRUTH].data[i] == a.mean[GN_RIG_BACKGROUND].data[i];
    assert_true(same > 3 * n / 4 && same < 3 * n);
    gn_rig_pictures_finish(&a);
    gn_rig_pictures_finish(&b);
    gn_rig_pictures_finish(&c);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere_shadow), cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_lamps),         cmocka_unit_test(test_mirror),
        cmocka_unit_test(test_demo_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
