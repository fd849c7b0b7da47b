/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The kernels of each processor give the plain ones' bits; those are what their formulas say. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/render/internal.h"
#include "tests/meshes.h"

#define N_ROUNDS 3000
#define MAX_LIGHTS 37

/** Inputs of all kernels. */
struct inputs {
    float normals[6][LANES];
    float points[3][LANES];
    float dirs[3][MAX_LIGHTS], irradiance[3][MAX_LIGHTS];
    uint16_t mask[MAX_LIGHTS];
    float weights[3][LANES];
    int ends[3];
    struct box box, directions[LANES];
    struct direction_boxes boxes;
    float sides[2][3][LANES]; // min, max of directions, taken for boxes in space
    double matrix[9], slack;
};

/** Of the points that dirs are taken for. */
enum { N_CORNERS = 5 };
static const uint16_t corners[N_CORNERS] = {0, 7, 5, 36, 19};

/** And outputs. */
struct outputs {
    float cosines[LANES];
    unsigned lit, met;
    double sums[3][LANES];
    int32_t cells[LANES];
    unsigned above[2], between, overlaps; // above: with both signs
    float turned[3][LANES];
};

/** Mostly [-1, 1), at times nothing, tiny or huge. */
static float draw(uint64_t *seed)
{
    static const float extremes[8] = {0, -0.0f, 1e-42f, -1e-38f, 1, -1, 1e9f, -3e30f};
    uint64_t r = gn_test_random(seed);
    return r % 16 == 0 ? extremes[r / 16 % 8] : 2 * (float)gn_test_random_unit(seed) - 1;
}

static uint16_t draw_mask(uint64_t *seed)
{
    uint64_t r = gn_test_random(seed);
    return r % 4 == 0 ? 0 : r % 4 == 1 ? 0xffff : (uint16_t)(r >> 16);
}

static void draw_box(uint64_t *seed, struct box *box)
{
    for (int k = 0; k < 3; k++) {
        float a = draw(seed);
        float b = draw(seed);
        box->min[k] = a < b ? a : b;
        box->max[k] = a < b ? b : a;
    }
}

static void fill(uint64_t *seed, struct inputs *in)
{
    for (int i = 0; i < 6 * LANES; i++)
        in->normals[i / LANES][i % LANES] = draw(seed);
    for (int i = 0; i < 3 * LANES; i++) {
        in->points[i / LANES][i % LANES] = draw(seed);
        in->weights[i / LANES][i % LANES] = fabsf(draw(seed));
    }
    for (int l = 0; l < MAX_LIGHTS; l++) {
        for (int k = 0; k < 3; k++) {
            in->dirs[k][l] = draw(seed);
            in->irradiance[k][l] = fabsf(draw(seed));
        }
        in->mask[l] = draw_mask(seed);
    }
    in->ends[0] = 5;
    in->ends[1] = 5; // a part without lights
    in->ends[2] = MAX_LIGHTS;
    draw_box(seed, &in->box);
    for (int i = 0; i < LANES; i++) {
        draw_box(seed, &in->directions[i]);
        gn_directions_set_box(&in->boxes, i, &in->directions[i]);
        for (int k = 0; k < 3; k++) {
            in->sides[0][k][i] = in->directions[i].min[k];
            in->sides[1][k][i] = in->directions[i].max[k];
        }
    }
    for (int i = 0; i < 9; i++)
        in->matrix[i] = (double)draw(seed);
    in->slack = fabs((double)draw(seed));
}

static struct gn_kernel_sum make_sum(const struct inputs *in, int round)
{
    struct gn_kernel_sum sum = {
        .n = round % MAX_LIGHTS,
        .mask = round / 4 % 2 ? in->mask : NULL,
        .unweighted = round / 2 % 2,
        .n_parts = round % 2 ? 3 : 1,
        .ends = in->ends,
        .weights = in->weights[0],
        .weights_stride = LANES,
    };
    for (int k = 0; k < 3; k++) {
        sum.surfaces.shading[k] = in->normals[k];
        sum.surfaces.geometric[k] = in->normals[3 + k];
        sum.dir[k] = in->dirs[k];
        sum.irradiance[k] = in->irradiance[k];
    }
    return sum;
}

static struct gn_kernel_planes make_planes(const struct inputs *in)
{
    struct gn_kernel_planes planes;
    for (int i = 0; i < 6; i++)
        planes.axis[i / 3][i % 3] = in->normals[i];
    for (int i = 0; i < 2; i++)
        planes.offset[i] = in->weights[i];
    return planes;
}

