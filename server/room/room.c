/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/room.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/log.h"
#include "server/room/convert.h"
#include "server/room/room_internal.h"

GN_LOG_TOPIC("room");

static int init_locks(struct gn_room *room)
{
    int rc = gn_mutex_init(&room->mu);
    if (rc < 0)
        return rc;
    rc = gn_cond_init(&room->light_wake);
    if (rc < 0) {
        gn_mutex_finish(&room->mu);
        return rc;
    }
    rc = gn_cond_init(&room->render_wake);
    if (rc < 0) {
        gn_cond_finish(&room->light_wake);
        gn_mutex_finish(&room->mu);
    }
    return rc;
}

int gn_room_create(const struct gn_room_options *options, struct gn_room **out_room,
                   struct gn_error *out_error)
{
    *out_room = NULL;
    struct gn_room *room = calloc(1, sizeof(*room));
    if (!room)
        return gn_error_set(out_error, -ENOMEM, "room %s: out of memory", options->name);
    int rc = init_locks(room);
    if (rc < 0) {
        free(room);
        return gn_error_set(out_error, rc, "room %s: no lock: %s", options->name, strerror(-rc));
    }
    room->options = *options;
    snprintf(room->name, sizeof(room->name), "%s", options->name);
    snprintf(room->node, sizeof(room->node), "%s", options->node);
    room->options.name = room->name;
    room->options.node = room->node;
    room->options.scene_path = NULL;

    rc = gn_scheduler_create(&room->scheduler);
    if (rc < 0) {
        gn_error_set(out_error, rc, "room %s: out of memory", room->name);
        goto out;
    }
    struct gn_error scene_error = {0};
    rc = gn_scene_read_file(options->scene_path, options->pool, &room->scene, &scene_error);
    if (rc < 0) {
        gn_error_set(out_error, rc, "room %s: %s", room->name, scene_error.text);
        goto out;
    }
    room->figures.n_objects = room->scene->n_objects;
    room->figures.n_movable = room->scene->n_movable;
    room->figures.n_real_triangles = room->scene->n_real_triangles;
    room->figures.n_virtual_triangles = room->scene->n_virtual_triangles;
    if (room->scene->model == GN_MODEL_GLOBAL)
        room->options.map.model = room->scene;
    gn_render_get_needs(room->scene, &room->options.render, &room->needs);
    rc = gn_frame_maker_create(&room->options, room->scene, &room->maker, &scene_error);
    if (rc < 0) {
        gn_error_set(out_error, rc, "room %s: %s", room->name, scene_error.text);
        goto out;
    }
    rc = gn_emitters_create(room->scene, &room->options.emitters, &room->emitters, &scene_error);
    if (rc == 0)
        rc = gn_screens_init(&room->screens, room->emitters);
    if (rc == 0)
        rc = gn_poses_init(&room->poses, room->scene);
    room->render_poses = calloc((size_t)room->scene->n_movable + 1, sizeof(*room->render_poses));
    if (rc == 0 && !room->render_poses)
        rc = -ENOMEM;
    if (rc < 0) {
        gn_error_set(out_error, rc, "room %s: %s", room->name,
                     scene_error.text[0] ? scene_error.text : "out of memory");
        goto out;
    }
    room->is_light_stale = true;
    rc = gn_thread_start(&room->light_thread, "gn-light", gn_room_run_light, room);
    if (rc == 0)
        rc = gn_thread_start(&room->render_thread, "gn-render", gn_room_run_render, room);
    if (rc < 0) {
        gn_error_set(out_error, rc, "room %s: cannot start a thread: %s", room->name,
                     strerror(-rc));
        goto out;
    }
    gn_log(GN_LOG_INFO, "room %s: %d objects, %d real and %d virtual triangles", room->name,
           room->scene->n_objects, room->scene->n_real_triangles, room->scene->n_virtual_triangles);
    *out_room = room;
    return 0;
out:
    gn_room_destroy(&room);
    return rc;
}

void gn_room_destroy(struct gn_room **room)
{
    struct gn_room *r = *room;
    if (!r)
        return;
    gn_mutex_lock(&r->mu);
    r->is_stopping = true;
    gn_cond_broadcast(&r->light_wake);
    gn_cond_broadcast(&r->render_wake);
    gn_mutex_unlock(&r->mu);
    gn_frame_maker_cancel(r->maker);
    gn_thread_join(&r->light_thread);
    gn_thread_join(&r->render_thread);
    gn_probes_finish(&r->probes);
    gn_screens_finish(&r->screens);
    gn_poses_finish(&r->poses);
    free(r->render_poses);
    gn_emitters_destroy(&r->emitters);
    gn_lighting_state_unref(&r->light);
    gn_snapshot_unref(&r->composite);
    if (r->scheduler)
        gn_scheduler_destroy(&r->scheduler);
    gn_frame_maker_destroy(&r->maker);
    gn_scene_destroy(&r->scene);
    gn_cond_finish(&r->render_wake);
    gn_cond_finish(&r->light_wake);
    gn_mutex_finish(&r->mu);
    free(r);
    *room = NULL;
}

