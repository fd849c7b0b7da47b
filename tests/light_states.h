/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Lighting states of frames with known light, and of streams of such frames, for tests with cmocka.
 */
#ifndef GN_TESTS_LIGHT_STATES_H
#define GN_TESTS_LIGHT_STATES_H

#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/unit/cmocka_setup.h"

/** Each function fails the test where it fails. options, pool may be NULL; owned by the caller. */
static inline struct gn_lighting_state *make_state(const struct light_fixture *f,
                                                   const struct gn_light_options *options,
                                                   struct gn_pool *pool)
{
    struct gn_lighting_state *state = NULL;
    struct gn_error error = {0};
    if (gn_lighting_state_create(&f->frame, NULL, options, pool, &state, &error) < 0)
        fail_msg("%s", error.text);
    return state;
}

/** One more frame of a stream, step_ns later: replaces *state. */
static inline void advance(struct light_fixture *f, int64_t step_ns,
                           struct gn_light_options *options, struct gn_lighting_state **state)
{
    f->frame.capture_time_ns += step_ns;
    options->previous = *state;
    struct gn_lighting_state *next = make_state(f, options, NULL);
    gn_lighting_state_unref(state);
    *state = next;
}

static inline void make_room(struct light_fixture *f, enum gn_projection_type type, int width,
                             int height)
{
    assert_int_equal(light_fixture_init(f, type, width, height), 0);
    light_fixture_fill(f, light_fixture_room);
}

/** A lamp seen by the texels within 5 degrees of dir (probe axes). */
static inline bool is_on_lamp(const double lamp[static 3], const double dir[static 3])
{
    return dir[0] * lamp[0] + dir[1] * lamp[1] + dir[2] * lamp[2] > 0.9962;
}

static inline void set_lamp(struct light_fixture *f, const double lamp[static 3], float radiance)
{
    for (int y = 0; y < f->image.height; y++)
        for (int x = 0; x < f->image.width; x++) {
            double d[3];
            if (gn_projection_get_direction(&f->frame.projection, x + 0.5, y + 0.5, d) &&
                is_on_lamp(lamp, d))
                for (int c = 0; c < 3; c++)
                    gn_image_at(&f->image, x, y)[c] = radiance;
        }
}

/** f's picture: clean's with noise of 1 % of each channel. */
static inline void add_noise(const struct light_fixture *clean, struct light_fixture *f,
                             uint32_t *random)
{
    for (int i = 0; i < 3 * f->image.width * f->image.height; i++) {
        float sum = 0; // of twelve even ones: a standard deviation of 1
        for (int k = 0; k < 12; k++) {
            *random = *random * 1664525 + 1013904223;
            sum += (float)(*random >> 8) / (float)(1 << 24) - 0.5f;
        }
        f->image.data[i] = clean->image.data[i] * (1 + 0.01f * sum);
    }
}

/** The light of that id, or NULL. */
static inline const struct gn_light *find_light(const struct gn_lighting_state *state, uint64_t id)
{
    for (int i = 0; i < state->n_lights; i++)
        if (state->lights[i].id == id)
            return &state->lights[i];
    return NULL;
}

/** How many lights of after have ids that before has not. */
static inline int count_new(const struct gn_lighting_state *before,
                            const struct gn_lighting_state *after)
{
    int n = 0;
    for (int i = 0; i < after->n_lights; i++)
        n += find_light(before, after->lights[i].id) == NULL;
    return n;
}

static inline void assert_same_lights(const struct gn_lighting_state *a,
                                      const struct gn_lighting_state *b)
{
    assert_int_equal(a->n_lights, b->n_lights);
    for (int i = 0; i < a->n_lights; i++)
        assert_true(light_fixture_is_same(&a->lights[i], &b->lights[i]));
}

#endif
