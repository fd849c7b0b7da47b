/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The largest maps, and samples as estimates of integrals: sums of millions, tables of sums that
 * must not run out of digits, directions that must agree with their density. */
#include <math.h>
#include <stdlib.h>

#include "common/pool.h"
#include "proto/attr.h"
#include "server/light/luminance.h"
#include "server/light/map_samples.h"
#include "server/light/map_table.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/unit/cmocka_setup.h"

static const double pi = 3.14159265358979323846;

/* How far the lights but the sun are from evenly spread: the length of their mean direction. */
static double get_bias(const struct gn_lighting_state *s, const double sun[static 3])
{
    double moment[3] = {0}, all = 0;
    for (int i = 0; i < s->n_lights; i++) {
        const struct gn_light *l = &s->lights[i];
        double dot = 0, power = (double)l->irradiance[1];
        for (int c = 0; c < 3; c++)
            dot += (double)l->dir_world[c] * sun[c];
        if (l->is_disc || dot > 0.999999)
            continue;
        for (int c = 0; c < 3; c++)
            moment[c] += power * (double)l->dir_world[c];
        all += power;
    }
    double length = sqrt(moment[0] * moment[0] + moment[1] * moment[1] + moment[2] * moment[2]);
    return all > 0 ? length / all : 0; // `seed` may drop all but the sun
}

/* 33.5 million texels of 1, and a sun of 1e9 that comes first: in single precision a table of their
 * sums has no digits left for most of them. The rest has all its light, on no side less than on the
 * other. */
static void trap_8_no_texel_without_width(void **unused)
{
    (void)unused;
    enum { W = 8192, H = 4096 };
    struct light_fixture f;
    struct gn_pool *pool = NULL;
    double sun[3], rest = 0;
    assert_int_equal(gn_pool_create(2, &pool), 0);
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, W, H), 0);
    for (size_t i = 0; i < (size_t)3 * W * H; i++)
        f.image.data[i] = 1;
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 4, 300)[c] = 1e9f;
    f.frame.codes = &f.image;
    assert_true(gn_projection_get_direction(&f.frame.projection, 4.5, 300.5, sun));
    double w = gn_projection_get_solid_angle(&f.frame.projection, 4, 300);
    struct gn_lighting_state *s = NULL;
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        const struct gn_light_options options = {.method = (enum gn_light_method)m,
                                                 .n_lights = m == GN_LIGHT_PARTITION_SEED ? 0 : 256,
                                                 .no_sh = m > 0,
                                                 .previous = s};
        struct gn_radiance_map_options map_options = {.previous = s ? s->map : NULL};
        struct gn_lighting_state *next;
        struct gn_error error = {0};
        if (gn_lighting_state_create(&f.frame, &map_options, &options, pool, &next, &error) < 0)
            fail_msg("%s", error.text);
        gn_lighting_state_unref(&s);
        s = next;
        double sum = 0, total = s->total_irradiance[1];
        rest = (total - 1e9 * w) / (4 * pi - w) - 1;
        for (int i = 0; i < s->n_lights; i++)
            sum += (double)s->lights[i].irradiance[1];
        double worst = get_bias(s, sun);
        print_message(
            "# 8192 x 4096, %-10s: the rest off by %.1e, to one side by %.4f, lights' sum "
            "by "
            "%.1e, %.0f ms\n",
            gn_light_method_get_name(options.method), rest, worst, sum / total - 1,
            s->ms_map + s->ms_lights);
        assert_true(fabs(rest) < 1e-5);
        if (m == GN_LIGHT_PARTITION_SEED)
            continue;
        assert_near(sum, total, 1e-5 * total);
        assert_true(worst < 0.01);
    }
    gn_lighting_state_unref(&s);
    gn_pool_destroy(&pool);
    light_fixture_finish(&f);
}

static void slope(const double dir[static 3], float out[static 3])
{
    out[0] = out[1] = out[2] = (float)(1 + 0.8 * dir[2] + 0.15 * dir[0]);
}

static double test_function(int k, const double d[static 3])
{
    switch (k) {
    case 0:
        return 1;
    case 1:
        return 1 + d[2];
    case 2:
        return d[0] * d[0] + 2 * d[1];
    case 3:
        return exp(2 * d[2]);
    default:
        return 2 + d[0] * d[0] * d[0] - 3 * d[0] * d[1] * d[1]; // cos 3 phi on the equator
    }
}

/* Samples have the density Y / power per steradian: sums over them are integrals, those of 1 / Y
 * too, whatever the projection does to solid angles. */
static void trap_6_samples_do_not_have_their_density(void **unused)
{
    (void)unused;
    static const struct {
        enum gn_projection_type type;
        int width, height;
    } maps[] = {{GN_PROJECTION_LATLONG, 96, 48},      {GN_PROJECTION_ANGULAR, 100, 100},
                {GN_PROJECTION_MIRRORBALL, 160, 160}, {GN_PROJECTION_CUBE, 40, 240},
                {GN_PROJECTION_OCTAHEDRAL, 64, 64},   {GN_PROJECTION_FISHEYE_EQUIDISTANT, 90, 90}};
    for (size_t t = 0; t < GN_ARRAY_LEN(maps); t++) {
        struct light_fixture f;
        struct gn_radiance_map *map;
        struct gn_map_samples samples = {0};
        const struct gn_map_sampling sampling = {.n_wanted = 40000};
        assert_int_equal(light_fixture_init(&f, maps[t].type, maps[t].width, maps[t].height), 0);
        light_fixture_fill(&f, slope);
        assert_int_equal(gn_radiance_map_create(&f.frame, NULL, NULL, &map, NULL), 0);
        struct gn_scratch *scratch = gn_scratch_borrow(&map->table->scratch);
        assert_int_equal(gn_map_samples_draw(map, &sampling, scratch, &samples), 0);
        double whole = 0, worst = 0;
        for (int i = 0; i < map->radiance.width * map->radiance.height; i++)
            whole += gn_luminance(map->radiance.data + 3 * i) * (double)map->solid_angle[i];
        for (int k = 0; k < 5; k++) {
            double by_samples = 0, truth = 0;
            for (int i = 0; i < map->radiance.width * map->radiance.height; i++) {
                const float *v = map->direction_world + 3 * i;
                const double d[3] = {(double)v[0], (double)v[1], (double)v[2]};
                truth += test_function(k, d) * (double)map->solid_angle[i];
            }
            for (int i = 0; i < samples.n; i++) {
                const float *v = map->direction_world + 3 * (size_t)samples.texel[i];
                const double d[3] = {(double)v[0], (double)v[1], (double)v[2]};
                by_samples += test_function(k, d) * samples.power /
                              gn_luminance(map->radiance.data + 3 * (size_t)samples.texel[i]);
            }
            worst = fmax(worst, fabs(by_samples / truth - 1));
        }
        double norm = samples.n * samples.power / whole;
        print_message(
            "# %-20s %d samples: density integrates to %.5f, five functions within %.4f\n",
            gn_projection_get_name(maps[t].type), samples.n, norm, worst);
        assert_near(norm, 1, 0.01);
        assert_true(worst < 0.02);
        gn_scratch_give_back(&map->table->scratch, &scratch);
        gn_radiance_map_unref(&map);
        light_fixture_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_6_samples_do_not_have_their_density),
        cmocka_unit_test(trap_8_no_texel_without_width),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
