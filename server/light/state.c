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
#include "server/light/method.h"
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

/* Moves the list's lights into the state, by falling luminance, the weakest beyond the bound left
 * out. */
static int take_lights(struct gn_lighting_state *state, const struct gn_light_list *list)
{
    struct ranked_light *ranked = malloc((size_t)list->n * sizeof(*ranked) + 1);
    int n = list->n < GN_LIGHTS_MAX ? list->n : GN_LIGHTS_MAX;
    state->lights = malloc((size_t)n * sizeof(*state->lights) + 1);
    if (!ranked || !state->lights) {
        free(ranked);
        return -ENOMEM;
    }
    for (int i = 0; i < list->n; i++)
        ranked[i] =
            (struct ranked_light){list->lights[i], gn_luminance(list->lights[i].irradiance), i};
    qsort(ranked, (size_t)list->n, sizeof(*ranked), compare_ranked);
    for (int i = 0; i < n; i++)
        state->lights[i] = ranked[i].light;
    state->n_lights = n;
    state->figures.n_dropped = list->n - n;
    free(ranked);
    return 0;
}

/* What was kept under the same settings and plan. */
static const struct gn_light_memory *recall(const struct gn_lighting_state *state,
                                            const struct gn_lighting_state *previous)
{
    if (!previous || !previous->memory || previous->plan != state->plan ||
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
                                         .pool = pool};
    if (rc == 0)
        rc = gn_light_maker_get(settings->method)->make(&input, list, &state->figures);
    gn_radiance_map_unref(&rest);
    return rc;
}

static int make_lights(struct gn_lighting_state *state, const struct gn_light_options *options,
                       struct gn_pool *pool, struct gn_error *out_error)
{
    struct gn_light_settings settings;
    int rc = gn_light_settings_init(&settings, options, state->map, out_error);
    if (rc < 0)
        return rc;
    struct gn_light_list list = {0};
    state->memory = calloc(1, sizeof(*state->memory));
    rc = state->memory ? 0 : -ENOMEM;
    if (rc == 0)
        rc = gn_partition_plan_create(state->map, &settings.division,
                                      options->previous ? options->previous->plan : NULL,
                                      &state->plan);
    if (rc == 0) {
        memcpy(&state->memory->settings, &settings, sizeof(settings));
        rc = make_from_rest(state, &settings, options->previous, pool, &list);
    }
    if (rc == 0)
        rc = take_lights(state, &list);
    if (rc == 0)
        place_lights(state);
    gn_light_list_finish(&list);
    return rc < 0 ? gn_error_set(out_error, rc, "lights: no memory") : 0;
}

static double to_ms(int64_t duration_ns)
{
    return (double)duration_ns / (double)GN_NS_PER_MS;
}

/* What follows the frames takes the place of what this one says. */
static int publish_smoothed(struct gn_lighting_state *state,
                            const struct gn_lighting_state *previous,
                            const struct gn_light_options *options)
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
    if (!state->has_sh)
        return 0;
    memcpy(state->sh, t->values, sizeof(state->sh));
    state->irradiance = state->frame_irradiance;
    if (t->values_share < 1)
        gn_irradiance_follow(&state->irradiance, &previous->irradiance, t->values_share,
                             (const double(*)[3])state->sh, options->irradiance.dering);
    return 0;
}

static int smooth(struct gn_lighting_state *state, const struct gn_light_options *options)
{
    const struct gn_temporal *kept = options->previous && options->previous->stream == state->stream
                                         ? options->previous->temporal
                                         : NULL;
    struct gn_temporal_input input = {.time_ns = state->capture_time_ns,
                                      .has_lights = state->has_lights,
                                      .n_lights = state->n_lights,
                                      .lights = state->lights,
                                      .n_values = state->has_sh ? 3 * GN_SH_MAX : 0};
    _Static_assert(3 * GN_SH_MAX <= GN_TEMPORAL_VALUES_MAX, "all harmonics are followed");
    memcpy(input.total, state->total_irradiance, sizeof(input.total));
    if (state->has_sh)
        memcpy(input.values, state->sh, sizeof(state->sh));
    state->frame_irradiance = state->irradiance;
    int rc = gn_temporal_follow(kept, &input, options->smoothing, &state->temporal);
    return rc < 0 ? rc : publish_smoothed(state, options->previous, options);
}

