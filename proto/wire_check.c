/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What the messages mean: ranges, what needs what, and whether the payload has the length that the
 * header implies. */
#include <math.h>
#include <string.h>

#include "proto/wire_internal.h"

#define PI 3.14159265358979323846
// Beyond these no lens and no sensor is; they keep later arithmetic far from overflow.
#define MAX_COORDINATE_PX 1e6
#define MAX_COEFFICIENT 1e6
#define MAX_SCALE 1e12
// rad: what a float32 of pi has more than pi, and more. Readers cut it off.
#define THETA_SLACK 1e-6

static int check_transform(const struct gn_msg_transform *t, const char *path,
                           struct gn_wire_fault *fault)
{
    double norm2 = 0;
    for (int i = 0; i < 4; i++)
        norm2 += t->orientation[i] * t->orientation[i];
    if (!(fabs(sqrt(norm2) - 1) <= 1e-3))
        return gn_wire_refuse(fault, "%s.orientation: norm %g, a rotation has 1", path,
                              sqrt(norm2));
    for (int i = 0; i < 3; i++)
        if (fabs(t->position_m[i]) > GN_LIMIT_POSITION_M)
            return gn_wire_refuse(fault, "%s.position_m[%d]: %g m, at most 1e6 m", path, i,
                                  t->position_m[i]);
    return 0;
}

static int check_response(const struct gn_msg_response *r, bool may_have_table, const char *path,
                          struct gn_wire_fault *fault)
{
    bool is_table = r->type == GN_MSG_RESPONSE_TYPE_TABLE;
    if (r->type == GN_MSG_RESPONSE_TYPE_GAMMA && !(r->gamma >= 0.1 && r->gamma <= 10))
        return gn_wire_refuse(fault, "%s.gamma: %g, must be in [0.1, 10]", path, r->gamma);
    if (r->type == GN_MSG_RESPONSE_TYPE_LOG && (r->log_b <= 0 || r->log_c < 0))
        return gn_wire_refuse(fault, "%s: log_b %g must be above 0, log_c %g not below", path,
                              r->log_b, r->log_c);
    if (is_table && !may_have_table)
        return gn_wire_refuse(fault, "%s.type: a table is not possible here", path);
    if (is_table && (r->table_entries < 2 || r->table_entries > GN_LIMIT_TABLE_ENTRIES))
        return gn_wire_refuse(fault, "%s.table_entries: %u, must be in [2, %d]", path,
                              r->table_entries, GN_LIMIT_TABLE_ENTRIES);
    if (!is_table && r->table_entries != 0)
        return gn_wire_refuse(fault, "%s.table_entries: %u, but the response is no table", path,
                              r->table_entries);
    return 0;
}

static int check_colour(const double matrix[static 9], double scale, const char *path,
                        struct gn_wire_fault *fault)
{
    for (int i = 0; i < 9; i++)
        if (fabs(matrix[i]) > MAX_COEFFICIENT)
            return gn_wire_refuse(fault, "%s.matrix_to_rec709[%d]: %g, at most 1e6", path, i,
                                  matrix[i]);
    if (scale < 0 || scale > MAX_SCALE)
        return gn_wire_refuse(fault, "%s.scale: %g, must be in [0, 1e12]", path, scale);
    return 0;
}

static int check_side(uint32_t px, const char *path, struct gn_wire_fault *fault)
{
    if (px >= 1 && px <= GN_LIMIT_SIDE_PX)
        return 0;
    return gn_wire_refuse(fault, "%s: %u px, must be in [1, %d]", path, px, GN_LIMIT_SIDE_PX);
}

/** Pictures without a circle. */
static bool has_whole_sphere(gn_msg_projection_type_t type)
{
    return type == GN_MSG_PROJECTION_TYPE_LATLONG || type == GN_MSG_PROJECTION_TYPE_CUBE ||
           type == GN_MSG_PROJECTION_TYPE_OCTAHEDRAL;
}