const struct gn_room_options *gn_room_get_options(const struct gn_room *room)
{
    return &room->options;
}

struct gn_room_session *gn_room_find_locked(struct gn_room *room, uint64_t id)
{
    struct gn_room_session *s = room->sessions;
    while (s && s->id != id)
        s = s->next;
    return s;
}

int gn_room_join(struct gn_room *room, const struct gn_room_member *member,
                 struct gn_room_session **out_session, struct gn_error *out_error)
{
    *out_session = NULL;
    struct gn_room_session *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->room = room;
    s->id = member->id;
    s->role = member->role;
    s->want_lighting_maps = member->want_lighting_maps;
    s->want_lighting_states = member->want_lighting_states || member->want_lighting_maps;
    s->slot = -1;
    s->figures.id = member->id;
    s->figures.role = member->role;
    s->figures.since_ns = gn_clock_get_monotonic_ns();
    snprintf(s->figures.name, sizeof(s->figures.name), "%s", member->name);
    snprintf(s->figures.peer, sizeof(s->figures.peer), "%s", member->peer);

    gn_mutex_lock(&room->mu);
    bool has_subscribers =
        s->want_lighting_states && room->n_subscribers == GN_ROOM_MAX_SUBSCRIBERS;
    if (s->role == GN_MSG_ROLE_VIEWER && !has_subscribers)
        s->slot = gn_scheduler_add(room->scheduler);
    bool is_full = has_subscribers || (s->role == GN_MSG_ROLE_VIEWER && s->slot < 0);
    if (!is_full) {
        s->next = room->sessions;
        room->sessions = s;
        if (s->role == GN_MSG_ROLE_VIEWER && room->n_viewers++ == 0)
            gn_probes_owe(&room->probes);
        room->n_probes += s->role == GN_MSG_ROLE_PROBE;
        room->n_screens += s->role == GN_MSG_ROLE_SCREEN;
        room->n_trackers += s->role == GN_MSG_ROLE_TRACKER;
        room->n_subscribers += s->want_lighting_states;
        gn_cond_signal(&room->light_wake);
    }
    gn_mutex_unlock(&room->mu);
    if (is_full) {
        free(s);
        return gn_error_set(out_error, -EUSERS, "room %s has its %d %s", room->name,
                            has_subscribers ? GN_ROOM_MAX_SUBSCRIBERS : GN_ROOM_MAX_VIEWERS,
                            has_subscribers ? "subscribers of lighting states" : "viewers");
    }
    *out_session = s;
    return 0;
}

void gn_room_leave(struct gn_room_session **session)
{
    struct gn_room_session *s = *session;
    if (!s)
        return;
    struct gn_room *room = s->room;
    struct gn_frame_job job;
    bool had_frame = false;
    gn_mutex_lock(&room->mu);
    struct gn_room_session **at = &room->sessions;
    while (*at != s)
        at = &(*at)->next;
    *at = s->next;
    room->n_viewers -= s->role == GN_MSG_ROLE_VIEWER;
    room->n_probes -= s->role == GN_MSG_ROLE_PROBE;
    room->n_screens -= s->role == GN_MSG_ROLE_SCREEN;
    room->n_trackers -= s->role == GN_MSG_ROLE_TRACKER;
    room->n_subscribers -= s->want_lighting_states;
    if (s->slot >= 0)
        had_frame = gn_scheduler_remove(room->scheduler, s->slot, &job);
    struct gn_probe old;
    gn_probes_leave(&room->probes, s->id, &old);
    if (old.light) {
        room->is_light_stale = true;
        gn_cond_signal(&room->light_wake);
    }
    gn_cond_signal(&room->render_wake); // nobody waits for its light any more
    gn_mutex_unlock(&room->mu);
    if (had_frame)
        gn_room_drop(room, &job, GN_MSG_DROP_REASON_SESSION_ENDED, "the session ended");
    gn_probe_finish(&old);
    free(s);
    *session = NULL;
}

