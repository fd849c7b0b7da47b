/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_places.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/file.h"
#include "client/poses.h"
#include "client/track/rotation.h"
#include "client/track/tracker.h"
#include "common/compare.h"

#define DEGREE 57.29577951308232

/** Poses this many of their errors from the middlemost agree, whatever the others do. */
static const double least_spread = 3;
/** An error is taken to be this large at least. */
static const double least_rad = 0.03 / DEGREE, least_m = 3e-4;

/** The places of one body that the pictures say. */
struct said {
    int n;
    struct gn_pose pose[GN_PLACES_MAX_PICTURES];
    double error_rad[GN_PLACES_MAX_PICTURES], error_m[GN_PLACES_MAX_PICTURES];
};

static void take(const struct gn_tracker *tracker, int world, int body, struct said *said)
{
    if (body == world || said->n == GN_PLACES_MAX_PICTURES ||
        !gn_tracker_get_between(tracker, world, body, &said->pose[said->n]))
        return;
    const struct gn_pose_fit *a = &gn_tracker_get_body(tracker, world)->fit;
    const struct gn_pose_fit *b = &gn_tracker_get_body(tracker, body)->fit;
    // A turn of the world's pose moves what lies beside it.
    double reach = 0;
    for (int k = 0; k < 3; k++)
        reach = hypot(reach, said->pose[said->n].translation[k]);
    said->error_rad[said->n] = hypot(a->error_rad, b->error_rad);
    said->error_m[said->n++] = hypot(hypot(a->error_m, b->error_m), a->error_rad * reach);
}

static int read_pictures(const struct gn_bodies *bodies, const char *camera_path,
                         const char *pattern, struct said *said, struct gn_error *out_error)
{
    struct gn_camera camera;
    struct gn_tracker *tracker = NULL;
    struct gn_source *source = NULL;
    struct gn_file_list list = {0};
    struct gn_capture capture;
    const struct gn_file_source_options as_they_are = {0};
    int world = gn_bodies_find(bodies, GN_BODY_WORLD), got = 0;
    bool has_place;
    const struct gn_tracker_options options = {.camera = &camera, .bodies = bodies, .is_raw = true};
    int err = gn_poses_read_camera(camera_path, &camera, &has_place, out_error);
    if (!err)
        err = gn_file_list_find(pattern, 1, &list, out_error); // 1 Hz: each by itself
    if (!err && list.n_entries > GN_PLACES_MAX_PICTURES)
        err = gn_error_set(out_error, -E2BIG, "%s: %d pictures, at most %d are taken", pattern,
                           list.n_entries, GN_PLACES_MAX_PICTURES);
    if (!err)
        err = gn_tracker_create(&options, &tracker, out_error);
    if (!err && gn_file_source_open(&list, &as_they_are, &source) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    while (!err && (got = gn_source_read(source, &capture, out_error)) > 0) {
        int seen = gn_tracker_update(tracker, &capture, gn_poses_get_time_ns(&capture), out_error);
        err = seen < 0 ? seen : 0;
        for (int i = 0; i < bodies->n_bodies && !err; i++)
            take(tracker, world, i, &said[i]);
    }
    gn_source_close(&source);
    gn_tracker_destroy(&tracker);
    gn_file_list_finish(&list);
    return err ? err : got;
}

/** How far apart two pictures put the body, turned or moved, in units of their errors. */
static double get_distance(const struct said *said, int i, int k)
{
    const struct gn_pose *a = &said->pose[i], *b = &said->pose[k];
    double rad = fmax(hypot(said->error_rad[i], said->error_rad[k]), least_rad), apart = 0;
    double m = fmax(hypot(said->error_m[i], said->error_m[k]), least_m);
    for (int j = 0; j < 3; j++)
        apart = hypot(apart, a->translation[j] - b->translation[j]);
    return fmax(gn_rotation_get_angle(a->rotation, b->rotation) / rad, apart / m);
}

/** Distances from the pose that is nearest to all others; returns their median. */
static double get_distances(const struct said *said, double *out_distance)
{
    double best = INFINITY, sorted[GN_PLACES_MAX_PICTURES];
    int middle = 0;
    for (int i = 0; i < said->n; i++) {
        double sum = 0;
        for (int k = 0; k < said->n; k++)
            sum += get_distance(said, i, k);
        middle = sum < best ? i : middle;
        best = fmin(best, sum);
    }
    for (int i = 0; i < said->n; i++)
        sorted[i] = out_distance[i] = get_distance(said, middle, i);
    qsort(sorted, (size_t)said->n, sizeof(*sorted), gn_compare_doubles);
    return sorted[(said->n - 1) / 2];
}

/** The mean of those that agree. */
static void average(const struct said *said, struct gn_body_place *out)
{
    double distance[GN_PLACES_MAX_PICTURES], q[4] = {0}, t[3] = {0};
    double expected[2] = {0}, scatter[2] = {0}; // rad, m: squares
    double bound = fmax(3 * get_distances(said, distance), least_spread);
    const double *middle = NULL;
    int n = 0;
    *out = (struct gn_body_place){.is_known = true};
    for (int i = 0; i < said->n; i++) {
        if (distance[i] > bound)
            continue;
        const double *r = said->pose[i].rotation;
        middle = middle ? middle : r;
        double sign = r[0] * middle[0] + r[1] * middle[1] + r[2] * middle[2] + r[3] * middle[3];
        for (int k = 0; k < 4; k++)
            q[k] += sign < 0 ? -r[k] : r[k];
        for (int k = 0; k < 3; k++)
            t[k] += said->pose[i].translation[k];
        expected[0] += said->error_rad[i] * said->error_rad[i];
        expected[1] += said->error_m[i] * said->error_m[i];
        n++;
    }
    double length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int k = 0; k < 4; k++)
        out->world_from_body.rotation[k] = q[k] / length;
    for (int k = 0; k < 3; k++)
        out->world_from_body.translation[k] = t[k] / n;
    for (int i = 0; i < said->n; i++) {
        if (distance[i] > bound)
            continue;
        double turn = gn_rotation_get_angle(out->world_from_body.rotation, said->pose[i].rotation);
        scatter[0] += turn * turn;
        for (int k = 0; k < 3; k++)
            scatter[1] += pow(said->pose[i].translation[k] - t[k] / n, 2);
    }
    // By their scatter, but not less than what one picture is expected to be off by.
    out->n_pictures = n;
    out->error_rad = sqrt(fmax(scatter[0] / n, expected[0]) / n);
    out->error_m = sqrt(fmax(scatter[1] / n, expected[1]) / n);
}

