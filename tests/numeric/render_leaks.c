/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Whole frames at all scales and far from the origin: no point of a lit surface hides light from
 * itself (acne), no light gets into what is closed (leaks). Steps between coordinates: see
 * render_scales.c. Under sanitizers the least and the greatest of scales and distances.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>

#include "proto/attr.h"
#include "tests/meshes.h"
#include "tests/numeric/extreme.h"
#include "tests/sanitized.h"

#define SIDE 24
#define N_PIXELS (SIDE * SIDE)
#define FOCAL 18
#define DEGREE (M_PI / 180)

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const struct gn_render_options one_ray = {.single_ray = true};
static const double scales[] = {1e-3, 1, 1e3, 1e6};
static const double distances[] = {0, 1e2, 1e4};

/** Calls test at all scales and distances, for a plane of one cell and of 16 x 16. */
static void for_all_places(void (*test)(const struct gn_extreme_place *place, int n, double step))
{
    for (size_t s = 0; s < GN_ARRAY_LEN(scales); s = gn_test_get_next(s, GN_ARRAY_LEN(scales))) {
        for (size_t d = 0; d < GN_ARRAY_LEN(distances);
             d = gn_test_get_next(d, GN_ARRAY_LEN(distances))) {
            const struct gn_extreme_place place = gn_extreme_away(scales[s], distances[d]);
            test(&place, 1, gn_extreme_get_step(distances[d]));
            test(&place, 16, gn_extreme_get_step(distances[d]));
        }
    }
}

/** By how much rounding tilts cells of that size, rad: three axes of half a step at each end. */
static double get_tilt(double step, double cell)
{
    return 2.5 * step / cell + 1e-6;
}

/** Elevation of a grazing light, rad: 0.1 degrees, more where cells tilt by as much. */
static double get_elevation(double tilt)
{
    return fmax(0.1 * DEGREE, 1.6 * tilt);
}

static void judge_floor(void *context, const struct gn_extreme_view *view)
{
    const double *angles = context; // elevation and tilt
    double sine = sin(angles[0]);
    double low = sin(angles[0] - angles[1]);
    double high = sin(angles[0] + angles[1]);
    if (view->quality == GN_QUALITY_REFERENCE)
        return; // it is lit by the map
    for (int i = 0; i < N_PIXELS; i++) {
        double factor = (double)view->layers->shadow.data[3 * i];
        assert_true(view->layers->virtual_rgba.data[4 * i + 3] == 0);
        if (view->quality == GN_QUALITY_SEED)
            assert_true(fabs(factor - 1 / (1 + sine)) < 1e-6);
        else
            assert_true(factor >= low / (sine + low) - 1e-6 &&
                        factor <= high / (sine + high) + 1e-6);
    }
}

/* All of a real floor is in the shadow that a roof throws of the light above; the light that comes
 * in under it, from 89.9 degrees, is what is left, and reaches every point. */
static void check_floor(const struct gn_extreme_place *place, int n, double step)
{
    static const double eye[3] = {0, -0.3, 0.9}, target[3] = {0, 0, 0};
    double tilt = get_tilt(step, 2.0 / n);
    double angles[2] = {get_elevation(tilt), tilt};
    const float up = (float)sin(angles[0]);
    const struct gn_light lights[2] = {
        {.dir_world = {0, 0, 1}, .irradiance = {up, up, up}},
        {.dir_world = {0.6f * (float)cos(angles[0]), 0.8f * (float)cos(angles[0]), up},
         .irradiance = {1, 1, 1}},
    };
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(2, n), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(12, 1), 0, 0, 1,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 8);
    gn_extreme_set_lights(&stage, place, lights, 2);
    gn_extreme_aim(&stage, place, SIDE, 2 * FOCAL, eye, target);
    gn_extreme_check(&stage, NULL, &one_ray, judge_floor, angles);
    gn_test_stage_finish(&stage);
}

static void test_no_acne_on_real_floors(void **state)
{
    (void)state;
    for_all_places(check_floor);
}

static void judge_table(void *context, const struct gn_extreme_view *view)
{
    const double *angles = context;
    double least = INFINITY;
    double most = 0;
    for (int i = 0; i < N_PIXELS; i++) {
        const float *v = view->layers->virtual_rgba.data + 4 * i;
        assert_true(v[3] == 1);
        least = fmin(least, (double)v[0]);
        most = fmax(most, (double)v[0]);
    }
    if (view->quality == GN_QUALITY_REFERENCE) { // by the whole sky: all alike
        assert_true(least > 0 && most <= least * (1 + 2 * angles[1] + 1e-6));
    } else {
        assert_true(least >= 0.5 / M_PI * sin(angles[0] - angles[1]) * (1 - 1e-6));
        assert_true(most <= 0.5 / M_PI * sin(angles[0] + angles[1]) * (1 + 1e-6));
    }
}

