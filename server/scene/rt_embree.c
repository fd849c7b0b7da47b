/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/rt.h"
#include "server/scene/rt_loop.h"

#include <assert.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef GN_HAVE_EMBREE4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "common/thread.h"

// Meshes a scene may hold; geometry ids are indices of gn_rt.meshes.
#define MAX_MESHES (1 << 20)

struct rt_mesh {
    uint32_t object;
    bool mirrored;             // world_from_object turns the winding round
    const float *vertices;     // [][3] world m; Embree's buffer, alive as long as the scenes
    const uint32_t *triangles; // [][3]
};

struct rt_bounds {
    float min[3];
    float max[3];
};

struct gn_rt {
    RTCDevice device;           // shared (ref)
    RTCScene scenes[3];         // index: set - 1
    struct rt_bounds bounds[3]; // min > max: empty
    int n_meshes;
    int capacity;
    struct rt_mesh *meshes; // [capacity]; index = geometry id in every scene
    bool is_committed;
};

/* One device for the process: its threads and its memory are shared by all scenes. */
static struct {
    struct gn_mutex mu;
    RTCDevice device; // guarded by mu; one reference each gn_rt
    int users;        // guarded by mu
} shared = {.mu = {.pthread = PTHREAD_MUTEX_INITIALIZER}};

static const char *name_error(enum RTCError error)
{
    switch (error) {
    case RTC_ERROR_INVALID_ARGUMENT:
        return "invalid argument";
    case RTC_ERROR_INVALID_OPERATION:
        return "invalid operation";
    case RTC_ERROR_OUT_OF_MEMORY:
        return "out of memory";
    case RTC_ERROR_UNSUPPORTED_CPU:
        return "this processor lacks SSE2";
    case RTC_ERROR_CANCELLED:
        return "cancelled";
    default:
        return "unknown error";
    }
}

/** 0, or the errno of what went wrong in this thread's last Embree calls. */
static int check_device(RTCDevice device, const char *what, struct gn_error *out_error)
{
    enum RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_NONE)
        return 0;
    int code = error == RTC_ERROR_OUT_OF_MEMORY ? -ENOMEM : -EIO;
    return gn_error_set(out_error, code, "ray tracer: %s: %s", what, name_error(error));
}

static RTCDevice acquire_device(void)
{
    gn_mutex_lock(&shared.mu);
    if (shared.users == 0) {
        // Embree starts no threads of its own: those that build a tree are ours, and join.
        char config[64];
        int n = gn_thread_get_cpu_count();
        (void)snprintf(config, sizeof(config), "threads=%d,user_threads=%d", n, n);
        shared.device = rtcNewDevice(config);
    }
    if (shared.device)
        shared.users++;
    RTCDevice device = shared.device;
    gn_mutex_unlock(&shared.mu);
    return device;
}

static void release_device(void)
{
    gn_mutex_lock(&shared.mu);
    if (--shared.users == 0) {
        rtcReleaseDevice(shared.device);
        shared.device = NULL;
    }
    gn_mutex_unlock(&shared.mu);
}

int gn_rt_create(struct gn_rt **out_rt, struct gn_error *out_error)
{
    *out_rt = NULL;
    struct gn_rt *rt = calloc(1, sizeof(*rt));
    if (!rt)
        return gn_error_set(out_error, -ENOMEM, "ray tracer: out of memory");
    int ret = 0;
    rt->device = acquire_device();
    if (!rt->device) {
        ret = check_device(NULL, "cannot start", out_error);
        if (ret == 0)
            ret = gn_error_set(out_error, -EIO, "ray tracer: cannot start");
        goto out;
    }
    for (int i = 0; i < 3; i++) {
        rt->scenes[i] = rtcNewScene(rt->device);
        if (!rt->scenes[i]) {
            ret = check_device(rt->device, "cannot make a scene", out_error);
            goto out;
        }
        rtcSetSceneFlags(rt->scenes[i], RTC_SCENE_FLAG_ROBUST);
        for (int k = 0; k < 3; k++) {
            rt->bounds[i].min[k] = INFINITY;
            rt->bounds[i].max[k] = -INFINITY;
        }
    }
    *out_rt = rt;
    rt = NULL;
out:
    gn_rt_destroy(&rt);
    return ret;
}

