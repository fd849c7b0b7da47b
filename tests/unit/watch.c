/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Which markers are seen from picture to picture: followed, looked for again, never guessed. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/track/watch.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"
#include "tests/unit/paper.h"

enum { WIDTH = GN_PAPER_WIDTH, HEIGHT = GN_PAPER_HEIGHT };

static const int64_t frame_ns = INT64_C(20000000);
static const struct gn_camera camera = {.width = WIDTH,
                                        .height = HEIGHT,
                                        .fx = 250,
                                        .fy = 250,
                                        .cx = 120,
                                        .cy = 80,
                                        .world_from_camera = {.rotation = {1, 0, 0, 0}}};

/** A watch for markers 7 and 9. */
static struct gn_watch *create_for(bool is_live)
{
    static struct gn_body_marker markers[2] = {{.id = 7}, {.id = 9}};
    static const struct gn_bodies bodies = {
        .n_bodies = 1, .bodies = {{.name = "world", .n_markers = 2, .markers = markers}}};
    struct gn_watch *watch = NULL;
    assert_int_equal(gn_watch_create(&camera, &bodies, is_live, &watch, NULL), 0);
    return watch;
}

static struct gn_watch *create(void)
{
    return create_for(false);
}

/** Shows it what is drawn; returns how many markers it sees. */
static int show(struct gn_watch *watch, int64_t time_ns)
{
    const struct gn_grey grey = gn_paper_get_grey();
    int n = -1;
    assert_int_equal(gn_watch_update(watch, &grey, time_ns, NULL), 0);
    (void)gn_watch_get_sightings(watch, &n);
    return n;
}

static struct gn_watch_counts get_counts(const struct gn_watch *watch)
{
    struct gn_watch_counts counts;
    gn_watch_get_counts(watch, &counts);
    return counts;
}

static void one_that_is_there_twice_tells_nothing(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    int n;
    gn_paper_clear();
    gn_paper_put(7, 20, 20, 8);
    gn_paper_put(7, 90, 70, 8);
    gn_paper_put(9, 160, 20, 8);
    assert_int_equal(show(watch, 0), 1);
    assert_int_equal(gn_watch_get_sightings(watch, &n)->id, 9);
    gn_watch_destroy(&watch);
}

/** Found by both looks, for large and for small ones, it is still one. */
static void each_is_seen_once_and_small_ones_beside_large(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    gn_paper_clear();
    gn_paper_put(7, 30.3, 40.6, 3);
    assert_int_equal(show(watch, 0), 1);
    gn_watch_destroy(&watch);
    gn_paper_put(9, 151.01, 60.41, 1.2); // which the look for large ones misses
    watch = create();
    assert_int_equal(show(watch, 0), 2);
    gn_watch_destroy(&watch);
}

static void what_moves_evenly_is_followed(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    for (int i = 0; i < 14; i++) { // 9 px a picture: edges are measured within 3 px
        gn_paper_clear();
        gn_paper_put(7, 10.2 + 9 * i, 20.4 + 4 * i, 8);
        assert_int_equal(show(watch, i * frame_ns), 1);
        int n;
        const double *corner = gn_watch_get_sightings(watch, &n)->corners[0];
        assert_true(fabs(corner[0] - 10.2 - 9 * i) < 0.1 && fabs(corner[1] - 20.4 - 4 * i) < 0.1);
    }
    // The first is searched, and the second, whose step is not known.
    assert_true(get_counts(watch).n_followed >= 12 - 1);
    gn_watch_destroy(&watch);
}

static void what_leaps_is_looked_for_near_by(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    gn_paper_clear();
    gn_paper_put(7, 60, 50, 8);
    assert_int_equal(show(watch, 0), 1);
    gn_paper_clear();
    gn_paper_put(7, 80, 64, 8);
    assert_int_equal(show(watch, frame_ns), 1);
    assert_int_equal(get_counts(watch).n_searched_whole, 1);
    gn_watch_destroy(&watch);
}

static void a_second_one_is_found_beside_the_followed(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    gn_paper_clear();
    gn_paper_put(7, 30, 40, 8);
    for (int i = 0; i < 10; i++)
        assert_int_equal(show(watch, i * frame_ns), 1);
    assert_true(get_counts(watch).n_followed >= 8);
    gn_paper_put(9, 150, 60, 8);
    int n_late = 0;
    while (n_late < 30 && show(watch, (10 + n_late) * frame_ns) < 2)
        n_late++;
    assert_in_range(n_late, 1, 15);
    gn_watch_destroy(&watch);
}

/** As a recording's that begins again. */
static void times_that_go_back_are_no_reason_to_wait(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    gn_paper_clear();
    assert_int_equal(show(watch, INT64_C(60000000000)), 0);
    gn_paper_put(7, 30, 40, 8);
    assert_int_equal(show(watch, 0), 1);
    gn_watch_destroy(&watch);
}

