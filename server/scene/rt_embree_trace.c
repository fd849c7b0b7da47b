/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/rt_embree.h"

#include <assert.h>
#include <float.h>
#include <math.h>
#include <string.h>

/* The only difference between Embree 3 and 4: how a call gets its arguments. */
#ifdef GN_HAVE_EMBREE4
static void trace_intersect1(RTCScene scene, struct RTCRayHit *rayhit)
{
    rtcIntersect1(scene, rayhit, NULL);
}

static void trace_occluded1(RTCScene scene, struct RTCRay *ray)
{
    rtcOccluded1(scene, ray, NULL);
}

static void trace_occluded16(const int *valid, RTCScene scene, bool has_instances,
                             struct RTCRay16 *ray)
{
    (void)has_instances;
    rtcOccluded16(valid, scene, ray, NULL);
}

static void trace_intersect16(const int *valid, RTCScene scene, bool has_instances,
                              struct RTCRayHit16 *rayhit)
{
    struct RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    if (!has_instances)
        arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcIntersect16(valid, scene, rayhit, &arguments);
}
#else
static void trace_intersect1(RTCScene scene, struct RTCRayHit *rayhit)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, rayhit);
}

static void trace_occluded1(RTCScene scene, struct RTCRay *ray)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, ray);
}

static void trace_occluded16(const int *valid, RTCScene scene, bool has_instances,
                             struct RTCRay16 *ray)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    // Embree 3.13.5 does not return from some packets into instances where they are said to be
    // coherent (tests/unit/render_motion.c meets one within its first frame).
    if (!has_instances)
        context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded16(valid, scene, &context, ray);
}

static void trace_intersect16(const int *valid, RTCScene scene, bool has_instances,
                              struct RTCRayHit16 *rayhit)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (!has_instances)
        context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &context, rayhit);
}
#endif

/** The first two rows of Embree's ray are written as a whole each, since Embree reads them so: read
 * soon after four single writes they wait for these, for longer than many a ray takes to trace. */
static struct RTCRay make_ray(const float org[static 3], const float dir[static 3], float t_near,
                              float t_far)
{
    typedef float row __attribute__((vector_size(16)));
    const row rows[2] = {{org[0], org[1], org[2], t_near}, {dir[0], dir[1], dir[2], 0}};
    struct RTCRay ray = {.tfar = t_far, .mask = 0xffffffffu};
    memcpy(&ray, rows, sizeof(rows));
    return ray;
}

/** World point or (w 0) direction of a mover's own one. */
static void to_world(const float m[static 12], const double p[static 3], double w, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = m[k] * p[0] + m[3 + k] * p[1] + m[6 + k] * p[2] + w * m[9 + k];
}

/** A triangle's first corner and the ways to the others, in its own coordinates. */
struct spot {
    double v0[3], e1[3], e2[3];
};

static struct spot get_spot(const struct rt_mesh *mesh, uint32_t triangle)
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)triangle;
    const float *v0 = mesh->vertices + 3 * (size_t)index[0];
    const float *v1 = mesh->vertices + 3 * (size_t)index[1];
    const float *v2 = mesh->vertices + 3 * (size_t)index[2];
    struct spot spot;
    for (int k = 0; k < 3; k++) {
        spot.v0[k] = v0[k];
        spot.e1[k] = (double)v1[k] - v0[k];
        spot.e2[k] = (double)v2[k] - v0[k];
    }
    return spot;
}

