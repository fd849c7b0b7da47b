/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* GGX reflection and glass: energy, densities, Fresnel's numbers. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "server/render/ggx.h"
#include "server/render/glass.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

/* Points of the unit square, per side. */
enum { SIDE = 256 };

static const double roughnesses[] = {0, 0.04, 0.1, 0.3, 0.55, 0.8, 1};
static const double cosines[] = {0.02, 0.1, 0.4, 0.8, 1};

/** A surface about a slanted normal, seen at that cosine. */
static void aim(double cosine, struct gn_surface *surface, float out_dir[static 3])
{
    static const double n[3] = {0.48, -0.6, 0.64};
    static const double t[3] = {0.8, 0, -0.6};
    double sine = sqrt(1 - cosine * cosine);
    for (int k = 0; k < 3; k++) {
        surface->normal_geometric[k] = surface->normal_horizon[k] = surface->normal_shading[k] =
            (float)n[k];
        out_dir[k] = (float)(-cosine * n[k] + sine * t[k]);
    }
    surface->is_front = true;
}

static struct gn_surface make_ggx(double roughness, double metallic, float albedo)
{
    return (struct gn_surface){.material = GN_MATERIAL_GGX,
                               .albedo = {albedo, albedo, albedo},
                               .roughness = (float)roughness,
                               .metallic = (float)metallic,
                               .ior = 1.5f};
}

/** What the reflection sends back of light 1 from all around. */
static double reflect_white(const struct ggx *ggx)
{
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double u[2] = {(i / SIDE + 0.5) / SIDE, (i % SIDE + 0.5) / SIDE};
        float dir[3];
        double weight[3];
        double pdf;
        if (gn_ggx_sample(ggx, u, dir, weight, &pdf))
            sum += weight[1];
    }
    return sum / (SIDE * SIDE);
}

static void test_a_white_surface_sends_all_back(void **state)
{
    (void)state;
    for (size_t r = 0; r < LENGTH(roughnesses); r++) {
        for (size_t c = 0; c < LENGTH(cosines); c++) {
            for (int metallic = 0; metallic <= 1; metallic++) {
                struct gn_surface surface = make_ggx(roughnesses[r], metallic, 1);
                struct ggx ggx;
                float dir[3];
                aim(cosines[c], &surface, dir);
                gn_ggx_init(&surface, dir, &ggx);
                double whole = reflect_white(&ggx);
                assert_float_equal(whole, ggx.reflected[1], 1e-3);
                assert_float_equal(whole + ggx.base[1], 1, 1e-3);
            }
        }
    }
}

static void test_sampling_and_evaluation_agree(void **state)
{
    (void)state;
    for (size_t r = 1; r < LENGTH(roughnesses); r++) {
        for (size_t c = 0; c < LENGTH(cosines); c++) {
            struct gn_surface surface = make_ggx(roughnesses[r], 0.5, 0.6f);
            struct ggx ggx;
            float dir[3];
            aim(cosines[c], &surface, dir);
            gn_ggx_init(&surface, dir, &ggx);
            for (int i = 0; i < 400; i++) {
                const double u[2] = {(i / 20 + 0.5) / 20, (i % 20 + 0.5) / 20};
                float out[3];
                double weight[3], value[3], pdf, pdf_again;
                if (!gn_ggx_sample(&ggx, u, out, weight, &pdf))
                    continue;
                gn_ggx_eval(&ggx, out, value, &pdf_again);
                // The direction is in float: near a narrow lobe's edge that is some of its width.
                double slack = 1e-4 + 1e-6 / (ggx.alpha * ggx.alpha);
                if (slack > 0.02)
                    continue;
                assert_float_equal(pdf_again / pdf, 1, slack);
                for (int k = 0; k < 3; k++)
                    assert_float_equal(value[k] / (weight[k] * pdf), 1, slack);
            }
        }
    }
}

