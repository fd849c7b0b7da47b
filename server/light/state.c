/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/state.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/discs.h"
#include "server/light/luminance.h"
#include "server/light/map_geometry.h"
#include "server/light/map_table.h"
#include "server/light/method.h"
#include "server/light/state_copy.h"
#include "server/light/temporal.h"

/* A light with its place in the list, which decides between equals. */
struct ranked_light {
    struct gn_light light;
    double luminance;
    int place;
};

static int compare_ranked(const void *a, const void *b)
{
    const struct ranked_light *la = a, *lb = b;
    if (la->luminance != lb->luminance)
        return la->luminance > lb->luminance ? -1 : 1;
    return la->place < lb->place ? -1 : la->place > lb->place;
}

/* Copies the list's lights into the state, by falling luminance, the weakest beyond the bound left
 * out. */
static int take_lights(struct gn_lighting_state *state, const struct gn_light_list *list)
{
    struct ranked_light *ranked = gn_scratch_take(list->scratch, (size_t)list->n, sizeof(*ranked));
    int n = list->n < GN_LIGHTS_MAX ? list->n : GN_LIGHTS_MAX;
    state->lights = malloc((size_t)n * sizeof(*state->lights) + 1);
    if (!ranked || !state->lights)
        return -ENOMEM;
    for (int i = 0; i < list->n; i++)
        ranked[i] =
            (struct ranked_light){list->lights[i], gn_luminance(list->lights[i].irradiance), i};
    qsort(ranked, (size_t)list->n, sizeof(*ranked), compare_ranked);
    for (int i = 0; i < n; i++)
        state->lights[i] = ranked[i].light;
    state->n_lights = n;
    state->figures.n_dropped = list->n - n;
    return 0;
}

/* What was kept under the same settings, and under the same plan where that says what it is of. */
static const struct gn_light_memory *recall(const struct gn_lighting_state *state,
                                            const struct gn_lighting_state *previous)
{
    if (!previous || !previous->memory)
        return NULL;
    bool is_of_plan = !gn_light_maker_get(state->memory->settings.method)->is_of_world;
    if ((is_of_plan && previous->plan != state->plan) ||
        memcmp(&previous->memory->settings, &state->memory->settings,
               sizeof(state->memory->settings)) != 0)
        return NULL;
    return previous->memory;
}

/* Where the method did not say it, lights start at the surface in their direction; none starts
 * behind that surface, where it would be hidden from everywhere. */
static void place_lights(struct gn_lighting_state *state)
{
    const struct gn_map_geometry *geometry = state->map->geometry;
    for (int i = 0; i < state->n_lights && geometry; i++) {
        struct gn_light *light = &state->lights[i];
        float distance, normal[3];
        if (light->distance == INFINITY)
            continue;
        gn_map_geometry_look(geometry, light->dir_world, &distance, normal);
        if (light->distance == 0)
            memcpy(light->normal, normal, sizeof(normal));
        if (light->distance == 0 || distance < light->distance)
            light->distance = distance;
    }
}

/* Lights of the map, small suns first, the rest by the method. */
static int make_from_rest(struct gn_lighting_state *state, struct gn_light_settings *settings,
                          const struct gn_lighting_state *previous, struct gn_pool *pool,
                          struct gn_light_list *list)
{
    struct gn_radiance_map *rest = NULL;
    int rc = 0;
    if (settings->has_discs)
        rc = gn_discs_take(state->map, previous, pool, list, &rest);
    state->figures.n_discs = list->n;
    if (settings->n_aim > 0)
        settings->n_aim = settings->n_aim > list->n ? settings->n_aim - list->n : 1;
    const struct gn_light_input input = {.map = rest ? rest : state->map,
                                         .settings = settings,
                                         .plan = state->plan,
                                         .previous = previous,
                                         .remembered = recall(state, previous),
                                         .memory = state->memory,
                                         .scratch = list->scratch,
                                         .pool = pool};
    if (rc == 0)
        rc = gn_light_maker_get(settings->method)->make(&input, list, &state->figures);
    gn_radiance_map_unref(&rest);
    return rc;
}

