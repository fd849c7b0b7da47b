/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/estimate.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/light/luminance.h"
#include "server/light/map_rows.h"

/** Pixels of one piece of work, and the most pieces. */
enum { CHUNK = 64, MAX_CHUNKS = 2 * ESTIMATE_PIXELS / CHUNK };
/** A factor from here on is no shadow. */
#define AFFECTED 0.995

struct sums {
    struct gn_error_sums error;
    uint64_t rays;
};

struct job {
    const struct frame *frame;
    const struct estimate *estimate;
    int step, columns, n_cells; // a pixel from each square of step x step
    int part, n_parts;          // of the cells; each has sets of its own
    int n_sets;                 // that pixels take theirs from
    bool has_blockers;
    struct sums sums[MAX_CHUNKS];
};

/** One receiver's view of a set. */
struct view {
    const struct estimate_set *set;
    float weight[ESTIMATE_SET];    // by which the light counts; 0: none, or hidden by real objects
    uint8_t is_near[ESTIMATE_SET]; // in the cone of the virtual objects
    uint8_t is_cut[ESTIMATE_SET];
    int n_cut;
};

/** Mixes all bits. Source: Steele et al., "Fast splittable pseudorandom number generators", 2014,
 * with the constants of Stafford's variant 13. */
static uint64_t mix(uint64_t x)
{
    x += UINT64_C(0x9e3779b97f4a7c15);
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

/** Point i of Sobol's first two dimensions. Source: Kollig and Keller, "Efficient multidimensional
 * sampling", 2002. `shift` turns it into a random one, and leaves 256 of them a net. */
static void get_point(uint32_t i, uint64_t shift, double out[static 2])
{
    uint32_t x = (uint32_t)shift, y = (uint32_t)(shift >> 32);
    for (uint32_t k = i, u = 1u << 31, v = 1u << 31; k != 0; k >>= 1, u >>= 1, v ^= v >> 1) {
        x ^= k & 1 ? u : 0;
        y ^= k & 1 ? v : 0;
    }
    out[0] = (x + 0.5) * 0x1p-32;
    out[1] = (y + 0.5) * 0x1p-32;
}

/** Its index along the curve of Morton 1966 through squares of 1/16 x 1/16, each of which has one
 * point of a net: so packets hold neighbours. */
static int get_place(const double at[static 2])
{
    int x = (int)(at[0] * 16), y = (int)(at[1] * 16), place = 0;
    for (int bit = 0; bit < 4; bit++)
        place |= (x >> bit & 1) << 2 * bit | (y >> bit & 1) << (2 * bit + 1);
    return place;
}

/* Making the sets */

static double get_patches_sum(const struct gn_radiance_map *map, int y)
{
    double sum = 0;
    for (int k = 0; k < GN_MAP_PATCHES; k++)
        sum += map->rows[y].luminance[k];
    return sum;
}

static double get_texel_power(const struct gn_radiance_map *map, size_t i)
{
    return gn_luminance(map->radiance.data + 3 * i) * (double)map->solid_angle[i];
}

/** Luminance that comes from where the map shows nothing, and of the whole sphere as bright. */
static double get_fill_power(const struct gn_radiance_map *map, double *out_sphere)
{
    double y = map->is_full_sphere ? 0 : gn_luminance(map->fill);
    *out_sphere = map->fill_solid_angle > 0 ? 4 * M_PI * y : 0;
    return *out_sphere > 0 ? map->fill_solid_angle * y : 0;
}

static void set_direction(struct estimate_set *set, int i, const double dir[static 3],
                          const float radiance[static 3], double solid_angle)
{
    for (int k = 0; k < 3; k++) {
        set->dir[k][i] = (float)dir[k];
        set->irradiance[k][i] = (float)((double)radiance[k] * solid_angle);
    }
}

/** A direction that the map does not show: one of the sphere; dark where the map shows it. */
static void draw_fill(const struct gn_radiance_map *map, const double at[static 2],
                      double probability, struct estimate_set *set, int i)
{
    static const float dark[3] = {0};
    double z = 1 - 2 * at[0], r = sqrt(fmax(0, 1 - z * z)), phi = 2 * M_PI * at[1], xy[2];
    double dir[3] = {r * cos(phi), r * sin(phi), z};
    bool is_shown = gn_projection_get_position(&map->projection, dir, xy);
    gn_pose_rotate(&map->world_from_probe, dir, dir);
    set_direction(set, i, dir, is_shown ? dark : map->fill,
                  4 * M_PI / (ESTIMATE_SET * probability));
}

/** A direction of the map by the point: a row, a patch of it, a texel of that, a place in it. Any
 * wrong sum of a row or patch changes the density, which is divided by, and not the mean. */
static void draw_texel(const struct gn_radiance_map *map, const double *rows, double at_row,
                       double at_column, double probability, struct estimate_set *set, int i)
{
    static const double up[3] = {0, 0, 1};
    static const float dark[3] = {0};
    int low = 0, high = map->radiance.height, width = map->radiance.width;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        *(rows[middle] <= at_row ? &low : &high) = middle;
    }
    double row = rows[low + 1] - rows[low], left = at_column * row;
    const double *patches = map->rows[low].luminance;
    int patch = 0, side = map->table->patch_side;
    while (patch < GN_MAP_PATCHES - 1 && left >= patches[patch])
        left -= patches[patch++];
    while (patch > 0 && !(patches[patch] > 0)) // rounded past the last
        patch--;
    int x = patch * side, end = x + side < width ? x + side : width;
    double sum = 0, power = 0;
    size_t first = (size_t)low * (size_t)width;
    for (int k = x; k < end; k++)
        sum += get_texel_power(map, first + (size_t)k);
    if (!(row > 0) || !(sum > 0) || x >= end) {
        set_direction(set, i, up, dark, 0);
        return;
    }
    left = fmin(fmax(left / patches[patch], 0), 1) * sum;
    while (x < end - 1 && left >= (power = get_texel_power(map, first + (size_t)x))) {
        left -= power;
        x++;
    }
    size_t texel = first + (size_t)x;
    power = get_texel_power(map, texel);
    if (!(power > 0)) {
        set_direction(set, i, up, dark, 0);
        return;
    }
    double along = fmin(fmax(left / power, 0), 1), dir[3];
    if (gn_projection_get_direction(&map->projection, x + along,
                                    low + fmin((at_row - rows[low]) / row, 1), dir))
        gn_pose_rotate(&map->world_from_probe, dir, dir);
    else
        for (size_t k = 0; k < 3; k++)
            dir[k] = map->direction_world[3 * texel + k];
    double share = patches[patch] / rows[map->radiance.height] * power / sum;
    set_direction(set, i, dir, map->radiance.data + 3 * texel,
                  (double)map->solid_angle[texel] / (ESTIMATE_SET * probability * share));
}