/** Over the sphere the density is the share of directions that are not thrown away. */
static void test_densities_add_up(void **state)
{
    (void)state;
    static const double rough[] = {0.3, 0.6, 1};
    enum { RINGS = 700 };
    for (size_t i = 0; i < LENGTH(rough) * LENGTH(cosines); i++) {
        struct gn_surface surface = make_ggx(rough[i % LENGTH(rough)], 1, 1);
        struct ggx ggx;
        float dir[3];
        double sum = 0, kept = 0;
        aim(cosines[i / LENGTH(rough)], &surface, dir);
        gn_ggx_init(&surface, dir, &ggx);
        for (int j = 0; j < SIDE * SIDE; j++) {
            const double u[2] = {(j / SIDE + 0.5) / SIDE, (j % SIDE + 0.5) / SIDE};
            float out[3];
            double weight[3], pdf;
            kept += gn_ggx_sample(&ggx, u, out, weight, &pdf);
        }
        for (int j = 0; j < RINGS * RINGS; j++) {
            double z = 1 - 2 * (j / RINGS + 0.5) / RINGS;
            double phi = 2 * M_PI * (j % RINGS + 0.5) / RINGS, s = sqrt(1 - z * z);
            const float out[3] = {(float)(s * cos(phi)), (float)(s * sin(phi)), (float)z};
            double value[3], pdf;
            gn_ggx_eval(&ggx, out, value, &pdf);
            sum += pdf * 4 * M_PI / (RINGS * RINGS);
        }
        assert_float_equal(sum, kept / (SIDE * SIDE), 4e-3);
    }
}

static void test_fresnel_has_the_published_values(void **state)
{
    (void)state;
    static const struct {
        double degrees, ratio, share;
    } known[] = {
        {0, 1.5, 0.04},
        {45, 1.5, 0.0502399},        // crown glass in air
        {56.309932, 1.5, 0.0739645}, // Brewster's angle: p is 0
        {80, 1.5, 0.3877044},
        {90, 1.5, 1},
        {0, 1.333, 0.0203733}, // water
        {0, 2.417, 0.1719688}, // diamond
        {0, 1 / 1.5, 0.04},
        {41.9, 1 / 1.5, 1}, // beyond 41.81 degrees all comes back
        {30, 1 / 1.5, 0.0551902},
    };
    for (size_t i = 0; i < LENGTH(known); i++) {
        double cos_i = cos(known[i].degrees * M_PI / 180), cos_t;
        double share = gn_glass_get_fresnel(fmax(cos_i, 0), known[i].ratio, &cos_t);
        assert_float_equal(share, known[i].share, 2e-5);
        double sine = sqrt(1 - cos_i * cos_i) / known[i].ratio; // Snell
        assert_float_equal(cos_t, sine < 1 ? sqrt(1 - sine * sine) : 0, 1e-12);
    }
}

static void test_glass_splits_all_light(void **state)
{
    (void)state;
    const double u[2] = {0.3, 0.6};
    for (int side = 0; side < 2; side++) {
        for (size_t c = 0; c < LENGTH(cosines); c++) {
            struct gn_surface surface = {
                .material = GN_MATERIAL_GLASS, .albedo = {1, 1, 0.5f}, .ior = 1.5f};
            struct glass_ray back, through;
            float dir[3];
            aim(cosines[c], &surface, dir);
            surface.is_front = side;
            gn_glass_split(&surface, dir, u, &back, &through);
            double cos_t;
            double share = gn_glass_get_fresnel(cosines[c], side ? 1.5 : 1 / 1.5, &cos_t);
            assert_float_equal(back.weight[0], share, 1e-4); // the cosine is in float
            assert_float_equal(back.weight[0] + through.weight[0], 1, 1e-6);
            assert_float_equal(through.weight[2], 0.5 * through.weight[1], 1e-6);
            double sines[2] = {0}, cosine[2] = {0};
            for (int k = 0; k < 3; k++) {
                cosine[0] += (double)through.dir[k] * surface.normal_shading[k];
                cosine[1] += (double)back.dir[k] * surface.normal_shading[k];
            }
            sines[0] = sqrt(1 - cosine[0] * cosine[0]);
            sines[1] = sqrt(1 - cosine[1] * cosine[1]);
            assert_float_equal(cosine[1], cosines[c], 1e-5);
            if (through.weight[0] > 0) {
                assert_true(cosine[0] < 0);
                assert_float_equal(sines[0], sines[1] * (side ? 1 / 1.5 : 1.5), 1e-4);
            } else {
                assert_true(!side && sines[1] > 1 / 1.5);
            }
        }
    }
}

