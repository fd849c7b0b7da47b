/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The upper level: an instance for each mesh that moves. Embree takes a ray into the mesh's own
 * coordinates by a float matrix; what that rounds off is bounded by the largest coordinate that
 * takes part, that of the mesh's box in world, and is in the clearance of a hit.
 */
#include "server/scene/rt_embree.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

/** Checks and sets where a mover stands; widens bounds by its box. */
static int set_stand(const struct rt_mover *mover, const struct gn_pose *pose,
                     struct rt_stand *out_stand, struct rt_bounds *out_bounds,
                     struct gn_error *out_error)
{
    double m[16];
    gn_pose_to_matrix(pose, m);
    struct rt_stand stand = {0};
    struct rt_bounds bounds;
    for (int k = 0; k < 3; k++) {
        const double *row = m + 4 * k;
        double middle = row[3];
        double half = 0.0;
        for (int i = 0; i < 3; i++) {
            const struct rt_bounds *own = &mover->bounds;
            middle += row[i] * mover->middle[i];
            half += fabs(row[i]) * fmax(fabs((double)own->min[i]), fabs((double)own->max[i]));
            stand.world_from_own[3 * i + k] = (float)row[i];
        }
        double far = fabs(middle) + half;
        if (!(far <= GN_RT_MAX_COORDINATE))
            return gn_error_set(out_error, -EINVAL,
                                "the pose puts it %g m from the origin; at most %g m is traced",
                                far, GN_RT_MAX_COORDINATE);
        stand.world_from_own[9 + k] = (float)middle;
        stand.reach = fmaxf(stand.reach, (float)far);
        bounds.min[k] = (float)(middle - half);
        bounds.max[k] = (float)(middle + half);
    }
    for (int k = 0; k < 3; k++) { // by what rounds: see clearance
        bounds.min[k] -= GN_RT_MOVED_ROUNDING * stand.reach;
        bounds.max[k] += GN_RT_MOVED_ROUNDING * stand.reach;
    }
    *out_stand = stand;
    *out_bounds = bounds;
    return 0;
}

/** Checks all before it sets any. */
static int set_stands(struct gn_rt *rt, const struct gn_pose *poses, struct gn_error *out_error)
{
    struct rt_stand stand;
    struct rt_bounds bounds;
    for (int i = 0; i < rt->n_movers; i++) {
        int ret = set_stand(&rt->movers[i], poses ? &poses[i] : &rt->movers[i].pose, &stand,
                            &bounds, out_error);
        if (ret < 0)
            return ret;
    }
    for (int i = 0; i < 3; i++)
        rt->bounds[i] = rt->resting[i];
    for (int i = 0; i < rt->n_movers; i++) {
        const struct rt_mover *mover = &rt->movers[i];
        (void)set_stand(mover, poses ? &poses[i] : &mover->pose, &rt->stands[i], &bounds, NULL);
        gn_rt_widen_bounds(&rt->bounds[mover->set - 1], &bounds);
        gn_rt_widen_bounds(&rt->bounds[GN_RT_ALL - 1], &bounds);
        rtcSetGeometryTransform(rt->instances[i], 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                                rt->stands[i].world_from_own);
        rtcCommitGeometry(rt->instances[i]);
    }
    for (int i = 0; i < 3; i++) {
        if (rt->moving[i])
            rtcCommitScene(rt->moving[i]);
    }
    return gn_rt_check_device(rt->device, "cannot move a mesh", out_error);
}

/** The scene of a set's instances; with those of one set only, that of all is the same one. */
static RTCScene get_scene(struct gn_rt *rt, enum gn_rt_set set)
{
    RTCScene *scene = &rt->moving[set - 1];
    if (!*scene)
        *scene = rtcNewScene(rt->device);
    if (*scene)
        rtcSetSceneFlags(*scene, RTC_SCENE_FLAG_ROBUST);
    return *scene;
}

