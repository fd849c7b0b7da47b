/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Near light for the reference. The irradiance of a piece without anything in its way is exact
 * near it: Lambert's sum over the piece's triangles, cut off at the receiver's horizon,
 *   E = L / 2 sum_i theta_i (c_i . n),
 * theta_i the angle between neighbouring corners as seen from the point, c_i the unit normal of
 * their plane with it. Source: Lambert, Photometria, 1760; as Baum, Rushmeier and Winget,
 * "Improving Radiosity Solutions through the Use of Analytically Determined Form-Factors", SIGGRAPH
 * 1989, eq. 3. From 64 radii on it is a disc's (off by about 1e-4). Visibility is that of one
 * random point of each piece, the pieces being the strata; of a lamp's sphere, of 16.
 */
#include "server/render/near.h"

#include <math.h>
#include <string.h>

#include "server/render/internal.h"

/** Radii from which on a piece is a disc. */
#define FAR_RADII 64
/** A lamp's sphere is tried in SIDE x SIDE strata. */
#define SIDE 4
/** Tries to find a point of a piece above the horizon. */
#define TRIES 16

/** Splitmix64, as bounce.c. */
static double next_unit(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/** A receiver: a point off its surface. */
struct receiver {
    const struct gn_surface *surface;
    const float *org;
    bool even; // without the cosine
};

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[static 3], const double b[static 3], double out[static 3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/** One side of Lambert's sum. */
static double add_side(const double a[static 3], const double b[static 3], const double n[static 3])
{
    double c[3];
    cross(a, b, c);
    double sine = sqrt(dot(c, c));
    return sine > 0 ? atan2(sine, dot(a, b)) * dot(c, n) / sine : 0;
}

/** Irradiance of a triangle of radiance 1 on a plane with unit normal n through p. */
static double get_triangle_irradiance(const struct gn_piece_triangle *t, const double p[static 3],
                                      const double n[static 3])
{
    double corner[3][3];
    double kept[4][3];
    double height[3];
    double sides[2][3];
    double facing[3];
    int n_kept = 0;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            corner[i][k] = t->corners[i][k] - p[k];
        height[i] = dot(corner[i], n);
    }
    for (int k = 0; k < 3; k++) {
        sides[0][k] = corner[1][k] - corner[0][k];
        sides[1][k] = corner[2][k] - corner[0][k];
    }
    cross(sides[0], sides[1], facing);
    if (!(dot(facing, corner[0]) < 0))
        return 0; // it shows its back
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        if (height[i] > 0)
            memcpy(kept[n_kept++], corner[i], sizeof(corner[i]));
        if ((height[i] > 0) != (height[j] > 0)) {
            double share = height[i] / (height[i] - height[j]);
            for (int k = 0; k < 3; k++)
                kept[n_kept][k] = corner[i][k] + share * (corner[j][k] - corner[i][k]);
            n_kept++;
        }
    }
    double sum = 0;
    for (int i = 0; i < n_kept; i++)
        sum += add_side(kept[i], kept[(i + 1) % n_kept], n);
    return 0.5 * fabs(sum);
}

/** Is dir above both horizons? */
static bool is_above(const struct gn_surface *surface, const double dir[static 3])
{
    double shading = 0;
    double geometric = 0;
    for (int k = 0; k < 3; k++) {
        shading += surface->normal_shading[k] * dir[k];
        geometric += surface->normal_horizon[k] * dir[k];
    }
    return shading > 0 && geometric > 0;
}

/** A random point of the piece, moved off it; evenly over its area. */
static void choose_point(const struct gn_pieces *pieces, const struct gn_piece *piece,
                         uint64_t *random, double out[static 3])
{
    double target = next_unit(random) * piece->area;
    const struct gn_piece_triangle *t = &pieces->triangles[piece->first];
    for (int i = 0; i < piece->n; i++) {
        t = &pieces->triangles[piece->first + i];
        target -= t->area;
        if (target < 0)
            break;
    }
    double root = sqrt(next_unit(random));
    double share = next_unit(random);
    double sides[2][3];
    double n[3];
    for (int k = 0; k < 3; k++) {
        sides[0][k] = t->corners[1][k] - t->corners[0][k];
        sides[1][k] = t->corners[2][k] - t->corners[0][k];
    }
    cross(sides[0], sides[1], n);
    for (int k = 0; k < 3; k++)
        out[k] = t->corners[0][k] + root * (1 - share) * sides[0][k] + root * share * sides[1][k] +
                 t->clearance * n[k] / (2 * t->area);
}