static void test_normals_that_look_away_are_turned(void **state)
{
    (void)state;
    static const double away[] = {-0.9, -0.3, 0, 1e-6};
    for (size_t i = 0; i < LENGTH(away); i++) {
        struct gn_surface surface = make_ggx(0.5, 1, 1);
        struct ggx ggx;
        float dir[3];
        aim(away[i], &surface, dir);
        gn_ggx_init(&surface, dir, &ggx);
        double length = 0, seen = 0;
        for (int k = 0; k < 3; k++) {
            length += ggx.wo[k] * ggx.wo[k];
            seen -= ggx.frame[2][k] * dir[k];
        }
        assert_float_equal(length, 1, 1e-6);
        assert_true(seen > 0 && ggx.wo[2] > 0);
        assert_float_equal(reflect_white(&ggx), ggx.reflected[1], 2e-3);
    }
}

/** Lambda of Smith's function by the cosine. */
static double get_lambda(double cosine, double alpha)
{
    return 0.5 * (sqrt(1 + alpha * alpha * (1 / (cosine * cosine) - 1)) - 1);
}

/** One facet's share of what rough glass reflects and lets through, per solid angle of facets. */
static void add_facet(double cosine, double alpha, double ratio, double z, double phi,
                      double out_sums[static 2])
{
    double sine = sqrt(1 - cosine * cosine), s = sqrt(1 - z * z), cos_t;
    double along = sine * s * cos(phi) + cosine * z;
    if (along <= 0)
        return;
    double fresnel = gn_glass_get_fresnel(fmin(along, 1), ratio, &cos_t);
    double d = 1 + (alpha * alpha - 1) * z * z;
    double seen = alpha * alpha / (M_PI * d * d) * along / cosine;
    double reflected = 2 * along * z - cosine; // their z
    double refracted = (along / ratio - cos_t) * z - cosine / ratio;
    double lambda = get_lambda(cosine, alpha);
    if (reflected > 0)
        out_sums[0] += seen * fresnel / (1 + lambda + get_lambda(reflected, alpha));
    if (cos_t > 0 && refracted < 0)
        out_sums[1] += seen * (1 - fresnel) / ((1 + lambda) * (1 + get_lambda(refracted, alpha)));
}

/** Walter et al. 2007, eqs. 20 and 21, summed over all facets, against what is sampled. */
static void test_rough_glass_is_the_sum_of_its_facets(void **state)
{
    (void)state;
    static const double rough[] = {0.5, 0.8, 1};
    enum { RINGS = 600 };
    for (size_t i = 0; i < LENGTH(rough) * LENGTH(cosines) * 2; i++) {
        bool is_front = i % 2;
        double cosine = cosines[i / 2 % LENGTH(cosines)],
               roughness = rough[i / 2 / LENGTH(cosines)];
        double sums[2] = {0}, sampled[2] = {0};
        struct gn_surface surface = {.material = GN_MATERIAL_GLASS,
                                     .albedo = {1, 1, 1},
                                     .roughness = (float)roughness,
                                     .ior = 1.5f};
        float dir[3];
        aim(cosine, &surface, dir);
        surface.is_front = is_front;
        for (int j = 0; j < RINGS * RINGS; j++)
            add_facet(cosine, roughness * roughness, is_front ? 1.5 : 1 / 1.5,
                      (j / RINGS + 0.5) / RINGS, 2 * M_PI * (j % RINGS + 0.5) / RINGS, sums);
        for (int j = 0; j < SIDE * SIDE; j++) {
            const double u[2] = {(j / SIDE + 0.5) / SIDE, (j % SIDE + 0.5) / SIDE};
            struct glass_ray back, through;
            gn_glass_split(&surface, dir, u, &back, &through);
            sampled[0] += back.weight[1] / (SIDE * SIDE);
            sampled[1] += through.weight[1] / (SIDE * SIDE);
        }
        for (int k = 0; k < 2; k++)
            assert_float_equal(sampled[k], sums[k] * 2 * M_PI / (RINGS * RINGS), 2e-3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_white_surface_sends_all_back),
        cmocka_unit_test(test_sampling_and_evaluation_agree),
        cmocka_unit_test(test_densities_add_up),
        cmocka_unit_test(test_fresnel_has_the_published_values),
        cmocka_unit_test(test_glass_splits_all_light),
        cmocka_unit_test(test_normals_that_look_away_are_turned),
        cmocka_unit_test(test_rough_glass_is_the_sum_of_its_facets),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
