/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Markers of so few pixels that their cells run into each other: found, read and placed; lost and
 * found again. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/watch.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 160, HEIGHT = 120, MAX_SIDE = GN_MARKER_MAX_CELLS };

/** Where a marker lies: its middle, its cell in px, turned by an angle, narrowed across. */
struct place {
    double x, y, cell, angle, narrow;
};

static const struct gn_camera camera = {.width = WIDTH,
                                        .height = HEIGHT,
                                        .fx = 200,
                                        .fy = 200,
                                        .cx = 80,
                                        .cy = 60,
                                        .response = {.type = GN_RESPONSE_SRGB},
                                        .world_from_camera = {.rotation = {1, 0, 0, 0}}};

static void get_corner(const struct place *p, int cells, int k, double out[static 2])
{
    double half = cells * p->cell / 2;
    double u = (k == 1 || k == 2 ? half : -half) * p->narrow, v = k >= 2 ? half : -half;
    out[0] = p->x + cos(p->angle) * u - sin(p->angle) * v;
    out[1] = p->y + sin(p->angle) * u + cos(p->angle) * v;
}

/** Whether blotches of 4 to 16 px, as dark and as light as markers, are in the place of paper. */
static bool is_cluttered;

static double get_paper(double x, double y)
{
    double sum = 0;
    for (int size = 4; size <= 16 && is_cluttered; size *= 2) {
        uint64_t seed = (uint64_t)((int)(x + 64) / size * 4096 + (int)(y + 64) / size * 64 + size);
        sum += gn_test_random_unit(&seed) / 3;
    }
    return is_cluttered ? pow(sum, 3) : 0.2;
}

/** Reflectance at a point: the marker, a white margin of a cell, darker paper. */
static double get_light(const struct place *p, const uint8_t *white, int cells, double x, double y)
{
    double dx = x - p->x, dy = y - p->y;
    double u = (cos(p->angle) * dx + sin(p->angle) * dy) / (p->cell * p->narrow) + cells / 2.0;
    double v = (-sin(p->angle) * dx + cos(p->angle) * dy) / p->cell + cells / 2.0;
    if (u < -1 || v < -1 || u >= cells + 1 || v >= cells + 1)
        return get_paper(x, y);
    if (u < 0 || v < 0 || u >= cells || v >= cells)
        return 0.7;
    return white[(int)v * cells + (int)u] ? 0.7 : 0.04;
}

/** As a lens of 0.5 px (the points' normal spread) and square pixels see it, in sRGB codes. */
static void shoot(const struct place *p, const uint8_t *white, int cells, uint8_t *out)
{
    enum { N = 25 };
    static const double spread[4] = {-0.6, -0.2, 0.2, 0.6}; // px, 0.45 RMS with the pixel's square
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double sum = 0, far = hypot(i % WIDTH - p->x, i / WIDTH - p->y) - 3;
        int n = far < p->cell * (cells / 2.0 + 1) * 1.42 ? N * 16 : 1; // all one paper beyond
        for (int k = 0; k < n; k++) {
            int at = k % N;
            double x = i % WIDTH + (at % 5 + 0.5) / 5 + spread[k / N % 4];
            double y = i / WIDTH + (at / 5 + 0.5) / 5 + spread[k / N / 4];
            sum += get_light(p, white, cells, x, y);
        }
        out[i] = (uint8_t)lround(255 * gn_response_encode(&camera.response, (float)(sum / n)));
    }
}

static struct gn_grey get_grey(const uint8_t *pixels)
{
    struct gn_grey grey = {.pixels = pixels, .width = WIDTH, .height = HEIGHT};
    for (int i = 0; i < 256; i++)
        grey.linear[i] = gn_response_decode(&camera.response, (float)i / 255.0F);
    return grey;
}

/** Looks for these ids in the picture of one marker. */
static void look(const char *dictionary, const struct place *p, int id, const int *ids, int n_ids,
                 bool with_small, struct gn_search_finds *out)
{
    static uint8_t pixels[WIDTH * HEIGHT];
    uint8_t white[MAX_SIDE * MAX_SIDE];
    struct gn_search *search = NULL;
    const struct gn_search_options options = {
        .camera = &camera,
        .dictionary = gn_marker_find_dictionary(dictionary, strlen(dictionary)),
        .ids = ids,
        .n_ids = n_ids};
    int cells = gn_marker_get_cells(options.dictionary, id, white);
    shoot(p, white, cells, pixels);
    const struct gn_grey grey = get_grey(pixels);
    assert_int_equal(gn_search_create(&options, &search, NULL), 0);
    assert_int_equal(
        gn_search_find(search, &grey, NULL,
                       with_small ? GN_SEARCH_WHOLE | GN_SEARCH_SMALL : GN_SEARCH_WHOLE, out, NULL),
        0);
    gn_search_destroy(&search);
}