/* A virtual table that a light grazes, and a whole sky lights: no point of it hides any. */
static void check_table(const struct gn_extreme_place *place, int n, double step)
{
    static const double eye[3] = {0, -0.3, 0.9}, target[3] = {0, 0, 0};
    double tilt = get_tilt(step, 2.0 / n);
    double angles[2] = {get_elevation(tilt), tilt};
    const struct gn_light light = {.dir_world = {0.6f * (float)cos(angles[0]),
                                                 0.8f * (float)cos(angles[0]),
                                                 (float)sin(angles[0])},
                                   .irradiance = {1, 1, 1}};
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(2, n), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 8);
    gn_extreme_set_lights(&stage, place, &light, 1);
    gn_extreme_aim(&stage, place, SIDE, 2 * FOCAL, eye, target);
    gn_extreme_check(&stage, NULL, &one_ray, judge_table, angles);
    gn_test_stage_finish(&stage);
}

static void test_no_acne_on_virtual_tables(void **state)
{
    (void)state;
    for_all_places(check_table);
}

/** A closed box and what light got in. */
struct closed {
    double step;
    int n_floor, n_seam; // pixels
    double leaked;       // sum of the factors at the seam
};

/** Does one of the 3 x 3 pixels about it show something virtual? */
static bool is_seam(const struct gn_layers *layers, int x, int y)
{
    for (int n = 0; n < 9; n++) {
        int px = x + n % 3 - 1;
        int py = y + n / 3 - 1;
        bool is_inside = px >= 0 && py >= 0 && px < SIDE && py < SIDE;
        if (is_inside && layers->virtual_rgba.data[4 * (py * SIDE + px) + 3] > 0)
            return true;
    }
    return false;
}

static void judge_closed(void *context, const struct gn_extreme_view *view)
{
    struct closed *closed = context;
    closed->n_floor = closed->n_seam = 0;
    closed->leaked = 0;
    for (int i = 0; i < N_PIXELS; i++) {
        const float *v = view->layers->virtual_rgba.data + 4 * i;
        const float *factor = view->layers->shadow.data + 3 * i;
        assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0);
        if (v[3] == 1)
            continue;
        closed->n_floor++;
        if (is_seam(view->layers, i % SIDE, i / SIDE)) {
            closed->n_seam++;
            closed->leaked += (double)factor[0];
        } else {
            assert_true(factor[0] < 1e-6f && factor[1] < 1e-6f && factor[2] < 1e-6f);
        }
    }
    // The floor is about 1 size away; of a pixel at the wall this share lies within two steps.
    double share = 2 * closed->step * FOCAL;
    assert_true(closed->n_floor > N_PIXELS / 3 && closed->n_seam > 20);
    assert_true(closed->leaked <= share * closed->n_seam);
}

/*
 * A closed virtual box stands about the camera, through the floor: no light is left on the floor in
 * it, nor on its own walls. Points of the floor and corners of the box are rounded by up to 0.87
 * steps each, so what is nearer to the wall than two steps may be on its other side.
 */
static void check_box(const struct gn_extreme_place *place, int n, double step)
{
    static const double eye[3] = {0.2, -0.3, 0.6}, target[3] = {0, 0.2, 0};
    struct gn_test_stage stage = {0};
    struct closed closed = {.step = step};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, n), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_box(1.4f, 1.2f, 1.3f), 0, 0, 0.1,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 8);
    gn_extreme_aim(&stage, place, SIDE, FOCAL, eye, target);
    gn_extreme_check(&stage, NULL, NULL, judge_closed, &closed);
    gn_test_stage_finish(&stage);
}

static void test_no_leak_into_a_virtual_box(void **state)
{
    (void)state;
    for_all_places(check_box);
}

static void judge_room(void *context, const struct gn_extreme_view *view)
{
    int *n_virtual = context;
    for (int i = 0; i < N_PIXELS; i++) {
        const float *v = view->layers->virtual_rgba.data + 4 * i;
        *n_virtual += v[3] > 0;
        for (int c = 0; c < 3; c++) {
            assert_true(v[c] == 0);
            // The seed's sums take real objects for transparent.
            assert_true(view->quality == GN_QUALITY_SEED ||
                        view->layers->shadow.data[3 * i + c] == 1);
        }
    }
}

/* A closed real room: what is virtual in it stands in the dark and throws no shadow. */
static void check_room(const struct gn_extreme_place *place, int n, double step)
{
    static const double eye[3] = {0.7, -0.8, 0.6}, target[3] = {0, 0, -0.6};
    struct gn_test_stage stage = {0};
    int n_virtual = 0;
    (void)step;
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_cube(2), 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, n + 3), 0, 0, -0.7,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 8);
    gn_extreme_aim(&stage, place, SIDE, FOCAL, eye, target);
    gn_extreme_check(&stage, NULL, &one_ray, judge_room, &n_virtual);
    assert_true(n_virtual > 3 * 20);
    gn_test_stage_finish(&stage);
}

static void test_no_leak_into_a_room(void **state)
{
    (void)state;
    for_all_places(check_room);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_acne_on_real_floors),
        cmocka_unit_test(test_no_acne_on_virtual_tables),
        cmocka_unit_test(test_no_leak_into_a_virtual_box),
        cmocka_unit_test(test_no_leak_into_a_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
