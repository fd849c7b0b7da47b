/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light in time, on lists made by hand: what is followed, what fades, what jumps, what is kept. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/luminance.h"
#include "server/light/temporal.h"
#include "tests/light_fixture.h"
#include "tests/temporal_play.h"

static void takes_the_first_frame_as_it_is(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    p.values[1] = -3;
    show(&p, 0.02);
    assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_START);
    assert_int_equal(p.now->n_lights, 4);
    for (int i = 0; i < 4; i++)
        assert_memory_equal(find(&p, (uint64_t)i + 1), &p.lights[i], sizeof(p.lights[i]));
    assert_true(p.now->values[1] == -3);
    assert_true(p.now->is_settled);
    end(&p);
}

/* y += (1 - exp(-dt / play_tau)) (x - y), whatever the steps are. A change below the noise takes
 * tau. */
static void follows_by_the_exact_exponential(void **test)
{
    (void)test;
    static const double dts[] = {0.001, 0.0334, 0.1, 0.25, 0.0009};
    struct play p;
    begin(&p);
    show(&p, 0.02);
    double from = get_power(&p, 2), t = 0;
    p.lights[1].irradiance[0] *= 1.004f;
    double to = (double)p.lights[1].irradiance[0];
    p.values[2] = 1;
    p.values[0] = 5;
    for (size_t i = 0; i < sizeof(dts) / sizeof(dts[0]); i++) {
        show(&p, dts[i]);
        t += dts[i];
        assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_FOLLOW);
        assert_near(p.now->figures.dt_ms, 1e3 * dts[i], 1e-6);
        assert_near(p.now->figures.tau_ms, 1e3 * play_tau, 1e-9);
        assert_near(get_power(&p, 2), to + (from - to) * exp(-t / play_tau), 1e-6 * to);
        assert_near(p.now->values[2], 1 - exp(-t / play_tau), 1e-6);
    }
    end(&p);
}

/* What changes by more than noise is there to 90 % within 100 ms. */
static void hurries_while_light_changes(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.lights[1].irradiance[0] *= 2;
    p.lights[1].irradiance[1] *= 2;
    p.lights[1].irradiance[2] *= 2;
    show(&p, 0.1);
    assert_near(p.now->figures.tau_ms, 40, 1e-9);
    assert_near(get_power(&p, 2), 20 - 10 * exp(-2.5), 1e-4);
    assert_true(get_power(&p, 2) > 19);
    assert_int_equal(p.now->figures.n_snaps, 0);
    end(&p);
}

static void turns_directions_weighted_by_energy(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    struct gn_light old = p.lights[2];
    p.n = 2;
    put_light(&p, 3, 3.0 + 0.3, 0.5, 10);
    put_light(&p, 4, 4.5, 0.5, 10);
    double last = 0, way = get_angle(&old, &p.lights[2]);
    for (int i = 0; i < 40; i++) {
        show(&p, 1.0 / 60);
        double angle = get_angle(find(&p, 3), &old);
        assert_true(angle >= last - 1e-6 && angle <= way + 1e-6);
        last = angle;
        assert_near(get_sum(&p, 0), 40, 40e-6);
    }
    assert_near(last, way, 0.01);
    // Twice the power pulls the middle of the way nearer: (2 b + a) / 3 after one half-life.
    end(&p);
    begin(&p);
    show(&p, 0.02);
    p.n = 2;
    put_light(&p, 3, 3.0 + 0.1, 0.5, 20);
    put_light(&p, 4, 4.5, 0.5, 10);
    show(&p, 0.04 * log(2));
    double moved = get_angle(find(&p, 3), &old), left = get_angle(find(&p, 3), &p.lights[2]);
    assert_near(moved / left, 2, 0.05);
    end(&p);
}

