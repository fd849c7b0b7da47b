/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Penrose tiles and F-codes: the known counts and properties of the system. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "server/light/map_samples.h"
#include "server/light/map_table.h"
#include "server/light/penrose.h"
#include "tests/light_fixture.h"

static const double golden = 1.6180339887498949;

/* What is seen of one level of the tiling. */
struct level_sums {
    int level;
    long n_tiles, n_points, n_bad_codes;
    double area;
    struct gn_penrose_tile *points; // may be NULL
};

static double get_area(const struct gn_penrose_tile *tile)
{
    double p[3][2];
    gn_penrose_get_corners(tile, p);
    return 0.5 * fabs((p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) -
                      (p[2][0] - p[0][0]) * (p[1][1] - p[0][1]));
}

static void visit(const struct gn_penrose_tile *tile, struct level_sums *sums)
{
    /* Two neighbouring ones: F_(2l+1) of one level, F_(2l+2) of the next. */
    sums->n_bad_codes += tile->pair[1] == 2 && tile->pair[2] == 1;
    sums->n_bad_codes += tile->code > gn_penrose_fibonacci(2 * tile->level + 2) - 1;
    if (tile->level == sums->level) {
        bool is_point = tile->type <= GN_PENROSE_B;
        if (is_point && sums->points)
            sums->points[sums->n_points] = *tile;
        sums->n_tiles++;
        sums->n_points += is_point;
        sums->area += is_point ? 0 : get_area(tile);
        return;
    }
    struct gn_penrose_tile child[4];
    int n = gn_penrose_split(tile, child);
    for (int i = 0; i < n; i++)
        visit(&child[i], sums);
}

static void levels_have_the_known_counts_and_area(void **unused)
{
    (void)unused;
    static const long counts[14] = {1,    4,    11,    30,    81,    215,    565,
                                    1480, 3875, 10146, 26565, 69551, 182089, 476716};
    double root_area = 0.5 * pow(golden, 3) * sin(acos(-1) / 5) * 4;
    for (int level = 0; level < 14; level++) {
        struct level_sums sums = {.level = level};
        struct gn_penrose_tile root = gn_penrose_get_root(1);
        visit(&root, &sums);
        assert_int_equal(sums.n_tiles, counts[level]);
        assert_int_equal(sums.n_bad_codes, 0);
        assert_near(sums.area / root_area, 1, 1e-9);
        if (level == 11)
            assert_int_equal(sums.n_points, 23183);
    }
}

static int compare_points(const void *a, const void *b)
{
    const struct gn_penrose_tile *p = a, *q = b;
    for (int i = 0; i < 2; i++)
        if (p->p1[i] != q->p1[i])
            return p->p1[i] < q->p1[i] ? -1 : 1;
    return 0;
}

static void points_are_unique_and_codes_even(void **unused)
{
    (void)unused;
    struct level_sums sums = {.level = 11, .points = calloc(23183, sizeof(*sums.points))};
    struct gn_penrose_tile root = gn_penrose_get_root(1);
    assert_non_null(sums.points);
    visit(&root, &sums);
    int decile[10] = {0}, n_inside = 0;
    double limit = (double)gn_penrose_fibonacci(24);
    for (long i = 0; i < sums.n_points; i++) {
        const struct gn_penrose_tile *p = &sums.points[i];
        if (p->p1[0] < 0 || p->p1[0] >= 1 || p->p1[1] < 0 || p->p1[1] >= 1)
            continue;
        n_inside++;
        decile[(int)(10 * (double)p->code / limit)]++;
    }
    for (int i = 0; i < 10; i++)
        assert_true(lround(100 * fabs(10.0 * decile[i] / n_inside - 1)) <= 2); // percent
    assert_int_equal(decile[0], 465);                                          // as known
    assert_int_equal(decile[1], 462);
    qsort(sums.points, (size_t)sums.n_points, sizeof(*sums.points), compare_points);
    for (long i = 0; i < sums.n_points; i++) // equal points would be neighbours within rounding
        for (long j = i + 1;
             j < sums.n_points && sums.points[j].p1[0] - sums.points[i].p1[0] < 1e-9; j++)
            assert_true(fabs(sums.points[j].p1[1] - sums.points[i].p1[1]) > 1e-6);
    free(sums.points);
}

/* A constant importance over the unit square, its samples kept. */
struct even {
    double m;
    int n;
    struct gn_penrose_sample samples[8192];
};

