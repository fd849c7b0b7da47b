/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light where it is hard to place, through every method: at the poles, on the seam, at the horizon,
 * twice the same, and in the largest map. */
#include <math.h>
#include <stdlib.h>

#include "proto/attr.h"
#include "server/light/map_samples.h"
#include "server/light/state.h"
#include "tests/light_states.h"

static const char *get_name(const struct gn_light_options *options)
{
    return gn_light_method_get_name(options->method);
}

static double get_dot(const float a[static 3], const double b[static 3])
{
    return (double)a[0] * b[0] + (double)a[1] * b[1] + (double)a[2] * b[2];
}

/* Adds a disc of radiance 1000 to the fixture; 4 x 4 points of each texel. */
static void add_lamp(struct light_fixture *f, const double dir[static 3], double radius)
{
    for (int y = 0; y < f->image.height; y++) {
        for (int x = 0; x < f->image.width; x++) {
            int n = 0;
            for (int i = 0; i < 16; i++) {
                double d[3];
                n += gn_projection_get_direction(&f->frame.projection, x + (i % 4 + 0.5) / 4,
                                                 y + (i / 4 + 0.5) / 4, d) &&
                     d[0] * dir[0] + d[1] * dir[1] + d[2] * dir[2] > cos(radius);
            }
            for (int c = 0; c < 3; c++)
                gn_image_at(&f->image, x, y)[c] += (float)(1000 * n / 16.0);
        }
    }
}

/* Irradiance of a plane that faces n: by the lights, and by the texels and the fill below z = 0. */
static double get_by_lights(const struct gn_lighting_state *s, const double n[static 3])
{
    double sum = 0;
    for (int i = 0; i < s->n_lights; i++)
        sum += (double)s->lights[i].irradiance[1] * fmax(get_dot(s->lights[i].dir_world, n), 0);
    return sum;
}

static double get_by_texels(const struct gn_lighting_state *s, const double n[static 3])
{
    const struct gn_radiance_map *map = s->map;
    double sum = 0;
    for (int i = 0; i < map->radiance.width * map->radiance.height; i++)
        sum += (double)map->radiance.data[3 * i + 1] * (double)map->solid_angle[i] *
               fmax(get_dot(map->direction_world + 3 * i, n), 0);
    return sum;
}

static void check_sum(const struct gn_lighting_state *s, const struct gn_light_options *options)
{
    double sum = 0;
    for (int i = 0; i < s->n_lights; i++) {
        for (int c = 0; c < 3; c++)
            assert_true(s->lights[i].irradiance[c] >= 0 && isfinite(s->lights[i].dir_world[c]));
        sum += (double)s->lights[i].irradiance[1];
    }
    if (options->method != GN_LIGHT_PARTITION_SEED)
        assert_near(sum, s->total_irradiance[1], 1e-5 * s->total_irradiance[1]);
}

/* A lamp has the same light and the same place at a pole, on the seam and anywhere else. */
static void trap_5_a_lamp_at_a_pole_or_on_the_seam(void **unused)
{
    (void)unused;
    static const struct {
        const char *name;
        double dir[3];
    } places[] = {{"anywhere", {0.48, 0.6, 0.64}}, {"upper pole", {0, 0, 1}},
                  {"lower pole", {0, 0, -1}},      {"seam", {-1, 0, 0}},
                  {"near a pole", {0, 0.02, 1}},   {"near the seam", {-1, 0.01, 0.3}}};
    for (size_t k = 0; k < GN_ARRAY_LEN(places); k++) {
        double dir[3], length = 0, worst[2] = {0};
        for (int c = 0; c < 3; c++)
            length += places[k].dir[c] * places[k].dir[c];
        for (int c = 0; c < 3; c++)
            dir[c] = places[k].dir[c] / sqrt(length);
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 180, 90), 0);
        light_fixture_fill(&f, light_fixture_constant);
        add_lamp(&f, dir, 0.07);
        for (int i = 0; i < 2 * GN_LIGHT_METHOD_COUNT; i++) {
            struct gn_light_options options = {.method = (enum gn_light_method)(i / 2),
                                               .no_discs = i % 2};
            struct gn_lighting_state *s = make_state(&f, &options, NULL);
            check_sum(s, &options);
            double lamp = 0, toward[3] = {0}, truth = get_by_texels(s, dir);
            for (int l = 0; l < s->n_lights; l++) {
                if (get_dot(s->lights[l].dir_world, dir) < cos(0.14))
                    continue;
                lamp += (double)s->lights[l].irradiance[1];
                for (int c = 0; c < 3; c++)
                    toward[c] +=
                        (double)s->lights[l].irradiance[1] * (double)s->lights[l].dir_world[c];
            }
            double off[3] = {toward[1] * dir[2] - toward[2] * dir[1],
                             toward[2] * dir[0] - toward[0] * dir[2],
                             toward[0] * dir[1] - toward[1] * dir[0]};
            double angle = sqrt(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]) / lamp;
            worst[0] = fmax(worst[0], angle);
            if (options.method != GN_LIGHT_PARTITION_SEED)
                worst[1] = fmax(worst[1], fabs(get_by_lights(s, dir) / truth - 1));
            if (!(angle < 0.02))
                fail_msg("%s, %s: %g rad off", places[k].name, get_name(&options), angle);
            double e[3];
            gn_irradiance_get(&s->irradiance, dir, e);
            worst[1] = fmax(worst[1], fabs(e[1] / truth - 1));
            gn_lighting_state_unref(&s);
        }
        print_message("# a lamp of 4 degrees, %-13s: within %.4f rad, irradiance within %.4f\n",
                      places[k].name, worst[0], worst[1]);
        assert_true(worst[1] < 0.05);
        light_fixture_finish(&f);
    }
}