static void fades_lights_in_and_out_and_keeps_the_sum(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    // Light 2 is divided into three others where it was: the place has the same light as before.
    p.lights[1] = p.lights[3];
    p.n = 3;
    for (int i = 0; i < 3; i++)
        put_light(&p, 20 + (uint64_t)i, 1.5 + 0.02 * (i - 1), 0.5, 10.0 / 3);
    show(&p, 1.0 / 60);
    assert_int_equal(p.now->figures.n_births, 3);
    assert_int_equal(p.now->figures.n_deaths, 1);
    assert_int_equal(p.now->figures.n_snaps, 0);
    assert_int_equal(p.now->figures.n_fading, 1);
    double alpha = p.now->figures.alpha;
    assert_true(alpha > 0.05 && alpha < 0.95);
    assert_near(get_power(&p, 2), 10 * (1 - alpha), 1e-5);
    assert_near(get_power(&p, 20), 10 * alpha / 3, 1e-5);
    int n_frames = 0;
    for (; find(&p, 2); n_frames++) {
        for (int c = 0; c < 3; c++) {
            assert_near(get_sum(&p, c), p.now->total[c], 1e-5 * p.now->total[c]);
            assert_near(p.now->total[c], c == 0 ? 40 : c == 1 ? 36 : 20, 40e-6);
        }
        assert_true(n_frames < 120);
        show(&p, 1.0 / 60);
        assert_int_equal(p.now->figures.n_births + p.now->figures.n_deaths, 0);
    }
    assert_int_equal(p.now->figures.n_fading, 0);
    assert_int_equal(p.now->n_lights, 6);
    assert_near(get_sum(&p, 0), 40, 40e-6);
    end(&p);
}

static void takes_a_light_back_that_was_fading(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    p.lights[3].irradiance[0] = p.lights[3].irradiance[1] = p.lights[3].irradiance[2] = 0.1f;
    show(&p, 0.02);
    p.n = 3;
    show(&p, 0.02);
    double faded = get_power(&p, 4);
    assert_true(faded > 0 && faded < 0.1);
    p.n = 4;
    show(&p, 0.02);
    assert_int_equal(p.now->figures.n_births, 0);
    assert_int_equal(p.now->n_lights, 4);
    assert_true(get_power(&p, 4) > faded && get_power(&p, 4) < 0.1);
    end(&p);
}

/* A light does not travel through what lies between: it goes here and comes there. */
static void does_not_turn_through_a_jump(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    for (int i = 0; i < 30; i++) // so many that one of them is no change of its place by a factor
        put_light(&p, 100 + (uint64_t)i, 0.2 * i, 0.5, 10);
    show(&p, 0.02);
    struct gn_light old = p.lights[0];
    p.lights[0].dir_world[0] *= -1;
    p.lights[0].dir_world[1] *= -1;
    show(&p, 0.02);
    assert_int_equal(p.now->figures.n_births, 1);
    assert_int_equal(p.now->figures.n_deaths, 1);
    assert_near(get_angle(find(&p, 1), &p.lights[0]), 0, 1e-3);
    assert_near(get_power(&p, 1), 10 * p.now->figures.alpha, 1e-5);
    assert_near(get_angle(find(&p, 0), &old), 0, 1e-3);
    assert_near(get_power(&p, 0), 10 * (1 - p.now->figures.alpha), 1e-5);
    assert_near(get_sum(&p, 0), 340, 340e-6);
    end(&p);
}

static void snaps_where_a_lamp_goes_on_and_only_there(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.values[0] = 7;
    put_light(&p, 9, 1.5, -0.6, 1e5);  // new
    p.lights[3].irradiance[0] *= 1.5f; // far from it
    show(&p, 0.01);
    assert_true(p.now->figures.n_snaps >= 1);
    assert_memory_equal(find(&p, 9), &p.lights[4], sizeof(struct gn_light));
    double alpha = p.now->figures.alpha;
    assert_near(get_power(&p, 4), 10 + 5 * alpha, 1e-4);
    assert_true(p.now->values[0] == 7); // the map's figures are of all places
    assert_near(get_sum(&p, 0), p.now->total[0], 1e-5 * p.now->total[0]);
    p.n = 4; // off again: at once, and nothing of it is left
    show(&p, 0.01);
    assert_null(find(&p, 9));
    assert_near(get_sum(&p, 0), p.now->total[0], 1e-5 * p.now->total[0]);
    assert_true(get_sum(&p, 0) < 46);
    end(&p);
}

static void sees_a_new_division_as_no_change(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.n = 0;
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 8; k++)
            put_light(&p, 1000 + 8 * (uint64_t)i + (uint64_t)k, 1.5 * i + 0.05 * (k - 3.5), 0.5,
                      10.0 / 8);
    show(&p, 0.02);
    assert_int_equal(p.now->figures.n_snaps, 0);
    assert_int_equal(p.now->figures.n_births, 32);
    assert_int_equal(p.now->n_lights, 36);
    end(&p);
}

