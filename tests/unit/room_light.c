/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a room leaves out of its light, and that nobody sees it. */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/half.h"
#include "server/room/room.h"
#include "server/room/same_frame.h"

enum { WIDTH = 64, HEIGHT = 48, MAP_WIDTH = 64, MAP_HEIGHT = 32 };
enum scene { DIFFUSE, MIRROR, TV, N_SCENES };

static char folder[] = "/tmp/gnomon-room-light.XXXXXX";
static const char *const meshes[] = {"floor.obj", "roof.obj"};
static const char *const scenes[] = {"diffuse.json", "mirror.json", "tv.json"};

/* A room with a viewer and a probe. */
struct house {
    struct gn_mailbox *mailbox;
    struct gn_room *room;
    struct gn_room_session *probe, *viewer, *subscriber;
    uint64_t next_id, frame_id, sequence;
    int64_t time_ns;
    double gain;           // of all light
    struct gn_note *notes; // taken from the mailbox, not read
};

static void write_file(const char *name, const char *text)
{
    char path[64];
    struct gn_error error = {0};
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    assert_int_equal(gn_file_write(path, text, strlen(text), &error), 0);
}

static int setup(void **test)
{
    (void)test;
    if (!mkdtemp(folder))
        return -1;
    write_file(meshes[0], "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
                          "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
    write_file(meshes[1], "v -0.2 -0.2 0.2\nv 0.2 -0.2 0.2\nv 0 0.2 0.3\nf 1 2 3\n");
    write_file(scenes[DIFFUSE], "{\"objects\": [{\"mesh\": \"floor.obj\", \"role\": \"real\"},"
                                " {\"mesh\": \"roof.obj\", \"role\": \"virtual\"}]}");
    write_file(scenes[MIRROR], "{\"objects\": [{\"mesh\": \"roof.obj\", \"role\": \"virtual\","
                               " \"material\": {\"type\": \"mirror\"}}]}");
    write_file(scenes[TV], "{\"objects\": [{\"mesh\": \"roof.obj\", \"role\": \"virtual\"},"
                           " {\"mesh\": \"floor.obj\", \"role\": \"real\", \"material\":"
                           " {\"type\": \"diffuse\", \"emission_stream\": \"tv\","
                           " \"emission_scale\": 4}}]}");
    return 0;
}

static int teardown(void **test)
{
    (void)test;
    const char *const names[] = {meshes[0], meshes[1], scenes[0], scenes[1], scenes[2]};
    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        char path[64];
        snprintf(path, sizeof(path), "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder);
}

static struct gn_room_session *join(struct house *h, enum gn_msg_role role, bool subscribes)
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

static void build_shaded(struct house *h, enum scene scene, double noise, bool no_shadow,
                         bool by_irradiance)
{
    char path[64];
    struct gn_error error = {0};
    *h = (struct house){.time_ns = 1000000000, .gain = 1};
    snprintf(path, sizeof(path), "%s/%s", folder, scenes[scene]);
    assert_int_equal(gn_mailbox_create(&h->mailbox), 0);
    const struct gn_room_options options = {
        .name = "test",
        .node = "node",
        .scene_path = path,
        .light = {.smoothing = 0.4},
        .render = {.no_shadow = no_shadow,
                   .shading = by_irradiance ? GN_SHADING_IRRADIANCE : GN_SHADING_LIGHTS},
        .environment_noise = noise,
        .max_picture_width = WIDTH,
        .max_picture_height = HEIGHT,
        .max_environment_width = MAP_WIDTH,
        .max_environment_height = MAP_HEIGHT,
        .holdable_margin = 0.8,
        .mailbox = h->mailbox,
    };
    if (gn_room_create(&options, &h->room, &error) < 0)
        fail_msg("%s", error.text);
    h->probe = join(h, GN_MSG_ROLE_PROBE, false);
    h->viewer = join(h, GN_MSG_ROLE_VIEWER, false);
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
    assert_int_equal(gn_room_put_camera(h->viewer, &camera, &error), 0);
}

static void build(struct house *h, enum scene scene, double noise, bool no_shadow)
{
    build_shaded(h, scene, noise, no_shadow, false);
}

static void raze(struct house *h)
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
}

/* A sky that is brighter on one side, with a lamp; noise: each half float up or down by a share. */
static struct gn_buf *make_pixels(double gain, double noise, unsigned seed)
{
    struct gn_buf *pixels;
    assert_int_equal(gn_buf_create((size_t)MAP_WIDTH * MAP_HEIGHT * 6, &pixels), 0);
    for (int i = 0; i < MAP_WIDTH * MAP_HEIGHT; i++) {
        double x = i % MAP_WIDTH, y = (double)(i / MAP_WIDTH);
        double lamp = fabs(x - 20) < 2 && fabs(y - 6) < 2 ? 40 : 0;
        for (int c = 0; c < 3; c++) {
            seed = seed * 1664525u + 1013904223u;
            double sign = seed >> 31 ? 1 : -1;
            double value = gain * (0.1 + 0.2 * x / MAP_WIDTH + lamp) * (1 + sign * noise);
            uint16_t half = gn_half_from_float((float)value);
            pixels->data[6 * i + 2 * c] = (uint8_t)half;
            pixels->data[6 * i + 2 * c + 1] = (uint8_t)(half >> 8);
        }
    }
    return pixels;
}

static struct gn_msg_environment_frame make_header(void)
{
    return (struct gn_msg_environment_frame){
        .width = MAP_WIDTH,
        .height = MAP_HEIGHT,
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

static void send_light(struct house *h, uint64_t sequence, double noise, unsigned seed)
{
    struct gn_msg_environment_frame frame = make_header();
    struct gn_error error = {0};
    struct gn_buf *pixels = make_pixels(h->gain, noise, seed);
    frame.sequence = h->sequence = sequence;
    frame.capture_time_ns = h->time_ns += 33333333;
    assert_int_equal(gn_room_put_environment(h->probe, &frame, pixels, &error), 0);
    gn_buf_unref(&pixels);
}

static struct gn_room_figures get_figures(struct house *h)
{
    struct gn_room_figures figures;
    gn_room_get_figures(h->room, &figures);
    return figures;
}

/* Sends an environment frame and waits for its light. */
static void light_up(struct house *h, double noise, unsigned seed)
{
    send_light(h, h->sequence + 1, noise, seed);
    for (int i = 0; get_figures(h).light_sequence != h->sequence; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
}

static void send_frame(struct house *h, uint64_t min_sequence, uint32_t wait_ms)
{
    struct gn_buf *picture;
    struct gn_error error = {0};
    assert_int_equal(gn_buf_create((size_t)WIDTH * HEIGHT * 3, &picture), 0);
    memset(picture->data, 150, picture->len);
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const struct gn_msg_frame frame = {
        .id = ++h->frame_id,
        .views_count = 1,
        .views[0] = {.has_world_from_camera = true,
                     .world_from_camera = {.orientation = {0, 1, 0, 0}, .position_m = {0, 0, 1}},
                     .picture_format = GN_MSG_PICTURE_FORMAT_RGB8,
                     .payload_length = (uint32_t)picture->len},
        .result_format = GN_MSG_PICTURE_FORMAT_RGB8,
        .lighting_min_sequence = min_sequence,
        .lighting_wait_ms = wait_ms,
    };
    int64_t now_ns = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
    assert_int_equal(gn_room_put_frame(h->viewer, &frame, picture, now_ns, &error), 0);
    gn_buf_unref(&picture);
}

/* The next result's sequence of light, its picture in out; 0: none within the time. */
static uint64_t take_result(struct house *h, int timeout_ms, uint8_t out[WIDTH * HEIGHT * 3])
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
                memcpy(out, note->payload->data, (size_t)WIDTH * HEIGHT * 3);
            }
            gn_mailbox_recycle(h->mailbox, &note);
        }
    }
    return sequence;
}

