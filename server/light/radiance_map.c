/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/radiance_map.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_geometry.h"
#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;

/* What one row of texels adds to the figures: summed row by row, so that threads change no bit. */
struct row_sums {
    int n_nan, n_inf, n_negative, n_capped, n_clipped;
    double luminance; // sum of Y dOmega
    double max_luminance;
    double irradiance[3]; // sum of L dOmega
    double upward[3];     // sum of L max(0, d . axis) dOmega
};

/* One frame on its way to a map. */
struct work {
    const struct gn_environment_frame *frame;
    struct gn_radiance_map *map;
    struct gn_response linear; // the response after decoding: matrix and scale
    bool is_radiance;          // after decoding: neither matrix nor scale
    float *decoded;            // [code_max + 1], may be NULL: decode texel by texel
    struct row_sums *rows;     // [height]
};

/* One channel of a code, mended: what cannot be light is dark. */
static float mend_code(float code, bool *is_nan, bool *is_inf, bool *is_negative)
{
    *is_nan = *is_nan || isnan(code);
    *is_inf = *is_inf || code == INFINITY;
    *is_negative = *is_negative || code < 0;
    return code > 0 && code < INFINITY ? code : 0;
}

static float look_up(const struct work *work, float code)
{
    float max = (float)work->frame->code_max;
    return work->decoded[(int)lrintf(fminf(code, 1) * max)];
}

static void decode_row(void *context, int y, int worker)
{
    (void)worker;
    struct work *work = context;
    const struct gn_image *codes = work->frame->codes;
    struct gn_radiance_map *map = work->map;
    struct row_sums *sums = &work->rows[y];
    bool is_mono = codes->channels<3, is_integer = work->frame->code_max> 0;
    float *row = gn_image_at(&map->radiance, 0, y);
    for (int x = 0; x < codes->width; x++) {
        const float *code = gn_image_at(codes, x, y);
        bool is_nan = false, is_inf = false, is_negative = false, is_clipped = false;
        for (int c = 0; c < 3; c++) {
            float v = code[is_mono ? 0 : c];
            if (!(v >= 0 && v < INFINITY))
                v = mend_code(v, &is_nan, &is_inf, &is_negative);
            is_clipped = is_clipped || (is_integer && v >= 1);
            row[3 * x + c] = work->decoded ? look_up(work, v) : v;
        }
        sums->n_nan += is_nan;
        sums->n_inf += is_inf;
        sums->n_negative += is_negative;
        sums->n_clipped += is_clipped;
    }
    if (!work->is_radiance)
        gn_response_to_radiance(&work->linear, row, codes->width);
    const float *solid_angle = map->solid_angle + (size_t)y * (size_t)codes->width;
    for (int x = 0; x < codes->width; x++) {
        bool is_capped = false;
        for (int c = 0; c < 3; c++) {
            float v = row[3 * x + c];
            is_capped = is_capped || v > GN_RADIANCE_MAX;
            v = v < GN_RADIANCE_MAX ? v : GN_RADIANCE_MAX;
            row[3 * x + c] = solid_angle[x] > 0 ? v : 0;
        }
        sums->n_capped += is_capped;
    }
}

static bool is_infinite_texel(const struct gn_image *codes, int x, int y)
{
    const float *code = gn_image_at(codes, x, y);
    for (int c = 0; c < codes->channels && c < 3; c++)
        if (code[c] == INFINITY)
            return true;
    return false;
}

static float get_median(float *v, int n)
{
    for (int i = 1; i < n; i++) {
        float key = v[i];
        int j = i;
        for (; j > 0 && v[j - 1] > key; j--)
            v[j] = v[j - 1];
        v[j] = key;
    }
    return n == 0 ? 0 : n % 2 ? v[n / 2] : 0.5f * (v[n / 2 - 1] + v[n / 2]);
}

/* The median, by channel, of the finite ones of eight neighbours; 0 without any. */
static void mend_infinite_texel(const struct gn_image *codes, struct gn_radiance_map *map, int x,
                                int y)
{
    float values[3][8];
    int n = 0;
    for (int i = 0; i < 9; i++) {
        int at[2] = {x, y};
        if (i == 4 || !gn_projection_step(&map->projection, i % 3 - 1, i / 3 - 1, at) ||
            is_infinite_texel(codes, at[0], at[1]) ||
            !(map->solid_angle[(size_t)at[1] * (size_t)codes->width + (size_t)at[0]] > 0))
            continue;
        for (int c = 0; c < 3; c++)
            values[c][n] = gn_image_at(&map->radiance, at[0], at[1])[c];
        n++;
    }
    for (int c = 0; c < 3; c++)
        gn_image_at(&map->radiance, x, y)[c] = get_median(values[c], n);
}