static const struct {
    const char *dictionary;
    int id, cells;
    struct place place;
} cases[] = {
    {"apriltag_36h11", 7, 8, {80.3, 60.8, 1.4, 0.12, 1}},
    {"apriltag_36h11", 41, 8, {71.2, 55.1, 1.5, -0.5, 1}},
    {"apriltag_36h11", 23, 8, {60.9, 70.6, 2.2, 2.9, 0.62}},
    {"6x6_250", 101, 8, {90.4, 50.2, 1.6, 1.3, 0.9}},
    {"5x5_100", 3, 7, {99.7, 61.5, 1.5, 0.4, 1}},
    {"4x4_50", 11, 6, {64.5, 44.4, 1.7, -2.1, 1}},
};

static void found_read_and_placed(void **state)
{
    (void)state;
    static struct gn_search_finds finds;
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        double worst = 0;
        look(cases[i].dictionary, &cases[i].place, cases[i].id, &cases[i].id, 1, true, &finds);
        assert_int_equal(finds.n_found, 1);
        assert_int_equal(finds.found[0].id, cases[i].id);
        for (int k = 0; k < 4; k++) {
            double corner[2];
            get_corner(&cases[i].place, cases[i].cells, k, corner);
            worst = fmax(worst, hypot(finds.found[0].corners[k][0] - corner[0],
                                      finds.found[0].corners[k][1] - corner[1]));
        }
        print_message("# %s, cells of %.1f px: corners to %.3f px\n", cases[i].dictionary,
                      cases[i].place.cell * cases[i].place.narrow, worst);
        assert_true(worst < 0.15);
    }
}

static void smallest_by_a_closer_look(void **state)
{
    (void)state;
    static struct gn_search_finds finds;
    int n[2] = {0};
    for (int i = 0; i < 10; i++) {
        const int id = 30 + i;
        const struct place place = {70.2 + 0.9 * i, 60.7 - 0.3 * i, 1.35, 0.3 * i, 0.95};
        for (int k = 0; k < 2; k++) {
            look("apriltag_36h11", &place, id, &id, 1, k == 1, &finds);
            n[k] += finds.n_found;
        }
    }
    print_message("# cells of 1.3 px: %d of 10 found, %d at the first look\n", n[1], n[0]);
    assert_true(n[1] == 10 && n[0] < 10);
}

static void only_ids_that_are_looked_for(void **state)
{
    (void)state;
    static struct gn_search_finds finds;
    int others[200], n = 0;
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        n = 0;
        for (int id = 0; id < 50; id++)
            if (id != cases[i].id)
                others[n++] = id;
        look(cases[i].dictionary, &cases[i].place, cases[i].id, others, n, true, &finds);
        for (int k = 0; k < finds.n_found; k++)
            assert_int_equal(finds.found[k].id, cases[i].id); // as OpenCV reads it
    }
}

static void at_the_border_too(void **state)
{
    (void)state;
    static struct gn_search_finds finds;
    const int id = 5;
    const struct place place = {30, 8 * 5 / 2.0 + 1, 5, 0.02, 1};
    look("apriltag_36h11", &place, id, &id, 1, false, &finds);
    assert_int_equal(finds.n_found, 1);
}

/** What is shown to a watch: pictures with a marker and without it. */
struct show {
    const uint8_t *with, *without;
    double rate_hz;
    bool is_live;
};

/** What came of it: for how long, s, the marker was in sight before it was seen; how many of the
 * empty pictures were searched, how often these were looked at, all in all and one at most. */
struct outcome {
    double late_s;
    int n_searched, n_looks, most_looks;
};

/** The marker for three pictures, none for so many, and then again. */
static struct outcome lose_and_find(const struct show *show, int n_without)
{
    static struct gn_bodies bodies;
    struct gn_watch *watch = NULL;
    struct gn_watch_counts counts = {0}, before, begun = {0};
    struct outcome out = {0};
    const struct gn_grey seen = get_grey(show->with), empty = get_grey(show->without);
    assert_int_equal(gn_bodies_read_text("apriltag_36h11:33:0.05", &bodies, NULL), 0);
    assert_int_equal(gn_watch_create(&camera, &bodies, show->is_live, &watch, NULL), 0);
    int i = 0, n_seen = 0, n_late = 0;
    for (; i < 3 + n_without; i++) {
        int64_t time_ns = llround(1e9 * i / show->rate_hz);
        before = counts;
        assert_int_equal(gn_watch_update(watch, i < 3 ? &seen : &empty, time_ns, NULL), 0);
        (void)gn_watch_get_sightings(watch, &n_seen);
        assert_int_equal(n_seen, i < 3);
        gn_watch_get_counts(watch, &counts);
        begun = i < 3 ? counts : begun;
        if (i > 3 + 0.5 * show->rate_hz + 1)
            out.most_looks = (int)fmax(out.most_looks, (double)(counts.n_looks - before.n_looks));
    }
    out.n_searched = (int)(counts.n_searched_whole - begun.n_searched_whole);
    out.n_looks = (int)(counts.n_looks - begun.n_looks);
    for (; n_seen == 0 && n_late < show->rate_hz; i++, n_late++) {
        assert_int_equal(gn_watch_update(watch, &seen, llround(1e9 * i / show->rate_hz), NULL), 0);
        (void)gn_watch_get_sightings(watch, &n_seen);
    }
    out.late_s = (n_late - 1) / show->rate_hz;
    gn_watch_destroy(&watch);
    gn_bodies_finish(&bodies);
    return out;
}