static int check_projection(const struct gn_msg_projection *p, struct gn_wire_fault *fault)
{
    const char *path = "ENVIRONMENT_FRAME.projection";
    if (fabs(p->center_x_px) > MAX_COORDINATE_PX || fabs(p->center_y_px) > MAX_COORDINATE_PX)
        return gn_wire_refuse(fault, "%s: centre (%g, %g) px, at most 1e6", path, p->center_x_px,
                              p->center_y_px);
    if (p->radius_px < 0 || p->radius_px > MAX_COORDINATE_PX || p->focal_px < 0 ||
        p->focal_px > MAX_COORDINATE_PX)
        return gn_wire_refuse(fault, "%s: radius_px %g, focal_px %g, must be in [0, 1e6]", path,
                              p->radius_px, p->focal_px);
    double max = p->type == GN_MSG_PROJECTION_TYPE_ORTHOGRAPHIC ? PI / 2 : PI;
    if (p->theta_max < 0 || p->theta_max > max + THETA_SLACK)
        return gn_wire_refuse(fault, "%s.theta_max: %g rad, must be in [0, %g]", path, p->theta_max,
                              max);
    bool is_kannala_brandt = p->type == GN_MSG_PROJECTION_TYPE_KANNALA_BRANDT;
    const double k[4] = {p->k1, p->k2, p->k3, p->k4};
    for (int i = 0; i < 4; i++)
        if (fabs(k[i]) > MAX_COEFFICIENT || (k[i] != 0 && !is_kannala_brandt))
            return gn_wire_refuse(fault, "%s.k%d: %g, only for KANNALA_BRANDT and at most 1e6",
                                  path, i + 1, k[i]);
    const double v[3] = {p->vignetting_a, p->vignetting_b, p->vignetting_c};
    for (int i = 0; i < 3; i++)
        if (fabs(v[i]) > MAX_COEFFICIENT || (v[i] != 0 && has_whole_sphere(p->type)))
            return gn_wire_refuse(fault,
                                  "%s.vignetting_%c: %g, only for a circle's projection and at "
                                  "most 1e6",
                                  path, 'a' + i, v[i]);
    return 0;
}

static int check_environment_pixels(const struct gn_msg_environment_frame *m,
                                    uint32_t payload_bytes, struct gn_wire_fault *fault)
{
    uint64_t table = 4 * (uint64_t)m->response.table_entries;
    size_t pixel = gn_wire_get_pixel_bytes(m->pixel_format);
    uint64_t want = table + (uint64_t)m->width * m->height * pixel;
    if (pixel != 0 && payload_bytes != want)
        return gn_wire_refuse(fault,
                              "ENVIRONMENT_FRAME: payload of %u bytes, but %u x %u px of %zu bytes "
                              "and the table make %llu",
                              payload_bytes, m->width, m->height, pixel, (unsigned long long)want);
    if (pixel == 0 && payload_bytes <= table)
        return gn_wire_refuse(fault, "ENVIRONMENT_FRAME: no file in the payload of %u bytes",
                              payload_bytes);
    if (m->pixel_format == GN_MSG_PIXEL_FORMAT_EXR &&
        m->response.type != GN_MSG_RESPONSE_TYPE_LINEAR)
        return gn_wire_refuse(fault, "ENVIRONMENT_FRAME.response: EXR is linear");
    return 0;
}

static int check_environment(const struct gn_msg_environment_frame *m, uint32_t payload_bytes,
                             struct gn_wire_fault *fault)
{
    if (m->sequence == 0)
        return gn_wire_refuse(fault, "ENVIRONMENT_FRAME.sequence: 0, the first is 1");
    int err = check_side(m->width, "ENVIRONMENT_FRAME.width", fault);
    if (!err)
        err = check_side(m->height, "ENVIRONMENT_FRAME.height", fault);
    if (!err && !m->has_projection)
        err = gn_wire_refuse(fault, "ENVIRONMENT_FRAME.projection: missing");
    if (!err)
        err = check_projection(&m->projection, fault);
    if (!err && m->has_response)
        err = check_response(&m->response, true, "ENVIRONMENT_FRAME.response", fault);
    if (!err)
        err = check_colour(m->matrix_to_rec709, m->scale, "ENVIRONMENT_FRAME", fault);
    if (!err && m->exposure_s < 0)
        err = gn_wire_refuse(fault, "ENVIRONMENT_FRAME.exposure_s: %g s, must not be negative",
                             m->exposure_s);
    if (!err && m->has_world_from_probe)
        err = check_transform(&m->world_from_probe, "ENVIRONMENT_FRAME.world_from_probe", fault);
    return err ? err : check_environment_pixels(m, payload_bytes, fault);
}