static double get_even(void *context, double x, double y)
{
    const struct even *even = context;
    return x >= 0 && x < 1 && y >= 0 && y < 1 ? even->m : 0;
}

static double get_even_max(void *context, const double low[static 2], const double high[static 2])
{
    (void)low;
    (void)high;
    return ((const struct even *)context)->m;
}

static int keep(void *context, const struct gn_penrose_sample *sample)
{
    struct even *even = context;
    assert_true(even->n < 8192);
    even->samples[even->n++] = *sample;
    return 0;
}

static void sample_even(struct even *even, double m)
{
    *even = (struct even){.m = m};
    const struct gn_penrose_importance importance = {
        .size = 1, .context = even, .get_at = get_even, .get_max = get_even_max};
    assert_int_equal(gn_penrose_sample_domain(&importance, keep, even), 0);
}

static int compare_codes(const void *a, const void *b)
{
    const struct gn_penrose_sample *p = a, *q = b;
    if (p->tile.code != q->tile.code)
        return p->tile.code < q->tile.code ? -1 : 1;
    return p->x != q->x ? (p->x < q->x ? -1 : 1) : (p->y > q->y) - (p->y < q->y);
}

static int compare_paths(const void *a, const void *b)
{
    uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;
    return (p > q) - (p < q);
}

static void samples_nest(void **unused)
{
    (void)unused;
    static struct even few, many;
    for (double m = 100; m < 20000; m *= 1.9) {
        sample_even(&few, m);
        sample_even(&many, 2 * m);
        qsort(many.samples, (size_t)many.n, sizeof(many.samples[0]), compare_codes);
        assert_true(many.n > few.n);
        for (int i = 0; i < few.n; i++)
            assert_non_null(bsearch(&few.samples[i], many.samples, (size_t)many.n,
                                    sizeof(many.samples[0]), compare_codes));
    }
}

static void density_is_known(void **unused)
{
    (void)unused;
    static struct even even;
    for (double m = 400; m < 40000; m *= 1.1) { // about 40 to 4000 samples
        sample_even(&even, m);
        double share = even.n / (GN_PENROSE_DENSITY * m);
        assert_true(fabs(share - 1) < (even.n < 128 ? 0.13 : 0.06));
    }
    sample_even(&even, 70000);
    assert_near(even.n / 70000.0, GN_PENROSE_DENSITY, 0.0005);
}

static void samples_are_taken_at_the_level_required(void **unused)
{
    (void)unused;
    static struct even even;
    int seen[21] = {0};
    sample_even(&even, 20000);
    for (int i = 0; i < even.n; i++) {
        const struct gn_penrose_tile *tile = &even.samples[i].tile;
        int structure = gn_penrose_get_structure(tile);
        assert_int_equal(tile->level, gn_penrose_get_level(20000));
        assert_near(tile->scale, 2 * pow(golden, -tile->level), 1e-12);
        assert_true(tile->direction >= 0 && tile->direction < 20);
        assert_true(structure >= 0 && structure <= 20);
        assert_true((double)tile->code < even.m);
        seen[structure]++;
    }
    int n_seen = 0;
    for (int i = 0; i < 21; i++)
        n_seen += seen[i] > 0;
    assert_true(n_seen >= 9);
}

static void a_code_equal_to_the_importance_is_no_sample(void **unused)
{
    (void)unused;
    static struct even even;
    int n_nearest = 0;
    for (int m = 1; m < 400; m++) {
        sample_even(&even, m);
        for (int i = 0; i < even.n; i++) {
            assert_true(even.samples[i].tile.code < (uint64_t)m);
            n_nearest += even.samples[i].tile.code == (uint64_t)m - 1;
        }
    }
    assert_true(n_nearest > 0);
}

/* m = F_n - 1, F_n, F_n + 1 for all n whose F_n + 1 a double holds, odd n in the middle of a level.
 */
