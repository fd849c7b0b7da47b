/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/edges.h"

#include <math.h>
#include <string.h>

enum { MAX_PLACES = 40, MIN_PLACES = 6, MAX_STEPS = 25 };

/** Widest half of a profile, px, and its step. */
static const double max_reach_px = 3.0, step_px = 0.25;
/** Least difference of linear light across an edge, of full scale. */
static const double min_contrast = 0.02;

/** An edge between two corners: rays of its ends, and their pictures. */
struct edge {
    double rays[2][2]; // x/z, y/z
    double px[2][2];
};

/** What was measured at one place along an edge: `offset` px outwards of it, where t of it is. */
struct place {
    double t;
    double offset;
    double normal[2];
};

static bool is_inside(const struct gn_grey *g, double x, double y, double margin)
{
    return x >= margin && y >= margin && x <= g->width - margin && y <= g->height - margin;
}

static bool project(const struct gn_camera *camera, const double ray[static 2],
                    double out_px[static 2])
{
    const double point[3] = {ray[0], ray[1], 1};
    return gn_camera_project(camera, point, out_px);
}

static bool get_ray(const struct gn_camera *camera, const double px[static 2],
                    double out_ray[static 2])
{
    double dir[3];
    if (!gn_camera_get_ray(camera, px[0], px[1], dir))
        return false;
    out_ray[0] = dir[0] / dir[2];
    out_ray[1] = dir[1] / dir[2];
    return true;
}

/**
 * The light along a profile from -reach (inside) to +reach (outside) at x + s n: its values, and
 * its sums over the inner and the outer quarter.
 */
static int take_profile(const struct gn_grey *g, const double px[static 2],
                        const double normal[static 2], double reach, double *out)
{
    int n = (int)(2 * reach / step_px);
    for (int i = 0; i < n; i++) {
        double s = -reach + (i + 0.5) * (2 * reach / n);
        out[i] = gn_grey_sample(g, px[0] + s * normal[0], px[1] + s * normal[1]);
    }
    return n;
}

/** Measures the places along an edge; returns how many there are. */
static int measure(const struct gn_grey *g, const struct gn_camera *camera, const struct edge *e,
                   double reach, double side, struct place places[static MAX_PLACES])
{
    double length = hypot(e->px[1][0] - e->px[0][0], e->px[1][1] - e->px[0][1]);
    double along[2] = {(e->px[1][0] - e->px[0][0]) / length, (e->px[1][1] - e->px[0][1]) / length};
    // Clockwise in a picture whose y runs down: outside is on the left of the way.
    double normal[2] = {side * along[1], -side * along[0]};
    // Near the corners the profiles would see the other edges.
    double margin = fmin((reach + 1.5) / length, 0.3);
    int n_wanted = (int)fmin(MAX_PLACES, fmax(MIN_PLACES, length * (1 - 2 * margin) / 1.5));
    static const int n_ends = 4; // of a profile's values, that are plainly inside or outside
    double values[MAX_PLACES][MAX_STEPS], dark = 0, light = 0;
    int n = 0, n_steps = 0;
    for (int i = 0; i < n_wanted; i++) {
        double t = margin + (1 - 2 * margin) * (i + 0.5) / n_wanted;
        double ray[2], px[2];
        for (int k = 0; k < 2; k++)
            ray[k] = (1 - t) * e->rays[0][k] + t * e->rays[1][k];
        if (!project(camera, ray, px) || !is_inside(g, px[0], px[1], reach + 2))
            continue;
        n_steps = take_profile(g, px, normal, reach, values[n]);
        for (int k = 0; k < n_ends; k++) {
            dark += values[n][k];
            light += values[n][n_steps - 1 - k];
        }
        places[n++] = (struct place){.t = t, .normal = {normal[0], normal[1]}};
    }
    if (n < MIN_PLACES)
        return 0;
    dark /= n_ends * n;
    light /= n_ends * n;
    if (!(light - dark >= min_contrast))
        return 0;
    // Ideally dark up to the edge and light from there: the light's sum tells where that is.
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int k = 0; k < n_steps; k++)
            sum += (values[i][k] - dark) / (light - dark);
        places[i].offset = reach - sum * 2 * reach / n_steps;
    }
    return n;
}

/** Fits offset = a + b t, places far from it left out; false where too few agree. */
static bool fit_line(const struct place *places, int n, double *out_a, double *out_b)
{
    double a = 0, b = 0, limit = INFINITY;
    for (int pass = 0; pass < 3; pass++) {
        double w = 0, st = 0, so = 0, stt = 0, sto = 0, squares = 0;
        for (int i = 0; i < n; i++) {
            const struct place *p = &places[i];
            if (fabs(p->offset - a - b * p->t) > limit)
                continue;
            w += 1;
            st += p->t;
            so += p->offset;
            stt += p->t * p->t;
            sto += p->t * p->offset;
        }
        double det = w * stt - st * st;
        if (w < MIN_PLACES || 2 * w < n || !(det > 1e-9))
            return false;
        b = (w * sto - st * so) / det;
        a = (so - b * st) / w;
        for (int i = 0; i < n; i++)
            if (fabs(places[i].offset - a - b * places[i].t) <= limit)
                squares += pow(places[i].offset - a - b * places[i].t, 2);
        limit = fmax(2.5 * sqrt(squares / w), 0.02);
    }
    *out_a = a;
    *out_b = b;
    return true;
}