static int check_emitter(const struct gn_msg_emitter_frame *m, uint32_t payload_bytes,
                         struct gn_wire_fault *fault)
{
    if (!m->stream[0])
        return gn_wire_refuse(fault, "EMITTER_FRAME.stream: missing");
    if (m->sequence == 0)
        return gn_wire_refuse(fault, "EMITTER_FRAME.sequence: 0, the first is 1");
    if (m->width < 1 || m->width > GN_LIMIT_EMITTER_SIDE_PX || m->height < 1 ||
        m->height > GN_LIMIT_EMITTER_SIDE_PX)
        return gn_wire_refuse(fault, "EMITTER_FRAME: %u x %u px, sides must be in [1, %d]",
                              m->width, m->height, GN_LIMIT_EMITTER_SIDE_PX);
    if (m->pixel_format != GN_MSG_PIXEL_FORMAT_RGB8 &&
        m->pixel_format != GN_MSG_PIXEL_FORMAT_JPEG &&
        m->pixel_format != GN_MSG_PIXEL_FORMAT_RGB_F16)
        return gn_wire_refuse(fault,
                              "EMITTER_FRAME.pixel_format: %d, only RGB8, JPEG and RGB_F16 are "
                              "right",
                              (int)m->pixel_format);
    uint64_t want = (uint64_t)m->width * m->height * gn_wire_get_pixel_bytes(m->pixel_format);
    if (want > 0 ? payload_bytes != want : payload_bytes == 0)
        return gn_wire_refuse(fault, "EMITTER_FRAME: payload of %u bytes, %u x %u px need %llu%s",
                              payload_bytes, m->width, m->height, (unsigned long long)want,
                              want > 0 ? "" : " and more: a JPEG file");
    if (m->scale < 0 || m->scale > MAX_SCALE)
        return gn_wire_refuse(fault, "EMITTER_FRAME.scale: %g, must be in [0, 1e12]", m->scale);
    return m->has_response ? check_response(&m->response, false, "EMITTER_FRAME.response", fault)
                           : 0;
}

static int check_pose(const struct gn_msg_pose *m, struct gn_wire_fault *fault)
{
    if (!m->has_world_from_object)
        return gn_wire_refuse(fault, "POSE.world_from_object: missing");
    if (m->confidence < 0 || m->confidence > 1)
        return gn_wire_refuse(fault, "POSE.confidence: %g, must be in [0, 1]",
                              (double)m->confidence);
    return check_transform(&m->world_from_object, "POSE.world_from_object", fault);
}

static int check_camera(const struct gn_msg_camera *m, struct gn_wire_fault *fault)
{
    if (m->index >= GN_LIMIT_VIEWS)
        return gn_wire_refuse(fault, "CAMERA.index: %u, must be in [0, %d]", m->index,
                              GN_LIMIT_VIEWS - 1);
    int err = check_side(m->width, "CAMERA.width", fault);
    if (!err)
        err = check_side(m->height, "CAMERA.height", fault);
    if (err)
        return err;
    if (!(m->fx > 0 && m->fx <= MAX_COORDINATE_PX && m->fy > 0 && m->fy <= MAX_COORDINATE_PX))
        return gn_wire_refuse(fault, "CAMERA: fx %g, fy %g px, must be in (0, 1e6]", m->fx, m->fy);
    if (fabs(m->cx) > MAX_COORDINATE_PX || fabs(m->cy) > MAX_COORDINATE_PX)
        return gn_wire_refuse(fault, "CAMERA: cx %g, cy %g px, at most 1e6", m->cx, m->cy);
    const double k[5] = {m->k1, m->k2, m->p1, m->p2, m->k3};
    for (int i = 0; i < 5; i++)
        if (fabs(k[i]) > MAX_COEFFICIENT)
            return gn_wire_refuse(fault, "CAMERA: distortion coefficient %d is %g, at most 1e6",
                                  i + 1, k[i]);
    for (int i = 0; i < 3; i++)
        if (!(m->noise_slope[i] >= 0 && m->noise_slope[i] <= 1 && m->noise_offset[i] >= 0 &&
              m->noise_offset[i] <= 1))
            return gn_wire_refuse(fault,
                                  "CAMERA: noise_slope %g, noise_offset %g, must be in [0, 1]",
                                  m->noise_slope[i], m->noise_offset[i]);
    if (!(m->blur_px >= 0 && m->blur_px <= GN_LIMIT_BLUR_PX))
        return gn_wire_refuse(fault, "CAMERA.blur_px: %g px, must be in [0, %d]", m->blur_px,
                              GN_LIMIT_BLUR_PX);
    if (m->has_response)
        err = check_response(&m->response, false, "CAMERA.response", fault);
    return err ? err : check_colour(m->matrix_to_rec709, m->scale, "CAMERA", fault);
}