void gn_rt_destroy(struct gn_rt **rt)
{
    struct gn_rt *self = *rt;
    *rt = NULL;
    if (!self)
        return;
    for (int i = 0; i < 3; i++) {
        if (self->scenes[i])
            rtcReleaseScene(self->scenes[i]);
    }
    if (self->device)
        release_device();
    free(self->meshes);
    free(self);
}

static double get_determinant(const double m[static 16])
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

static int check_matrix(const double m[static 16], struct gn_error *out_error)
{
    for (int i = 0; i < 16; i++) {
        if (!isfinite(m[i]))
            return gn_error_set(out_error, -EINVAL, "world_from_object: element %d is not finite",
                                i);
    }
    if (m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
        return gn_error_set(out_error, -EINVAL, "world_from_object: last row must be 0 0 0 1");
    // Relative to the rows' lengths, so that a small uniform scale is no singularity.
    double rows = 1.0;
    for (int i = 0; i < 3; i++)
        rows *=
            sqrt(m[4 * i] * m[4 * i] + m[4 * i + 1] * m[4 * i + 1] + m[4 * i + 2] * m[4 * i + 2]);
    double det = get_determinant(m);
    if (!(fabs(det) > 1e-9 * rows) || !isfinite(det))
        return gn_error_set(out_error, -EINVAL, "world_from_object: singular matrix");
    return 0;
}

/** World vertices into out[n][3]; widens the bounds. */
static int transform_vertices(const struct gn_mesh *mesh, const double m[static 16], float *out,
                              struct rt_bounds *bounds, struct gn_error *out_error)
{
    for (int i = 0; i < mesh->n_vertices; i++) {
        const float *p = mesh->positions + 3 * (size_t)i;
        for (int k = 0; k < 3; k++) {
            const double *row = m + 4 * k;
            double x = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
            if (!(fabs(x) <= GN_RT_MAX_COORDINATE))
                return gn_error_set(out_error, -EINVAL,
                                    "vertex %d lies at %g m in the world; at most %g m is traced",
                                    i, x, GN_RT_MAX_COORDINATE);
            float f = (float)x;
            out[3 * (size_t)i + (size_t)k] = f;
            bounds->min[k] = fminf(bounds->min[k], f);
            bounds->max[k] = fmaxf(bounds->max[k], f);
        }
    }
    return 0;
}

static int reserve_mesh(struct gn_rt *rt, struct gn_error *out_error)
{
    if (rt->n_meshes < rt->capacity)
        return 0;
    if (rt->capacity >= MAX_MESHES)
        return gn_error_set(out_error, -EINVAL, "more than %d meshes in one scene", MAX_MESHES);
    int capacity = rt->capacity ? 2 * rt->capacity : 16;
    struct rt_mesh *meshes = realloc(rt->meshes, (size_t)capacity * sizeof(*meshes));
    if (!meshes)
        return gn_error_set(out_error, -ENOMEM, "ray tracer: out of memory");
    rt->meshes = meshes;
    rt->capacity = capacity;
    return 0;
}

static void widen_bounds(struct rt_bounds *bounds, const struct rt_bounds *more)
{
    for (int k = 0; k < 3; k++) {
        bounds->min[k] = fminf(bounds->min[k], more->min[k]);
        bounds->max[k] = fmaxf(bounds->max[k], more->max[k]);
    }
}

int gn_rt_add_mesh(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                   const struct gn_mesh *mesh, const double world_from_object[static 16],
                   struct gn_error *out_error)
{
    if (rt->is_committed)
        return gn_error_set(out_error, -EINVAL, "ray tracer: the scene is committed already");
    if (set != GN_RT_REAL && set != GN_RT_VIRTUAL)
        return gn_error_set(out_error, -EINVAL, "a mesh is either real or virtual");
    int ret = check_matrix(world_from_object, out_error);
    if (ret == 0)
        ret = reserve_mesh(rt, out_error);
    if (ret < 0)
        return ret;

    RTCGeometry geometry = rtcNewGeometry(rt->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *vertices = NULL;
    uint32_t *triangles = NULL;
    struct rt_bounds bounds = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    if (geometry) {
        vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           3 * sizeof(float), (size_t)mesh->n_vertices);
        triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            3 * sizeof(uint32_t), (size_t)mesh->n_triangles);
    }
    if (!vertices || !triangles) {
        ret = gn_error_set(out_error, -ENOMEM, "ray tracer: no memory for %d triangles",
                           mesh->n_triangles);
        (void)rtcGetDeviceError(rt->device); // read, so that it is not found by a later call
        goto out;
    }
    ret = transform_vertices(mesh, world_from_object, vertices, &bounds, out_error);
    if (ret < 0)
        goto out;
    for (size_t i = 0; i < 3 * (size_t)mesh->n_triangles; i++) {
        assert(mesh->triangles[i] < (uint32_t)mesh->n_vertices);
        triangles[i] = mesh->triangles[i];
    }
    rtcSetGeometryMask(geometry, 0xffffffffu);
    rtcCommitGeometry(geometry);
    unsigned id = (unsigned)rt->n_meshes;
    rtcAttachGeometryByID(rt->scenes[set - 1], geometry, id);
    rtcAttachGeometryByID(rt->scenes[GN_RT_ALL - 1], geometry, id);
    ret = check_device(rt->device, "cannot add a mesh", out_error);
    if (ret < 0)
        goto out;
    rt->meshes[rt->n_meshes++] = (struct rt_mesh){
        .object = object,
        .mirrored = get_determinant(world_from_object) < 0.0,
        .vertices = vertices,
        .triangles = triangles,
    };
    widen_bounds(&rt->bounds[set - 1], &bounds);
    widen_bounds(&rt->bounds[GN_RT_ALL - 1], &bounds);
out:
    if (geometry)
        rtcReleaseGeometry(geometry);
    return ret;
}