/** Live, a second of nothing: the search is shared from here on. Returns the next picture's time.
 */
static int64_t show_nothing(struct gn_watch *watch)
{
    gn_paper_clear();
    for (int i = 0; i < 50; i++)
        assert_int_equal(show(watch, i * frame_ns), 0);
    return 50 * frame_ns;
}

static void where_a_share_finds_one_all_is_searched_next(void **state)
{
    (void)state;
    struct gn_watch *watch = create_for(true);
    int64_t time_ns = show_nothing(watch);
    int n = 0;
    gn_paper_put(7, 30.3, 40.6, 8);
    gn_paper_put(9, 151.01, 60.41, 1.2); // which no share finds that finds the other
    for (int i = 0; i < 20 && n == 0; i++, time_ns += frame_ns)
        n = show(watch, time_ns);
    assert_int_equal(n, 1);
    assert_int_equal(show(watch, time_ns), 2);
    gn_watch_destroy(&watch);
}

static void shares_tell_of_other_dictionaries_and_times_that_go_back(void **state)
{
    (void)state;
    struct gn_watch *watch = create_for(true);
    struct gn_foreign_finds finds;
    uint8_t white[GN_PAPER_MAX_CELLS];
    int64_t time_ns = show_nothing(watch);
    int side = gn_marker_get_cells(gn_marker_find_dictionary("6x6_250", 7), 100, white);
    gn_paper_put_cells(white, side, 140, 40, 8, 20);
    assert_false(gn_watch_get_foreign(watch, &finds));
    for (int i = 0; i < 21; i++, time_ns += frame_ns)
        assert_int_equal(show(watch, time_ns), 0);
    assert_true(gn_watch_get_foreign(watch, &finds));
    assert_int_equal(finds.ids[0], 100);
    gn_paper_put(7, 30, 40, 8);
    assert_int_equal(show(watch, 0), 1);
    gn_watch_destroy(&watch);
}

static void others_of_the_dictionary_are_told_and_then_no_other_dictionary(void **state)
{
    (void)state;
    struct gn_watch *watch = create();
    struct gn_foreign_finds finds;
    uint8_t white[GN_PAPER_MAX_CELLS];
    gn_paper_clear();
    gn_paper_put(3, 30, 40, 8);
    int side = gn_marker_get_cells(gn_marker_find_dictionary("6x6_250", 7), 100, white);
    gn_paper_put_cells(white, side, 140, 40, 8, 20);
    assert_int_equal(show(watch, 0), 0);
    assert_int_equal(gn_watch_get_strangers(watch)->n_ids, 1);
    assert_int_equal(gn_watch_get_strangers(watch)->ids[0], 3);
    assert_false(gn_watch_get_foreign(watch, &finds));
    gn_paper_clear();
    gn_paper_put_cells(white, side, 140, 40, 8, 20);
    assert_int_equal(show(watch, 20 * frame_ns), 0);
    assert_int_equal(gn_watch_get_strangers(watch)->n_ids, 0);
    assert_true(gn_watch_get_foreign(watch, &finds));
    assert_int_equal(finds.ids[0], 100);
    gn_watch_destroy(&watch);
}

/** A square is read as a marker only where its cells are that marker's, each of them. */
static void no_square_is_read_as_what_it_is_not(void **state)
{
    (void)state;
    enum { N = 2000, N_IDS = 50 };
    int ids[N_IDS], n_read = 0;
    struct gn_reader *reader = NULL;
    const struct gn_grey grey = gn_paper_get_grey();
    uint64_t random = 5;
    for (int i = 0; i < N_IDS; i++)
        ids[i] = i;
    assert_int_equal(gn_reader_create(0, ids, N_IDS, &reader), 0);
    for (int i = 0; i < N + N_IDS; i++) {
        uint8_t white[36] = {0}, listed[GN_PAPER_MAX_CELLS];
        struct gn_marker_sighting seen;
        double corners[4][2] = {{40, 40}, {52, 40}, {52, 52}, {40, 52}};
        int n_wrong = 0;
        for (int k = 0; k < 16; k++)
            white[6 * (k / 4 + 1) + k % 4 + 1] = gn_test_random_unit(&random) < 0.5;
        if (i >= N)
            (void)gn_marker_get_cells(0, i - N, white);
        gn_paper_clear();
        gn_paper_put_cells(white, 6, 40, 40, 2, 20);
        if (!gn_reader_read(reader, &grey, corners, &seen)) {
            assert_true(i < N);
            continue;
        }
        n_read++;
        (void)gn_marker_get_cells(0, seen.id, listed);
        for (int k = 0; k < 36; k++) { // of the listed cells, as the corners say that they lie
            double u = (k % 6 + 0.5) / 6, v = (k / 6 + 0.5) / 6, px[2];
            gn_quad_map(seen.corners, u, v, px);
            n_wrong += listed[k] != white[6 * ((int)(px[1] - 40) / 2) + (int)(px[0] - 40) / 2];
        }
        assert_int_equal(n_wrong, 0);
    }
    print_message("# %d squares of chance and %d markers: %d read\n", N, N_IDS, n_read);
    gn_reader_destroy(&reader);
}