static double to_ms(int64_t duration_ns)
{
    return (double)duration_ns / (double)GN_NS_PER_MS;
}

static int make_lights(struct gn_lighting_state *state, const struct gn_light_options *options,
                       struct gn_pool *pool, struct gn_error *out_error)
{
    struct gn_light_settings settings;
    int rc = gn_light_settings_init(&settings, options, state->map, out_error);
    if (rc < 0)
        return rc;
    int64_t start_ns = gn_clock_get_monotonic_ns();
    gn_scratch_place *place = &state->map->table->scratch;
    struct gn_scratch *scratch = gn_scratch_borrow(place);
    struct gn_light_list list = {.scratch = scratch};
    // Another stream's tables serve, but its lights and decisions are none of this one's.
    bool goes_on = options->previous && options->previous->stream == options->stream;
    gn_partition_plan_unref(&state->plan);
    gn_light_memory_unref(&state->memory);
    free(state->lights);
    state->lights = NULL;
    state->memory = calloc(1, sizeof(*state->memory));
    rc = state->memory && scratch ? 0 : -ENOMEM;
    if (rc == 0)
        rc = gn_partition_plan_create(state->map, &settings.division,
                                      options->previous ? options->previous->plan : NULL,
                                      &state->plan);
    if (rc == 0) {
        memcpy(&state->memory->settings, &settings, sizeof(settings));
        rc = make_from_rest(state, &settings, goes_on ? options->previous : NULL, pool, &list);
    }
    if (rc == 0)
        rc = take_lights(state, &list);
    if (rc == 0)
        place_lights(state);
    gn_scratch_give_back(place, &scratch);
    state->has_lights = true;
    state->ms_lights = to_ms(gn_clock_get_monotonic_ns() - start_ns);
    return rc < 0 ? gn_error_set(out_error, rc, "lights: no memory") : 0;
}

/* Irradiance of all directions, the fill's among them. */
static void get_total(const struct gn_radiance_map *map, double out_total[static 3])
{
    for (int c = 0; c < 3; c++)
        out_total[c] =
            map->figures.shown_irradiance[c] + (double)map->fill[c] * map->fill_solid_angle;
}

/* What follows the frames takes the place of what this one says. */
static int publish_lights(struct gn_lighting_state *state)
{
    const struct gn_temporal *t = state->temporal;
    struct gn_light *lights = malloc((size_t)t->n_lights * sizeof(*lights) + 1);
    if (!lights)
        return -ENOMEM;
    for (int i = 0; i < t->n_lights; i++)
        gn_temporal_get_light(t, i, &lights[i]);
    free(state->lights);
    state->lights = lights;
    state->n_lights = t->n_lights;
    memcpy(state->total_irradiance, t->total, sizeof(t->total));
    state->in_time = t->figures;
    return 0;
}

static void publish_harmonics(struct gn_lighting_state *state,
                              const struct gn_lighting_state *previous,
                              const struct gn_light_options *options)
{
    const struct gn_temporal *t = state->temporal;
    struct gn_irradiance *irradiance = &state->irradiance;
    bool is_scaled = t->factor[0] != 1 || t->factor[1] != 1 || t->factor[2] != 1;
    memcpy(state->sh, t->values, sizeof(state->sh));
    *irradiance = state->frame_irradiance;
    for (int i = 0; is_scaled && i < irradiance->n_lights; i++)
        for (int c = 0; c < 3; c++)
            irradiance->lights[i].irradiance[c] *= t->factor[c];
    if (t->values_share < 1 || is_scaled)
        gn_irradiance_follow(irradiance, t->values_share < 1 ? &previous->irradiance : NULL,
                             t->values_share, (const double(*)[3])state->sh,
                             options->irradiance.dering);
}

