/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

#include <cmocka.h>
#include <errno.h>
#include <pb_common.h>
#include <pb_decode.h>
#include <pb_encode.h>

#include "tests/unit/wire_samples.h"

#define FOR_EACH_TYPE(info)                                                                        \
    for (const struct gn_wire_info *info = gn_wire_get_row(0); info;                               \
         info = gn_wire_get_row((size_t)(++row)))

/** The header of msg as plain protobuf, without any of our checks. */
static size_t encode_unchecked(const struct gn_wire_info *info, const void *msg, uint8_t *buf,
                               size_t cap)
{
    pb_ostream_t stream = pb_ostream_from_buffer(buf, cap);
    assert_true(pb_encode(&stream, info->fields, msg));
    return stream.bytes_written;
}

static void test_round_trip(void **state)
{
    (void)state;
    int row = 0;
    FOR_EACH_TYPE(info)
    {
        union gn_wire_message in, out;
        uint32_t payload = sample_message(info->type, &in);
        uint8_t buf[GN_WIRE_HEAD_BYTES];
        size_t len = 0;
        struct gn_wire_fault fault = {""};
        assert_string_equal(fault.text, "");
        int err = gn_wire_encode(info->type, &in, payload, buf, sizeof(buf), &len, &fault);
        assert_string_equal(fault.text, "");
        assert_int_equal(err, 0);

        struct gn_envelope envelope;
        assert_int_equal(gn_envelope_decode(buf, &envelope), 0);
        assert_int_equal(envelope.version, 1);
        assert_int_equal(envelope.type, info->type);
        assert_int_equal(envelope.header_bytes, len - GN_ENVELOPE_BYTES);
        assert_int_equal(envelope.payload_bytes, payload);

        memset(&out, 0, sizeof(out));
        assert_int_equal(gn_wire_decode(info->type, buf + GN_ENVELOPE_BYTES, envelope.header_bytes,
                                        payload, &out, &fault),
                         0);
        // Every field is set, so that no default is filled in: the same bytes come out again.
        uint8_t again[GN_WIRE_HEAD_BYTES];
        size_t again_len = 0;
        assert_int_equal(
            gn_wire_encode(info->type, &out, payload, again, sizeof(again), &again_len, &fault), 0);
        assert_int_equal(again_len, len);
        assert_memory_equal(again, buf, len);
    }
    assert_int_equal(row, 16);
}

static void test_small_buffer_is_refused(void **state)
{
    (void)state;
    int row = 0;
    FOR_EACH_TYPE(info)
    {
        union gn_wire_message in;
        uint32_t payload = sample_message(info->type, &in);
        uint8_t full[GN_WIRE_HEAD_BYTES];
        size_t len = 0, unused = 12345;
        assert_int_equal(gn_wire_encode(info->type, &in, payload, full, sizeof(full), &len, NULL),
                         0);
        for (size_t cap = 0; cap < len; cap++) {
            uint8_t *exact = malloc(cap ? cap : 1);
            assert_int_equal(gn_wire_encode(info->type, &in, payload, exact, cap, &unused, NULL),
                             -ENOBUFS);
            free(exact);
        }
        assert_int_equal(unused, 12345);
    }
}

/** Whether the first n bytes end between two fields. */
static bool is_field_end(const uint8_t *header, size_t len, size_t n)
{
    pb_istream_t stream = pb_istream_from_buffer(header, len);
    while (len - stream.bytes_left < n) {
        pb_wire_type_t type;
        uint32_t tag;
        bool eof;
        assert_true(pb_decode_tag(&stream, &type, &tag, &eof));
        assert_true(pb_skip_field(&stream, type));
    }
    return len - stream.bytes_left == n;
}

static void test_truncation_at_every_byte(void **state)
{
    (void)state;
    int row = 0;
    FOR_EACH_TYPE(info)
    {
        union gn_wire_message in, out;
        uint32_t payload = sample_message(info->type, &in);
        uint8_t buf[GN_WIRE_HEAD_BYTES];
        size_t len = encode_unchecked(info, &in, buf, sizeof(buf));
        for (size_t n = 0; n < len; n++) {
            uint8_t *exact = malloc(n ? n : 1);
            memcpy(exact, buf, n);
            struct gn_wire_fault fault = {""};
            int err = gn_wire_decode(info->type, exact, n, payload, &out, &fault);
            free(exact);
            if (!is_field_end(buf, len, n))
                assert_int_equal(err, -EBADMSG);
            if (err)
                assert_true(strncmp(fault.text, info->name, strlen(info->name)) == 0);
        }
    }
}