static void cross(const double a[static 3], const double b[static 3], double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The ray in a mover's own coordinates. */
static void to_own(const float m[static 12], double s[static 3], double d[static 3])
{
    const double world_s[3] = {s[0] - m[9], s[1] - m[10], s[2] - m[11]};
    const double world_d[3] = {d[0], d[1], d[2]};
    for (int k = 0; k < 3; k++) {
        const double column[3] = {m[3 * k], m[3 * k + 1], m[3 * k + 2]};
        s[k] = dot(column, world_s);
        d[k] = dot(column, world_d);
    }
}

/**
 * Where the ray meets a triangle of a thin mesh, once more in double: in floats the tracer's u and
 * v are off by 2^-24 of lengths over the triangle's width, centimetres along a needle of metres.
 * What then lies outside is taken to the edge. Source: Moeller and Trumbore, "Fast, Minimum Storage
 * Ray-Triangle Intersection", 1997.
 */
static void sharpen(const struct rt_mesh *mesh, const struct rt_stand *stand, uint32_t triangle,
                    const float org[static 3], const float dir[static 3], float *t, float *u,
                    float *v)
{
    const struct spot spot = get_spot(mesh, triangle);
    double s[3] = {org[0], org[1], org[2]};
    double d[3] = {dir[0], dir[1], dir[2]};
    double p[3];
    double q[3];
    if (stand)
        to_own(stand->world_from_own, s, d);
    for (int k = 0; k < 3; k++)
        s[k] -= spot.v0[k];
    cross(d, spot.e2, p);
    cross(s, spot.e1, q);
    double determinant = dot(spot.e1, p);
    double at[3] = {dot(spot.e2, q) / determinant, dot(s, p) / determinant,
                    dot(d, q) / determinant};
    if (!(at[0] > 0.0) || !isfinite(at[0]) || !isfinite(at[1]) || !isfinite(at[2]))
        return; // edge on: as the tracer has it
    at[1] = fmin(fmax(at[1], 0.0), 1.0);
    at[2] = fmin(fmax(at[2], 0.0), 1.0 - at[1]);
    *t = (float)at[0];
    *u = (float)at[1];
    *v = (float)at[2];
}

/** The point at barycentric u, v. */
static inline void get_point(const struct spot *spot, float u, float v, double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = spot->v0[k] + (double)u * spot->e1[k] + (double)v * spot->e2[k];
}

/** The largest of these, 0 at least. */
static inline double max2(double a, double b)
{
    return a > b ? a : b;
}

/** Largest coordinate of the way from p to a corner of its triangle. */
static double get_extent(const struct rt_mesh *mesh, uint32_t triangle, const double p[static 3])
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)triangle;
    double extent = 0;
    for (int i = 0; i < 3; i++) {
        const float *v = mesh->vertices + 3 * (size_t)index[i];
        for (int k = 0; k < 3; k++)
            extent = max2(extent, fabs(v[k] - p[k]));
    }
    return extent;
}

/** Point, normal and clearance from the triangle's own vertices, in double, rounded once. */
static void fill_hit(const struct rt_mesh *mesh, const struct rt_stand *stand,
                     struct gn_rt_hit *hit)
{
    const struct spot spot = get_spot(mesh, hit->triangle);
    const double *e1 = spot.e1;
    const double *e2 = spot.e2;
    double own[3];
    double p[3];
    get_point(&spot, hit->u, hit->v, own);
    memcpy(p, own, sizeof(p));
    double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2],
                   e1[0] * e2[1] - e1[1] * e2[0]};
    double extent = get_extent(mesh, hit->triangle, own);
    double magnitude = 0;
    if (stand) {
        const double own_n[3] = {n[0], n[1], n[2]};
        to_world(stand->world_from_own, own, 1.0, p);
        to_world(stand->world_from_own, own_n, 0.0, n);
    }
    for (int k = 0; k < 3; k++) {
        hit->point[k] = (float)p[k];
        magnitude = max2(magnitude, fabs(p[k]));
    }
    hit->clearance = (float)(FLT_EPSILON * (4.0 * magnitude + 16.0 * extent));
    if (stand)
        hit->clearance += GN_RT_MOVED_ROUNDING * stand->reach;
    double scale = 1.0 / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (mesh->mirrored)
        scale = -scale;
    for (int k = 0; k < 3; k++)
        hit->normal[k] = (float)(n[k] * scale);
}

/** The mesh of a geometry or, where mover is not RTC_INVALID_GEOMETRY_ID, of a mover. */
static const struct rt_mesh *get_mesh(const struct gn_rt *rt, unsigned mover, unsigned geometry)
{
    return mover != RTC_INVALID_GEOMETRY_ID ? &rt->movers[mover].mesh : &rt->meshes[geometry];
}

static const struct rt_stand *get_stand(const struct gn_rt *rt, unsigned mover)
{
    return mover != RTC_INVALID_GEOMETRY_ID ? &rt->stands[mover] : NULL;
}

static void make_hit(const struct gn_rt *rt, unsigned mover, unsigned geometry, unsigned triangle,
                     float distance, float u, float v, struct gn_rt_hit *out_hit)
{
    const struct rt_mesh *mesh = get_mesh(rt, mover, geometry);
    *out_hit = (struct gn_rt_hit){
        .distance = distance, .u = u, .v = v, .object = mesh->object, .triangle = triangle};
    fill_hit(mesh, get_stand(rt, mover), out_hit);
}

