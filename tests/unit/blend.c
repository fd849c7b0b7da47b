/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light between several probes: the weights, and that a picture is the weighted sum of each's. */
#include "server/light/blend.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/light_fixture.h"
#include "tests/meshes.h"
#include "tests/stage.h"

#define N_PLACES 3
// In floats exact.
static const double places[N_PLACES][3] = {{-0.5, 0, 0.25}, {0.5, 0, 0.25}, {0.125, 0.375, 1.25}};

/** The light of a probe there; red, blue or green lamps in the direction of +y. */
static struct gn_lighting_state *make_state(int color, const double position[static 3])
{
    struct light_fixture f;
    struct gn_error error = {0};
    struct gn_lighting_state *state = NULL;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 64, 32), 0);
    light_fixture_fill(&f, light_fixture_room);
    for (size_t i = 0; i < (size_t)64 * 32 * 3; i++)
        f.image.data[i] *= i % 3 == (size_t)color ? 1 : 0.1f;
    memcpy(f.frame.position, position, sizeof(f.frame.position));
    const struct gn_light_options options = {.n_lights = 24};
    if (gn_lighting_state_create(&f.frame, NULL, &options, NULL, &state, &error) < 0)
        fail_msg("%s", error.text);
    light_fixture_finish(&f);
    return state;
}

static void make_states(struct gn_lighting_state *states[static N_PLACES],
                        struct gn_lighting_state **out_joined)
{
    static const int colors[N_PLACES] = {0, 2, 1};
    for (int i = 0; i < N_PLACES; i++)
        states[i] = make_state(colors[i], places[i]);
    assert_int_equal(gn_lighting_state_join(states, N_PLACES, 1, out_joined), 0);
}

static void free_states(struct gn_lighting_state *states[static N_PLACES],
                        struct gn_lighting_state **joined)
{
    gn_lighting_state_unref(joined);
    for (int i = 0; i < N_PLACES; i++) {
        assert_int_equal(states[i]->references, 1); // the joined one let them go
        gn_lighting_state_unref(&states[i]);
    }
}

static void test_weights(void **unused)
{
    (void)unused;
    struct gn_lighting_state *states[N_PLACES], *joined;
    struct gn_blend blend;
    double w[GN_PROBES_MAX], before[GN_PROBES_MAX] = {0};
    make_states(states, &joined);
    gn_blend_init(&blend, joined);
    assert_int_equal(blend.n, N_PLACES);
    for (int i = 0; i < N_PLACES; i++) {
        const float there[3] = {(float)places[i][0], (float)places[i][1], (float)places[i][2]};
        gn_blend_get_weights(&blend, there, w);
        for (int j = 0; j < N_PLACES; j++) // exactly its own light
            assert_true(w[j] == (i == j));
    }
    // Along a line that passes through two of the probes: continuous, of sum 1. At distance r of
    // one probe with the next at distance 1 a weight's slope is below 2 / r, and never above 4.
    const int n = 20000;
    double steepest = 0;
    for (int i = 0; i <= n; i++) {
        const float point[3] = {(float)(-1 + 2.0 * i / n), 0, 0.25f};
        double sum = 0;
        gn_blend_get_weights(&blend, point, w);
        for (int j = 0; j < N_PLACES; j++) {
            assert_true(w[j] >= 0 && w[j] <= 1);
            sum += w[j];
            if (i > 0)
                steepest = fmax(steepest, fabs(w[j] - before[j]) * n / 2);
        }
        assert_near(sum, 1, 1e-12);
        memcpy(before, w, sizeof(w));
    }
    print_message("# steepest weight: %.2f / m\n", steepest);
    assert_true(steepest > 0.5 && steepest < 4);
    // Half way between two, the third far off: halves but for the third's share.
    const float middle[3] = {0, 0, 0.25f};
    gn_blend_get_weights(&blend, middle, w);
    assert_near(w[0], w[1], 1e-9);
    // Far out all count alike, and nothing overflows.
    const float far_off[3] = {1e18f, 0, 0};
    gn_blend_get_weights(&blend, far_off, w);
    assert_near(w[0], 1.0 / 3, 1e-6);
    // Two in one place share it.
    memcpy(blend.position[1], blend.position[0], sizeof(blend.position[0]));
    const float there[3] = {(float)places[0][0], 0, (float)places[0][2]};
    gn_blend_get_weights(&blend, there, w);
    assert_true(w[0] == 0.5 && w[1] == 0.5 && w[2] == 0);
    free_states(states, &joined);
}

