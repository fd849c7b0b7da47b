/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/tracer.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "tests/rig/random.h"
#include "tests/rig/vec.h"

/* Bounces, mirrors and glass together. */
#define MAX_VERTICES (GN_RIG_MAX_BOUNCES + 24)
/* Pairs of random numbers: one for the pixel, two for each vertex; then, where there is near light,
 * one for the emitters and one for each lamp at each vertex; then one for the lens's blur; then one
 * for the choice of a way at each vertex. */
#define NEAR_PAIRS (1 + 2 * MAX_VERTICES)
#define BLUR_PAIR (NEAR_PAIRS + (1 + GN_RIG_MAX_LAMPS) * MAX_VERTICES)
#define CHOICE_PAIRS (BLUR_PAIR + 1)
#define MAX_PAIRS (CHOICE_PAIRS + MAX_VERTICES)

/* Rays to near light end this share of their length before it: they start a little off the surface,
 * so that they would run into an emitter seen edge-on. */
#define NEAR_GAP 1e-3

struct job {
    const struct gn_rig_room *room;
    const struct gn_rig_environment *env;
    const struct gn_rig_view *view;
    struct gn_rig_render_options options;
    struct gn_rig_pictures *out;
};

/* Where the random numbers of one batch of paths come from. */
struct draws {
    uint32_t key[2];
    uint32_t counter[4]; // pixel, batch, pair, frame
    uint32_t seeds[MAX_PAIRS][3];
    int n_seeded; // seeds are made when a path first goes that far
    uint32_t index;
};

/* What one path brought home. */
struct path {
    double direct[3];
    double all[3];
    bool sees_virtual;  // the camera ray met a virtual object first
    bool meets_virtual; // any of its rays did
};

static void get_pair(struct draws *draws, int pair, double out_pair[static 2])
{
    for (; draws->n_seeded <= pair; draws->n_seeded++) {
        uint32_t words[4];
        draws->counter[2] = (uint32_t)draws->n_seeded;
        gn_rig_philox(draws->counter, draws->key, words);
        memcpy(draws->seeds[draws->n_seeded], words, sizeof(draws->seeds[0]));
    }
    gn_rig_get_sobol2(draws->index, draws->seeds[pair], out_pair);
}

static void to_float(const double v[static 3], float out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (float)v[k];
}

/* The point moved off its surface to the side of dir. */
static void leave_surface(const struct gn_rig_surface *s, const double dir[static 3],
                          float out_org[static 3], float out_dir[static 3])
{
    float point[3], normal[3];
    to_float(s->point, point);
    to_float(s->normal_geometric, normal);
    to_float(dir, out_dir);
    gn_rt_offset_origin(point, normal, (float)s->clearance,
                        vec_dot(s->normal_shading, dir) > 0 ? normal : out_dir, out_org);
    for (int k = 0; k < 3 && vec_dot(s->normal_shading, dir) > 0; k++)
        out_org[k] += (float)s->lift[k];
}

/* Bright light from one sampled direction that the surface sends on, for an albedo of 1. */
static void gather_light(const struct job *job, enum gn_rt_set set, const struct gn_rig_surface *s,
                         const double uv[static 2], double out_sent[static 3], bool *io_meets)
{
    struct gn_rig_light_sample light;
    float org[3], dir[3];
    memset(out_sent, 0, 3 * sizeof(*out_sent));
    if (!gn_rig_environment_sample(job->env, s->point, uv, &light))
        return;
    double cosine = vec_dot(light.dir, s->normal_shading);
    if (cosine <= 0)
        return;
    leave_surface(s, light.dir, org, dir);
    if (gn_rt_is_occluded(job->room->rt, set, org, dir, 0, (float)light.distance)) {
        if (set == GN_RT_ALL && !*io_meets)
            *io_meets =
                !gn_rt_is_occluded(job->room->rt, GN_RT_REAL, org, dir, 0, (float)light.distance);
        return;
    }
    for (int k = 0; k < 3; k++)
        out_sent[k] = light.radiance[k] * cosine / (GN_RIG_PI * light.pdf_solid_angle);
}

/* Adds one near light, for an albedo of 1. A virtual one is part of the light with the virtual
 * objects only. */
static void add_near(const struct job *job, enum gn_rt_set set, const struct gn_rig_surface *s,
                     const struct gn_rig_near_sample *light, double io_sent[static 3],
                     bool *io_meets)
{
    float org[3], dir[3];
    double cosine = vec_dot(light->dir, s->normal_shading);
    if (cosine <= 0)
        return;
    leave_surface(s, light->dir, org, dir);
    float length = (float)(light->distance * (1 - NEAR_GAP));
    bool is_hidden = gn_rt_is_occluded(job->room->rt, set, org, dir, 0, length);
    if (set == GN_RT_ALL && !*io_meets)
        *io_meets = light->is_virtual || (is_hidden && !gn_rt_is_occluded(job->room->rt, GN_RT_REAL,
                                                                          org, dir, 0, length));
    for (int k = 0; k < 3 && !is_hidden && (set == GN_RT_ALL || !light->is_virtual); k++)
        io_sent[k] += light->given[k] * cosine / GN_RIG_PI;
}

