/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* libgnomon against a server of few lines in a thread, on a loopback socket. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

#include <cmocka.h>
#include <errno.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <unistd.h>

#include "client/lib/gnomon.h"
#include "common/clock.h"
#include "common/conn.h"
#include "tests/unit/wire_samples.h"

#define SERVER_AHEAD_NS (5 * GN_NS_PER_S)

/** What the server does after HELLO. */
enum script { SCRIPT_SERVE, SCRIPT_REDIRECT, SCRIPT_ERROR, SCRIPT_SILENT, SCRIPT_GARBAGE };

struct server {
    enum script script;
    int listener;
    uint16_t port;
    struct gn_msg_redirect redirect;         // for SCRIPT_REDIRECT
    struct gn_msg_error error;               // for SCRIPT_ERROR
    struct gn_msg_welcome welcome;           // for SCRIPT_SERVE
    struct gn_msg_hello hello;               // owner: server's thread until joined
    atomic_llong ahead_ns;                   // atomic: of its clock
    atomic_bool is_busy;                     // atomic: PINGs wait until a CAMERA comes
    atomic_int seen[GN_WIRE_STATISTICS + 1]; // atomic: messages of each type that came
    size_t frame_bytes;                      // owner: server's thread until joined
    pthread_t thread;
};

/** Next message by blocking reads; false at the end. */
static bool next(struct gn_conn *conn, struct gn_conn_message *message, union gn_wire_message *out)
{
    int n;
    do
        n = gn_conn_read(conn, message);
    while (n == 0);
    return n == 1 && gn_conn_decode(message, out, NULL) == 0;
}

static void answer(struct gn_conn *conn, enum gn_wire_type type, const void *msg,
                   struct gn_buf *payload)
{
    if (gn_conn_send(conn, type, msg, payload, NULL) != 0 || gn_conn_flush(conn) < 0)
        abort();
}

/** A frame comes back as the picture that was sent. */
static void answer_frame(struct gn_conn *conn, const struct gn_msg_frame *frame,
                         struct gn_buf *picture)
{
    if (frame->views_count != 1 || !picture) {
        struct gn_msg_dropped dropped = {frame->id, GN_MSG_DROP_REASON_BAD_FRAME,
                                         "one view, please"};
        answer(conn, GN_WIRE_DROPPED, &dropped, NULL);
        return;
    }
    struct gn_msg_result result = {.id = frame->id, .capture_time_ns = frame->capture_time_ns};
    result.views_count = 1;
    result.views[0] = (struct gn_msg_result_view){GN_MSG_PICTURE_FORMAT_RGB8, 4, 2, 0, 24};
    answer(conn, GN_WIRE_RESULT, &result, picture);
}

static void answer_ping(struct server *s, struct gn_conn *conn, int64_t t1_ns)
{
    int64_t now = gn_clock_get_monotonic_ns() + atomic_load(&s->ahead_ns);
    int64_t wrong = now + GN_NS_PER_S; // to a PING that never was: no sample
    answer(conn, GN_WIRE_PONG, &(struct gn_msg_pong){t1_ns - 1, wrong, wrong}, NULL);
    answer(conn, GN_WIRE_PONG, &(struct gn_msg_pong){t1_ns, now, now}, NULL);
}

static void serve(struct server *s, struct gn_conn *conn)
{
    struct gn_conn_message message;
    union gn_wire_message m;
    int64_t waiting_ns = 0; // t1 of a PING that waits; 0: none
    answer(conn, GN_WIRE_WELCOME, &s->welcome, NULL);
    while (next(conn, &message, &m)) {
        atomic_fetch_add(&s->seen[message.envelope.type], 1);
        if (message.envelope.type == GN_WIRE_PING) {
            // An event before the answer, which the client has to keep.
            struct gn_msg_statistics statistics = {.sessions = 3};
            if (s->hello.want_statistics)
                answer(conn, GN_WIRE_STATISTICS, &statistics, NULL);
            if (atomic_load(&s->is_busy))
                waiting_ns = m.ping.t1_ns;
            else
                answer_ping(s, conn, m.ping.t1_ns);
        } else if (message.envelope.type == GN_WIRE_CAMERA && waiting_ns) {
            answer_ping(s, conn, waiting_ns);
            waiting_ns = 0;
        } else if (message.envelope.type == GN_WIRE_ENVIRONMENT_FRAME) {
            answer(conn, GN_WIRE_PING, &(struct gn_msg_ping){77}, NULL);
        } else if (message.envelope.type == GN_WIRE_FRAME) {
            s->frame_bytes = message.payload ? message.payload->len : 0;
            answer_frame(conn, &m.frame, message.payload);
        }
        gn_buf_unref(&message.payload);
        if (message.envelope.type == GN_WIRE_BYE)
            return;
    }
}

