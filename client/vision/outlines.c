/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Suzuki and Abe 1985, algorithm 1: a row-wise scan finds where a border begins, which is followed
 * once around, counterclockwise. Of a border's order nothing is kept but whether a pixel was met,
 * and met as the last one before a hole or the outside.
 */
#include "client/vision/outlines.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum {
    LEFT = 8,
    RIGHT = 24,       // columns beside the picture, which is read eight pixels at once
    MARGIN_CODES = 7, // by which dark is darker than the mean, as OpenCV's markers have it
    MET = 1,
    MET_LAST = 2,
    MAX_SIDES = 6, // of an outline that is given on: a side may yet be laid along another
};

/** Least area of an outline, of the square of its number of points, for it to be looked at at all:
 * a square seen as a rhombus six times as long as it is wide has ten times that. */
static const double min_fill = 0.002;

/**
 * The step from a pixel of a border to the next one, by where one came from and which of the eight
 * neighbours are dark: to the first dark one counterclockwise. Directions count that way, from the
 * right. In one number: how far the next pixel is, times STEP; where one comes from then, times
 * 256; IS_LAST: the pixel to the right was passed, and is not dark.
 */
enum { STEP = 1 << 12, FROM = 7 * 256, IS_LAST = 1 << 11 };

struct gn_outlines {
    int32_t steps[8 * 256]; // [from][dark neighbours]
    int width, height;
    long stride, n_pixels;        // of the three, borders and all
    uint8_t *dark, *around, *met; // [height + 2][stride] 0 or 1; dark neighbours; MET, MET_LAST
    int n_columns;                // there is memory for
    uint16_t *columns;            // sums
    int32_t *sums;
    long n_points, max_points; // of the outlines that are kept, one after another
    int32_t (*points)[2];
    int n_kept, max_kept;
    long *ends; // of each in points
};

/** A border being followed. */
struct border {
    long at; // index of its first pixel
    int x, y;
    bool is_hole;
};

int gn_outlines_create(struct gn_outlines **out_outlines)
{
    struct gn_outlines *o = calloc(1, sizeof(*o));
    *out_outlines = o;
    if (!o)
        return -ENOMEM;
    return 0;
}

void gn_outlines_destroy(struct gn_outlines **outlines)
{
    struct gn_outlines *o = *outlines;
    if (o) {
        free(o->dark);
        free(o->around);
        free(o->met);
        free(o->columns);
        free(o->sums);
        free(o->points);
        free(o->ends);
    }
    free(o);
    *outlines = NULL;
}

static long get_offset(int32_t step)
{
    return step >> 12; // of negative ones too, gcc and clang say
}

static void set_steps(struct gn_outlines *o)
{
    const long w = o->stride, offsets[8] = {1, 1 - w, -w, -w - 1, -1, w - 1, w, w + 1};
    for (int from = 0; from < 8; from++) {
        for (int around = 0; around < 256; around++) {
            int k = 1;
            while (k < 8 && !(around >> ((from + k) & 7) & 1))
                k++;
            int to = (from + k) & 7;
            o->steps[from * 256 + around] =
                (int32_t)(offsets[to] * STEP) + ((to ^ 4) << 8) + (from + k > 8 ? IS_LAST : 0);
        }
    }
}

/** Takes the memory for such a picture and such outlines; what is there is kept. */
static int reserve(struct gn_outlines *o, const struct gn_outlines_options *wanted)
{
    long stride = (wanted->width + LEFT + RIGHT) & ~15L, n = stride * (wanted->height + 2);
    if (n > o->n_pixels) {
        free(o->dark);
        free(o->around);
        free(o->met);
        o->dark = malloc((size_t)n);
        o->around = malloc((size_t)n);
        o->met = malloc((size_t)n);
        o->n_pixels = o->dark && o->around && o->met ? n : 0;
    }
    int n_columns = wanted->width + wanted->window;
    if (n_columns > o->n_columns) {
        free(o->columns);
        free(o->sums);
        o->columns = malloc((size_t)n_columns * sizeof(*o->columns));
        o->sums = malloc((size_t)n_columns * sizeof(*o->sums));
        o->n_columns = o->columns && o->sums ? n_columns : 0;
    }
    o->width = wanted->width;
    o->height = wanted->height;
    if (stride != o->stride) {
        o->stride = stride;
        set_steps(o);
    }
    o->n_points = o->n_kept = 0;
    return o->n_pixels && o->n_columns ? 0 : -ENOMEM;
}