/* Lights that change their names with every frame cost no more than as many again. */
static void bounds_the_number_of_fading_lights(void **test)
{
    (void)test;
    struct play p = {.tau = 5, .time_ns = 1};
    for (int frame = 0; frame < 50; frame++) {
        p.n = 0;
        for (int i = 0; i < PLAY_LIGHTS; i++)
            put_light(&p, (uint64_t)(1 + frame * PLAY_LIGHTS + i), 0.1 * i, 0.02 * i, 1 + 0.01 * i);
        show(&p, 0.01);
        assert_true(p.now->n_lights <= 2 * PLAY_LIGHTS);
        for (int c = 0; c < 3; c++)
            assert_near(get_sum(&p, c), p.now->total[c], 1e-5 * p.now->total[c]);
    }
    assert_int_equal(p.now->figures.n_fading, PLAY_LIGHTS);
    end(&p);
}

static void holds_when_time_stands_still(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.lights[0].irradiance[0] *= 2;
    show(&p, 0.01);
    double power = get_power(&p, 1);
    static const double back[] = {0, -0.005, -0.1};
    for (int i = 0; i < 3; i++) {
        show(&p, back[i]);
        assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_HOLD);
        assert_true(get_power(&p, 1) == power);
    }
    show(&p, 0.105 + 0.01); // time goes on from the newest frame that was followed
    assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_FOLLOW);
    assert_near(p.now->figures.dt_ms, 10, 1e-5);
    for (int i = 0; i < GN_TEMPORAL_HOLDS_MAX; i++) {
        show(&p, 0);
        assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_HOLD);
    }
    show(&p, 0); // a clock that stands still is none
    assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_START);
    assert_true(get_power(&p, 1) == 20);
    end(&p);
}

static void starts_anew_after_a_gap(void **test)
{
    (void)test;
    static const double gaps[] = {0.501, -0.501, 100, 9e9, -9e9};
    struct play p;
    for (size_t i = 0; i < sizeof(gaps) / sizeof(gaps[0]); i++) {
        begin(&p);
        show(&p, 0.02);
        p.lights[0].irradiance[0] *= 2;
        show(&p, gaps[i]);
        assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_START);
        assert_true(get_power(&p, 1) == 20);
        end(&p);
    }
    begin(&p);
    show(&p, 0.02);
    p.time_ns = INT64_MIN; // what a peer may make up
    show(&p, 0);
    p.time_ns = INT64_MAX;
    show(&p, 0);
    assert_int_equal(p.now->figures.verdict, GN_TEMPORAL_START);
    end(&p);
}

static void settles_to_the_bit(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.lights[0].irradiance[0] *= 1.7f;
    p.lights[1].dir_world[2] += 0.01f;
    p.n--;
    p.values[0] = 3;
    show(&p, 0.02);
    assert_false(p.now->is_settled);
    for (int i = 0; i < 400 && !p.now->is_settled; i++) {
        struct gn_temporal *next; // the same frame, seen again
        p.time_ns += 16666667;
        assert_int_equal(gn_temporal_follow_same(p.now, p.time_ns, p.tau, &next), 0);
        struct gn_temporal *old = p.now;
        p.now = NULL;
        p.time_ns -= 16666667;
        struct gn_temporal_input input = get_input(&p);
        input.time_ns += 16666667;
        p.time_ns += 16666667;
        assert_int_equal(gn_temporal_follow(old, &input, p.tau, &p.now), 0);
        assert_int_equal(next->n_lights, p.now->n_lights);
        assert_memory_equal(next->lights, p.now->lights,
                            (size_t)next->n_lights * sizeof(next->lights[0]));
        assert_memory_equal(next->values, p.now->values, sizeof(next->values));
        assert_memory_equal(next->total, p.now->total, sizeof(next->total));
        free(next);
        free(old);
    }
    assert_true(p.now->is_settled);
    assert_int_equal(p.now->n_lights, 3);
    for (int i = 0; i < 3; i++)
        assert_memory_equal(find(&p, (uint64_t)i + 1), &p.lights[i], sizeof(p.lights[i]));
    assert_true(p.now->values[0] == 3);
    end(&p);
}

/* A light that loses one channel: it is gone within seconds, not a thousand denormals later. */
static void settles_where_a_channel_goes_out(void **test)
{
    (void)test;
    struct play p;
    begin(&p);
    show(&p, 0.02);
    p.lights[0].irradiance[2] = 0;
    for (int i = 0; i < 600 && (i == 0 || !p.now->is_settled); i++)
        show(&p, 1.0 / 60);
    assert_true(p.now->is_settled);
    assert_true(find(&p, 1)->irradiance[2] == 0);
    end(&p);
}

