/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/tracker.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "client/track/axes.h"
#include "client/track/grey.h"
#include "client/track/misfit.h"
#include "client/track/pose_choice.h"
#include "common/draw.h"
#include "common/jpeg.h"

/** Below these speeds of its answer a body counts as at rest, m/s and rad/s. */
static const double rest_speed = 0.005, rest_turn = 0.02;

/** What is kept of each body from picture to picture. */
struct memory {
    struct gn_pose_filter filter;
    struct gn_pose_choice choice;
    bool was_seen; // in the last picture
    bool was_ever_seen;
    struct gn_pose last_measured, last_steady;
};

struct gn_tracker {
    struct gn_camera camera;
    const struct gn_bodies *bodies; // borrowed
    bool is_raw;
    struct gn_watch *watch;
    struct gn_jpeg *jpeg;
    struct gn_image8 grey_picture;
    struct gn_grey grey; // the same pixels
    bool has_picture;
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
    int err = gn_watch_create(&t->camera, t->bodies, options->is_live, &t->watch, out_error);
    t->points = calloc(GN_BODY_MAX_MARKERS * 4, sizeof(*t->points));
    t->seen = calloc(GN_BODY_MAX_MARKERS * 4, sizeof(*t->seen));
    if (!err && (!t->points || !t->seen || gn_jpeg_create(&t->jpeg) < 0 ||
                 gn_image8_init(&t->grey_picture, t->camera.width, t->camera.height, 1) < 0))
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err) {
        gn_tracker_destroy(&t);
        return err;
    }
    set_linear(t);
    *out_tracker = t;
    return 0;
}

