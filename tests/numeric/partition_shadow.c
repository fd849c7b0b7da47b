/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How well the lights of the energy partition shade, against the paper's literal partition with no
 * fewer lights: the shadow factor of a horizontal receiver under random caps, against the sum over
 * all texels.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/light/luminance.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

enum { SIDE = 300, N_SETS = 400, N_CAPS_MAX = 3 };

static const double pi = 3.14159265358979323846;

/* What stands in the way: discs of 5 to 25 degrees. */
struct occluders {
    int n;
    double dir[N_CAPS_MAX][3], cos_radius[N_CAPS_MAX];
};

static struct occluders sets[N_SETS];
static double truth[N_SETS];

static double get_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(*state >> 11) / 9007199254740992.0;
}

static void make_occluders(void)
{
    uint64_t random = 7;
    for (int s = 0; s < N_SETS; s++) {
        sets[s].n = 1 + (int)(N_CAPS_MAX * get_random(&random));
        for (int i = 0; i < sets[s].n; i++) {
            double z = get_random(&random), phi = 2 * pi * get_random(&random);
            double r = sqrt(1 - z * z);
            sets[s].dir[i][0] = r * cos(phi);
            sets[s].dir[i][1] = r * sin(phi);
            sets[s].dir[i][2] = z;
            sets[s].cos_radius[i] = cos((5 + 20 * get_random(&random)) * pi / 180);
        }
    }
}

static bool is_open(const struct occluders *set, const float d[static 3])
{
    for (int i = 0; i < set->n; i++) {
        const double *c = set->dir[i];
        if (c[0] * (double)d[0] + c[1] * (double)d[1] + c[2] * (double)d[2] > set->cos_radius[i])
            return false;
    }
    return true;
}

/* Four lamps and a window, the largest luminance about 100 times the mean. */
static void indoor(const double dir[static 3], float out[static 3])
{
    light_fixture_room(dir, out);
}

/* A sun of 0.6 degrees and 2e5 in a blue sky. */
static void sunny(const double dir[static 3], float out[static 3])
{
    bool is_sun = 0.5 * dir[0] + 0.3 * dir[1] + 0.81240384 * dir[2] > cos(0.3 * pi / 180);
    out[0] = is_sun ? 2e5f : 0.6f;
    out[1] = is_sun ? 1.9e5f : 0.9f;
    out[2] = is_sun ? 1.7e5f : 1.4f;
}

/* An overcast sky, brighter at the zenith, seen through and beside a bright window. */
static void overcast(const double dir[static 3], float out[static 3])
{
    bool is_window = dir[0] < -0.6 && fabs(dir[1]) < 0.4 && dir[2] > 0.2 && dir[2] < 0.6;
    float sky = (float)((1 + 2 * dir[2]) / 3);
    out[0] = is_window ? 14 : sky;
    out[1] = is_window ? 14 : sky;
    out[2] = is_window ? 15 : 1.1f * sky;
}

/* The factor of each set from weighted directions: U is the receiver's light, S what is open. */
struct factor {
    double open[N_SETS], all;
};

static void add_direction(struct factor *f, const float d[static 3], double luminance)
{
    if (!(d[2] > 0) || !(luminance > 0))
        return;
    f->all += (double)d[2] * luminance;
    for (int s = 0; s < N_SETS; s++)
        f->open[s] += is_open(&sets[s], d) ? (double)d[2] * luminance : 0;
}

static struct factor factor;

static void find_truth(const struct light_fixture *f)
{
    struct gn_radiance_map *map;
    struct gn_error error = {0};
    factor = (struct factor){0};
    assert_int_equal(gn_radiance_map_create(&f->frame, NULL, NULL, &map, &error), 0);
    for (size_t t = 0; t < (size_t)SIDE * SIDE; t++)
        add_direction(&factor, map->direction_world + 3 * t,
                      gn_luminance(map->radiance.data + 3 * t) * (double)map->solid_angle[t]);
    for (int s = 0; s < N_SETS; s++)
        truth[s] = factor.open[s] / factor.all;
    gn_radiance_map_unref(&map);
}

/* Root mean square error over the sets that shade. */
static double measure(const struct light_fixture *f, const struct gn_light_options *options,
                      int *out_n_lights)
{
    struct gn_lighting_state *state;
    struct gn_error error = {0};
    double sum = 0;
    int n = 0;
    assert_int_equal(gn_lighting_state_create(&f->frame, NULL, options, NULL, &state, &error), 0);
    factor = (struct factor){0};
    *out_n_lights = 0;
    for (int i = 0; i < state->n_lights; i++) { // those from below shade nothing
        *out_n_lights += state->lights[i].dir_world[2] > 0;
        add_direction(&factor, state->lights[i].dir_world,
                      gn_luminance(state->lights[i].irradiance));
    }
    for (int s = 0; s < N_SETS; s++) {
        double test = factor.all > 0 ? factor.open[s] / factor.all : 1;
        if (truth[s] >= 0.995 && test >= 0.995)
            continue;
        sum += (test - truth[s]) * (test - truth[s]);
        n++;
    }
    gn_lighting_state_unref(&state);
    return sqrt(sum / n);
}

/* The literal partition at each maxLS, and the energy one with no more lights. Returns the smallest
 * ratio of their errors but for maxLS = 1: with the dozen lights that gives, each is a large part
 * of the sky in any method, and the ratio is only said. */
static double compare(const char *name,
                      void (*light)(const double dir[static 3], float out[static 3]))
{
    struct light_fixture f;
    double worst = INFINITY;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, SIDE, SIDE), 0);
    light_fixture_fill(&f, light);
    find_truth(&f);
    for (int max_ls = 1; max_ls <= 64; max_ls *= 8) {
        struct gn_light_options seed = {.method = GN_LIGHT_PARTITION_SEED, .max_ls = max_ls};
        int n_seed, n_energy = INT32_MAX;
        double literal = measure(&f, &seed, &n_seed), energy = 1;
        for (int wanted = n_seed + 12; wanted > 0 && n_energy > n_seed; wanted--) {
            struct gn_light_options options = {.n_lights = wanted};
            energy = measure(&f, &options, &n_energy); // the fill's, from below, do not count
        }
        print_message(
            "# %-9s maxLS %2d: literal %.4f with %3d lights, energy %.4f with %3d: %.1f\n", name,
            max_ls, literal, n_seed, energy, n_energy, literal / energy);
        if (max_ls > 1)
            worst = fmin(worst, literal / energy);
    }
    for (int n = 16; n <= 256; n *= 2) {
        struct gn_light_options options = {.n_lights = n};
        int n_lights;
        double rmse = measure(&f, &options, &n_lights);
        print_message("# %-9s energy %.4f with %3d\n", name, rmse, n_lights);
    }
    light_fixture_finish(&f);
    return worst;
}

static void lamps_are_four_times_better(void **unused)
{
    (void)unused;
    assert_true(compare("indoor", indoor) > 4);
}

static void overcast_is_four_times_better(void **unused)
{
    (void)unused;
    assert_true(compare("overcast", overcast) > 4);
}

/* With a sun its few lights are all that is needed: better or not is only said. */
static void the_sun_is_told(void **unused)
{
    (void)unused;
    assert_true(compare("sunny", sunny) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lamps_are_four_times_better),
        cmocka_unit_test(overcast_is_four_times_better),
        cmocka_unit_test(the_sun_is_told),
    };
    make_occluders();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