bool gn_rt_intersect(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                     const float dir[static 3], float t_near, float t_far,
                     struct gn_rt_hit *out_hit)
{
    assert(rt->is_committed);
    struct RTCRayHit rayhit = {
        .ray = make_ray(org, dir, t_near, t_far),
        .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .instID = {RTC_INVALID_GEOMETRY_ID}},
    };
    if (rt->scenes[set - 1])
        trace_intersect1(rt->scenes[set - 1], &rayhit);
    if (rt->moving[set - 1]) // only what is nearer than what rests
        trace_intersect1(rt->moving[set - 1], &rayhit);
    if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    const struct rt_mesh *mesh = get_mesh(rt, rayhit.hit.instID[0], rayhit.hit.geomID);
    if (mesh->is_thin)
        sharpen(mesh, get_stand(rt, rayhit.hit.instID[0]), rayhit.hit.primID, org, dir,
                &rayhit.ray.tfar, &rayhit.hit.u, &rayhit.hit.v);
    make_hit(rt, rayhit.hit.instID[0], rayhit.hit.geomID, rayhit.hit.primID, rayhit.ray.tfar,
             rayhit.hit.u, rayhit.hit.v, out_hit);
    return true;
}

/** The packet as Embree has it. */
static void fill_rays(const struct gn_rt_packet *packet, struct RTCRay16 *ray)
{
    memcpy(ray->org_x, packet->org_x, sizeof(ray->org_x));
    memcpy(ray->org_y, packet->org_y, sizeof(ray->org_y));
    memcpy(ray->org_z, packet->org_z, sizeof(ray->org_z));
    memcpy(ray->tnear, packet->t_near, sizeof(ray->tnear));
    memcpy(ray->dir_x, packet->dir_x, sizeof(ray->dir_x));
    memcpy(ray->dir_y, packet->dir_y, sizeof(ray->dir_y));
    memcpy(ray->dir_z, packet->dir_z, sizeof(ray->dir_z));
    memcpy(ray->tfar, packet->t_far, sizeof(ray->tfar));
    memset(ray->time, 0, sizeof(ray->time));
    memset(ray->mask, 0xff, sizeof(ray->mask));
    memset(ray->id, 0, sizeof(ray->id));
    memset(ray->flags, 0, sizeof(ray->flags));
}

void gn_rt_intersect16(const struct gn_rt *rt, enum gn_rt_set set,
                       const struct gn_rt_packet *packet, struct gn_rt_packet_hits *out_hits)
{
    assert(rt->is_committed);
    struct RTCRayHit16 rayhit;
    fill_rays(packet, &rayhit.ray);
    for (int i = 0; i < GN_RT_PACKET; i++)
        rayhit.hit.geomID[i] = rayhit.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    if (rt->scenes[set - 1])
        trace_intersect16(packet->valid, rt->scenes[set - 1], false, &rayhit);
    if (rt->moving[set - 1])
        trace_intersect16(packet->valid, rt->moving[set - 1], true, &rayhit);
    memcpy(out_hits->distance, rayhit.ray.tfar, sizeof(out_hits->distance));
    memcpy(out_hits->u, rayhit.hit.u, sizeof(out_hits->u));
    memcpy(out_hits->v, rayhit.hit.v, sizeof(out_hits->v));
    memcpy(out_hits->triangle, rayhit.hit.primID, sizeof(out_hits->triangle));
    memcpy(out_hits->mesh, rayhit.hit.geomID, sizeof(out_hits->mesh));
    memcpy(out_hits->mover, rayhit.hit.instID[0], sizeof(out_hits->mover));
    out_hits->met = 0;
    for (int i = 0; i < GN_RT_PACKET; i++) {
        if (packet->valid[i] == 0 || rayhit.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID)
            continue;
        out_hits->met |= 1u << i;
        const struct rt_mesh *mesh = get_mesh(rt, out_hits->mover[i], out_hits->mesh[i]);
        const float org[3] = {packet->org_x[i], packet->org_y[i], packet->org_z[i]};
        const float dir[3] = {packet->dir_x[i], packet->dir_y[i], packet->dir_z[i]};
        out_hits->object[i] = mesh->object;
        if (mesh->is_thin)
            sharpen(mesh, get_stand(rt, out_hits->mover[i]), out_hits->triangle[i], org, dir,
                    &out_hits->distance[i], &out_hits->u[i], &out_hits->v[i]);
    }
}

void gn_rt_get_hit(const struct gn_rt *rt, const struct gn_rt_packet_hits *hits, int lane,
                   struct gn_rt_hit *out_hit)
{
    make_hit(rt, hits->mover[lane], hits->mesh[lane], hits->triangle[lane], hits->distance[lane],
             hits->u[lane], hits->v[lane], out_hit);
}

/** True where all lanes that have met something have met the same triangle. */
static bool is_one_triangle(const struct gn_rt_packet_hits *hits, int lane)
{
    uint32_t other = 0;
    for (int i = 0; i < GN_RT_PACKET; i++) {
        uint32_t differs = (hits->triangle[i] ^ hits->triangle[lane]) |
                           (hits->mesh[i] ^ hits->mesh[lane]) |
                           (hits->mover[i] ^ hits->mover[lane]);
        other |= hits->met >> i & 1 ? differs : 0;
    }
    return other == 0;
}