struct poison {
    const struct gn_wire_info *info;
    const void *root;
    size_t root_bytes;
    uint32_t payload;
    double value;
    int visited;
};

static void poison_floats(const pb_msgdesc_t *fields, void *msg, struct poison *p);

static void expect_refused(struct poison *p)
{
    uint8_t buf[GN_WIRE_HEAD_BYTES];
    size_t len;
    struct gn_wire_fault fault = {""};
    assert_int_equal(
        gn_wire_encode(p->info->type, p->root, p->payload, buf, sizeof(buf), &len, &fault), -EDOM);
    len = encode_unchecked(p->info, p->root, buf, sizeof(buf));
    union gn_wire_message out;
    assert_int_equal(gn_wire_decode(p->info->type, buf, len, p->payload, &out, &fault), -EDOM);
    assert_non_null(strstr(fault.text, "not a finite number"));
    p->visited++;
}

static void poison_one(const pb_field_iter_t *it, char *data, struct poison *p)
{
    if (PB_LTYPE(it->type) == PB_LTYPE_SUBMESSAGE) {
        poison_floats(it->submsg_desc, data, p);
    } else if (PB_LTYPE(it->type) == PB_LTYPE_FIXED32) {
        float keep, bad = (float)p->value;
        memcpy(&keep, data, sizeof(keep));
        memcpy(data, &bad, sizeof(bad));
        expect_refused(p);
        memcpy(data, &keep, sizeof(keep));
    } else if (PB_LTYPE(it->type) == PB_LTYPE_FIXED64) {
        double keep;
        memcpy(&keep, data, sizeof(keep));
        memcpy(data, &p->value, sizeof(p->value));
        expect_refused(p);
        memcpy(data, &keep, sizeof(keep));
    }
}

static void poison_floats(const pb_msgdesc_t *fields, void *msg, struct poison *p)
{
    pb_field_iter_t it;
    if (!pb_field_iter_begin(&it, fields, msg))
        return;
    do {
        size_t count = 1;
        if (PB_HTYPE(it.type) == PB_HTYPE_REPEATED)
            count = *(pb_size_t *)it.pSize;
        for (size_t i = 0; i < count; i++)
            poison_one(&it, (char *)it.pData + i * it.data_size, p);
    } while (pb_field_iter_next(&it));
}

static void test_every_float_must_be_finite(void **state)
{
    (void)state;
    const double values[] = {NAN, INFINITY, -INFINITY};
    int visited = 0;
    for (size_t v = 0; v < GN_ARRAY_LEN(values); v++) {
        int row = 0;
        FOR_EACH_TYPE(info)
        {
            union gn_wire_message m;
            struct poison p = {info, &m, sizeof(m), sample_message(info->type, &m), values[v], 0};
            poison_floats(info->fields, &m, &p);
            visited += p.visited;
        }
    }
    // WELCOME 1, ENVIRONMENT_FRAME 34, EMITTER_FRAME 5, POSE 8, CAMERA 30, FRAME 4 x 17 + 1, RESULT
    // 15, LIGHTING 30, STATISTICS 3.
    assert_int_equal(visited, 3 * 195);
}

/** What one change of a sample must lead to, from the encoder and the decoder alike. */
static void expect(enum gn_wire_type type, const union gn_wire_message *m, uint32_t payload,
                   int want, const char *names)
{
    uint8_t buf[GN_WIRE_HEAD_BYTES];
    size_t len;
    struct gn_wire_fault fault = {""};
    assert_int_equal(gn_wire_encode(type, m, payload, buf, sizeof(buf), &len, &fault), want);
    if (want)
        assert_non_null(strstr(fault.text, names));
    union gn_wire_message out;
    len = encode_unchecked(gn_wire_get_info(type), m, buf, sizeof(buf));
    assert_int_equal(gn_wire_decode(type, buf, len, payload, &out, &fault), want);
    if (want)
        assert_non_null(strstr(fault.text, names));
}

