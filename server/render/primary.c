/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

#include "server/render/pass.h"

bool gn_primary_has_same_rays(const struct gn_camera *a, const struct gn_camera *b)
{
    return a->width == b->width && a->height == b->height && a->fx == b->fx && a->fy == b->fy &&
           a->cx == b->cx && a->cy == b->cy &&
           memcmp(a->distortion, b->distortion, sizeof(a->distortion)) == 0;
}

struct rays_job {
    const struct gn_camera *camera;
    const struct pass *pass; // NULL: rays through the centres
    float *table;
};

static void make_row(void *context, int y, int worker)
{
    (void)worker;
    const struct rays_job *job = context;
    const struct gn_camera *camera = job->camera;
    float *row = job->table + (size_t)y * (size_t)camera->width * 3;
    for (int x = 0; x < camera->width; x++) {
        double dir[3];
        double at[2] = {0.5, 0.5};
        if (job->pass)
            gn_pass_get_point(job->pass, x, y, at);
        if (!gn_camera_get_ray(camera, x + at[0], y + at[1], dir))
            dir[0] = dir[1] = dir[2] = 0;
        for (int k = 0; k < 3; k++)
            row[3 * x + k] = (float)dir[k];
    }
}

/** Slopes of a ray; false where the camera has none. */
static bool get_slopes(const float *dir, double out[static 2])
{
    if (!(dir[2] > 0))
        return false;
    out[0] = (double)dir[0] / dir[2];
    out[1] = (double)dir[1] / dir[2];
    return true;
}

/** Bounds of all slopes, and of the rays of grids: they lie between neighbours or half a pixel
 * outside, so twice the widest step between neighbours is kept as a margin. */
static void bound_slopes(const struct gn_camera *camera, const float *table, double s[static 4])
{
    size_t width = (size_t)camera->width;
    size_t n = width * (size_t)camera->height;
    double step[2] = {1 / camera->fx, 1 / camera->fy};
    s[0] = s[2] = INFINITY;
    s[1] = s[3] = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        double here[2];
        double there[2];
        if (!get_slopes(table + 3 * i, here))
            continue;
        for (int k = 0; k < 2; k++) {
            s[2 * k] = fmin(s[2 * k], here[k]);
            s[2 * k + 1] = fmax(s[2 * k + 1], here[k]);
        }
        for (int k = 0; k < 2; k++) {
            bool is_last = k == 0 ? i % width == width - 1 : i + width >= n;
            if (is_last || !get_slopes(table + 3 * (i + (k == 0 ? 1 : width)), there))
                continue;
            for (int a = 0; a < 2; a++)
                step[a] = fmax(step[a], fabs(there[a] - here[a]));
        }
    }
    for (int k = 0; k < 2; k++) {
        s[2 * k] -= 2 * step[k];
        s[2 * k + 1] += 2 * step[k];
    }
}

void gn_primary_make_rays(const struct gn_camera *camera, const struct pass *pass,
                          struct gn_pool *pool, float *table, double *out_slopes)
{
    struct rays_job job = {.camera = camera, .pass = pass, .table = table};
    gn_pool_run(pool, camera->height, make_row, &job);
    if (out_slopes)
        bound_slopes(camera, table, out_slopes);
}

void gn_primary_aim(const struct frame *frame, const float dir_camera[static 3],
                    struct sample *sample)
{
    const double *r = frame->world_from_camera;
    for (int k = 0; k < 3; k++)
        sample->dir[k] = (float)(r[3 * k] * dir_camera[0] + r[3 * k + 1] * dir_camera[1] +
                                 r[3 * k + 2] * dir_camera[2]);
    sample->dir_z = dir_camera[2];
}

void gn_primary_aim_block(const struct frame *frame, int x, int y, struct sight_rays *out)
{
    size_t width = (size_t)frame->camera->width;
    float dir[3][LANES];
    const float *const from_camera[3] = {dir[0], dir[1], dir[2]};
    float *const world[3] = {out->dir[0], out->dir[1], out->dir[2]};
    for (int i = 0; i < LANES; i++) {
        int px = x + i % BLOCK;
        int py = y + i / BLOCK;
        bool is_inside = px < frame->camera->width && py < frame->camera->height;
        const float *from = frame->rays + (is_inside ? 3 * ((size_t)py * width + (size_t)px) : 0);
        for (int k = 0; k < 3; k++)
            dir[k][i] = from[k];
        out->has_ray[i] = is_inside && from[2] > 0;
    }
    frame->kernels->turn(frame->world_from_camera, from_camera, world);
    memcpy(out->dir_z, dir[2], sizeof(out->dir_z));
}

