/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/misfit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/pose_fit.h"
#include "client/track/quad.h"

enum { MAX_POINTS = GN_BODY_MAX_MARKERS * 4, MAX_FITS = 64 };

/** What a fit is made under. */
struct guess {
    int turn;      // quarters: the seen corner k is the listed corner k + turn
    double spread; // of the markers' middles from their centre, of what is listed
};

static const struct guess as_listed = {0, 1};

struct work {
    const struct gn_misfit_view *view;
    int n; // markers
    const struct gn_body_marker *known[GN_BODY_MAX_MARKERS];
    bool is_out[GN_BODY_MAX_MARKERS];
    double limit_px;
    double points[MAX_POINTS][3], seen[MAX_POINTS][2];
    struct gn_pose pose; // of the last fit
};

double gn_misfit_get_limit(double side_px)
{
    return fmax(0.5, 0.015 * side_px);
}

double gn_misfit_get_gross_limit(double side_px)
{
    return fmax(1, 0.1 * side_px);
}

static void get_middle(const struct gn_body_marker *m, double out[static 3])
{
    for (int a = 0; a < 3; a++)
        out[a] = (m->corners_body[0][a] + m->corners_body[1][a] + m->corners_body[2][a] +
                  m->corners_body[3][a]) /
                 4;
}

