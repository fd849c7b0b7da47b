/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/frame.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/composite.h"
#include "common/jpeg.h"
#include "common/log.h"
#include "server/room/buf_pool.h"
#include "server/room/pace.h"
#include "server/room/still.h"
#include "server/scene/motion.h"

GN_LOG_TOPIC("room");

/** The buffers of one picture size. */
struct frame_buffers {
    int width, height; // 0: not used yet
    uint64_t used;     // the frame that used it last
    struct gn_layers layers;
    struct gn_image8 background;
    struct gn_image8 composite;
};

struct gn_frame_maker {
    const struct gn_room_options *options;
    struct gn_renderer *renderer;
    struct gn_still *still;
    struct gn_compositor *compositor;
    struct gn_motion *motion;
    struct gn_scene_snapshot *snapshot; // a reference: what the renderer shows; NULL: the scene
    struct gn_jpeg *jpeg;
    struct gn_buf_pool *payloads;
    struct gn_paces paces;
    uint64_t n_frames;
    double after_ms; // that a pixel's compositing and encoding takes, rather more
    struct frame_buffers buffers[GN_FRAME_KEPT_SIZES];
};

static void finish_buffers(struct frame_buffers *b)
{
    gn_layers_finish(&b->layers);
    gn_image8_finish(&b->background);
    gn_image8_finish(&b->composite);
    *b = (struct frame_buffers){0};
}

int gn_frame_maker_create(const struct gn_room_options *options, const struct gn_scene *scene,
                          struct gn_frame_maker **out_maker, struct gn_error *out_error)
{
    *out_maker = NULL;
    struct gn_frame_maker *m = calloc(1, sizeof(*m));
    if (!m)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    m->options = options;
    int rc = gn_renderer_create(scene, options->pool, &m->renderer, out_error);
    if (rc == 0)
        rc = gn_still_create(scene, options->pool, &m->still, out_error);
    if (rc == 0)
        rc = gn_motion_create(scene, &m->motion, out_error);
    if (rc < 0)
        goto out;
    rc = gn_compositor_create(options->pool, &m->compositor);
    if (rc == 0)
        rc = gn_jpeg_create(&m->jpeg);
    if (rc == 0)
        rc = gn_buf_pool_create(&m->payloads);
    if (rc < 0) {
        gn_error_set(out_error, rc, "out of memory");
        goto out;
    }
    *out_maker = m;
    return 0;
out:
    gn_frame_maker_destroy(&m);
    return rc;
}

void gn_frame_maker_cancel(struct gn_frame_maker *maker)
{
    if (!maker)
        return;
    gn_renderer_cancel(maker->renderer);
    gn_still_cancel(maker->still);
}

void gn_frame_maker_destroy(struct gn_frame_maker **maker)
{
    struct gn_frame_maker *m = *maker;
    if (!m)
        return;
    for (int i = 0; i < GN_FRAME_KEPT_SIZES; i++)
        finish_buffers(&m->buffers[i]);
    gn_buf_pool_destroy(&m->payloads);
    gn_jpeg_destroy(&m->jpeg);
    gn_compositor_destroy(&m->compositor);
    gn_still_destroy(&m->still);
    gn_renderer_destroy(&m->renderer);
    gn_scene_snapshot_unref(&m->snapshot);
    gn_motion_destroy(&m->motion);
    free(m);
    *maker = NULL;
}

int gn_frame_maker_pose(struct gn_frame_maker *maker, const struct gn_pose *poses,
                        struct gn_error *out_error)
{
    struct gn_scene_snapshot *snapshot = NULL;
    int rc = gn_motion_make_snapshot(maker->motion, poses, &snapshot, out_error);
    if (rc < 0)
        return rc;
    gn_renderer_set_scene(maker->renderer, gn_scene_snapshot_get(snapshot));
    gn_still_set_scene(maker->still, gn_scene_snapshot_get(snapshot));
    gn_scene_snapshot_unref(&maker->snapshot);
    maker->snapshot = snapshot;
    return 0;
}