/* All but the map, which is there, and the frame's names. */
static int fill_from_map(struct gn_lighting_state *state, const struct gn_light_options *options,
                         struct gn_pool *pool, struct gn_error *out_error)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    int rc = 0;
    state->has_sh = !options->no_sh;
    if (state->has_sh && gn_irradiance_init_from_map(&state->irradiance, state->sh, state->map,
                                                     &options->irradiance, pool) < 0)
        return gn_error_set(out_error, -ENOMEM, "spherical harmonics: no memory");
    int64_t sh_ns = gn_clock_get_monotonic_ns();
    state->has_lights = !options->no_lights;
    if (state->has_lights)
        rc = make_lights(state, options, pool, out_error);
    if (rc < 0)
        return rc;
    int64_t lights_ns = gn_clock_get_monotonic_ns();
    for (int c = 0; c < 3; c++)
        state->total_irradiance[c] = state->map->figures.shown_irradiance[c] +
                                     (double)state->map->fill[c] * state->map->fill_solid_angle;
    state->stream = options->stream;
    if (options->smoothing > 0 && smooth(state, options) < 0)
        return gn_error_set(out_error, -ENOMEM, "light in time: no memory");
    state->published_time_ns = gn_clock_get_monotonic_ns();
    state->ms_sh = to_ms(sh_ns - start_ns);
    state->ms_lights = to_ms(lights_ns - sh_ns);
    state->ms_temporal = to_ms(state->published_time_ns - lights_ns);
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

int gn_lighting_state_complete(const struct gn_lighting_state *state,
                               const struct gn_light_options *options, struct gn_pool *pool,
                               struct gn_lighting_state **out_state, struct gn_error *out_error)
{
    *out_state = NULL;
    struct gn_light_options with_tables = *options;
    with_tables.previous = state;
    with_tables.stream = state->stream;
    int rc = check_options(options, out_error);
    struct gn_lighting_state *made = rc == 0 ? make_empty(out_error) : NULL;
    if (!made)
        return rc < 0 ? rc : -ENOMEM;
    made->sequence = state->sequence;
    made->capture_time_ns = state->capture_time_ns;
    made->ms_map = state->ms_map;
    made->map = gn_radiance_map_ref(state->map);
    rc = fill_from_map(made, &with_tables, pool, out_error);
    if (rc < 0) {
        gn_lighting_state_unref(&made);
        return rc;
    }
    *out_state = made;
    return 0;
}

/* A state with the same light; what others share is shared. */
static struct gn_lighting_state *copy_light(const struct gn_lighting_state *state)
{
    struct gn_lighting_state *copy = make_empty(NULL);
    if (!copy)
        return NULL;
    copy->map = gn_radiance_map_ref(state->map);
    copy->plan = state->plan ? gn_partition_plan_ref(state->plan) : NULL;
    copy->memory = state->memory ? gn_light_memory_ref(state->memory) : NULL;
    copy->has_sh = state->has_sh;
    memcpy(copy->sh, state->sh, sizeof(copy->sh));
    copy->irradiance = state->irradiance;
    copy->frame_irradiance = state->frame_irradiance;
    copy->has_lights = state->has_lights;
    memcpy(copy->total_irradiance, state->total_irradiance, sizeof(copy->total_irradiance));
    copy->figures = state->figures;
    copy->lights = malloc((size_t)state->n_lights * sizeof(*copy->lights) + 1);
    if (!copy->lights) {
        gn_lighting_state_unref(&copy);
        return NULL;
    }
    if (state->n_lights > 0)
        memcpy(copy->lights, state->lights, (size_t)state->n_lights * sizeof(*copy->lights));
    copy->n_lights = state->n_lights;
    return copy;
}

int gn_lighting_state_advance(const struct gn_lighting_state *state, uint64_t sequence,
                              int64_t capture_time_ns, const struct gn_light_options *options,
                              struct gn_lighting_state **out_state)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    *out_state = NULL;
    struct gn_lighting_state *copy = copy_light(state);
    if (!copy)
        return -ENOMEM;
    copy->stream = state->stream;
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
    gn_radiance_map_unref(&s->map);
    gn_emission_unref(&s->emission);
    free(s->near);
    free(s->lights);
    free(s);
}