static double get_distance(const double a[static 3], const double b[static 3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static double get_size(const struct gn_body_marker *m)
{
    return get_distance(m->corners_body[0], m->corners_body[1]);
}

/** Fits those markers that are not out; px RMS, infinity where there is no pose. */
static double fit(struct work *w, struct guess guess)
{
    double centre[3] = {0};
    int n = 0;
    for (int i = 0; i < w->n; i++) {
        double middle[3];
        get_middle(w->known[i], middle);
        for (int a = 0; a < 3; a++)
            centre[a] += middle[a] / w->n;
    }
    for (int i = 0; i < w->n; i++) {
        double middle[3];
        get_middle(w->known[i], middle);
        for (int k = 0; k < 4 && !w->is_out[i]; k++, n++) {
            const double *corner = w->known[i]->corners_body[(k + guess.turn) % 4];
            for (int a = 0; a < 3; a++)
                w->points[n][a] = corner[a] + (guess.spread - 1) * (middle[a] - centre[a]);
            memcpy(w->seen[n], w->view->seen[i].corners[k], sizeof(w->seen[n]));
        }
    }
    struct gn_pose_fit fits[2];
    if (gn_pose_fit_points(w->view->camera, (const double(*)[3])w->points,
                           (const double(*)[2])w->seen, n, 0.1, fits, NULL) < 1)
        return INFINITY;
    w->pose = fits[0].camera_from_body;
    return fits[0].rms_px;
}

/** The spread under which all fits best. */
static struct guess find_spread(struct work *w)
{
    struct guess best = as_listed, tried = as_listed;
    double least = INFINITY, step = log(1.1);
    for (int i = -10; i <= 10; i++) { // 0.39 to 2.6 times as far
        tried.spread = exp(i * step);
        double rms = fit(w, tried);
        if (rms < least) {
            least = rms;
            best = tried;
        }
    }
    for (; step > 1e-4; step /= 2) {
        double middle = best.spread;
        for (int sign = -1; sign <= 1; sign += 2) {
            tried.spread = middle * exp(sign * step / 2);
            double rms = fit(w, tried);
            if (rms < least) {
                least = rms;
                best = tried;
            }
        }
    }
    return best;
}

/** Leaves out the marker without which the rest fit best. Returns how well. */
static double leave_one_out(struct work *w)
{
    double least = INFINITY;
    int worst = -1;
    for (int i = 0; i < w->n; i++) {
        if (w->is_out[i])
            continue;
        w->is_out[i] = true;
        double rms = fit(w, as_listed);
        w->is_out[i] = false;
        if (rms < least) {
            least = rms;
            worst = i;
        }
    }
    if (worst < 0)
        return INFINITY;
    w->is_out[worst] = true;
    return fit(w, as_listed);
}

/** Leaves out as few as can be, less than half; false where the rest never fit. */
static bool leave_some_out(struct work *w)
{
    for (int n_out = 1; 2 * n_out < w->n && n_out * w->n <= MAX_FITS; n_out++)
        if (leave_one_out(w) <= w->limit_px)
            return true;
    memset(w->is_out, 0, sizeof(w->is_out));
    return false;
}

/** Where the marker's corners lie in its listed plane, by the pose of the last fit. */
static bool place(const struct work *w, int i, double out_body[4][3])
{
    const struct gn_body_marker *m = w->known[i];
    double corners[4][3], normal[3], u[3], v[3], height = 0;
    struct gn_pose body_from_camera;
    gn_pose_invert(&w->pose, &body_from_camera);
    for (int k = 0; k < 4; k++)
        gn_pose_transform(&w->pose, m->corners_body[k], corners[k]);
    for (int a = 0; a < 3; a++) {
        u[a] = corners[1][a] - corners[0][a];
        v[a] = corners[3][a] - corners[0][a];
    }
    for (int a = 0; a < 3; a++) {
        normal[a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
        height += normal[a] * corners[0][a];
    }
    for (int k = 0; k < 4; k++) {
        double dir[3];
        const double *px = w->view->seen[i].corners[k];
        if (!gn_camera_get_ray(w->view->camera, px[0], px[1], dir))
            return false;
        double along = normal[0] * dir[0] + normal[1] * dir[1] + normal[2] * dir[2];
        double t = height / along;
        if (!(t > 0) || !isfinite(t))
            return false;
        const double point[3] = {t * dir[0], t * dir[1], t * dir[2]};
        gn_pose_transform(&body_from_camera, point, out_body[k]);
    }
    return true;
}

/** What is wrong with one marker where the others are right. */
static int describe(const struct work *w, int i, char *out, size_t out_bytes)
{
    const struct gn_body_marker *m = w->known[i];
    struct gn_body_marker found = {.id = m->id};
    double size = get_size(m), side = 0, middle[2][3], least = INFINITY;
    int turn = 0;
    if (!place(w, i, found.corners_body))
        return snprintf(out, out_bytes, "marker %d is elsewhere", m->id);
    get_middle(m, middle[0]);
    get_middle(&found, middle[1]);
    for (int k = 0; k < 4; k++)
        side += get_distance(found.corners_body[k], found.corners_body[(k + 1) % 4]) / 4;
    for (int t = 0; t < 4; t++) {
        double sum = 0;
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 3; a++)
                sum += pow(found.corners_body[k][a] - middle[1][a] -
                               (m->corners_body[(k + t) % 4][a] - middle[0][a]),
                           2);
        if (sum < least) {
            least = sum;
            turn = t;
        }
    }
    double away = get_distance(middle[0], middle[1]);
    if (fabs(side / size - 1) > 0.05)
        return snprintf(out, out_bytes, "marker %d is %.1f mm wide, not %.1f", m->id, 1e3 * side,
                        1e3 * size);
    if (turn != 0 && away < 0.1 * size)
        return snprintf(out, out_bytes, "marker %d is turned by %d degrees", m->id, 90 * turn);
    return snprintf(out, out_bytes, "marker %d lies %.1f mm away, its middle at [%.4f, %.4f, %.4f]",
                    m->id, 1e3 * away, middle[1][0], middle[1][1], middle[1][2]);
}

/** Says what is wrong with those that are out. */
static void describe_all(const struct work *w, char *out, size_t out_bytes)
{
    size_t at = (size_t)snprintf(out, out_bytes, "the others fit, but ");
    for (int i = 0, n = 0; i < w->n && at < out_bytes; i++) {
        if (!w->is_out[i])
            continue;
        at += (size_t)snprintf(out + at, out_bytes - at, "%s", n++ ? ", " : "");
        if (at < out_bytes)
            at += (size_t)describe(w, i, out + at, out_bytes - at);
    }
}

/** Where more is wrong: what the marker that is seen largest says about the one farthest off. */
static void describe_by_one(struct work *w, char *out, size_t out_bytes)
{
    double largest = 0, farthest = -1;
    int one = 0, other = 0;
    for (int i = 0; i < w->n; i++) {
        double corners[4][2];
        memcpy(corners, w->view->seen[i].corners, sizeof(corners));
        double side_px = gn_quad_get_side(corners);
        one = side_px > largest ? i : one;
        largest = fmax(largest, side_px);
        w->is_out[i] = true;
    }
    w->is_out[one] = false;
    bool is_known = fit(w, as_listed) <= w->limit_px;
    for (int i = 0; i < w->n && is_known; i++) {
        struct gn_body_marker found;
        double middle[2][3];
        if (i == one || !place(w, i, found.corners_body))
            continue;
        get_middle(w->known[i], middle[0]);
        get_middle(&found, middle[1]);
        double away = get_distance(middle[0], middle[1]);
        other = away > farthest ? i : other;
        farthest = fmax(farthest, away);
    }
    size_t at = (size_t)snprintf(out, out_bytes, "more than one of them is elsewhere");
    if (farthest >= 0 && at < out_bytes)
        at +=
            (size_t)snprintf(out + at, out_bytes - at, "; by marker %d alone ", w->known[one]->id);
    if (farthest >= 0 && at < out_bytes)
        (void)describe(w, other, out + at, out_bytes - at);
}

/** The least distance between the middles of two of the markers, as listed, m. */
static double get_least_distance(const struct work *w)
{
    double least = INFINITY, a[3], b[3];
    for (int i = 0; i < w->n; i++) {
        for (int k = 0; k < i; k++) {
            get_middle(w->known[i], a);
            get_middle(w->known[k], b);
            least = fmin(least, get_distance(a, b));
        }
    }
    return least;
}

static void explain(struct work *w, char *out, size_t out_bytes)
{
    static const int turns[] = {2, 1, 3};
    for (int i = 0; i < 3; i++) {
        if (fit(w, (struct guess){turns[i], 1}) <= w->limit_px) {
            snprintf(out, out_bytes,
                     turns[i] == 2 ? "each turned by 180 degrees fits: AprilTags' corners start "
                                     "elsewhere (docs/frames.md)"
                                   : "each turned by %d degrees fits",
                     90 * turns[i]);
            return;
        }
    }
    struct guess guess = find_spread(w);
    if (fit(w, guess) <= w->limit_px) {
        double distance = get_least_distance(w);
        snprintf(out, out_bytes,
                 "their middles are %.1f mm apart, not %.1f, if their sizes are right",
                 1e3 * guess.spread * distance, 1e3 * distance);
    } else if (leave_some_out(w)) {
        describe_all(w, out, out_bytes);
    } else {
        describe_by_one(w, out, out_bytes);
    }
}

bool gn_misfit_explain(const struct gn_misfit_view *view, char *out, size_t out_bytes)
{
    struct work *w = calloc(1, sizeof(*w));
    double side_px = 0;
    bool is_wrong = false;
    if (!w)
        return false;
    w->view = view;
    for (int i = 0; i < view->n_seen && i < GN_BODY_MAX_MARKERS; i++) {
        double corners[4][2];
        memcpy(corners, view->seen[i].corners, sizeof(corners));
        side_px += gn_quad_get_side(corners) / view->n_seen;
        for (int k = 0; k < view->body->n_markers; k++)
            if (view->body->markers[k].id == view->seen[i].id)
                w->known[w->n] = &view->body->markers[k];
        w->n += w->known[w->n] != NULL;
    }
    w->limit_px = gn_misfit_get_limit(side_px);
    double rms = w->n == view->n_seen && w->n > 1 ? fit(w, as_listed) : 0;
    if (rms > w->limit_px) {
        is_wrong = true;
        explain(w, out, out_bytes);
    }
    free(w);
    return is_wrong;
}
