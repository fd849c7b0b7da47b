/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/foreign.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "client/vision/markers.h"

enum { MAX_CELLS = GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS, MAX_READ = 64 };

/** Least difference of linear light between black and white, of full scale. */
static const double min_contrast = 0.02;

/** Dictionaries of which the smaller ones are the beginning. */
static const char *const families[][4] = {
    {"4x4_50", "4x4_100", "4x4_250", "4x4_1000"},
    {"5x5_50", "5x5_100", "5x5_250", "5x5_1000"},
    {"6x6_50", "6x6_100", "6x6_250", "6x6_1000"},
    {"7x7_50", "7x7_100", "7x7_250", "7x7_1000"},
    {"aruco_original"},
    {"apriltag_16h5"},
    {"apriltag_25h9"},
    {"apriltag_36h10"},
    {"apriltag_36h11"},
};
enum { N_FAMILIES = GN_ARRAY_LEN(families) };

/** A family's markers. */
struct book {
    int cells, n_ids;
    uint64_t *codes; // of their inner cells, as they stand
};

/** A marker that was read. */
struct read {
    int family, id, n_pictures;
    bool is_in_last;
};

struct gn_foreign {
    struct book books[N_FAMILIES];
    int n_pictures; // looked at
    int n_read;
    struct read read[MAX_READ];
};

static int find_dictionary(const char *name)
{
    return gn_marker_find_dictionary(name, strlen(name));
}

static int get_largest(int family)
{
    int k = 3;
    while (!families[family][k])
        k--;
    return find_dictionary(families[family][k]);
}

/** The inner cells as bits; at most 49. */
static uint64_t pack(const uint8_t *white, int n)
{
    uint64_t code = 0;
    for (int y = 1; y < n - 1; y++)
        for (int x = 1; x < n - 1; x++)
            code = code << 1 | white[y * n + x];
    return code;
}

int gn_foreign_create(struct gn_foreign **out_foreign)
{
    *out_foreign = NULL;
    struct gn_foreign *f = calloc(1, sizeof(*f));
    for (int i = 0; f && i < N_FAMILIES; i++) {
        struct book *b = &f->books[i];
        uint8_t white[MAX_CELLS];
        int dictionary = get_largest(i);
        b->n_ids = gn_marker_count_ids(dictionary);
        b->codes = calloc((size_t)b->n_ids + 1, sizeof(*b->codes));
        if (!b->codes) {
            gn_foreign_destroy(&f);
            break;
        }
        for (int id = 0; id < b->n_ids; id++) {
            b->cells = gn_marker_get_cells(dictionary, id, white);
            b->codes[id] = pack(white, b->cells);
        }
    }
    *out_foreign = f;
    return f ? 0 : -ENOMEM;
}

void gn_foreign_destroy(struct gn_foreign **foreign)
{
    if (!*foreign)
        return;
    for (int i = 0; i < N_FAMILIES; i++)
        free((*foreign)->books[i].codes);
    free(*foreign);
    *foreign = NULL;
}

/** White and black cells; false where the border is not black or nothing is white. */
static bool tell_cells(const struct gn_grey *grey, int n, double quad[4][2],
                       uint8_t out_white[static MAX_CELLS])
{
    double light[MAX_CELLS], least = 1, most = 0;
    if (!gn_quad_sample_cells(grey, n, quad, light))
        return false;
    for (int i = 0; i < n * n; i++) {
        least = light[i] < least ? light[i] : least;
        most = light[i] > most ? light[i] : most;
    }
    if (!(most - least >= min_contrast))
        return false;
    for (int i = 0; i < n * n; i++) {
        bool is_border = i % n == 0 || i % n == n - 1 || i / n == 0 || i / n == n - 1;
        out_white[i] = light[i] > (least + most) / 2;
        if (is_border && out_white[i])
            return false;
    }
    return true;
}

static void note(struct gn_foreign *f, int family, int id)
{
    struct read *r = NULL;
    for (int i = 0; i < f->n_read && !r; i++)
        if (f->read[i].family == family && f->read[i].id == id)
            r = &f->read[i];
    if (!r && f->n_read == MAX_READ)
        return;
    if (!r) {
        r = &f->read[f->n_read++];
        *r = (struct read){.family = family, .id = id};
    }
    r->n_pictures += !r->is_in_last;
    r->is_in_last = true;
}

static void read_square(struct gn_foreign *f, int family, const uint8_t *seen)
{
    const struct book *b = &f->books[family];
    uint8_t white[MAX_CELLS], turned[MAX_CELLS];
    int n = b->cells;
    memcpy(white, seen, sizeof(white));
    for (int turn = 0; turn < 4; turn++) {
        uint64_t code = pack(white, n);
        for (int id = 0; id < b->n_ids; id++)
            if (b->codes[id] == code)
                note(f, family, id);
        for (int i = 0; i < n * n; i++)
            turned[i] = white[i % n * n + (n - 1 - i / n)];
        memcpy(white, turned, sizeof(white));
    }
}

void gn_foreign_look(struct gn_foreign *f, const struct gn_grey *grey, double (*quads)[4][2],
                     int n_quads)
{
    f->n_pictures++;
    for (int i = 0; i < f->n_read; i++)
        f->read[i].is_in_last = false;
    for (int i = 0; i < n_quads; i++) {
        for (int family = 0; family < N_FAMILIES; family++) {
            uint8_t white[MAX_CELLS] = {0};
            int n = f->books[family].cells;
            if (n > 0 && tell_cells(grey, n, quads[i], white))
                read_square(f, family, white);
        }
    }
}

static int compare(const void *a, const void *b)
{
    return *(const int *)a - *(const int *)b;
}

/** Of 16 cells so many patterns are markers, 6 % of all, that one reading of one tells nothing; in
 * a first picture, which may be the only one, those of the smallest dictionaries do, 0.3 %. */
static bool is_certain(const struct gn_foreign *f, const struct read *r)
{
    return r->n_pictures > 1 || f->books[r->family].cells > 6 || (f->n_pictures == 1 && r->id < 50);
}

bool gn_foreign_get(const struct gn_foreign *f, struct gn_foreign_finds *out)
{
    int n[N_FAMILIES] = {0}, family = 0;
    for (int i = 0; i < f->n_read; i++)
        n[f->read[i].family] += is_certain(f, &f->read[i]);
    for (int i = 1; i < N_FAMILIES; i++)
        family = n[i] > n[family] ? i : family;
    if (n[family] == 0)
        return false;
    out->n_ids = 0;
    for (int i = 0; i < f->n_read && out->n_ids < GN_FOREIGN_MAX_IDS; i++)
        if (f->read[i].family == family && is_certain(f, &f->read[i]))
            out->ids[out->n_ids++] = f->read[i].id;
    qsort(out->ids, (size_t)out->n_ids, sizeof(*out->ids), compare);
    int k = 0;
    out->dictionary = find_dictionary(families[family][k]);
    while (out->ids[out->n_ids - 1] >= gn_marker_count_ids(out->dictionary))
        out->dictionary = find_dictionary(families[family][++k]);
    return true;
}