#define EXPECT_REFUSED(TYPE, member, change, names)                                                \
    do {                                                                                           \
        union gn_wire_message m_;                                                                  \
        uint32_t payload_ = sample_message(GN_WIRE_##TYPE, &m_);                                   \
        m_.member.change;                                                                          \
        expect(GN_WIRE_##TYPE, &m_, payload_, -EDOM, names);                                       \
    } while (0)

static void test_enums_out_of_range(void **state)
{
    (void)state;
    EXPECT_REFUSED(HELLO, hello, role = 0, "HELLO.role");
    EXPECT_REFUSED(HELLO, hello, role = 5, "HELLO.role");
    EXPECT_REFUSED(ERROR, error, code = 0, "ERROR.code");
    EXPECT_REFUSED(BYE, bye, reason = 0, "BYE.reason");
    EXPECT_REFUSED(BYE, bye, reason = 4, "BYE.reason");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, pixel_format = 0, "pixel_format");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, pixel_format = 10, "pixel_format");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.type = 0, "projection.type");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.type = 11, "projection.type");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, response.type = 5, "response.type");
    EXPECT_REFUSED(CAMERA, camera, response.type = 5, "response.type");
    EXPECT_REFUSED(FRAME, frame, views[3].picture_format = 3, "FRAME.views[3].picture_format");
    EXPECT_REFUSED(FRAME, frame, result_format = 3, "FRAME.result_format");
    EXPECT_REFUSED(FRAME, frame, quality = 3, "FRAME.quality");
    EXPECT_REFUSED(RESULT, result, views[1].format = 3, "RESULT.views[1].format");
    EXPECT_REFUSED(RESULT, result, receipt.quality = 3, "RESULT.receipt.quality");
    EXPECT_REFUSED(RESULT, result, receipt.budget.verdict = 3, "RESULT.receipt.budget.verdict");
    EXPECT_REFUSED(DROPPED, dropped, reason = 0, "DROPPED.reason");
    EXPECT_REFUSED(DROPPED, dropped, reason = 12, "DROPPED.reason");
}