static void join_commit(void *context, int item, int worker)
{
    (void)item;
    (void)worker;
    rtcJoinCommitScene(context);
}

int gn_rt_commit(struct gn_rt *rt, struct gn_pool *pool, struct gn_error *out_error)
{
    // A thread more than Embree has slots for would wait inside for ever.
    int n_threads = pool ? gn_pool_get_size(pool) : 1;
    int n_processors = gn_thread_get_cpu_count();
    if (n_threads > n_processors)
        n_threads = n_processors;
    for (int i = 0; i < 3; i++) {
        gn_pool_run(pool, n_threads, join_commit, rt->scenes[i]);
        // Builds again only where another thread's share of the build failed: the error is kept
        // for the thread that met it, and this call meets it here.
        rtcCommitScene(rt->scenes[i]);
        int ret = check_device(rt->device, "cannot build the scene", out_error);
        if (ret < 0)
            return ret;
    }
    rt->is_committed = true;
    return 0;
}

bool gn_rt_get_bounds(const struct gn_rt *rt, enum gn_rt_set set, float out_min[static 3],
                      float out_max[static 3])
{
    const struct rt_bounds *bounds = &rt->bounds[set - 1];
    if (bounds->min[0] > bounds->max[0])
        return false;
    for (int k = 0; k < 3; k++) {
        out_min[k] = bounds->min[k];
        out_max[k] = bounds->max[k];
    }
    return true;
}

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

