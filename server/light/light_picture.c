/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/light_picture.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "common/projection.h"
#include "common/response.h"
#include "server/light/luminance.h"
#include "server/light/partition_plan.h"

static const double pi = 3.14159265358979323846;

/* A middle grey, and the exposed value that becomes white. */
static const double grey = 0.18, white = 8;

struct picture_work {
    const struct gn_lighting_state *state;
    struct gn_projection projection; // of the picture
    struct gn_image light;           // linear, then tone-mapped
    double *log_sums;                // [height][2]: sum of log Y over lit pixels, their number
    double exposure;
    bool has_regions;
    struct gn_image8 *out;
};

static void look_up_row(void *context, int y, int worker)
{
    (void)worker;
    struct picture_work *work = context;
    double *sums = work->log_sums + 2 * (size_t)y;
    sums[0] = sums[1] = 0;
    for (int x = 0; x < work->light.width; x++) {
        double d[3];
        float *rgb = gn_image_at(&work->light, x, y);
        gn_projection_get_direction(&work->projection, x + 0.5, y + 0.5, d);
        gn_radiance_map_get_radiance(work->state->map,
                                     (float[3]){(float)d[0], (float)d[1], (float)d[2]}, rgb);
        double luminance = gn_luminance(rgb), weight = sin(pi * (y + 0.5) / work->light.height);
        if (luminance > 0) {
            sums[0] += weight * log(luminance);
            sums[1] += weight;
        }
    }
}

/* Reinhard's curve with a white point, on the luminance; what then leaves the gamut fades to
 * white. Source: Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002, eq 4.
 */
static void map_tone(double exposure, float rgb[static 3])
{
    double y = exposure * gn_luminance(rgb);
    if (!(y > 0)) {
        rgb[0] = rgb[1] = rgb[2] = 0;
        return;
    }
    double shown = fmin(y < 1e6 ? y * (1 + y / (white * white)) / (1 + y) : 1, 1);
    for (int c = 0; c < 3; c++) {
        double v = fmin((double)rgb[c] * exposure / y, 5) * shown;
        rgb[c] = (float)fmin(v + (1 - v) * shown * shown * shown, 1);
    }
}

/* The base region of a pixel; -1 where nothing is divided. */
static int get_region(const struct picture_work *work, int x, int y)
{
    const struct gn_partition_plan *plan = work->state->plan;
    double d[3], polar[2];
    x = x < work->light.width ? x : 0;
    y = y < work->light.height ? y : work->light.height - 1;
    gn_projection_get_direction(&work->projection, x + 0.5, y + 0.5, d);
    gn_partition_plan_get_world_polar(plan, d, polar);
    return polar[0] > plan->theta_max ? -1 : gn_partition_plan_find_region(plan, polar);
}

static void map_row(void *context, int y, int worker)
{
    (void)worker;
    struct picture_work *work = context;
    for (int x = 0; x < work->light.width; x++) {
        float *rgb = gn_image_at(&work->light, x, y);
        map_tone(work->exposure, rgb);
        if (!work->has_regions)
            continue;
        int region = get_region(work, x, y);
        if (region != get_region(work, x + 1, y) || region != get_region(work, x, y + 1))
            for (int c = 0; c < 3; c++)
                rgb[c] = 0.55f * rgb[c] + 0.45f * (c == 0 ? 0.1f : 0.35f);
    }
}

static void encode_row(void *context, int y, int worker)
{
    (void)worker;
    static const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    struct picture_work *work = context;
    const float *row = gn_image_at(&work->light, 0, y);
    uint8_t *out = gn_image8_at(work->out, 0, y);
    for (int i = 0; i < 3 * work->light.width; i++)
        out[i] = (uint8_t)lrintf(255 * gn_response_encode(&srgb, row[i]));
}

static void blend(float *rgb, const float color[static 3], double alpha)
{
    for (int c = 0; c < 3; c++)
        rgb[c] += (float)alpha * (color[c] - rgb[c]);
}