void gn_tracker_destroy(struct gn_tracker **tracker)
{
    struct gn_tracker *t = *tracker;
    if (!t)
        return;
    gn_watch_destroy(&t->watch);
    gn_jpeg_destroy(&t->jpeg);
    gn_image8_finish(&t->grey_picture);
    free(t->points);
    free(t->seen);
    free(t);
    *tracker = NULL;
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

/** Whether the markers are where they are listed; returns whether they are so far from there that
 * their pose says nothing. Of one marker alone that cannot be told. */
static bool judge_fit(struct gn_tracker *t, struct gn_tracked_body *b, double rms_px)
{
    double side_px = 0;
    if (b->n_markers < 2)
        return false;
    for (int i = 0; i < b->n_markers; i++)
        side_px += gn_quad_get_side(t->seen + 4 * i) / b->n_markers;
    b->is_misfit = rms_px > gn_misfit_get_limit(side_px);
    t->counts.n_misfits += b->is_misfit;
    return rms_px > gn_misfit_get_gross_limit(side_px);
}

/** Fits one body to its sightings. 1: seen, 0: not, or a negative errno. */
static int fit_body(struct gn_tracker *t, int body, int64_t time_ns, struct gn_error *out_error)
{
    struct gn_tracked_body *b = &t->tracked[body];
    const struct gn_body *known = &t->bodies->bodies[body];
    int n = 0, owner, marker, n_seen;
    const struct gn_marker_sighting *seen = gn_watch_get_sightings(t->watch, &n_seen);
    *b = (struct gn_tracked_body){0};
    for (int i = 0; i < n_seen && n < GN_BODY_MAX_MARKERS * 4; i++) {
        if (!gn_bodies_find_marker(t->bodies, seen[i].id, &owner, &marker) || owner != body)
            continue;
        for (int k = 0; k < 4; k++, n++) {
            memcpy(t->points[n], known->markers[marker].corners_body[k], sizeof(t->points[n]));
            memcpy(t->seen[n], seen[i].corners[k], sizeof(t->seen[n]));
        }
    }
    struct gn_pose_fit fits[2];
    int n_fits = 0;
    if (n > 0)
        n_fits = gn_pose_fit_points(&t->camera, (const double(*)[3])t->points,
                                    (const double(*)[2])t->seen, n, GN_TRACKER_CORNER_ERROR_PX,
                                    fits, out_error);
    b->n_markers = n / 4;
    t->memory[body].was_ever_seen = t->memory[body].was_ever_seen || n > 0;
    if (n_fits >= 0 && judge_fit(t, b, n_fits > 0 ? fits[0].rms_px : INFINITY) && n_fits > 0)
        n_fits = 0;
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
        t->tracked[i].is_seen = t->tracked[i].is_misfit = false;
    int err = gn_grey_from_capture(capture, t->jpeg, &t->grey_picture, out_error);
    if (err)
        return err;
    t->has_picture = true;
    err = gn_watch_update(t->watch, &t->grey, time_ns, out_error);
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

static int compare_ids(const void *a, const void *b)
{
    return ((const struct gn_marker_sighting *)a)->id - ((const struct gn_marker_sighting *)b)->id;
}

/** Explains the misfit of one body. */
static bool explain_body(const struct gn_tracker *t, int body, char *out, size_t out_bytes)
{
    static const int max_listed = 8;
    const struct gn_body *known = &t->bodies->bodies[body];
    struct gn_marker_sighting *own = calloc(GN_BODY_MAX_MARKERS, sizeof(*own));
    int n_seen, owner, marker, n = 0;
    const struct gn_marker_sighting *seen = gn_watch_get_sightings(t->watch, &n_seen);
    char why[256] = "";
    for (int i = 0; i < n_seen && own && n < GN_BODY_MAX_MARKERS; i++)
        if (gn_bodies_find_marker(t->bodies, seen[i].id, &owner, &marker) && owner == body)
            own[n++] = seen[i];
    if (own)
        qsort(own, (size_t)n, sizeof(*own), compare_ids);
    const struct gn_misfit_view view = {
        .camera = &t->camera, .body = known, .seen = own, .n_seen = n};
    bool is_wrong = own && gn_misfit_explain(&view, why, sizeof(why));
    size_t at = is_wrong
                    ? (size_t)snprintf(out, out_bytes, "the markers of \"%s\" (seen: ", known->name)
                    : out_bytes;
    for (int i = 0; i < n && i < max_listed && at < out_bytes; i++)
        at += (size_t)snprintf(out + at, out_bytes - at, i ? ", %d" : "%d", own[i].id);
    if (at < out_bytes)
        snprintf(out + at, out_bytes - at, "%s) are not where they are listed: %s",
                 n > max_listed ? ", ..." : "", why);
    free(own);
    return is_wrong;
}

/** Markers that no body has, where a body was never seen; or of another dictionary, where nothing
 * is. */
static bool get_strangers(const struct gn_tracker *t, struct gn_foreign_finds *out)
{
    bool is_one_missing = false;
    int n_seen;
    for (int i = 0; i < t->bodies->n_bodies; i++)
        is_one_missing = is_one_missing || !t->memory[i].was_ever_seen;
    *out = *gn_watch_get_strangers(t->watch);
    if (is_one_missing && out->n_ids > 0)
        return true;
    (void)gn_watch_get_sightings(t->watch, &n_seen);
    return n_seen == 0 && gn_watch_get_foreign(t->watch, out) &&
           out->dictionary != t->bodies->dictionary;
}

bool gn_tracker_is_doubtful(const struct gn_tracker *t)
{
    struct gn_foreign_finds strangers;
    for (int i = 0; i < t->bodies->n_bodies; i++)
        if (t->tracked[i].is_misfit)
            return true;
    return get_strangers(t, &strangers);
}

bool gn_tracker_explain(const struct gn_tracker *t, char *out, size_t out_bytes)
{
    struct gn_foreign_finds strangers;
    for (int i = 0; i < t->bodies->n_bodies; i++)
        if (t->tracked[i].is_misfit)
            return explain_body(t, i, out, out_bytes);
    if (!get_strangers(t, &strangers))
        return false;
    char ids[128] = "", name[2][32];
    const char *some = strangers.n_ids > 1 ? "are ids" : "is id";
    for (int i = 0, at = 0; i < strangers.n_ids; i++)
        at += snprintf(ids + at, sizeof(ids) - (size_t)at, i ? ", %d" : "%d", strangers.ids[i]);
    gn_marker_print_name(strangers.dictionary, name[0], sizeof(name[0]));
    gn_marker_print_name(t->bodies->dictionary, name[1], sizeof(name[1]));
    const char *missing = NULL;
    for (int i = 0; i < t->bodies->n_bodies && !missing; i++)
        missing = t->memory[i].was_ever_seen ? NULL : t->bodies->bodies[i].name;
    if (strangers.dictionary == t->bodies->dictionary)
        snprintf(out, out_bytes,
                 "no marker of \"%s\" is seen, but of %s there %s %s, which no body has", missing,
                 name[0], some, ids);
    else
        snprintf(out, out_bytes, "no marker of %s is seen, but of %s there %s %s", name[1], name[0],
                 some, ids);
    return true;
}

void gn_tracker_get_counts(const struct gn_tracker *t, struct gn_tracker_counts *out)
{
    *out = t->counts;
    gn_watch_get_counts(t->watch, &out->markers);
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
    static const struct gn_ink outline = {255, 200, 0};
    if (!t->has_picture)
        return -EINVAL;
    int err = gn_image8_init(out_rgb, t->grey.width, t->grey.height, 3);
    if (err)
        return err;
    size_t n = (size_t)t->grey.width * (size_t)t->grey.height;
    for (size_t i = 0; i < 3 * n; i++)
        out_rgb->data[i] = t->grey.pixels[i / 3];
    int n_seen;
    const struct gn_marker_sighting *seen = gn_watch_get_sightings(t->watch, &n_seen);
    for (int i = 0; i < n_seen; i++)
        for (int k = 0; k < 4; k++)
            gn_draw_line(out_rgb, seen[i].corners[k], seen[i].corners[(k + 1) % 4], outline);
    for (int i = 0; i < t->bodies->n_bodies; i++)
        if (t->tracked[i].is_seen)
            gn_axes_draw(out_rgb, &t->camera, &t->tracked[i].camera_from_body,
                         get_reach(&t->bodies->bodies[i]));
    return 0;
}
