/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The picture of a lighting state: sizes, lights where they belong, colours. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/light/light_picture.h"
#include "tests/light_fixture.h"

static void half_red(const double dir[static 3], float out[static 3])
{
    out[0] = dir[2] > 0 ? 2 : 0.02f;
    out[1] = out[2] = 0.02f;
}

static struct gn_lighting_state *make_state(struct light_fixture *f,
                                            void (*radiance)(const double dir[static 3],
                                                             float out[static 3]))
{
    struct gn_lighting_state *state;
    struct gn_error error = {0};
    assert_int_equal(light_fixture_init(f, GN_PROJECTION_LATLONG, 64, 32), 0);
    light_fixture_fill(f, radiance);
    assert_int_equal(gn_lighting_state_create(&f->frame, NULL, NULL, NULL, &state, &error), 0);
    return state;
}

static void the_map_is_shown_in_world_axes(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_lighting_state *state = make_state(&f, half_red);
    struct gn_light_picture_options options = {.width = 90, .height = 45, .no_lights = true};
    struct gn_image8 picture;
    assert_int_equal(gn_light_picture_make(state, &options, NULL, &picture), 0);
    assert_true(picture.width == 90 && picture.height == 45 && picture.channels == 3);
    const uint8_t *up = gn_image8_at(&picture, 20, 5), *down = gn_image8_at(&picture, 20, 40);
    assert_true(up[0] > 150 && up[0] > 2 * up[1]);
    assert_true(down[0] == down[1] && down[0] < up[0]);
    gn_image8_finish(&picture);
    options.exposure_ev = -3;
    assert_int_equal(gn_light_picture_make(state, &options, NULL, &picture), 0);
    assert_true(gn_image8_at(&picture, 20, 40)[1] < 40);
    gn_image8_finish(&picture);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void lights_and_borders_are_drawn_where_they_are(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_lighting_state *state = make_state(&f, light_fixture_room);
    struct gn_light_picture_options options = {.no_lights = true};
    struct gn_image8 plain, drawn, borders;
    assert_int_equal(gn_light_picture_make(state, &options, NULL, &plain), 0);
    assert_true(plain.width == 512 && plain.height == 256);
    options.has_regions = true;
    assert_int_equal(gn_light_picture_make(state, &options, NULL, &borders), 0);
    assert_int_equal(gn_light_picture_make(state, NULL, NULL, &drawn), 0);
    assert_true(memcmp(plain.data, borders.data, 3 * 512 * 256) != 0);
    struct gn_projection p = {.type = GN_PROJECTION_LATLONG, .width = 512, .height = 256};
    const struct gn_light *last = &state->lights[state->n_lights - 1]; // on top of the others
    double xy[2],
        d[3] = {(double)last->dir_world[0], (double)last->dir_world[1], (double)last->dir_world[2]};
    const char *reason;
    assert_int_equal(gn_projection_init(&p, &reason), 0);
    assert_true(gn_projection_get_position(&p, d, xy));
    const uint8_t *at = gn_image8_at(&drawn, (int)xy[0], (int)xy[1]);
    int strongest = at[0] > at[1] ? at[0] : at[1];
    assert_true((strongest > at[2] ? strongest : at[2]) > 240); // its hue at full strength
    int n_changed = 0;
    for (int i = 0; i < 512 * 256; i++)
        n_changed += memcmp(plain.data + 3 * i, drawn.data + 3 * i, 3) != 0;
    assert_true(n_changed > 5 * state->n_lights && n_changed < 512 * 256 / 4);
    gn_image8_finish(&plain);
    gn_image8_finish(&drawn);
    gn_image8_finish(&borders);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

static void black(const double dir[static 3], float out[static 3])
{
    (void)dir;
    out[0] = 0;
}

static void bad_sizes_are_refused_and_black_is_black(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_lighting_state *state = make_state(&f, black);
    const struct gn_light_picture_options bad[] = {
        {.width = -1}, {.height = 20000}, {.exposure_ev = NAN}};
    struct gn_image8 picture;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(gn_light_picture_make(state, &bad[i], NULL, &picture), -EINVAL);
        assert_null(picture.data);
    }
    assert_int_equal(gn_light_picture_make(state, NULL, NULL, &picture), 0);
    for (int i = 0; i < 3 * 512 * 256; i++)
        assert_int_equal(picture.data[i], 0);
    gn_image8_finish(&picture);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_map_is_shown_in_world_axes),
        cmocka_unit_test(lights_and_borders_are_drawn_where_they_are),
        cmocka_unit_test(bad_sizes_are_refused_and_black_is_black),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
