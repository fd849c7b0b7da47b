/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/fisheye_markers.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/rectify.h"
#include "client/track/edges.h"
#include "client/vision/markers.h"
#include "common/vec3.h"

/** What a view that looks straight at a marker shows, in half widths of the marker. */
static const double surround = 1.6;
/** Width of a cell in it: edges are measured over 3 px to each side, a third of one. */
static const double cell_px = 9;

/** A marker as a view has it. */
struct candidate {
    int id;
    double dirs[4][3];
    double middle[3]; // unit
    double radius;    // rad, from the middle to the farthest corner
    double off_axis;  // rad, from the view's
    double error_px;  // of the fisheye's picture, once refined
    bool is_fine;
    bool is_twice;
};

struct gn_fisheye_finder {
    struct gn_projection projection;
    struct gn_marker_finder *finder;
    int cells; // of a marker's side
    int n_views;
    struct gn_rectified_view views[GN_RECTIFY_MAX_VIEWS];
    struct gn_image8 grey; // [side][side] of the largest view
    struct gn_marker_sighting sightings[GN_FISHEYE_MAX_MARKERS];
    int n_candidates;
    struct candidate candidates[GN_FISHEYE_MAX_MARKERS];
};

static double get_angle(const double a[static 3], const double b[static 3])
{
    double cross[3];
    gn_vec3_cross(a, b, cross);
    return atan2(sqrt(gn_vec3_dot(cross, cross)), gn_vec3_dot(a, b));
}

int gn_fisheye_finder_create(const struct gn_projection *projection, int dictionary,
                             struct gn_fisheye_finder **out_finder, struct gn_error *out_error)
{
    const struct gn_marker_finder_options options = {.dictionary = dictionary,
                                                     .refinement = GN_MARKER_REFINE_NONE};
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    *out_finder = NULL;
    struct gn_fisheye_finder *f = calloc(1, sizeof(*f));
    if (!f)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    f->projection = *projection;
    f->n_views = gn_rectify_tile(projection, f->views);
    f->cells = gn_marker_get_cells(dictionary, 0, cells);
    int err = gn_marker_finder_create(&options, &f->finder, out_error);
    if (!err && gn_image8_init(&f->grey, GN_RECTIFY_MAX_SIDE, GN_RECTIFY_MAX_SIDE, 1) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err)
        gn_fisheye_finder_destroy(&f);
    *out_finder = f;
    return err;
}

void gn_fisheye_finder_destroy(struct gn_fisheye_finder **finder)
{
    struct gn_fisheye_finder *f = *finder;
    if (!f)
        return;
    gn_marker_finder_destroy(&f->finder);
    gn_image8_finish(&f->grey);
    free(f);
    *finder = NULL;
}

static void set_middle(struct candidate *c)
{
    double sum[3] = {0}, length;
    for (int i = 0; i < 12; i++)
        sum[i % 3] += c->dirs[i / 3][i % 3];
    length = sqrt(gn_vec3_dot(sum, sum));
    for (int k = 0; k < 3; k++)
        c->middle[k] = sum[k] / length;
    c->radius = 0;
    for (int k = 0; k < 4; k++)
        c->radius = fmax(c->radius, get_angle(c->middle, c->dirs[k]));
}

/** Adds what a view has seen; of one marker in several views the one nearest its view's axis. */
static void add(struct gn_fisheye_finder *f, const struct gn_rectified_view *view,
                const struct gn_marker_sighting *sighting)
{
    struct candidate c = {.id = sighting->id};
    const double *m = view->probe_from_view, axis[3] = {m[2], m[5], m[8]};
    for (int k = 0; k < 4; k++)
        gn_rectify_get_direction(view, sighting->corners[k], c.dirs[k]);
    set_middle(&c);
    c.off_axis = get_angle(axis, c.middle);
    for (int i = 0; i < f->n_candidates; i++) {
        struct candidate *other = &f->candidates[i];
        if (other->id != c.id)
            continue;
        bool is_same = get_angle(other->middle, c.middle) < fmin(other->radius, c.radius);
        c.is_twice = other->is_twice || !is_same;
        if (c.off_axis < other->off_axis || c.is_twice)
            *other = c;
        return;
    }
    if (f->n_candidates < GN_FISHEYE_MAX_MARKERS)
        f->candidates[f->n_candidates++] = c;
}

