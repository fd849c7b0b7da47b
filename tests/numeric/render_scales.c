/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Whole frames of scenes from 1e-3 to 1e6 of their size, and up to 1e4 of their sizes away from the
 * origin. A float between 2^12 and 2^13 is the next one's neighbour by 2^-11: at 1e4 sizes (0.7e4
 * along an axis) coordinates are steps of 5e-4 sizes. All else follows from this number.
 * Under sanitizers the first and the last place or power.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/attr.h"
#include "server/light/emitters.h"
#include "tests/meshes.h"
#include "tests/numeric/extreme.h"
#include "tests/sanitized.h"

#define SIDE 40
#define N_PIXELS (SIDE * SIDE)

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const double scales[] = {1e-3, 1, 1e3, 1e6};

/** A floor and a crate of the room; on and over it what is diffuse, smooth, a mirror and glossy. */
static void add_yard(struct gn_test_stage *stage)
{
    static const float bright[3] = {0.9f, 0.8f, 0.7f};
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(4, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_cube(0.6f), 1.1, 0.7, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.8f), 0, 0, 0.4, GN_MATERIAL_DIFFUSE,
                      bright);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.35f, 8), -0.9, 0.6, 0.5,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.3f, 8), 0.9, -0.8, 0.35,
                      GN_MATERIAL_MIRROR, bright);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_box(0.4f, 0.3f, 0.2f), -0.7, -0.8, 0.15,
                      GN_MATERIAL_GGX, bright);
    stage->objects[stage->n_objects - 1].material.roughness = 0.4f;
}

/** A stage at a place, lit and aimed at. */
static void make_yard(struct gn_test_stage *stage, const struct gn_extreme_place *place)
{
    static const double eye[3] = {2.6, -3.2, 2.4}, target[3] = {0, 0, 0.2};
    add_yard(stage);
    gn_extreme_move_objects(stage, place);
    gn_test_stage_commit(stage, 0);
    gn_extreme_set_sky(stage, place, 8);
    gn_extreme_aim(stage, place, SIDE, 40, eye, target);
}

/** Pictures of the three qualities. */
struct pictures {
    double scale;
    struct {
        float virtual_rgba[4 * N_PIXELS], shadow[3 * N_PIXELS], depth[N_PIXELS];
    } of[3];
    double worst;
    int n_shadowed;
};

static void keep(void *context, const struct gn_extreme_view *view)
{
    struct pictures *p = context;
    memcpy(p->of[view->quality].virtual_rgba, view->layers->virtual_rgba.data,
           sizeof(p->of[0].virtual_rgba));
    memcpy(p->of[view->quality].shadow, view->layers->shadow.data, sizeof(p->of[0].shadow));
    memcpy(p->of[view->quality].depth, view->layers->depth.data, sizeof(p->of[0].depth));
    for (int i = 0; i < 3 * N_PIXELS; i++)
        p->n_shadowed += view->layers->shadow.data[i] < 0.9f;
}

/** A lamp of the room and a virtual one: their light falls off by the square. */
struct lamps {
    struct gn_emitters *emitters;
    struct gn_emission *emission;
    struct gn_lighting_state *light;
};

static void add_lamps(struct gn_test_stage *stage, double scale, struct lamps *lamps)
{
    float square = (float)(scale * scale);
    const struct gn_scene_light at[2] = {
        {.position = {-1.5 * scale, -0.5 * scale, 2 * scale},
         .intensity = {0.5f * square, 0.4f * square, 0.3f * square},
         .radius = (float)(0.05 * scale),
         .role = GN_RT_REAL},
        {.position = {0.3 * scale, -0.9 * scale, 0.6 * scale},
         .intensity = {0.3f * square, 0.3f * square, 0.6f * square},
         .radius = (float)(0.05 * scale),
         .role = GN_RT_VIRTUAL},
    };
    assert_int_equal(gn_scene_set_lights(stage->scene, at, 2, NULL), 0);
    assert_int_equal(gn_emitters_create(stage->scene, NULL, &lamps->emitters, NULL), 0);
    lamps->emission = gn_emitters_get_emission(lamps->emitters);
    assert_int_equal(gn_lighting_state_create_dark(lamps->emission, NULL, 0, &lamps->light, NULL),
                     0);
    stage->state.n_near = lamps->light->n_near;
    stage->state.near = lamps->light->near;
    stage->state.emission = lamps->light->emission;
}

static void finish_lamps(struct lamps *lamps)
{
    gn_lighting_state_unref(&lamps->light);
    gn_emission_unref(&lamps->emission);
    gn_emitters_destroy(&lamps->emitters);
}

