/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What all methods that keep the map's energy have in common, then what each promises itself. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "common/pool.h"
#include "server/light/lights.h"
#include "server/light/luminance.h"
#include "server/light/method.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

static const double pi = 3.14159265358979323846;

static const struct {
    enum gn_light_method method;
    double miss; // of the wanted number, at most this share and one
} methods[] = {
    {GN_LIGHT_MEDIAN_CUT, 0},
    {GN_LIGHT_VARIANCE, 0},
    {GN_LIGHT_INVERSION, 0.45}, // points with nothing nearest to them
    {GN_LIGHT_QUADTREE, 0.07},  // three lights more for each split
};
enum { N_METHODS = sizeof(methods) / sizeof(methods[0]) };

static struct gn_lighting_state *make_state(const struct light_fixture *f,
                                            enum gn_light_method method, int n_lights,
                                            struct gn_lighting_state *previous,
                                            struct gn_pool *pool)
{
    struct gn_lighting_state *state = NULL;
    struct gn_error error = {0};
    const struct gn_light_options options = {
        .method = method, .n_lights = n_lights, .previous = previous, .no_sh = true};
    if (gn_lighting_state_create(&f->frame, NULL, &options, pool, &state, &error) < 0)
        fail_msg("%s", error.text);
    return state;
}

static double get_angle(const float a[static 3], const float b[static 3])
{
    double x = (double)a[1] * (double)b[2] - (double)a[2] * (double)b[1];
    double y = (double)a[2] * (double)b[0] - (double)a[0] * (double)b[2];
    double z = (double)a[0] * (double)b[1] - (double)a[1] * (double)b[0];
    return atan2(sqrt(x * x + y * y + z * z), (double)a[0] * (double)b[0] +
                                                  (double)a[1] * (double)b[1] +
                                                  (double)a[2] * (double)b[2]);
}

static const struct gn_light *find_id(const struct gn_lighting_state *state, uint64_t id)
{
    for (int i = 0; i < state->n_lights; i++)
        if (state->lights[i].id == id)
            return &state->lights[i];
    return NULL;
}

/* Sound lights, each with an identity of its own, that add up to the map. */
static void check_lights(const struct gn_lighting_state *state)
{
    double sum[3] = {0};
    for (int i = 0; i < state->n_lights; i++) {
        const struct gn_light *light = &state->lights[i];
        double length = 0;
        for (int c = 0; c < 3; c++) {
            sum[c] += (double)light->irradiance[c];
            length += (double)light->dir_world[c] * (double)light->dir_world[c];
            assert_true(light->irradiance[c] >= 0);
        }
        assert_near(length, 1, 1e-6);
        assert_true(light->angular_radius > 0 && (double)light->angular_radius <= pi + 1e-6);
        assert_true(light->id != 0 && find_id(state, light->id) == light);
    }
    for (int c = 0; c < 3; c++)
        assert_near(sum[c], state->total_irradiance[c], 1e-5 * state->total_irradiance[c]);
}

/* Both states hold the same lights, to the bit. */
static bool are_same(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    bool is_same = a->n_lights == b->n_lights;
    for (int i = 0; i < a->n_lights && is_same; i++) {
        const struct gn_light *x = &a->lights[i], *y = &b->lights[i];
        is_same = x->id == y->id && x->angular_radius == y->angular_radius &&
                  memcmp(x->dir_world, y->dir_world, sizeof(x->dir_world)) == 0 &&
                  memcmp(x->irradiance, y->irradiance, sizeof(x->irradiance)) == 0;
    }
    return is_same;
}

