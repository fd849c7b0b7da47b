/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* One message of each type with every field set, for tests of the wire and of the connection. */
#ifndef GN_TESTS_UNIT_WIRE_SAMPLES_H
#define GN_TESTS_UNIT_WIRE_SAMPLES_H

#include <math.h>
#include <string.h>

#include "proto/wire.h"

static const struct gn_msg_transform sample_transform = {
    .orientation = {0.5, -0.5, 0.5, -0.5},
    .position_m = {-1e6, 1e-300, 0.25},
};

static inline void sample_session(enum gn_wire_type type, union gn_wire_message *m)
{
    if (type == GN_WIRE_HELLO) {
        m->hello = (struct gn_msg_hello){
            .version_min = 1,
            .version_max = UINT32_MAX,
            .capabilities = UINT64_MAX,
            .role = GN_MSG_ROLE_TRACKER,
            .resume_token = {2, {0, 255}},
            .ticket = {64, {1}},
            .want_lighting_states = true,
            .want_lighting_maps = true,
            .want_statistics = true,
        };
        memset(m->hello.client_name, 'n', sizeof(m->hello.client_name) - 1);
        memset(m->hello.token, '~', sizeof(m->hello.token) - 1);
        strcpy(m->hello.client_version, "1.2");
        strcpy(m->hello.room, "Labor \xc3\xbc");
    } else if (type == GN_WIRE_WELCOME) {
        m->welcome = (struct gn_msg_welcome){
            1,    UINT64_MAX, {32, {7}}, "gnomond", "0.1.0", 5,     4,
            8192, 4096,       2048,      1024,      59.5f,   15000, "lab",
        };
    } else if (type == GN_WIRE_REDIRECT) {
        m->redirect = (struct gn_msg_redirect){"host.example", 65535, {1, {9}}};
    } else if (type == GN_WIRE_ERROR) {
        m->error = (struct gn_msg_error){
            GN_MSG_ERROR_CODE_INTERNAL, "what, where, why", 19, UINT64_MAX, true, 1, 2};
    } else if (type == GN_WIRE_BYE) {
        m->bye = (struct gn_msg_bye){GN_MSG_BYE_REASON_SHUTDOWN, "maintenance"};
    } else if (type == GN_WIRE_PING) {
        m->ping.t1_ns = INT64_MIN;
    } else if (type == GN_WIRE_PONG) {
        m->pong = (struct gn_msg_pong){INT64_MIN, INT64_MAX, -1};
    }
}

static inline void sample_environment(struct gn_msg_environment_frame *m)
{
    *m = (struct gn_msg_environment_frame){
        .sequence = UINT64_MAX,
        .capture_time_ns = INT64_MAX,
        .width = 3,
        .height = 2,
        .pixel_format = GN_MSG_PIXEL_FORMAT_RGB12,
        .has_projection = true,
        .projection = {GN_MSG_PROJECTION_TYPE_KANNALA_BRANDT, 1.5, 1.25, 1, 2, 1.5, 1e-3, -2e-3,
                       3e-3, -4e-3, -0.3, 0.05, -0.01},
        .has_response = true,
        .response = {GN_MSG_RESPONSE_TYPE_TABLE, 2.2, 0.1, 0.2, 0.3, 5},
        .matrix_to_rec709 = {1, 2, 3, 4, 5, 6, 7, 8, 9},
        .scale = 1e12,
        .exposure_s = 1e-300,
        .has_world_from_probe = true,
        .world_from_probe = sample_transform,
    };
}

static inline void sample_result(struct gn_msg_result *m)
{
    *m = (struct gn_msg_result){
        .id = 7,
        .capture_time_ns = -7,
        .views_count = 2,
        .views = {{GN_MSG_PICTURE_FORMAT_RGB8, 2, 1, 4, 6},
                  {GN_MSG_PICTURE_FORMAT_JPEG, 9, 8, 0, 4}},
        .has_receipt = true,
        .receipt =
            {1,
             2,
             3,
             4,
             5,
             6,
             7,
             8,
             9,
             -10,
             11,
             12,
             13,
             UINT64_MAX,
             -1,
             GN_MSG_QUALITY_REFERENCE,
             16,
             {{"", ""}},
             true,
             {16, 15, GN_MSG_BUDGET_VERDICT_TOO_SMALL, -1, -1, 4096, 4, 4, UINT64_MAX, UINT64_MAX}},
    };
    for (size_t i = 0; i < 16; i++) {
        memset(m->receipt.left_out[i].pass, 'p', sizeof(m->receipt.left_out[i].pass) - 1);
        memset(m->receipt.left_out[i].why, 'w', sizeof(m->receipt.left_out[i].why) - 1);
    }
}

