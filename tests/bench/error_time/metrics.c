/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/error_time/metrics.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"
#include "tests/bench/error_time/flip.h"

#define MASK_BELOW 0.995f
#define REL_EPSILON 0.01
#define TRIMMED_SHARE 0.001
#define EXPOSURE 0.25
// Rings and sectors of what the map does not show, of each of which the middle is taken.
enum { FILL_RINGS = 128, FILL_SECTORS = 256 };

static double get_luminance(const float rgb[static 3])
{
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

static bool is_shadowed(const float shadow[static 3])
{
    return shadow[0] < MASK_BELOW || shadow[1] < MASK_BELOW || shadow[2] < MASK_BELOW;
}

void gn_bench_compose(const struct gn_bench_picture *reference, const struct gn_image *shadow,
                      const struct gn_image *virtual_rgba, bool is_exposed, struct gn_image *out)
{
    size_t n = (size_t)out->width * (size_t)out->height;
    double mean = 0;
    for (size_t i = 0; i < n; i++)
        mean += get_luminance(reference->background.data + 3 * i) / (double)n;
    double scale = is_exposed && mean > 0 ? EXPOSURE / mean : 1;
    for (size_t i = 0; i < n; i++) {
        const float *rgba = virtual_rgba->data + 4 * i;
        for (size_t c = 0; c < 3; c++) {
            double real = (double)shadow->data[3 * i + c] * reference->background.data[3 * i + c];
            double value = scale * (real * (1 - rgba[3]) + rgba[c]);
            out->data[3 * i + c] = (float)(is_exposed ? fmin(value, 1) : value);
        }
    }
}

/** Over the pixels of touched; terms has room for three numbers for each pixel. */
static void measure_relative(const struct gn_image *reference, const struct gn_image *test,
                             const bool *touched, double *terms, struct gn_bench_errors *out)
{
    size_t n_pixels = (size_t)test->width * (size_t)test->height, n = 0;
    double mean = 0, sum = 0;
    for (size_t i = 0; i < 3 * n_pixels; i++) {
        if (touched[i / 3]) {
            mean += reference->data[i];
            n++;
        }
    }
    mean /= n > 0 ? (double)n : 1;
    n = 0;
    for (size_t i = 0; i < 3 * n_pixels && mean > 0; i++) {
        if (!touched[i / 3])
            continue;
        double r = reference->data[i] / mean, d = test->data[i] / mean - r;
        terms[n++] = d * d / (r * r + REL_EPSILON);
    }
    qsort(terms, n, sizeof(*terms), gn_compare_doubles);
    size_t n_kept = n - (size_t)((double)n * TRIMMED_SHARE);
    for (size_t i = 0; i < n; i++) {
        sum += terms[i];
        if (i + 1 == n_kept)
            out->relmse_trimmed = sum / (double)n_kept;
    }
    out->relmse = n > 0 ? sum / (double)n : 0;
}

static void measure_shadow(const struct gn_bench_picture *reference, const struct gn_layers *test,
                           bool *out_touched, struct gn_bench_errors *out)
{
    size_t n = (size_t)test->width * (size_t)test->height;
    double squares = 0, sum = 0;
    for (size_t i = 0; i < n; i++) {
        const float *r = reference->shadow.data + 3 * i, *x = test->shadow.data + 3 * i;
        bool is_virtual = reference->virtual_rgba.data[4 * i + 3] > 0;
        bool is_masked = !is_virtual && (is_shadowed(r) || is_shadowed(x));
        out_touched[i] = is_virtual || is_masked;
        out->n_masked += is_masked;
        for (int c = 0; c < 3 && is_masked; c++) {
            double d = (double)x[c] - r[c];
            squares += d * d;
            sum += d;
        }
    }
    double count = out->n_masked > 0 ? 3 * (double)out->n_masked : 1;
    out->rmse = sqrt(squares / count);
    out->bias = sum / count;
}

int gn_bench_measure_errors(const struct gn_bench_picture *reference, const struct gn_layers *test,
                            bool has_flip, struct gn_bench_errors *out_errors)
{
    struct gn_bench_errors errors = {.flip = -1};
    struct gn_image pictures[2] = {{0}};
    size_t n = (size_t)test->width * (size_t)test->height;
    bool *touched = malloc(n);
    double *terms = malloc(3 * n * sizeof(*terms));
    int ret = touched && terms ? 0 : -ENOMEM;
    for (int i = 0; i < 2 && ret == 0; i++)
        ret = gn_image_init(&pictures[i], test->width, test->height, 3);
    if (ret == 0) {
        measure_shadow(reference, test, touched, &errors);
        gn_bench_compose(reference, &reference->shadow, &reference->virtual_rgba, false,
                         &pictures[0]);
        gn_bench_compose(reference, &test->shadow, &test->virtual_rgba, false, &pictures[1]);
        measure_relative(&pictures[0], &pictures[1], touched, terms, &errors);
    }
    if (ret == 0 && has_flip) {
        gn_bench_compose(reference, &reference->shadow, &reference->virtual_rgba, true,
                         &pictures[0]);
        gn_bench_compose(reference, &test->shadow, &test->virtual_rgba, true, &pictures[1]);
        ret = gn_flip_compare(&pictures[0], &pictures[1], GN_FLIP_PIXELS_PER_DEGREE, NULL,
                              &errors.flip);
    }
    if (ret == 0)
        *out_errors = errors;
    gn_image_finish(&pictures[0]);
    gn_image_finish(&pictures[1]);
    free(touched);
    free(terms);
    return ret;
}

/** A spiral of equal steps along z and of the golden angle about it (Fibonacci lattice). */
static void get_normal(int i, double out[static 3])
{
    double z = 1 - (2 * i + 1.0) / GN_BENCH_NORMALS, phi = i * M_PI * (3 - sqrt(5));
    double r = sqrt(1 - z * z);
    out[0] = r * cos(phi);
    out[1] = r * sin(phi);
    out[2] = z;
}

static void add_light(const double dir[static 3], const double power[static 3],
                      double irradiance[static GN_BENCH_NORMALS][3])
{
    for (int i = 0; i < GN_BENCH_NORMALS; i++) {
        double n[3];
        get_normal(i, n);
        double cosine = n[0] * dir[0] + n[1] * dir[1] + n[2] * dir[2];
        for (int c = 0; c < 3 && cosine > 0; c++)
            irradiance[i][c] += cosine * power[c];
    }
}

void gn_bench_sum_texels(const struct gn_radiance_map *map,
                         double out_irradiance[static GN_BENCH_NORMALS][3])
{
    memset(out_irradiance, 0, GN_BENCH_NORMALS * sizeof(out_irradiance[0]));
    size_t n = (size_t)map->radiance.width * (size_t)map->radiance.height;
    for (size_t i = 0; i < n; i++) {
        double dir[3], power[3];
        for (size_t c = 0; c < 3; c++) {
            dir[c] = map->direction_world[3 * i + c];
            power[c] = (double)map->radiance.data[3 * i + c] * map->solid_angle[i];
        }
        if (power[0] > 0 || power[1] > 0 || power[2] > 0)
            add_light(dir, power, out_irradiance);
    }
    // The fill: cells of equal solid angle from the rim to the pole behind.
    double rim = cos(map->projection.theta_max), n_cells = (double)FILL_RINGS * FILL_SECTORS;
    for (int i = 0; i < FILL_RINGS * FILL_SECTORS && map->fill_solid_angle > 0; i++) {
        double z = rim - (1 + rim) * (i / FILL_SECTORS + 0.5) / FILL_RINGS;
        double phi = 2 * M_PI * (i % FILL_SECTORS + 0.5) / FILL_SECTORS, r = sqrt(1 - z * z);
        double dir[3] = {r * cos(phi), r * sin(phi), z}, power[3];
        for (int c = 0; c < 3; c++)
            power[c] = (double)map->fill[c] * map->fill_solid_angle / n_cells;
        gn_pose_rotate(&map->world_from_probe, dir, dir);
        add_light(dir, power, out_irradiance);
    }
}

static double compare_tables(double test[static GN_BENCH_NORMALS][3],
                             double exact[static GN_BENCH_NORMALS][3])
{
    double squares = 0, sum = 0;
    for (int i = 0; i < GN_BENCH_NORMALS * 3; i++) {
        double d = test[i / 3][i % 3] - exact[i / 3][i % 3];
        squares += d * d;
        sum += exact[i / 3][i % 3];
    }
    double n = GN_BENCH_NORMALS * 3;
    return sum > 0 ? sqrt(squares / n) / (sum / n) : 0;
}

double gn_bench_compare_irradiance(const struct gn_lighting_state *state,
                                   double exact[static GN_BENCH_NORMALS][3])
{
    double test[GN_BENCH_NORMALS][3] = {{0}};
    for (int i = 0; i < state->n_lights; i++) {
        double dir[3], power[3];
        for (int c = 0; c < 3; c++) {
            dir[c] = state->lights[i].dir_world[c];
            power[c] = state->lights[i].irradiance[c];
        }
        add_light(dir, power, test);
    }
    return compare_tables(test, exact);
}

double gn_bench_compare_sh(const struct gn_lighting_state *state,
                           double exact[static GN_BENCH_NORMALS][3])
{
    double test[GN_BENCH_NORMALS][3];
    for (int i = 0; i < GN_BENCH_NORMALS; i++) {
        double n[3];
        get_normal(i, n);
        gn_irradiance_get(&state->irradiance, n, test[i]);
    }
    return compare_tables(test, exact);
}
