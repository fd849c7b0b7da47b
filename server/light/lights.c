/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/lights.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/grid.h"
#include "common/clock.h"
#include "server/light/luminance.h"
#include "server/light/method.h"
#include "server/light/map_geometry.h"

static const double pi = 3.14159265358979323846;

void gn_patch_add_texel(struct gn_patch *patch, const struct gn_radiance_map *map, uint32_t texel)
{
    const float *l = map->radiance.data + 3 * (size_t)texel;
    const float *d = map->direction_world + 3 * (size_t)texel;
    double w = (double)map->solid_angle[texel], energy = gn_luminance(l) * w;
    for (int c = 0; c < 3; c++) {
        patch->irradiance[c] += (double)l[c] * w;
        patch->toward[c] += energy * (double)d[c];
    }
    patch->energy += energy;
    patch->own_spread += energy * w / (4 * pi);
    patch->solid_angle += w;
    patch->n_lit += energy > 0;
    if (!map->geometry)
        return;
    const float *normal = map->geometry->normal + 3 * (size_t)texel;
    patch->is_placed = true;
    patch->nearness += energy * (double)map->geometry->nearness[texel];
    for (int c = 0; c < 3; c++)
        patch->normal[c] += energy * (double)normal[c];
}

void gn_patch_add(struct gn_patch *patch, const struct gn_patch *other)
{
    for (int c = 0; c < 3; c++) {
        patch->irradiance[c] += other->irradiance[c];
        patch->toward[c] += other->toward[c];
        patch->normal[c] += other->normal[c];
    }
    patch->energy += other->energy;
    patch->own_spread += other->own_spread;
    patch->solid_angle += other->solid_angle;
    patch->n_lit += other->n_lit;
    patch->is_placed = patch->is_placed || other->is_placed;
    patch->nearness += other->nearness;
}

bool gn_patch_get_light(const struct gn_patch *patch, struct gn_light *out_light)
{
    if (!(patch->energy > 0))
        return false;
    double v[3], length = 0;
    for (int c = 0; c < 3; c++) {
        v[c] = patch->toward[c] / patch->energy;
        length += v[c] * v[c];
    }
    length = sqrt(length);
    double spread = fmax(1 - length, 0) + patch->own_spread / patch->energy;
    *out_light = (struct gn_light){.dir_world = {0, 0, 1},
                                   .angular_radius = (float)acos(fmax(1 - 2 * spread, -1))};
    for (int c = 0; c < 3; c++) {
        if (length > 1e-9) // else light from all sides: any direction is as good
            out_light->dir_world[c] = (float)(v[c] / length);
        out_light->irradiance[c] = (float)patch->irradiance[c];
    }
    if (!patch->is_placed)
        return true;
    double n = sqrt(patch->normal[0] * patch->normal[0] + patch->normal[1] * patch->normal[1] +
                    patch->normal[2] * patch->normal[2]);
    out_light->distance =
        patch->nearness > 0 ? (float)(length * patch->energy / patch->nearness) : INFINITY;
    for (int c = 0; c < 3 && n > 1e-9 * patch->energy; c++)
        out_light->normal[c] = (float)(patch->normal[c] / n);
    return true;
}

int gn_light_list_add(struct gn_light_list *list, const struct gn_light *light)
{
    if (list->n == list->capacity) {
        int capacity = list->capacity ? 2 * list->capacity : 128;
        struct gn_light *lights = gn_scratch_grow(list->scratch, list->lights, (size_t)list->n,
                                                  (size_t)capacity, sizeof(*lights));
        if (!lights)
            return -ENOMEM;
        list->lights = lights;
        list->capacity = capacity;
    }
    list->lights[list->n++] = *light;
    return 0;
}

int gn_light_list_add_fill(struct gn_light_list *list, const struct gn_radiance_map *map,
                           const struct gn_partition_plan *plan, int *out_n)
{
    double luminance = gn_luminance(map->fill);
    *out_n = 0;
    for (int i = 0; i < plan->n_fill_cells; i++) {
        const struct gn_fill_cell *cell = &plan->fill_cell[i];
        struct gn_patch patch = {.energy = cell->solid_angle}; // of luminance 1: the same direction
        for (int c = 0; c < 3; c++) {                          // to the bit whatever the light
            patch.irradiance[c] = (double)map->fill[c] * cell->solid_angle;
            patch.toward[c] = cell->toward[c];
        }
        struct gn_light light;
        if (!(luminance > 0) || !gn_patch_get_light(&patch, &light))
            continue;
        light.id = GN_LIGHT_ID_FILL | (uint64_t)i;
        int rc = gn_light_list_add(list, &light);
        if (rc < 0)
            return rc;
        ++*out_n;
    }
    return 0;
}

bool gn_light_is_count_kept(double count_ratio)
{
    return count_ratio >= 0.75 && count_ratio <= 1.25;
}

double gn_light_get_share(const struct gn_light_input *input)
{
    static const double time_constant_s = 1;
    double ms =
        gn_clock_get_ms_between(input->previous->map->capture_time_ns, input->map->capture_time_ns);
    return ms > 0 ? -expm1(-1e-3 * ms / time_constant_s) : 0;
}