/** The buffers of that size; those that rested longest are given up for a new size. */
static int get_buffers(struct gn_frame_maker *m, int width, int height,
                       struct frame_buffers **out_buffers)
{
    struct frame_buffers *b = &m->buffers[0];
    for (int i = 0; i < GN_FRAME_KEPT_SIZES; i++) {
        struct frame_buffers *each = &m->buffers[i];
        if (each->width == width && each->height == height) {
            each->used = m->n_frames;
            *out_buffers = each;
            return 0;
        }
        if (each->used < b->used)
            b = each;
    }
    finish_buffers(b);
    int rc = gn_layers_init(&b->layers, width, height);
    if (rc == 0)
        rc = gn_image8_init(&b->background, width, height, 3);
    if (rc == 0)
        rc = gn_image8_init(&b->composite, width, height, 3);
    if (rc < 0) {
        finish_buffers(b);
        return rc;
    }
    b->width = width;
    b->height = height;
    b->used = m->n_frames;
    *out_buffers = b;
    return 0;
}

/** Milliseconds since *at, which moves on to now. */
static double lap(int64_t *at)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    double ms = (double)(now_ns - *at) * 1e-6;
    *at = now_ns;
    return ms;
}

/** The view's picture to b->background. Returns 0 or a reason and a sentence. */
static enum gn_msg_drop_reason decode_picture(struct gn_frame_maker *m,
                                              const struct gn_frame_job *job, size_t index,
                                              struct frame_buffers *b, struct gn_error *error)
{
    const struct gn_msg_frame_view *view = &job->frame.views[index];
    size_t n = (size_t)b->width * (size_t)b->height * 3;
    switch (view->picture_format) {
    case GN_MSG_PICTURE_FORMAT_NONE:
        memset(b->background.data, 0, n);
        return 0;
    case GN_MSG_PICTURE_FORMAT_RGB8:
        memcpy(b->background.data, job->payload->data + view->payload_offset, n);
        return 0;
    case GN_MSG_PICTURE_FORMAT_JPEG: {
        struct gn_error why = {0};
        int rc = gn_jpeg_decode(m->jpeg, job->payload->data + view->payload_offset,
                                view->payload_length, &b->background, &why);
        if (rc == 0)
            return 0;
        gn_error_set(error, rc, "view %zu: %s", index, why.text);
        return rc == -ENOMEM ? GN_MSG_DROP_REASON_INTERNAL : GN_MSG_DROP_REASON_BAD_PICTURE;
    }
    default:
        gn_error_set(error, 0, "view %zu: picture format %d is none", index,
                     (int)view->picture_format);
        return GN_MSG_DROP_REASON_BAD_FRAME;
    }
}

/** Adds one view's report to the frame's receipt: times and rays are sums over the views. */
static void add_report(struct gn_msg_receipt *receipt, const struct gn_render_report *report)
{
    receipt->plan_ms += (float)report->ms_plan;
    receipt->primary_ms += (float)report->ms_primary;
    receipt->shade_ms += (float)report->ms_shade;
    receipt->shadow_ms += (float)report->ms_shadow;
    receipt->rays_primary += report->rays_primary;
    receipt->rays_shadow += report->rays_shadow + report->rays_shade;
    receipt->rays_secondary += report->rays_mirror;
    receipt->lights_used = (uint32_t)report->n_lights;
    for (int i = 0; i < report->n_plan; i++) {
        const struct gn_plan_entry *entry = &report->plan[i];
        bool is_known = entry->ran;
        for (size_t k = 0; k < receipt->left_out_count && !is_known; k++)
            is_known = strcmp(receipt->left_out[k].pass, entry->pass) == 0 &&
                       strncmp(receipt->left_out[k].why, entry->why,
                               sizeof(receipt->left_out[k].why) - 1) == 0;
        if (is_known || receipt->left_out_count == GN_ARRAY_LEN(receipt->left_out))
            continue;
        struct gn_msg_left_out *out = &receipt->left_out[receipt->left_out_count++];
        gn_wire_set_string(out->pass, sizeof(out->pass), entry->pass);
        gn_wire_set_string(out->why, sizeof(out->why), entry->why);
    }
}

