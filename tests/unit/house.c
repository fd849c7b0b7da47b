/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/unit/house.h"

#include <math.h>
#include <poll.h>
#include <string.h>
#include <time.h>

#include "common/clock.h"
#include "common/half.h"
#include "tests/folder.h"
#include "tests/unit/cmocka_setup.h"

static const char *const names[] = {"diffuse.json", "mirror.json", "tv.json", "floor.obj",
                                    "roof.obj"};

int house_set_up(void **test)
{
    (void)test;
    if (gn_test_folder_create() < 0)
        return -1;
    gn_test_folder_write_text("floor.obj",
                              "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
                              "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
    gn_test_folder_write_text("roof.obj",
                              "v -0.2 -0.2 0.2\nv 0.2 -0.2 0.2\nv 0 0.2 0.3\nf 1 2 3\n");
    gn_test_folder_write_text(names[HOUSE_DIFFUSE],
                              "{\"objects\": [{\"mesh\": \"floor.obj\", \"role\": \"real\"},"
                              " {\"mesh\": \"roof.obj\", \"role\": \"virtual\"}]}");
    gn_test_folder_write_text(names[HOUSE_MIRROR],
                              "{\"objects\": [{\"mesh\": \"roof.obj\", \"role\": \"virtual\","
                              " \"material\": {\"type\": \"mirror\"}}]}");
    gn_test_folder_write_text(names[HOUSE_TV],
                              "{\"objects\": [{\"mesh\": \"roof.obj\", \"role\": \"virtual\"},"
                              " {\"mesh\": \"floor.obj\", \"role\": \"real\", \"material\":"
                              " {\"type\": \"diffuse\", \"emission_stream\": \"tv\","
                              " \"emission_scale\": 4}}]}");
    return 0;
}

int house_tear_down(void **test)
{
    (void)test;
    return gn_test_folder_remove(names, sizeof(names) / sizeof(names[0]));
}

struct gn_room_session *house_join(struct house *h, enum gn_msg_role role, bool subscribes)
{
    const struct gn_room_member member = {.id = ++h->next_id,
                                          .role = role,
                                          .name = "test",
                                          .peer = "here",
                                          .want_lighting_states = subscribes};
    struct gn_room_session *session = NULL;
    struct gn_error error = {0};
    assert_int_equal(gn_room_join(h->room, &member, &session, &error), 0);
    return session;
}

void house_build(struct house *h, enum house_scene scene, double noise,
                 const struct gn_render_options *render)
{
    struct gn_error error = {0};
    *h = (struct house){
        .time_ns = GN_NS_PER_S, .gain = 1, .result_format = GN_MSG_PICTURE_FORMAT_RGB8};
    assert_int_equal(gn_buf_create(HOUSE_PICTURE_BYTES, &h->picture), 0);
    memset(h->picture->data, 150, h->picture->len);
    assert_int_equal(gn_mailbox_create(&h->mailbox), 0);
    const struct gn_room_options options = {
        .name = "test",
        .node = "node",
        .scene_path = gn_test_folder_get_path(names[scene]),
        .light = {.smoothing = 0.4},
        .render = render ? *render : (struct gn_render_options){0},
        .environment_noise = noise,
        .max_picture_width = HOUSE_WIDTH,
        .max_picture_height = HOUSE_HEIGHT,
        .max_environment_width = HOUSE_MAP_WIDTH,
        .max_environment_height = HOUSE_MAP_HEIGHT,
        .holdable_margin = 0.8,
        .mailbox = h->mailbox,
    };
    if (gn_room_create(&options, &h->room, &error) < 0)
        fail_msg("%s", error.text);
    h->probe = house_join(h, GN_MSG_ROLE_PROBE, false);
    h->viewer = house_join(h, GN_MSG_ROLE_VIEWER, false);
    const struct gn_msg_camera camera = {
        .width = HOUSE_WIDTH,
        .height = HOUSE_HEIGHT,
        .fx = HOUSE_WIDTH,
        .fy = HOUSE_WIDTH,
        .cx = HOUSE_WIDTH / 2.0,
        .cy = HOUSE_HEIGHT / 2.0,
        .has_response = true,
        .response.type = GN_MSG_RESPONSE_TYPE_SRGB,
        .matrix_to_rec709 = {1, 0, 0, 0, 1, 0, 0, 0, 1},
        .scale = 1,
    };
    assert_int_equal(gn_room_put_camera(h->viewer, &camera, &error), 0);
}

void house_raze(struct house *h)
{
    gn_room_leave(&h->subscriber);
    gn_room_leave(&h->viewer);
    gn_room_leave(&h->probe);
    gn_room_destroy(&h->room);
    while (h->notes) {
        struct gn_note *note = h->notes;
        h->notes = note->next;
        gn_mailbox_recycle(h->mailbox, &note);
    }
    gn_mailbox_destroy(&h->mailbox);
    gn_buf_unref(&h->picture);
}

struct gn_buf *house_make_pixels(double gain, double noise, unsigned seed)
{
    struct gn_buf *pixels;
    assert_int_equal(gn_buf_create((size_t)HOUSE_MAP_WIDTH * HOUSE_MAP_HEIGHT * 6, &pixels), 0);
    for (int i = 0; i < HOUSE_MAP_WIDTH * HOUSE_MAP_HEIGHT; i++) {
        double x = i % HOUSE_MAP_WIDTH, y = (double)(i / HOUSE_MAP_WIDTH);
        double lamp = fabs(x - 20) < 2 && fabs(y - 6) < 2 ? 40 : 0;
        for (int c = 0; c < 3; c++) {
            seed = seed * 1664525u + 1013904223u;
            double sign = seed >> 31 ? 1 : -1;
            double value = gain * (0.1 + 0.2 * x / HOUSE_MAP_WIDTH + lamp) * (1 + sign * noise);
            uint16_t half = gn_half_from_float((float)value);
            pixels->data[6 * i + 2 * c] = (uint8_t)half;
            pixels->data[6 * i + 2 * c + 1] = (uint8_t)(half >> 8);
        }
    }
    return pixels;
}

struct gn_msg_environment_frame house_make_header(void)
{
    return (struct gn_msg_environment_frame){
        .width = HOUSE_MAP_WIDTH,
        .height = HOUSE_MAP_HEIGHT,
        .pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F16,
        .has_projection = true,
        .projection = {.type = GN_MSG_PROJECTION_TYPE_LATLONG, .radius_px = 8},
        .has_response = true,
        .matrix_to_rec709 = {1, 0, 0, 0, 1, 0, 0, 0, 1},
        .scale = 1,
        .has_world_from_probe = true,
        .world_from_probe.orientation = {1, 0, 0, 0},
    };
}

void house_send_light(struct house *h, struct gn_buf *pixels)
{
    struct gn_msg_environment_frame frame = house_make_header();
    struct gn_error error = {0};
    frame.sequence = ++h->sequence;
    frame.capture_time_ns = h->time_ns += 33333333;
    assert_int_equal(gn_room_put_environment(h->probe, &frame, pixels, &error), 0);
}

struct gn_room_figures house_get_figures(struct house *h)
{
    struct gn_room_figures figures;
    gn_room_get_figures(h->room, &figures);
    return figures;
}

void house_wait_for_light(struct house *h)
{
    for (int i = 0; house_get_figures(h).light_sequence != h->sequence; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
}

void house_light_up(struct house *h, double noise, unsigned seed)
{
    struct gn_buf *pixels = house_make_pixels(h->gain, noise, seed);
    house_send_light(h, pixels);
    gn_buf_unref(&pixels);
    house_wait_for_light(h);
}

void house_send_frame(struct house *h, uint64_t min_sequence, uint32_t wait_ms)
{
    struct gn_error error = {0};
    const struct gn_msg_frame frame = {
        .id = ++h->frame_id,
        .views_count = 1,
        .views[0] = {.has_world_from_camera = true,
                     .world_from_camera = {.orientation = {0, 1, 0, 0}, .position_m = {0, 0, 1}},
                     .picture_format = GN_MSG_PICTURE_FORMAT_RGB8,
                     .payload_length = (uint32_t)h->picture->len},
        .result_format = h->result_format,
        .jpeg_quality = h->result_format == GN_MSG_PICTURE_FORMAT_JPEG ? 90 : 0,
        .lighting_min_sequence = min_sequence,
        .lighting_wait_ms = wait_ms,
    };
    int64_t now_ns = gn_clock_get_monotonic_ns();
    assert_int_equal(gn_room_put_frame(h->viewer, &frame, h->picture, now_ns, &error), 0);
}

uint64_t house_take_result(struct house *h, int timeout_ms, uint8_t out[HOUSE_PICTURE_BYTES])
{
    uint64_t sequence = 0;
    while (sequence == 0) {
        struct pollfd wait = {.fd = gn_mailbox_get_fd(h->mailbox), .events = POLLIN};
        if (poll(&wait, 1, timeout_ms) != 1)
            return 0;
        for (struct gn_note *note = gn_mailbox_take_all(h->mailbox), *next; note; note = next) {
            next = note->next;
            assert_int_not_equal(note->type, GN_WIRE_DROPPED);
            if (note->type == GN_WIRE_RESULT) {
                sequence = note->body.result.receipt.lighting_sequence;
                if (out)
                    memcpy(out, note->payload->data, HOUSE_PICTURE_BYTES);
            }
            gn_mailbox_recycle(h->mailbox, &note);
        }
    }
    return sequence;
}

void house_draw(struct house *h, uint8_t out[HOUSE_PICTURE_BYTES])
{
    house_send_frame(h, h->sequence, 20000);
    assert_int_equal(house_take_result(h, 20000, out), h->sequence);
}
