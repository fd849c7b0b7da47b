/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/rt_embree.h"
#include "server/scene/rt_loop.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/thread.h"

// Meshes a scene may hold; geometry ids are indices of gn_rt.meshes.
#define MAX_MESHES (1 << 20)
// Length over width of triangles that are met in double.
#define THIN 64.0

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

int gn_rt_check_device(RTCDevice device, const char *what, struct gn_error *out_error)
{
    enum RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_NONE)
        return 0;
    int code = error == RTC_ERROR_OUT_OF_MEMORY ? -ENOMEM : -EIO;
    return gn_error_set(out_error, code, "ray tracer: %s: %s", what, name_error(error));
}

RTCDevice gn_rt_acquire_device(void)
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

void gn_rt_release_device(void)
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
    rt->device = gn_rt_acquire_device();
    if (!rt->device) {
        ret = gn_rt_check_device(NULL, "cannot start", out_error);
        if (ret == 0)
            ret = gn_error_set(out_error, -EIO, "ray tracer: cannot start");
        goto out;
    }
    for (int i = 0; i < 3; i++) {
        rt->scenes[i] = rtcNewScene(rt->device);
        if (!rt->scenes[i]) {
            ret = gn_rt_check_device(rt->device, "cannot make a scene", out_error);
            goto out;
        }
        rtcSetSceneFlags(rt->scenes[i], RTC_SCENE_FLAG_ROBUST);
        rt->resting[i] = rt->bounds[i] = RT_BOUNDS_EMPTY;
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
    gn_rt_finish_instances(self);
    for (int i = 0; i < 3; i++) {
        if (self->scenes[i])
            rtcReleaseScene(self->scenes[i]);
    }
    for (int i = 0; i < self->n_movers && !self->source; i++)
        rtcReleaseScene(self->movers[i].scene);
    if (self->device)
        gn_rt_release_device();
    if (!self->source) {
        free(self->meshes);
        free(self->movers);
    }
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

void gn_rt_widen_bounds(struct rt_bounds *bounds, const struct rt_bounds *more)
{
    for (int k = 0; k < 3; k++) {
        bounds->min[k] = fminf(bounds->min[k], more->min[k]);
        bounds->max[k] = fmaxf(bounds->max[k], more->max[k]);
    }
}

/** Lets rays pass where the mesh is cut out: those lanes' hits are dropped. */
static void filter_cutouts(const struct RTCFilterFunctionNArguments *arguments)
{
    // In C the hits' rows of N have no names: Ng_x, Ng_y, Ng_z, u, v, primID, ... (rtcore_ray.h).
    const struct gn_mesh *mesh = arguments->geometryUserPtr;
    const char *rows = (const char *)arguments->hit;
    size_t n = arguments->N;
    for (size_t i = 0; i < n; i++) {
        float uv[2];
        uint32_t triangle;
        memcpy(&uv[0], rows + 4 * (3 * n + i), sizeof(uv[0]));
        memcpy(&uv[1], rows + 4 * (4 * n + i), sizeof(uv[1]));
        memcpy(&triangle, rows + 4 * (5 * n + i), sizeof(triangle));
        if (arguments->valid[i] != 0 && gn_mesh_is_cut_out(mesh, triangle, uv[0], uv[1]))
            arguments->valid[i] = 0;
    }
}

static void set_cutouts(RTCGeometry geometry, const struct gn_mesh *mesh)
{
    void *pointer; // Embree hands it back as it is; nothing is written through it
    memcpy(&pointer, &mesh, sizeof(pointer));
    rtcSetGeometryUserData(geometry, pointer);
    rtcSetGeometryIntersectFilterFunction(geometry, filter_cutouts);
    rtcSetGeometryOccludedFilterFunction(geometry, filter_cutouts);
}

static int check_addition(const struct gn_rt *rt, enum gn_rt_set set, const double m[static 16],
                          struct gn_error *out_error)
{
    if (rt->is_committed)
        return gn_error_set(out_error, -EINVAL, "ray tracer: the scene is committed already");
    if (set != GN_RT_REAL && set != GN_RT_VIRTUAL)
        return gn_error_set(out_error, -EINVAL, "a mesh is either real or virtual");
    return check_matrix(m, out_error);
}

/** Twice a triangle's area, squared, and its longest side, squared. Exact for zero area: products
 * of differences of floats. */
static void measure(const float *vertices, const uint32_t index[static 3], double *out_area2,
                    double *out_side2)
{
    const float *p[3];
    double e[3][3]; // sides; e[2] = -(e[0] + e[1])
    *out_area2 = *out_side2 = 0;
    for (int i = 0; i < 3; i++)
        p[i] = vertices + 3 * (size_t)index[i];
    for (int i = 0; i < 3; i++) {
        double square = 0;
        for (int k = 0; k < 3; k++) {
            e[i][k] = (double)p[(i + 1) % 3][k] - p[i][k];
            square += e[i][k] * e[i][k];
        }
        *out_side2 = fmax(*out_side2, square);
    }
    for (int k = 0; k < 3; k++) {
        double n = e[0][(k + 1) % 3] * e[1][(k + 2) % 3] - e[0][(k + 2) % 3] * e[1][(k + 1) % 3];
        *out_area2 += n * n;
    }
}

/** Copies triangles. One that has no area after the matrix and rounding is made a point, which no
 * ray meets: it has no normal. True where one is thin. */
static bool copy_triangles(const struct gn_mesh *mesh, const float *vertices, uint32_t *out)
{
    bool is_thin = false;
    for (size_t i = 0; i < (size_t)mesh->n_triangles; i++) {
        uint32_t *index = out + 3 * i;
        double area2;
        double side2;
        for (int k = 0; k < 3; k++) {
            index[k] = mesh->triangles[3 * i + (size_t)k];
            assert(index[k] < (uint32_t)mesh->n_vertices);
        }
        measure(vertices, index, &area2, &side2);
        if (area2 > 0)
            is_thin |= area2 * (THIN * THIN) < side2 * side2;
        else
            index[1] = index[2] = index[0];
    }
    return is_thin;
}

/** Embree's copy of a mesh after the matrix, committed; *out_geometry is the caller's. */
static int make_geometry(struct gn_rt *rt, uint32_t object, const struct gn_mesh *mesh,
                         const double m[static 16], RTCGeometry *out_geometry,
                         struct rt_mesh *out_mesh, struct rt_bounds *out_bounds,
                         struct gn_error *out_error)
{
    RTCGeometry geometry = rtcNewGeometry(rt->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *vertices = NULL;
    uint32_t *triangles = NULL;
    struct rt_bounds bounds = RT_BOUNDS_EMPTY;
    int ret = 0;
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
    ret = transform_vertices(mesh, m, vertices, &bounds, out_error);
    if (ret < 0)
        goto out;
    bool is_thin = copy_triangles(mesh, vertices, triangles);
    rtcSetGeometryMask(geometry, 0xffffffffu);
    if (gn_mesh_has_cutouts(mesh))
        set_cutouts(geometry, mesh);
    rtcCommitGeometry(geometry);
    *out_geometry = geometry;
    geometry = NULL;
    *out_mesh = (struct rt_mesh){
        .object = object,
        .mirrored = get_determinant(m) < 0.0,
        .is_thin = is_thin,
        .vertices = vertices,
        .triangles = triangles,
    };
    *out_bounds = bounds;
out:
    if (geometry)
        rtcReleaseGeometry(geometry);
    return ret;
}

int gn_rt_add_mesh(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                   const struct gn_mesh *mesh, const double world_from_object[static 16],
                   struct gn_error *out_error)
{
    RTCGeometry geometry = NULL;
    struct rt_mesh made = {0};
    struct rt_bounds bounds;
    int ret = check_addition(rt, set, world_from_object, out_error);
    if (ret == 0)
        ret = reserve_mesh(rt, out_error);
    if (ret == 0)
        ret = make_geometry(rt, object, mesh, world_from_object, &geometry, &made, &bounds,
                            out_error);
    if (ret < 0)
        return ret;
    unsigned id = (unsigned)rt->n_meshes;
    rtcAttachGeometryByID(rt->scenes[set - 1], geometry, id);
    rtcAttachGeometryByID(rt->scenes[GN_RT_ALL - 1], geometry, id);
    rtcReleaseGeometry(geometry);
    ret = gn_rt_check_device(rt->device, "cannot add a mesh", out_error);
    if (ret < 0)
        return ret;
    rt->meshes[rt->n_meshes++] = made;
    gn_rt_widen_bounds(&rt->resting[set - 1], &bounds);
    gn_rt_widen_bounds(&rt->resting[GN_RT_ALL - 1], &bounds);
    return 0;
}

static int reserve_mover(struct gn_rt *rt, struct gn_error *out_error)
{
    if (rt->n_movers < rt->movers_capacity)
        return 0;
    int capacity = rt->movers_capacity ? 2 * rt->movers_capacity : 4;
    struct rt_mover *movers = realloc(rt->movers, (size_t)capacity * sizeof(*movers));
    if (!movers)
        return gn_error_set(out_error, -ENOMEM, "ray tracer: out of memory");
    rt->movers = movers;
    rt->movers_capacity = capacity;
    return 0;
}

/** The middle of the mesh's box after the matrix; 0 where there is none. */
static void get_middle(const struct gn_mesh *mesh, const double m[static 16], double out[static 3])
{
    for (int k = 0; k < 3; k++) {
        const double *row = m + 4 * k;
        double min = INFINITY;
        double max = -INFINITY;
        for (int i = 0; i < mesh->n_vertices; i++) {
            const float *p = mesh->positions + 3 * (size_t)i;
            double x = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
            min = fmin(min, x);
            max = fmax(max, x);
        }
        out[k] = min <= max ? 0.5 * (min + max) : 0.0;
    }
}

int gn_rt_add_mover(struct gn_rt *rt, enum gn_rt_set set, uint32_t object,
                    const struct gn_mesh *mesh, const double object_from_mesh[static 16],
                    const struct gn_pose *world_from_object, struct gn_error *out_error)
{
    int ret = check_addition(rt, set, object_from_mesh, out_error);
    if (ret == 0)
        ret = reserve_mover(rt, out_error);
    if (ret < 0)
        return ret;
    RTCGeometry geometry = NULL;
    struct rt_mover mover = {.set = set, .pose = *world_from_object};
    double own_from_mesh[16];
    memcpy(own_from_mesh, object_from_mesh, sizeof(own_from_mesh));
    get_middle(mesh, object_from_mesh, mover.middle);
    for (int k = 0; k < 3; k++)
        own_from_mesh[4 * k + 3] -= mover.middle[k];
    ret = make_geometry(rt, object, mesh, own_from_mesh, &geometry, &mover.mesh, &mover.bounds,
                        out_error);
    if (ret < 0)
        return ret;
    mover.scene = rtcNewScene(rt->device);
    if (mover.scene) {
        rtcSetSceneFlags(mover.scene, RTC_SCENE_FLAG_ROBUST);
        rtcAttachGeometryByID(mover.scene, geometry, 0);
    }
    rtcReleaseGeometry(geometry);
    ret = gn_rt_check_device(rt->device, "cannot add a mesh that moves", out_error);
    if (ret == 0) {
        rt->movers[rt->n_movers++] = mover;
        return 0;
    }
    if (mover.scene)
        rtcReleaseScene(mover.scene);
    return ret;
}

static void join_commit(void *context, int item, int worker)
{
    (void)item;
    (void)worker;
    rtcJoinCommitScene(context);
}

static int build(const struct gn_rt *rt, RTCScene scene, struct gn_pool *pool,
                 struct gn_error *out_error)
{
    // A thread more than Embree has slots for would wait inside for ever.
    int n_threads = pool ? gn_pool_get_size(pool) : 1;
    int n_processors = gn_thread_get_cpu_count();
    if (n_threads > n_processors)
        n_threads = n_processors;
    gn_pool_run(pool, n_threads, join_commit, scene);
    // Builds again only where another thread's share of the build failed: the error is kept for
    // the thread that met it, and this call meets it here.
    rtcCommitScene(scene);
    return gn_rt_check_device(rt->device, "cannot build the scene", out_error);
}

int gn_rt_commit(struct gn_rt *rt, struct gn_pool *pool, struct gn_error *out_error)
{
    int ret = 0;
    if (rt->is_committed)
        return gn_error_set(out_error, -EINVAL, "ray tracer: the scene is committed already");
    for (int i = 0; i < 3 && ret == 0; i++) {
        ret = build(rt, rt->scenes[i], pool, out_error);
        if (ret == 0 && rt->resting[i].min[0] > rt->resting[i].max[0]) {
            rtcReleaseScene(rt->scenes[i]); // nothing rests: no ray asks it
            rt->scenes[i] = NULL;
        }
    }
    for (int i = 0; i < rt->n_movers && ret == 0; i++)
        ret = build(rt, rt->movers[i].scene, pool, out_error);
    if (ret == 0)
        ret = gn_rt_make_instances(rt, out_error);
    if (ret < 0)
        return ret;
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

void *gn_rt_get_tree(const struct gn_rt *rt, enum gn_rt_set set)
{
    return rt->scenes[set - 1];
}