static int reserve_rows(struct estimate *estimate, int n)
{
    if (n <= estimate->capacity)
        return 0;
    free(estimate->rows);
    estimate->capacity = 0;
    estimate->rows = malloc(((size_t)n + 1) * sizeof(*estimate->rows));
    estimate->capacity = estimate->rows ? n : 0;
    return estimate->rows ? 0 : -ENOMEM;
}

/** True where the probe's map can be drawn from. */
static bool is_drawable(const struct gn_radiance_map *map)
{
    // Light of the global model starts at finite places, which these directions have not.
    return map && map->rows && !map->geometry;
}

/** Fills the probe's sets. *out_power: the map's luminance. */
static void draw_sets(struct estimate *estimate, const struct job *job, int probe,
                      const struct gn_radiance_map *map, double *out_power)
{
    double sphere, fill = get_fill_power(map, &sphere), *rows = estimate->rows;
    rows[0] = 0;
    for (int y = 0; y < map->radiance.height; y++)
        rows[y + 1] = rows[y] + get_patches_sum(map, y);
    double shown = rows[map->radiance.height];
    *out_power = shown + fill;
    if (!(*out_power > 0))
        return;
    double share = shown / (shown + sphere);
    for (int i = 0; i < job->n_sets * ESTIMATE_SET; i++) {
        int set = i / ESTIMATE_SET,
            drawn = (job->part * GN_PROBES_MAX + probe) * ESTIMATE_SETS + set;
        double at[2];
        get_point((uint32_t)(i % ESTIMATE_SET), mix((uint64_t)drawn), at);
        int place = get_place(at);
        if (at[0] < share)
            draw_texel(map, rows, at[0] / share * shown, at[1], share, &estimate->sets[probe][set],
                       place);
        else
            draw_fill(map, (const double[2]){(at[0] - share) / (1 - share), at[1]}, 1 - share,
                      &estimate->sets[probe][set], place);
    }
}