static void every_method_keeps_energy_and_number(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } maps[] = {{GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300},
                {GN_PROJECTION_FISHEYE_EQUISOLID, 151, 120},
                {GN_PROJECTION_MIRRORBALL, 200, 200},
                {GN_PROJECTION_LATLONG, 256, 128},
                {GN_PROJECTION_CUBE, 64, 384},
                {GN_PROJECTION_OCTAHEDRAL, 100, 100}};
    static const int wanted[] = {1, 2, 7, 64, 300, 1000};
    for (size_t k = 0; k < sizeof(maps) / sizeof(maps[0]); k++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, maps[k].type, maps[k].width, maps[k].height), 0);
        light_fixture_fill(&f, light_fixture_room);
        for (int m = 0; m < N_METHODS; m++) {
            for (size_t i = 0; i < sizeof(wanted) / sizeof(wanted[0]); i++) {
                struct gn_lighting_state *state =
                    make_state(&f, methods[m].method, wanted[i], NULL, NULL);
                check_lights(state);
                assert_near(state->n_lights, wanted[i],
                            methods[m].miss * wanted[i] + (methods[m].miss > 0));
                gn_lighting_state_unref(&state);
            }
        }
        light_fixture_finish(&f);
    }
}

static void every_method_takes_maps_of_any_size(void **unused)
{
    (void)unused;
    static const int sizes[][2] = {{1, 1}, {1, 9}, {13, 1}, {3, 2}, {37, 19}};
    for (size_t k = 0; k < sizeof(sizes) / sizeof(sizes[0]); k++) {
        struct light_fixture f;
        int width = sizes[k][0], height = sizes[k][1];
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, width, height), 0);
        light_fixture_fill(&f, light_fixture_constant);
        for (int m = 0; m < N_METHODS; m++) {
            struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
            check_lights(state);
            assert_true(state->n_lights >= 1 && state->n_lights <= width * height);
            if (methods[m].miss == 0)
                assert_true(state->n_lights == (int)fmin(width * height, 64));
            gn_lighting_state_unref(&state);
        }
        light_fixture_finish(&f);
    }
}

static void every_method_leaves_black_black(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 64, 64), 0);
    f.frame.codes = &f.image;
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
        assert_int_equal(state->n_lights, 0);
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

static void every_method_gives_one_texel_its_share(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_constant);
    double w = gn_projection_get_solid_angle(&f.frame.projection, 200, 60), dir[3];
    assert_true(gn_projection_get_direction(&f.frame.projection, 200.5, 60.5, dir));
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 200, 60)[c] = (float)(99 * (4 * pi - w) / w);
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *state = make_state(&f, methods[m].method, 64, NULL, NULL);
        check_lights(state);
        const struct gn_light *hot = &state->lights[0];
        assert_near((double)hot->irradiance[1] / state->total_irradiance[1], 0.99, 1e-3);
        assert_near(
            get_angle(hot->dir_world, (float[3]){(float)dir[0], (float)dir[1], (float)dir[2]}), 0,
            1e-3);
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

static void every_method_has_the_same_bits_on_threads(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_pool *pool = NULL;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300), 0);
    light_fixture_fill(&f, light_fixture_room);
    assert_int_equal(gn_pool_create(3, &pool), 0);
    for (int m = 0; m < N_METHODS; m++) {
        struct gn_lighting_state *one = make_state(&f, methods[m].method, 64, NULL, NULL);
        struct gn_lighting_state *three = make_state(&f, methods[m].method, 64, NULL, pool);
        struct gn_lighting_state *next = make_state(&f, methods[m].method, 64, one, pool);
        assert_true(are_same(one, three));
        assert_true(are_same(one, next)); // and the same frame has the same lights
        gn_lighting_state_unref(&one);
        gn_lighting_state_unref(&three);
        gn_lighting_state_unref(&next);
    }
    gn_pool_destroy(&pool);
    light_fixture_finish(&f);
}

static void median_cut_halves_energy(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 300, 300), 0);
    light_fixture_fill(&f, light_fixture_room);
    for (int n = 2; n <= 256; n *= 2) {
        struct gn_lighting_state *state = make_state(&f, GN_LIGHT_MEDIAN_CUT, n, NULL, NULL);
        double sum = 0, most = gn_luminance(state->lights[0].irradiance);
        for (int i = 0; i < n; i++)
            sum += gn_luminance(state->lights[i].irradiance);
        printf("# %d lights: the strongest has %.3f of the mean\n", n, most * n / sum);
        // A large region is cut between cells, and a lamp here is 4 to 8 cells wide.
        assert_true(most * n / sum < (n <= 8 ? 1.05 : 1.6));
        gn_lighting_state_unref(&state);
    }
    light_fixture_finish(&f);
}