static void mend_infinite_row(void *context, int y, int worker)
{
    (void)worker;
    struct work *work = context;
    const struct gn_image *codes = work->frame->codes;
    if (work->rows[y].n_inf == 0)
        return;
    for (int x = 0; x < codes->width; x++)
        if (is_infinite_texel(codes, x, y) &&
            work->map->solid_angle[(size_t)y * (size_t)codes->width + (size_t)x] > 0)
            mend_infinite_texel(codes, work->map, x, y);
}

static void sum_row(void *context, int y, int worker)
{
    (void)worker;
    struct work *work = context;
    const struct gn_radiance_map *map = work->map;
    const double *axis = map->table->axis_world;
    struct row_sums *sums = &work->rows[y];
    size_t width = (size_t)map->radiance.width, start = (size_t)y * width;
    double sum[3] = {0}, upward[3] = {0}, luminance = 0, max = 0;
    for (size_t i = start; i < start + width; i++) { // no light where no solid angle
        const float *l = map->radiance.data + 3 * i, *d = map->direction_world + 3 * i;
        double w = (double)map->solid_angle[i], y_texel = gn_luminance(l);
        double up = axis[0] * (double)d[0] + axis[1] * (double)d[1] + axis[2] * (double)d[2];
        up = up > 0 ? up * w : 0;
        luminance += y_texel * w;
        max = y_texel > max ? y_texel : max;
        for (int c = 0; c < 3; c++) {
            sum[c] += (double)l[c] * w;
            upward[c] += (double)l[c] * up;
        }
    }
    sums->luminance = luminance;
    sums->max_luminance = max;
    memcpy(sums->irradiance, sum, sizeof(sum));
    memcpy(sums->upward, upward, sizeof(upward));
}

static void sum_figures(const struct work *work, double out_upward[static 3])
{
    struct gn_radiance_map_figures f = {0};
    for (int c = 0; c < 3; c++)
        out_upward[c] = 0;
    for (int y = 0; y < work->map->radiance.height; y++) {
        const struct row_sums *row = &work->rows[y];
        f.n_nan += row->n_nan;
        f.n_inf += row->n_inf;
        f.n_negative += row->n_negative;
        f.n_capped += row->n_capped;
        f.n_clipped += row->n_clipped;
        f.mean_luminance += row->luminance;
        f.max_luminance = fmax(f.max_luminance, row->max_luminance);
        for (int c = 0; c < 3; c++) {
            f.shown_irradiance[c] += row->irradiance[c];
            out_upward[c] += row->upward[c];
        }
    }
    f.shown_solid_angle = work->map->table->shown_solid_angle;
    f.mean_luminance = f.shown_solid_angle > 0 ? f.mean_luminance / f.shown_solid_angle : 0;
    work->map->figures = f;
}

/* Codes of an integer format are few: each is decoded once. */
static int make_decoder(struct work *work)
{
    const struct gn_environment_frame *frame = work->frame;
    work->linear = frame->response;
    bool has_matrix = frame->response.scale != 0 && frame->response.scale != 1;
    for (int i = 0; i < 9; i++)
        has_matrix = has_matrix || frame->response.to_rec709[i] != 0;
    work->is_radiance =
        !has_matrix && (frame->response.type == GN_RESPONSE_LINEAR || frame->code_max > 0);
    if (frame->code_max == 0 || frame->response.type == GN_RESPONSE_LINEAR)
        return 0;
    size_t n = (size_t)frame->code_max + 1;
    work->decoded = malloc(n * sizeof(*work->decoded));
    if (!work->decoded)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        work->decoded[i] = gn_response_decode(&frame->response, (float)i / (float)frame->code_max);
    work->linear.type = GN_RESPONSE_LINEAR;
    return 0;
}