/* Asking a pixel */

/** The cone from a point about the virtual objects: unit axis and the cosine of its half angle. */
static float get_cone(const struct frame *frame, const float org[static 3], float axis[static 3])
{
    float radius2 = 0, distance2 = 0;
    for (int k = 0; k < 3; k++) {
        float half = 0.5f * (frame->virtual_box.max[k] - frame->virtual_box.min[k]);
        axis[k] = frame->virtual_box.min[k] + half - org[k];
        radius2 += half * half;
        distance2 += axis[k] * axis[k];
    }
    for (int k = 0; k < 3 && distance2 > 0; k++)
        axis[k] /= sqrtf(distance2);
    // A little wider, against rounding.
    return distance2 > 1.001f * radius2 ? sqrtf(1 - radius2 / distance2) - 1e-4f : -2;
}

static void init_view(const struct sample *s, const struct estimate_set *set, float weight,
                      const float axis[static 3], float cosine, struct view *view)
{
    const float *n = s->surface.normal_shading, *g = s->surface.normal_horizon;
    view->set = set;
    view->n_cut = 0;
    for (int i = 0; i < ESTIMATE_SET; i++) {
        float x = set->dir[0][i], y = set->dir[1][i], z = set->dir[2][i];
        float c = n[0] * x + n[1] * y + n[2] * z;
        float d = g[0] * x + g[1] * y + g[2] * z;
        float a = axis[0] * x + axis[1] * y + axis[2] * z;
        c = d > 0 ? c : 0;
        c = c > 0 ? c : 0;
        view->weight[i] = weight * c;
        view->is_near[i] = (uint8_t)((c > 0) & (a >= cosine));
        view->is_cut[i] = 0;
    }
}

static void flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                  struct view *view, uint64_t *rays)
{
    int n;
    uint32_t hidden = gn_packet_trace(frame, scratch, set, &n, rays);
    for (; hidden != 0; hidden &= hidden - 1) {
        int i = scratch->lane_light[__builtin_ctz(hidden)];
        if (set == GN_RT_REAL) {
            view->weight[i] = 0;
        } else {
            view->is_cut[i] = 1;
            view->n_cut++;
        }
    }
}

static void trace(const struct frame *frame, struct scratch *scratch, const struct sample *s,
                  enum gn_rt_set role, struct view *view, uint64_t *rays)
{
    const struct estimate_set *set = view->set;
    for (int i = 0; i < ESTIMATE_SET; i++) {
        if (role == GN_RT_REAL ? !(view->weight[i] > 0) : !view->is_near[i])
            continue;
        const float dir[3] = {set->dir[0][i], set->dir[1][i], set->dir[2][i]};
        if (gn_packet_add(scratch, s->org, dir, 0, i, 0, INFINITY))
            flush(frame, scratch, role, view, rays);
    }
    flush(frame, scratch, role, view, rays);
}