static void trace_block(const struct frame *frame, const struct sight_rays *rays,
                        struct gn_rt_packet_hits *hits, struct tile_figures *figures)
{
    struct gn_rt_packet packet;
    int n_rays = 0;
    for (int i = 0; i < LANES; i++) {
        packet.org_x[i] = frame->origin[0];
        packet.org_y[i] = frame->origin[1];
        packet.org_z[i] = frame->origin[2];
        packet.t_near[i] = 0;
        packet.t_far[i] = INFINITY;
        packet.valid[i] = rays->has_ray[i] ? -1 : 0;
        n_rays += rays->has_ray[i];
    }
    memcpy(packet.dir_x, rays->dir[0], sizeof(packet.dir_x));
    memcpy(packet.dir_y, rays->dir[1], sizeof(packet.dir_y));
    memcpy(packet.dir_z, rays->dir[2], sizeof(packet.dir_z));
    hits->met = 0;
    figures->rays_primary += (uint64_t)n_rays;
    // One ray against both sets: what is nearest is seen, so real objects hide virtual ones.
    if (n_rays > 0)
        gn_rt_intersect16(frame->rt, frame->seen, &packet, hits);
}

/** Is what a ray sees of the object told by the hit alone? */
static bool is_simple(const struct frame *frame, const struct gn_scene_object *object)
{
    if (object->role != GN_RT_REAL || object->is_movable || object->mesh.normals)
        return false;
    if (!frame->run_optics)
        return true;
    return !gn_optics_may_show(object);
}

/* Rays leave a resting surface that is not lifted by its clearance off the point, at most
 * FLT_EPSILON (4 + 16 x 2) times the largest coordinate: less than half of the frame's margin. */
static bool bound_block(const struct frame *frame, const struct gn_rt_packet_hits *hits,
                        struct box *out_box)
{
    for (uint32_t met = hits->met; met != 0; met &= met - 1) {
        uint32_t index = hits->object[__builtin_ctz(met)];
        if (!is_simple(frame, &frame->scene->objects[index]))
            return false;
    }
    gn_rt_bound_points(frame->rt, hits, out_box->min, out_box->max);
    for (int k = 0; k < 3; k++) {
        out_box->min[k] -= frame->margin;
        out_box->max[k] += frame->margin;
    }
    return true;
}

void gn_primary_see_block(const struct frame *frame, const struct sight_rays *rays,
                          struct sight *out, struct tile_figures *figures)
{
    trace_block(frame, rays, &out->hits, figures);
    for (int i = 0; i < LANES; i++) {
        bool is_met = out->hits.met >> i & 1;
        out->depth[i] = is_met ? out->hits.distance[i] * rays->dir_z[i] : INFINITY;
    }
    out->is_bounded = (frame->skips || frame->kept) && bound_block(frame, &out->hits, &out->box);
}

void gn_primary_take(const struct frame *frame, const struct sight_rays *rays,
                     const struct gn_rt_packet_hits *hits, int lane, struct sample *s,
                     struct tile_figures *figures)
{
    const struct gn_surface *surface = &s->surface;
    struct gn_rt_hit hit;
    for (int k = 0; k < 3; k++)
        s->dir[k] = rays->dir[k][lane];
    s->dir_z = rays->dir_z[lane];
    s->kind = SAMPLE_NOTHING;
    s->depth = INFINITY;
    s->is_receiver = s->is_cut = s->is_lit = false;
    s->shown = 0;
    if (!(hits->met >> lane & 1))
        return;
    gn_rt_get_hit(frame->rt, hits, lane, &hit);
    gn_scene_get_surface_filtered(frame->scene, s->dir, &hit, hit.distance * frame->pixel_angle,
                                  &s->surface);
    s->kind = surface->role == GN_RT_VIRTUAL ? SAMPLE_VIRTUAL : SAMPLE_REAL;
    s->object = hit.object;
    s->depth = hit.distance * s->dir_z;
    gn_surface_get_origin(surface, s->org);
    // A shadow is less light on a diffuse surface; real mirrors and glass show other things.
    s->is_receiver =
        s->kind == SAMPLE_REAL && (surface->material == GN_MATERIAL_DIFFUSE ||
                                   (surface->material == GN_MATERIAL_GGX &&
                                    !(frame->run_optics && gn_optics_is_shown_by(surface))));
    s->has_photons = s->is_receiver && frame->run_caustics;
    figures->n_receivers += s->is_receiver;
}

void gn_primary_trace(const struct frame *frame, struct sample *samples, int n,
                      struct tile_figures *figures)
{
    for (int first = 0; first < n; first += LANES) {
        struct sight_rays rays;
        struct gn_rt_packet_hits hits;
        int n_lanes = n - first < LANES ? n - first : LANES;
        for (int i = 0; i < LANES; i++) {
            const struct sample *s = &samples[first + (i < n_lanes ? i : 0)];
            for (int k = 0; k < 3; k++)
                rays.dir[k][i] = s->dir[k];
            rays.dir_z[i] = s->dir_z;
            rays.has_ray[i] = i < n_lanes && s->dir_z > 0;
        }
        trace_block(frame, &rays, &hits, figures);
        for (int i = 0; i < n_lanes; i++)
            gn_primary_take(frame, &rays, &hits, i, &samples[first + i], figures);
    }
}
