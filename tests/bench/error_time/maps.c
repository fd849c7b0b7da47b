/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/error_time/maps.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/image_file.h"
#include "tests/bench/seed_settings.h"
#include "tests/meshes.h"

const struct gn_bench_map_kind gn_bench_maps[] = {
    {"lamps", 4},
    {"sun", 4},
    {"overcast", 2},
    {"rig", 4}, // no files
    {"interior", 4},
    {"city", 4},
    {"sunrise", 4}, // GN_TEST_MAPS
    {"drachenfels_cellar_1k", 4},
    {"lebombo_1k", 2}, // GNOMON_DATA
};
const int gn_bench_n_maps = GN_ARRAY_LEN(gn_bench_maps);

enum { SIZE = 300, PARTS = 4 };

typedef void paint_fn(const struct gn_bench_change *change, const double dir[static 3],
                      double out[static 3]);

static double get_cosine(double elevation_deg, double azimuth_deg, const double dir[static 3])
{
    double e = elevation_deg * M_PI / 180, a = azimuth_deg * M_PI / 180;
    return cos(e) * cos(a) * dir[0] + cos(e) * sin(a) * dir[1] + sin(e) * dir[2];
}

/** In a window of the wall towards -x. */
static bool is_window(const double dir[static 3])
{
    return dir[0] < -0.8 && fabs(dir[1]) < 0.35 && dir[2] > 0.1 && dir[2] < 0.5;
}

static void paint_lamps(const struct gn_bench_change *change, const double dir[static 3],
                        double out[static 3])
{
    static const struct {
        double elevation_deg, azimuth_deg, radius_deg, rgb[3];
    } lamps[4] = {{67, 40, 3, {60, 52, 40}},
                  {55, 142, 4, {36, 33, 28}},
                  {51, 252, 3.5, {40, 42, 47}},
                  {44, 335, 2.5, {64, 47, 30}}};
    double wall = 0.25 + 0.2 * dir[2];
    out[0] = 1.05 * wall;
    out[1] = wall;
    out[2] = 0.9 * wall;
    if (is_window(dir)) {
        out[0] = 5;
        out[1] = 6;
        out[2] = 7.5;
    }
    for (int i = 0; i < 4; i++) {
        double azimuth = lamps[i].azimuth_deg + (i == 0 ? change->turn_deg : 0);
        bool is_in = get_cosine(lamps[i].elevation_deg, azimuth, dir) >
                     cos(lamps[i].radius_deg * M_PI / 180);
        for (int c = 0; c < 3 && is_in && !(i == 0 && change->is_lamp_off); c++)
            out[c] = lamps[i].rgb[c];
    }
}

static void paint_sun(const struct gn_bench_change *change, const double dir[static 3],
                      double out[static 3])
{
    (void)change;
    double sun = get_cosine(42, 30, dir), glow = exp(8 * (sun - 1));
    out[0] = 0.45 + 2.0 * glow;
    out[1] = 0.70 + 1.9 * glow;
    out[2] = 1.20 + 1.6 * glow;
    if (sun > cos(0.3 * M_PI / 180)) {
        out[0] = 2.1e5;
        out[1] = 2.0e5;
        out[2] = 1.8e5;
    }
}

static void paint_overcast(const struct gn_bench_change *change, const double dir[static 3],
                           double out[static 3])
{
    (void)change;
    double sky = (1 + 2 * dir[2]) / 3; // Moon and Spencer 1942, of the CIE's overcast sky
    out[0] = 0.95 * sky;
    out[1] = sky;
    out[2] = 1.1 * sky;
    if (is_window(dir)) {
        out[0] = 14;
        out[1] = 13;
        out[2] = 11;
    }
}