/** One view's range of the payload, and that it does not overlap those before it. */
static int check_range(const char *name, size_t view, bool has_picture, uint32_t (*ranges)[2],
                       uint32_t payload_bytes, struct gn_wire_fault *fault)
{
    uint64_t begin = ranges[view][0], length = ranges[view][1];
    if (has_picture != (length > 0))
        return gn_wire_refuse(fault, "%s.views[%zu]: %llu bytes of payload, but %s picture", name,
                              view, (unsigned long long)length, has_picture ? "there is a" : "no");
    if (begin + length > payload_bytes)
        return gn_wire_refuse(fault, "%s.views[%zu]: ends at byte %llu of a payload of %u", name,
                              view, (unsigned long long)(begin + length), payload_bytes);
    for (size_t i = 0; i < view; i++)
        if (length > 0 && begin < (uint64_t)ranges[i][0] + ranges[i][1] &&
            ranges[i][0] < begin + length)
            return gn_wire_refuse(fault, "%s.views[%zu]: its payload overlaps that of view %zu",
                                  name, view, i);
    return 0;
}

static int check_frame(const struct gn_msg_frame *m, uint32_t payload_bytes,
                       struct gn_wire_fault *fault)
{
    if (m->id == 0)
        return gn_wire_refuse(fault, "FRAME.id: 0, the first is 1");
    if (m->views_count == 0)
        return gn_wire_refuse(fault, "FRAME.views: none, there must be 1 to 4");
    if (m->jpeg_quality > 100)
        return gn_wire_refuse(fault, "FRAME.jpeg_quality: %u, must be in [0, 100]",
                              m->jpeg_quality);
    if (m->lighting_wait_ms > GN_LIMIT_LIGHTING_WAIT_MS)
        return gn_wire_refuse(fault, "FRAME.lighting_wait_ms: %u ms, must be in [0, %d]",
                              m->lighting_wait_ms, GN_LIMIT_LIGHTING_WAIT_MS);
    if (!(m->budget_ms >= 0 && m->budget_ms <= GN_LIMIT_BUDGET_MS))
        return gn_wire_refuse(fault, "FRAME.budget_ms: %g ms, must be in [0, %d]",
                              (double)m->budget_ms, GN_LIMIT_BUDGET_MS);
    uint32_t ranges[GN_LIMIT_VIEWS][2];
    for (size_t i = 0; i < m->views_count; i++) {
        const struct gn_msg_frame_view *v = &m->views[i];
        if (v->camera >= GN_LIMIT_VIEWS)
            return gn_wire_refuse(fault, "FRAME.views[%zu].camera: %u, must be in [0, %d]", i,
                                  v->camera, GN_LIMIT_VIEWS - 1);
        ranges[i][0] = v->payload_offset;
        ranges[i][1] = v->payload_length;
        int err = check_range("FRAME", i, v->picture_format != GN_MSG_PICTURE_FORMAT_NONE, ranges,
                              payload_bytes, fault);
        if (!err && v->has_world_from_camera)
            err = check_transform(&v->world_from_camera, "FRAME.views[].world_from_camera", fault);
        if (!err)
            err = check_colour(v->matrix_to_rec709, v->scale, "FRAME.views[]", fault);
        if (err)
            return err;
    }
    return 0;
}

static int check_receipt(const struct gn_msg_receipt *r, struct gn_wire_fault *fault)
{
    const float ms[] = {r->queue_ms, r->decode_ms, r->plan_ms,      r->primary_ms,
                        r->shade_ms, r->shadow_ms, r->composite_ms, r->encode_ms};
    for (size_t i = 0; i < GN_ARRAY_LEN(ms); i++)
        if (ms[i] < 0)
            return gn_wire_refuse(fault, "RESULT.receipt: a stage time of %g ms", (double)ms[i]);
    if (r->has_budget && !(r->budget.budget_ms > 0 && r->budget.busy_ms >= 0))
        return gn_wire_refuse(fault, "RESULT.receipt.budget: %g ms of %g ms",
                              (double)r->budget.busy_ms, (double)r->budget.budget_ms);
    return 0;
}