static void test_values_out_of_range(void **state)
{
    (void)state;
    EXPECT_REFUSED(HELLO, hello, version_min = 0, "versions");
    EXPECT_REFUSED(HELLO, hello, version_max = 0, "versions");
    EXPECT_REFUSED(HELLO, hello, room[0] = '\n', "HELLO.room");
    EXPECT_REFUSED(HELLO, hello, room[6] = '\xff', "HELLO.room");
    EXPECT_REFUSED(WELCOME, welcome, session_id = 0, "WELCOME");
    EXPECT_REFUSED(WELCOME, welcome, max_frames_outstanding = 0, "WELCOME");
    EXPECT_REFUSED(REDIRECT, redirect, host[0] = 0, "REDIRECT");
    EXPECT_REFUSED(REDIRECT, redirect, port = 65536, "REDIRECT");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, sequence = 0, "sequence");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, width = 0, "width");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, height = 8193, "height");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, has_projection = false, "projection");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.theta_max = 3.2, "theta_max");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.type = 4, "k1");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.vignetting_b = 2e6,
                   "vignetting_b");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, projection.radius_px = -1, "radius_px");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, response.table_entries = 4097, "table");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, response.table_entries = 1, "table");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, response.type = 0, "table_entries");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, pixel_format = 8, "EXR");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, pixel_format = 2 - 1, "payload");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, scale = -1, "scale");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, matrix_to_rec709[8] = 1e7, "matrix");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, exposure_s = -1, "exposure");
    EXPECT_REFUSED(ENVIRONMENT_FRAME, environment_frame, world_from_probe.position_m[2] = -2e6,
                   "position_m[2]");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, stream[0] = 0, "stream");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, sequence = 0, "sequence");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, width = 2049, "2049 x 1");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, height = 0, "2 x 0");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, height = 2, "payload");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F32,
                   "pixel_format");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, scale = -1, "scale");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, response.type = GN_MSG_RESPONSE_TYPE_TABLE,
                   "table");
    EXPECT_REFUSED(EMITTER_FRAME, emitter_frame, response.gamma = 0, "gamma");
    EXPECT_REFUSED(POSE, pose, has_world_from_object = false, "world_from_object");
    EXPECT_REFUSED(POSE, pose, world_from_object.orientation[3] = 0, "orientation");
    EXPECT_REFUSED(POSE, pose, confidence = 1.5f, "confidence");
    EXPECT_REFUSED(CAMERA, camera, index = 4, "index");
    EXPECT_REFUSED(CAMERA, camera, width = 0, "width");
    EXPECT_REFUSED(CAMERA, camera, fx = 0, "fx");
    EXPECT_REFUSED(CAMERA, camera, fy = -1, "fy");
    EXPECT_REFUSED(CAMERA, camera, cy = 2e6, "cy");
    EXPECT_REFUSED(CAMERA, camera, k3 = -2e6, "coefficient 5");
    EXPECT_REFUSED(CAMERA, camera, response.log_b = 0, "log_b");
    EXPECT_REFUSED(CAMERA, camera, response.log_c = -1, "log_c");
    EXPECT_REFUSED(CAMERA, camera, response.type = GN_MSG_RESPONSE_TYPE_TABLE, "table");
    EXPECT_REFUSED(FRAME, frame, id = 0, "FRAME.id");
    EXPECT_REFUSED(FRAME, frame, views_count = 0, "FRAME.views");
    EXPECT_REFUSED(FRAME, frame, jpeg_quality = 101, "jpeg_quality");
    EXPECT_REFUSED(FRAME, frame, lighting_wait_ms = 60001, "lighting_wait_ms");
    EXPECT_REFUSED(FRAME, frame, views[2].camera = 4, "camera");
    EXPECT_REFUSED(FRAME, frame, views[0].payload_offset = 10, "payload of 12");
    EXPECT_REFUSED(FRAME, frame, views[0].payload_offset = UINT32_MAX, "payload of 12");
    EXPECT_REFUSED(FRAME, frame, views[3].payload_offset = 1, "overlaps");
    EXPECT_REFUSED(FRAME, frame, views[3].payload_length = 0, "there is a");
    EXPECT_REFUSED(FRAME, frame, views[3].picture_format = GN_MSG_PICTURE_FORMAT_NONE, "but no");
    EXPECT_REFUSED(FRAME, frame, views[1].world_from_camera.orientation[0] = 0, "orientation");
    EXPECT_REFUSED(RESULT, result, views[0].width = 3, "RESULT.views[0]");
    EXPECT_REFUSED(RESULT, result, views[1].height = 0, "height");
    EXPECT_REFUSED(RESULT, result, receipt.encode_ms = -1, "stage time");
    EXPECT_REFUSED(RESULT, result, receipt.budget.budget_ms = 0, "RESULT.receipt.budget");
    EXPECT_REFUSED(RESULT, result, receipt.budget.busy_ms = -1, "RESULT.receipt.budget");
    EXPECT_REFUSED(FRAME, frame, budget_ms = -1, "FRAME.budget_ms");
    EXPECT_REFUSED(FRAME, frame, budget_ms = 60001, "FRAME.budget_ms");
    EXPECT_REFUSED(DROPPED, dropped, id = 0, "DROPPED.id");
    EXPECT_REFUSED(LIGHTING_STATE, lighting_state, light_count = 16385, "light_count");
    EXPECT_REFUSED(LIGHTING_STATE, lighting_state, light_count = 1, "payload");
    EXPECT_REFUSED(LIGHTING_STATE, lighting_state, map_width = 0, "map");
    EXPECT_REFUSED(LIGHTING_STATE, lighting_state, discs[1] = 2, "discs[1]");
    EXPECT_REFUSED(LIGHTING_STATE, lighting_state, discs[1] = 0, "must rise");
    EXPECT_REFUSED(STATISTICS, statistics, holdable_fps = -1, "holdable_fps");
}

