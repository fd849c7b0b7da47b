/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_view/viewer.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/view/overlay.h"
#include "common/clock.h"
#include "common/text.h"
#include "proto/attr.h"

/** How long a frame's answer is waited for; of reference quality, which takes minutes. */
#define ANSWER_NS (60 * GN_NS_PER_S)
#define REFERENCE_ANSWER_NS (3600 * GN_NS_PER_S)
/** A window that has had no answer for so long says so. */
#define SILENCE_NS (2 * GN_NS_PER_S)
/** It says why frames are dropped after so many in a row. */
#define DROPPED_MIN 4

int gn_viewer_send_camera(struct gn_viewer *v, struct gn_error *out_error)
{
    const struct gn_camera *c = &v->camera;
    struct gn_msg_camera message = {
        .width = (uint32_t)c->width,
        .height = (uint32_t)c->height,
        .fx = c->fx,
        .fy = c->fy,
        .cx = c->cx,
        .cy = c->cy,
        .k1 = c->distortion[0],
        .k2 = c->distortion[1],
        .p1 = c->distortion[2],
        .p2 = c->distortion[3],
        .k3 = c->distortion[4],
        .has_response = true,
        .scale = c->response.scale,
        .blur_px = c->match.blur_px,
    };
    memcpy(message.noise_slope, c->match.noise_slope, sizeof(message.noise_slope));
    memcpy(message.noise_offset, c->match.noise_offset, sizeof(message.noise_offset));
    gn_cmd_make_response(&c->response, &message.response);
    memcpy(message.matrix_to_rec709, c->response.to_rec709, sizeof(c->response.to_rec709));
    int err = gn_client_send_camera(v->feed.client, &message);
    return err ? gn_cmd_set_fault(v->feed.client, err, out_error) : 0;
}

static struct gn_viewer_pending *find_pending(struct gn_viewer *v, uint64_t id)
{
    for (int i = 0; i < GN_VIEWER_MAX_OUTSTANDING; i++) {
        if (v->pending[i].id == id)
            return &v->pending[i];
    }
    return NULL;
}

struct gn_viewer_pending *gn_viewer_get_free(struct gn_viewer *v)
{
    return find_pending(v, 0);
}

/** One line a frame, where files are written; else they would only scroll by. */
static void print_result(const struct gn_viewer *v, const struct gn_msg_result *result,
                         const char *name, double latency_ms)
{
    const struct gn_msg_receipt *r = &result->receipt;
    char text[256];
    if (!v->record)
        return;
    printf("frame %llu: %s, %.1f ms, %u lights, light %llu", (unsigned long long)result->id, name,
           latency_ms, r->lights_used, (unsigned long long)r->lighting_sequence);
    if (gn_overlay_print_refined(r, text, sizeof(text)) > 0)
        printf(", refined %s", text);
    if (gn_overlay_print_budget(r, text, sizeof(text)) > 0)
        printf(", budget %s", text);
    printf("\n");
}

static int take_result(struct gn_viewer *v, const struct gn_viewer_pending *p,
                       const struct gn_client_event *event, struct gn_error *out_error)
{
    const struct gn_msg_result *result = &event->message.result;
    double latency_ms = (double)(event->received_ns - p->sent_ns) * 1e-6;
    int err = v->record ? gn_record_add_result(v->record, p->name, result, event->payload,
                                               latency_ms, out_error)
                        : 0;
    v->n_results++;
    v->n_wanting += p->wants_virtual;
    v->n_empty += p->wants_virtual && result->receipt.has_virtual_pixels &&
                  result->receipt.virtual_pixels == 0;
    v->n_dropped_since = 0;
    v->latency_sum_ms += latency_ms;
    v->latency_max_ms = fmax(v->latency_max_ms, latency_ms);
    print_result(v, result, p->name, latency_ms);
    if (v->show)
        gn_show_take_result(v->show, result, event->payload, latency_ms);
    return err;
}

static int take_dropped(struct gn_viewer *v, const struct gn_viewer_pending *p,
                        const struct gn_msg_dropped *d, struct gn_error *out_error)
{
    int err = v->record ? gn_record_add_dropped(v->record, p->name, d, out_error) : 0;
    v->n_dropped++;
    v->n_dropped_since++;
    snprintf(v->last_drop, sizeof(v->last_drop), "%s",
             d->sentence[0] ? d->sentence : gn_wire_get_drop_text(d->reason));
    gn_text_clean(v->last_drop);
    v->is_unlit = d->reason == GN_MSG_DROP_REASON_NO_LIGHTING;
    if (v->record)
        printf("frame %llu: %s, dropped: %s\n", (unsigned long long)p->id, p->name, v->last_drop);
    if (v->show)
        gn_show_take_dropped(v->show, v->last_drop);
    return err;
}

/** Takes what the server says about one frame. */
static int take_answer(struct gn_viewer *v, const struct gn_client_event *event,
                       struct gn_error *out_error)
{
    bool is_result = event->type == GN_WIRE_RESULT;
    uint64_t id = is_result ? event->message.result.id : event->message.dropped.id;
    struct gn_viewer_pending *p = id ? find_pending(v, id) : NULL;
    if (!p)
        return gn_error_set(out_error, -EPROTO, "frame %llu came back though it was not out",
                            (unsigned long long)id);
    int err = is_result ? take_result(v, p, event, out_error)
                        : take_dropped(v, p, &event->message.dropped, out_error);
    fflush(stdout);
    p->id = 0;
    v->n_outstanding--;
    return err;
}