/** Makes room for one more outline. */
static int reserve_outline(struct gn_outlines *o, long max_points)
{
    if (o->n_points + max_points + 1 > o->max_points) {
        long n = 2 * (o->n_points + max_points + 1);
        void *more = realloc(o->points, (size_t)n * sizeof(*o->points));
        if (!more)
            return -ENOMEM;
        o->points = more;
        o->max_points = n;
    }
    if (o->n_kept == o->max_kept) {
        int n = 2 * o->max_kept + 64;
        void *more = realloc(o->ends, (size_t)n * sizeof(*o->ends));
        if (!more)
            return -ENOMEM;
        o->ends = more;
        o->max_kept = n;
    }
    return 0;
}

static const uint8_t *get_row(const struct gn_outlines_options *p, int y)
{
    return p->grey + p->stride * (y < 0 ? 0 : y >= p->height ? p->height - 1 : y);
}

/** One row of dark pixels, by the sums of the window's columns. */
static void mark_row(const uint16_t *restrict columns, int32_t *restrict sums,
                     const uint8_t *restrict grey, int width, int window, uint8_t *restrict dark)
{
    int reach = window / 2, area = window * window, sum = 0, n = 0;
    // All sums from the left end, the outermost columns repeated.
    for (int x = 0; x < reach; x++, sum += columns[0])
        sums[n++] = sum;
    for (int x = 0; x < width; x++) {
        sums[n + x] = sum;
        sum += columns[x];
    }
    n += width;
    for (int x = 0; x <= reach; x++, sum += columns[width - 1])
        sums[n++] = sum;
    // The mean is rounded; the area is odd.
    const int16_t factor = (int16_t)area;
    for (int x = 0; x < width; x++) {
        int16_t limit = (int16_t)(grey[x] + MARGIN_CODES);
        dark[x] = sums[x + window] - sums[x] + area / 2 >= limit * factor;
    }
}

static void mark_dark(struct gn_outlines *o, const struct gn_outlines_options *p)
{
    int reach = p->window / 2, width = p->width;
    uint16_t *restrict columns = o->columns;
    memset(columns, 0, (size_t)width * sizeof(*columns));
    for (int y = -reach; y <= reach; y++) {
        const uint8_t *restrict row = get_row(p, y);
        for (int x = 0; x < width; x++)
            columns[x] = (uint16_t)(columns[x] + row[x]);
    }
    memset(o->dark, 0, (size_t)(o->stride * (p->height + 2)));
    for (int y = 0; y < p->height; y++) {
        mark_row(columns, o->sums, get_row(p, y), width, p->window,
                 o->dark + (y + 1) * o->stride + LEFT);
        const uint8_t *restrict gone = get_row(p, y - reach);
        const uint8_t *restrict come = get_row(p, y + reach + 1);
        for (int x = 0; x < width; x++)
            columns[x] = (uint16_t)(columns[x] + come[x] - gone[x]);
    }
}

static uint64_t load8(const uint8_t *at)
{
    uint64_t eight;
    memcpy(&eight, at, sizeof(eight));
    return eight;
}

/** Which neighbours of the dark pixels are dark, one bit for each direction, eight pixels at once.
 */