static void draw(struct house *h, uint8_t out[WIDTH * HEIGHT * 3])
{
    send_frame(h, h->sequence, 20000);
    assert_int_equal(take_result(h, 20000, out), h->sequence);
}

static int get_difference(const uint8_t *a, const uint8_t *b)
{
    int most = 0;
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++)
        most = abs(a[i] - b[i]) > most ? abs(a[i] - b[i]) : most;
    return most;
}

static void leaves_equal_frames_alone(void **test)
{
    (void)test;
    static uint8_t before[WIDTH * HEIGHT * 3], after[WIDTH * HEIGHT * 3], worked[sizeof(after)];
    struct house lazy, busy;
    build(&lazy, DIFFUSE, 0.004, false);
    build(&busy, DIFFUSE, 0, false);
    light_up(&lazy, 0, 1);
    light_up(&busy, 0, 1);
    draw(&lazy, before);
    light_up(&lazy, 0, 1); // the same bytes in other memory
    draw(&lazy, after);
    assert_memory_equal(before, after, sizeof(after));
    struct gn_room_figures f = get_figures(&lazy);
    assert_int_equal(f.environment_same, 1);
    assert_int_equal(f.light_published, 2);
    assert_true(f.light_capture_ns == lazy.time_ns);
    for (unsigned i = 2; i < 12; i++) { // noise below the bound, in half floats of 0.05 %
        light_up(&lazy, 0.003, i);
        light_up(&busy, 0.003, i);
    }
    draw(&lazy, after);
    draw(&busy, worked);
    assert_int_equal(get_figures(&lazy).environment_same, 11);
    assert_int_equal(get_figures(&busy).environment_same, 0);
    assert_true(get_difference(after, worked) <= 1);
    light_up(&lazy, 0.03, 99);
    assert_int_equal(get_figures(&lazy).environment_same, 11);
    raze(&lazy);
    raze(&busy);
}