/** Normal deviate (Box and Muller 1958). */
static double get_deviate(uint64_t *random)
{
    double u = 1 - gn_test_random_unit(random), v = gn_test_random_unit(random);
    return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

/** Each texel the mean of its parts that lie inside the circle. */
static void paint_texel(const struct gn_bench_map *map, paint_fn *paint,
                        const struct gn_bench_change *change, int x, int y, float out[static 3])
{
    double sum[3] = {0};
    int n = 0;
    for (int part = 0; part < PARTS * PARTS; part++) {
        double dir[3], rgb[3], sub_x = part % PARTS, sub_y = (part - part % PARTS) / PARTS;
        if (!gn_projection_get_direction(&map->frame.projection, x + (sub_x + 0.5) / PARTS,
                                         y + (sub_y + 0.5) / PARTS, dir))
            continue;
        paint(change, dir, rgb);
        for (int c = 0; c < 3; c++)
            sum[c] += rgb[c];
        n++;
    }
    for (int c = 0; c < 3; c++)
        out[c] = n > 0 ? (float)(sum[c] / n) : 0;
}

/** A fisheye that looks up, its axes the world's. */
static int paint_fisheye(const char *name, int size, paint_fn *paint,
                         const struct gn_bench_change *change, struct gn_bench_map *out)
{
    uint64_t random = change->seed;
    *out = (struct gn_bench_map){.name = name,
                                 .frame = {.projection = {.type = GN_PROJECTION_FISHEYE_EQUIDISTANT,
                                                          .width = size,
                                                          .height = size},
                                           .world_from_probe = {1, 0, 0, 0}}};
    int ret = gn_projection_init(&out->frame.projection, NULL);
    if (ret == 0)
        ret = gn_image_init(&out->pixels, size, size, 3);
    for (int i = 0; i < size * size && ret == 0; i++) {
        float *rgb = gn_image_at(&out->pixels, i % size, i / size);
        paint_texel(out, paint, change, i % size, i / size, rgb);
        for (int c = 0; c < 3 && change->noise > 0; c++)
            rgb[c] *= (float)fmax(0, 1 + change->noise * get_deviate(&random));
    }
    out->frame.codes = &out->pixels;
    return ret;
}

int gn_bench_map_init_lamps(int size, const struct gn_bench_change *change,
                            struct gn_bench_map *out_map)
{
    return paint_fisheye("lamps", size, paint_lamps, change, out_map);
}

/** Means of 2 x 2 pixels: photographs of half a size, so that their references take minutes. */
static int halve(struct gn_image *image)
{
    struct gn_image half;
    int ret = gn_image_init(&half, image->width / 2, image->height / 2, 3);
    for (int i = 0; ret == 0 && i < half.width * half.height; i++) {
        for (int part = 0; part < 4; part++) {
            int x = 2 * (i % half.width) + part % 2, y = 2 * (i / half.width) + part / 2;
            for (int c = 0; c < 3; c++)
                half.data[3 * i + c] += 0.25f * fmaxf(gn_image_at(image, x, y)[c], 0);
        }
    }
    gn_image_finish(image);
    *image = half;
    return ret;
}

static int read_map(const char *name, struct gn_bench_map *out)
{
    const char *folders[2] = {getenv("GN_TEST_MAPS"), getenv("GNOMON_DATA")};
    struct gn_image_file file;
    for (int i = 0; i < 2; i++) {
        char path[PATH_MAX];
        if (!folders[i] || !folders[i][0] ||
            snprintf(path, sizeof(path), i ? "%s/hdr/equirect/%s.hdr" : "%s/%s.exr", folders[i],
                     name) >= (int)sizeof(path) ||
            access(path, R_OK) != 0)
            continue;
        int ret = gn_image_read_file(path, &file, NULL);
        if (ret < 0)
            return ret;
        ret = gn_image_file_to_float(&file, 0, &out->pixels);
        gn_image_file_finish(&file);
        if (ret == 0)
            ret = out->pixels.channels == 3 ? halve(&out->pixels) : -EINVAL;
        if (ret < 0)
            return ret;
        out->name = name;
        out->frame = (struct gn_environment_frame){.codes = &out->pixels,
                                                   .projection = {.type = GN_PROJECTION_LATLONG,
                                                                  .width = out->pixels.width,
                                                                  .height = out->pixels.height},
                                                   .world_from_probe = {1, 0, 0, 0}};
        return gn_projection_init(&out->frame.projection, NULL);
    }
    return -ENOENT;
}

int gn_bench_map_init(const char *name, int size, struct gn_bench_map *out_map)
{
    static const struct {
        const char *name;
        paint_fn *paint;
    } painted[] = {{"lamps", paint_lamps}, {"sun", paint_sun}, {"overcast", paint_overcast}};
    *out_map = (struct gn_bench_map){.name = name};
    for (size_t i = 0; i < GN_ARRAY_LEN(painted); i++) {
        const struct gn_bench_change none = {0};
        if (strcmp(name, painted[i].name) == 0)
            return paint_fisheye(name, size > 0 ? size : SIZE, painted[i].paint, &none, out_map);
    }
    if (strcmp(name, "rig") == 0)
        return gn_seed_take_frame(&out_map->pixels, &out_map->frame);
    return read_map(name, out_map);
}

int gn_bench_map_split(const struct gn_bench_map *map, int factor, struct gn_bench_map *out_map)
{
    struct gn_radiance_map *radiance;
    *out_map = (struct gn_bench_map){.name = map->name, .frame = map->frame};
    // Of the mended map: its rim has light where the frame's has not.
    int ret = gn_radiance_map_create(&map->frame, NULL, NULL, &radiance, NULL);
    if (ret < 0)
        return ret;
    const struct gn_projection *from = &map->frame.projection;
    struct gn_projection *to = &out_map->frame.projection;
    *to = (struct gn_projection){.type = from->type,
                                 .width = from->width * factor,
                                 .height = from->height * factor,
                                 .center = {from->center[0] * factor, from->center[1] * factor},
                                 .radius = from->radius * factor,
                                 .theta_max = from->theta_max};
    ret = gn_projection_init(to, NULL);
    if (ret == 0)
        ret = gn_image_init(&out_map->pixels, to->width, to->height, 3);
    for (int y = 0; y < to->height && ret == 0; y++) {
        for (int x = 0; x < to->width; x++)
            memcpy(gn_image_at(&out_map->pixels, x, y),
                   gn_image_at(&radiance->radiance, x / factor, y / factor), 3 * sizeof(float));
    }
    out_map->frame.codes = &out_map->pixels;
    gn_radiance_map_unref(&radiance);
    return ret;
}

void gn_bench_map_finish(struct gn_bench_map *map)
{
    gn_image_finish(&map->pixels);
    *map = (struct gn_bench_map){0};
}
