/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/tracker.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "client/track/axes.h"
#include "client/track/edges.h"
#include "client/track/follow.h"
#include "client/track/grey.h"
#include "client/track/pose_choice.h"
#include "client/vision/markers.h"
#include "common/jpeg.h"

enum {
    MAX_SIGHTINGS = 1024,
    /** Where some markers are missing, the whole picture is searched again after so many. */
    SEARCH_INTERVAL = 15,
};

/** Below these speeds of its answer a body counts as at rest, m/s and rad/s. */
static const double rest_speed = 0.005, rest_turn = 0.02;

/** A marker of the last picture. */
struct followed {
    struct gn_marker_sighting sighting;
    double step[4][2]; // how its corners moved since the picture before, px
    uint8_t white[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
};

/** What is kept of each body from picture to picture. */
struct memory {
    struct gn_pose_filter filter;
    struct gn_pose_choice choice;
    bool was_seen;
    struct gn_pose last_measured, last_steady;
};

struct gn_tracker {
    struct gn_camera camera;
    const struct gn_bodies *bodies; // borrowed
    bool is_raw;
    int cells; // of a marker's side
    struct gn_marker_finder *finder;
    struct gn_jpeg *jpeg;
    struct gn_image8 grey_picture;
    struct gn_grey grey; // the same pixels
    bool has_picture;
    int since_whole; // pictures since all of one was searched
    struct gn_marker_window window;
    int n_sightings;
    struct gn_marker_sighting sightings[MAX_SIGHTINGS];
    int n_last;
    struct followed last[MAX_SIGHTINGS], next[MAX_SIGHTINGS];
    struct memory memory[GN_BODY_MAX_BODIES];
    struct gn_tracked_body tracked[GN_BODY_MAX_BODIES];
    double (*points)[3]; // [GN_BODY_MAX_MARKERS * 4], as are:
    double (*seen)[2];
    struct gn_tracker_counts counts;
};

static double get_processor_s(void)
{
    struct timespec t = {0};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void set_linear(struct gn_tracker *t)
{
    for (int i = 0; i < 256; i++)
        t->grey.linear[i] = gn_response_decode(&t->camera.response, (float)i / 255.0F);
    t->grey.pixels = t->grey_picture.data;
    t->grey.width = t->camera.width;
    t->grey.height = t->camera.height;
}

int gn_tracker_create(const struct gn_tracker_options *options, struct gn_tracker **out_tracker,
                      struct gn_error *out_error)
{
    static const struct gn_pose_filter_options unset = {0};
    *out_tracker = NULL;
    struct gn_tracker *t = calloc(1, sizeof(*t));
    if (!t)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    t->camera = *options->camera;
    t->bodies = options->bodies;
    t->is_raw = options->is_raw;
    bool is_unset = memcmp(&options->filter, &unset, sizeof(unset)) == 0;
    for (int i = 0; i < GN_BODY_MAX_BODIES; i++)
        t->memory[i].filter.options = is_unset ? GN_POSE_FILTER_DEFAULTS : options->filter;
    const struct gn_marker_finder_options finder = {.dictionary = t->bodies->dictionary,
                                                    .refinement = GN_MARKER_REFINE_NONE};
    int err = gn_marker_finder_create(&finder, &t->finder, out_error);
    t->points = calloc(GN_BODY_MAX_MARKERS * 4, sizeof(*t->points));
    t->seen = calloc(GN_BODY_MAX_MARKERS * 4, sizeof(*t->seen));
    if (!err && (!t->points || !t->seen || gn_jpeg_create(&t->jpeg) < 0 ||
                 gn_image8_init(&t->grey_picture, t->camera.width, t->camera.height, 1) < 0))
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err) {
        gn_tracker_destroy(&t);
        return err;
    }
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    t->cells = gn_marker_get_cells(t->bodies->dictionary, 0, cells);
    t->since_whole = SEARCH_INTERVAL;
    set_linear(t);
    *out_tracker = t;
    return 0;
}

void gn_tracker_destroy(struct gn_tracker **tracker)
{
    struct gn_tracker *t = *tracker;
    if (!t)
        return;
    gn_marker_finder_destroy(&t->finder);
    gn_jpeg_destroy(&t->jpeg);
    gn_image8_finish(&t->grey_picture);
    free(t->points);
    free(t->seen);
    free(t);
    *tracker = NULL;
}

/** Keeps the sightings of the bodies' own markers; one that is seen twice tells nothing. */
static void sort_out(struct gn_tracker *t)
{
    int n = 0, body, marker;
    for (int i = 0; i < t->n_sightings; i++) {
        bool is_alone = gn_bodies_find_marker(t->bodies, t->sightings[i].id, &body, &marker);
        for (int k = 0; k < t->n_sightings && is_alone; k++)
            is_alone = k == i || t->sightings[k].id != t->sightings[i].id;
        // Marked first, moved later: the others are still compared with it.
        t->sightings[i].corners[0][0] = is_alone ? t->sightings[i].corners[0][0] : NAN;
    }
    for (int i = 0; i < t->n_sightings; i++)
        if (!isnan(t->sightings[i].corners[0][0]))
            t->sightings[n++] = t->sightings[i];
    t->n_sightings = n;
}

static int search(struct gn_tracker *t, const struct gn_marker_window *window,
                  struct gn_error *out_error)
{
    int err =
        gn_marker_finder_find(t->finder, t->grey.pixels, t->grey.width, t->grey.height, window,
                              MAX_SIGHTINGS, t->sightings, &t->n_sightings, out_error);
    if (!err)
        sort_out(t);
    return err;
}

/** The surroundings of all that was seen: half a marker and more around. */
static void set_window(struct gn_tracker *t)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, side = 0;
    for (int i = 0; i < t->n_sightings; i++) {
        double(*c)[2] = t->sightings[i].corners;
        for (int k = 0; k < 4; k++) {
            for (int a = 0; a < 2; a++) {
                low[a] = fmin(low[a], c[k][a]);
                high[a] = fmax(high[a], c[k][a]);
            }
            side = fmax(side, hypot(c[k][0] - c[(k + 1) % 4][0], c[k][1] - c[(k + 1) % 4][1]));
        }
    }
    double around = 16 + 0.6 * side;
    t->window = (struct gn_marker_window){.x = (int)(low[0] - around),
                                          .y = (int)(low[1] - around),
                                          .width = (int)(high[0] - low[0] + 2 * around),
                                          .height = (int)(high[1] - low[1] + 2 * around)};
}