static void test_bad_structs_are_not_encoded(void **state)
{
    (void)state;
    union gn_wire_message m;
    uint8_t buf[GN_WIRE_HEAD_BYTES];
    size_t len;
    struct gn_wire_fault fault;
    sample_message(GN_WIRE_HELLO, &m);
    memset(m.hello.room, 'x', sizeof(m.hello.room)); // no NUL
    assert_int_equal(gn_wire_encode(GN_WIRE_HELLO, &m, 0, buf, sizeof(buf), &len, &fault), -EDOM);
    sample_message(GN_WIRE_HELLO, &m);
    m.hello.ticket.size = 65;
    assert_int_equal(gn_wire_encode(GN_WIRE_HELLO, &m, 0, buf, sizeof(buf), &len, &fault), -EDOM);
    uint32_t payload = sample_message(GN_WIRE_FRAME, &m);
    m.frame.views_count = 5;
    assert_int_equal(gn_wire_encode(GN_WIRE_FRAME, &m, payload, buf, sizeof(buf), &len, &fault),
                     -EDOM);
    assert_int_equal(gn_wire_encode(GN_WIRE_PING, &m, 1, buf, sizeof(buf), &len, &fault),
                     -EMSGSIZE);
    assert_int_equal(gn_wire_encode(8, &m, 0, buf, sizeof(buf), &len, &fault), -ENOMSG);
    assert_int_equal(gn_wire_decode(8, buf, 0, 0, &m, &fault), -ENOMSG);
}

static void test_defaults(void **state)
{
    (void)state;
    union gn_wire_message m = {0}, out;
    m.environment_frame = (struct gn_msg_environment_frame){
        .sequence = 1,
        .width = 300,
        .height = 200,
        .pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F32,
        .has_projection = true,
        .projection = {.type = GN_MSG_PROJECTION_TYPE_EQUIDISTANT},
    };
    uint8_t buf[GN_WIRE_HEAD_BYTES];
    uint32_t payload = 300 * 200 * 12;
    size_t len;
    assert_int_equal(
        gn_wire_encode(GN_WIRE_ENVIRONMENT_FRAME, &m, payload, buf, sizeof(buf), &len, NULL), 0);
    assert_int_equal(
        gn_wire_decode(GN_WIRE_ENVIRONMENT_FRAME, buf + 20, len - 20, payload, &out, NULL), 0);
    const struct gn_msg_environment_frame *e = &out.environment_frame;
    assert_true(e->projection.center_x_px == 150 && e->projection.center_y_px == 100);
    assert_true(e->projection.radius_px == 100 && e->projection.focal_px == 0);
    assert_true(fabs(e->projection.theta_max - acos(0)) < 1e-12);
    assert_true(e->has_response && e->response.type == GN_MSG_RESPONSE_TYPE_LINEAR);
    assert_true(e->scale == 1 && e->matrix_to_rec709[0] == 1 && e->matrix_to_rec709[4] == 1);
    assert_true(e->has_world_from_probe && e->world_from_probe.orientation[0] == 1);

    m.camera = (struct gn_msg_camera){.width = 4, .height = 4, .fx = 1, .fy = 1};
    assert_int_equal(gn_wire_encode(GN_WIRE_CAMERA, &m, 0, buf, sizeof(buf), &len, NULL), 0);
    assert_int_equal(gn_wire_decode(GN_WIRE_CAMERA, buf + 20, len - 20, 0, &out, NULL), 0);
    assert_int_equal(out.camera.response.type, GN_MSG_RESPONSE_TYPE_SRGB);
    assert_true(out.camera.scale == 1 && out.camera.matrix_to_rec709[8] == 1);

    m.frame = (struct gn_msg_frame){.id = 1, .views_count = 1};
    assert_int_equal(gn_wire_encode(GN_WIRE_FRAME, &m, 0, buf, sizeof(buf), &len, NULL), 0);
    assert_int_equal(gn_wire_decode(GN_WIRE_FRAME, buf + 20, len - 20, 0, &out, NULL), 0);
    assert_int_equal(out.frame.jpeg_quality, GN_JPEG_QUALITY_DEFAULT);
    assert_int_equal(out.frame.result_format, GN_MSG_PICTURE_FORMAT_RGB8);
    assert_false(out.frame.views[0].has_world_from_camera);
}

static void test_nul_ends_a_string(void **state)
{
    (void)state;
    // version_min 1, version_max 1, room "a\0b", role 2
    const uint8_t header[] = {0x08, 1, 0x10, 1, 0x3a, 3, 'a', 0, 'b', 0x40, 2};
    union gn_wire_message m;
    assert_int_equal(gn_wire_decode(GN_WIRE_HELLO, header, sizeof(header), 0, &m, NULL), 0);
    assert_string_equal(m.hello.room, "a");
}