/**
 * Measures the edges in a view straight at the marker, in which its cells are cell_px wide, or less
 * where the picture has no more to tell: then its blur is narrow beside a cell.
 */
static int refine(struct gn_fisheye_finder *f, const struct gn_image *light, struct candidate *c)
{
    struct gn_rectified_view view;
    struct gn_grey grey = {.pixels = f->grey.data};
    double corners[4][2], half_width = tan(fmax(c->radius, 1e-3)), finest = f->views[0].focal;
    double focal = cell_px * f->cells / (sqrt(2) * half_width); // of a square, seen straight
    gn_rectify_aim(c->middle, surround * half_width, fmin(focal, finest), &view);
    int err = gn_rectify_take(&view, &f->projection, light, 1 / surround, &f->grey, grey.linear);
    if (err)
        return err;
    const struct gn_camera camera = {.width = view.side,
                                     .height = view.side,
                                     .fx = view.focal,
                                     .fy = view.focal,
                                     .cx = 0.5 * view.side,
                                     .cy = 0.5 * view.side};
    grey.width = grey.height = view.side;
    for (int k = 0; k < 4; k++)
        (void)gn_rectify_get_position(&view, c->dirs[k], corners[k]); // about its axis: in front
    c->is_fine = gn_edges_refine(&grey, &camera, f->cells, corners);
    if (!c->is_fine)
        gn_edges_widen(corners, 0.5);
    for (int k = 0; k < 4; k++)
        gn_rectify_get_direction(&view, corners[k], c->dirs[k]);
    c->error_px =
        (c->is_fine ? GN_FISHEYE_EDGE_ERROR_PX : GN_FISHEYE_COARSE_ERROR_PX) * finest / view.focal;
    return 0;
}

/** False where the picture does not show all corners. */
static bool finish(const struct gn_fisheye_finder *f, const struct candidate *c,
                   struct gn_fisheye_marker *out)
{
    double px = 0, rad = 0;
    *out = (struct gn_fisheye_marker){.id = c->id, .is_coarse = !c->is_fine};
    memcpy(out->dirs, c->dirs, sizeof(out->dirs));
    for (int k = 0; k < 4; k++)
        if (!gn_projection_get_position(&f->projection, out->dirs[k], out->corners_px[k]))
            return false;
    for (int k = 0; k < 4; k++) {
        const double *p = out->corners_px[k], *q = out->corners_px[(k + 1) % 4];
        px += hypot(p[0] - q[0], p[1] - q[1]);
        rad += get_angle(out->dirs[k], out->dirs[(k + 1) % 4]);
    }
    out->width_px = px / 4;
    out->error_rad = c->error_px * rad / px;
    return rad > 0;
}

int gn_fisheye_finder_find(struct gn_fisheye_finder *f, const struct gn_image *light,
                           struct gn_fisheye_marker *out_markers, int *out_n_twice,
                           struct gn_error *out_error)
{
    float unused[256];
    int n = 0, n_twice = 0, n_seen = 0, err = 0;
    f->n_candidates = 0;
    for (int i = 0; i < f->n_views && !err; i++) {
        const struct gn_rectified_view *view = &f->views[i];
        if (gn_rectify_take(view, &f->projection, light, 1, &f->grey, unused) < 0)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
        err = gn_marker_finder_find(f->finder, f->grey.data, view->side, view->side, NULL,
                                    GN_FISHEYE_MAX_MARKERS, f->sightings, &n_seen, out_error);
        for (int k = 0; k < n_seen && !err; k++)
            add(f, view, &f->sightings[k]);
    }
    for (int i = 0; i < f->n_candidates && !err; i++) {
        struct candidate *c = &f->candidates[i];
        n_twice += c->is_twice;
        if (c->is_twice)
            continue;
        if (refine(f, light, c) < 0)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
        n += finish(f, c, &out_markers[n]);
    }
    if (out_n_twice)
        *out_n_twice = n_twice;
    return err ? err : n;
}