/** Everything of one frame that its steps share. */
struct work {
    struct gn_frame_maker *maker;
    struct gn_frame_job *job;
    struct gn_lighting_state *light;
    struct gn_msg_result *result;      // being filled, in the job's answer's place
    struct gn_buf *payload;            // being filled
    size_t used;                       // bytes of it
    int64_t start_ns;                  // when the frame's work began
    struct gn_pace_turn turn;          // of the viewer
    bool is_refined;                   // a view of it
    const struct gn_image8 *composite; // of the view made last
};

static void tell_step(void *context, const struct gn_render_report *report)
{
    add_report(context, report);
}

/** The layers of a view that has held still since its last frame. False: it has not, or this
 * failed. Else what is to be told of the frame, *out_why, and the slot that wants to know of it. */
static bool refine_view(struct work *w, const struct gn_still_view *view, int *out_place,
                        const char **out_why, const struct gn_layers **out_layers)
{
    static struct gn_log_limiter limiter = {.burst = 5, .interval_ns = 10 * GN_NS_PER_S};
    struct gn_still *still = w->maker->still;
    struct gn_msg_receipt *receipt = &w->result->receipt;
    struct gn_still_picture picture;
    struct gn_error error = {0};
    *out_place = -1;
    *out_why = w->maker->options->no_refining ? "switched off for the room"
                                              : gn_still_look(still, view, out_place);
    if (*out_why)
        return false;
    if (gn_still_refine(still, *out_place, tell_step, receipt, &picture, &error) < 0) {
        gn_log_limited(&limiter, GN_LOG_WARN, "a still view is not refined: %s", error.text);
        *out_why = "refining failed";
        return false;
    }
    *out_layers = picture.layers;
    w->is_refined = true;
    receipt->refined_passes = (uint32_t)picture.figures.n_passes;
    if (picture.figures.error >= 0) {
        receipt->refined_error = fmaxf(receipt->refined_error, (float)picture.figures.error);
        receipt->estimated_error =
            fmaxf(receipt->estimated_error, (float)picture.figures.error_shadow);
    }
    return true;
}

/** An even share for a view in what is left of the frame's budget; INFINITY: it has none. */
static double get_left_ms(const struct work *w, size_t index, int64_t now_ns)
{
    double pixels = 0;
    size_t n_views = w->job->frame.views_count;
    if (!(w->turn.budget_ms > 0))
        return INFINITY;
    for (size_t i = index; i < n_views; i++)
        pixels += (double)w->job->cameras[i].width * w->job->cameras[i].height;
    return (w->turn.budget_ms - gn_clock_get_ms_between(w->start_ns, now_ns) -
            w->maker->after_ms * pixels) /
           (double)(n_views - index);
}

/** The layers of a view, refined or rendered into b->layers. */
static int make_layers(struct work *w, size_t index, const struct gn_render_options *options,
                       struct frame_buffers *b, const struct gn_layers **out_layers,
                       struct gn_error *error)
{
    struct gn_frame_maker *m = w->maker;
    const struct gn_camera *camera = &w->job->cameras[index];
    int64_t now_ns = gn_clock_get_monotonic_ns();
    const struct gn_still_view view = {
        .session_id = w->job->answer->session_id,
        .index = index,
        .camera = camera,
        .light = w->light,
        .options = options,
        .now_ns = now_ns,
        .left_ms = get_left_ms(w, index, now_ns),
    };
    struct gn_render_report report = {0};
    int place;
    const char *why;
    if (refine_view(w, &view, &place, &why, out_layers))
        return 0;
    int rc = gn_renderer_render(m->renderer, camera, w->light, options, &b->layers, &report, error);
    if (rc < 0)
        return rc;
    gn_still_note(m->still, place, &report);
    gn_pace_put_report(&w->turn, (int)index, &report);
    gn_progressive_add_plan(&report, false, why);
    add_report(&w->result->receipt, &report);
    *out_layers = &b->layers;
    return 0;
}