/** A client that computes in float32 means pi by a little more than pi. */
static void test_theta_max_of_a_float(void **state)
{
    (void)state;
    union gn_wire_message m;
    uint32_t payload = sample_message(GN_WIRE_ENVIRONMENT_FRAME, &m);
    m.environment_frame.projection.theta_max = (double)3.14159265358979f;
    expect(GN_WIRE_ENVIRONMENT_FRAME, &m, payload, 0, "");
    m.environment_frame.projection.theta_max = 3.1416;
    expect(GN_WIRE_ENVIRONMENT_FRAME, &m, payload, -EDOM, "theta_max");
}

static void test_envelope(void **state)
{
    (void)state;
    // The worked example of PROTOCOL.md has the same layout.
    const struct gn_envelope in = {1, 0, GN_WIRE_FRAME, 0, 0x0102, 0x00030405};
    const uint8_t want[20] = {'G', 'N', 'O', 'M', 1, 0, 19, 0, 0, 0, 0, 0, 2, 1, 0, 0, 5, 4, 3, 0};
    uint8_t bytes[GN_ENVELOPE_BYTES];
    gn_envelope_encode(&in, bytes);
    assert_memory_equal(bytes, want, sizeof(want));
    struct gn_envelope out = {.version = 77};
    assert_int_equal(gn_envelope_decode(bytes, &out), 0);
    assert_memory_equal(&in, &out, sizeof(in));

    for (int i = 0; i < 4; i++) {
        uint8_t bad[GN_ENVELOPE_BYTES];
        memcpy(bad, bytes, sizeof(bad));
        bad[i] ^= 0x20;
        out.version = 77;
        assert_int_equal(gn_envelope_decode(bad, &out), -EBADMSG);
        assert_int_equal(out.version, 77);
    }
    const struct {
        struct gn_envelope e;
        int want;
    } cases[] = {
        {{0, 0, GN_WIRE_PING, 0, 0, 0}, -EPROTONOSUPPORT},
        {{2, 0, GN_WIRE_HELLO, 0, 0, 0}, -EPROTONOSUPPORT},
        {{255, 0, 9999, 0, UINT32_MAX, UINT32_MAX}, -EPROTONOSUPPORT},
        {{255, 0, GN_WIRE_ERROR, 0, 0, 0}, 0},
        {{1, 1, GN_WIRE_PING, 0, 0, 0}, -EPROTO},
        {{1, 0, GN_WIRE_PING, 1, 0, 0}, -EPROTO},
        {{1, 0, 0, 0, 0, 0}, -ENOMSG},
        {{1, 0, 8, 0, 0, 0}, -ENOMSG},
        {{1, 0, 36, 0, 0, 0}, -ENOMSG},
        {{1, 0, GN_WIRE_PING, 0, 0, 1}, -EMSGSIZE},
        {{1, 0, GN_WIRE_ERROR, 0, 2049, 0}, -EMSGSIZE},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        gn_envelope_encode(&cases[i].e, bytes);
        assert_int_equal(gn_envelope_decode(bytes, &out), cases[i].want);
        assert_memory_equal(&out, &cases[i].e, sizeof(out));
    }
}

static void test_limits_hold_at_the_byte(void **state)
{
    (void)state;
    int row = 0;
    FOR_EACH_TYPE(info)
    {
        assert_ptr_equal(gn_wire_get_info(info->type), info);
        assert_true(info->max_header_bytes <= GN_LIMIT_HEADER_BYTES);
        struct gn_envelope e = {
            1, 0, info->type, 0, info->max_header_bytes, info->max_payload_bytes};
        struct gn_envelope out;
        uint8_t bytes[GN_ENVELOPE_BYTES];
        gn_envelope_encode(&e, bytes);
        assert_int_equal(gn_envelope_decode(bytes, &out), 0);
        e.header_bytes++;
        gn_envelope_encode(&e, bytes);
        assert_int_equal(gn_envelope_decode(bytes, &out), -EMSGSIZE);
        e.header_bytes--;
        e.payload_bytes++;
        gn_envelope_encode(&e, bytes);
        assert_int_equal(gn_envelope_decode(bytes, &out), -EMSGSIZE);
    }
}