double gn_light_follow(const struct gn_light_input *input, double kept, double fresh,
                       double count_ratio)
{
    if (!(fresh < 4 * kept && kept < 4 * fresh))
        return fresh;
    if (gn_light_is_count_kept(count_ratio))
        return kept;
    return kept * pow(fresh / kept, gn_light_get_share(input));
}

struct gn_light_memory *gn_light_memory_ref(struct gn_light_memory *memory)
{
    atomic_fetch_add_explicit(&memory->more_references, 1, memory_order_relaxed);
    return memory;
}

void gn_light_memory_unref(struct gn_light_memory **memory)
{
    struct gn_light_memory *m = *memory;
    *memory = NULL;
    if (!m || atomic_fetch_sub_explicit(&m->more_references, 1, memory_order_acq_rel) > 0)
        return;
    gn_grid_plan_unref(&m->grid);
    free(m->marks);
    free(m);
}

static bool is_in(int value, int low, int high)
{
    return value == 0 || (value >= low && value <= high);
}

static const char *check_options(const struct gn_light_options *o)
{
    if ((unsigned)o->method >= GN_LIGHT_METHOD_COUNT)
        return "the method is unknown";
    if ((unsigned)o->metric > GN_METRIC_LOG2)
        return "the metric is unknown";
    if ((unsigned)o->weights >= GN_WEIGHTS_COUNT)
        return "the weights are unknown";
    if (o->n_lights != GN_LIGHTS_NO_AIM && !is_in(o->n_lights, 1, GN_LIGHTS_MAX))
        return "the number of lights must lie in [1, 4096]";
    if (!is_in(o->rings, 1, 64) || !is_in(o->sectors, 1, 256))
        return "the base division must have [1, 64] rings and [1, 256] sectors";
    if (!is_in(o->max_ls, 1, 4096))
        return "maxLS must lie in [1, 4096]";
    if (!is_in(o->n_samples, 1, 1 << 20))
        return "the number of samples must lie in [1, 1048576]";
    if ((o->literal | o->mended) & ~(unsigned)GN_READ_ALL)
        return "a reading is unknown";
    return NULL;
}

/* So many rings that about half of the wanted lights, but no fewer than three, are whole regions
 * of the part shown: then it is the light that says where the others go. */
static int choose_rings(const struct gn_radiance_map *map, int n_lights)
{
    double hemispheres = fmax(map->figures.shown_solid_angle / (2 * pi), 1);
    return (int)fmin(fmax(lround(sqrt(n_lights / hemispheres / 4)), 1), 18);
}

int gn_light_settings_init(struct gn_light_settings *settings,
                           const struct gn_light_options *options,
                           const struct gn_radiance_map *map, struct gn_error *out_error)
{
    const struct gn_light_options *o = options;
    const char *reason = check_options(o);
    bool is_seed = o->method == GN_LIGHT_PARTITION_SEED;
    bool has_aim = o->n_lights != GN_LIGHTS_NO_AIM && !is_seed;
    struct gn_light_settings s;
    memset(&s, 0, sizeof(s)); // with its padding
    s.method = o->method;
    s.metric = o->metric;
    s.weights = o->weights;
    s.relaxed = o->relaxed;
    s.literal = ((is_seed ? GN_READ_SEED : 0) | o->literal) & ~o->mended;
    s.has_discs = !is_seed && !o->no_discs;
    if (s.metric == GN_METRIC_DEFAULT)
        s.metric = is_seed ? GN_METRIC_POW2 : GN_METRIC_LOG2;
    s.n_aim = o->n_lights > 0 ? o->n_lights : 64;

    int rings = is_seed ? 8 : choose_rings(map, s.n_aim);
    s.division.rings = o->rings > 0 ? o->rings : rings;
    s.division.sectors = o->sectors > 0 ? o->sectors : 3 * s.division.rings;
    s.division.dark_rings = (s.division.rings + 1) / 2;
    s.division.dark_sectors = (s.division.sectors + 1) / 2;
    s.division.is_equal_angle = (s.literal & GN_READ_RADIUS_RINGS) != 0;
    if (!reason && s.division.rings * s.division.sectors > 1024)
        reason = "the base division must not have more than 1024 regions (rings times sectors)";
    if (reason)
        return gn_error_set(out_error, -EINVAL, "light options: %s", reason);

    s.max_ls = o->max_ls > 0 ? o->max_ls : has_aim && s.n_aim > 64 ? (s.n_aim + 7) / 8 : 8;
    s.n_samples = o->n_samples > 0 ? o->n_samples : 16 * s.division.rings * s.division.sectors;
    if (!has_aim || (s.method == GN_LIGHT_PARTITION_ENERGY && s.metric != GN_METRIC_LOG2))
        s.n_aim = o->method == GN_LIGHT_PARTITION_ENERGY || is_seed ? 0 : 64;
    memcpy(settings, &s, sizeof(s)); // with its padding
    return 0;
}
