/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/search.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ALL, SMALL, FINE, MIDDLE, COARSE, N_FINDERS }; // as the bits of gn_search_look
/** What is dark is told by a mean of so many px; 0: by all of these. */
static const int windows[N_FINDERS] = {[FINE] = 3, [MIDDLE] = 13, [COARSE] = 23};
enum { MAX_QUADS = 1024 };

/** Least correlation with its pattern of a marker that OpenCV has read. */
static const double min_correlation = 0.7;

struct gn_search {
    const struct gn_camera *camera; // borrowed
    int cells;
    int n_ids;
    int *ids;
    struct gn_marker_finder *finders[N_FINDERS];
    struct gn_reader *reader;
    struct gn_marker_sighting read[GN_SEARCH_MAX_FOUND];
    int n_unread;
    double unread[MAX_QUADS][4][2], quads[MAX_QUADS][4][2];
};

int gn_search_create(const struct gn_search_options *o, struct gn_search **out_search,
                     struct gn_error *out_error)
{
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    *out_search = NULL;
    struct gn_search *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->camera = o->camera;
    s->n_ids = o->n_ids;
    s->ids = calloc((size_t)o->n_ids + 1, sizeof(*s->ids));
    int err = s->ids ? 0 : gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int i = 0; !err && i < N_FINDERS; i++) {
        const struct gn_marker_finder_options wanted = {
            .dictionary = o->dictionary, .is_small = i == SMALL, .window = windows[i]};
        err = gn_marker_finder_create(&wanted, &s->finders[i], out_error);
    }
    if (!err && gn_reader_create(o->dictionary, o->ids, o->n_ids, &s->reader) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err) {
        gn_search_destroy(&s);
        return err;
    }
    memcpy(s->ids, o->ids, (size_t)o->n_ids * sizeof(*s->ids));
    s->cells = gn_marker_get_cells(o->dictionary, 0, cells);
    *out_search = s;
    return 0;
}

void gn_search_destroy(struct gn_search **search)
{
    struct gn_search *s = *search;
    if (!s)
        return;
    for (int i = 0; i < N_FINDERS; i++)
        gn_marker_finder_destroy(&s->finders[i]);
    gn_reader_destroy(&s->reader);
    free(s->ids);
    free(s);
    *search = NULL;
}

const struct gn_pattern *gn_search_get_pattern(const struct gn_search *s, int id)
{
    return gn_reader_get_pattern(s->reader, id);
}

double (*gn_search_get_unread(struct gn_search *s, int *out_n))[4][2]
{
    *out_n = s->n_unread;
    return s->unread;
}

static void get_middle(const struct gn_marker_sighting *m, double out[static 2])
{
    for (int a = 0; a < 2; a++)
        out[a] = (m->corners[0][a] + m->corners[1][a] + m->corners[2][a] + m->corners[3][a]) / 4;
}

/** Whether the marker was found before, by another way. */
static bool is_known(struct gn_search_finds *finds, const struct gn_marker_sighting *m)
{
    double mine[2], other[2];
    get_middle(m, mine);
    for (int i = 0; i < finds->n_found; i++) {
        get_middle(&finds->found[i], other);
        if (finds->found[i].id == m->id && hypot(mine[0] - other[0], mine[1] - other[1]) <
                                               0.5 * gn_quad_get_side(finds->found[i].corners))
            return true;
    }
    return false;
}

static void add(struct gn_search_finds *finds, const struct gn_marker_sighting *m)
{
    if (finds->n_found < GN_SEARCH_MAX_FOUND && !is_known(finds, m))
        finds->found[finds->n_found++] = *m;
}

/** Moves OpenCV's corners onto the marker; false where they stay what they are, but wider. */
static bool refine(const struct gn_search *s, const struct gn_grey *grey, double to_edge_px,
                   struct gn_marker_sighting *m)
{
    if (gn_edges_refine(grey, s->camera, s->cells, m->corners))
        return true;
    gn_edges_widen(m->corners, to_edge_px);
    const struct gn_pattern *pattern = gn_reader_get_pattern(s->reader, m->id);
    return pattern && gn_pattern_fit(grey, pattern, m->corners) >= min_correlation;
}

/** Reads a square of OpenCV's; its corners become wider. */
static bool read_square(const struct gn_search *s, const struct gn_grey *grey, double to_edge_px,
                        double corners_px[4][2], struct gn_search_finds *finds)
{
    struct gn_marker_sighting m;
    gn_edges_widen(corners_px, to_edge_px);
    if (!gn_reader_read(s->reader, grey, corners_px, &m))
        return false;
    add(finds, &m);
    return true;
}

/** One finder's squares. Of small ones there are so many that OpenCV's reading is not believed. */
static int look(struct gn_search *s, int which, const struct gn_grey *grey,
                const struct gn_marker_window *window, struct gn_search_finds *finds,
                struct gn_error *out_error)
{
    // Whole-pixel corners are the centres of the outermost dark pixels.
    const double to_edge_px = which == SMALL ? 0.25 : 0.5;
    int n = 0;
    int err = gn_marker_finder_find(s->finders[which], grey->pixels, grey->width, grey->height,
                                    window, GN_SEARCH_MAX_FOUND, s->read, &n, out_error);
    if (err)
        return err;
    for (int i = 0; i < n; i++) {
        if (which == SMALL) {
            (void)read_square(s, grey, to_edge_px, s->read[i].corners, finds);
        } else if (!is_known(finds, &s->read[i])) {
            finds->n_coarse += !refine(s, grey, to_edge_px, &s->read[i]);
            add(finds, &s->read[i]);
        }
    }
    n = gn_marker_finder_get_unread(s->finders[which], MAX_QUADS, s->quads);
    for (int i = 0; i < n; i++)
        if (!read_square(s, grey, to_edge_px, s->quads[i], finds) && which != SMALL &&
            s->n_unread < MAX_QUADS)
            memcpy(s->unread[s->n_unread++], s->quads[i], sizeof(s->quads[i]));
    return 0;
}

static bool has_all(const struct gn_search *s, const struct gn_search_finds *finds)
{
    int n = 0;
    for (int i = 0; i < s->n_ids; i++)
        for (int k = 0; k < finds->n_found; k++)
            if (finds->found[k].id == s->ids[i]) {
                n++;
                break;
            }
    return n == s->n_ids;
}

int gn_search_find(struct gn_search *s, const struct gn_grey *grey,
                   const struct gn_marker_window *window, unsigned looks,
                   struct gn_search_finds *out_finds, struct gn_error *out_error)
{
    out_finds->n_found = out_finds->n_coarse = 0;
    s->n_unread = 0;
    static const int order[] = {ALL, FINE, MIDDLE, COARSE, SMALL};
    int err = 0;
    for (size_t i = 0; i < GN_ARRAY_LEN(order) && !err; i++)
        if (looks >> order[i] & 1 && (order[i] != SMALL || !has_all(s, out_finds)))
            err = look(s, order[i], grey, window, out_finds, out_error);
    return err;
}