static int check_result(const struct gn_msg_result *m, uint32_t payload_bytes,
                        struct gn_wire_fault *fault)
{
    if (m->id == 0)
        return gn_wire_refuse(fault, "RESULT.id: 0, the first is 1");
    uint32_t ranges[GN_LIMIT_VIEWS][2];
    for (size_t i = 0; i < m->views_count; i++) {
        const struct gn_msg_result_view *v = &m->views[i];
        bool has_picture = v->format != GN_MSG_PICTURE_FORMAT_NONE;
        ranges[i][0] = v->payload_offset;
        ranges[i][1] = v->payload_length;
        int err = check_range("RESULT", i, has_picture, ranges, payload_bytes, fault);
        if (!err && has_picture)
            err = check_side(v->width, "RESULT.views[].width", fault);
        if (!err && has_picture)
            err = check_side(v->height, "RESULT.views[].height", fault);
        if (err)
            return err;
        uint64_t want = (uint64_t)v->width * v->height * gn_wire_get_picture_bytes(v->format);
        if (v->format == GN_MSG_PICTURE_FORMAT_RGB8 && v->payload_length != want)
            return gn_wire_refuse(fault, "RESULT.views[%zu]: %u bytes, but %u x %u px make %llu", i,
                                  v->payload_length, v->width, v->height, (unsigned long long)want);
    }
    return m->has_receipt ? check_receipt(&m->receipt, fault) : 0;
}

static int check_lighting(const struct gn_msg_lighting_state *m, uint32_t payload_bytes,
                          struct gn_wire_fault *fault)
{
    if (m->light_count > GN_LIMIT_LIGHTS)
        return gn_wire_refuse(fault, "LIGHTING_STATE.light_count: %u, at most %d", m->light_count,
                              GN_LIMIT_LIGHTS);
    if (m->map_width > GN_LIMIT_MAP_WIDTH_PX || m->map_height > GN_LIMIT_MAP_HEIGHT_PX ||
        (m->map_width == 0) != (m->map_height == 0))
        return gn_wire_refuse(fault, "LIGHTING_STATE: map of %u x %u px, at most %d x %d",
                              m->map_width, m->map_height, GN_LIMIT_MAP_WIDTH_PX,
                              GN_LIMIT_MAP_HEIGHT_PX);
    uint32_t want = m->light_count * GN_LIGHT_RECORD_BYTES + m->map_width * m->map_height * 6;
    if (payload_bytes != want)
        return gn_wire_refuse(fault,
                              "LIGHTING_STATE: payload of %u bytes, but lights and map make %u",
                              payload_bytes, want);
    for (size_t i = 0; i < m->discs_count; i++)
        if (m->discs[i] >= m->light_count || (i > 0 && m->discs[i] <= m->discs[i - 1]))
            return gn_wire_refuse(fault, "LIGHTING_STATE.discs[%zu]: %u, must rise and be below %u",
                                  i, m->discs[i], m->light_count);
    return 0;
}

static int check_hello(const struct gn_msg_hello *m, struct gn_wire_fault *fault)
{
    if (m->version_min == 0 || m->version_max < m->version_min)
        return gn_wire_refuse(fault, "HELLO: versions %u to %u, must be 1 or more and in order",
                              m->version_min, m->version_max);
    return 0;
}

static int check_welcome(const struct gn_msg_welcome *m, struct gn_wire_fault *fault)
{
    if (m->version == 0 || m->session_id == 0 || m->max_frames_outstanding == 0 ||
        m->holdable_fps < 0)
        return gn_wire_refuse(fault, "WELCOME: version, session_id and max_frames_outstanding must "
                                     "be 1 or more, holdable_fps not negative");
    return 0;
}

static int check_redirect(const struct gn_msg_redirect *m, struct gn_wire_fault *fault)
{
    if (m->host[0] == 0 || m->port == 0 || m->port > 65535)
        return gn_wire_refuse(fault, "REDIRECT: host '%.64s' port %u, not a place to connect to",
                              m->host, m->port);
    return 0;
}

static int check_statistics(const struct gn_msg_statistics *m, struct gn_wire_fault *fault)
{
    if (m->median_frame_ms < 0 || m->holdable_fps < 0)
        return gn_wire_refuse(fault,
                              "STATISTICS: median_frame_ms %g and holdable_fps %g must not "
                              "be negative",
                              (double)m->median_frame_ms, (double)m->holdable_fps);
    return 0;
}

