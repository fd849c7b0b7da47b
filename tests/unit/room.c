/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A room without sockets: what a frame costs in memory once the first ones are through. */
#include "server/room/room.h"

#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/file.h"
#include "tests/allocations.h"

#define WIDTH 64
#define HEIGHT 48

static char folder[] = "/tmp/gnomon-room.XXXXXX";
static struct gn_mailbox *mailbox;
static struct gn_room *room;
static struct gn_room_session *probe, *viewer;
static struct gn_buf *picture, *lights[2]; // which differ: a frame like the last costs nothing
static uint64_t frame_id, sequence;

static void write_file(const char *name, const char *text)
{
    char path[64];
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    struct gn_error error = {0};
    assert_int_equal(gn_file_write(path, text, strlen(text), &error), 0);
}

static struct gn_room_session *join(uint64_t id, enum gn_msg_role role)
{
    const struct gn_room_member member = {.id = id, .role = role, .name = "test", .peer = "here"};
    struct gn_room_session *session = NULL;
    struct gn_error error = {0};
    assert_int_equal(gn_room_join(room, &member, &session, &error), 0);
    return session;
}

static void put_camera(void)
{
    const struct gn_msg_camera camera = {
        .width = WIDTH,
        .height = HEIGHT,
        .fx = WIDTH,
        .fy = WIDTH,
        .cx = WIDTH / 2.0,
        .cy = HEIGHT / 2.0,
        .has_response = true,
        .response.type = GN_MSG_RESPONSE_TYPE_SRGB,
        .matrix_to_rec709 = {1, 0, 0, 0, 1, 0, 0, 0, 1},
        .scale = 1,
    };
    struct gn_error error = {0};
    assert_int_equal(gn_room_put_camera(viewer, &camera, &error), 0);
}

static int setup(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    write_file("floor.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n");
    write_file("roof.obj", "v -0.1 -0.1 0.2\nv 0.1 -0.1 0.2\nv 0 0.1 0.2\nf 1 2 3\n");
    write_file("scene.json", "{\"objects\": [{\"mesh\": \"floor.obj\", \"role\": \"real\"},"
                             " {\"mesh\": \"roof.obj\", \"role\": \"virtual\"}]}");
    char path[64];
    snprintf(path, sizeof(path), "%s/scene.json", folder);
    assert_int_equal(gn_mailbox_create(&mailbox), 0);
    const struct gn_room_options options = {
        .name = "test",
        .node = "node",
        .scene_path = path,
        .max_picture_width = WIDTH,
        .max_picture_height = HEIGHT,
        .max_environment_width = 32,
        .max_environment_height = 16,
        .holdable_margin = 0.8,
        .mailbox = mailbox,
    };
    struct gn_error error = {0};
    if (gn_room_create(&options, &room, &error) < 0)
        fail_msg("%s", error.text);
    probe = join(1, GN_MSG_ROLE_PROBE);
    viewer = join(2, GN_MSG_ROLE_VIEWER);
    put_camera();
    assert_int_equal(gn_buf_create((size_t)WIDTH * HEIGHT * 3, &picture), 0);
    memset(picture->data, 128, picture->len);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(gn_buf_create((size_t)32 * 16 * 6, &lights[k]), 0);
        for (size_t i = 0; i < lights[k]->len; i++) // half floats of radiance 1, or 1.125
            lights[k]->data[i] = i % 2 ? 0x3c : k ? 0x80 : 0x00;
    }
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    gn_room_leave(&viewer);
    gn_room_leave(&probe);
    gn_room_destroy(&room);
    gn_mailbox_destroy(&mailbox);
    gn_buf_unref(&picture);
    gn_buf_unref(&lights[0]);
    gn_buf_unref(&lights[1]);
    static const char *const names[] = {"floor.obj", "roof.obj", "scene.json"};
    for (size_t i = 0; i < GN_ARRAY_LEN(names); i++) {
        char path[64];
        snprintf(path, sizeof(path), "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder);
}

/** Sends an environment frame and waits until its light is the room's. */
static void light_up(void)
{
    const struct gn_msg_environment_frame frame = {
        .sequence = ++sequence,
        .width = 32,
        .height = 16,
        .pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F16,
        .has_projection = true,
        .projection = {.type = GN_MSG_PROJECTION_TYPE_LATLONG, .radius_px = 8},
        .has_response = true,
        .matrix_to_rec709 = {1, 0, 0, 0, 1, 0, 0, 0, 1},
        .scale = 1,
        .has_world_from_probe = true,
        .world_from_probe.orientation = {1, 0, 0, 0},
    };
    struct gn_error error = {0};
    assert_int_equal(gn_room_put_environment(probe, &frame, lights[sequence % 2], &error), 0);
    for (int i = 0; i < 20000; i++) {
        struct gn_room_figures figures;
        gn_room_get_figures(room, &figures);
        if (figures.light_sequence == sequence)
            return;
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    fail_msg("no light");
}

/** Sends a frame and takes its result. */
static void take_result(enum gn_msg_picture_format format)
{
    const struct gn_msg_frame frame = {
        .id = ++frame_id,
        .views_count = 1,
        .views[0] = {.has_world_from_camera = true,
                     .world_from_camera = {.orientation = {0, 1, 0, 0}, .position_m = {0, 0, 1}},
                     .picture_format = GN_MSG_PICTURE_FORMAT_RGB8,
                     .payload_length = (uint32_t)picture->len},
        .result_format = format,
        .jpeg_quality = 90,
    };
    struct gn_error error = {0};
    assert_int_equal(gn_room_put_frame(viewer, &frame, picture, 0, &error), 0);
    struct pollfd wait = {.fd = gn_mailbox_get_fd(mailbox), .events = POLLIN};
    assert_int_equal(poll(&wait, 1, 20000), 1);
    struct gn_note *note = gn_mailbox_take_all(mailbox);
    assert_non_null(note);
    assert_null(note->next);
    assert_int_equal(note->type, GN_WIRE_RESULT);
    assert_int_equal(note->body.result.id, frame_id);
    gn_mailbox_recycle(mailbox, &note);
}

static void test_frames_allocate_nothing(void **state)
{
    (void)state;
    light_up();
    static const enum gn_msg_picture_format formats[] = {GN_MSG_PICTURE_FORMAT_RGB8,
                                                         GN_MSG_PICTURE_FORMAT_JPEG};
    for (size_t f = 0; f < GN_ARRAY_LEN(formats); f++) {
        for (int i = 0; i < 3; i++)
            take_result(formats[f]);
        long before = gn_test_n_allocations;
        for (int i = 0; i < 20; i++)
            take_result(formats[f]);
        assert_int_equal(gn_test_n_allocations - before, 0);
    }
}

/** An environment frame makes a new state: a number of blocks that does not grow. */
static void test_light_allocates_as_much(void **state)
{
    (void)state;
    long n[3];
    for (int i = 0; i < 4; i++)
        light_up();
    for (int k = 0; k < 3; k++) {
        long before = gn_test_n_allocations;
        for (int i = 0; i < 10; i++)
            light_up();
        n[k] = gn_test_n_allocations - before;
    }
    print_message("# %ld allocations an environment frame\n", n[0] / 10);
    assert_int_equal(n[1], n[0]);
    assert_int_equal(n[2], n[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frames_allocate_nothing),
        cmocka_unit_test(test_light_allocates_as_much),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