static void levels_and_phases_are_exact_at_fibonacci_numbers(void **unused)
{
    (void)unused;
    assert_int_equal(gn_penrose_get_level(0), 0);
    assert_int_equal(gn_penrose_get_level(376), 6);
    assert_int_equal(gn_penrose_get_level(377), 7);
    for (int n = 2; n <= 78; n++) {
        for (int step = -1; step <= 1; step++) {
            double m = (double)gn_penrose_fibonacci(n) + step;
            int level = 0, phase = gn_penrose_get_phase(m);
            while (!((double)gn_penrose_fibonacci(2 * level + 2) > m))
                level++;
            assert_int_equal(gn_penrose_get_level(m), level);
            assert_true(phase >= 0 && phase < GN_PENROSE_INDICES);
            if (n < 10 || n > 45) // far apart, and still apart in double
                continue;
            if (n % 2 == 0)
                assert_int_equal(phase, step < 0 ? GN_PENROSE_INDICES - 1 : 0);
            else
                assert_int_equal(phase, GN_PENROSE_INDICES / 2);
        }
        double below = nextafter((double)gn_penrose_fibonacci(n), 0);
        assert_true(gn_penrose_get_phase(below) == (n % 2 ? 10 : 20) || n < 10);
    }
    assert_int_equal(gn_penrose_get_level(1e300), GN_PENROSE_LEVEL_MAX);
    assert_int_equal(gn_penrose_get_phase(1e300), GN_PENROSE_INDICES - 1);
    int before = 0; // rises through a level, from the first to the last
    for (double m = 377; m < 987; m += 0.25) {
        int phase = gn_penrose_get_phase(m);
        assert_true(phase == before || phase == before + 1);
        before = phase;
    }
    assert_int_equal(before, GN_PENROSE_INDICES - 1);
}

/* A point's number is its own, and the same under every importance. */
static void points_have_their_own_paths(void **unused)
{
    (void)unused;
    static struct even even;
    static uint64_t path_of[8192];
    static double at[8192][2];
    sample_even(&even, 60000);
    int n = even.n;
    for (int i = 0; i < n; i++) {
        path_of[i] = even.samples[i].tile.path;
        at[i][0] = even.samples[i].x;
        at[i][1] = even.samples[i].y;
        assert_true(i == 0 || path_of[i] != path_of[i - 1]);
    }
    sample_even(&even, 20000);
    for (int i = 0, k = 0; i < even.n; i++, k++) { // the walk has one order
        while (k < n && path_of[k] != even.samples[i].tile.path)
            k++;
        assert_true(k < n);
        assert_true(at[k][0] == even.samples[i].x && at[k][1] == even.samples[i].y);
    }
    qsort(path_of, (size_t)n, sizeof(path_of[0]), compare_paths);
    for (int i = 1; i < n; i++)
        assert_true(path_of[i] > path_of[i - 1]);
}

static void a_hot_texel_gets_its_share(void **unused)
{
    (void)unused;
    struct light_fixture f;
    struct gn_radiance_map *map;
    struct gn_error error = {0};
    assert_int_equal(light_fixture_init(&f, GN_PROJECTION_LATLONG, 1024, 512), 0);
    for (int i = 0; i < 3 * 1024 * 256; i++) // the lower half stays black
        f.image.data[i] = 1;
    f.frame.codes = &f.image;
    double w = gn_projection_get_solid_angle(&f.frame.projection, 300, 100);
    for (int c = 0; c < 3; c++)
        gn_image_at(&f.image, 300, 100)[c] = (float)(2 * acos(-1) / w);
    assert_int_equal(gn_radiance_map_create(&f.frame, NULL, NULL, &map, &error), 0);
    for (int is_relaxed = 0; is_relaxed < 2; is_relaxed++) {
        struct gn_scratch *scratch = gn_scratch_borrow(&map->table->scratch);
        struct gn_map_samples samples = {0};
        struct gn_map_sampling sampling = {.n_wanted = 2000, .is_relaxed = is_relaxed > 0};
        assert_int_equal(gn_map_samples_draw(map, &sampling, scratch, &samples), 0);
        int n_hot = 0;
        for (int i = 0; i < samples.n; i++) {
            n_hot += samples.texel[i] == 100 * 1024 + 300;
            assert_true(samples.texel[i] < 1024 * 256); // nothing where nothing shines
        }
        assert_near((double)n_hot / samples.n, 0.5, 0.01);
        assert_near(samples.n, 2000, 120);
        gn_scratch_give_back(&map->table->scratch, &scratch);
    }
    gn_radiance_map_unref(&map);
    light_fixture_finish(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_have_the_known_counts_and_area),
        cmocka_unit_test(points_are_unique_and_codes_even),
        cmocka_unit_test(samples_nest),
        cmocka_unit_test(density_is_known),
        cmocka_unit_test(samples_are_taken_at_the_level_required),
        cmocka_unit_test(a_code_equal_to_the_importance_is_no_sample),
        cmocka_unit_test(levels_and_phases_are_exact_at_fibonacci_numbers),
        cmocka_unit_test(points_have_their_own_paths),
        cmocka_unit_test(a_hot_texel_gets_its_share),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