/** Follows every marker of the last picture. False where one is not where it should be. */
static bool follow_markers(struct gn_tracker *t)
{
    for (int i = 0; i < t->n_last; i++) {
        struct gn_marker_sighting *s = &t->sightings[i];
        const struct followed *f = &t->last[i];
        const struct gn_follow_pattern pattern = {.cells = t->cells, .white = f->white};
        *s = f->sighting;
        for (int k = 0; k < 4; k++)
            for (int a = 0; a < 2; a++)
                s->corners[k][a] += f->step[k][a];
        if (!gn_follow_marker(&t->grey, &t->camera, &pattern, s->corners))
            return false;
    }
    t->n_sightings = t->n_last;
    return t->n_last > 0;
}

/** Searches near where the last picture had markers, and everywhere where that finds fewer. */
static int search_markers(struct gn_tracker *t, bool is_near, struct gn_error *out_error)
{
    int err = 0;
    t->n_sightings = 0;
    if (is_near)
        err = search(t, &t->window, out_error);
    if (!err && (!is_near || t->n_sightings < t->n_last)) {
        err = search(t, NULL, out_error);
        t->since_whole = 0;
        t->counts.n_searched_whole++;
    }
    for (int i = 0; i < t->n_sightings && !err; i++) {
        if (!gn_edges_refine(&t->grey, &t->camera, t->cells, t->sightings[i].corners)) {
            gn_edges_widen(t->sightings[i].corners, 0.5);
            t->counts.n_coarse_corners++;
        }
    }
    return err;
}

/** Keeps the sightings for following them into the next picture. */
static void remember(struct gn_tracker *t)
{
    struct followed *next = t->next;
    for (int i = 0; i < t->n_sightings; i++) {
        const struct followed *before = NULL;
        for (int k = 0; k < t->n_last && !before; k++)
            if (t->last[k].sighting.id == t->sightings[i].id)
                before = &t->last[k];
        next[i] = (struct followed){.sighting = t->sightings[i]};
        if (!before) {
            (void)gn_marker_get_cells(t->bodies->dictionary, t->sightings[i].id, next[i].white);
            continue;
        }
        memcpy(next[i].white, before->white, sizeof(next[i].white));
        for (int k = 0; k < 8; k++)
            next[i].step[k / 2][k % 2] =
                t->sightings[i].corners[k / 2][k % 2] - before->sighting.corners[k / 2][k % 2];
    }
    memcpy(t->last, next, (size_t)t->n_sightings * sizeof(*next));
    t->n_last = t->n_sightings;
    if (t->n_last > 0)
        set_window(t);
}