static int publish_smoothed(struct gn_lighting_state *state,
                            const struct gn_lighting_state *previous,
                            const struct gn_light_options *options)
{
    int rc = publish_lights(state);
    if (rc == 0 && state->has_sh)
        publish_harmonics(state, previous, options);
    return rc;
}

/* What the frame alone says; its sums of places, which only a step reads, are not in it. */
static void get_input(const struct gn_lighting_state *state, struct gn_temporal_input *out)
{
    *out = (struct gn_temporal_input){.time_ns = state->capture_time_ns,
                                      .has_lights = state->has_lights,
                                      .n_lights = state->n_lights,
                                      .lights = state->lights,
                                      .n_values = state->has_sh ? 3 * GN_SH_MAX : 0};
    _Static_assert(3 * GN_SH_MAX <= GN_TEMPORAL_VALUES_MAX, "all harmonics are followed");
    get_total(state->map, out->total);
    if (state->has_sh)
        memcpy(out->values, state->sh, sizeof(state->sh));
}

static int smooth(struct gn_lighting_state *state, const struct gn_light_options *options)
{
    const struct gn_temporal *kept = options->previous && options->previous->stream == state->stream
                                         ? options->previous->temporal
                                         : NULL;
    struct gn_temporal_input input;
    get_input(state, &input);
    gn_change_measure(state->map, input.sums);
    state->frame_irradiance = state->irradiance;
    int rc = gn_temporal_follow(kept, &input, options->smoothing, &state->temporal);
    return rc < 0 ? rc : publish_smoothed(state, options->previous, options);
}

static int make_harmonics(struct gn_lighting_state *state, const struct gn_light_options *options,
                          struct gn_pool *pool, struct gn_error *out_error)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    if (gn_irradiance_init_from_map(&state->irradiance, state->sh, state->map, &options->irradiance,
                                    pool) < 0)
        return gn_error_set(out_error, -ENOMEM, "spherical harmonics: no memory");
    state->has_sh = true;
    state->ms_sh = to_ms(gn_clock_get_monotonic_ns() - start_ns);
    return 0;
}

/* All but the map, which is there, and the frame's names. */
static int fill_from_map(struct gn_lighting_state *state, const struct gn_light_options *options,
                         struct gn_pool *pool, struct gn_error *out_error)
{
    int rc = options->no_sh ? 0 : make_harmonics(state, options, pool, out_error);
    if (rc == 0)
        rc = gn_lighting_state_add_pyramid(state, options, out_error);
    if (rc == 0 && !options->no_lights)
        rc = make_lights(state, options, pool, out_error);
    if (rc < 0)
        return rc;
    int64_t start_ns = gn_clock_get_monotonic_ns();
    get_total(state->map, state->total_irradiance);
    state->stream = options->stream;
    if (options->smoothing > 0 && smooth(state, options) < 0)
        return gn_error_set(out_error, -ENOMEM, "light in time: no memory");
    state->published_time_ns = gn_clock_get_monotonic_ns();
    state->ms_temporal = to_ms(state->published_time_ns - start_ns);
    return 0;
}

static int check_options(const struct gn_light_options *options, struct gn_error *out_error)
{
    if (!(options->smoothing >= 0 && options->smoothing <= 10))
        return gn_error_set(out_error, -EINVAL, "light options: smoothing must be 0 to 10 s");
    return 0;
}

static struct gn_lighting_state *make_empty(struct gn_error *out_error)
{
    struct gn_lighting_state *state = calloc(1, sizeof(*state));
    if (state)
        atomic_init(&state->references, 1);
    else
        (void)gn_error_set(out_error, -ENOMEM, "lighting state: no memory");
    return state;
}