/** Bounds of the points of one triangle that rests. */
static void bound_triangle(const struct spot *spot, const struct gn_rt_packet_hits *hits,
                           float out_min[static 3], float out_max[static 3])
{
    for (int k = 0; k < 3; k++) {
        float p[GN_RT_PACKET];
        for (int i = 0; i < GN_RT_PACKET; i++)
            p[i] = (float)(spot->v0[k] + (double)hits->u[i] * spot->e1[k] +
                           (double)hits->v[i] * spot->e2[k]);
        for (uint32_t met = hits->met; met != 0; met &= met - 1) {
            float x = p[__builtin_ctz(met)];
            out_min[k] = x < out_min[k] ? x : out_min[k];
            out_max[k] = x > out_max[k] ? x : out_max[k];
        }
    }
}

void gn_rt_bound_points(const struct gn_rt *rt, const struct gn_rt_packet_hits *hits,
                        float out_min[static 3], float out_max[static 3])
{
    int first = hits->met != 0 ? __builtin_ctz(hits->met) : 0;
    for (int k = 0; k < 3; k++) {
        out_min[k] = INFINITY;
        out_max[k] = -INFINITY;
    }
    if (hits->met != 0 && !get_stand(rt, hits->mover[first]) && is_one_triangle(hits, first)) {
        const struct spot spot =
            get_spot(get_mesh(rt, hits->mover[first], hits->mesh[first]), hits->triangle[first]);
        bound_triangle(&spot, hits, out_min, out_max);
        return;
    }
    for (uint32_t met = hits->met; met != 0; met &= met - 1) {
        int i = __builtin_ctz(met);
        const struct rt_stand *stand = get_stand(rt, hits->mover[i]);
        const struct spot spot =
            get_spot(get_mesh(rt, hits->mover[i], hits->mesh[i]), hits->triangle[i]);
        double own[3];
        double p[3];
        get_point(&spot, hits->u[i], hits->v[i], own);
        memcpy(p, own, sizeof(p));
        if (stand)
            to_world(stand->world_from_own, own, 1.0, p);
        for (int k = 0; k < 3; k++) {
            float x = (float)p[k];
            out_min[k] = x < out_min[k] ? x : out_min[k];
            out_max[k] = x > out_max[k] ? x : out_max[k];
        }
    }
}

bool gn_rt_is_occluded(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                       const float dir[static 3], float t_near, float t_far)
{
    assert(rt->is_committed);
    struct RTCRay ray = make_ray(org, dir, t_near, t_far);
    if (rt->scenes[set - 1])
        trace_occluded1(rt->scenes[set - 1], &ray);
    if (rt->moving[set - 1] && ray.tfar >= 0.0f)
        trace_occluded1(rt->moving[set - 1], &ray);
    return ray.tfar < 0.0f; // Embree's mark of a hit: -inf
}

/** Those of the lanes that the ray arrays now say are hidden. */
static uint32_t get_hidden(const struct RTCRay16 *ray, const int32_t *valid)
{
    uint32_t hidden = 0;
    for (int i = 0; i < GN_RT_PACKET; i++)
        hidden |= (uint32_t)(valid[i] != 0 && ray->tfar[i] < 0.0f) << i;
    return hidden;
}

uint32_t gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                              const struct gn_rt_packet *packet)
{
    assert(rt->is_committed);
    struct RTCRay16 ray;
    fill_rays(packet, &ray);
    if (rt->scenes[set - 1])
        trace_occluded16(packet->valid, rt->scenes[set - 1], false, &ray);
    if (!rt->moving[set - 1])
        return get_hidden(&ray, packet->valid);
    _Alignas(64) int32_t valid[GN_RT_PACKET];
    int n = 0;
    for (int i = 0; i < GN_RT_PACKET; i++) {
        valid[i] = packet->valid[i] != 0 && !(ray.tfar[i] < 0.0f) ? -1 : 0;
        n -= valid[i];
    }
    if (n > 0)
        trace_occluded16(valid, rt->moving[set - 1], true, &ray);
    return get_hidden(&ray, packet->valid);
}

void gn_rt_offset_origin(const float point[static 3], const float normal[static 3], float clearance,
                         const float toward[static 3], float out_org[static 3])
{
    float side = normal[0] * toward[0] + normal[1] * toward[1] + normal[2] * toward[2];
    float step = side < 0.0f ? -clearance : clearance;
    for (int k = 0; k < 3; k++)
        out_org[k] = point[k] + step * normal[k];
}
