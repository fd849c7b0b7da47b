/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <math.h>

#include "client/cmd_calibrate/calibrate_input.h"
#include "client/cmd_calibrate/calibrate_probe.h"
#include "common/draw.h"
#include "common/png.h"

static const struct gn_ink green = {0, 220, 0}, red = {255, 40, 0}, blue = {60, 140, 255},
                           yellow = {255, 200, 0};

/** A projection that has not been made valid shows nothing. */
static bool can_project(const struct gn_probe_run *run)
{
    return run->setup.projection.focal > 0;
}

static void draw_circles(const struct gn_probe_run *run, struct gn_image8 *shades)
{
    const struct gn_projection *p = &run->setup.projection;
    if (can_project(run))
        gn_draw_circle(shades, p->center[0], p->center[1], p->radius, blue);
    else if (run->has_circle)
        gn_draw_circle(shades, run->circle.center[0], run->circle.center[1], run->circle.radius,
                       blue);
    if (run->mask[2] > 0)
        gn_draw_circle(shades, run->mask[0], run->mask[1], run->mask[2], red);
}

static void draw_lamps(const struct gn_probe_run *run, struct gn_image8 *shades)
{
    struct gn_pose probe_from_world;
    for (int i = 0; i < run->n_candidates; i++)
        gn_draw_circle(shades, run->candidates[i].xy[0], run->candidates[i].xy[1], 6, yellow);
    for (int i = 0; i < run->n_matched; i++)
        gn_draw_circle(shades, run->matched[i].xy[0], run->matched[i].xy[1], 6, green);
    if (!run->has_pose)
        return;
    gn_pose_invert(&run->world_from_probe, &probe_from_world);
    for (int i = 0; i < run->n_matched; i++) {
        double dir[3], xy[2];
        gn_pose_rotate(&probe_from_world, run->matched[i].dir_world, dir);
        if (gn_projection_get_position(&run->setup.projection, dir, xy))
            gn_draw_dot(shades, xy[0], xy[1], 1.5, red);
    }
}

/** A straight line between two points of the probe's frame, which a fisheye bends. */
static void draw_bent(const struct gn_projection *p, struct gn_image8 *shades,
                      const double from[static 3], const double to[static 3], struct gn_ink ink)
{
    enum { PIECES = 24 };
    double before[2], xy[2];
    bool was_seen = false;
    for (int i = 0; i <= PIECES; i++) {
        double at[3], length = 0, t = (double)i / PIECES;
        for (int k = 0; k < 3; k++) {
            at[k] = (1 - t) * from[k] + t * to[k];
            length = hypot(length, at[k]);
        }
        for (int k = 0; k < 3; k++)
            at[k] /= length;
        bool is_seen = length > 0 && gn_projection_get_position(p, at, xy);
        if (is_seen && was_seen)
            gn_draw_line(shades, before, xy, ink);
        was_seen = is_seen;
        before[0] = xy[0];
        before[1] = xy[1];
    }
}

/** The world's axes, x red, y green, z blue, as long as the first marker is wide. */
static void draw_axes(const struct gn_probe_run *run, const struct gn_pose *probe_from_world,
                      struct gn_image8 *shades)
{
    static const struct gn_ink inks[3] = {{255, 40, 0}, {0, 220, 0}, {60, 140, 255}};
    const double(*c)[3] = run->sightings[0].corners_world;
    double length = hypot(hypot(c[1][0] - c[0][0], c[1][1] - c[0][1]), c[1][2] - c[0][2]);
    double origin[3];
    gn_pose_transform(probe_from_world, (const double[3]){0}, origin);
    for (int k = 0; k < 3; k++) {
        double tip[3] = {0};
        tip[k] = length;
        gn_pose_transform(probe_from_world, tip, tip);
        draw_bent(&run->setup.projection, shades, origin, tip, inks[k]);
    }
}

static void draw_markers(const struct gn_probe_run *run, struct gn_image8 *shades)
{
    const struct gn_projection *p = &run->setup.projection;
    struct gn_pose probe_from_world;
    for (int i = 0; i < run->n_markers; i++) {
        const struct gn_probe_marker *m = &run->markers[i];
        bool is_used = run->has_pose && m->sighting >= 0 && run->sightings[m->sighting].is_used;
        for (int k = 0; k < 4; k++)
            draw_bent(p, shades, m->seen.dirs[k], m->seen.dirs[(k + 1) % 4],
                      is_used ? green : yellow);
    }
    if (!run->has_pose || run->n_sightings == 0)
        return;
    gn_pose_invert(&run->world_from_probe, &probe_from_world);
    draw_axes(run, &probe_from_world, shades);
    for (int i = 0; i < 4 * run->n_sightings; i++) {
        double at[3], length = 0, xy[2];
        gn_pose_transform(&probe_from_world, run->sightings[i / 4].corners_world[i % 4], at);
        for (int k = 0; k < 3; k++)
            length = hypot(length, at[k]);
        for (int k = 0; k < 3; k++)
            at[k] /= length;
        if (length > 0 && gn_projection_get_position(p, at, xy))
            gn_draw_dot(shades, xy[0], xy[1], 1.5, red);
    }
}

int gn_probe_run_draw(const struct gn_probe_run *run, const char *path, struct gn_error *out_error)
{
    struct gn_image8 shades = {0};
    int err = gn_calibrate_stretch(&run->first, &shades);
    if (err)
        return gn_error_set(out_error, err, "%s: out of memory", path);
    draw_circles(run, &shades);
    draw_lamps(run, &shades);
    if (can_project(run))
        draw_markers(run, &shades);
    err = gn_png_write_file(path, &shades, out_error);
    gn_image8_finish(&shades);
    return err;
}
