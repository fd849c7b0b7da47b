/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/cmd_calibrate/calibrate_places.h"
#include "client/cmd_calibrate/calibrate_probe.h"
#include "client/feature.h"
#include "client/poses.h"
#include "client/vision/markers.h"

#define DEGREE 57.29577951308232

const char *gn_probe_run_find_marker_misuse(const struct gn_probe_run *run)
{
    bool has_file = gn_probe_run_has(run, "markers"), has_one = gn_probe_run_has(run, "marker");
    bool has_camera = gn_probe_run_has(run, "camera");
    if (has_camera != gn_probe_run_has(run, "camera-files") || (has_camera && !has_file))
        return "--camera and --camera-files go together, with --markers";
    if (!has_file && !has_one)
        return NULL;
    if (has_file && has_one)
        return "give one of --markers FILE and --marker DICT:ID:SIZE";
    if (gn_probe_run_has(run, "lamps"))
        return "markers and lamps each say where the probe looks: give --lamps, or --markers or "
               "--marker";
    if (gn_options_get_set(run->options, NULL, NULL, "fit") != 0)
        return "--fit is for --lamps: a few markers do not determine a lens";
    if (gn_probe_run_has(run, "ball"))
        return "--ball: a mirror ball sees markers from its surface, not from one point: give "
               "--lamps";
    return NULL;
}