/* The same from lamps and emissive objects, added: one point of each lamp, one of all objects. */
static void gather_near(const struct job *job, enum gn_rt_set set, const struct gn_rig_surface *s,
                        struct draws *draws, int vertex, double io_sent[static 3], bool *io_meets)
{
    const struct gn_rig_room *room = job->room;
    int pair = NEAR_PAIRS + (1 + GN_RIG_MAX_LAMPS) * vertex;
    struct gn_rig_near_sample light;
    double uv[2];
    if (room->emitters.n > 0) {
        get_pair(draws, pair, uv);
        if (gn_rig_emitters_sample(&room->emitters, s->point, uv, &light))
            add_near(job, set, s, &light, io_sent, io_meets);
    }
    for (int i = 0; i < room->n_lamps; i++) {
        get_pair(draws, pair + 1 + i, uv);
        if (gn_rig_lamp_sample(&room->lamps[i], s->point, uv, &light))
            add_near(job, set, s, &light, io_sent, io_meets);
    }
}

/* A direction around the unit normal n with density cos / pi: Malley's method on the frame of
 * Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. */
static void sample_cosine(const double n[static 3], const double uv[static 2],
                          double out_dir[static 3])
{
    double sign = copysign(1, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
    const double t[3] = {1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]};
    const double bt[3] = {b, sign + n[1] * n[1] * a, -n[1]};
    double r = sqrt(uv[0]), phi = 2 * GN_RIG_PI * uv[1], z = sqrt(fmax(0, 1 - uv[0]));
    for (int k = 0; k < 3; k++)
        out_dir[k] = r * cos(phi) * t[k] + r * sin(phi) * bt[k] + z * n[k];
    vec_normalize(out_dir);
}

/* A normal that looks away from the ray is turned until it just does not. */
static void get_facing(const struct gn_rig_surface *s, const double dir[static 3],
                       double out[static 3])
{
    double missing = 1e-4 + vec_dot(s->normal_shading, dir);
    for (int k = 0; k < 3; k++)
        out[k] = s->normal_shading[k] - (missing > 0 ? missing * dir[k] : 0);
    vec_normalize(out);
}

static bool leave_glass(const struct gn_rig_surface *s, double choice, double io_dir[static 3],
                        double io_weight[static 3])
{
    double normal[3];
    get_facing(s, io_dir, normal);
    bool through = gn_rig_glass_choose(normal, s->is_front ? s->ior : 1 / s->ior, choice, io_dir);
    for (int k = 0; k < 3 && through; k++)
        io_weight[k] *= s->albedo[k];
    return (vec_dot(io_dir, s->normal_shading) < 0) == through;
}

/* The next direction; false ends the path. The weight is multiplied by what the surface sends on.
 * *io_base: the surface is diffuse, or is left as if it were; of ggx, one of both by chance. */
static bool leave(const struct gn_rig_surface *s, const double uv[static 2], double choice,
                  double io_dir[static 3], double io_weight[static 3], bool *io_base)
{
    double normal[3];
    if (s->is_glass)
        return leave_glass(s, choice, io_dir, io_weight);
    if (s->gloss && (!*io_base || choice < 0.5)) {
        for (int k = 0; k < 3 && *io_base; k++)
            io_weight[k] *= 2;
        *io_base = false;
        get_facing(s, io_dir, normal);
        return gn_rig_gloss_reflect(s->gloss, s->own_albedo, normal, uv, io_dir, io_weight) &&
               vec_dot(io_dir, s->normal_shading) > 0;
    }
    for (int k = 0; k < 3 && s->gloss; k++)
        io_weight[k] *= 2;
    for (int k = 0; k < 3; k++)
        io_weight[k] *= s->albedo[k];
    if (s->is_mirror) {
        double along = vec_dot(io_dir, s->normal_shading);
        for (int k = 0; k < 3; k++)
            io_dir[k] -= 2 * along * s->normal_shading[k];
    } else {
        sample_cosine(s->normal_shading, uv, io_dir);
    }
    return vec_dot(io_dir, s->normal_shading) > 0;
}

/* The nearest surface that lies before the light. */
static bool find_surface(const struct job *job, enum gn_rt_set set, const double from[static 3],
                         const float org[static 3], const double dir[static 3],
                         struct gn_rig_surface *out_surface)
{
    struct gn_rt_hit hit;
    float dirf[3];
    to_float(dir, dirf);
    float far = (float)gn_rig_environment_get_distance(job->env, from, dir);
    if (!gn_rt_intersect(job->room->rt, set, org, dirf, 0, far, &hit))
        return false;
    gn_rig_room_get_surface(job->room, dir, &hit, out_surface);
    return true;
}