/** Aims at a random point of the piece above the horizon. False: none was found. */
static bool aim_at_piece(const struct near_lights *near, int l, const struct receiver *receiver,
                         uint64_t *random, struct near_ray *ray)
{
    for (int i = 0; i < TRIES; i++) {
        double point[3];
        choose_point(near->pieces, &near->pieces->pieces[l - near->first_piece], random, point);
        double length2 = 0;
        for (int k = 0; k < 3; k++) {
            point[k] -= receiver->org[k];
            length2 += point[k] * point[k];
        }
        if (!is_above(receiver->surface, point))
            continue;
        for (int k = 0; k < 3; k++)
            ray->dir[k] = (float)(point[k] / sqrt(length2));
        ray->length = (float)(sqrt(length2) * (1 - NEAR_SHARE));
        return true;
    }
    return false;
}

/** Irradiance for each W/sr by light l, and the ray to be tried. 0: none. */
static double see_piece(const struct near_lights *near, int l, const struct receiver *receiver,
                        uint64_t *random, struct near_ray *ray)
{
    const struct gn_near_light *light = &near->lights[l];
    bool is_piece = near->pieces && l >= near->first_piece;
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
        double d = (double)light->position_world[k] - receiver->org[k];
        distance2 += d * d;
    }
    bool is_far = distance2 > FAR_RADII * FAR_RADII * (double)light->radius * light->radius;
    double weight = 0;
    if (!is_piece || is_far || receiver->even) {
        if (!gn_near_aim(light, receiver->org, ray))
            return 0;
        double cosine = (double)surface_cosine(receiver->surface, ray->dir);
        weight = cosine > 0 ? ray->weight * (receiver->even ? 1 : cosine) : 0;
    } else {
        const struct gn_piece *piece = &near->pieces->pieces[l - near->first_piece];
        double p[3];
        double n[3];
        for (int k = 0; k < 3; k++) {
            p[k] = receiver->org[k];
            n[k] = receiver->surface->normal_shading[k];
        }
        for (int i = 0; i < piece->n; i++)
            weight += get_triangle_irradiance(&near->pieces->triangles[piece->first + i], p, n);
        weight /= piece->area;
    }
    return weight > 0 && is_piece && !aim_at_piece(near, l, receiver, random, ray) ? 0 : weight;
}

/** Stratum i of a lamp's sphere, seen from outside it: irradiance for each W/sr, and the ray. */
static double see_lamp(const struct gn_near_light *light, int i, const struct receiver *receiver,
                       uint64_t *random, struct near_ray *ray)
{
    double radius = light->radius;
    double to[3];
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
        to[k] = (double)light->position_world[k] - receiver->org[k];
        distance2 += to[k] * to[k];
    }
    double distance = sqrt(distance2);
    // The cone about the sphere: 1 - cos of its half angle, without cancellation.
    double sine2 = radius * radius / distance2;
    double cap = sine2 / (1 + sqrt(1 - sine2));
    double height = cap * (i / SIDE + next_unit(random)) / SIDE;
    double phi = 2 * M_PI * (i % SIDE + next_unit(random)) / SIDE;
    double r = sqrt(height * (2 - height));
    double axis[3] = {to[0] / distance, to[1] / distance, to[2] / distance};
    double sign = copysign(1, axis[2]); // Duff et al., JCGT 6(1), 2017
    double a = -1 / (sign + axis[2]);
    double b = axis[0] * axis[1] * a;
    const double s[3] = {1 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0]};
    const double t[3] = {b, sign + axis[1] * axis[1] * a, -axis[1]};
    double dir[3];
    for (int k = 0; k < 3; k++) {
        dir[k] = r * cos(phi) * s[k] + r * sin(phi) * t[k] + (1 - height) * axis[k];
        ray->dir[k] = (float)dir[k];
    }
    if (!is_above(receiver->surface, dir))
        return 0;
    double enters = distance * (1 - height) - sqrt(fmax(0, radius * radius - distance2 * r * r));
    ray->length = (float)(fmax(0, enters) * (1 - NEAR_SHARE));
    double cosine = receiver->even ? 1 : (double)surface_cosine(receiver->surface, ray->dir);
    // Radiance of 1 W/sr over pi r^2, from 2 pi cap / SIDE^2 of solid angle.
    return cosine * 2 * cap / (radius * radius * SIDE * SIDE);
}