static void makes_harmonics_only_for_who_uses_them(void **test)
{
    (void)test;
    static uint8_t without[WIDTH * HEIGHT * 3], with[sizeof(without)];
    struct house h;
    build(&h, DIFFUSE, 0.004, false);
    light_up(&h, 0, 1);
    draw(&h, without);
    struct gn_lighting_state *light = gn_room_get_light(h.room);
    assert_false(light->has_sh);
    assert_true(light->has_lights && light->n_lights > 0);
    gn_lighting_state_unref(&light);
    assert_int_equal(get_figures(&h).light_without_sh, 1);
    assert_int_equal(get_figures(&h).light_without_lights, 0);

    h.subscriber = join(&h, GN_MSG_ROLE_VIEWER, true); // gets the state there is, completed
    bool has_sh = false;
    for (int i = 0; !has_sh && i < 200; i++) {
        struct pollfd wait = {.fd = gn_mailbox_get_fd(h.mailbox), .events = POLLIN};
        assert_int_equal(poll(&wait, 1, 20000), 1);
        for (struct gn_note *note = gn_mailbox_take_all(h.mailbox), *next; note; note = next) {
            next = note->next;
            if (note->type == GN_WIRE_LIGHTING_STATE) {
                assert_int_equal(note->body.lighting_state.sequence, h.sequence);
                assert_true(note->body.lighting_state.sh[0] > 0);
                has_sh = true;
            }
            gn_mailbox_recycle(h.mailbox, &note);
        }
    }
    assert_true(has_sh);
    draw(&h, with);
    assert_memory_equal(without, with, sizeof(with));
    raze(&h);
}

static void makes_lights_only_for_who_uses_them(void **test)
{
    (void)test;
    static uint8_t without[WIDTH * HEIGHT * 3], with[sizeof(without)];
    struct house h;
    build(&h, MIRROR, 0.004, true);
    light_up(&h, 0, 1);
    draw(&h, without);
    assert_int_equal(get_figures(&h).light_without_lights, 1);
    assert_int_equal(get_figures(&h).n_lights, 0);
    struct gn_lighting_state *light = gn_room_get_light(h.room); // somebody looks
    for (int i = 0; !light->has_lights; i++) {
        assert_true(i < 20000);
        gn_lighting_state_unref(&light);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
        light = gn_room_get_light(h.room);
    }
    assert_true(light->n_lights > 0 && light->sequence == h.sequence);
    gn_lighting_state_unref(&light);
    draw(&h, with);
    assert_memory_equal(without, with, sizeof(with));
    raze(&h);
}