/* Whether the surface reflects diffusely too; its albedo becomes that part's. */
static bool get_base(struct gn_rig_surface *s, const double dir[static 3])
{
    double normal[3];
    memcpy(s->own_albedo, s->albedo, sizeof(s->albedo));
    if (s->gloss) {
        get_facing(s, dir, normal);
        gn_rig_gloss_get_base(s->gloss, s->own_albedo, -vec_dot(normal, dir), s->albedo);
    }
    return !s->is_mirror && !s->is_glass && s->albedo[0] + s->albedo[1] + s->albedo[2] > 0;
}

/* The light that the path ran into; behind a diffuse point, bright light was gathered already. */
static void add_light(const struct job *job, const double from[static 3],
                      const double dir[static 3], const double weight[static 3], bool is_gathered,
                      int diffuse, struct path *io_path)
{
    double rgb[3];
    bool is_bright = gn_rig_environment_get_radiance(job->env, from, dir, rgb);
    for (int k = 0; k < 3 && !(is_bright && is_gathered); k++) {
        io_path->all[k] += weight[k] * rgb[k];
        io_path->direct[k] += diffuse <= 1 ? weight[k] * rgb[k] : 0;
    }
}

static void trace_path(const struct job *job, enum gn_rt_set set, struct draws *draws,
                       const double camera[static 3], const double camera_dir[static 3],
                       struct path *out_path)
{
    struct path path = {0};
    double weight[3] = {1, 1, 1}, from[3], dir[3], rgb[3], uv[2], choice[2] = {0};
    float org[3];
    bool is_gathered = false; // the surface that the ray leaves has gathered bright light
    int diffuse = 0;          // surfaces met so far
    memcpy(from, camera, sizeof(from));
    memcpy(dir, camera_dir, sizeof(dir));
    to_float(camera, org);
    for (int vertex = 0; vertex < MAX_VERTICES; vertex++) {
        struct gn_rig_surface s;
        if (!find_surface(job, set, from, org, dir, &s)) {
            add_light(job, from, dir, weight, is_gathered, diffuse, &path);
            break;
        }
        path.sees_virtual |= vertex == 0 && s.is_virtual;
        path.meets_virtual |= s.is_virtual;
        for (int k = 0; k < 3 && !is_gathered; k++) {
            path.all[k] += weight[k] * s.emission[k];
            path.direct[k] += diffuse == 0 ? weight[k] * s.emission[k] : 0;
        }
        if (diffuse > job->options.bounces && is_gathered)
            break; // the last ray only looked for light
        bool has_base = get_base(&s, dir);
        if (has_base) {
            get_pair(draws, 1 + 2 * vertex, uv);
            gather_light(job, set, &s, uv, rgb, &path.meets_virtual);
            gather_near(job, set, &s, draws, vertex, rgb, &path.meets_virtual);
            for (int k = 0; k < 3; k++) {
                double sent = weight[k] * s.albedo[k] * rgb[k];
                path.all[k] += sent;
                path.direct[k] += diffuse == 0 ? sent : 0;
            }
        }
        get_pair(draws, 2 + 2 * vertex, uv);
        if (s.gloss || s.is_glass)
            get_pair(draws, CHOICE_PAIRS + vertex, choice);
        if (!leave(&s, uv, choice[0], dir, weight, &has_base))
            break;
        is_gathered = has_base;
        diffuse += has_base;
        float dirf[3];
        leave_surface(&s, dir, org, dirf);
        memcpy(from, s.point, sizeof(from));
    }
    *out_path = path;
}

/* A point of the pixel, and off it by what the lens spreads (Box and Muller 1958). */
static void get_place(const struct job *job, struct draws *draws, double out_xy[static 2])
{
    double uv[2];
    get_pair(draws, 0, out_xy);
    if (!(job->view->blur_px > 0))
        return;
    get_pair(draws, BLUR_PAIR, uv);
    double radius = job->view->blur_px * sqrt(-2 * log(1 - uv[0]));
    out_xy[0] += radius * cos(2 * GN_RIG_PI * uv[1]);
    out_xy[1] += radius * sin(2 * GN_RIG_PI * uv[1]);
}

