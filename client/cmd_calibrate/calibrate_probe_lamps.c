/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "client/cmd_calibrate/calibrate_probe.h"

/** More is not written: shadows would visibly fall another way. */
#define MAX_UNCERTAINTY_DEG 1.0

int gn_probe_run_read_lamps(struct gn_probe_run *run, struct gn_error *out_error)
{
    int n = gn_lamps_read_file(gn_probe_run_get(run, "lamps"), run->lamps, out_error);
    run->n_lamps = n < 0 ? 0 : n;
    if (n == 1)
        return gn_error_set(out_error, -EINVAL,
                            "%s has one lamp: two in a picture each, or three, say where the probe "
                            "looks",
                            gn_probe_run_get(run, "lamps"));
    return n < 0 ? n : 0;
}

static bool is_in(const struct gn_lamp *lamp, const char *picture)
{
    return strcmp(lamp->picture, "*") == 0 || strcmp(lamp->picture, picture) == 0;
}

int gn_probe_run_look_for_lamps(struct gn_probe_run *run, int picture, const struct gn_image *light,
                                struct gn_error *out_error)
{
    struct gn_spot spots[GN_SPOTS_MAX];
    char name[GN_FILE_NAME_BYTES];
    const char *path = run->list.entries[picture].path;
    int n_here = 0, n_taken = 0;
    gn_file_get_name(path, name);
    for (int k = 0; k < run->n_lamps; k++)
        n_here += is_in(&run->lamps[k], name);
    if (n_here == 0) {
        printf("%s: no lamp is said to be in it\n", path);
        return 0;
    }
    int max = n_here + 2 < GN_SPOTS_MAX ? n_here + 2 : GN_SPOTS_MAX;
    int n =
        gn_spots_find(light, gn_options_get_double(run->options, NULL, NULL, "share"), max, spots);
    if (n < 0)
        return gn_error_set(out_error, n, "out of memory");
    printf("%s: %d bright spots, %d lamps\n", path, n, n_here);
    // The brightest first, whole: a spot without some of its lamps could be taken for another.
    for (; n_taken < n && run->n_candidates + n_here <= GN_FISHEYE_MAX_CANDIDATES; n_taken++)
        for (int k = 0; k < run->n_lamps; k++) {
            if (!is_in(&run->lamps[k], name))
                continue;
            struct gn_fisheye_puzzle *c = &run->candidates[run->n_candidates++];
            memcpy(c->xy, spots[n_taken].xy, sizeof(c->xy));
            memcpy(c->dir_world, run->lamps[k].dir_world, sizeof(c->dir_world));
            c->picture = picture;
        }
    if (n_taken < n)
        printf("%s: its %d dimmest spots are left out: at most %d pairs of a spot and a lamp are "
               "matched; say for each lamp which picture shows it\n",
               path, n - n_taken, GN_FISHEYE_MAX_CANDIDATES);
    return 0;
}

/** Refuses where a lamp is in none of the spots that it should be. */
static int check_lamps(const struct gn_probe_run *run, struct gn_error *out_error)
{
    for (int k = 0; k < run->n_lamps; k++) {
        const double *dir = run->lamps[k].dir_world;
        bool is_looked_for = false, is_seen = false;
        for (int i = 0; i < run->n_candidates; i++)
            is_looked_for |= memcmp(run->candidates[i].dir_world, dir, 3 * sizeof(*dir)) == 0;
        for (int i = 0; i < run->n_matched; i++)
            is_seen |= memcmp(run->matched[i].dir_world, dir, 3 * sizeof(*dir)) == 0;
        if (is_looked_for && !is_seen)
            return gn_error_set(
                out_error, -EDOM,
                "lamp %d, direction %.3f %.3f %.3f, is not where the others say: is "
                "each way from the probe to the lamp, in the marker's frame, and "
                "is the projection right? (Leave out a lamp that is hidden.)",
                k + 1, dir[0], dir[1], dir[2]);
    }
    return 0;
}

int gn_probe_run_fit_lamps(struct gn_probe_run *run, struct gn_error *out_error)
{
    struct gn_projection projection = run->setup.projection;
    struct gn_fisheye_fit fit;
    int moves = (int)gn_options_get_set(run->options, NULL, NULL, "fit"), stride = 1;
    int n = gn_fisheye_match(&projection, run->candidates, run->n_candidates,
                             gn_options_get_double(run->options, NULL, NULL, "tolerance"),
                             run->matched, &stride, out_error);
    if (stride > 1)
        printf("%d pairs of a spot and a lamp are too many to try them all: one in %d orientations "
               "was tried; say for each lamp which picture shows it\n",
               run->n_candidates, stride);
    if (n < 0)
        return n;
    run->n_matched = n;
    int err = check_lamps(run, out_error);
    if (!err)
        err = gn_fisheye_fit(&projection, moves, run->matched, n, &fit, out_error);
    if (err)
        return err;
    for (int i = 0; i < n; i++)
        printf("lamp at %.2f, %.2f px, direction %.3f %.3f %.3f: %.3f degrees off\n",
               run->matched[i].xy[0], run->matched[i].xy[1], run->matched[i].dir_world[0],
               run->matched[i].dir_world[1], run->matched[i].dir_world[2],
               run->matched[i].error_deg);
    const double *q = fit.world_from_probe.rotation;
    printf("orientation %.6f %.6f %.6f %.6f; %d lamps off by %.3f degrees RMS, uncertainty %.3f "
           "degrees, condition number %.1f (at most %.0f)\n",
           q[0], q[1], q[2], q[3], n, fit.rms_deg, fit.uncertainty_deg, fit.condition,
           GN_FISHEYE_MAX_CONDITION);
    if (fit.uncertainty_deg > MAX_UNCERTAINTY_DEG)
        return gn_error_set(out_error, -EDOM,
                            "the orientation is uncertain by %.2f degrees, more than %.1f: lamps "
                            "farther away, more of them, or their places measured better",
                            fit.uncertainty_deg, MAX_UNCERTAINTY_DEG);
    run->setup.projection = fit.projection;
    run->world_from_probe = fit.world_from_probe;
    run->has_pose = true;
    return 0;
}