/* Who begins or ceases to want more of the light moves nothing of the picture, in the middle of a
 * step that is being followed. */
static void pictures_do_not_show_who_subscribes(void **test)
{
    (void)test;
    static uint8_t alone[WIDTH * HEIGHT * 3], watched[sizeof(alone)], first[sizeof(alone)];
    for (int shading = 0; shading < 2; shading++) {
        struct house a, b;
        build_shaded(&a, DIFFUSE, 0, shading == 1, shading == 1);
        build_shaded(&b, DIFFUSE, 0, shading == 1, shading == 1);
        struct house *const houses[] = {&a, &b};
        for (unsigned i = 0; i < 8; i++) {
            for (int k = 0; k < 2; k++) {
                houses[k]->gain = i < 2 ? 0.3 : 0.45;
                light_up(houses[k], 0, 1);
            }
            if (i == 3)
                b.subscriber = join(&b, GN_MSG_ROLE_VIEWER, true);
            for (int j = 0; i == 3; j++) { // until all of it is made
                struct gn_lighting_state *light = gn_room_get_light(b.room);
                bool is_whole = light->has_sh && light->has_lights;
                gn_lighting_state_unref(&light);
                if (is_whole)
                    break;
                assert_true(j < 20000);
                nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
            }
            if (i == 5)
                gn_room_leave(&b.subscriber);
            draw(&a, alone);
            draw(&b, watched);
            assert_memory_equal(alone, watched, sizeof(alone));
            if (i == 2)
                memcpy(first, alone, sizeof(first));
        }
        assert_true(get_difference(first, alone) > 2); // a step it was
        raze(&a);
        raze(&b);
    }
}

/* A replay that starts again counts from 1: the light of its first run is not what is meant. */
static void waits_for_the_light_of_the_newest_probe(void **test)
{
    (void)test;
    static uint8_t picture[WIDTH * HEIGHT * 3];
    struct house h;
    build(&h, DIFFUSE, 0, false);
    for (unsigned i = 0; i < 5; i++)
        light_up(&h, 0.1, i);
    gn_room_leave(&h.probe);
    h.probe = join(&h, GN_MSG_ROLE_PROBE, false);
    h.sequence = 0;
    light_up(&h, 0.1, 77);
    send_frame(&h, 3, 30000);
    assert_int_equal(take_result(&h, 150, picture), 0); // 5 was the other's
    light_up(&h, 0.1, 78);
    light_up(&h, 0.1, 79);
    assert_int_equal(take_result(&h, 20000, picture), 3);
    raze(&h);
}