static void what_is_hardly_darker_than_paper_is_not_read(void **state)
{
    (void)state;
    const int id = 7;
    struct gn_reader *reader = NULL;
    const struct gn_grey grey = gn_paper_get_grey();
    uint8_t white[GN_PAPER_MAX_CELLS];
    struct gn_marker_sighting seen;
    assert_int_equal(gn_reader_create(0, &id, 1, &reader), 0);
    (void)gn_marker_get_cells(0, id, white);
    for (int darker = 4; darker <= 8; darker += 4) { // 0.016 and 0.031 of full scale
        double corners[4][2] = {{40, 40}, {52, 40}, {52, 52}, {40, 52}};
        gn_paper_clear();
        gn_paper_put_cells(white, 6, 40, 40, 2, 204 - darker);
        assert_int_equal(gn_reader_read(reader, &grey, corners, &seen), darker == 8);
    }
    gn_reader_destroy(&reader);
}

/** One square of a picture in which nothing else is. */
static void show_square(struct gn_foreign *foreign, const uint8_t *white, int side)
{
    double quads[1][4][2] = {{{40, 40},
                              {40 + 4.0 * side, 40},
                              {40 + 4.0 * side, 40 + 4.0 * side},
                              {40, 40 + 4.0 * side}}};
    gn_paper_clear();
    gn_paper_put_cells(white, side, 40, 40, 4, 20);
    const struct gn_grey grey = gn_paper_get_grey();
    gn_foreign_look(foreign, &grey, quads, 1);
}

/** Squares with 16 cells are often some marker of 1000 by chance: seen once, they are none. */
static void markers_of_other_dictionaries_are_told_when_certain(void **state)
{
    (void)state;
    static const struct {
        const char *dictionary;
        int id, n_pictures; // that show it
        int n_before;       // that show nothing
        bool is_told;
    } cases[] = {{"4x4_1000", 700, 1, 0, false}, {"4x4_1000", 700, 2, 0, true},
                 {"4x4_50", 11, 1, 0, true},     {"4x4_50", 11, 1, 1, false},
                 {"4x4_50", 11, 2, 1, true},     {"6x6_1000", 700, 1, 1, true}};
    const uint8_t nothing[36] = {0};
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_foreign *foreign = NULL;
        struct gn_foreign_finds finds;
        uint8_t white[GN_PAPER_MAX_CELLS];
        const char *name = cases[i].dictionary;
        int dictionary = gn_marker_find_dictionary(name, strlen(name));
        int side = gn_marker_get_cells(dictionary, cases[i].id, white);
        assert_int_equal(gn_foreign_create(&foreign), 0);
        for (int k = 0; k < cases[i].n_before; k++)
            show_square(foreign, nothing, 6);
        for (int k = 0; k < cases[i].n_pictures; k++)
            show_square(foreign, white, side);
        assert_int_equal(gn_foreign_get(foreign, &finds), cases[i].is_told);
        assert_true(!cases[i].is_told || (finds.n_ids == 1 && finds.ids[0] == cases[i].id &&
                                          finds.dictionary == dictionary));
        // With a white cell in its border it is none.
        gn_foreign_destroy(&foreign);
        assert_int_equal(gn_foreign_create(&foreign), 0);
        white[side - 1] = 1;
        for (int k = 0; k < 3; k++)
            show_square(foreign, white, side);
        assert_false(gn_foreign_get(foreign, &finds));
        gn_foreign_destroy(&foreign);
    }
}

int main(void)
{
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_that_is_there_twice_tells_nothing),
        cmocka_unit_test(each_is_seen_once_and_small_ones_beside_large),
        cmocka_unit_test(what_moves_evenly_is_followed),
        cmocka_unit_test(what_leaps_is_looked_for_near_by),
        cmocka_unit_test(a_second_one_is_found_beside_the_followed),
        cmocka_unit_test(times_that_go_back_are_no_reason_to_wait),
        cmocka_unit_test(where_a_share_finds_one_all_is_searched_next),
        cmocka_unit_test(shares_tell_of_other_dictionaries_and_times_that_go_back),
        cmocka_unit_test(others_of_the_dictionary_are_told_and_then_no_other_dictionary),
        cmocka_unit_test(no_square_is_read_as_what_it_is_not),
        cmocka_unit_test(what_is_hardly_darker_than_paper_is_not_read),
        cmocka_unit_test(markers_of_other_dictionaries_are_told_when_certain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
