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
#include "server/light/code_table.h"
#include "server/light/map_geometry.h"
#include "server/light/map_rows.h"
#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;

/* One frame on its way to a map. */
struct work {
    struct gn_map_reader reader;
    struct gn_map_row *rows; // [height], the map's
};

static void read_row(void *context, int y, int worker)
{
    (void)worker;
    struct work *work = context;
    gn_map_row_read(&work->reader, y, &work->rows[y]);
}

static void mend_row(void *context, int y, int worker)
{
    (void)worker;
    struct work *work = context;
    gn_map_row_mend(&work->reader, y, &work->rows[y]);
}

/* A luminance is no larger than its largest channel, so that few rows have to be searched. */
static double get_max_luminance(const struct gn_map_reader *reader, const struct gn_map_row *rows,
                                int n_rows)
{
    int brightest = 0;
    for (int y = 1; y < n_rows; y++)
        if (rows[y].max_channel > rows[brightest].max_channel)
            brightest = y;
    double max = gn_map_row_get_max_luminance(reader, brightest);
    for (int y = 0; y < n_rows; y++)
        if ((double)rows[y].max_channel > max && y != brightest)
            max = fmax(max, gn_map_row_get_max_luminance(reader, y));
    return max;
}

/* Adds the rows up, in their order: threads change no bit. */
static void sum_figures(struct gn_radiance_map *map, const struct gn_map_reader *reader,
                        int *out_largest_code, double out_upward[static 3])
{
    struct gn_radiance_map_figures f = {.shown_solid_angle = map->table->shown_solid_angle};
    int largest_code = 0;
    double upward[3] = {0};
    for (int y = 0; y < map->radiance.height; y++) {
        const struct gn_map_row *row = &map->rows[y];
        f.n_nan += row->n_nan;
        f.n_inf += row->n_inf;
        f.n_negative += row->n_negative;
        f.n_capped += row->n_capped;
        f.n_clipped += row->n_clipped;
        f.n_out_of_gamut += row->n_out_of_gamut;
        largest_code = row->largest_code > largest_code ? row->largest_code : largest_code;
        for (int c = 0; c < 3; c++) {
            f.shown_irradiance[c] += row->irradiance[c];
            upward[c] += row->upward[c];
        }
    }
    const double *e = f.shown_irradiance;
    double luminance = gn_luminance_of_sum(e);
    f.mean_luminance = f.shown_solid_angle > 0 ? luminance / f.shown_solid_angle : 0;
    f.max_luminance = get_max_luminance(reader, map->rows, map->radiance.height);
    map->figures = f;
    *out_largest_code = largest_code;
    memcpy(out_upward, upward, sizeof(upward));
}

static int fill_map(const struct gn_environment_frame *frame,
                    const struct gn_radiance_map_options *options, struct gn_pool *pool,
                    struct gn_radiance_map *map, struct gn_error *out_error)
{
    int height = map->radiance.height;
    struct work work = {.reader = {.frame = frame,
                                   .table = map->table,
                                   .codes = map->codes,
                                   .radiance = map->radiance.data},
                        .rows = map->rows};
    gn_map_reader_init(&work.reader);
    gn_pool_run(pool, height, read_row, &work);
    bool has_infinite = false;
    for (int y = 0; y < height; y++)
        has_infinite = has_infinite || map->rows[y].n_inf > 0;
    if (has_infinite)
        gn_pool_run(pool, height, mend_row, &work);
    const uint32_t *rim = map->table->rim;
    for (int i = 0; i < map->table->n_rim; i++)
        memcpy(map->radiance.data + 3 * (size_t)rim[2 * i],
               map->radiance.data + 3 * (size_t)rim[2 * i + 1], 3 * sizeof(float));

    double upward[3];
    int largest_code;
    sum_figures(map, &work.reader, &largest_code, upward);
    if (largest_code > frame->code_max)
        return gn_error_set(out_error, -EINVAL,
                            "environment frame: a code of %d in a format of codes 0 to %d",
                            largest_code, frame->code_max);
    float albedo = options->ground_albedo == 0 ? 0.2f : options->ground_albedo;
    for (int c = 0; c < 3; c++)
        map->fill[c] = options->no_fill || !(map->fill_solid_angle > 0)
                           ? 0
                           : (float)((double)albedo * upward[c] / pi);
    return 0;
}

/* Whether the pixels are there, as large as the projection says. */
static const char *check_pixels(const struct gn_environment_frame *frame,
                                const struct gn_projection *projection)
{
    if ((unsigned)frame->layout >= GN_PIXELS_COUNT)
        return "its pixels lie in no layout there is";
    if (frame->code_max < 0 || frame->code_max > 65535)
        return "its largest code lies outside [0, 65535]";
    if (frame->layout != GN_PIXELS_IMAGE) {
        bool is_float = frame->layout == GN_PIXELS_RGB_F32 || frame->layout == GN_PIXELS_RGB_F16;
        if (!frame->raw)
            return "it has no pixels";
        if (is_float != (frame->code_max == 0) ||
            (frame->layout == GN_PIXELS_RGB_U8 && frame->code_max != 255))
            return "its largest code does not fit its layout";
        return NULL;
    }
    const struct gn_image *codes = frame->codes;
    if (!codes || !codes->data)
        return "it has no pixels";
    if (codes->channels != 1 && codes->channels != 3 && codes->channels != 4)
        return "its pixels have neither 1 nor 3 nor 4 channels";
    if (projection->width != codes->width || projection->height != codes->height)
        return "its projection is of another size than its picture";
    return NULL;
}