/* One whose pixels are bad holds nobody up, and counts from its first good frame. */
static void waits_for_no_probe_that_was_refused(void **test)
{
    (void)test;
    static uint8_t picture[WIDTH * HEIGHT * 3];
    struct house h;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = make_header();
    struct gn_buf *pixels = make_pixels(1, 0, 1);
    build(&h, DIFFUSE, 0, false);
    light_up(&h, 0.1, 1);
    struct gn_room_session *bad = join(&h, GN_MSG_ROLE_PROBE, false);
    frame.sequence = 1;
    frame.pixel_format = GN_MSG_PIXEL_FORMAT_JPEG;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    for (int i = 0; get_figures(&h).environment_refused == 0; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    light_up(&h, 0.1, 2);
    send_frame(&h, 2, 60000);
    assert_int_equal(take_result(&h, 20000, picture), 2);
    frame.sequence = 2;
    frame.pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F16;
    frame.scale = 2;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    for (int i = 0; get_figures(&h).light_published < 3; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    light_up(&h, 0.1, 3);
    send_frame(&h, 3, 60000);
    assert_int_equal(take_result(&h, 150, picture), 0); // 3 is the other's now
    frame.sequence = 3;
    assert_int_equal(gn_room_put_environment(bad, &frame, pixels, &error), 0);
    assert_int_equal(take_result(&h, 20000, picture), 3);
    gn_buf_unref(&pixels);
    gn_room_leave(&bad);
    raze(&h);
}

static void send_picture(struct gn_room_session *screen, uint64_t sequence)
{
    struct gn_buf *pixels;
    struct gn_error error = {0};
    const struct gn_msg_emitter_frame frame = {.stream = "tv",
                                               .sequence = sequence,
                                               .width = 2,
                                               .height = 2,
                                               .pixel_format = GN_MSG_PIXEL_FORMAT_RGB8,
                                               .scale = 1};
    assert_int_equal(gn_buf_create(12, &pixels), 0);
    memset(pixels->data, 200, pixels->len);
    if (gn_room_put_emitter(screen, &frame, pixels, &error) < 0)
        fail_msg("%s", error.text);
    gn_buf_unref(&pixels);
}

static void wait_for_shown(struct house *h, uint64_t n)
{
    for (int i = 0; get_figures(h).emitter_shown < n; i++) {
        assert_true(i < 20000);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
}

/* A picture that waits outlives its screen. */
static void shows_the_last_picture_of_a_screen_that_left(void **test)
{
    (void)test;
    struct house h;
    build(&h, TV, 0, false);
    struct gn_room_session *screen = join(&h, GN_MSG_ROLE_SCREEN, false);
    send_picture(screen, 1);
    wait_for_shown(&h, 1);
    gn_room_leave(&h.viewer); // nobody looks any more
    send_picture(screen, 2);
    send_picture(screen, 3);
    struct gn_room_figures f = get_figures(&h);
    assert_int_equal(f.emitter_superseded, 1);
    assert_int_equal(f.emitter_shown, 1);
    gn_room_leave(&screen);
    h.viewer = join(&h, GN_MSG_ROLE_VIEWER, false);
    wait_for_shown(&h, 2);
    f = get_figures(&h);
    assert_int_equal(f.emitter_shown, 2);
    assert_true(f.n_near > 0);
    // The lamp alone has no age: no environment frame was captured.
    struct gn_msg_statistics statistics;
    gn_room_get_statistics(h.room, &statistics);
    assert_true(f.has_light && !f.has_capture);
    assert_true(statistics.lighting_age_ms < 0);
    assert_int_equal(statistics.sessions, 2);
    screen = join(&h, GN_MSG_ROLE_SCREEN, false);
    gn_room_get_statistics(h.room, &statistics);
    assert_int_equal(statistics.sessions, 3);
    gn_room_leave(&screen);
    raze(&h);
}

/* What subscribers got: the next note of that kind, its session; false: none within the time. */
static bool take_state(struct house *h, uint64_t session_id, struct gn_note *out)
{
    for (;;) {
        while (h->notes) {
            struct gn_note *note = h->notes;
            h->notes = note->next;
            bool is_it = note->type == GN_WIRE_LIGHTING_STATE && note->session_id == session_id;
            *out = *note;
            gn_mailbox_recycle(h->mailbox, &note);
            if (is_it)
                return true;
        }
        struct pollfd wait = {.fd = gn_mailbox_get_fd(h->mailbox), .events = POLLIN};
        if (poll(&wait, 1, 20000) != 1)
            return false;
        h->notes = gn_mailbox_take_all(h->mailbox);
    }
}

static void tells_subscribers_who_came_and_went(void **test)
{
    (void)test;
    struct house h;
    struct gn_note note;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = make_header();
    struct gn_buf *pixels = make_pixels(1, 0, 1);
    build(&h, DIFFUSE, 0, false);
    uint64_t first = h.next_id - 1; // the probe of the house
    h.subscriber = join(&h, GN_MSG_ROLE_VIEWER, true);
    uint64_t listener = h.next_id;
    light_up(&h, 0, 1);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, first);
    assert_false(note.body.lighting_state.gone);
    struct gn_room_session *other = join(&h, GN_MSG_ROLE_PROBE, false);
    uint64_t second = h.next_id;
    frame.sequence = 1;
    assert_int_equal(gn_room_put_environment(other, &frame, pixels, &error), 0);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, second);
    gn_room_leave(&other);
    assert_true(take_state(&h, listener, &note));
    assert_int_equal(note.body.lighting_state.probe, second);
    assert_true(note.body.lighting_state.gone);
    assert_int_equal(note.body.lighting_state.light_count, 0);
    gn_room_leave(&h.probe); // the last one's light stays until another's is there
    h.probe = join(&h, GN_MSG_ROLE_PROBE, false);
    h.sequence = 0;
    light_up(&h, 0, 2);
    bool has_gone = false, has_come = false;
    for (int i = 0; i < 2; i++) {
        assert_true(take_state(&h, listener, &note));
        const struct gn_msg_lighting_state *m = &note.body.lighting_state;
        has_gone = has_gone || (m->gone && m->probe == first);
        has_come = has_come || (!m->gone && m->probe == h.next_id);
    }
    assert_true(has_gone && has_come);
    gn_buf_unref(&pixels);
    raze(&h);
}

/* Whoever joins while a probe's frames keep the light thread busy is told of the others, too. */
static void tells_newcomers_of_all_probes(void **test)
{
    (void)test;
    struct house h;
    struct gn_note note;
    struct gn_error error = {0};
    struct gn_msg_environment_frame frame = make_header();
    struct gn_buf *pixels = make_pixels(1, 0, 1);
    build(&h, DIFFUSE, 0, false);
    uint64_t quiet = h.next_id - 1;
    light_up(&h, 0, 1);
    struct gn_room_session *busy = join(&h, GN_MSG_ROLE_PROBE, false);
    for (int i = 0; i < 30; i++) {
        frame.sequence++;
        frame.scale = 1 + 0.1 * i;
        assert_int_equal(gn_room_put_environment(busy, &frame, pixels, &error), 0);
        nanosleep(&(struct timespec){.tv_nsec = 300000 * (i % 7)}, NULL); // taken, most times
        h.subscriber = join(&h, GN_MSG_ROLE_VIEWER, true);
        uint64_t newcomer = h.next_id;
        do {
            assert_true(take_state(&h, newcomer, &note));
        } while (note.body.lighting_state.probe != quiet);
        gn_room_leave(&h.subscriber);
    }
    gn_buf_unref(&pixels);
    gn_room_leave(&busy);
    raze(&h);
}

static struct gn_environment_job make_job(enum gn_msg_pixel_format format, size_t n_bytes)
{
    struct gn_environment_job job = {.session_id = 1, .frame = make_header()};
    job.frame.pixel_format = format;
    job.frame.response.type = GN_MSG_RESPONSE_TYPE_LOG; // five decades in 12 bits
    job.frame.response.log_a = 0.6;
    job.frame.response.log_b = 0.08;
    assert_int_equal(gn_buf_create(n_bytes, &job.payload), 0);
    memset(job.payload->data, 0, n_bytes);
    return job;
}

static void put_code(struct gn_environment_job *job, unsigned code)
{
    job->payload->data[100] = (uint8_t)code;
    job->payload->data[101] = (uint8_t)(code >> 8);
}

static void knows_how_far_a_code_may_be_off(void **test)
{
    (void)test;
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 6;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    assert_false(gn_worked_frame_is_same(&worked, &old, 0.004)); // nothing was worked on yet
    put_code(&old, 2000);
    gn_worked_frame_keep(&worked, &old);
    static const struct {
        unsigned code;
        double noise;
        bool is_same;
    } cases[] = {{2000, 0, true},     {2001, 0, false},     {2001, 0.004, true},
                 {1999, 0.004, true}, {2002, 0.004, false}, {1998, 0.004, false},
                 {2003, 0.01, true},  {2004, 0.01, false},  {4000, 0.01, false},
                 {2001, 0.002, false}}; // a code is exp(1 / (0.08 4095)): 0.31 %
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        put_code(&now, cases[i].code);
        assert_int_equal(gn_worked_frame_is_same(&worked, &now, cases[i].noise), cases[i].is_same);
    }
    put_code(&now, 2000);
    now.frame.sequence = 7;
    now.frame.capture_time_ns = 8;
    now.frame.exposure_s = 0.01;
    assert_true(gn_worked_frame_is_same(&worked, &now, 0.004));
    now.frame.scale = 1.001;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    now.frame.scale = 1;
    now.session_id = 2;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

static void put_table(struct gn_environment_job *job, float a, float b, float c, unsigned code)
{
    const float table[3] = {a, b, c};
    memcpy(job->payload->data, table, sizeof(table));
    put_code(job, code);
}

/* The table lies in the payload: a header that stays says nothing of it. */
static void forgets_the_bounds_of_another_table(void **test)
{
    (void)test;
    size_t n = sizeof(float[3]) + (size_t)MAP_WIDTH * MAP_HEIGHT * 6;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB12, n);
    old.frame.response = now.frame.response =
        (struct gn_msg_response){.type = GN_MSG_RESPONSE_TYPE_TABLE, .table_entries = 3};
    put_table(&old, 1, 1, 2, 100); // all codes up to the middle mean the same
    put_table(&now, 1, 1, 2, 1800);
    gn_worked_frame_keep(&worked, &old);
    assert_true(gn_worked_frame_is_same(&worked, &now, 0.004));
    put_table(&now, 0, 0.5f, 1, 100);
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.004));
    gn_worked_frame_keep(&worked, &now);
    put_table(&old, 0, 0.5f, 1, 1800);
    assert_false(gn_worked_frame_is_same(&worked, &old, 0.004));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