/* Lights of both states whose identity the other has not. */
static int count_changes(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    int n = 0;
    for (int i = 0; i < a->n_lights; i++)
        n += !find_id(b, a->lights[i].id);
    for (int i = 0; i < b->n_lights; i++)
        n += !find_id(a, b->lights[i].id);
    return n;
}

static bool is_near(const float dir[static 3], double x, double y, double z, double cosine)
{
    return (double)dir[0] * x + (double)dir[1] * y + (double)dir[2] * z > cosine;
}

/* By half a turn about z, which a lat-long shows as columns that move; the world stays. */
static void turn_probe(struct light_fixture *f)
{
    float row[512][3];
    f->frame.world_from_probe[0] = 0;
    f->frame.world_from_probe[3] = 1;
    for (int y = 0; y < 256; y++) {
        memcpy(row, gn_image_at(&f->image, 256, y), sizeof(row) / 2);
        memcpy(row + 256, gn_image_at(&f->image, 0, y), sizeof(row) / 2);
        memcpy(gn_image_at(&f->image, 0, y), row, sizeof(row));
    }
}

static void check_others_stay(bool turns)
{
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_room);
    struct gn_lighting_state *before = make_state(&f, GN_LIGHT_QUADTREE, 64, NULL, NULL);
    if (turns)
        turn_probe(&f);
    // A new lamp, an eighth as strong as all the light before
    for (int y = 60; y < 66; y++) {
        for (int x = 100; x < 106; x++) {
            double w = gn_projection_get_solid_angle(&f.frame.projection, x, y);
            for (int c = 0; c < 3; c++)
                gn_image_at(&f.image, x, y)[c] = (float)(before->total_irradiance[c] / 8 / 36 / w);
        }
    }
    struct gn_lighting_state *after = make_state(&f, GN_LIGHT_QUADTREE, 64, before, NULL);
    double lamp[3];
    assert_true(gn_projection_get_direction(&f.frame.projection, 103, 63, lamp));
    lamp[0] *= turns ? -1 : 1;
    lamp[1] *= turns ? -1 : 1;
    int n_same = 0, n_other = 0;
    for (int i = 0; i < before->n_lights; i++) {
        const struct gn_light *light = &before->lights[i], *next = find_id(after, light->id);
        bool is_same = next && (turns ? get_angle(light->dir_world, next->dir_world) < 1e-5
                                      : memcmp(light->dir_world, next->dir_world,
                                               sizeof(light->dir_world)) == 0);
        bool is_beside = is_near(light->dir_world, lamp[0], lamp[1], lamp[2], 0.9);
        assert_true(is_same || is_beside);
        n_same += is_same;
        n_other += !is_same;
    }
    printf("# a lamp comes on%s: %d lights stay, %d change, then %d lights\n",
           turns ? " as the probe turns" : "", n_same, n_other, after->n_lights);
    assert_true(n_same > 50 && after->n_lights > before->n_lights);
    gn_lighting_state_unref(&before);
    gn_lighting_state_unref(&after);
    light_fixture_finish(&f);
}

static void quadtree_leaves_the_others_where_they_were(void **unused)
{
    (void)unused;
    check_others_stay(false); // to the bit
    check_others_stay(true);
}

static double get_random(uint32_t *seed) // [-1, 1]
{
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / 8388608.0 - 1;
}