static int judge(const struct gn_body *body, const struct said *said,
                 const struct gn_body_place *place, struct gn_error *out_error)
{
    if (2 * place->n_pictures < said->n + 1 && said->n > 1)
        return gn_error_set(out_error, -EDOM,
                            "the place of \"%s\" in the world: only %d of %d pictures agree; did "
                            "it move, or are the markers too small?",
                            body->name, place->n_pictures, said->n);
    if (!(place->error_rad <= GN_PLACES_MAX_ERROR))
        return gn_error_set(out_error, -EDOM,
                            "the place of \"%s\" in the world is uncertain by %.2f degrees, at "
                            "most %.1f is right: take the camera nearer, the markers larger",
                            body->name, DEGREE * place->error_rad, DEGREE * GN_PLACES_MAX_ERROR);
    printf("\"%s\" in the world: %d of %d pictures agree, uncertainty %.3f degrees, %.1f mm\n",
           body->name, place->n_pictures, said->n, DEGREE * place->error_rad, 1e3 * place->error_m);
    return 0;
}

int gn_places_find(const struct gn_bodies *bodies, const char *camera_path, const char *pattern,
                   struct gn_body_place *out_places, struct gn_error *out_error)
{
    int world = gn_bodies_find(bodies, GN_BODY_WORLD), n_known = 0, err = 0;
    memset(out_places, 0, GN_BODY_MAX_BODIES * sizeof(*out_places));
    if (world >= 0)
        out_places[world] = (struct gn_body_place){true, {{1, 0, 0, 0}, {0}}, 0, 0, 0};
    if (!camera_path)
        return 0;
    struct said *said = calloc(GN_BODY_MAX_BODIES, sizeof(*said));
    if (!said)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    err = read_pictures(bodies, camera_path, pattern, said, out_error);
    for (int i = 0; i < bodies->n_bodies && !err; i++) {
        if (said[i].n == 0)
            continue;
        average(&said[i], &out_places[i]);
        err = judge(&bodies->bodies[i], &said[i], &out_places[i], out_error);
        n_known++;
    }
    if (!err && n_known == 0)
        err = gn_error_set(out_error, -EDOM,
                           "%s: no picture shows markers of \"" GN_BODY_WORLD
                           "\" and of another body together",
                           pattern);
    free(said);
    return err;
}