static void *run_server(void *arg)
{
    struct server *s = arg;
    int fd = accept(s->listener, NULL, NULL);
    if (fd < 0)
        return NULL;
    struct gn_conn_options opts = {.receive = GN_WIRE_TO_SERVER, .fd = fd};
    struct gn_conn *conn;
    struct gn_conn_message message;
    union gn_wire_message m;
    if (gn_conn_create(&opts, &conn) != 0)
        abort();
    if (next(conn, &message, &m) && message.envelope.type == GN_WIRE_HELLO) {
        s->hello = m.hello;
        if (s->script == SCRIPT_SERVE)
            serve(s, conn);
        else if (s->script == SCRIPT_REDIRECT)
            answer(conn, GN_WIRE_REDIRECT, &s->redirect, NULL);
        else if (s->script == SCRIPT_ERROR)
            answer(conn, GN_WIRE_ERROR, &s->error, NULL);
        else if (s->script == SCRIPT_GARBAGE && send(fd, "HTTP/1.1 400 Bad Request\r\n", 26, 0) < 0)
            abort();
        else
            while (next(conn, &message, &m)) // until the client gives up
                gn_buf_unref(&message.payload);
    }
    gn_conn_destroy(&conn);
    return NULL;
}

static void start_server(struct server *s, enum script script)
{
    memset(s, 0, sizeof(*s));
    s->script = script;
    atomic_store(&s->ahead_ns, SERVER_AHEAD_NS);
    s->welcome =
        (struct gn_msg_welcome){.version = 1, .session_id = 42, .max_frames_outstanding = 1};
    s->listener = socket(AF_INET, SOCK_STREAM, 0);
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t len = sizeof(address);
    assert_true(s->listener >= 0);
    assert_int_equal(bind(s->listener, (struct sockaddr *)&address, len), 0);
    assert_int_equal(listen(s->listener, 1), 0);
    assert_int_equal(getsockname(s->listener, (struct sockaddr *)&address, &len), 0);
    s->port = ntohs(address.sin_port);
}

static void run(struct server *s)
{
    assert_int_equal(pthread_create(&s->thread, NULL, run_server, s), 0);
}

static void stop_server(struct server *s)
{
    assert_int_equal(pthread_join(s->thread, NULL), 0);
    close(s->listener);
}

static struct gn_client_options viewer(const struct server *s)
{
    return (struct gn_client_options){
        .port = s->port, .role = GN_MSG_ROLE_VIEWER, .room = "lab", .token = "secret"};
}

/** Connecting must fail with want and a line that contains words. */
static void expect_no(const struct gn_client_options *opts, int want, const char *words)
{
    struct gn_client *client = (struct gn_client *)&client;
    struct gn_wire_fault why = {""};
    assert_int_equal(gn_client_connect(opts, &client, &why), want);
    assert_null(client);
    if (!strstr(why.text, words))
        fail_msg("'%s' has no '%s'", why.text, words);
}

/** Connecting must fail with want and just this line. */
static void expect_only(const struct gn_client_options *opts, int want, const char *line)
{
    struct gn_client *client = NULL;
    struct gn_wire_fault why = {""};
    assert_int_equal(gn_client_connect(opts, &client, &why), want);
    assert_string_equal(why.text, line);
}