static void quadtree_is_calm_in_noise(void **unused)
{
    (void)unused;
    enum { N_FRAMES = 30 };
    struct light_fixture clean, f;
    uint32_t seed = 1;
    assert_int_equal(light_fixture_init(&clean, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200), 0);
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200), 0);
    light_fixture_fill(&clean, light_fixture_room);
    light_fixture_fill(&f, light_fixture_room);
    struct gn_lighting_state *last = NULL;
    int n_changes = 0;
    for (int frame = 0; frame < N_FRAMES; frame++) {
        double gain = 1 + 0.01 * get_random(&seed); // all together, and each
        for (int i = 0; i < 3 * 200 * 200; i++)
            f.image.data[i] = clean.image.data[i] * (float)(gain * (1 + 0.017 * get_random(&seed)));
        f.frame.capture_time_ns = (int64_t)frame * 33333333;
        struct gn_lighting_state *state = make_state(&f, GN_LIGHT_QUADTREE, 64, last, NULL);
        n_changes += last ? count_changes(last, state) : 0;
        gn_lighting_state_unref(&last);
        last = state;
    }
    printf("# noise of 1 %%: %d births and deaths in %d frames\n", n_changes, N_FRAMES);
    assert_true(n_changes < N_FRAMES);
    gn_lighting_state_unref(&last);
    light_fixture_finish(&clean);
    light_fixture_finish(&f);
}

static void quadtree_comes_back_to_its_number(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200), 0);
    light_fixture_fill(&f, light_fixture_room);
    struct gn_lighting_state *last = make_state(&f, GN_LIGHT_QUADTREE, 64, NULL, NULL);
    int counts[121];
    for (int frame = 1; frame <= 120; frame++) { // light falls to a half: a stop down
        for (int i = 0; i < 3 * 200 * 200 && frame == 1; i++)
            f.image.data[i] *= 0.5f;
        f.frame.capture_time_ns = (int64_t)frame * 33333333;
        struct gn_lighting_state *state = make_state(&f, GN_LIGHT_QUADTREE, 64, last, NULL);
        counts[frame] = state->n_lights;
        gn_lighting_state_unref(&last);
        last = state;
    }
    printf("# half the light: %d lights at once, %d after 1 s, %d after 4 s\n", counts[1],
           counts[30], counts[120]);
    assert_true(counts[1] < 48 && counts[30] > counts[1]);
    assert_near(counts[120], 64, 17);
    for (int i = 0; i < 3 * 200 * 200; i++)
        f.image.data[i] *= 8; // far more: no frame may have more than twice the number
    struct gn_lighting_state *state = make_state(&f, GN_LIGHT_QUADTREE, 64, last, NULL);
    assert_near(state->n_lights, 64, 24);
    gn_lighting_state_unref(&last);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void inversion_spreads_evenly(void **unused)
{
    (void)unused;
    enum { RINGS = 8, SECTORS = 8, N = 1024 };
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, light_fixture_constant);
    struct gn_lighting_state *state = make_state(&f, GN_LIGHT_INVERSION, N, NULL, NULL);
    int bins[RINGS][SECTORS] = {{0}}, caps[2] = {0};
    for (int i = 0; i < state->n_lights; i++) {
        const float *d = state->lights[i].dir_world;
        double phi = atan2((double)d[1], (double)d[0]) + pi;
        int ring = (int)fmin((1 - (double)d[2]) / 2 * RINGS, RINGS - 1);
        bins[ring][(int)fmin(phi / (2 * pi) * SECTORS, SECTORS - 1)]++;
        caps[0] += (double)d[2] > 0.96; // a fiftieth of the sphere each
        caps[1] += (double)d[2] < -0.96;
    }
    double chi2 = 0, expected = (double)N / (RINGS * SECTORS);
    for (int i = 0; i < RINGS * SECTORS; i++) {
        double d = bins[i / SECTORS][i % SECTORS] - expected;
        chi2 += d * d / expected;
    }
    printf("# %d points, chi^2 of 64 equal bins %.1f (random: 63), caps %d and %d (20.5)\n",
           state->n_lights, chi2, caps[0], caps[1]);
    assert_int_equal(state->n_lights, N);
    assert_true(chi2 < 30); // far below random points' 63 +- 11: well spread
    assert_near(caps[0], N / 50.0, 3 * sqrt(N / 50.0));
    assert_near(caps[1], N / 50.0, 3 * sqrt(N / 50.0));
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void inversion_keeps_identities(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_FISHEYE_EQUIDISTANT, 200, 200), 0);
    light_fixture_fill(&f, light_fixture_room);
    struct gn_lighting_state *a = make_state(&f, GN_LIGHT_INVERSION, 64, NULL, NULL);
    for (int i = 0; i < 3 * 200 * 200; i++)
        f.image.data[i] *= 1e6f;
    struct gn_lighting_state *b = make_state(&f, GN_LIGHT_INVERSION, 64, a, NULL);
    assert_int_equal(count_changes(a, b), 0);
    for (int i = 0; i < a->n_lights; i++) {
        const struct gn_light *next = find_id(b, a->lights[i].id);
        assert_near(get_angle(a->lights[i].dir_world, next->dir_world), 0, 1e-5);
    }
    gn_lighting_state_unref(&a);
    gn_lighting_state_unref(&b);
    light_fixture_finish(&f);
}