static void mark_around(struct gn_outlines *o)
{
    for (int y = 1; y <= o->height; y++) {
        const uint8_t *row = o->dark + y * o->stride + LEFT;
        uint8_t *out = o->around + y * o->stride + LEFT;
        for (int x = 0; x < o->width; x += 8) {
            const uint8_t *here = row + x, *above = here - o->stride, *below = here + o->stride;
            if (load8(here) == 0)
                continue;
            uint64_t bits = load8(here + 1) | load8(above + 1) << 1 | load8(above) << 2 |
                            load8(above - 1) << 3 | load8(here - 1) << 4 | load8(below - 1) << 5 |
                            load8(below) << 6 | load8(below + 1) << 7;
            memcpy(out + x, &bits, sizeof(bits));
        }
    }
}

/** Follows a border once around. Writes its points behind the outlines, at most max + 1 of them,
 * and twice the area that they enclose, of either sign. Returns how many there are. */
static long follow(struct gn_outlines *o, const struct border *b, long max, int64_t *out_area)
{
    // By where one comes from after the step.
    static const int8_t dx[8] = {-1, -1, 0, 1, 1, 1, 0, -1}, dy[8] = {0, 1, 1, 1, 0, -1, -1, -1};
    const uint8_t *restrict around = o->around;
    const int32_t *restrict steps = o->steps;
    uint8_t *restrict met = o->met;
    int32_t(*restrict points)[2] = o->points + o->n_points;
    int x = b->x, y = b->y, from = b->is_hole ? 0 : 4;
    long n = 0, at = b->at;
    int64_t area = 0;
    *out_area = 0;
    if (around[at] == 0) {
        met[at] = MET | MET_LAST;
        return 1;
    }
    // The first dark neighbour clockwise is the border's last pixel.
    do
        from = (from - 1) & 7;
    while (!(around[at] >> from & 1));
    const long last = at + get_offset(steps[((from - 1) & 7) * 256 + (1 << from)]);
    for (int32_t row = from * 256;;) {
        int32_t step = steps[row + around[at]];
        met[at] = (uint8_t)(met[at] | MET | (step & IS_LAST) / (IS_LAST / MET_LAST));
        row = step & FROM;
        long stored = n < max ? n : max;
        points[stored][0] = x;
        points[stored][1] = y;
        n++;
        int direction = row / 256;
        area += (2 * x + dx[direction]) * dy[direction];
        x += dx[direction];
        y += dy[direction];
        long to = at + get_offset(step);
        if (to == b->at && at == last)
            break;
        at = to;
    }
    *out_area = area;
    return n;
}

static int64_t get_square(const int32_t a[static 2], const int32_t b[static 2])
{
    int64_t x = b[0] - a[0], y = b[1] - a[1];
    return x * x + y * y;
}

static int find_farthest(const int32_t (*points)[2], int n, int from)
{
    int64_t most = -1;
    int found = from;
    for (int i = 0; i < n; i++) {
        int64_t square = get_square(points[from], points[i]);
        found = square > most ? i : found;
        most = square > most ? square : most;
    }
    return found;
}

/** The point farthest from the line through points from and to, [from, to), all counted around;
 * -1: none is farther than the tolerance. */
static int find_bend(const int32_t (*points)[2], int n, int from, int to, double tolerance)
{
    const int32_t *a = points[from % n], *b = points[to % n];
    int64_t dx = b[0] - a[0], dy = b[1] - a[1], most = -1;
    int found = -1;
    for (int i = from + 1; i < to; i++) {
        const int32_t *p = points[i < n ? i : i - n];
        int64_t off = llabs((p[1] - a[1]) * dx - (p[0] - a[0]) * dy);
        found = off > most ? i : found;
        most = off > most ? off : most;
    }
    return (double)most * (double)most > tolerance * tolerance * (double)(dx * dx + dy * dy) ? found
                                                                                             : -1;
}