static void compares_floats_by_share(void **test)
{
    (void)test;
    static const struct {
        float old, now;
        bool is_same;
    } cases[] = {{1, 1.0039f, true},  {1, 0.9961f, true}, {1, 1.0041f, false},
                 {0, 1e-30f, false},  {0, 0, true},       {-1, -1.001f, false},
                 {1, NAN, false},     {NAN, 1, false},    {INFINITY, INFINITY, true},
                 {INFINITY, 1, false}};
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 12;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct gn_worked_frame worked = {0};
        struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB_F32, n);
        struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB_F32, n);
        memcpy(old.payload->data + 400, &cases[i].old, 4);
        memcpy(now.payload->data + 400, &cases[i].now, 4);
        gn_worked_frame_keep(&worked, &old);
        assert_int_equal(gn_worked_frame_is_same(&worked, &now, 0.004), cases[i].is_same);
        gn_worked_frame_finish(&worked);
        gn_buf_unref(&old.payload);
        gn_buf_unref(&now.payload);
    }
}

/* Its codes are too coarse for a share: one of them is 0.4 to 100 % of the light. */
static void compares_bytes_of_rgb8(void **test)
{
    (void)test;
    size_t n = (size_t)MAP_WIDTH * MAP_HEIGHT * 3;
    struct gn_worked_frame worked = {0};
    struct gn_environment_job old = make_job(GN_MSG_PIXEL_FORMAT_RGB8, n);
    struct gn_environment_job now = make_job(GN_MSG_PIXEL_FORMAT_RGB8, n);
    old.payload->data[100] = now.payload->data[100] = 254;
    gn_worked_frame_keep(&worked, &old);
    assert_true(gn_worked_frame_is_same(&worked, &now, 0));
    now.payload->data[100] = 255;
    assert_false(gn_worked_frame_is_same(&worked, &now, 0.1));
    gn_worked_frame_finish(&worked);
    gn_buf_unref(&old.payload);
    gn_buf_unref(&now.payload);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(knows_how_far_a_code_may_be_off),
        cmocka_unit_test(forgets_the_bounds_of_another_table),
        cmocka_unit_test(compares_floats_by_share),
        cmocka_unit_test(compares_bytes_of_rgb8),
        cmocka_unit_test(leaves_equal_frames_alone),
        cmocka_unit_test(makes_harmonics_only_for_who_uses_them),
        cmocka_unit_test(makes_lights_only_for_who_uses_them),
        cmocka_unit_test(pictures_do_not_show_who_subscribes),
        cmocka_unit_test(waits_for_the_light_of_the_newest_probe),
        cmocka_unit_test(waits_for_no_probe_that_was_refused),
        cmocka_unit_test(tells_newcomers_of_all_probes),
        cmocka_unit_test(tells_subscribers_who_came_and_went),
        cmocka_unit_test(shows_the_last_picture_of_a_screen_that_left),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
