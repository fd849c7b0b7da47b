/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Poses that come in: of a viewer's camera, of movable objects. */
#include <errno.h>

#include "common/log.h"
#include "server/room/convert.h"
#include "server/room/room_internal.h"

GN_LOG_TOPIC("room");

static int put_own_pose(struct gn_room_session *session, const struct gn_msg_pose *pose,
                        struct gn_error *out_error)
{
    if (session->role != GN_MSG_ROLE_VIEWER)
        return gn_error_set(out_error, -EOPNOTSUPP,
                            "POSE.object is empty: a tracker names a movable object; a viewer's "
                            "camera is only posed by itself");
    int rc = gn_convert_transform(pose->has_world_from_object, &pose->world_from_object,
                                  &session->world_from_camera, out_error);
    session->has_pose = session->has_pose || rc == 0;
    return rc;
}

/** Which object, where and when. Returns its index or a negative errno and a sentence. */
static int read_pose(const struct gn_room *room, const struct gn_msg_pose *pose, int64_t now_ns,
                     struct gn_pose *out_pose, int64_t *out_time_ns, struct gn_error *out_error)
{
    int index = gn_poses_find(&room->poses, pose->object, out_error);
    if (index < 0)
        return index;
    *out_time_ns = pose->time_ns != 0 ? pose->time_ns : now_ns;
    if (*out_time_ns > now_ns + GN_POSES_AHEAD_NS)
        return gn_error_set(out_error, -EINVAL,
                            "object '%s': POSE.time_ns lies %.3f s ahead of the server's clock: "
                            "PING tells it",
                            pose->object, gn_clock_get_ms_between(now_ns, *out_time_ns) * 1e-3);
    int rc = gn_convert_transform(pose->has_world_from_object, &pose->world_from_object, out_pose,
                                  out_error);
    return rc < 0 ? rc : index;
}

int gn_room_put_pose(struct gn_room_session *session, const struct gn_msg_pose *pose,
                     struct gn_error *out_error)
{
    struct gn_room *room = session->room;
    struct gn_pose where = {{0}};
    int64_t now_ns = gn_clock_get_monotonic_ns();
    int64_t time_ns = 0;
    if (!pose->object[0])
        return put_own_pose(session, pose, out_error);
    // Names stay as they are, so no lock is needed to find one.
    int index = read_pose(room, pose, now_ns, &where, &time_ns, out_error);
    gn_mutex_lock(&room->mu);
    room->figures.poses_in++;
    session->figures.poses_in++;
    room->figures.poses_refused += index < 0;
    if (index >= 0 &&
        gn_poses_put(&room->poses, index, &where, time_ns, now_ns, session->id) == GN_POSE_LATE)
        room->figures.poses_late++;
    gn_mutex_unlock(&room->mu);
    return index < 0 ? index : 0;
}

int gn_room_get_movers(struct gn_room *room, int first, int cap,
                       struct gn_mover_figures *out_movers)
{
    struct gn_time_window intervals[GN_MOVER_FIGURES_MAX];
    if (cap > GN_MOVER_FIGURES_MAX)
        cap = GN_MOVER_FIGURES_MAX;
    gn_mutex_lock(&room->mu);
    int n = gn_poses_get_figures(&room->poses, first, cap, out_movers, intervals);
    gn_mutex_unlock(&room->mu);
    for (int i = 0; i < n; i++) {
        double ms = gn_time_window_get(&intervals[i], 0.5);
        out_movers[i].rate_hz = ms > 0 ? 1000 / ms : 0;
    }
    return n;
}
