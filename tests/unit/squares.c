/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Markers and squares in pictures of chance: what OpenCV itself finds, by which it is judged. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/vision/markers.h"
#include "tests/random.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 320, HEIGHT = 240, MAX_FOUND = 64, MAX_QUADS = 1024 };

static uint8_t grey[WIDTH * HEIGHT];

/** What one finder finds. */
struct finds {
    int n, n_unread;
    struct gn_marker_sighting seen[MAX_FOUND];
    double unread[MAX_QUADS][4][2];
};

/** Blotches of 2 to 32 px. */
static void draw_clutter(uint64_t *seed, double strength)
{
    memset(grey, 120, sizeof(grey));
    for (int size = 2; size <= 32; size *= 2)
        for (int y = 0; y < HEIGHT; y += size)
            for (int x = 0; x < WIDTH; x += size) {
                int code = (int)(strength * (gn_test_random_unit(seed) - 0.5));
                for (int v = y; v < y + size && v < HEIGHT; v++)
                    for (int u = x; u < x + size && u < WIDTH; u++)
                        grey[v * WIDTH + u] = (uint8_t)(grey[v * WIDTH + u] + code);
            }
}

/** A turned square of cells on a light margin; no id: of one dark cell. */
static void draw_square(uint64_t *seed, int dictionary, bool is_marker)
{
    uint8_t white[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS] = {0};
    int id = (int)(50 * gn_test_random_unit(seed));
    int side = gn_marker_get_cells(dictionary, id, white);
    double cell = 3 + 7 * gn_test_random_unit(seed), angle = 6.3 * gn_test_random_unit(seed);
    double x = WIDTH * gn_test_random_unit(seed), y = HEIGHT * gn_test_random_unit(seed);
    double narrow = 0.05 + 0.95 * gn_test_random_unit(seed);
    if (!is_marker)
        memset(white, 0, sizeof(white));
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double dx = i % WIDTH - x, dy = i / WIDTH - y;
        double u = (cos(angle) * dx + sin(angle) * dy) / (cell * narrow) + side / 2.0;
        double v = (cos(angle) * dy - sin(angle) * dx) / cell + side / 2.0;
        if (u < -1 || v < -1 || u >= side + 1 || v >= side + 1)
            continue;
        bool is_out = u < 0 || v < 0 || u >= side || v >= side;
        grey[i] = is_out || white[(int)v * side + (int)u] ? 220 : 30;
    }
}

static void find(struct gn_marker_finder *finder, struct finds *out)
{
    assert_int_equal(gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, NULL, MAX_FOUND, out->seen,
                                           &out->n, NULL),
                     0);
    out->n_unread = gn_marker_finder_get_unread(finder, MAX_QUADS, out->unread);
}

/** Whether both are the same square, corner by corner from one on; from the first on: of markers.
 */
static bool is_same(double (*a)[2], double (*b)[2], bool is_marker, double most_px)
{
    for (int turn = 0; turn < (is_marker ? 1 : 4); turn++) {
        double off = 0;
        for (int k = 0; k < 4; k++)
            off = fmax(off, hypot(a[(k + turn) % 4][0] - b[k][0], a[(k + turn) % 4][1] - b[k][1]));
        if (off <= most_px)
            return true;
    }
    return false;
}

/** How many of a's markers b lacks; refinement moves corners by some px. */
static int count_missing(struct finds *a, struct finds *b)
{
    int n = 0;
    for (int i = 0; i < a->n; i++) {
        int k = 0;
        while (k < b->n && !(a->seen[i].id == b->seen[k].id &&
                             is_same(a->seen[i].corners, b->seen[k].corners, true, 8)))
            k++;
        n += k == b->n;
    }
    return n;
}

/** The same of other squares, whose corners nobody moves. */
static int count_missing_unread(struct finds *a, struct finds *b)
{
    int n = 0;
    for (int i = 0; i < a->n_unread; i++) {
        int k = 0;
        while (k < b->n_unread && !is_same(a->unread[i], b->unread[k], false, 0))
            k++;
        n += k == b->n_unread;
    }
    return n;
}

/** OpenCV itself looks where corners are to be refined. */
static void create_both(int dictionary, bool is_small, struct gn_marker_finder **out_finders)
{
    for (int k = 0; k < 2; k++) {
        const struct gn_marker_finder_options options = {.dictionary = dictionary,
                                                         .is_small = is_small,
                                                         .refinement = k ? GN_MARKER_REFINE_SUBPIX
                                                                         : GN_MARKER_REFINE_NONE};
        assert_int_equal(gn_marker_finder_create(&options, &out_finders[k], NULL), 0);
    }
}

/** Not quite all: of squares close to one another another one is kept, and what is hardly legible
 * is read at other points. */
static void what_opencv_finds_is_found(void **state)
{
    (void)state;
    static struct finds ours, theirs;
    uint64_t seed = 3;
    int dictionary = gn_marker_find_dictionary("4x4_50", 6);
    for (int small = 0; small < 2; small++) {
        int n = 0, n_unread = 0, n_more = 0, n_less = 0, n_unread_off = 0;
        struct gn_marker_finder *finders[2] = {NULL};
        create_both(dictionary, small, finders);
        for (int i = 0; i < 24; i++) {
            draw_clutter(&seed, 8 * (i % 6));
            for (int k = 0; k < 6; k++)
                draw_square(&seed, dictionary, k % 3 != 2);
            find(finders[0], &ours);
            find(finders[1], &theirs);
            n += theirs.n;
            n_unread += theirs.n_unread;
            n_more += count_missing(&ours, &theirs);
            n_less += count_missing(&theirs, &ours);
            n_unread_off +=
                count_missing_unread(&ours, &theirs) + count_missing_unread(&theirs, &ours);
        }
        print_message("# %s: OpenCV finds %d markers, we %d others and not %d; of %d other squares "
                      "%d differ\n",
                      small ? "small ones" : "all", n, n_more, n_less, n_unread, n_unread_off);
        assert_true(n > 40 && n_unread > 400);
        assert_true(n_more + n_less <= 1);
        assert_true(n_unread_off <= n_unread / 50);
        for (int k = 0; k < 2; k++)
            gn_marker_finder_destroy(&finders[k]);
    }
}

int main(void)
{
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_opencv_finds_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