/** Where the lines through two pairs of rays meet. */
static bool meet(double a[2][2], double b[2][2], double out[static 2])
{
    double u[2] = {a[1][0] - a[0][0], a[1][1] - a[0][1]};
    double v[2] = {b[1][0] - b[0][0], b[1][1] - b[0][1]};
    double w[2] = {b[0][0] - a[0][0], b[0][1] - a[0][1]};
    double cross = u[0] * v[1] - u[1] * v[0];
    if (!(fabs(cross) > 0.02 * hypot(u[0], u[1]) * hypot(v[0], v[1])))
        return false;
    double t = (w[0] * v[1] - w[1] * v[0]) / cross;
    out[0] = a[0][0] + t * u[0];
    out[1] = a[0][1] + t * u[1];
    return true;
}

/** One round for all four edges. */
static bool refine_once(const struct gn_grey *g, const struct gn_camera *camera, double reach,
                        double corners_px[4][2])
{
    double rays[4][2], lines[4][2][2], area = 0;
    for (int k = 0; k < 4; k++) {
        const double *p = corners_px[k], *q = corners_px[(k + 1) % 4];
        area += p[0] * q[1] - p[1] * q[0];
        if (!get_ray(camera, p, rays[k]))
            return false;
    }
    for (int k = 0; k < 4; k++) {
        struct place places[MAX_PLACES];
        struct edge e;
        double a, b;
        for (int i = 0; i < 2; i++) {
            memcpy(e.rays[i], rays[(k + i) % 4], sizeof(e.rays[i]));
            memcpy(e.px[i], corners_px[(k + i) % 4], sizeof(e.px[i]));
        }
        int n = measure(g, camera, &e, reach, area > 0 ? 1 : -1, places);
        if (n == 0 || !fit_line(places, n, &a, &b))
            return false;
        for (int i = 0; i < 2; i++) {
            double offset = a + b * i;
            const double px[2] = {e.px[i][0] + offset * places[0].normal[0],
                                  e.px[i][1] + offset * places[0].normal[1]};
            if (!(fabs(offset) < reach) || !get_ray(camera, px, lines[k][i]))
                return false;
        }
    }
    double found_px[4][2];
    for (int k = 0; k < 4; k++) {
        double ray[2];
        if (!meet(lines[(k + 3) % 4], lines[k], ray) || !project(camera, ray, found_px[k]) ||
            !is_inside(g, found_px[k][0], found_px[k][1], 1))
            return false;
    }
    memcpy(corners_px, found_px, sizeof(found_px));
    return true;
}

bool gn_edges_refine(const struct gn_grey *grey, const struct gn_camera *camera, int cells,
                     double corners_px[4][2])
{
    double found[4][2], shortest = INFINITY;
    memcpy(found, corners_px, sizeof(found));
    // The second round's profiles have the edge in their middle, the third's the same ends.
    for (int round = 0; round < 3; round++) {
        shortest = fmin(shortest, gn_quad_get_side(found));
        double reach = fmin(0.8 * shortest / cells, max_reach_px);
        if (!(shortest / cells >= GN_EDGES_MIN_CELL_PX) || !refine_once(grey, camera, reach, found))
            return false;
    }
    for (int k = 0; k < 4; k++)
        if (!(hypot(found[k][0] - corners_px[k][0], found[k][1] - corners_px[k][1]) < 3))
            return false;
    memcpy(corners_px, found, sizeof(found));
    return true;
}

void gn_edges_widen(double corners_px[4][2], double by_px)
{
    double lines[4][2][2], area = 0;
    for (int k = 0; k < 4; k++)
        area += corners_px[k][0] * corners_px[(k + 1) % 4][1] -
                corners_px[k][1] * corners_px[(k + 1) % 4][0];
    for (int k = 0; k < 4; k++) {
        const double *p = corners_px[k], *q = corners_px[(k + 1) % 4];
        double length = hypot(q[0] - p[0], q[1] - p[1]),
               share = (area > 0 ? by_px : -by_px) / length;
        for (int a = 0; a < 2; a++) {
            double outwards = a ? -(q[0] - p[0]) : q[1] - p[1];
            lines[k][0][a] = p[a] + share * outwards;
            lines[k][1][a] = q[a] + share * outwards;
        }
    }
    for (int k = 0; k < 4; k++)
        (void)meet(lines[(k + 3) % 4], lines[k], corners_px[k]);
}