/** Refuses to wait any longer for a frame that is out. */
static int check_answers(const struct gn_viewer *v, struct gn_error *out_error)
{
    int64_t now_ns = gn_client_now_ns();
    int64_t limit_ns =
        v->frame.quality == GN_MSG_QUALITY_REFERENCE ? REFERENCE_ANSWER_NS : ANSWER_NS;
    for (int i = 0; i < GN_VIEWER_MAX_OUTSTANDING; i++) {
        const struct gn_viewer_pending *p = &v->pending[i];
        if (p->id && now_ns - p->sent_ns > limit_ns)
            return gn_error_set(out_error, -ETIMEDOUT, "frame %llu (%s) was not answered in %d s",
                                (unsigned long long)p->id, p->name, (int)(limit_ns / GN_NS_PER_S));
    }
    return 0;
}

/** Whatever is worth a sentence at the window though the connection stands. */
static void show_trouble(struct gn_viewer *v)
{
    int64_t longest_ns = 0, now_ns = gn_client_now_ns();
    bool waits_light = false;
    char text[320] = "";
    for (int i = 0; i < GN_VIEWER_MAX_OUTSTANDING; i++) {
        const struct gn_viewer_pending *p = &v->pending[i];
        if (p->id && now_ns - p->sent_ns > longest_ns) {
            longest_ns = now_ns - p->sent_ns;
            waits_light = p->waits_light;
        }
    }
    if (longest_ns > SILENCE_NS)
        snprintf(text, sizeof(text), "no answer for %d s%s", (int)(longest_ns / GN_NS_PER_S),
                 waits_light ? "; is a gnomon probe running?" : "");
    else if (v->n_dropped_since >= DROPPED_MIN)
        snprintf(text, sizeof(text), "no picture: %s", v->last_drop);
    else if (v->poses && gn_poses_get_doubt(v->poses))
        snprintf(text, sizeof(text), "%s", gn_poses_get_doubt(v->poses));
    gn_show_set_state(v->show, text[0] ? GN_SHOW_TROUBLE : GN_SHOW_LIVE, text);
}

bool gn_viewer_pump(struct gn_viewer *v)
{
    struct gn_source_counts source;
    gn_source_get_counts(v->feed.source, &source);
    const struct gn_show_counts counts = {.n_sent = v->feed.n_sent,
                                          .n_results = v->n_results,
                                          .n_dropped = v->n_dropped,
                                          .n_lost = v->n_lost,
                                          .source = v->feed.source->is_live ? &source : NULL};
    gn_show_put_counts(v->show, &counts);
    v->is_closed = !gn_show_pump(v->show);
    return !v->is_closed;
}

/** One event, or none within the time. Returns whether there was one, or a negative errno and a
 * sentence; *out_is_lost: the connection is of no more use. */
static int take_event(struct gn_viewer *v, int timeout_ms, bool *out_is_lost,
                      struct gn_error *out_error)
{
    struct gn_client_event event;
    int err = 0, got = gn_client_poll(v->feed.client, timeout_ms, &event);
    *out_is_lost = got < 0;
    if (got < 0)
        return gn_cmd_set_fault(v->feed.client, got, out_error);
    if (got == 0) {
        err = gn_feed_keep_clock(&v->feed, out_error);
        *out_is_lost = err != 0;
    } else if (event.type == GN_WIRE_RESULT || event.type == GN_WIRE_DROPPED) {
        err = take_answer(v, &event, out_error);
    } else if (event.type == GN_WIRE_LIGHTING_STATE && v->show) {
        gn_show_take_light(v->show, &event.message.lighting_state, event.payload,
                           event.payload_bytes);
    } else {
        err = gn_cmd_take_event(&event, out_error);
        *out_is_lost = event.type == GN_WIRE_BYE;
    }
    if (!err) {
        err = check_answers(v, out_error);
        *out_is_lost = err != 0;
    }
    return err ? err : got;
}

int gn_viewer_serve(struct gn_viewer *v, int64_t due_ns, int max_left, struct gn_error *out_error)
{
    for (;;) {
        if (gn_cmd_is_interrupted() || (v->show && !gn_viewer_pump(v)))
            return -EINTR;
        int timeout_ms = gn_feed_get_timeout_ms(due_ns);
        bool is_due = timeout_ms == 0, is_lost;
        if (is_due && v->n_outstanding > max_left)
            timeout_ms = 200;
        if (v->show && timeout_ms > GN_SHOW_TICK_MS)
            timeout_ms = GN_SHOW_TICK_MS;
        int got = take_event(v, timeout_ms, &is_lost, out_error);
        if (got < 0 && is_lost)
            got = gn_viewer_reconnect(v, got, out_error);
        else if (v->show)
            show_trouble(v);
        if (got < 0 || (is_due && got == 0 && v->n_outstanding <= max_left))
            return got;
    }
}
