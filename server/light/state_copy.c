/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* References to lighting states, and copies of them. */
#include "server/light/state_copy.h"

#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/lights.h"
#include "server/light/partition_plan.h"

struct gn_lighting_state *gn_lighting_state_copy(const struct gn_lighting_state *state)
{
    const size_t start = offsetof(struct gn_lighting_state, map);
    _Static_assert(offsetof(struct gn_lighting_state, references) == 0, "only it lies before map");
    size_t lights_bytes = (size_t)state->n_lights * sizeof(*state->lights);
    struct gn_lighting_state *copy = malloc(sizeof(*copy));
    struct gn_light *lights = malloc(lights_bytes + 1);
    if (!copy || !lights) {
        free(copy);
        free(lights);
        return NULL;
    }
    // All but the counter, which others change meanwhile.
    memcpy((char *)copy + start, (const char *)state + start, sizeof(*copy) - start);
    atomic_init(&copy->references, 1);
    if (state->n_lights > 0)
        memcpy(lights, state->lights, lights_bytes);
    copy->lights = lights;
    copy->near = NULL;
    copy->n_near = 0;
    copy->emission = NULL;
    copy->temporal = NULL;
    (void)gn_radiance_map_ref(copy->map);
    if (copy->pyramid)
        (void)gn_pyramid_ref(copy->pyramid);
    if (copy->plan)
        (void)gn_partition_plan_ref(copy->plan);
    if (copy->memory)
        (void)gn_light_memory_ref(copy->memory);
    for (int i = 0; i < copy->n_others; i++)
        (void)gn_lighting_state_ref(copy->others[i]);
    return copy;
}

int gn_lighting_state_add_pyramid(struct gn_lighting_state *state,
                                  const struct gn_light_options *options,
                                  struct gn_error *out_error)
{
    if (!options->want_pyramid || state->pyramid)
        return 0;
    return gn_pyramid_create(state->map, &state->pyramid) < 0
               ? gn_error_set(out_error, -ENOMEM, "the map's pyramid: no memory")
               : 0;
}

struct gn_lighting_state *gn_lighting_state_ref(struct gn_lighting_state *state)
{
    atomic_fetch_add_explicit(&state->references, 1, memory_order_relaxed);
    return state;
}

void gn_lighting_state_unref(struct gn_lighting_state **state)
{
    struct gn_lighting_state *s = *state;
    *state = NULL;
    if (!s || atomic_fetch_sub_explicit(&s->references, 1, memory_order_acq_rel) != 1)
        return;
    gn_light_memory_unref(&s->memory);
    free(s->temporal);
    for (int i = 0; i < s->n_others; i++)
        gn_lighting_state_unref(&s->others[i]);
    gn_partition_plan_unref(&s->plan);
    gn_pyramid_unref(&s->pyramid);
    gn_radiance_map_unref(&s->map);
    gn_emission_unref(&s->emission);
    free(s->near);
    free(s->lights);
    free(s);
}