static int fill_map(struct work *work, const struct gn_radiance_map_options *options,
                    struct gn_pool *pool)
{
    struct gn_radiance_map *map = work->map;
    int height = map->radiance.height;
    work->rows = calloc((size_t)height, sizeof(*work->rows));
    if (!work->rows || make_decoder(work) < 0)
        return -ENOMEM;
    gn_pool_run(pool, height, decode_row, work);
    gn_pool_run(pool, height, mend_infinite_row, work);
    const uint32_t *rim = map->table->rim;
    for (int i = 0; i < map->table->n_rim; i++)
        memcpy(map->radiance.data + 3 * (size_t)rim[2 * i],
               map->radiance.data + 3 * (size_t)rim[2 * i + 1], 3 * sizeof(float));
    gn_pool_run(pool, height, sum_row, work);

    double upward[3];
    sum_figures(work, upward);
    float albedo = options->ground_albedo == 0 ? 0.2f : options->ground_albedo;
    for (int c = 0; c < 3; c++)
        map->fill[c] = options->no_fill || !(map->fill_solid_angle > 0)
                           ? 0
                           : (float)((double)albedo * upward[c] / pi);
    return 0;
}

static const char *check_frame(const struct gn_environment_frame *frame,
                               const struct gn_radiance_map_options *options,
                               struct gn_projection *out_projection, struct gn_pose *out_pose)
{
    const struct gn_image *codes = frame->codes;
    const char *reason = NULL;
    if (!codes || !codes->data)
        return "it has no pixels";
    if (codes->channels != 1 && codes->channels != 3 && codes->channels != 4)
        return "its pixels have neither 1 nor 3 nor 4 channels";
    *out_projection = frame->projection;
    if (gn_projection_init(out_projection, &reason) < 0)
        return reason;
    if (out_projection->width != codes->width || out_projection->height != codes->height)
        return "its projection is of another size than its picture";
    if (gn_response_check(&frame->response, &reason) < 0)
        return reason;
    if (frame->code_max < 0 || frame->code_max > 65535)
        return "its largest code lies outside [0, 65535]";
    memcpy(out_pose->rotation, frame->world_from_probe, sizeof(out_pose->rotation));
    memcpy(out_pose->translation, frame->position, sizeof(out_pose->translation));
    if (gn_pose_normalize(out_pose) < 0)
        return "its orientation is not a unit quaternion";
    for (int i = 0; i < 3; i++)
        if (!isfinite(frame->position[i]))
            return "its position is not finite";
    if (!(options->ground_albedo >= 0 && options->ground_albedo <= 1))
        return "the fill's albedo lies outside [0, 1]";
    return NULL;
}

/* Takes the pixels that an earlier map of the stream left, or new ones; all are written later. */
static int get_pixels(struct gn_radiance_map *map)
{
    const struct gn_projection *p = &map->projection;
    float *spare = atomic_exchange_explicit(&map->table->spare, NULL, memory_order_acquire);
    if (!spare)
        return gn_image_init(&map->radiance, p->width, p->height, 3);
    map->radiance = (struct gn_image){p->width, p->height, 3, spare};
    return 0;
}

static int fill_head(const struct gn_environment_frame *frame,
                     const struct gn_radiance_map_options *options,
                     const struct gn_projection *projection, const struct gn_pose *pose,
                     struct gn_pool *pool, struct gn_radiance_map *map)
{
    map->projection = *projection;
    map->world_from_probe = *pose;
    int rc =
        gn_map_table_create(projection, pose->rotation,
                            options->previous ? options->previous->table : NULL, pool, &map->table);
    if (rc == 0 && options->model)
        rc = gn_map_geometry_create(options->model, map->table, pose->translation,
                                    options->previous ? options->previous->geometry : NULL, pool,
                                    &map->geometry);
    if (rc < 0)
        return rc;
    map->solid_angle = map->table->solid_angle;
    map->direction_world = map->table->direction_world;
    map->fill_solid_angle = map->table->fill_solid_angle;
    map->is_full_sphere = gn_projection_is_full_sphere(projection);
    map->capture_time_ns = frame->capture_time_ns;
    map->sequence = frame->sequence;
    return get_pixels(map);
}

int gn_radiance_map_create(const struct gn_environment_frame *frame,
                           const struct gn_radiance_map_options *options, struct gn_pool *pool,
                           struct gn_radiance_map **out_map, struct gn_error *out_error)
{
    static const struct gn_radiance_map_options defaults = {0};
    if (!options)
        options = &defaults;
    *out_map = NULL;
    struct gn_projection projection;
    struct gn_pose pose;
    const char *reason = check_frame(frame, options, &projection, &pose);
    if (reason)
        return gn_error_set(out_error, -EINVAL, "environment frame: %s", reason);