static void stays_black_where_it_is_black(void **test)
{
    (void)test;
    struct play p = {.tau = play_tau};
    for (int i = 0; i < 5; i++) {
        show(&p, 0.02);
        assert_int_equal(p.now->n_lights, 0);
        assert_true(p.now->total[0] == 0 && p.now->values[0] == 0 && p.now->is_settled);
    }
    put_light(&p, 1, 0, 1, 5);
    show(&p, 0.02);
    p.n = 0;
    for (int i = 0; i < 60; i++)
        show(&p, 0.02);
    assert_int_equal(p.now->n_lights, 0);
    assert_true(p.now->total[0] == 0 && p.now->total[1] == 0 && p.now->total[2] == 0);
    end(&p);
}

static void follows_without_lights_too(void **test)
{
    (void)test;
    struct gn_temporal *a = NULL, *b = NULL;
    const double up[3] = {0, 0, 1};
    struct gn_temporal_input input = {.total = {10, 10, 10}, .n_values = 2, .values = {4, 1}};
    gn_change_add(input.sums, up, 10);
    assert_int_equal(gn_temporal_follow(NULL, &input, play_tau, &a), 0);
    input.time_ns = 20000000;
    input.total[1] = 10.02;
    gn_change_add(input.sums, up, 0.014);
    assert_int_equal(gn_temporal_follow(a, &input, play_tau, &b), 0);
    assert_near(b->figures.tau_ms, 200, 1e-9);
    assert_near(b->total[1], 10 + 0.02 * (1 - exp(-0.1)), 1e-9);
    free(a);
    input.time_ns = 40000000;
    input.values[1] = 2;
    gn_change_add(input.sums, up, 1);
    assert_int_equal(gn_temporal_follow(b, &input, play_tau, &a), 0);
    assert_near(a->values[1], 1 + (1 - exp(-0.5)), 1e-9);
    free(b);
    input.time_ns = 60000000;
    input.total[0] = input.total[1] = input.total[2] = 1; // the light goes
    gn_change_add(input.sums, up, -10);
    assert_int_equal(gn_temporal_follow(a, &input, play_tau, &b), 0);
    assert_true(b->total[0] == 1 && b->values[1] == 2);
    free(a);
    free(b);
}

/* Two frames are one to the bit in what both keep. */
static void assert_same_light(const struct gn_temporal *a, const struct gn_temporal *b,
                              bool has_lights)
{
    assert_memory_equal(a->sums, b->sums, sizeof(a->sums));
    assert_int_equal(a->n_held, b->n_held);
    assert_true(a->figures.alpha == b->figures.alpha);
    if (has_lights) {
        assert_memory_equal(a->total, b->total, sizeof(a->total));
        assert_int_equal(a->n_lights, b->n_lights);
        assert_memory_equal(a->lights, b->lights, (size_t)a->n_lights * sizeof(a->lights[0]));
    } else {
        assert_memory_equal(a->values, b->values, sizeof(a->values));
        assert_true(a->values_share == b->values_share);
    }
}

/* One stream is made whole all the time, one has lights or values alone but for some frames: in
 * the middle of a step, by a frame or after it. What it always has is the same to the bit. */
static void knows_nothing_of_what_is_left_out(void **test)
{
    (void)test;
    for (int k = 0; k < 4; k++) {
        bool has_lights = k % 2, is_between = k / 2;
        struct play p;
        struct gn_temporal *part = NULL, *next;
        begin(&p);
        for (int i = 0; i < 24; i++) {
            bool is_whole = i >= 8 && i < 14;
            p.values[0] = 40 + (i > 5 ? 9 : 0);
            p.values[1] = 0.1 * i;
            p.lights[1].irradiance[i % 3] = 10 + (float)(i > 5) * 8 + 0.01f * (float)i;
            p.lights[2].dir_world[2] += 0.01f;
            if (i == 11)
                put_light(&p, 9, 1.5, -0.6, 500); // is there at once
            show(&p, i % 7 == 6 ? 0 : 1.0 / 30);
            struct gn_temporal_input whole = get_input(&p), input = whole;
            bool asks = is_whole && !(is_between && i == 8);
            input.has_lights = has_lights || asks;
            input.n_lights = input.has_lights ? p.n : 0;
            input.n_values = !has_lights || asks ? 3 : 0;
            assert_int_equal(gn_temporal_follow(part, &input, p.tau, &next), 0);
            free(part);
            part = next;
            if (is_between && i == 8) {
                assert_int_equal(gn_temporal_complete(part, &whole, &next), 0);
                free(part);
                part = next;
            }
            if (is_whole) {
                double sum = 0;
                for (int j = 0; j < part->n_lights; j++)
                    sum += part->lights[j].irradiance[1];
                assert_near(sum, part->total[1], 1e-5 * sum);
                assert_int_equal(part->input.n_values, 3);
            }
            assert_same_light(p.now, part, has_lights);
        }
        free(part);
        end(&p);
    }
}