/* The mean of one batch of paths, for each picture. */
static void render_batch(const struct job *job, struct draws *draws, int x, int y,
                         double out_means[static GN_RIG_PICTURES][3], double *io_covered)
{
    const double *m = job->view->world_from_camera;
    const double camera[3] = {m[3], m[7], m[11]};
    double scale = 1.0 / job->options.batch_size;
    memset(out_means, 0, GN_RIG_PICTURES * sizeof(*out_means));
    for (int i = 0; i < job->options.batch_size; i++) {
        struct path truth, background;
        double within[2], dir[3];
        draws->index = (uint32_t)i;
        get_place(job, draws, within);
        gn_rig_view_get_ray(job->view, x + within[0], y + within[1], dir);
        trace_path(job, GN_RT_ALL, draws, camera, dir, &truth);
        background = truth;
        if (truth.meets_virtual)
            trace_path(job, GN_RT_REAL, draws, camera, dir, &background);
        *io_covered += truth.sees_virtual;
        for (int k = 0; k < 3; k++) {
            out_means[GN_RIG_BACKGROUND][k] += background.direct[k] * scale;
            out_means[GN_RIG_BACKGROUND_BOUNCES][k] += background.all[k] * scale;
            out_means[GN_RIG_TRUTH][k] += truth.direct[k] * scale;
            out_means[GN_RIG_TRUTH_BOUNCES][k] += truth.all[k] * scale;
        }
    }
}

static void render_pixel(const struct job *job, int x, int y)
{
    double sum[GN_RIG_PICTURES][3] = {0}, squares[GN_RIG_PICTURES][3] = {0}, covered = 0;
    double first[GN_RIG_PICTURES][3] = {0}; // sums are taken from the first batch on: no cancelling
    int n = job->options.batches;
    for (int b = 0; b < n; b++) {
        struct draws draws = {
            .key = {(uint32_t)job->options.seed, (uint32_t)(job->options.seed >> 32)},
            .counter = {(uint32_t)x | (uint32_t)y << 16, (uint32_t)b, 0,
                        (uint32_t)job->options.frame}};
        double means[GN_RIG_PICTURES][3];
        render_batch(job, &draws, x, y, means, &covered);
        if (b == 0)
            memcpy(first, means, sizeof(first));
        for (int p = 0; p < GN_RIG_PICTURES; p++)
            for (int k = 0; k < 3; k++) {
                double d = means[p][k] - first[p][k];
                sum[p][k] += d;
                squares[p][k] += d * d;
            }
    }
    for (int p = 0; p < GN_RIG_PICTURES; p++)
        for (int k = 0; k < 3; k++) {
            double d = sum[p][k] / n, variance = fmax(0, squares[p][k] / n - d * d) / (n - 1);
            gn_image_at(&job->out->mean[p], x, y)[k] = (float)(first[p][k] + d);
            gn_image_at(&job->out->error[p], x, y)[k] = (float)sqrt(variance);
        }
    *gn_image_at(&job->out->object, x, y) = (float)(covered / (n * job->options.batch_size));
}

static void render_row(void *context, int y, int worker)
{
    const struct job *job = context;
    (void)worker;
    for (int x = 0; x < job->view->width; x++)
        render_pixel(job, x, y);
}

void gn_rig_pictures_finish(struct gn_rig_pictures *pictures)
{
    for (int p = 0; p < GN_RIG_PICTURES; p++) {
        gn_image_finish(&pictures->mean[p]);
        gn_image_finish(&pictures->error[p]);
    }
    gn_image_finish(&pictures->object);
}

int gn_rig_render(const struct gn_rig_room *room, const struct gn_rig_environment *env,
                  const struct gn_rig_view *view, const struct gn_rig_render_options *options,
                  struct gn_pool *pool, struct gn_rig_pictures *out_pictures,
                  struct gn_error *out_error)
{
    struct gn_rig_pictures pictures = {0};
    struct job job = {room, env, view, *options, &pictures};
    struct gn_rig_render_options *o = &job.options;
    int w = view->width, h = view->height, result;
    o->batches = o->batches ? o->batches : 8;
    o->batch_size = o->batch_size ? o->batch_size : 16;
    if (o->bounces < 0 || o->bounces > GN_RIG_MAX_BOUNCES || o->batches < 2 || o->batches > 64 ||
        o->batch_size < 1 || o->batch_size > 4096 || (o->batch_size & (o->batch_size - 1)))
        return gn_error_set(out_error, -EINVAL,
                            "rig: %d bounces, %d batches of %d paths: need [0, %d], [2, 64] and a "
                            "power of two up to 4096",
                            o->bounces, o->batches, o->batch_size, GN_RIG_MAX_BOUNCES);
    result = gn_image_init(&pictures.object, w, h, 1);
    for (int p = 0; result == 0 && p < GN_RIG_PICTURES; p++) {
        result = gn_image_init(&pictures.mean[p], w, h, 3);
        if (result == 0)
            result = gn_image_init(&pictures.error[p], w, h, 3);
    }
    if (result) {
        gn_rig_pictures_finish(&pictures);
        return gn_error_set(out_error, result, "rig: no pictures of %d x %d", w, h);
    }
    gn_pool_run(pool, h, render_row, &job);
    *out_pictures = pictures;
    return 0;
}