static const char *check_frame(const struct gn_environment_frame *frame,
                               const struct gn_radiance_map_options *options,
                               struct gn_projection *out_projection, struct gn_pose *out_pose)
{
    const char *reason = NULL;
    *out_projection = frame->projection;
    if (gn_projection_init(out_projection, &reason) < 0)
        return reason;
    reason = check_pixels(frame, out_projection);
    if (reason)
        return reason;
    if (gn_response_check(&frame->response, &reason) < 0)
        return reason;
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

/*
 * A map with a table, pixels and rows: one that was freed in this stream, or a new one. All pixels
 * and rows are written later.
 */
static int get_blank(const struct gn_projection *projection, const struct gn_pose *pose,
                     const struct gn_radiance_map *previous, struct gn_pool *pool,
                     struct gn_radiance_map **out_map)
{
    struct gn_map_table *table;
    int rc = gn_map_table_create(projection, pose->rotation, previous ? previous->table : NULL,
                                 pool, &table);
    if (rc < 0)
        return rc;
    struct gn_radiance_map *map = NULL;
    for (int i = 0; i < GN_MAP_SPARES && !map; i++)
        map = atomic_exchange_explicit(&table->spare[i], NULL, memory_order_acquire);
    if (!map) {
        map = calloc(1, sizeof(*map));
        if (map) {
            map->rows = malloc((size_t)projection->height * sizeof(*map->rows));
            rc = gn_image_init(&map->radiance, projection->width, projection->height, 3);
        }
    }
    if (!map || !map->rows || rc < 0) {
        if (map)
            gn_radiance_map_free(map);
        gn_map_table_unref(&table);
        return -ENOMEM;
    }
    atomic_init(&map->references, 1);
    map->table = table;
    *out_map = map;
    return 0;
}

static int fill_head(const struct gn_environment_frame *frame,
                     const struct gn_radiance_map_options *options,
                     const struct gn_projection *projection, const struct gn_pose *pose,
                     struct gn_pool *pool, struct gn_radiance_map *map)
{
    const struct gn_radiance_map *previous = options->previous;
    map->projection = *projection;
    map->world_from_probe = *pose;
    map->solid_angle = map->table->solid_angle;
    map->direction_world = map->table->direction_world;
    map->fill_solid_angle = map->table->fill_solid_angle;
    map->is_full_sphere = gn_projection_is_full_sphere(projection);
    map->capture_time_ns = frame->capture_time_ns;
    map->sequence = frame->sequence;
    int rc = 0;
    if (frame->code_max > 0)
        rc = gn_code_table_create(&frame->response, frame->code_max,
                                  previous ? previous->codes : NULL, &map->codes);
    if (rc == 0 && options->model)
        rc = gn_map_geometry_create(options->model, map->table, pose->translation,
                                    previous ? previous->geometry : NULL, pool, &map->geometry);
    return rc;
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

    struct gn_radiance_map *map = NULL;
    int rc = get_blank(&projection, &pose, options->previous, pool, &map);
    if (rc == 0)
        rc = fill_head(frame, options, &projection, &pose, pool, map);
    if (rc < 0)
        gn_error_set(out_error, rc, "environment frame: no memory for a map of %d x %d",
                     projection.width, projection.height);
    else
        rc = fill_map(frame, options, pool, map, out_error);
    if (rc < 0)
        gn_radiance_map_unref(&map);
    *out_map = map;
    return rc;
}

int gn_radiance_map_copy(const struct gn_radiance_map *map, struct gn_radiance_map **out_map)
{
    struct gn_radiance_map *copy;
    *out_map = NULL;
    int rc = get_blank(&map->projection, &map->world_from_probe, map, NULL, &copy);
    if (rc < 0)
        return rc;
    copy->geometry = map->geometry ? gn_map_geometry_ref(map->geometry) : NULL;
    copy->codes = NULL;
    copy->projection = map->projection;
    copy->world_from_probe = map->world_from_probe;
    copy->solid_angle = map->solid_angle;
    copy->direction_world = map->direction_world;
    copy->is_full_sphere = map->is_full_sphere;
    memcpy(copy->fill, map->fill, sizeof(copy->fill));
    copy->fill_solid_angle = map->fill_solid_angle;
    copy->capture_time_ns = map->capture_time_ns;
    copy->sequence = map->sequence;
    copy->figures = map->figures;
    memcpy(copy->rows, map->rows, (size_t)map->radiance.height * sizeof(*map->rows));
    memcpy(copy->radiance.data, map->radiance.data,
           3 * (size_t)map->radiance.width * (size_t)map->radiance.height * sizeof(float));
    *out_map = copy;
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
    struct gn_map_table *table = m->table;
    gn_map_geometry_unref(&m->geometry);
    gn_code_table_unref(&m->codes);
    m->table = NULL;
    for (int i = 0; i < GN_MAP_SPARES && m; i++) // the place of none, or of one that is freed
        m = atomic_exchange_explicit(&table->spare[i], m, memory_order_acq_rel);
    if (m)
        gn_radiance_map_free(m);
    gn_map_table_unref(&table);
}

void gn_radiance_map_free(struct gn_radiance_map *map)
{
    gn_image_finish(&map->radiance);
    free(map->rows);
    free(map);
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