static const double rates_hz[] = {15, 24, 25, 30, 60};
static const struct place places[2] = {{72.9, 59.8, 4, 0.9, 0.95}, {72.9, 59.8, 1.35, 0.9, 0.95}};
static uint8_t shots[2][WIDTH * HEIGHT], empty_shot[WIDTH * HEIGHT];

static void shoot_all(bool with_clutter)
{
    static const struct place nowhere = {-100, -100, 1, 0, 1};
    uint8_t white[MAX_SIDE * MAX_SIDE];
    int cells = gn_marker_get_cells(gn_marker_find_dictionary("apriltag_36h11", 14), 33, white);
    is_cluttered = with_clutter;
    shoot(&nowhere, white, cells, empty_shot);
    for (int k = 0; k < 2; k++)
        shoot(&places[k], white, cells, shots[k]);
    is_cluttered = false;
}

static void lost_ones_are_found_in_a_third_of_a_second(void **state)
{
    (void)state;
    shoot_all(false);
    for (int k = 0; k < 2; k++) {
        double longest_s = 0;
        for (size_t i = 0; i < GN_ARRAY_LEN(rates_hz); i++) {
            const struct show show = {shots[k], empty_shot, rates_hz[i], false};
            int n_second = (int)rates_hz[i];
            for (int phase = 0; phase < 10; phase++) {
                struct outcome o = lose_and_find(&show, n_second + phase);
                longest_s = fmax(longest_s, o.late_s);
                // All for half a second, then at most 7 in one.
                assert_true(o.n_searched <=
                            0.5 * rates_hz[i] + 2 + 7 * (0.5 + phase / rates_hz[i]));
            }
            // Soon after it was lost each picture is searched.
            struct outcome o = lose_and_find(&show, n_second / 3);
            assert_int_equal(o.n_searched, n_second / 3);
            assert_true(o.late_s == 0 || (k == 1 && o.late_s <= 0.134));
        }
        print_message("# cells of %.1f px: seen again after %.3f s at most\n", places[k].cell,
                      longest_s);
        assert_true(longest_s <= (k == 1 ? 0.3334 : 0.2001));
    }
}

static void live_pictures_share_the_search(void **state)
{
    (void)state;
    for (int clutter = 0; clutter < 2; clutter++) {
        shoot_all(clutter == 1);
        for (int k = 0; k < 2; k++) {
            double longest_s = 0;
            for (size_t i = 0; i < GN_ARRAY_LEN(rates_hz); i++) {
                const struct show show = {shots[k], empty_shot, rates_hz[i], true};
                int n_before = 4 * (int)(0.5 * rates_hz[i] + 2);
                for (int phase = 0; phase < 12; phase += 3) {
                    int n = (int)rates_hz[i] + phase;
                    struct outcome o = lose_and_find(&show, n);
                    longest_s = fmax(longest_s, o.late_s);
                    // The first half second as ever, then one look each 100 ms.
                    assert_int_equal(o.most_looks, 1);
                    assert_true(o.n_looks <= n_before + (n / rates_hz[i] - 0.5) / 0.1 + 1);
                }
            }
            print_message("# %s, live, cells of %.1f px: seen again after %.3f s at most\n",
                          clutter ? "clutter" : "plain", places[k].cell, longest_s);
            assert_true(longest_s <= (k == 1 ? 0.4168 : 0.2001));
        }
    }
}

int main(void)
{
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(found_read_and_placed),
        cmocka_unit_test(smallest_by_a_closer_look),
        cmocka_unit_test(only_ids_that_are_looked_for),
        cmocka_unit_test(at_the_border_too),
        cmocka_unit_test(lost_ones_are_found_in_a_third_of_a_second),
        cmocka_unit_test(live_pictures_share_the_search),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