static void run_boxes(const struct gn_kernels *kernels, const struct inputs *in,
                      const float dir[static 3], struct outputs *out)
{
    const float *const p[3] = {in->dirs[0], in->dirs[1], in->dirs[2]};
    const float *const from[3] = {in->points[0], in->points[1], in->points[2]};
    float *const to[3] = {out->turned[0], out->turned[1], out->turned[2]};
    const struct gn_kernel_planes planes = make_planes(in);
    struct gn_kernel_horizons horizons;
    struct gn_kernel_boxes boxes;
    for (int k = 0; k < 3; k++) {
        horizons.org[k] = in->points[k];
        horizons.normal[k] = in->normals[k];
        boxes.min[k] = in->sides[0][k];
        boxes.max[k] = in->sides[1][k];
    }
    for (int i = 0; i < 2; i++)
        out->above[i] = kernels->get_above(&horizons, 1 - 2 * i, p, corners, N_CORNERS, in->slack);
    out->between = kernels->meet_boxes(&boxes, in->box.min, in->box.max, dir);
    out->overlaps = kernels->get_overlaps(&planes, 1, in->box.min, in->box.max);
    kernels->turn(in->matrix, from, to);
}

static void run(const struct gn_kernels *kernels, const struct inputs *in, int round,
                struct outputs *out)
{
    const struct gn_kernel_sum sum = make_sum(in, round);
    const float *const p[3] = {in->points[0], in->points[1], in->points[2]};
    const float dir[3] = {in->dirs[0][0], in->dirs[1][0], in->dirs[2][0]};
    memset(out, 0, sizeof(*out));
    kernels->get_cosines(&sum.surfaces, dir, out->cosines);
    out->lit = kernels->get_lit(&sum.surfaces, dir);
    out->met = kernels->meet(&in->boxes, in->box.min, in->box.max);
    kernels->sum_lights(&sum, out->sums);
    kernels->get_cells(dir, 32, p, out->cells);
    run_boxes(kernels, in, dir, out);
}

static void test_same_bits(void **state)
{
    (void)state;
    int n_kernels = 0;
    while (gn_kernels_get_at(n_kernels))
        print_message("# %s\n", gn_kernels_get_at(n_kernels++)->name);
    assert_ptr_equal(gn_kernels_get(), gn_kernels_get_at(n_kernels - 1));
    struct inputs *in = aligned_alloc(64, (sizeof(*in) + 63) / 64 * 64);
    struct outputs plain;
    struct outputs wide;
    assert_non_null(in);
    uint64_t seed = 21;
    for (int round = 0; round < N_ROUNDS; round++) {
        fill(&seed, in);
        run(gn_kernels_get_at(0), in, round, &plain);
        for (int i = 1; i < n_kernels; i++) {
            run(gn_kernels_get_at(i), in, round, &wide);
            assert_memory_equal(plain.cosines, wide.cosines, sizeof(plain.cosines));
            assert_int_equal(plain.lit, wide.lit);
            assert_int_equal(plain.met, wide.met);
            assert_memory_equal(plain.sums, wide.sums, sizeof(plain.sums));
            assert_memory_equal(plain.cells, wide.cells, sizeof(plain.cells));
            assert_memory_equal(plain.above, wide.above, sizeof(plain.above));
            assert_int_equal(plain.between, wide.between);
            assert_int_equal(plain.overlaps, wide.overlaps);
            assert_memory_equal(plain.turned, wide.turned, sizeof(plain.turned));
        }
    }
    free(in);
}

static bool is_same(double a, double b)
{
    return a == b || (isnan(a) && isnan(b)); // of infinite cosines
}