static void trace_occluded16(const int *valid, RTCScene scene, struct RTCRay16 *ray)
{
    rtcOccluded16(valid, scene, ray, NULL);
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

static void trace_occluded16(const int *valid, RTCScene scene, struct RTCRay16 *ray)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded16(valid, scene, &context, ray);
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

/** Point, normal and clearance from the triangle's own vertices, in double, rounded once. */
static void fill_hit(const struct rt_mesh *mesh, struct gn_rt_hit *hit)
{
    const uint32_t *index = mesh->triangles + 3 * (size_t)hit->triangle;
    const float *v0 = mesh->vertices + 3 * (size_t)index[0];
    const float *v1 = mesh->vertices + 3 * (size_t)index[1];
    const float *v2 = mesh->vertices + 3 * (size_t)index[2];
    double e1[3];
    double e2[3];
    double magnitude = 0.0;
    double extent = 0.0;
    for (int k = 0; k < 3; k++) {
        e1[k] = (double)v1[k] - v0[k];
        e2[k] = (double)v2[k] - v0[k];
        double p = v0[k] + (double)hit->u * e1[k] + (double)hit->v * e2[k];
        hit->point[k] = (float)p;
        magnitude = fmax(magnitude, fabs(p));
        extent = fmax(extent, fmax(fabs(v0[k] - p), fmax(fabs(v1[k] - p), fabs(v2[k] - p))));
    }
    hit->clearance = (float)(FLT_EPSILON * (4.0 * magnitude + 16.0 * extent));
    double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2],
                   e1[0] * e2[1] - e1[1] * e2[0]};
    double scale = 1.0 / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (mesh->mirrored)
        scale = -scale;
    for (int k = 0; k < 3; k++)
        hit->normal[k] = (float)(n[k] * scale);
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
    trace_intersect1(rt->scenes[set - 1], &rayhit);
    if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    const struct rt_mesh *mesh = &rt->meshes[rayhit.hit.geomID];
    *out_hit = (struct gn_rt_hit){
        .distance = rayhit.ray.tfar,
        .u = rayhit.hit.u,
        .v = rayhit.hit.v,
        .object = mesh->object,
        .triangle = rayhit.hit.primID,
    };
    fill_hit(mesh, out_hit);
    return true;
}

bool gn_rt_is_occluded(const struct gn_rt *rt, enum gn_rt_set set, const float org[static 3],
                       const float dir[static 3], float t_near, float t_far)
{
    assert(rt->is_committed);
    struct RTCRay ray = make_ray(org, dir, t_near, t_far);
    trace_occluded1(rt->scenes[set - 1], &ray);
    return ray.tfar < 0.0f; // Embree's mark of a hit: -inf
}

uint32_t gn_rt_get_occluded16(const struct gn_rt *rt, enum gn_rt_set set,
                              const struct gn_rt_packet *packet)
{
    assert(rt->is_committed);
    struct RTCRay16 ray;
    for (int i = 0; i < GN_RT_PACKET; i++) {
        ray.org_x[i] = packet->org_x[i];
        ray.org_y[i] = packet->org_y[i];
        ray.org_z[i] = packet->org_z[i];
        ray.tnear[i] = packet->t_near[i];
        ray.dir_x[i] = packet->dir_x[i];
        ray.dir_y[i] = packet->dir_y[i];
        ray.dir_z[i] = packet->dir_z[i];
        ray.time[i] = 0.0f;
        ray.tfar[i] = packet->t_far[i];
        ray.mask[i] = 0xffffffffu;
        ray.id[i] = 0;
        ray.flags[i] = 0;
    }
    trace_occluded16(packet->valid, rt->scenes[set - 1], &ray);
    uint32_t occluded = 0;
    for (int i = 0; i < GN_RT_PACKET; i++)
        occluded |= (uint32_t)(packet->valid[i] != 0 && ray.tfar[i] < 0.0f) << i;
    return occluded;
}

void gn_rt_offset_origin(const float point[static 3], const float normal[static 3], float clearance,
                         const float toward[static 3], float out_org[static 3])
{
    float side = normal[0] * toward[0] + normal[1] * toward[1] + normal[2] * toward[2];
    float step = side < 0.0f ? -clearance : clearance;
    for (int k = 0; k < 3; k++)
        out_org[k] = point[k] + step * normal[k];
}

void *gn_rt_get_tree(const struct gn_rt *rt, enum gn_rt_set set)
{
    return rt->scenes[set - 1];
}