int gn_lighting_state_create(const struct gn_environment_frame *frame,
                             const struct gn_radiance_map_options *map_options,
                             const struct gn_light_options *options, struct gn_pool *pool,
                             struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    static const struct gn_light_options defaults = {0};
    struct gn_radiance_map_options map_copy = {0};
    *out_state = NULL;
    if (!options)
        options = &defaults;
    if (map_options)
        map_copy = *map_options;
    if (!map_copy.previous && options->previous)
        map_copy.previous = options->previous->map;
    int rc = check_options(options, out_error);
    struct gn_lighting_state *state = rc == 0 ? make_empty(out_error) : NULL;
    if (!state)
        return rc < 0 ? rc : -ENOMEM;
    int64_t start_ns = gn_clock_get_monotonic_ns();
    state->n_asked = options->n_lights;
    state->sequence = frame->sequence;
    state->capture_time_ns = frame->capture_time_ns;
    rc = gn_radiance_map_create(frame, &map_copy, pool, &state->map, out_error);
    state->ms_map = to_ms(gn_clock_get_monotonic_ns() - start_ns);
    if (rc == 0)
        rc = fill_from_map(state, options, pool, out_error);
    if (rc < 0) {
        gn_lighting_state_unref(&state);
        return rc;
    }
    *out_state = state;
    return 0;
}

/* The filter's step is done: what is new begins beside what it keeps. */
static int complete_in_time(struct gn_lighting_state *made, const struct gn_lighting_state *state,
                            const struct gn_light_options *options)
{
    struct gn_temporal_input input;
    get_input(made, &input);
    int rc = gn_temporal_complete(state->temporal, &input, &made->temporal);
    if (rc == 0 && !state->has_lights)
        rc = publish_lights(made);
    if (rc == 0 && !state->has_sh && made->has_sh) {
        made->frame_irradiance = made->irradiance;
        publish_harmonics(made, state, options);
    }
    return rc;
}

int gn_lighting_state_complete(const struct gn_lighting_state *state,
                               const struct gn_light_options *options, struct gn_pool *pool,
                               struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    *out_state = NULL;
    struct gn_light_options with_tables = *options;
    with_tables.previous = state;
    int rc = check_options(options, out_error);
    if (rc < 0)
        return rc;
    struct gn_lighting_state *made = gn_lighting_state_copy(state);
    if (!made)
        return gn_error_set(out_error, -ENOMEM, "lighting state: no memory");
    if (!options->no_sh && !state->has_sh)
        rc = make_harmonics(made, options, pool, out_error);
    if (rc == 0)
        rc = gn_lighting_state_add_pyramid(made, options, out_error);
    if (rc == 0 && !options->no_lights && !state->has_lights)
        rc = make_lights(made, &with_tables, pool, out_error);
    if (!state->has_lights)
        made->n_asked = options->n_lights;
    if (rc == 0 && state->temporal && (rc = complete_in_time(made, state, options)) < 0)
        (void)gn_error_set(out_error, rc, "light in time: no memory");
    if (rc < 0) {
        gn_lighting_state_unref(&made);
        return rc;
    }
    made->published_time_ns = gn_clock_get_monotonic_ns();
    *out_state = made;
    return 0;
}

int gn_lighting_state_advance(const struct gn_lighting_state *state, uint64_t sequence,
                              int64_t capture_time_ns, const struct gn_light_options *options,
                              struct gn_lighting_state **out_state)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    *out_state = NULL;
    struct gn_lighting_state *copy = gn_lighting_state_copy(state);
    if (!copy)
        return -ENOMEM;
    copy->sequence = sequence;
    copy->capture_time_ns = capture_time_ns;
    int rc = 0;
    if (state->temporal && options->smoothing > 0) {
        rc = gn_temporal_follow_same(state->temporal, capture_time_ns, options->smoothing,
                                     &copy->temporal);
        if (rc == 0)
            rc = publish_smoothed(copy, state, options);
    }
    if (rc < 0) {
        gn_lighting_state_unref(&copy);
        return rc;
    }
    copy->published_time_ns = gn_clock_get_monotonic_ns();
    copy->ms_temporal = to_ms(copy->published_time_ns - start_ns);
    *out_state = copy;
    return 0;
}
