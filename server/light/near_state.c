/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Near light of a lighting state. */
#include <errno.h>
#include <stdlib.h>

#include "server/light/state_copy.h"

static bool gives_light(const struct gn_near_light *light)
{
    return light->intensity[0] > 0 || light->intensity[1] > 0 || light->intensity[2] > 0;
}

int gn_lighting_state_set_emission(struct gn_lighting_state *state, struct gn_emission *emission)
{
    struct gn_near_light *near = NULL;
    int n = 0;
    if (emission) {
        near = malloc((size_t)emission->n_lights * sizeof(*near) + 1);
        if (!near)
            return -ENOMEM;
        for (int i = 0; i < emission->n_lights; i++) {
            if (gives_light(&emission->lights[i]))
                near[n++] = emission->lights[i];
        }
        (void)gn_emission_ref(emission);
    }
    gn_emission_unref(&state->emission);
    free(state->near);
    state->emission = emission;
    state->near = near;
    state->n_near = n;
    return 0;
}

int gn_lighting_state_create_dark(struct gn_emission *emission,
                                  const struct gn_light_options *options, int64_t capture_time_ns,
                                  struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    struct gn_image black = {0};
    struct gn_environment_frame frame = {
        .codes = &black,
        .projection = {.type = GN_PROJECTION_LATLONG, .width = 8, .height = 4},
        .world_from_probe = {1, 0, 0, 0},
        .capture_time_ns = capture_time_ns,
    };
    const char *reason = NULL;
    struct gn_lighting_state *state = NULL;
    *out_state = NULL;
    int ret = gn_projection_init(&frame.projection, &reason);
    if (ret == 0)
        ret = gn_image_init(&black, frame.projection.width, frame.projection.height, 3);
    if (ret < 0)
        return gn_error_set(out_error, ret, "lighting state: no memory");
    ret = gn_lighting_state_create(&frame, NULL, options, NULL, &state, out_error);
    if (ret == 0 && (ret = gn_lighting_state_set_emission(state, emission)) < 0) {
        gn_lighting_state_unref(&state);
        (void)gn_error_set(out_error, ret, "lighting state: no memory");
    }
    gn_image_finish(&black);
    *out_state = state;
    return ret;
}

int gn_lighting_state_replace_emission(const struct gn_lighting_state *state,
                                       struct gn_emission *emission,
                                       struct gn_lighting_state **out_state)
{
    *out_state = NULL;
    struct gn_lighting_state *copy = gn_lighting_state_copy(state);
    if (!copy)
        return -ENOMEM;
    if (gn_lighting_state_set_emission(copy, emission) < 0) {
        gn_lighting_state_unref(&copy);
        return -ENOMEM;
    }
    *out_state = copy;
    return 0;
}