/** How many parts of light l are tried. */
static int count_parts(const struct gn_near_light *light, const struct receiver *receiver)
{
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
        double d = (double)light->position_world[k] - receiver->org[k];
        distance2 += d * d;
    }
    bool is_sphere = light->object == GN_NEAR_NO_OBJECT && light->radius > 0 &&
                     distance2 > (double)light->radius * light->radius;
    return is_sphere ? SIDE * SIDE : 1;
}

/** Irradiance for each W/sr of part i of light l, and its ray; the same at every call. */
static double see_part(const struct frame *frame, int l, int i, int n_parts,
                       const struct receiver *receiver, uint64_t seed, struct near_ray *ray)
{
    uint64_t random = seed ^ ((uint64_t)(l + 1) << 32) ^ (uint64_t)i * UINT64_C(0xd1342543de82ef95);
    return n_parts > 1 ? see_lamp(&frame->near.lights[l], i, receiver, &random, ray)
                       : see_piece(&frame->near, l, receiver, &random, ray);
}

static bool is_hidden(const struct frame *frame, enum gn_rt_set set,
                      const struct receiver *receiver, const struct near_ray *ray, uint64_t *rays)
{
    ++*rays;
    return gn_rt_is_occluded(frame->rt, set, receiver->org, ray->dir, 0, ray->length);
}

static void add_light(const struct gn_near_light *light, double weight, double sum[static 3])
{
    for (int k = 0; k < 3; k++)
        sum[k] += weight * (double)light->intensity[k];
}

static bool is_dark(const struct gn_near_light *light)
{
    return !(light->intensity[0] > 0 || light->intensity[1] > 0 || light->intensity[2] > 0);
}

/** Adds the open light of the roles to sum; what `set` hides is not. */
static void gather(const struct frame *frame, const struct sample *s, unsigned roles,
                   enum gn_rt_set set, double sum[static 3], uint64_t *n_near, uint64_t *rays)
{
    const struct receiver receiver = {&s->surface, s->org, false};
    for (int l = 0; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        int n_parts = count_parts(light, &receiver);
        for (int i = 0; i < n_parts && (light->role & roles) && !is_dark(light); i++) {
            struct near_ray ray;
            double weight = see_part(frame, l, i, n_parts, &receiver, s->seed, &ray);
            *n_near += weight > 0;
            if (weight > 0 && !is_hidden(frame, set, &receiver, &ray, rays))
                add_light(light, weight, sum);
        }
    }
}

void gn_near_reference_shade(const struct frame *frame, struct sample *s,
                             struct tile_figures *figures)
{
    double sum[3] = {0};
    gather(frame, s, GN_RT_ALL, GN_RT_ALL, sum, &figures->n_near, &figures->rays_shade);
    for (int k = 0; k < 3; k++)
        s->radiance[k] += s->through[k] * (s->surface.albedo[k] / M_PI * sum[k]);
}

void gn_near_reference_gain(const struct frame *frame, struct sample *s,
                            struct tile_figures *figures)
{
    double sum[3] = {0};
    gather(frame, s, GN_RT_VIRTUAL, GN_RT_ALL, sum, &figures->n_near, &figures->rays_shadow);
    for (int k = 0; k < 3; k++)
        s->gain[k] += s->surface.albedo[k] / M_PI * sum[k];
}

bool gn_near_reference_is_cut(const struct frame *frame, const struct sample *s,
                              struct tile_figures *figures)
{
    const struct receiver receiver = {&s->surface, s->org, frame->options.shadow_unweighted};
    struct box from;
    memcpy(from.min, s->org, sizeof(from.min));
    memcpy(from.max, s->org, sizeof(from.max));
    for (int l = 0; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        int n_parts = count_parts(light, &receiver);
        for (int i = 0; i < n_parts && light->role == GN_RT_REAL && !is_dark(light); i++) {
            struct near_ray ray;
            if (!(see_part(frame, l, i, n_parts, &receiver, s->seed, &ray) > 0))
                continue;
            figures->n_near++;
            if (frame->cull && !gn_box_may_meet_from_box(&frame->virtual_box, &from, ray.dir))
                continue;
            if (is_hidden(frame, GN_RT_VIRTUAL, &receiver, &ray, &figures->rays_shadow))
                return true;
        }
    }
    return false;
}