    struct gn_radiance_map *map = calloc(1, sizeof(*map));
    struct work work = {.frame = frame, .map = map};
    int rc = -ENOMEM;
    if (map) {
        atomic_init(&map->references, 1);
        rc = fill_head(frame, options, &projection, &pose, pool, map);
    }
    if (rc == 0)
        rc = fill_map(&work, options, pool);
    free(work.rows);
    free(work.decoded);
    if (rc < 0) {
        gn_radiance_map_unref(&map);
        return gn_error_set(out_error, rc, "environment frame: no memory for a map of %d x %d",
                            projection.width, projection.height);
    }
    *out_map = map;
    return 0;
}

struct gn_radiance_map *gn_radiance_map_ref(struct gn_radiance_map *map)
{
    atomic_fetch_add_explicit(&map->references, 1, memory_order_relaxed);
    return map;
}

void gn_radiance_map_unref(struct gn_radiance_map **map)
{
    struct gn_radiance_map *m = *map;
    *map = NULL;
    if (!m || atomic_fetch_sub_explicit(&m->references, 1, memory_order_acq_rel) != 1)
        return;
    float *pixels = m->radiance.data;
    if (m->table && pixels)
        pixels = atomic_exchange_explicit(&m->table->spare, pixels, memory_order_acq_rel);
    free(pixels);
    gn_map_geometry_unref(&m->geometry);
    gn_map_table_unref(&m->table);
    free(m);
}

/* Adds the light of the texel beside texel home, if it shows any. */
static void add_tap(const struct gn_radiance_map *map, const int home[static 2], int dx, int dy,
                    double weight, double sum[static 4])
{
    int at[2] = {home[0], home[1]};
    if (!gn_projection_step(&map->projection, dx, dy, at) ||
        !(map->solid_angle[(size_t)at[1] * (size_t)map->radiance.width + (size_t)at[0]] > 0))
        return;
    const float *l = gn_image_at(&map->radiance, at[0], at[1]);
    for (int c = 0; c < 3; c++)
        sum[c] += weight * (double)l[c];
    sum[3] += weight;
}

/* The radiance the map shows there; false: it shows none. */
static bool look_up_shown(const struct gn_radiance_map *map, const float dir_world[static 3],
                          float out_radiance[static 3])
{
    const double *m = map->table->world_from_probe;
    double dir[3], xy[2], sum[4] = {0};
    for (int c = 0; c < 3; c++) // the transpose: probe_from_world
        dir[c] = m[c] * (double)dir_world[0] + m[3 + c] * (double)dir_world[1] +
                 m[6 + c] * (double)dir_world[2];
    if (gn_projection_get_position(&map->projection, dir, xy)) {
        int home[2] = {(int)fmin(xy[0], map->radiance.width - 1),
                       (int)fmin(xy[1], map->radiance.height - 1)};
        double x = xy[0] - home[0] - 0.5, y = xy[1] - home[1] - 0.5; // from the texel's centre
        for (int i = 0; i < 4; i++)
            add_tap(map, home, i % 2 ? (x < 0 ? -1 : 1) : 0, i / 2 ? (y < 0 ? -1 : 1) : 0,
                    (i % 2 ? fabs(x) : 1 - fabs(x)) * (i / 2 ? fabs(y) : 1 - fabs(y)), sum);
    }
    for (int c = 0; c < 3 && sum[3] > 0; c++)
        out_radiance[c] = (float)(sum[c] / sum[3]);
    return sum[3] > 0;
}

void gn_radiance_map_get_radiance(const struct gn_radiance_map *map,
                                  const float dir_world[static 3], float out_radiance[static 3])
{
    if (!look_up_shown(map, dir_world, out_radiance))
        memcpy(out_radiance, map->fill, sizeof(map->fill));
}

bool gn_radiance_map_get_radiance_at(const struct gn_radiance_map *map, const float point[static 3],
                                     float out_radiance[static 3])
{
    float dir[3];
    return map->geometry && gn_map_geometry_sees(map->geometry, point, dir) &&
           look_up_shown(map, dir, out_radiance);
}