/** Fill *m with a valid message of that type, zero around it. Returns the payload's length that
 * goes with it. */
static inline uint32_t sample_message(enum gn_wire_type type, union gn_wire_message *m)
{
    memset(m, 0, sizeof(*m));
    switch (type) {
    case GN_WIRE_ENVIRONMENT_FRAME:
        sample_environment(&m->environment_frame);
        return 5 * 4 + 3 * 2 * 6;
    case GN_WIRE_EMITTER_FRAME:
        m->emitter_frame = (struct gn_msg_emitter_frame){
            .stream = "tv",
            .sequence = UINT64_MAX,
            .capture_time_ns = INT64_MIN,
            .width = 2,
            .height = 1,
            .pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F16,
            .has_response = true,
            .response = {GN_MSG_RESPONSE_TYPE_GAMMA, 2.2, 0.1, 0.2, 0.3, 0},
            .scale = 1e-12};
        return 2 * 6;
    case GN_WIRE_POSE:
        m->pose = (struct gn_msg_pose){"teapot", true, sample_transform, INT64_MIN, 1};
        return 0;
    case GN_WIRE_CAMERA:
        m->camera = (struct gn_msg_camera){.index = 3,
                                           .width = 8192,
                                           .height = 1,
                                           .fx = 600,
                                           .fy = 601.5,
                                           .cx = -5,
                                           .cy = 6,
                                           .k1 = 0.1,
                                           .k2 = -0.2,
                                           .p1 = 0.3,
                                           .p2 = -0.4,
                                           .k3 = 0.5,
                                           .has_response = true,
                                           .response = {GN_MSG_RESPONSE_TYPE_LOG, 1, -2, 3, 4, 0},
                                           .matrix_to_rec709 = {9, 8, 7, 6, 5, 4, 3, 2, 1},
                                           .scale = 1e-300,
                                           .noise_slope = {0, 0.5, 1},
                                           .noise_offset = {1, 1e-9, 0},
                                           .blur_px = 8};
        return 0;
    case GN_WIRE_FRAME:
        m->frame = (struct gn_msg_frame){UINT64_MAX,
                                         INT64_MIN,
                                         4,
                                         {{0}},
                                         GN_MSG_PICTURE_FORMAT_JPEG,
                                         100,
                                         GN_MSG_QUALITY_SEED,
                                         UINT64_MAX,
                                         GN_LIMIT_LIGHTING_WAIT_MS};
        for (uint32_t i = 0; i < 4; i++)
            m->frame.views[i] = (struct gn_msg_frame_view){
                true,    sample_transform,           i, GN_MSG_PICTURE_FORMAT_RGB8, 3 * (3 - i), 3,
                i * 0.5, {i, 8, 7, 6, 5, 4, 3, 2, 1}};
        return 12;
    case GN_WIRE_RESULT:
        sample_result(&m->result);
        return 10;
    case GN_WIRE_DROPPED:
        m->dropped = (struct gn_msg_dropped){9, GN_MSG_DROP_REASON_INTERNAL, "because"};
        return 0;
    case GN_WIRE_LIGHTING_STATE:
        m->lighting_state = (struct gn_msg_lighting_state){
            "lab", "node", 5, 6, {0}, 2, 4, 2, 9, {-1, 0.5f, 2}, true, 2, {0, 1}};
        for (int i = 0; i < 27; i++)
            m->lighting_state.sh[i] = (float)(i - 13);
        return 2 * GN_LIGHT_RECORD_BYTES + 4 * 2 * 6;
    case GN_WIRE_STATISTICS:
        m->statistics = (struct gn_msg_statistics){"lab", 1, 2, 3, 4, 5, 6, 7.5f, 8.5f, -9.5f};
        return 0;
    default:
        sample_session(type, m);
        return 0;
    }
}

#endif