void gn_room_drop(struct gn_room *room, struct gn_frame_job *job, enum gn_msg_drop_reason reason,
                  const char *sentence)
{
    uint64_t session_id = job->answer->session_id;
    gn_mutex_lock(&room->mu);
    room->figures.frames_dropped++;
    room->figures.dropped_by_reason[reason]++;
    struct gn_room_session *s = gn_room_find_locked(room, session_id);
    if (s)
        s->figures.frames_dropped++;
    gn_mutex_unlock(&room->mu);
    static struct gn_log_limiter limiter = {.burst = 50, .interval_ns = GN_NS_PER_S};
    gn_log_limited(&limiter, GN_LOG_DEBUG, "room %s: session %llu: frame %llu dropped: %s",
                   room->name, (unsigned long long)session_id, (unsigned long long)job->frame.id,
                   sentence);
    gn_note_set_dropped(job->answer, job->frame.id, reason, sentence);
    gn_buf_unref(&job->payload);
    gn_mailbox_post(room->options.mailbox, job->answer);
    job->answer = NULL;
}

/** Bytes that one view's picture must have; 0: any number (JPEG). */
static size_t get_picture_bytes(const struct gn_camera *camera, enum gn_msg_picture_format format)
{
    return (size_t)camera->width * (size_t)camera->height * gn_wire_get_picture_bytes(format);
}

/** Looks cameras and poses up. Returns 0, or the reason to drop the frame and a sentence. */
static enum gn_msg_drop_reason prepare_job(const struct gn_room_session *s,
                                           struct gn_frame_job *job, struct gn_error *error)
{
    const struct gn_msg_frame *frame = &job->frame;
    if (frame->quality == GN_MSG_QUALITY_REFERENCE && s->room->options.refuse_reference) {
        gn_error_set(error, 0,
                     "room %s renders no frames of reference quality "
                     "(its allow-reference is false)",
                     s->room->name);
        return GN_MSG_DROP_REASON_UNSUPPORTED;
    }
    size_t result_bytes = 0;
    for (size_t i = 0; i < frame->views_count; i++) {
        const struct gn_msg_frame_view *view = &frame->views[i];
        if (view->camera >= GN_LIMIT_VIEWS || !s->has_camera[view->camera]) {
            gn_error_set(error, 0, "view %zu: no CAMERA %u was sent before", i, view->camera);
            return GN_MSG_DROP_REASON_NO_CAMERA;
        }
        struct gn_camera *camera = &job->cameras[i];
        *camera = s->cameras[view->camera];
        if (!view->has_world_from_camera && !s->has_pose) {
            gn_error_set(error, 0, "view %zu: neither a pose of its own nor a POSE before", i);
            return GN_MSG_DROP_REASON_NO_POSE;
        }
        camera->world_from_camera = s->world_from_camera;
        if (view->has_world_from_camera &&
            gn_convert_transform(true, &view->world_from_camera, &camera->world_from_camera,
                                 error) < 0)
            return GN_MSG_DROP_REASON_BAD_FRAME;
        struct gn_error why = {0};
        if (gn_convert_view(view, camera, &why) < 0) {
            gn_error_set(error, -EINVAL, "view %zu: %s", i, why.text);
            return GN_MSG_DROP_REASON_BAD_FRAME;
        }
        gn_match_keep(GN_MATCH_ALL & ~s->room->options.unmatched, camera);
        size_t wanted = get_picture_bytes(camera, view->picture_format);
        if (wanted && wanted != view->payload_length) {
            gn_error_set(error, 0, "view %zu: %u bytes of RGB8, but camera %u has %dx%d: %zu", i,
                         view->payload_length, view->camera, camera->width, camera->height, wanted);
            return GN_MSG_DROP_REASON_BAD_FRAME;
        }
        result_bytes += get_picture_bytes(camera, GN_MSG_PICTURE_FORMAT_RGB8);
    }
    if (frame->result_format != GN_MSG_PICTURE_FORMAT_JPEG &&
        result_bytes > GN_LIMIT_RESULT_BYTES) {
        gn_error_set(error, 0, "the result would take %zu bytes, a message holds %u: ask for JPEG",
                     result_bytes, GN_LIMIT_RESULT_BYTES);
        return GN_MSG_DROP_REASON_UNSUPPORTED;
    }
    return 0;
}