/* Times that a client made up, as far apart as they can be: all of the way, and none back. */
static void any_times_may_be_given(void **unused)
{
    (void)unused;
    struct gn_radiance_map first = {.capture_time_ns = INT64_MIN};
    struct gn_radiance_map last = {.capture_time_ns = INT64_MAX};
    struct gn_lighting_state before = {.map = &first}, after = {.map = &last};
    const struct gn_light_input on = {.map = &last, .previous = &before};
    const struct gn_light_input back = {.map = &first, .previous = &after};
    assert_true(gn_light_get_share(&on) == 1);
    assert_true(gn_light_get_share(&back) == 0);
}

/* A lamp towards +x with a share of the energy, as wide; and the sky of radiance 1 about it. With a
 * sun, a texel with a fifth of the sky's energy elsewhere. */
static struct gn_lighting_state *light_lamp(double share, double radius, bool has_sun,
                                            struct gn_lighting_state *previous)
{
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 2048, 1024), 0);
    light_fixture_fill(&f, light_fixture_constant);
    const struct gn_projection *p = &f.frame.projection;
    double sky = 4 * pi * (double)f.image.data[0], sun = has_sun ? 0.2 * sky : 0, omega = 0;
    for (int pass = 0; pass < 2; pass++) {
        double excess = share / (1 - share) * (sky + sun) / omega; // pass 1
        for (int i = 0; i < p->width * p->height; i++) {
            double d[3];
            int x = i % p->width, y = i / p->width;
            if (!gn_projection_get_direction(p, x + 0.5, y + 0.5, d) || d[0] < cos(radius))
                continue;
            omega += pass == 0 ? gn_projection_get_solid_angle(p, x, y) : 0;
            for (int c = 0; c < 3 && pass == 1; c++)
                gn_image_at(&f.image, x, y)[c] += (float)excess;
        }
    }
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 80, 240)[c] +=
            (float)(sun / gn_projection_get_solid_angle(p, 80, 240));
    struct gn_lighting_state *state = make_state(&f, GN_LIGHT_MEDIAN_CUT, 8, previous, NULL);
    light_fixture_finish(&f);
    return state;
}

/* Each disc has a hysteresis of its own: a sun elsewhere makes no disc of a weak or wide spot. */
static void a_spot_in_between_is_a_disc_only_where_one_was(void **unused)
{
    (void)unused;
    static const struct {
        double share, radius;
        bool is_fresh, is_kept;
    } cases[] = {
        {0.051, 0.012, true, true},   {0.049, 0.012, false, true}, {0.041, 0.012, false, true},
        {0.039, 0.012, false, false}, {0.2, 0.0165, true, true},   {0.2, 0.0182, false, true},
        {0.2, 0.0205, false, false},
    };
    struct gn_lighting_state *before[3] = {
        light_lamp(0, 0.012, false, NULL), light_lamp(0, 0.012, true, NULL),
        light_lamp(0.1, 0.012, true, NULL)}; // nothing, a sun, a sun and the lamp
    for (int k = 0; k < 3; k++)
        assert_int_equal(before[k]->figures.n_discs, k);
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        for (int k = 0; k < 3; k++) {
            struct gn_lighting_state *state =
                light_lamp(cases[i].share, cases[i].radius, k > 0, before[k]);
            bool is_disc = k == 2 ? cases[i].is_kept : cases[i].is_fresh;
            if (state->figures.n_discs != (k > 0) + is_disc)
                fail_msg("case %zu after %d discs: %d discs", i, k, state->figures.n_discs);
            gn_lighting_state_unref(&state);
        }
    }
    for (int k = 0; k < 3; k++)
        gn_lighting_state_unref(&before[k]);
}