/**
 * Finds the markers: follows those of the last picture; else searches near them; else everywhere,
 * as now and then where some of the bodies' markers have been missing.
 */
static int find_markers(struct gn_tracker *t, struct gn_error *out_error)
{
    int n_known = 0, err = 0;
    for (int i = 0; i < t->bodies->n_bodies; i++)
        n_known += t->bodies->bodies[i].n_markers;
    bool is_near = t->n_last > 0 && (t->n_last == n_known || t->since_whole < SEARCH_INTERVAL);
    t->since_whole++;
    if (is_near && follow_markers(t))
        t->counts.n_followed++;
    else
        err = search_markers(t, is_near, out_error);
    if (err)
        t->n_sightings = 0;
    remember(t);
    return err;
}

static double get_length(const double v[static 3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/** How still and how late the answers are. */
static void count_step(struct gn_tracker *t, struct memory *m, const struct gn_tracked_body *b)
{
    const struct gn_pose_filter *f = &m->filter;
    if (m->was_seen && !t->is_raw) {
        bool is_moving = get_length(f->speed) > rest_speed,
             is_turning = get_length(f->turn) > rest_turn;
        double measured_m2 = 0, steady_m2 = 0;
        for (int k = 0; k < 3; k++) {
            measured_m2 +=
                pow(b->fit.camera_from_body.translation[k] - m->last_measured.translation[k], 2);
            steady_m2 += pow(b->camera_from_body.translation[k] - m->last_steady.translation[k], 2);
        }
        if (is_moving || is_turning) {
            t->counts.n_moving++;
            t->counts.moving_lag_s +=
                fmax(is_moving ? f->lag_s : 0, is_turning ? f->turn_lag_s : 0);
        } else {
            t->counts.n_rest++;
            t->counts.rest_measured_m2 += measured_m2;
            t->counts.rest_steady_m2 += steady_m2;
        }
    }
    m->was_seen = true;
    m->last_measured = b->fit.camera_from_body;
    m->last_steady = b->camera_from_body;
}

/** Chooses among the poses and makes the answer steady. */
static int take_fits(struct gn_tracker *t, int body, int64_t time_ns,
                     const struct gn_pose_fit *fits, int n_fits)
{
    struct memory *m = &t->memory[body];
    struct gn_tracked_body *b = &t->tracked[body];
    struct gn_pose expected;
    bool is_expected = gn_pose_filter_predict(&m->filter, time_ns, &expected);
    uint64_t n_rejected = m->choice.n_rejected, n_changed = m->choice.n_changed;
    int chosen =
        gn_pose_choice_update(&m->choice, time_ns, fits, n_fits, is_expected ? &expected : NULL);
    t->counts.n_flips_rejected += m->choice.n_rejected - n_rejected;
    t->counts.n_flips_corrected += m->choice.n_changed - n_changed;
    if (m->choice.n_changed > n_changed) // what went before was another pose
        m->filter = (struct gn_pose_filter){.options = m->filter.options};
    b->fit = fits[chosen];
    int step = gn_pose_filter_update(&m->filter, time_ns, &b->fit.camera_from_body);
    if (step < 0)
        return step;
    b->is_seen = true;
    // A picture that is not later than the one before has a pose of its own all the same.
    bool is_own = t->is_raw || step == GN_POSE_FILTER_SKIPPED;
    b->camera_from_body = is_own ? b->fit.camera_from_body : m->filter.pose;
    t->counts.n_seen++;
    count_step(t, m, b);
    return 0;
}

/** Fits one body to its sightings. 1: seen, 0: not, or a negative errno. */
static int fit_body(struct gn_tracker *t, int body, int64_t time_ns, struct gn_error *out_error)
{
    struct gn_tracked_body *b = &t->tracked[body];
    const struct gn_body *known = &t->bodies->bodies[body];
    int n = 0, owner, marker;
    *b = (struct gn_tracked_body){0};
    for (int i = 0; i < t->n_sightings && n < GN_BODY_MAX_MARKERS * 4; i++) {
        if (!gn_bodies_find_marker(t->bodies, t->sightings[i].id, &owner, &marker) || owner != body)
            continue;
        for (int k = 0; k < 4; k++, n++) {
            memcpy(t->points[n], known->markers[marker].corners_body[k], sizeof(t->points[n]));
            memcpy(t->seen[n], t->sightings[i].corners[k], sizeof(t->seen[n]));
        }
    }
    struct gn_pose_fit fits[2];
    int n_fits = 0;
    if (n > 0)
        n_fits = gn_pose_fit_points(&t->camera, (const double(*)[3])t->points,
                                    (const double(*)[2])t->seen, n, GN_TRACKER_CORNER_ERROR_PX,
                                    fits, out_error);
    b->n_markers = n / 4;
    for (int i = 0; i < n_fits; i++) {
        double found_px = sqrt(fits[i].sum_px2 / (2 * n - 6));
        double share = fmax(1, found_px / GN_TRACKER_CORNER_ERROR_PX);
        fits[i].error_m *= share;
        fits[i].error_rad *= share;
    }
    if (n_fits <= 0 || take_fits(t, body, time_ns, fits, n_fits) < 0)
        t->memory[body].was_seen = false;
    return n_fits < 0 ? n_fits : b->is_seen;
}

int gn_tracker_update(struct gn_tracker *t, const struct gn_capture *capture, int64_t time_ns,
                      struct gn_error *out_error)
{
    double start_s = get_processor_s();
    int n_seen = 0;
    for (int i = 0; i < GN_BODY_MAX_BODIES; i++)
        t->tracked[i].is_seen = false;
    int err = gn_grey_from_capture(capture, t->jpeg, &t->grey_picture, out_error);
    if (err)
        return err;
    t->has_picture = true;
    err = find_markers(t, out_error);
    for (int i = 0; i < t->bodies->n_bodies && err >= 0; i++) {
        err = fit_body(t, i, time_ns, out_error);
        n_seen += err > 0;
    }
    t->counts.n_pictures++;
    t->counts.time_s += get_processor_s() - start_s;
    return err < 0 ? err : n_seen;
}

const struct gn_tracked_body *gn_tracker_get_body(const struct gn_tracker *t, int body)
{
    return &t->tracked[body];
}

bool gn_tracker_get_camera(const struct gn_tracker *t, int body,
                           struct gn_pose *out_body_from_camera)
{
    if (!t->tracked[body].is_seen)
        return false;
    gn_pose_invert(&t->tracked[body].camera_from_body, out_body_from_camera);
    return true;
}

bool gn_tracker_get_between(const struct gn_tracker *t, int base, int body,
                            struct gn_pose *out_base_from_body)
{
    if (!t->tracked[body].is_seen || !gn_tracker_get_camera(t, base, out_base_from_body))
        return false;
    gn_pose_multiply(out_base_from_body, &t->tracked[body].camera_from_body, out_base_from_body);
    return true;
}

void gn_tracker_get_counts(const struct gn_tracker *t, struct gn_tracker_counts *out)
{
    *out = t->counts;
}

/** How far the body's first corners are from its origin: as long its axes are drawn. */
static double get_reach(const struct gn_body *body)
{
    double reach = 0;
    for (int i = 0; i < body->n_markers; i++)
        for (int k = 0; k < 3; k++)
            reach = fmax(reach, fabs(body->markers[i].corners_body[0][k]));
    return reach;
}

int gn_tracker_draw(const struct gn_tracker *t, struct gn_image8 *out_rgb)
{
    static const uint8_t outline[3] = {255, 200, 0};
    if (!t->has_picture)
        return -EINVAL;
    int err = gn_image8_init(out_rgb, t->grey.width, t->grey.height, 3);
    if (err)
        return err;
    size_t n = (size_t)t->grey.width * (size_t)t->grey.height;
    for (size_t i = 0; i < 3 * n; i++)
        out_rgb->data[i] = t->grey.pixels[i / 3];
    for (int i = 0; i < t->n_sightings; i++)
        for (int k = 0; k < 4; k++)
            gn_axes_draw_line(out_rgb, t->sightings[i].corners[k],
                              t->sightings[i].corners[(k + 1) % 4], outline);
    for (int i = 0; i < t->bodies->n_bodies; i++)
        if (t->tracked[i].is_seen)
            gn_axes_draw(out_rgb, &t->camera, &t->tracked[i].camera_from_body,
                         get_reach(&t->bodies->bodies[i]));
    return 0;
}