/* Adds the light of what the map does not show, in many even directions. */
static void add_fill(const struct gn_radiance_map *map, double sums[static GN_CHANGE_SUMS])
{
    enum { N_ROWS = 200, N_COLUMNS = 400 };
    const double pi = acos(-1.0);
    for (int i = 0; i < N_ROWS * N_COLUMNS; i++) {
        double z = 1 - (2 * (i / N_COLUMNS) + 1.0) / N_ROWS, r = sqrt(1 - z * z), xy[2];
        double phi = 2 * pi * (i % N_COLUMNS + 0.5) / N_COLUMNS;
        const double dir[3] = {r * cos(phi), r * sin(phi), z}; // of probe and world
        if (gn_projection_get_position(&map->projection, dir, xy))
            continue;
        gn_change_add(sums, dir, gn_luminance(map->fill) * 4 * pi / (N_ROWS * N_COLUMNS));
    }
}

/* Summed while the map is made, patch by patch, and yet those of its texels one by one. */
static void sums_are_those_of_the_texels(void **test)
{
    (void)test;
    static const struct {
        enum gn_projection_type type;
        int width, height;
        double tolerance; // a lamp counts from the middle of its patch; patches may be texels
    } cases[] = {{GN_PROJECTION_FISHEYE_EQUIDISTANT, 301, 301, 0.03},
                 {GN_PROJECTION_LATLONG, 300, 150, 0.03},
                 {GN_PROJECTION_LATLONG, 1000, 500, 0.03},
                 {GN_PROJECTION_LATLONG, 48, 24, 1e-6},
                 {GN_PROJECTION_OCTAHEDRAL, 40, 40, 1e-6}};
    for (size_t k = 0; k < sizeof(cases) / sizeof(cases[0]); k++) {
        struct light_fixture f;
        struct gn_radiance_map *map;
        struct gn_error error = {0};
        double sums[GN_CHANGE_SUMS], expected[GN_CHANGE_SUMS] = {0};
        assert_int_equal(light_fixture_init(&f, cases[k].type, cases[k].width, cases[k].height), 0);
        light_fixture_fill(&f, light_fixture_room);
        const struct gn_radiance_map_options options = {.ground_albedo = 0.9f};
        assert_int_equal(gn_radiance_map_create(&f.frame, &options, NULL, &map, &error), 0);
        gn_change_measure(map, sums);
        size_t n = (size_t)map->radiance.width * (size_t)map->radiance.height;
        for (size_t i = 0; i < n; i++) {
            const float *d = map->direction_world + 3 * i;
            const double dir[3] = {(double)d[0], (double)d[1], (double)d[2]};
            if (map->solid_angle[i] > 0)
                gn_change_add(expected, dir,
                              (double)map->solid_angle[i] *
                                  gn_luminance(map->radiance.data + 3 * i));
        }
        if (!map->is_full_sphere)
            add_fill(map, expected);
        double all = expected[GN_CHANGE_WINDOWS];
        assert_near(sums[GN_CHANGE_WINDOWS], all, 1e-6 * all);
        for (int i = 0; i < GN_CHANGE_WINDOWS; i++)
            assert_near(sums[i], expected[i], cases[k].tolerance * all);
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(takes_the_first_frame_as_it_is),
        cmocka_unit_test(follows_by_the_exact_exponential),
        cmocka_unit_test(hurries_while_light_changes),
        cmocka_unit_test(turns_directions_weighted_by_energy),
        cmocka_unit_test(fades_lights_in_and_out_and_keeps_the_sum),
        cmocka_unit_test(takes_a_light_back_that_was_fading),
        cmocka_unit_test(does_not_turn_through_a_jump),
        cmocka_unit_test(snaps_where_a_lamp_goes_on_and_only_there),
        cmocka_unit_test(sees_a_new_division_as_no_change),
        cmocka_unit_test(bounds_the_number_of_fading_lights),
        cmocka_unit_test(holds_when_time_stands_still),
        cmocka_unit_test(starts_anew_after_a_gap),
        cmocka_unit_test(settles_to_the_bit),
        cmocka_unit_test(settles_where_a_channel_goes_out),
        cmocka_unit_test(stays_black_where_it_is_black),
        cmocka_unit_test(follows_without_lights_too),
        cmocka_unit_test(knows_nothing_of_what_is_left_out),
        cmocka_unit_test(sums_are_those_of_the_texels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