/* A disc with a dark rim and a light line inside it: seen on bright and on dark ground. */
static void draw_disc(struct gn_image *image, const double xy[static 2], double radius,
                      const float color[static 3])
{
    static const float black[3] = {0}, light[3] = {1, 1, 1};
    int reach = (int)ceil(radius + 2), x0 = (int)floor(xy[0]), y0 = (int)floor(xy[1]);
    for (int y = y0 - reach; y <= y0 + reach; y++) {
        for (int x = x0 - reach; x <= x0 + reach; x++) {
            if (y < 0 || y >= image->height)
                continue;
            double r = hypot(x + 0.5 - xy[0], y + 0.5 - xy[1]);
            float *rgb = gn_image_at(image, ((x % image->width) + image->width) % image->width, y);
            blend(rgb, black, 0.75 * fmin(fmax(radius + 1.5 - r, 0), 1));
            blend(rgb, light, 0.9 * fmin(fmax(radius + 0.5 - r, 0), 1));
            blend(rgb, color, fmin(fmax(radius - 0.5 - r, 0), 1));
        }
    }
}

static void draw_lights(struct picture_work *work)
{
    const struct gn_lighting_state *s = work->state;
    double total = 0;
    for (int i = 0; i < s->n_lights; i++)
        total += gn_luminance(s->lights[i].irradiance);
    for (int i = 0; i < s->n_lights; i++) {
        const struct gn_light *l = &s->lights[i];
        double d[3], xy[2], max = 0;
        float color[3];
        for (int c = 0; c < 3; c++) {
            d[c] = (double)l->dir_world[c];
            max = fmax(max, (double)l->irradiance[c]);
        }
        if (!(max > 0) || !gn_projection_get_position(&work->projection, d, xy))
            continue;
        for (int c = 0; c < 3; c++) // its hue at full strength
            color[c] = (float)((double)l->irradiance[c] / max);
        double share = gn_luminance(l->irradiance) / total;
        double radius = 0.11 * work->light.height * sqrt(share);
        draw_disc(&work->light, xy, fmax(radius, 0.006 * work->light.height) + 1, color);
    }
}

static int make_picture(struct picture_work *work, const struct gn_light_picture_options *options,
                        struct gn_pool *pool)
{
    int height = work->projection.height;
    int rc = gn_image_init(&work->light, work->projection.width, height, 3);
    work->log_sums = malloc(2 * (size_t)height * sizeof(*work->log_sums));
    if (rc < 0 || !work->log_sums)
        return rc < 0 ? rc : -ENOMEM;
    gn_pool_run(pool, height, look_up_row, work);
    double log_sum = 0, n_lit = 0;
    for (int y = 0; y < height; y++) {
        log_sum += work->log_sums[2 * (size_t)y];
        n_lit += work->log_sums[2 * (size_t)y + 1];
    }
    double mean = n_lit > 0 ? exp(log_sum / n_lit) : 1;
    work->exposure = grey / mean * exp2(options->exposure_ev);
    gn_pool_run(pool, height, map_row, work);
    if (!options->no_lights)
        draw_lights(work);
    gn_pool_run(pool, height, encode_row, work);
    return 0;
}

int gn_light_picture_make(const struct gn_lighting_state *state,
                          const struct gn_light_picture_options *options, struct gn_pool *pool,
                          struct gn_image8 *out_picture)
{
    static const struct gn_light_picture_options defaults = {0};
    if (!options)
        options = &defaults;
    struct picture_work work = {.state = state,
                                .projection = {.type = GN_PROJECTION_LATLONG,
                                               .width = options->width ? options->width : 512,
                                               .height = options->height ? options->height : 256},
                                .has_regions =
                                    options->has_regions && state->plan && state->figures.rings > 0,
                                .out = out_picture};
    const char *reason;
    *out_picture = (struct gn_image8){0};
    if (gn_projection_init(&work.projection, &reason) < 0 || !(fabs(options->exposure_ev) <= 60))
        return -EINVAL;
    int rc = gn_image8_init(out_picture, work.projection.width, work.projection.height, 3);
    if (rc == 0)
        rc = make_picture(&work, options, pool);
    if (rc < 0)
        gn_image8_finish(out_picture);
    free(work.log_sums);
    gn_image_finish(&work.light);
    return rc;
}