static void test_set_string(void **state)
{
    (void)state;
    char out[6];
    gn_wire_set_string(out, sizeof(out), "abcdefgh");
    assert_string_equal(out, "abcde");
    gn_wire_set_string(out, sizeof(out), "abcd\xc3\xbc"); // two bytes do not fit in one
    assert_string_equal(out, "abcd");
    gn_wire_set_string(out, sizeof(out),
                       "a\n\xff\x7f"
                       "b");
    assert_string_equal(out, "a???b");
    gn_wire_set_string(out, sizeof(out), "\xed\xa0\x80"); // a surrogate
    assert_string_equal(out, "???");
    gn_wire_set_string(out, sizeof(out), "\xf0\x9f\x98\x80");
    assert_string_equal(out, "\xf0\x9f\x98\x80");
    gn_wire_set_string(out, sizeof(out), "\xc0\xaf\xe2\x82"); // overlong, cut short
    assert_string_equal(out, "????");
    gn_wire_set_string(out, 1, "abc");
    assert_string_equal(out, "");
}

/** xorshift32 (Marsaglia 2003): the same sequence everywhere. */
static uint32_t next_random(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

/** Damaged headers are refused, or what comes out is a message that we would send ourselves. */
static void test_damaged_headers(void **state)
{
    (void)state;
    const char *wish = getenv("GN_TEST_SEED");
    uint32_t seed = wish ? (uint32_t)strtoul(wish, NULL, 10) : 20261122u;
    print_message("# GN_TEST_SEED=%u\n", seed);
    uint32_t random = seed ? seed : 1;
    int accepted = 0, refused = 0, row = 0;
    FOR_EACH_TYPE(info)
    {
        for (int turn = 0; turn < 3000; turn++) {
            union gn_wire_message m;
            uint32_t payload = sample_message(info->type, &m);
            uint8_t buf[GN_WIRE_HEAD_BYTES];
            size_t len = encode_unchecked(info, &m, buf, sizeof(buf));
            for (uint32_t hits = 1 + next_random(&random) % 3; hits > 0; hits--)
                buf[next_random(&random) % len] = (uint8_t)next_random(&random);
            uint8_t *exact = malloc(len);
            memcpy(exact, buf, len);
            int err = gn_wire_decode(info->type, exact, len, payload, &m, NULL);
            free(exact);
            assert_true(err == 0 || err == -EBADMSG || err == -EDOM);
            refused += err != 0;
            if (err)
                continue;
            accepted++;
            assert_int_equal(gn_wire_encode(info->type, &m, payload, buf, sizeof(buf), &len, NULL),
                             0);
        }
    }
    assert_true(accepted > 1000 && refused > 1000); // the damage is neither too small nor too great
}

static void test_every_number_has_a_sentence(void **state)
{
    (void)state;
    const char *unknown = gn_wire_get_error_text(_GN_MSG_ERROR_CODE_MAX + 1);
    for (unsigned i = 1; i <= _GN_MSG_ERROR_CODE_MAX; i++)
        assert_string_not_equal(gn_wire_get_error_text(i), unknown);
    unknown = gn_wire_get_drop_text(_GN_MSG_DROP_REASON_MAX + 1);
    for (unsigned i = 1; i <= _GN_MSG_DROP_REASON_MAX; i++)
        assert_string_not_equal(gn_wire_get_drop_text(i), unknown);
    unknown = gn_wire_get_bye_text(_GN_MSG_BYE_REASON_MAX + 1);
    for (unsigned i = 1; i <= _GN_MSG_BYE_REASON_MAX; i++)
        assert_string_not_equal(gn_wire_get_bye_text(i), unknown);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_small_buffer_is_refused),
        cmocka_unit_test(test_truncation_at_every_byte),
        cmocka_unit_test(test_every_float_must_be_finite),
        cmocka_unit_test(test_enums_out_of_range),
        cmocka_unit_test(test_values_out_of_range),
        cmocka_unit_test(test_bad_structs_are_not_encoded),
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_nul_ends_a_string),
        cmocka_unit_test(test_theta_max_of_a_float),
        cmocka_unit_test(test_envelope),
        cmocka_unit_test(test_limits_hold_at_the_byte),
        cmocka_unit_test(test_set_string),
        cmocka_unit_test(test_damaged_headers),
        cmocka_unit_test(test_every_number_has_a_sentence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