int gn_room_put_frame(struct gn_room_session *session, const struct gn_msg_frame *frame,
                      struct gn_buf *payload, int64_t received_ns, struct gn_error *out_error)
{
    struct gn_room *room = session->room;
    if (frame->id <= session->last_frame_id)
        return gn_error_set(out_error, -EDOM, "FRAME id %llu is not above the last one, %llu",
                            (unsigned long long)frame->id,
                            (unsigned long long)session->last_frame_id);
    struct gn_frame_job job = {.frame = *frame, .received_ns = received_ns};
    if (gn_mailbox_get_blank(room->options.mailbox, &job.answer) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    job.answer->session_id = session->id;
    job.payload = gn_buf_ref(payload);
    session->last_frame_id = frame->id;

    struct gn_error error = {0};
    enum gn_msg_drop_reason reason = prepare_job(session, &job, &error);
    struct gn_frame_job superseded;
    bool has_superseded = false;
    gn_mutex_lock(&room->mu);
    room->figures.frames_in++;
    session->figures.frames_in++;
    if (reason == 0) {
        has_superseded = gn_scheduler_put(room->scheduler, session->slot, &job, &superseded);
        gn_cond_signal(&room->render_wake);
    }
    gn_mutex_unlock(&room->mu);
    if (reason != 0)
        gn_room_drop(room, &job, reason, error.text);
    if (has_superseded)
        gn_room_drop(room, &superseded, GN_MSG_DROP_REASON_SUPERSEDED,
                     "a later frame came before this one was begun");
    return 0;
}

int gn_room_put_camera(struct gn_room_session *session, const struct gn_msg_camera *camera,
                       struct gn_error *out_error)
{
    const struct gn_room_options *o = &session->room->options;
    if (camera->index >= GN_LIMIT_VIEWS)
        return gn_error_set(out_error, -EINVAL, "camera %u: a session has %d", camera->index,
                            GN_LIMIT_VIEWS);
    if (camera->width > (uint32_t)o->max_picture_width ||
        camera->height > (uint32_t)o->max_picture_height)
        return gn_error_set(out_error, -EINVAL, "camera %u has %ux%u, room %s grants %dx%d",
                            camera->index, camera->width, camera->height, o->name,
                            o->max_picture_width, o->max_picture_height);
    int rc = gn_convert_camera(camera, &session->cameras[camera->index], out_error);
    session->has_camera[camera->index] = session->has_camera[camera->index] || rc == 0;
    return rc;
}

int gn_room_put_environment(struct gn_room_session *session,
                            const struct gn_msg_environment_frame *frame, struct gn_buf *payload,
                            struct gn_error *out_error)
{
    struct gn_room *room = session->room;
    const struct gn_room_options *o = &room->options;
    if (frame->sequence <= session->last_environment_sequence)
        return gn_error_set(out_error, -EDOM,
                            "ENVIRONMENT_FRAME sequence %llu is not above the last one, %llu",
                            (unsigned long long)frame->sequence,
                            (unsigned long long)session->last_environment_sequence);
    bool is_first = session->last_environment_sequence == 0;
    session->last_environment_sequence = frame->sequence;
    if (frame->width > (uint32_t)o->max_environment_width ||
        frame->height > (uint32_t)o->max_environment_height)
        return gn_error_set(out_error, -EINVAL, "environment frame of %ux%u, room %s grants %dx%d",
                            frame->width, frame->height, o->name, o->max_environment_width,
                            o->max_environment_height);
    struct gn_environment_job job = {
        .session_id = session->id, .frame = *frame, .payload = gn_buf_ref(payload)};
    struct gn_probe old;
    gn_mutex_lock(&room->mu);
    room->figures.environment_in++;
    session->figures.environment_in++;
    int rc = gn_probes_put(&room->probes, &job, is_first, &old);
    room->figures.environment_superseded += rc == 1;
    room->figures.environment_refused += rc < 0;
    gn_cond_signal(&room->light_wake);
    gn_mutex_unlock(&room->mu);
    gn_probe_finish(&old);
    if (rc >= 0)
        return 0;
    gn_buf_unref(&job.payload);
    return gn_error_set(out_error, rc,
                        "room %s has its %d probes: frames of another are taken once one has left",
                        o->name, GN_PROBES_MAX);
}

int gn_room_put_emitter(struct gn_room_session *session, const struct gn_msg_emitter_frame *frame,
                        struct gn_buf *payload, struct gn_error *out_error)
{
    struct gn_room *room = session->room;
    if (frame->sequence <= session->last_emitter_sequence)
        return gn_error_set(out_error, -EDOM,
                            "EMITTER_FRAME sequence %llu is not above the last one, %llu",
                            (unsigned long long)frame->sequence,
                            (unsigned long long)session->last_emitter_sequence);
    session->last_emitter_sequence = frame->sequence;
    int stream =
        gn_screens_find(&room->screens, frame->stream, out_error); // names stay as they are
    struct gn_buf *superseded = NULL;
    gn_mutex_lock(&room->mu);
    room->figures.emitter_in++;
    if (stream >= 0) {
        const struct gn_emitter_job job = {.session_id = session->id,
                                           .stream = stream,
                                           .frame = *frame,
                                           .payload = gn_buf_ref(payload)};
        gn_screens_put(&room->screens, &job, &superseded);
        room->figures.emitter_superseded += superseded != NULL;
        gn_cond_signal(&room->light_wake);
    } else {
        room->figures.emitter_refused++;
    }
    gn_mutex_unlock(&room->mu);
    gn_buf_unref(&superseded);
    return stream < 0 ? stream : 0;
}
