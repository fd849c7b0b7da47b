/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Light that grazes: a coarse mesh with smooth normals has no black triangles where light falls. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>

#include "proto/attr.h"
#include "tests/meshes.h"
#include "tests/stage.h"

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void paint_white(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    (void)dir;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = 2;
}

/* Lights of one sky on a Fibonacci lattice, one of them exactly at the horizon of each axis. */
static void set_sky(struct gn_test_stage *stage)
{
    enum { N = 1024 };
    struct gn_light lights[N] = {0};
    for (int i = 0; i < N; i++) {
        double z = 1 - (2 * i + 1.0) / N, phi = i * M_PI * (3 - sqrt(5));
        lights[i].dir_world[0] = (float)(sqrt(1 - z * z) * cos(phi));
        lights[i].dir_world[1] = (float)(sqrt(1 - z * z) * sin(phi));
        lights[i].dir_world[2] = (float)z;
        for (int k = 0; k < 3; k++)
            lights[i].irradiance[k] = (float)(2 * 4 * M_PI / N);
    }
    gn_test_stage_set_lights(stage, lights, N);
}

/* Least and greatest radiance of pixels that the object covers wholly, their number, and how many
 * of them are black. */
static int get_range(const struct gn_test_stage *stage, double out_range[static 2], int *out_n)
{
    int n_black = 0;
    out_range[0] = INFINITY;
    out_range[1] = *out_n = 0;
    for (int i = 0; i < stage->camera.width * stage->camera.height; i++) {
        const float *v = stage->layers.virtual_rgba.data + 4 * i;
        if (v[3] < 1)
            continue;
        for (int c = 0; c < 3; c++) {
            assert_true(isfinite(v[c]) && v[c] >= 0);
            out_range[0] = fmin(out_range[0], (double)v[c]);
            out_range[1] = fmax(out_range[1], (double)v[c]);
        }
        n_black += v[1] == 0;
        ++*out_n;
    }
    return n_black;
}

static void trap_13_no_black_triangles(void **unused)
{
    (void)unused;
    static const char *const names[] = {"interactive", "reference"};
    static const enum gn_quality qualities[] = {GN_QUALITY_INTERACTIVE, GN_QUALITY_REFERENCE};
    static const double eye[3] = {3, 2, 1.5}, origin[3] = {0, 0, 0};
    for (int rings = 3; rings <= 24; rings *= 2) {
        struct gn_test_stage stage = {0};
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(1, rings), 0, 0, 0,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(&stage, 0);
        gn_test_stage_set_map(&stage, 64, 32, paint_white, NULL);
        gn_test_stage_aim(&stage, 80, 80, 120, eye, origin);
        for (int q = 0; q < 2; q++) {
            const struct gn_render_options options = {.quality = qualities[q]};
            double range[2];
            int n;
            set_sky(&stage);
            gn_test_stage_render(&stage, &options);
            (void)get_range(&stage, range, &n);
            print_message("# a ball of %d rings, even sky, %s: %.4f to %.4f of albedo x radiance\n",
                          rings, names[q], range[0], range[1]);
            assert_true(n > 800 && range[0] > 0.85 && range[1] < 1.02);
        }
        /* All triangles that are seen face a light that stands at the eye. */
        struct gn_light lamp = {.irradiance = {1, 1, 1}};
        double length = sqrt(eye[0] * eye[0] + eye[1] * eye[1] + eye[2] * eye[2]), range[2];
        int n;
        for (int c = 0; c < 3; c++)
            lamp.dir_world[c] = (float)(eye[c] / length);
        gn_test_stage_set_lights(&stage, &lamp, 1);
        const struct gn_render_options options = {.quality = GN_QUALITY_INTERACTIVE};
        gn_test_stage_render(&stage, &options);
        int n_black = get_range(&stage, range, &n);
        print_message(
            "# a ball of %d rings, a light at the eye: up to %.4f, %d pixels of %d black\n", rings,
            range[1], n_black, n);
        // At the outline an interpolated normal may look away from the eye, and so from the light.
        assert_true(n_black < 0.02 * n && range[1] <= 0.5 / M_PI * 1.0001);
        gn_test_stage_finish(&stage);
    }
}

/* A floor that a light meets at a millionth of a radian, or exactly edge on: its share is what its
 * cosine says, and the rest stays. */
static void a_light_on_the_floors_horizon(void **unused)
{
    (void)unused;
    static const double slopes[] = {1e-2, 1e-4, 1e-6, 1e-9, 0, -1e-6};
    static const double eye[3] = {0.5, -4, 3}, origin[3] = {0, 0, 0};
    struct gn_test_stage stage = {0};
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(6, 8), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_cube(0.5f), 0, 0, 0.25,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_white, NULL);
    gn_test_stage_aim(&stage, 64, 64, 90, eye, origin);
    for (size_t k = 0; k < GN_ARRAY_LEN(slopes); k++) {
        const struct gn_light lights[2] = {
            {.dir_world = {0.8f, 0.6f, (float)slopes[k]}, .irradiance = {1e6f, 1e6f, 1e6f}},
            {.dir_world = {0, 0, 1}, .irradiance = {1, 1, 1}},
        };
        const struct gn_render_options options = {.quality = GN_QUALITY_INTERACTIVE};
        gn_test_stage_set_lights(&stage, lights, 2);
        gn_test_stage_render(&stage, &options);
        // Behind the cube the lamp is blocked, the other light is not.
        double behind = 1 / (1 + 1e6 * fmax((double)lights[0].dir_world[2], 0)), worst[2] = {0};
        int n = 0;
        for (int i = 0; i < 64 * 64; i++) {
            double p[3];
            if (stage.layers.virtual_rgba.data[4 * i + 3] > 0)
                continue;
            gn_test_stage_get_point(&stage, i % 64 + 0.5, (int)(i / 64) + 0.5, 0, p);
            double along = 0.8 * p[0] + 0.6 * p[1], across = 0.6 * p[0] - 0.8 * p[1];
            bool is_before = along > 0.6;
            bool is_behind = along < -0.6 && along > -1.2 && fabs(across) < 0.2;
            n += is_behind;
            for (int c = 0; c < 3; c++) {
                double factor = (double)stage.layers.shadow.data[3 * i + c];
                assert_true(factor >= 0 && factor <= 1);
                if (is_before)
                    worst[0] = fmax(worst[0], 1 - factor);
                if (is_behind)
                    worst[1] = fmax(worst[1], fabs(factor - behind));
            }
        }
        print_message("# a light %g above the floor: factors off by %.1e where nothing blocks, by "
                      "%.1e of %.4g where the cube does (%d pixels)\n",
                      slopes[k], worst[0], worst[1], behind, n);
        assert_true(n > 20 && worst[0] < 1e-6 && worst[1] < 1e-4);
    }
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trap_13_no_black_triangles),
        cmocka_unit_test(a_light_on_the_floors_horizon),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