static void two_lamps(const double dir[static 3], float out[static 3])
{
    float v = 0.01f;
    if (0.6 * dir[0] + 0.8 * dir[2] > 0.9986) // 3 degrees
        v = 200;
    if (0.48 * dir[0] - 0.64 * dir[1] + 0.6 * dir[2] > 0.9945) // 6 degrees
        v = 100;
    out[0] = out[1] = out[2] = v;
}

static void variance_keeps_a_lamp_whole(void **unused)
{
    (void)unused;
    struct light_fixture f;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
    light_fixture_fill(&f, two_lamps);
    struct gn_lighting_state *state = make_state(&f, GN_LIGHT_VARIANCE, 4, NULL, NULL);
    double small = 200 * 2 * pi * (1 - 0.9986), large = 100 * 2 * pi * (1 - 0.9945);
    assert_near((double)state->lights[0].irradiance[1] / large, 1, 0.02);
    assert_near((double)state->lights[1].irradiance[1] / small, 1, 0.02);
    assert_near(get_angle(state->lights[0].dir_world, (float[3]){0.48f, -0.64f, 0.6f}), 0, 0.01);
    assert_near(get_angle(state->lights[1].dir_world, (float[3]){0.6f, 0, 0.8f}), 0, 0.01);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static float faint;

static void lamp_over_faint(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = out[2] = dir[2] > cos(1.2 * pi / 180) ? 1 : faint;
}

/* What the grid's sums cannot tell from darkness must not keep a lamp of few cells and many texels
 * from being cut. */
static void cuts_reach_a_lamp_over_faint_light(void **unused)
{
    (void)unused;
    static const float backgrounds[] = {0, 1e-30f, 1e-18f, 1e-9f};
    static const enum gn_light_method cutting[] = {GN_LIGHT_MEDIAN_CUT, GN_LIGHT_VARIANCE};
    for (size_t i = 0; i < 8; i++) {
        struct light_fixture f;
        struct gn_lighting_state *state = NULL;
        struct gn_error error = {0};
        const struct gn_light_options options = {
            .method = cutting[i % 2], .n_lights = 16, .no_sh = true, .no_discs = true};
        faint = backgrounds[i / 2];
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 512, 256), 0);
        light_fixture_fill(&f, lamp_over_faint);
        if (gn_lighting_state_create(&f.frame, NULL, &options, NULL, &state, &error) < 0)
            fail_msg("%s", error.text);
        assert_int_equal(state->n_lights, 16);
        check_lights(state);
        gn_lighting_state_unref(&state);
        light_fixture_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_method_keeps_energy_and_number),
        cmocka_unit_test(every_method_takes_maps_of_any_size),
        cmocka_unit_test(every_method_leaves_black_black),
        cmocka_unit_test(every_method_gives_one_texel_its_share),
        cmocka_unit_test(every_method_has_the_same_bits_on_threads),
        cmocka_unit_test(median_cut_halves_energy),
        cmocka_unit_test(cuts_reach_a_lamp_over_faint_light),
        cmocka_unit_test(variance_keeps_a_lamp_whole),
        cmocka_unit_test(quadtree_leaves_the_others_where_they_were),
        cmocka_unit_test(quadtree_is_calm_in_noise),
        cmocka_unit_test(quadtree_comes_back_to_its_number),
        cmocka_unit_test(any_times_may_be_given),
        cmocka_unit_test(a_spot_in_between_is_a_disc_only_where_one_was),
        cmocka_unit_test(inversion_spreads_evenly),
        cmocka_unit_test(inversion_keeps_identities),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