/** Lane by lane, as the formulas have it. */
static void check_lane(const struct inputs *in, int round, const struct outputs *out, int i)
{
    const struct gn_kernel_sum sum = make_sum(in, round);
    const float s[3] = {in->normals[0][i], in->normals[1][i], in->normals[2][i]};
    const float g[3] = {in->normals[3][i], in->normals[4][i], in->normals[5][i]};
    double sums[3] = {0};
    for (int l = 0; l < sum.n; l++) {
        const float dir[3] = {in->dirs[0][l], in->dirs[1][l], in->dirs[2][l]};
        bool is_lit = dot3(s, dir) > 0 && dot3(g, dir) > 0;
        float w = !is_lit || (sum.mask && !(sum.mask[l] >> i & 1)) ? 0
                  : sum.unweighted                                 ? 1
                                                                   : dot3(s, dir);
        if (sum.n_parts > 1)
            w *= in->weights[l < 5 ? 0 : 2][i];
        for (int k = 0; k < 3; k++) {
            sums[k] += (double)in->irradiance[k][l] * (double)w;
        }
    }
    for (int k = 0; k < 3; k++) {
        assert_true(is_same(sums[k], out->sums[k][i]));
    }
    const float first[3] = {in->dirs[0][0], in->dirs[1][0], in->dirs[2][0]};
    bool is_lit = dot3(s, first) > 0 && dot3(g, first) > 0;
    assert_int_equal(out->lit >> i & 1, is_lit);
    assert_true(out->cosines[i] == (is_lit ? dot3(s, first) : 0));
    const float p[3] = {in->points[0][i], in->points[1][i], in->points[2][i]};
    float cell = dot3(first, p) + 32;
    if (fabsf(cell) < 1e5f)
        assert_int_equal(out->cells[i], (int)cell);
    else
        assert_true(out->cells[i] < 0 || out->cells[i] > 64);
}

static bool is_box_small(const struct box *box)
{
    bool is_small = true;
    for (int k = 0; k < 3; k++)
        is_small &= fabsf(box->min[k]) < 1e12f && fabsf(box->max[k]) < 1e12f;
    return is_small;
}

/** The same of the kernels that leave rays out. Returns which of their answers were yes, as bits.
 */
static unsigned check_boxes(const struct inputs *in, const struct outputs *out, int i)
{
    const float dir[3] = {in->dirs[0][0], in->dirs[1][0], in->dirs[2][0]};
    const struct gn_kernel_planes planes = make_planes(in);
    double highest[2] = {-INFINITY, -INFINITY};
    bool overlaps = true;
    for (size_t j = 0; j < N_CORNERS; j++) {
        double height = 0;
        double size = 0; // what rounding is a share of
        for (int k = 0; k < 3; k++) {
            double n = in->normals[k][i];
            height += n * ((double)in->dirs[k][corners[j]] - in->points[k][i]);
            size += fabs(n * in->dirs[k][corners[j]]) + fabs(n * in->points[k][i]);
        }
        // So near that rounding may say either: as it says.
        if (fabs(fabs(height) - in->slack) <= 1e-14 * (size + in->slack))
            return 0;
        highest[0] = fmax(highest[0], height);
        highest[1] = fmax(highest[1], -height);
    }
    for (int j = 0; j < 2; j++)
        assert_int_equal(out->above[j] >> i & 1, highest[j] > -in->slack);
    for (int j = 0; j < 2; j++) {
        float low = planes.offset[j][i];
        float high = low;
        for (int k = 0; k < 3; k++) {
            float a = planes.axis[j][k][i] * in->box.min[k];
            float b = planes.axis[j][k][i] * in->box.max[k];
            low += a < b ? a : b;
            high += a > b ? a : b;
        }
        overlaps &= high >= 0 && low < 1;
    }
    assert_int_equal(out->overlaps >> i & 1, overlaps);
    bool meets = gn_box_may_meet_from_box(&in->directions[i], &in->box, dir);
    if (is_box_small(&in->directions[i]) && is_box_small(&in->box))
        assert_int_equal(out->between >> i & 1, meets);
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int j = 0; j < 3; j++)
            sum += in->matrix[3 * k + j] * (double)in->points[j][i];
        assert_true(is_same((double)(float)sum, (double)out->turned[k][i]));
    }
    return (out->above[0] >> i & 1) | (out->between >> i & 1) << 1 | (out->overlaps >> i & 1) << 2;
}

static void test_plain_ones_are_the_formulas(void **state)
{
    (void)state;
    struct inputs *in = aligned_alloc(64, (sizeof(*in) + 63) / 64 * 64);
    struct outputs out;
    assert_non_null(in);
    uint64_t seed = 22;
    int n_yes[3] = {0};
    for (int round = 0; round < N_ROUNDS / 10; round++) {
        fill(&seed, in);
        run(gn_kernels_get_at(0), in, round, &out);
        for (int i = 0; i < LANES; i++) {
            check_lane(in, round, &out, i);
            unsigned yes = check_boxes(in, &out, i);
            for (int j = 0; j < 3; j++)
                n_yes[j] += yes >> j & 1;
        }
    }
    for (int j = 0; j < 3; j++) // both answers come
        assert_in_range(n_yes[j], N_ROUNDS / 10 * LANES / 50, N_ROUNDS / 10 * LANES * 49 / 50);
    free(in);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_plain_ones_are_the_formulas),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