static void send_and_receive(struct gn_client *client, struct server *s)
{
    (void)s;
    uint8_t picture[24];
    for (int i = 0; i < 24; i++)
        picture[i] = (uint8_t)(i * 9);
    struct gn_msg_frame frame = {.id = 5, .capture_time_ns = 99, .views_count = 1};
    frame.views[0].picture_format = GN_MSG_PICTURE_FORMAT_RGB8;
    frame.views[0].payload_length = 24;
    assert_int_equal(gn_client_send_frame(client, &frame, picture, sizeof(picture)), 0);
    struct gn_client_event event;
    assert_int_equal(gn_client_poll(client, 5000, &event), 1);
    assert_int_equal(event.type, GN_WIRE_RESULT);
    assert_int_equal(event.message.result.id, 5);
    assert_int_equal(event.message.result.capture_time_ns, 99);
    assert_int_equal(event.payload_bytes, 24);
    assert_memory_equal(event.payload, picture, 24);

    frame.id = 6;
    frame.views[0] = (struct gn_msg_frame_view){0};
    assert_int_equal(gn_client_send_frame(client, &frame, NULL, 0), 0);
    assert_int_equal(gn_client_poll(client, 5000, &event), 1);
    assert_int_equal(event.type, GN_WIRE_DROPPED);
    assert_int_equal(event.message.dropped.id, 6);
    assert_null(event.payload);
}

static void test_session(void **state)
{
    (void)state;
    struct server s;
    start_server(&s, SCRIPT_SERVE);
    run(&s);
    struct gn_client_options opts = viewer(&s);
    opts.want_statistics = true;
    opts.resume_token = (const uint8_t *)"resume";
    opts.resume_token_bytes = 6;
    struct gn_client *client;
    struct gn_wire_fault why = {""};
    assert_int_equal(gn_client_connect(&opts, &client, &why), 0);
    assert_int_equal(gn_client_get_welcome(client)->session_id, 42);

    assert_int_equal(gn_client_sync_clock(client, 4, 5000), 0);
    int64_t error = gn_client_get_clock_offset_ns(client) - SERVER_AHEAD_NS;
    int64_t trip = gn_client_get_round_trip_ns(client);
    assert_true(trip >= 0 && llabs(error) <= trip / 2 + 1);
    assert_int_equal(gn_client_to_server_ns(client, 1000),
                     1000 + gn_client_get_clock_offset_ns(client));
    struct gn_client_event event;
    for (int i = 0; i < 4; i++) { // that came between, none lost
        assert_int_equal(gn_client_poll(client, 0, &event), 1);
        assert_int_equal(event.type, GN_WIRE_STATISTICS);
        assert_int_equal(event.message.statistics.sessions, 3);
    }
    assert_int_equal(gn_client_poll(client, 0, &event), 0);
    int64_t before = gn_client_now_ns();
    assert_int_equal(gn_client_poll(client, 30, &event), 0);
    assert_true(gn_client_now_ns() - before >= 30 * GN_NS_PER_MS);

    // A bad value is refused here and costs nothing.
    struct gn_msg_camera camera = {.width = 4, .height = 2, .fx = NAN, .fy = 1};
    assert_int_equal(gn_client_send_camera(client, &camera), -EDOM);
    assert_non_null(strstr(gn_client_get_fault(client), "CAMERA.fx"));
    camera.fx = 1;
    assert_int_equal(gn_client_send_camera(client, &camera), 0);
    union gn_wire_message pose;
    sample_message(GN_WIRE_POSE, &pose);
    assert_int_equal(gn_client_send_pose(client, &pose.pose), 0);
    union gn_wire_message environment;
    uint8_t pixels[128] = {0};
    uint32_t len = sample_message(GN_WIRE_ENVIRONMENT_FRAME, &environment);
    assert_int_equal(
        gn_client_send_environment(client, &environment.environment_frame, pixels, len), 0);
    send_and_receive(client, &s); // and the server's PING is answered meanwhile
    assert_int_equal(gn_client_bye(client, GN_MSG_BYE_REASON_DONE), 0);
    assert_int_equal(gn_client_poll(client, 5000, &event), -ENODATA);
    assert_int_equal(gn_client_send_pose(client, &pose.pose), -ENODATA); // it stays lost
    gn_client_destroy(&client);
    assert_null(client);
    stop_server(&s);

    assert_int_equal(s.hello.role, GN_MSG_ROLE_VIEWER);
    assert_string_equal(s.hello.room, "lab");
    assert_string_equal(s.hello.token, "secret");
    assert_memory_equal(s.hello.resume_token.bytes, "resume", 6);
    assert_true(s.hello.want_statistics && !s.hello.want_lighting_states);
    assert_int_equal(s.seen[GN_WIRE_PING], 4);
    assert_int_equal(s.seen[GN_WIRE_PONG], 1);
    assert_int_equal(s.seen[GN_WIRE_CAMERA], 1);
    assert_int_equal(s.seen[GN_WIRE_POSE], 1);
    assert_int_equal(s.seen[GN_WIRE_ENVIRONMENT_FRAME], 1);
    assert_int_equal(s.seen[GN_WIRE_BYE], 1);
}