/** Makes a view's layers and puts them over b->background, into b->composite. */
static int draw_view(struct work *w, size_t index, struct frame_buffers *b, struct gn_error *error)
{
    struct gn_frame_maker *m = w->maker;
    const struct gn_camera *camera = &w->job->cameras[index];
    struct gn_render_options options = m->options->render;
    options.quality = (enum gn_quality)w->job->frame.quality;
    options.seed = w->job->frame.id;
    options.no_virtual |= w->job->frame.no_virtual;
    options.no_shadow |= w->job->frame.no_shadow;
    gn_pace_set_options(&w->turn, &options);
    const struct gn_layers *made;
    int rc = make_layers(w, index, &options, b, &made, error);
    if (rc < 0)
        return rc;
    const struct gn_composite_layers layers = {&made->virtual_rgba, &made->shadow, &made->added};
    const struct gn_composite_options look = {
        .encoded_multiply = m->options->encoded_multiply || options.quality == GN_QUALITY_SEED,
        .match = camera->match,
        .frame = w->job->frame.id * GN_LIMIT_VIEWS + index,
    };
    int64_t at = gn_clock_get_monotonic_ns();
    rc = gn_compositor_put_image8(m->compositor, &layers, &b->background, &camera->response, &look,
                                  &b->composite);
    w->result->receipt.composite_ms += (float)lap(&at);
    if (rc == -ENOMEM)
        return gn_error_set(error, rc, "out of memory for the composite");
    if (rc < 0)
        return gn_error_set(error, rc, "the layers do not fit the picture");
    w->result->receipt.virtual_pixels += gn_compositor_get_n_covered(m->compositor);
    return 0;
}

/** One view from picture to its place in the payload. */
static enum gn_msg_drop_reason make_view(struct work *w, size_t index, struct gn_error *error)
{
    struct gn_frame_maker *m = w->maker;
    const struct gn_camera *camera = &w->job->cameras[index];
    struct frame_buffers *b;
    if (get_buffers(m, camera->width, camera->height, &b) < 0) {
        gn_error_set(error, -ENOMEM, "out of memory for %dx%d", camera->width, camera->height);
        return GN_MSG_DROP_REASON_INTERNAL;
    }
    int64_t at = gn_clock_get_monotonic_ns();
    enum gn_msg_drop_reason reason = decode_picture(m, w->job, index, b, error);
    w->result->receipt.decode_ms += (float)lap(&at);
    if (reason != 0)
        return reason;

    if (draw_view(w, index, b, error) < 0)
        return GN_MSG_DROP_REASON_INTERNAL;

    uint8_t *out = w->payload->data + w->used;
    size_t room = w->payload->len - w->used, n = 0;
    bool is_jpeg = w->job->frame.result_format == GN_MSG_PICTURE_FORMAT_JPEG;
    at = gn_clock_get_monotonic_ns();
    if (is_jpeg) {
        const struct gn_jpeg_options options = {.quality = (int)w->job->frame.jpeg_quality};
        if (gn_jpeg_encode(m->jpeg, &b->composite, &options, out, room, &n, error) < 0)
            return GN_MSG_DROP_REASON_INTERNAL;
    } else {
        n = (size_t)b->width * (size_t)b->height * 3;
        assert(n <= room);
        memcpy(out, b->composite.data, n);
    }
    w->result->receipt.encode_ms += (float)lap(&at);
    w->result->views[index] = (struct gn_msg_result_view){
        .format = is_jpeg ? GN_MSG_PICTURE_FORMAT_JPEG : GN_MSG_PICTURE_FORMAT_RGB8,
        .width = (uint32_t)b->width,
        .height = (uint32_t)b->height,
        .payload_offset = (uint32_t)w->used,
        .payload_length = (uint32_t)n,
    };
    w->used += n;
    w->composite = &b->composite;
    return 0;
}

