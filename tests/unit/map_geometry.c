/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The global model's geometry of a map: distances and normals, what the probe sees, the places of
 * lights. */
#include "server/light/map_geometry.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/stage.h"

// The probe is here in a cube of 2 m, with a post of 0.2 m beside it.
static const double probe[3] = {0.25, 0, -0.125};

static struct gn_scene *make_scene(void)
{
    struct gn_scene_object *objects = calloc(2, sizeof(*objects));
    struct gn_scene *scene = NULL;
    struct gn_error error = {0};
    assert_non_null(objects);
    for (int i = 0; i < 2; i++) {
        objects[i] = (struct gn_scene_object){.role = GN_RT_REAL};
        objects[i].mesh = i == 0 ? gn_test_make_box(2, 2, 2) : gn_test_make_box(0.2f, 0.2f, 2);
        for (int k = 0; k < 4; k++)
            objects[i].world_from_object[5 * k] = 1;
        objects[i].world_from_object[3] = i == 0 ? 0 : -0.5;
    }
    if (gn_scene_create(objects, 2, NULL, &scene, &error) < 0)
        fail_msg("%s", error.text);
    free(objects);
    return scene;
}

static struct gn_lighting_state *make_light(const struct gn_scene *scene, const double at[3],
                                            enum gn_light_method method,
                                            const struct gn_lighting_state *previous)
{
    struct light_fixture f;
    struct gn_error error = {0};
    struct gn_lighting_state *state = NULL;
    const struct gn_radiance_map_options map_options = {.model = scene};
    const struct gn_light_options options = {.method = method, .previous = previous};
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 64, 32), 0);
    light_fixture_fill(&f, light_fixture_room);
    memcpy(f.frame.position, at, sizeof(f.frame.position));
    if (gn_lighting_state_create(&f.frame, &map_options, &options, NULL, &state, &error) < 0)
        fail_msg("%s", error.text);
    light_fixture_finish(&f);
    return state;
}

/** Nearness of the cube's inside along dir. */
static double get_nearness(const float dir[static 3])
{
    double most = 0;
    for (int k = 0; k < 3; k++) {
        double d = (double)dir[k];
        most = fmax(most, d > 0 ? d / (1 - probe[k]) : -d / (1 + probe[k]));
    }
    return most;
}

static void test_distances(void **unused)
{
    (void)unused;
    struct gn_scene *scene = make_scene();
    struct gn_lighting_state *state = make_light(scene, probe, GN_LIGHT_PARTITION_ENERGY, NULL);
    const struct gn_radiance_map *map = state->map;
    const struct gn_map_geometry *g = map->geometry;
    int n_post = 0;
    assert_non_null(g);
    assert_int_equal(g->n_covered, 64 * 32);
    for (size_t i = 0; i < (size_t)64 * 32; i++) {
        const float *d = map->direction_world + 3 * i, *n = g->normal + 3 * i;
        double wall = get_nearness(d);
        assert_true((double)(n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) < 0);
        if ((double)g->nearness[i] > 1.001 * wall) // the post stands before the wall
            n_post++;
        else
            assert_near(g->nearness[i], wall, 1e-5);
    }
    assert_true(n_post > 20 && n_post < 300);
    gn_lighting_state_unref(&state);
    gn_scene_destroy(&scene);
}

static void test_sees(void **unused)
{
    (void)unused;
    struct gn_scene *scene = make_scene();
    struct gn_lighting_state *state = make_light(scene, probe, GN_LIGHT_PARTITION_ENERGY, NULL);
    const struct gn_radiance_map *map = state->map;
    for (int i = 0; i < 200; i++) {
        const float point[3] = {1, sinf((float)i), cosf(1.7f * (float)i)};
        float dir[3], there[3], seen[3];
        assert_true(gn_radiance_map_get_radiance_at(map, point, there));
        assert_true(gn_map_geometry_sees(map->geometry, point, dir));
        gn_radiance_map_get_radiance(map, dir, seen);
        assert_memory_equal(there, seen, sizeof(seen));
    }
    const float behind_post[3] = {-1, 0, -0.125f};
    float untouched[3] = {7, 7, 7};
    assert_false(gn_radiance_map_get_radiance_at(map, behind_post, untouched));
    assert_true(untouched[0] == 7);
    // The local model knows no places.
    struct gn_lighting_state *local = make_light(NULL, probe, GN_LIGHT_PARTITION_ENERGY, NULL);
    const float point[3] = {1, 0, 0};
    assert_null(local->map->geometry);
    assert_false(gn_radiance_map_get_radiance_at(local->map, point, untouched));
    for (int i = 0; i < local->n_lights; i++)
        assert_true(local->lights[i].distance == 0);
    gn_lighting_state_unref(&local);
    gn_lighting_state_unref(&state);
    gn_scene_destroy(&scene);
}

static void test_made_once(void **unused)
{
    (void)unused;
    static const double elsewhere[3] = {0.5, 0, 0};
    struct gn_scene *scene = make_scene();
    struct gn_lighting_state *a = make_light(scene, probe, GN_LIGHT_PARTITION_ENERGY, NULL);
    struct gn_lighting_state *b = make_light(scene, probe, GN_LIGHT_PARTITION_ENERGY, a);
    struct gn_lighting_state *c = make_light(scene, elsewhere, GN_LIGHT_PARTITION_ENERGY, b);
    assert_ptr_equal(a->map->geometry, b->map->geometry);
    assert_ptr_not_equal(b->map->geometry, c->map->geometry);
    assert_ptr_equal(b->map->table, c->map->table);
    gn_lighting_state_unref(&a);
    gn_lighting_state_unref(&b);
    gn_lighting_state_unref(&c);
    gn_scene_destroy(&scene);
}

/** Whatever the method, lights stand in the cube, and none behind what the probe sees there. */
static void test_places_of_lights(void **unused)
{
    (void)unused;
    struct gn_scene *scene = make_scene();
    for (int method = 0; method < GN_LIGHT_METHOD_COUNT; method++) {
        struct gn_lighting_state *state =
            make_light(scene, probe, (enum gn_light_method)method, NULL);
        double near_wall = 0;
        assert_true(state->n_lights > 3);
        for (int i = 0; i < state->n_lights; i++) {
            const struct gn_light *light = &state->lights[i];
            const float *d = light->dir_world, *n = light->normal;
            double distance = (double)light->distance;
            assert_true(distance > 0.05 && distance <= 1.0001 / get_nearness(d));
            near_wall += distance > 0.9 / get_nearness(d);
            assert_near(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1, 1e-5);
        }
        // Nearly all are on it.
        assert_true(near_wall > 0.6 * state->n_lights);
        gn_lighting_state_unref(&state);
    }
    gn_scene_destroy(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distances),
        cmocka_unit_test(test_sees),
        cmocka_unit_test(test_made_once),
        cmocka_unit_test(test_places_of_lights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