static int attach(struct gn_rt *rt, struct gn_error *out_error)
{
    bool has[4] = {false};
    for (int i = 0; i < rt->n_movers; i++)
        has[rt->movers[i].set] = true;
    for (int i = 0; i < rt->n_movers; i++) {
        const struct rt_mover *mover = &rt->movers[i];
        RTCGeometry instance = rtcNewGeometry(rt->device, RTC_GEOMETRY_TYPE_INSTANCE);
        RTCScene scene = get_scene(rt, mover->set);
        RTCScene all = has[1] && has[2] ? get_scene(rt, GN_RT_ALL) : NULL;
        rt->instances[i] = instance;
        if (!instance || !scene || (has[1] && has[2] && !all))
            break;
        rtcSetGeometryInstancedScene(instance, mover->scene);
        rtcSetGeometryTimeStepCount(instance, 1);
        rtcSetGeometryMask(instance, 0xffffffffu);
        rtcAttachGeometryByID(scene, instance, (unsigned)i);
        if (all)
            rtcAttachGeometryByID(all, instance, (unsigned)i);
    }
    int ret = gn_rt_check_device(rt->device, "cannot add a mesh that moves", out_error);
    if (ret == 0 && !(has[1] && has[2])) {
        rt->moving[GN_RT_ALL - 1] = rt->moving[has[1] ? 0 : 1];
        rtcRetainScene(rt->moving[GN_RT_ALL - 1]);
    }
    return ret;
}

int gn_rt_make_instances(struct gn_rt *rt, struct gn_error *out_error)
{
    for (int i = 0; i < 3; i++)
        rt->bounds[i] = rt->resting[i];
    if (rt->n_movers == 0)
        return 0;
    rt->stands = calloc((size_t)rt->n_movers, sizeof(*rt->stands));
    rt->instances = calloc((size_t)rt->n_movers, sizeof(*rt->instances));
    if (!rt->stands || !rt->instances)
        return gn_error_set(out_error, -ENOMEM, "ray tracer: out of memory");
    int ret = attach(rt, out_error);
    return ret == 0 ? set_stands(rt, NULL, out_error) : ret;
}

void gn_rt_finish_instances(struct gn_rt *rt)
{
    for (int i = 0; i < 3; i++) {
        if (rt->moving[i])
            rtcReleaseScene(rt->moving[i]);
    }
    for (int i = 0; i < rt->n_movers && rt->instances; i++) {
        if (rt->instances[i])
            rtcReleaseGeometry(rt->instances[i]);
    }
    free(rt->instances);
    free(rt->stands);
}

int gn_rt_create_posed(const struct gn_rt *source, struct gn_rt **out_rt,
                       struct gn_error *out_error)
{
    *out_rt = NULL;
    if (!source->is_committed || source->source)
        return gn_error_set(out_error, -EINVAL, "ray tracer: not a committed scene of its own");
    struct gn_rt *rt = malloc(sizeof(*rt));
    if (!rt)
        return gn_error_set(out_error, -ENOMEM, "ray tracer: out of memory");
    *rt = *source;
    rt->source = source;
    rt->stands = NULL;
    rt->instances = NULL;
    rt->device = gn_rt_acquire_device(); // there is one: the source has it
    for (int i = 0; i < 3; i++) {
        rt->moving[i] = NULL;
        if (rt->scenes[i])
            rtcRetainScene(rt->scenes[i]);
    }
    int ret = gn_rt_make_instances(rt, out_error);
    if (ret == 0)
        *out_rt = rt;
    else
        gn_rt_destroy(&rt);
    return ret;
}

int gn_rt_set_poses(struct gn_rt *rt, const struct gn_pose *poses, struct gn_error *out_error)
{
    if (!rt->source)
        return gn_error_set(out_error, -EINVAL, "ray tracer: only a posed scene takes poses");
    return rt->n_movers > 0 ? set_stands(rt, poses, out_error) : 0;
}