/** Adds the view's light to sums[0], and what virtual objects cut of it to sums[1]. */
static void add_view(const struct view *view, double sums[static 2][3])
{
    for (int k = 0; k < 3; k++) {
        const float *irradiance = view->set->irradiance[k];
        for (int i = 0; i < ESTIMATE_SET; i++) {
            double e = (double)(irradiance[i] * view->weight[i]);
            sums[0][k] += e;
            sums[1][k] += view->is_cut[i] ? e : 0;
        }
    }
}

/** The factor of one set of directions. is_affected: it is needed though nothing is cut. */
static void get_ratio(const struct job *job, struct scratch *scratch, const struct sample *s,
                      int set, double out[static 3], uint64_t *rays)
{
    const struct frame *frame = job->frame;
    double sums[2][3] = {{0}};
    float axis[3], cosine = get_cone(frame, s->org, axis);
    struct view views[GN_PROBES_MAX];
    int n_cut = 0;
    for (int p = 0; p < frame->blend.n; p++) {
        init_view(s, &job->estimate->sets[p][set], frame->blend.n > 1 ? s->weights[p] : 1, axis,
                  cosine, &views[p]);
        trace(frame, scratch, s, GN_RT_VIRTUAL, &views[p], rays);
        n_cut += views[p].n_cut;
    }
    for (int p = 0; p < frame->blend.n && n_cut > 0; p++) {
        if (job->has_blockers)
            trace(frame, scratch, s, GN_RT_REAL, &views[p], rays);
        add_view(&views[p], sums);
    }
    for (int k = 0; k < 3; k++)
        out[k] = sums[0][k] > frame->floor_irradiance[k] ? 1 - sums[1][k] / sums[0][k] : 1;
}

static void ask_pixel(const struct job *job, struct scratch *scratch, const struct sample *s,
                      const float factor[static 3], uint64_t random, struct sums *sums)
{
    double ratios[2][3], square = 0;
    uint64_t n_sets = (uint64_t)job->n_sets;
    int first = (int)(random % n_sets);
    int other = (int)(((uint64_t)first + 1 + (random >> 32) % (n_sets - 1)) % n_sets);
    bool is_affected = false;
    get_ratio(job, scratch, s, first, ratios[0], &sums->rays);
    get_ratio(job, scratch, s, other, ratios[1], &sums->rays);
    for (int k = 0; k < 3; k++) {
        double f = (double)factor[k];
        is_affected |= f < AFFECTED || 0.5 * (ratios[0][k] + ratios[1][k]) < AFFECTED;
        square += (f - ratios[0][k]) * (f - ratios[1][k]) / 3;
    }
    if (!is_affected)
        return;
    sums->error.n++;
    sums->error.square += square;
    sums->error.square2 += square * square;
}

static void ask_chunk(void *context, int item, int worker)
{
    struct job *job = context;
    const struct frame *frame = job->frame;
    struct scratch *scratch = &frame->scratches[worker];
    struct tile_figures figures = {0};
    struct sums sums = {0};
    int pixels[CHUNK][2];
    int n = 0, width = frame->camera->width, height = frame->camera->height;
    for (int cell = item * CHUNK; cell < (item + 1) * CHUNK && cell < job->n_cells; cell++) {
        uint64_t random = mix((uint64_t)cell);
        int x = cell % job->columns * job->step + (int)(random % (uint64_t)job->step);
        int y = cell / job->columns * job->step + (int)((random >> 32) % (uint64_t)job->step);
        if (x >= width || y >= height || (int)(mix(random) % (uint64_t)job->n_parts) != job->part)
            continue;
        pixels[n][0] = x;
        pixels[n][1] = y;
        gn_primary_aim(frame, frame->rays + 3 * ((size_t)y * (size_t)width + (size_t)x),
                       &scratch->samples[n]);
        n++;
    }
    gn_primary_trace(frame, scratch->samples, n, &figures);
    gn_render_weigh_probes(frame, scratch->samples, n);
    sums.rays = figures.rays_primary;
    for (int i = 0; i < n; i++) {
        const int *at = pixels[i];
        uint64_t pixel = (uint64_t)at[1] * (uint64_t)width + (uint64_t)at[0];
        if (scratch->samples[i].is_receiver)
            ask_pixel(job, scratch, &scratch->samples[i],
                      gn_refine_get_feature(frame, at[0], at[1])->color, mix(~pixel), &sums);
    }
    job->sums[item] = sums;
}