/* Lamps cut in half by the horizon of the plane and, in a fisheye, by its rim. */
static void a_lamp_on_the_horizon(void **unused)
{
    (void)unused;
    static const enum gn_projection_type types[] = {
        GN_PROJECTION_LATLONG, GN_PROJECTION_FISHEYE_EQUIDISTANT, GN_PROJECTION_CUBE};
    static const double up[3] = {0, 0, 1}, east[3] = {0.8, 0.6, 0};
    for (size_t t = 0; t < GN_ARRAY_LEN(types); t++) {
        struct light_fixture f;
        double worst = 0;
        assert_int_equal(light_fixture_init(&f, types[t], 128, types[t] ? 128 : 64), 0);
        f.frame.codes = &f.image;
        add_lamp(&f, east, 0.07);
        struct gn_lighting_state *s;
        for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
            const struct gn_light_options options = {.method = (enum gn_light_method)m};
            s = make_state(&f, &options, NULL);
            check_sum(s, &options);
            if (s->n_lights == 0 && m != GN_LIGHT_PARTITION_SEED) // whose strict mean may say so
                fail_msg("%s, %s: no lights", get_name(&options), gn_projection_get_name(types[t]));
            double total = s->map->figures.shown_irradiance[1];
            double off = (get_by_lights(s, up) - get_by_texels(s, up)) / total;
            worst = fmax(worst, m == GN_LIGHT_PARTITION_SEED ? 0 : fabs(off));
            gn_lighting_state_unref(&s);
        }
        print_message("# a lamp on the horizon, %s: the plane's irradiance within %.4f of the "
                      "lamp's\n",
                      gn_projection_get_name(types[t]), worst);
        assert_true(worst < 0.02); // sin of a quarter of the lamp
        light_fixture_finish(&f);
    }
}

/* Equal powers, names of their own, and the same bits in the next frame. */
static void two_identical_suns(void **unused)
{
    (void)unused;
    static const int at[][4] = {{60, 40, 180, 40}, {60, 40, 63, 40}, {0, 62, 255, 62}};
    static const char *const places[] = {"far apart", "beside each other", "across the seam"};
    for (size_t k = 0; k < GN_ARRAY_LEN(at); k++) {
        struct light_fixture f;
        assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 256, 128), 0);
        light_fixture_fill(&f, light_fixture_constant);
        double dir[2][3], worst = 0;
        int n_discs = 0;
        for (int i = 0; i < 2; i++) {
            int x = at[k][2 * i], y = at[k][2 * i + 1];
            for (int c = 0; c < 3; c++)
                gn_image_at(&f.image, x, y)[c] = 1e7f;
            assert_true(gn_projection_get_direction(&f.frame.projection, x + 0.5, y + 0.5, dir[i]));
        }
        for (int i = 0; i < 2 * GN_LIGHT_METHOD_COUNT; i++) {
            struct gn_light_options options = {.method = (enum gn_light_method)(i / 2),
                                               .no_discs = i % 2};
            struct gn_lighting_state *s = make_state(&f, &options, NULL);
            check_sum(s, &options);
            double power[2] = {0}, middle[3];
            for (int c = 0; c < 3; c++)
                middle[c] = dir[0][c] - dir[1][c]; // nearer to which
            for (int l = 0; l < s->n_lights; l++) {
                double side = get_dot(s->lights[l].dir_world, middle);
                power[side < 0] += (double)s->lights[l].irradiance[1];
                for (int j = 0; j < l; j++)
                    assert_true(s->lights[l].id != s->lights[j].id || s->lights[l].id == 0);
            }
            double half = 0.5 * (power[0] + power[1]);
            options.previous = s;
            struct gn_lighting_state *next = make_state(&f, &options, NULL);
            assert_same_lights(next, s);
            worst = fmax(worst, fabs(power[0] - half) / half);
            n_discs += s->figures.n_discs;
            gn_lighting_state_unref(&next);
            gn_lighting_state_unref(&s);
        }
        print_message("# two suns, %s: each has half the light within %.1e\n", places[k], worst);
        assert_true(worst < 1e-3);
        assert_int_equal(n_discs,
                         k == 2 ? 0 : 2 * (GN_LIGHT_METHOD_COUNT - 1)); // touching: no disc
        light_fixture_finish(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_5_a_lamp_at_a_pole_or_on_the_seam),
        cmocka_unit_test(a_lamp_on_the_horizon),
        cmocka_unit_test(two_identical_suns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