/** Most bytes that the result's pictures can take. */
static size_t get_payload_bound(const struct gn_frame_job *job)
{
    size_t n = 0;
    for (size_t i = 0; i < job->frame.views_count; i++) {
        const struct gn_camera *c = &job->cameras[i];
        n += job->frame.result_format == GN_MSG_PICTURE_FORMAT_JPEG
                 ? gn_jpeg_get_bound(c->width, c->height)
                 : (size_t)c->width * (size_t)c->height * 3;
    }
    return n;
}

static enum gn_msg_drop_reason make_views(struct work *w, struct gn_error *error)
{
    for (size_t i = 0; i < w->job->frame.views_count; i++) {
        enum gn_msg_drop_reason reason = make_view(w, i, error);
        if (reason != 0)
            return reason;
    }
    if (w->used > GN_LIMIT_RESULT_BYTES) {
        gn_error_set(error, 0, "the result has %zu bytes, a message holds %u: lower jpeg_quality",
                     w->used, GN_LIMIT_RESULT_BYTES);
        return GN_MSG_DROP_REASON_UNSUPPORTED;
    }
    w->payload->len = w->used;
    return 0;
}

static void start_receipt(struct gn_msg_receipt *receipt, const struct gn_frame_job *job,
                          const struct gn_lighting_state *light, int64_t now_ns)
{
    receipt->queue_ms = (float)gn_clock_get_ms_between(job->received_ns, now_ns);
    receipt->lighting_sequence = light->sequence;
    receipt->lighting_age_ms =
        (float)gn_clock_get_ms_between(light->capture_time_ns, job->frame.capture_time_ns);
    receipt->estimated_error = -1;
    receipt->refined_error = -1;
    receipt->has_virtual_pixels = true;
    receipt->quality = job->frame.quality;
}

void gn_frame_maker_make(struct gn_frame_maker *maker, struct gn_frame_job *job,
                         struct gn_lighting_state *light, struct gn_frame_outcome *out_outcome)
{
    int64_t start_ns = gn_clock_get_monotonic_ns();
    *out_outcome = (struct gn_frame_outcome){0};
    maker->n_frames++;
    struct gn_note *answer = job->answer;
    struct work w = {.maker = maker,
                     .job = job,
                     .light = light,
                     .result = &answer->body.result,
                     .start_ns = start_ns};
    if (gn_buf_pool_get(maker->payloads, get_payload_bound(job), &w.payload) < 0) {
        out_outcome->reason = GN_MSG_DROP_REASON_INTERNAL;
        gn_error_set(&out_outcome->error, -ENOMEM, "out of memory for the result");
        return;
    }
    memset(&answer->body, 0, sizeof(answer->body));
    start_receipt(&w.result->receipt, job, light, start_ns);
    gn_pace_begin(&maker->paces, maker->options, job, light, &w.turn);
    out_outcome->wanted_lights = gn_paces_get_wanted(&maker->paces);
    out_outcome->reason = make_views(&w, &out_outcome->error);
    if (out_outcome->reason != 0) {
        gn_buf_unref(&w.payload);
        return;
    }
    w.result->id = job->frame.id;
    w.result->capture_time_ns = job->frame.capture_time_ns;
    w.result->views_count = job->frame.views_count;
    w.result->has_receipt = true;
    answer->type = GN_WIRE_RESULT;
    answer->payload = w.payload;

    double pixels = 0;
    for (size_t i = 0; i < job->frame.views_count; i++)
        pixels += (double)job->cameras[i].width * job->cameras[i].height;
    const struct gn_msg_receipt *receipt = &w.result->receipt;
    double after_ms = (double)(receipt->composite_ms + receipt->encode_ms) / pixels;
    maker->after_ms = fmax(after_ms, 0.9 * maker->after_ms + 0.1 * after_ms);
    out_outcome->busy_ms = (double)(gn_clock_get_monotonic_ns() - start_ns) * 1e-6;
    if (!w.is_refined)
        gn_pace_end(&w.turn, job, out_outcome->busy_ms, &w.result->receipt);
    out_outcome->vga_ms = out_outcome->busy_ms * (640.0 * 480.0 / pixels);
    out_outcome->is_refined = w.is_refined;
    out_outcome->composite = w.composite;
}
