/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A picture and where its camera was, on their way as one frame.
 */
#include <errno.h>
#include <stdio.h>

#include "client/cmd_view/viewer.h"
#include "common/clock.h"

/** How long a frame may wait for light, ms. */
#define LIGHT_WAIT_MS 5000
/** Where the camera is said to be where nobody knows: it looks up and sees nothing of any scene. */
static const struct gn_pose nowhere = {{1, 0, 0, 0}, {0, 0, 1e5}};

/** What light the frame waits for: that of its number, or, before the first result, any. */
static void set_light_wanted(struct gn_viewer *v, struct gn_msg_frame *frame)
{
    int64_t now_ns = gn_client_now_ns();
    if (v->feed.n_sent == 0)
        v->first_sent_ns = now_ns;
    int64_t left_ms = LIGHT_WAIT_MS - (now_ns - v->first_sent_ns) / GN_NS_PER_MS;
    if (v->sync_light) {
        frame->lighting_min_sequence = v->sync_light + (uint64_t)v->feed.n_sent;
        frame->lighting_wait_ms = LIGHT_WAIT_MS;
    } else if (v->n_results == 0 && left_ms > 0) {
        frame->lighting_wait_ms = (uint32_t)left_ms;
    }
}

/**
 * Says where the camera was when it took the picture: by the markers in it, by the source, or where
 * camera.json has it at rest. Without the world's markers the frame goes all the same, and comes
 * back as it is.
 */
static int place_frame(struct gn_viewer *v, const struct gn_capture *capture,
                       struct gn_msg_frame *frame, struct gn_error *out_error)
{
    struct gn_pose pose =
        capture->has_pose ? capture->world_from_camera : v->camera.world_from_camera;
    int n_seen = v->poses ? gn_poses_take(v->poses, capture, out_error) : 0;
    if (n_seen < 0)
        return n_seen;
    if (v->show)
        gn_show_set_wishes(v->show, frame);
    if (v->poses && !gn_poses_get_camera(v->poses, &pose)) {
        pose = nowhere;
        frame->no_virtual = frame->no_shadow = true;
        v->n_unplaced++;
    }
    if (v->show)
        gn_show_put_pose(v->show, &pose);
    gn_cmd_make_transform(&pose, &frame->views[0].world_from_camera);
    return 0;
}

int gn_viewer_send(struct gn_feed *r, const struct gn_capture *capture, struct gn_error *out_error)
{
    struct gn_viewer *v = (struct gn_viewer *)r;
    int err = gn_viewer_serve(v, gn_feed_get_due_ns(r, capture), v->max_outstanding - 1, out_error);
    if (err)
        return err;
    bool is_jpeg = capture->format == GN_CAPTURE_JPEG;
    if (!is_jpeg && capture->format != GN_CAPTURE_RGB8)
        return gn_error_set(out_error, -EINVAL,
                            "%s is no 8-bit picture; camera frames are 8-bit PNG or JPEG",
                            capture->name);
    if (capture->width != v->camera.width || capture->height != v->camera.height)
        return gn_error_set(out_error, -EINVAL,
                            "%s is %dx%d, but the camera was calibrated at %dx%d", capture->name,
                            capture->width, capture->height, v->camera.width, v->camera.height);
    struct gn_viewer_pending *p = gn_viewer_get_free(v);
    struct gn_msg_frame frame = v->frame;
    frame.id = (uint64_t)r->n_sent + 1;
    frame.capture_time_ns = gn_feed_get_capture_ns(r, capture);
    frame.views_count = 1;
    frame.views[0] = (struct gn_msg_frame_view){
        .has_world_from_camera = true,
        .picture_format = is_jpeg ? GN_MSG_PICTURE_FORMAT_JPEG : GN_MSG_PICTURE_FORMAT_RGB8,
        .payload_length = (uint32_t)capture->data_bytes,
    };
    err = place_frame(v, capture, &frame, out_error);
    if (err)
        return err;
    set_light_wanted(v, &frame);
    *p = (struct gn_viewer_pending){.id = frame.id,
                                    .sent_ns = gn_client_now_ns(),
                                    .wants_virtual = !frame.no_virtual,
                                    .waits_light = frame.lighting_wait_ms > 0};
    snprintf(p->name, sizeof(p->name), "%s", capture->name);
    err = gn_client_send_frame(r->client, &frame, capture->data, capture->data_bytes);
    if (err) {
        bool is_ours = err == -EDOM || err == -EMSGSIZE;
        gn_cmd_set_fault(r->client, err, out_error);
        if (is_ours || !v->show)
            return err;
    }
    r->n_sent++;
    v->n_outstanding++;
    return err ? gn_viewer_reconnect(v, err, out_error) : 0;
}