static void test_join(void **unused)
{
    (void)unused;
    struct gn_lighting_state *states[N_PLACES], *joined, *alone;
    make_states(states, &joined);
    assert_int_equal(joined->n_others, N_PLACES - 1);
    assert_true(joined->sequence == states[1]->sequence && joined->map == states[0]->map);
    // One probe's light is itself: the same object, so the same bits.
    assert_int_equal(gn_lighting_state_join(states, 1, 0, &alone), 0);
    assert_ptr_equal(alone, states[0]);
    struct gn_blend blend;
    gn_blend_init(&blend, alone);
    const float point[3] = {3, 4, 5};
    for (int i = 0; i < 100; i++) {
        const float dir[3] = {sinf((float)i), cosf((float)i) * 0.6f, cosf((float)i) * 0.8f};
        float a[3], b[3];
        gn_blend_get_radiance(&blend, point, dir, a);
        gn_radiance_map_get_radiance(states[0]->map, dir, b);
        assert_memory_equal(a, b, sizeof(a));
    }
    gn_lighting_state_unref(&alone);
    free_states(states, &joined);
}

static void render(struct gn_test_stage *stage, const struct gn_lighting_state *state,
                   const struct gn_render_options *options)
{
    struct gn_error error = {0};
    if (gn_renderer_render(stage->renderer, &stage->camera, state, options, &stage->layers,
                           &stage->report, &error) < 0)
        fail_msg("%s", error.text);
}

/** Pixel (x, y) of the floor, a virtual one or a real one, at z = 0. */
static void get_weights(const struct gn_test_stage *stage, const struct gn_lighting_state *joined,
                        int x, int y, double w[static GN_PROBES_MAX])
{
    struct gn_blend blend;
    double p[3];
    gn_blend_init(&blend, joined);
    gn_test_stage_get_point(stage, x + 0.5, y + 0.5, 0, p);
    const float point[3] = {(float)p[0], (float)p[1], (float)p[2]};
    gn_blend_get_weights(&blend, point, w);
}

/** A virtual floor is lit by each probe's light in proportion to its weight at each pixel's point;
 * in a mirror each map is seen so. */
static void check_virtual(enum gn_material_type material, const struct gn_render_options *options,
                          double tolerance)
{
    static const float grey[3] = {0.5f, 0.5f, 0.5f};
    const double eye[3] = {0, -2, 1.5}, target[3] = {0, 0, 0};
    struct gn_test_stage stage = {0};
    struct gn_lighting_state *states[N_PLACES], *joined;
    double alone[N_PLACES][24 * 12][3];
    make_states(states, &joined);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_plane(4, 2), 0, 0, 0, material, grey);
    gn_test_stage_commit(&stage, 0);
    // The reference has its grids where it sees contrast: in smaller pixels.
    gn_test_stage_aim(&stage, 24, 12, options->quality == GN_QUALITY_REFERENCE ? 100 : 16, eye,
                      target);
    for (int i = 0; i < N_PLACES; i++) {
        render(&stage, states[i], options);
        for (int p = 0; p < 24 * 12; p++)
            for (int c = 0; c < 3; c++)
                alone[i][p][c] = (double)stage.layers.virtual_rgba.data[4 * p + c];
    }
    render(&stage, joined, options);
    double most = 0, least = 1;
    for (int p = 0; p < 24 * 12; p++) {
        double w[GN_PROBES_MAX];
        const float *pixel = stage.layers.virtual_rgba.data + (size_t)4 * p;
        if (pixel[3] < 1 || p / 24 < 3) // the floor's edge has a grid of rays
            continue;
        get_weights(&stage, joined, p % 24, p / 24, w);
        most = fmax(most, w[0]);
        least = fmin(least, w[0]);
        for (int c = 0; c < 3; c++) {
            double expected = w[0] * alone[0][p][c] + w[1] * alone[1][p][c] + w[2] * alone[2][p][c];
            assert_near(pixel[c], expected, tolerance * expected);
        }
    }
    assert_true(most - least > 0.1);
    gn_test_stage_finish(&stage);
    free_states(states, &joined);
}