int gn_wire_check(uint16_t type, const void *msg, uint32_t payload_bytes,
                  struct gn_wire_fault *fault)
{
    switch ((enum gn_wire_type)type) {
    case GN_WIRE_HELLO:
        return check_hello(msg, fault);
    case GN_WIRE_WELCOME:
        return check_welcome(msg, fault);
    case GN_WIRE_REDIRECT:
        return check_redirect(msg, fault);
    case GN_WIRE_ENVIRONMENT_FRAME:
        return check_environment(msg, payload_bytes, fault);
    case GN_WIRE_EMITTER_FRAME:
        return check_emitter(msg, payload_bytes, fault);
    case GN_WIRE_POSE:
        return check_pose(msg, fault);
    case GN_WIRE_CAMERA:
        return check_camera(msg, fault);
    case GN_WIRE_FRAME:
        return check_frame(msg, payload_bytes, fault);
    case GN_WIRE_RESULT:
        return check_result(msg, payload_bytes, fault);
    case GN_WIRE_DROPPED:
        if (((const struct gn_msg_dropped *)msg)->id == 0)
            return gn_wire_refuse(fault, "DROPPED.id: 0, the first is 1");
        return 0;
    case GN_WIRE_LIGHTING_STATE:
        return check_lighting(msg, payload_bytes, fault);
    case GN_WIRE_STATISTICS:
        return check_statistics(msg, fault);
    case GN_WIRE_ERROR:
    case GN_WIRE_BYE:
    case GN_WIRE_PING:
    case GN_WIRE_PONG:
        return 0; // the walk has seen all there is to see
    }
    return gn_wire_refuse(fault, "no message has type %u", type);
}

static void set_colour_defaults(double matrix[static 9], double *scale)
{
    static const double zero[9] = {0};
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    bool is_zero = true;
    for (int i = 0; i < 9; i++)
        is_zero = is_zero && matrix[i] == zero[i];
    if (is_zero)
        memcpy(matrix, identity, sizeof(identity));
    if (*scale == 0)
        *scale = 1;
}

static double default_theta_max(gn_msg_projection_type_t type)
{
    if (has_whole_sphere(type))
        return 0;
    bool is_ball =
        type == GN_MSG_PROJECTION_TYPE_ANGULAR || type == GN_MSG_PROJECTION_TYPE_MIRROR_BALL;
    return is_ball ? PI : PI / 2;
}

static void set_emitter_defaults(struct gn_msg_emitter_frame *m)
{
    if (!m->has_response && m->pixel_format != GN_MSG_PIXEL_FORMAT_RGB_F16)
        m->response.type = GN_MSG_RESPONSE_TYPE_SRGB;
    m->has_response = true;
    if (m->scale == 0)
        m->scale = 1;
}

static void set_environment_defaults(struct gn_msg_environment_frame *m)
{
    struct gn_msg_projection *p = &m->projection;
    if (p->center_x_px == 0 && p->center_y_px == 0) {
        p->center_x_px = m->width / 2.0;
        p->center_y_px = m->height / 2.0;
    }
    if (p->radius_px == 0 && p->focal_px == 0)
        p->radius_px = (m->width < m->height ? m->width : m->height) / 2.0;
    if (p->theta_max == 0)
        p->theta_max = default_theta_max(p->type);
    m->has_response = true; // all 0 is LINEAR
    set_colour_defaults(m->matrix_to_rec709, &m->scale);
    if (!m->has_world_from_probe)
        m->world_from_probe.orientation[0] = 1;
    m->has_world_from_probe = true;
}

void gn_wire_set_defaults(uint16_t type, void *msg)
{
    if (type == GN_WIRE_EMITTER_FRAME) {
        set_emitter_defaults(msg);
    } else if (type == GN_WIRE_ENVIRONMENT_FRAME) {
        set_environment_defaults(msg);
    } else if (type == GN_WIRE_CAMERA) {
        struct gn_msg_camera *m = msg;
        if (!m->has_response)
            m->response.type = GN_MSG_RESPONSE_TYPE_SRGB;
        m->has_response = true;
        set_colour_defaults(m->matrix_to_rec709, &m->scale);
    } else if (type == GN_WIRE_FRAME) {
        struct gn_msg_frame *m = msg;
        if (m->result_format == GN_MSG_PICTURE_FORMAT_NONE)
            m->result_format = GN_MSG_PICTURE_FORMAT_RGB8;
        if (m->jpeg_quality == 0)
            m->jpeg_quality = GN_JPEG_QUALITY_DEFAULT;
    }
}