void gn_near_reference_sum(const struct frame *frame, const struct sample *s, bool even,
                           double sums[static 2][3], struct tile_figures *figures)
{
    const struct receiver receiver = {&s->surface, s->org, even};
    for (int l = 0; l < frame->near.n; l++) {
        const struct gn_near_light *light = &frame->near.lights[l];
        int n_parts = count_parts(light, &receiver);
        for (int i = 0; i < n_parts && light->role == GN_RT_REAL && !is_dark(light); i++) {
            struct near_ray ray;
            double weight = see_part(frame, l, i, n_parts, &receiver, s->seed, &ray);
            if (!(weight > 0))
                continue;
            figures->n_near++;
            figures->n_rays_real += frame->run_blockers;
            if (frame->run_blockers &&
                is_hidden(frame, GN_RT_REAL, &receiver, &ray, &figures->rays_shadow))
                continue;
            add_light(light, weight, sums[0]);
            if (is_hidden(frame, GN_RT_VIRTUAL, &receiver, &ray, &figures->rays_shadow))
                add_light(light, weight, sums[1]);
        }
    }
}

/** The light whose part of the powers' sum holds u. */
static int choose_light(const struct near_lights *near, double u, double *out_probability)
{
    int lo = 0;
    int hi = near->n - 1;
    while (lo < hi) {
        int mid = lo + (hi - lo) / 2;
        if (near->cdf[mid] > u)
            hi = mid;
        else
            lo = mid + 1;
    }
    *out_probability = near->cdf[lo] - (lo > 0 ? near->cdf[lo - 1] : 0);
    return lo;
}

void gn_near_reference_ask(const struct frame *frame, const struct sample *s, bool even, double u,
                           uint64_t random, double sums[static 2][3], uint64_t *rays)
{
    const struct receiver receiver = {&s->surface, s->org, even};
    double probability;
    int l = choose_light(&frame->near, u, &probability);
    const struct gn_near_light *light = &frame->near.lights[l];
    if (light->role != GN_RT_REAL || !(probability > 0))
        return;
    struct near_ray ray;
    int n_parts = count_parts(light, &receiver);
    int part = (int)(next_unit(&random) * n_parts);
    double weight = see_part(frame, l, part, n_parts, &receiver, random, &ray) * n_parts;
    if (!(weight > 0) || is_hidden(frame, GN_RT_REAL, &receiver, &ray, rays))
        return;
    add_light(light, weight / probability, sums[0]);
    if (gn_box_may_meet(&frame->virtual_box, s->org, ray.dir) &&
        is_hidden(frame, GN_RT_VIRTUAL, &receiver, &ray, rays))
        add_light(light, weight / probability, sums[1]);
}

void gn_near_reference_try(const struct frame *frame, const struct gn_surface *surface,
                           const float org[static 3], enum gn_rt_set set, uint64_t random,
                           double out_irradiance[static 3], enum gn_rt_set *out_role,
                           uint64_t *rays)
{
    const struct near_lights *near = &frame->near;
    const struct receiver receiver = {surface, org, false};
    double probability;
    int lo = choose_light(near, next_unit(&random), &probability);
    const struct gn_near_light *light = &near->lights[lo];
    int n_parts = count_parts(light, &receiver);
    int part = (int)(next_unit(&random) * n_parts);
    struct near_ray ray;
    memset(out_irradiance, 0, 3 * sizeof(*out_irradiance));
    *out_role = light->role;
    if (!(light->role & set) || !(probability > 0))
        return;
    double weight = see_part(frame, lo, part, n_parts, &receiver, random, &ray) * n_parts;
    if (weight > 0 && !is_hidden(frame, set, &receiver, &ray, rays))
        add_light(light, weight / probability, out_irradiance);
}