/* A server that does not answer is not waited for: the clock stays as it was, all else goes on. */
static void test_clock_is_measured_meanwhile(void **state)
{
    (void)state;
    struct server s;
    start_server(&s, SCRIPT_SERVE);
    run(&s);
    struct gn_client_options opts = viewer(&s);
    struct gn_client *client;
    struct gn_client_event event;
    assert_int_equal(gn_client_connect(&opts, &client, NULL), 0);
    assert_int_equal(gn_client_sync_clock(client, 4, 5000), 0);
    int64_t before_ns = gn_client_get_clock_offset_ns(client);
    int64_t ahead_ns = SERVER_AHEAD_NS + GN_NS_PER_S;
    atomic_store(&s.ahead_ns, ahead_ns);
    atomic_store(&s.is_busy, true);
    assert_int_equal(gn_client_begin_clock_sync(client, 65), -EINVAL);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(gn_client_begin_clock_sync(client, 3), 0);
        send_and_receive(client, &s);
        assert_int_equal(s.seen[GN_WIRE_PING], 5); // the one that waits
        assert_int_equal(gn_client_get_clock_offset_ns(client), before_ns);
    }
    atomic_store(&s.is_busy, false);
    struct gn_msg_camera camera = {.width = 4, .height = 2, .fx = 1, .fy = 1};
    assert_int_equal(gn_client_send_camera(client, &camera), 0);
    for (int i = 0; i < 250 && gn_client_get_clock_offset_ns(client) == before_ns; i++)
        assert_int_equal(gn_client_poll(client, 20, &event), 0);
    assert_int_equal(s.seen[GN_WIRE_PING], 7); // and two more
    int64_t trip_ns = gn_client_get_round_trip_ns(client);
    assert_true(llabs(gn_client_get_clock_offset_ns(client) - ahead_ns) <= trip_ns / 2 + 1);

    // What is under way does not hinder one that waits; nor does one that failed what comes later.
    atomic_store(&s.is_busy, true);
    assert_int_equal(gn_client_begin_clock_sync(client, 3), 0);
    assert_int_equal(gn_client_sync_clock(client, 4, 30), -ETIMEDOUT);
    atomic_store(&s.is_busy, false);
    atomic_store(&s.ahead_ns, SERVER_AHEAD_NS);
    assert_int_equal(gn_client_sync_clock(client, 4, 5000), 0);
    trip_ns = gn_client_get_round_trip_ns(client);
    assert_true(llabs(gn_client_get_clock_offset_ns(client) - SERVER_AHEAD_NS) <= trip_ns / 2 + 1);
    assert_int_equal(gn_client_bye(client, GN_MSG_BYE_REASON_DONE), 0);
    gn_client_destroy(&client);
    stop_server(&s);
}

