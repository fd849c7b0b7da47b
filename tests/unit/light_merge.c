/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Fewer lights for the same light. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "server/render/light_merge.h"

enum { N = 200 };

/** Spread over the sphere, of any colour; every third one is near where `has_near`. */
static void make_lights(struct gn_light *lights, int n, bool has_near)
{
    memset(lights, 0, (size_t)n * sizeof(*lights));
    for (int i = 0; i < n; i++) {
        double z = 1 - (2 * i + 1.0) / n, r = sqrt(1 - z * z), phi = 2.4 * i;
        const double dir[3] = {r * cos(phi), r * sin(phi), z};
        for (int k = 0; k < 3; k++) {
            lights[i].dir_world[k] = (float)dir[k];
            lights[i].irradiance[k] = (float)(1 + (i * (7 + k)) % 11);
            lights[i].normal[k] = has_near && i % 3 == 0 ? (float)-dir[k] : 0;
        }
        lights[i].distance = has_near && i % 3 == 0 ? (float)(1 + i % 5) : INFINITY;
        lights[i].angular_radius = 0.05f;
        lights[i].id = (uint64_t)i + 1;
    }
}

static bool is_same(const struct gn_light *a, const struct gn_light *b)
{
    return memcmp(a->dir_world, b->dir_world, sizeof(a->dir_world)) == 0 &&
           memcmp(a->irradiance, b->irradiance, sizeof(a->irradiance)) == 0 &&
           memcmp(&a->distance, &b->distance, sizeof(a->distance)) == 0 &&
           memcmp(&a->angular_radius, &b->angular_radius, sizeof(a->angular_radius)) == 0 &&
           a->is_disc == b->is_disc && a->id == b->id;
}

static void check(const struct gn_light *lights, int n, int n_wanted)
{
    struct light_merge merge = {0};
    double before[3] = {0}, after[3] = {0};
    int m = gn_light_merge_make(&merge, lights, n, n_wanted);
    assert_true(m > 0 && m <= n && (m <= n_wanted || m <= 4));
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < n; i++)
            before[k] += (double)lights[i].irradiance[k];
        for (int i = 0; i < m; i++)
            after[k] += (double)merge.lights[i].irradiance[k];
        assert_float_equal(after[k] / before[k], 1, 1e-6);
    }
    for (int i = 0; i < m; i++) {
        const struct gn_light *light = &merge.lights[i];
        double length = 0;
        for (int k = 0; k < 3; k++)
            length += (double)light->dir_world[k] * (double)light->dir_world[k];
        assert_float_equal(length, 1, 1e-5);
        assert_true(light->distance > 0 && isfinite(light->angular_radius));
    }
    gn_light_merge_finish(&merge);
}

static void test_power_is_kept(void **state)
{
    (void)state;
    struct gn_light lights[N];
    for (int near = 0; near < 2; near++) {
        make_lights(lights, N, near);
        for (int n = 1; n <= N; n += n < 20 ? 1 : 37)
            check(lights, N, n);
        check(lights, 1, 1);
    }
}

static void test_all_that_is_wanted_stays_as_it_is(void **state)
{
    (void)state;
    struct gn_light lights[N];
    struct light_merge merge = {0};
    make_lights(lights, N, true);
    assert_int_equal(gn_light_merge_make(&merge, lights, N, N), N);
    bool is_seen[N] = {0};
    for (int i = 0; i < N; i++) {
        uint64_t id = merge.lights[i].id;
        assert_in_range(id, 1, N);
        assert_false(is_seen[id - 1]);
        is_seen[id - 1] = true;
        assert_true(is_same(&merge.lights[i], &lights[id - 1]));
    }
    gn_light_merge_finish(&merge);
}

static void test_discs_are_not_merged(void **state)
{
    (void)state;
    struct gn_light lights[N];
    struct light_merge merge = {0};
    make_lights(lights, N, false);
    lights[17].is_disc = lights[99].is_disc = true;
    assert_int_equal(gn_light_merge_make(&merge, lights, N, 5), 5);
    assert_true(is_same(&merge.lights[0], &lights[17]));
    assert_true(is_same(&merge.lights[1], &lights[99]));
    assert_int_equal(gn_light_merge_make(&merge, lights, N, 1), 3);
    check(lights, N, 5);
    gn_light_merge_finish(&merge);
}

/** Two tight groups far apart are two lights, each at its group's mean. */
static void test_groups_are_found(void **state)
{
    (void)state;
    struct gn_light lights[40];
    struct light_merge merge = {0};
    memset(lights, 0, sizeof(lights));
    for (int i = 0; i < 40; i++) {
        double tilt = 0.01 * (i / 2 % 5 - 2);
        lights[i].dir_world[0] = (float)((i % 2 ? 1 : -1) * cos(tilt));
        lights[i].dir_world[2] = (float)sin(tilt);
        lights[i].irradiance[1] = 1;
        lights[i].distance = INFINITY;
    }
    assert_int_equal(gn_light_merge_make(&merge, lights, 40, 2), 2);
    for (int i = 0; i < 2; i++) {
        assert_float_equal(fabs((double)merge.lights[i].dir_world[0]), 1, 1e-4);
        assert_float_equal((double)merge.lights[i].irradiance[1], 20, 1e-5);
    }
    // Lights of one direction, or dark ones, are one.
    for (int i = 0; i < 40; i++) {
        memcpy(lights[i].dir_world, (float[3]){0, 0, 1}, sizeof(lights[i].dir_world));
        lights[i].irradiance[1] = i < 20;
    }
    assert_int_equal(gn_light_merge_make(&merge, lights, 40, 10), 1);
    gn_light_merge_finish(&merge);
}

static void test_more_lights_divide_one_group(void **state)
{
    (void)state;
    struct gn_light lights[N], before[N];
    struct light_merge merge = {0};
    make_lights(lights, N, true);
    for (int n = 2; n < 50; n++) {
        int m = gn_light_merge_make(&merge, lights, N, n), n_new = 0;
        assert_int_equal(m, n);
        for (int i = 0; i < m; i++) {
            bool is_old = false;
            for (int j = 0; j < m - 1 && n > 2; j++)
                is_old |= is_same(&merge.lights[i], &before[j]);
            n_new += !is_old;
        }
        assert_int_equal(n_new, 2);
        memcpy(before, merge.lights, (size_t)m * sizeof(before[0]));
    }
    gn_light_merge_finish(&merge);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_power_is_kept),
        cmocka_unit_test(test_all_that_is_wanted_stays_as_it_is),
        cmocka_unit_test(test_discs_are_not_merged),
        cmocka_unit_test(test_groups_are_found),
        cmocka_unit_test(test_more_lights_divide_one_group),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