/** Squares so wide that the picture has about ESTIMATE_PIXELS, and surely no more than there are
 * chunks for. */
static void cut_picture(struct job *job)
{
    int width = job->frame->camera->width, height = job->frame->camera->height;
    job->step = (int)fmax(1, floor(sqrt((double)width * height / ESTIMATE_PIXELS)));
    do {
        job->columns = (width + job->step - 1) / job->step;
        job->n_cells = job->columns * ((height + job->step - 1) / job->step);
    } while (job->n_cells > MAX_CHUNKS * CHUNK && job->step++);
}

double gn_error_sums_get(const struct gn_error_sums *sums, int n_sums)
{
    struct gn_error_sums all = {0};
    for (int i = 0; i < n_sums; i++) {
        all.square += sums[i].square;
        all.square2 += sums[i].square2;
        all.n += sums[i].n;
    }
    if (all.n < ESTIMATE_LEAST)
        return -1;
    double mean = all.square / all.n;
    double variance = fmax(all.square2 / all.n - mean * mean, 0) / (all.n - 1);
    return sqrt(fmax(mean, sqrt(variance)));
}

static void sum_up(const struct job *job, int n_chunks, struct gn_render_report *report)
{
    for (int i = 0; i < n_chunks; i++) {
        report->error.square += job->sums[i].error.square;
        report->error.square2 += job->sums[i].error.square2;
        report->error.n += job->sums[i].error.n;
        report->rays_estimate += job->sums[i].rays;
    }
    report->estimated_error = gn_error_sums_get(&report->error, 1);
}

int gn_estimate_make(struct estimate *estimate, const struct frame *frame, struct gn_pool *pool,
                     struct gn_render_report *report)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    double power = 0;
    struct job job = {.frame = frame, .estimate = estimate, .n_parts = 1, .n_sets = ESTIMATE_SETS};
    if (frame->options.estimate_parts > 1) {
        job.n_parts = frame->options.estimate_parts;
        job.part = frame->options.estimate_part;
        job.n_sets = 2;
    }
    report->estimated_error = -1;
    // Without a map of the light there is no truth to ask; near light is not in it.
    if (frame->options.quality == GN_QUALITY_REFERENCE || !frame->options.estimate_error ||
        !frame->run_shadow || frame->near.n > 0)
        return 0;
    for (int p = 0; p < frame->blend.n; p++) {
        double one;
        const struct gn_radiance_map *map = frame->blend.state[p]->map;
        if (!is_drawable(map))
            return 0;
        if (reserve_rows(estimate, map->radiance.height) < 0)
            return -ENOMEM;
        memset(estimate->sets[p], 0, sizeof(estimate->sets[p]));
        draw_sets(estimate, &job, p, map, &one);
        power += one;
    }
    if (!(power > 0))
        return 0;
    // Flat real geometry hides no light from itself.
    job.has_blockers = frame->run_blockers || frame->options.shadow_ignore_real;
    cut_picture(&job);
    int n_chunks = (job.n_cells + CHUNK - 1) / CHUNK;
    gn_pool_run(pool, n_chunks, ask_chunk, &job);
    sum_up(&job, n_chunks, report);
    report->ms_estimate = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
    return 0;
}

void gn_estimate_finish(struct estimate *estimate)
{
    free(estimate->rows);
    memset(estimate, 0, sizeof(*estimate));
}