static void compare_bits(void *context, const struct gn_extreme_view *view)
{
    struct pictures *p = context;
    const struct gn_layers *layers = view->layers;
    int q = view->quality;
    assert_memory_equal(layers->virtual_rgba.data, p->of[q].virtual_rgba,
                        sizeof(p->of[q].virtual_rgba));
    assert_memory_equal(layers->shadow.data, p->of[q].shadow, sizeof(p->of[q].shadow));
    for (int i = 0; i < N_PIXELS; i++)
        assert_true(layers->depth.data[i] == p->of[q].depth[i] * (float)p->scale);
}

/* A power of two scales every number exactly: no length of the renderer's own takes part. */
static void test_powers_of_two_change_no_bit(void **state)
{
    static const int powers[] = {0, -10, 20};
    struct pictures *first = calloc(1, sizeof(*first));
    (void)state;
    assert_non_null(first);
    for (size_t i = 0; i < GN_ARRAY_LEN(powers); i = gn_test_get_next(i, GN_ARRAY_LEN(powers))) {
        struct gn_test_stage stage = {0};
        struct lamps lamps = {0};
        first->scale = ldexp(1, powers[i]);
        const struct gn_extreme_place place = gn_extreme_at_scale(first->scale);
        make_yard(&stage, &place);
        add_lamps(&stage, first->scale, &lamps);
        gn_extreme_check(&stage, NULL, NULL, i == 0 ? keep : compare_bits, first);
        gn_test_stage_finish(&stage);
        finish_lamps(&lamps);
    }
    assert_true(first->n_shadowed > 300);
    free(first);
}

/** How far x lies outside what the 3 x 3 pixels about i have in a channel; a quarter more of their
 * span is free, as edges of several lights may lie in it. */
static double get_excess(const float *picture, int n_channels, int i, int channel, double x)
{
    double low = INFINITY;
    double high = -INFINITY;
    for (int n = 0; n < 9; n++) {
        int px = i % SIDE + n % 3 - 1;
        int py = i / SIDE + n / 3 - 1;
        if (px < 0 || py < 0 || px >= SIDE || py >= SIDE)
            continue;
        double there = (double)picture[n_channels * (py * SIDE + px) + channel];
        low = fmin(low, there);
        high = fmax(high, there);
    }
    double free = 0.25 * (high - low);
    return fmax(0, fmax(low - free - x, x - high - free));
}

static void compare_nearby(void *context, const struct gn_extreme_view *view)
{
    struct pictures *p = context;
    for (int i = 0; i < N_PIXELS; i++) {
        for (int c = 0; c < 3; c++)
            p->worst = fmax(p->worst, get_excess(p->of[view->quality].shadow, 3, i, c,
                                                 (double)view->layers->shadow.data[3 * i + c]));
        double covered = (double)view->layers->virtual_rgba.data[4 * i + 3];
        assert_true(get_excess(p->of[view->quality].virtual_rgba, 4, i, 3, covered) == 0);
    }
}

/*
 * At other places all coordinates are rounded to the step there: vertices, the eye, points, origins
 * of rays, by less than 4 steps (2e-3 sizes) together. Centres of pixels are 0.1 sizes apart: each
 * sees what at scale 1 lies between it and its neighbours, as their factors do. The
 * floor's cells, one size wide, tilt by 2 steps a size: cosines, and with them factors, by 1e-3.
 */
static void test_other_places_show_the_same(void **state)
{
    static const struct gn_render_options one_ray = {.single_ray = true};
    const struct gn_extreme_place middle = gn_extreme_at_scale(1);
    const size_t n_places = 2 * GN_ARRAY_LEN(scales);
    struct gn_test_stage yard = {0};
    struct pictures *first = calloc(1, sizeof(*first));
    (void)state;
    assert_non_null(first);
    make_yard(&yard, &middle);
    gn_extreme_check(&yard, NULL, &one_ray, keep, first);
    gn_test_stage_finish(&yard);
    for (size_t i = 0; i < n_places; i = gn_test_get_next(i, n_places)) {
        struct gn_test_stage stage = {0};
        double distance = i % 2 ? 1e4 : 0;
        const struct gn_extreme_place place = gn_extreme_away(scales[i / 2], distance);
        make_yard(&stage, &place);
        first->worst = 0;
        gn_extreme_check(&stage, NULL, &one_ray, compare_nearby, first);
        print_message("# scale %g, %g sizes away: factors leave their neighbourhood by %.1e\n",
                      scales[i / 2], distance, first->worst);
        assert_true(first->worst <= 2 * gn_extreme_get_step(distance) + 1e-5);
        gn_test_stage_finish(&stage);
    }
    assert_true(first->n_shadowed > 300);
    free(first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_powers_of_two_change_no_bit),
        cmocka_unit_test(test_other_places_show_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