/** Whether Douglas and Peucker's lines along it (1973) are four or a few more. */
static bool is_like_square(const int32_t (*points)[2], int n, double tolerance)
{
    int ends[2 * MAX_SIDES][2], n_open = 2, n_sides = 0, from = 0, to = 0;
    for (int i = 0; i < 3; i++) {
        from = to;
        to = find_farthest(points, n, from);
    }
    if (to < from) {
        int swap = from;
        from = to;
        to = swap;
    }
    ends[0][0] = from;
    ends[0][1] = ends[1][0] = to;
    ends[1][1] = from + n;
    while (n_open > 0 && n_sides + n_open <= MAX_SIDES) {
        int *e = ends[--n_open];
        int bend = find_bend(points, n, e[0], e[1], tolerance);
        if (bend < 0) {
            n_sides++;
            continue;
        }
        ends[n_open + 1][0] = bend;
        ends[n_open + 1][1] = e[1];
        e[1] = bend;
        n_open += 2;
    }
    return n_open == 0 && n_sides >= 4;
}

/** Which of eight pixels begin a border that was not met yet, one bit of each byte: the outer one
 * of something where it is dark and the one left of it is not, a hole's where it is the other way
 * round. */
static uint64_t find_begins(const uint8_t *dark, const uint8_t *met)
{
    uint64_t here = load8(dark), left = load8(dark - 1);
    uint64_t outer = here & ~left & ~load8(met);
    uint64_t hole = ~here & left & ~(load8(met - 1) >> 1);
    return (outer | hole) & UINT64_C(0x0101010101010101);
}

/** Follows one border, and keeps it where it could be a square's. Returns its points or -ENOMEM. */
static long take_border(struct gn_outlines *o, const struct gn_outlines_options *p,
                        const struct border *b)
{
    int64_t area;
    long n = follow(o, b, p->max_points, &area);
    const int32_t(*points)[2] = (const int32_t(*)[2])(o->points + o->n_points);
    if (n < p->min_points || n > p->max_points ||
        (double)llabs(area) < 2 * min_fill * (double)n * (double)n ||
        !is_like_square(points, (int)n, p->tolerance * (double)n))
        return n;
    o->n_points += n;
    o->ends[o->n_kept++] = o->n_points;
    return reserve_outline(o, p->max_points) < 0 ? -ENOMEM : n;
}

/** The borders that begin in eight pixels from x on. Returns their points or -ENOMEM. */
static long take_borders(struct gn_outlines *o, const struct gn_outlines_options *p, int x, int y)
{
    long sum = 0, first = (y + 1) * o->stride + LEFT + x;
    uint64_t begins = find_begins(o->dark + first, o->met + first);
    uint8_t is_begin[8];
    if (begins == 0)
        return 0;
    memcpy(is_begin, &begins, sizeof(is_begin));
    for (int k = 0; k < 8; k++) {
        // Those before it may have met it.
        bool is_hole = !o->dark[first + k];
        int is_met = is_hole ? o->met[first + k - 1] & MET_LAST : o->met[first + k];
        if (!is_begin[k] || is_met)
            continue;
        const struct border b = {first + k - is_hole, x + k - is_hole, y, is_hole};
        long n = take_border(o, p, &b);
        if (n < 0)
            return n;
        sum += n;
    }
    return sum;
}

long gn_outlines_find(struct gn_outlines *o, const struct gn_outlines_options *p)
{
    long sum = 0;
    if (reserve(o, p) < 0 || reserve_outline(o, p->max_points) < 0)
        return -ENOMEM;
    mark_dark(o, p);
    mark_around(o);
    memset(o->met, 0, (size_t)(o->stride * (o->height + 2)));
    for (int y = 0; y < o->height; y++) {
        for (int x = 0; x <= o->width; x += 8) {
            long n = take_borders(o, p, x, y);
            if (n < 0)
                return n;
            sum += n;
        }
    }
    return sum;
}

int gn_outlines_count(const struct gn_outlines *o)
{
    return o->n_kept;
}

const int32_t (*gn_outlines_get(const struct gn_outlines *o, int i, int *out_n))[2]
{
    long first = i > 0 ? o->ends[i - 1] : 0;
    *out_n = (int)(o->ends[i] - first);
    return (const int32_t(*)[2])(o->points + first);
}