static void test_redirect_is_followed_once(void **state)
{
    (void)state;
    struct server first, second;
    start_server(&first, SCRIPT_REDIRECT);
    start_server(&second, SCRIPT_SERVE);
    first.redirect = (struct gn_msg_redirect){"127.0.0.1", second.port, {3, {1, 2, 3}}};
    run(&first);
    run(&second);
    struct gn_client_options opts = viewer(&first);
    struct gn_client *client;
    assert_int_equal(gn_client_connect(&opts, &client, NULL), 0);
    gn_client_destroy(&client);
    stop_server(&first);
    stop_server(&second);
    assert_int_equal(first.hello.ticket.size, 0);
    assert_int_equal(second.hello.ticket.size, 3);
    assert_int_equal(second.hello.ticket.bytes[2], 3);
    assert_string_equal(second.hello.room, "lab");

    start_server(&first, SCRIPT_REDIRECT);
    start_server(&second, SCRIPT_REDIRECT);
    first.redirect = (struct gn_msg_redirect){"127.0.0.1", second.port, {0}};
    second.redirect = (struct gn_msg_redirect){"third.example", 1, {0}};
    run(&first);
    run(&second);
    opts = viewer(&first);
    expect_no(&opts, -ELOOP, "third.example");
    stop_server(&first);
    stop_server(&second);
}

static void test_refusals(void **state)
{
    (void)state;
    struct server s;
    start_server(&s, SCRIPT_ERROR);
    s.error = (struct gn_msg_error){
        .code = GN_MSG_ERROR_CODE_VERSION, .version_min = 3, .version_max = 4};
    run(&s);
    struct gn_client_options opts = viewer(&s);
    expect_no(&opts, -EPROTONOSUPPORT, "3 to 4, this client 1 to 1");
    stop_server(&s);

    start_server(&s, SCRIPT_ERROR);
    s.error = (struct gn_msg_error){.code = GN_MSG_ERROR_CODE_NO_SUCH_ROOM};
    strcpy(s.error.sentence, "there is 'hall' and 'lab2'");
    run(&s);
    opts = viewer(&s);
    expect_only(&opts, -EACCES, "there is 'hall' and 'lab2'"); // its reason once
    stop_server(&s);

    start_server(&s, SCRIPT_ERROR);
    s.error = (struct gn_msg_error){.code = GN_MSG_ERROR_CODE_NO_SUCH_ROOM};
    run(&s);
    opts = viewer(&s);
    expect_only(&opts, -EACCES, "the server has no room of this name");
    stop_server(&s);

    start_server(&s, SCRIPT_GARBAGE);
    run(&s);
    opts = viewer(&s);
    expect_no(&opts, -EPROTO, "not this protocol");
    stop_server(&s);

    start_server(&s, SCRIPT_SILENT);
    run(&s);
    opts = viewer(&s);
    opts.timeout_ms = 50;
    expect_no(&opts, -ETIMEDOUT, "no answer to HELLO within 50 ms");
    stop_server(&s);
}

static void test_nobody_there(void **state)
{
    (void)state;
    struct server s;
    start_server(&s, SCRIPT_SILENT);
    close(s.listener);
    struct gn_client_options opts = viewer(&s);
    expect_no(&opts, -ECONNREFUSED, "127.0.0.1 port");
    opts.host = "name.invalid";
    expect_no(&opts, -EHOSTUNREACH, "name.invalid");
    opts.role = 0;
    expect_no(&opts, -EINVAL, "role 0");
    opts = viewer(&s);
    char room[100];
    memset(room, 'r', sizeof(room));
    room[99] = 0;
    opts.room = room;
    expect_no(&opts, -EINVAL, "too long");
}

static void test_keepalive(void **state)
{
    (void)state;
    struct server s;
    start_server(&s, SCRIPT_SERVE);
    s.welcome.idle_timeout_ms = 60;
    run(&s);
    struct gn_client_options opts = viewer(&s);
    struct gn_client *client;
    assert_int_equal(gn_client_connect(&opts, &client, NULL), 0);
    struct gn_client_event event;
    assert_int_equal(gn_client_poll(client, 200, &event), 0);
    assert_true(atomic_load(&s.seen[GN_WIRE_PING]) >= 2);
    gn_client_destroy(&client);
    stop_server(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_session),
        cmocka_unit_test(test_clock_is_measured_meanwhile),
        cmocka_unit_test(test_redirect_is_followed_once),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_nobody_there),
        cmocka_unit_test(test_keepalive),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