static void test_picture_is_weighted_sum(void **unused)
{
    (void)unused;
    // No grids of rays: one point for each pixel. The reference has its grid where it sees
    // contrast.
    const struct gn_render_options lights = {.quality = GN_QUALITY_SEED};
    const struct gn_render_options irradiance = {.quality = GN_QUALITY_SEED,
                                                 .shading = GN_SHADING_IRRADIANCE};
    const struct gn_render_options reference = {.quality = GN_QUALITY_REFERENCE};
    check_virtual(GN_MATERIAL_DIFFUSE, &lights, 1e-5);
    check_virtual(GN_MATERIAL_DIFFUSE, &irradiance, 1e-5);
    check_virtual(GN_MATERIAL_DIFFUSE, &reference, 1e-3);
    check_virtual(GN_MATERIAL_MIRROR, &lights, 1e-5);
}

/** One state with the lights of both, each by its weight. */
static struct gn_lighting_state *mix(const struct gn_lighting_state *a,
                                     const struct gn_lighting_state *b, const double *w)
{
    struct gn_lighting_state *mixed = make_state(0, places[0]);
    free(mixed->lights);
    mixed->n_lights = a->n_lights + b->n_lights;
    mixed->lights = calloc((size_t)mixed->n_lights, sizeof(*mixed->lights));
    for (int i = 0; i < mixed->n_lights; i++) {
        bool is_a = i < a->n_lights;
        mixed->lights[i] = is_a ? a->lights[i] : b->lights[i - a->n_lights];
        for (int c = 0; c < 3; c++)
            mixed->lights[i].irradiance[c] *= (float)w[is_a ? 0 : 1];
    }
    return mixed;
}

/** The factor of a pixel of real floor is that which both probes' lights, each by the pixel's
 * weights, would give. */
static void test_shadow_is_weighted(void **unused)
{
    (void)unused;
    static const float grey[3] = {0.5f, 0.5f, 0.5f};
    const double eye[3] = {0, -2, 1.5}, target[3] = {0, 0, 0};
    const struct gn_render_options options = {.quality = GN_QUALITY_SEED};
    struct gn_test_stage stage = {0};
    struct gn_lighting_state *two[2] = {make_state(0, places[0]), make_state(2, places[1])},
                             *joined;
    float shadow[24 * 12 * 3];
    int n = 0;
    for (int i = 0; i < two[1]->n_lights; i++) // quite another light
        two[1]->lights[i].dir_world[0] *= -1;
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_box(0.5f, 0.5f, 0.5f), 0, 0, 0.25,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_aim(&stage, 24, 12, 16, eye, target);
    assert_int_equal(gn_lighting_state_join(two, 2, 0, &joined), 0);
    render(&stage, joined, &options);
    memcpy(shadow, stage.layers.shadow.data, sizeof(shadow));
    for (int p = 3 * 24; p < 12 * 24; p += 5) {
        double w[GN_PROBES_MAX];
        if (shadow[3 * p] > 0.98f)
            continue;
        get_weights(&stage, joined, p % 24, p / 24, w);
        struct gn_lighting_state *mixed = mix(two[0], two[1], w);
        render(&stage, mixed, &options);
        for (int c = 0; c < 3; c++)
            assert_near(shadow[3 * p + c], stage.layers.shadow.data[3 * p + c], 1e-5);
        gn_lighting_state_unref(&mixed);
        n++;
    }
    assert_true(n > 8);
    gn_lighting_state_unref(&joined);
    gn_lighting_state_unref(&two[0]);
    gn_lighting_state_unref(&two[1]);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_weights),
        cmocka_unit_test(test_join),
        cmocka_unit_test(test_picture_is_weighted_sum),
        cmocka_unit_test(test_shadow_is_weighted),
    };
    return cmocka_run_group_tests_name("blend", tests, NULL, NULL);
}
