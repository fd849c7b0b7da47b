/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a frame of a stream takes from the system, once the stream is warm: what is published and
 * what the next frame is to know, under a byte for each texel; no map, no grid of cells. */
#include "tests/unit/cmocka_setup.h"

#include "server/light/state.h"
#include "tests/allocations.h"
#include "tests/light_fixture.h"

enum { WIDTH = 512, HEIGHT = 256, N_WARM_UP = 4, N_FRAMES = 8 };

/* A room, with a sun besides, which is kept whole and taken out of a copy of the map. */
static void sunny_room(const double dir[static 3], float out[static 3])
{
    light_fixture_room(dir, out);
    for (int c = 0; c < 3 && dir[0] * 0.6 + dir[2] * 0.8 > 0.99996; c++)
        out[c] = 2e5f;
}

static long get_bytes_per_frame(enum gn_light_method method,
                                void (*radiance)(const double dir[static 3], float out[static 3]),
                                int n_discs)
{
    struct light_fixture f;
    struct gn_lighting_state *state = NULL, *next;
    long before = 0;
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, WIDTH, HEIGHT), 0);
    light_fixture_fill(&f, radiance);
    for (int i = 0; i < N_WARM_UP + N_FRAMES; i++) {
        struct gn_light_options options = {.method = method, .smoothing = 0.4, .previous = state};
        struct gn_error error = {0};
        if (i == N_WARM_UP)
            before = gn_test_allocated_bytes;
        f.frame.capture_time_ns += 33333333;
        f.frame.response.scale = 1 + 0.01 * (i % 2);
        assert_int_equal(gn_lighting_state_create(&f.frame, NULL, &options, NULL, &next, &error),
                         0);
        gn_lighting_state_unref(&state);
        state = next;
    }
    long bytes = (gn_test_allocated_bytes - before) / N_FRAMES;
    assert_true(before > 12L * WIDTH * HEIGHT); // the counter works
    assert_int_equal(state->figures.n_discs, n_discs);
    gn_lighting_state_unref(&state);
    light_fixture_finish(&f);
    return bytes;
}

static void a_warm_stream_takes_no_map(void **unused)
{
    (void)unused;
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        enum gn_light_method method = (enum gn_light_method)m;
        long room = get_bytes_per_frame(method, light_fixture_room, 0);
        long sunny =
            get_bytes_per_frame(method, sunny_room, method == GN_LIGHT_PARTITION_SEED ? 0 : 1);
        print_message("# %s: %ld and, with a sun, %ld bytes a frame\n",
                      gn_light_method_get_name(method), room, sunny);
        assert_true(room < 1L * WIDTH * HEIGHT);
        assert_true(sunny < room + WIDTH * HEIGHT / 4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_warm_stream_takes_no_map)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