int gn_probe_run_read_markers(struct gn_probe_run *run, struct gn_error *out_error)
{
    const char *path = gn_probe_run_get(run, "markers");
    if (!gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    if (run->setup.projection.type == GN_PROJECTION_MIRRORBALL)
        return gn_error_set(out_error, -EINVAL,
                            "a mirror ball sees markers from its surface, not from one point, and "
                            "its size is not known: give --lamps, farther off than 20 of its "
                            "radii");
    int err = path ? gn_bodies_read_file(path, &run->bodies, out_error)
                   : gn_bodies_read_text(gn_probe_run_get(run, "marker"), &run->bodies, out_error);
    if (!err)
        gn_poses_doubt_sizes(&run->bodies, path ? path : "--marker");
    if (!err && gn_bodies_find(&run->bodies, GN_BODY_WORLD) < 0)
        err = gn_error_set(out_error, -EINVAL,
                           "%s: there is no body \"" GN_BODY_WORLD
                           "\", in whose frame the probe's orientation is to be",
                           path);
    return err;
}

/** Where the marker's corners are in the world; -1: nothing says that. */
static int add_sighting(struct gn_probe_run *run, const struct gn_body_place *places,
                        const struct gn_fisheye_marker *seen)
{
    int body, marker;
    if (!gn_bodies_find_marker(&run->bodies, seen->id, &body, &marker) || !places[body].is_known)
        return -1;
    struct gn_probe_sighting *s = &run->sightings[run->n_sightings];
    *s = (struct gn_probe_sighting){.error_rad = seen->error_rad, .marker = seen->id};
    memcpy(s->dirs_probe, seen->dirs, sizeof(s->dirs_probe));
    for (int k = 0; k < 4; k++)
        gn_pose_transform(&places[body].world_from_body,
                          run->bodies.bodies[body].markers[marker].corners_body[k],
                          s->corners_world[k]);
    return run->n_sightings++;
}

/** A line about one marker of a picture. */
static void print_marker(const struct gn_probe_run *run, const struct gn_probe_marker *m)
{
    int body, marker;
    printf("  marker %d: %.0f px wide%s", m->seen.id, m->seen.width_px,
           m->seen.is_coarse ? ", too small, dim or blurred to measure its edges" : "");
    if (!gn_bodies_find_marker(&run->bodies, m->seen.id, &body, &marker))
        printf("; not listed, left out");
    else if (m->sighting < 0)
        printf("; where \"%s\" is in the world is not known, left out: see --camera-files",
               run->bodies.bodies[body].name);
    printf("\n");
}

static int look_into(struct gn_probe_run *run, struct gn_fisheye_finder *finder, int picture,
                     const struct gn_body_place *places, struct gn_fisheye_marker *found,
                     struct gn_error *out_error)
{
    struct gn_image light = {0};
    int n_twice = 0, err = gn_probe_run_read_light(run, picture, &light, out_error);
    int n = err ? err : gn_fisheye_finder_find(finder, &light, found, &n_twice, out_error);
    gn_image_finish(&light);
    if (n < 0)
        return n;
    printf("%s: %d marker%s", run->list.entries[picture].path, n, n == 1 ? "" : "s");
    if (n_twice > 0)
        printf(", and %d seen at two places, left out", n_twice);
    printf("\n");
    for (int i = 0; i < n; i++) {
        if (run->n_markers == GN_PROBE_POSE_MAX_SIGHTINGS)
            return gn_error_set(out_error, -E2BIG,
                                "%s: more than %d markers in all pictures: take fewer pictures",
                                run->list.entries[picture].path, GN_PROBE_POSE_MAX_SIGHTINGS);
        struct gn_probe_marker *m = &run->markers[run->n_markers++];
        *m = (struct gn_probe_marker){found[i], picture, add_sighting(run, places, &found[i])};
        print_marker(run, m);
    }
    return 0;
}

static int find_all(struct gn_probe_run *run, const struct gn_body_place *places,
                    struct gn_error *out_error)
{
    struct gn_fisheye_finder *finder = NULL;
    struct gn_fisheye_marker *found = calloc(GN_FISHEYE_MAX_MARKERS, sizeof(*found));
    int err = found ? gn_fisheye_finder_create(&run->setup.projection, run->bodies.dictionary,
                                               &finder, out_error)
                    : gn_error_set(out_error, -ENOMEM, "out of memory");
    for (int i = 0; i < run->list.n_entries && !err; i++)
        err = look_into(run, finder, i, places, found, out_error);
    gn_fisheye_finder_destroy(&finder);
    free(found);
    if (!err && run->n_sightings == 0)
        err = gn_error_set(out_error, -EDOM,
                           "no marker whose place is known is seen in %d pictures: it needs a "
                           "white margin and cells 2 px wide or more, and the right projection",
                           run->list.n_entries);
    return err;
}

/** What the places of other bodies than the world add to the errors. */
static void add_errors(const struct gn_probe_run *run, const struct gn_body_place *places,
                       struct gn_probe_pose *pose)
{
    double rad = 0, m = 0;
    for (int i = 0; i < run->n_markers; i++) {
        int at = run->markers[i].sighting, body, marker;
        if (at < 0 || !run->sightings[at].is_used ||
            !gn_bodies_find_marker(&run->bodies, run->markers[i].seen.id, &body, &marker))
            continue;
        double reach = 0;
        for (int k = 0; k < 3; k++)
            reach = hypot(reach, pose->world_from_probe.translation[k] -
                                     places[body].world_from_body.translation[k]);
        rad = fmax(rad, places[body].error_rad);
        m = fmax(m, hypot(places[body].error_m, places[body].error_rad * reach));
    }
    pose->error_rad = hypot(pose->error_rad, rad);
    pose->error_m = hypot(pose->error_m, m);
}

/** Where corners are off by more than pixels make them, the lens is not as it is said to be. */
static void print_misfit(const struct gn_probe_run *run, const struct gn_probe_pose *pose)
{
    double expected = 0;
    for (int i = 0; i < run->n_sightings; i++)
        expected = fmax(expected, run->sightings[i].is_used ? run->sightings[i].error_rad : 0);
    if (pose->rms_rad > 4 * expected)
        printf(
            "that is %.0f times what their edges are good to: circle, lens or a marker's size and "
            "place may be a little wrong, and the orientation by more than its uncertainty\n",
            pose->rms_rad / expected);
}

static void print_result(const struct gn_probe_run *run, const struct gn_probe_pose *pose)
{
    const double *q = pose->world_from_probe.rotation, *t = pose->world_from_probe.translation;
    for (int i = 0; i < run->n_markers; i++) {
        const struct gn_probe_marker *m = &run->markers[i];
        const struct gn_probe_sighting *s = m->sighting < 0 ? NULL : &run->sightings[m->sighting];
        if (s && !s->is_used)
            printf("%s: marker %d is %.2f degrees off where the others put it, left out\n",
                   run->list.entries[m->picture].path, m->seen.id, DEGREE * s->rms_rad);
    }
    printf("orientation %.6f %.6f %.6f %.6f, uncertainty %.3f degrees; position %.4f %.4f %.4f m, "
           "uncertainty %.1f mm\n",
           q[0], q[1], q[2], q[3], DEGREE * pose->error_rad, t[0], t[1], t[2], 1e3 * pose->error_m);
    printf("by %d of %d sightings of markers, corners off by %.3f degrees RMS", pose->n_used,
           run->n_sightings, DEGREE * pose->rms_rad);
    if (isfinite(pose->margin))
        printf("; the next best pose fits worse by %.0f (at least %.0f)", pose->margin,
               GN_PROBE_POSE_MIN_MARGIN);
    printf("\n");
    print_misfit(run, pose);
}

int gn_probe_run_fit_markers(struct gn_probe_run *run, struct gn_error *out_error)
{
    struct gn_body_place places[GN_BODY_MAX_BODIES];
    struct gn_probe_pose pose = {0};
    int err = gn_places_find(&run->bodies, gn_probe_run_get(run, "camera"),
                             gn_probe_run_get(run, "camera-files"), places, out_error);
    if (!err)
        err = find_all(run, places, out_error);
    if (!err)
        err = gn_probe_pose_fit(run->sightings, run->n_sightings, &pose, out_error);
    if (pose.n_used == 0)
        return err;
    run->world_from_probe = pose.world_from_probe;
    run->has_pose = true; // to be looked at, refused or not
    if (err)
        return err;
    add_errors(run, places, &pose);
    print_result(run, &pose);
    if (!(pose.error_rad <= GN_PROBE_POSE_MAX_ERROR))
        return gn_error_set(out_error, -EDOM,
                            "the orientation is uncertain by %.2f degrees with the places of "
                            "bodies by --camera-files, at most %.1f is right",
                            DEGREE * pose.error_rad, DEGREE * GN_PROBE_POSE_MAX_ERROR);
    return 0;
}
