/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/conn.h"
#include "tests/unit/wire_samples.h"

static int created_bytes; // of payloads that send_payload() made and that live still

static void count_release(struct gn_buf *buf)
{
    created_bytes -= (int)buf->len;
    free(buf->data);
    free(buf);
}

/** A payload of counting bytes whose end is seen. */
static struct gn_buf *make_payload(size_t len)
{
    struct gn_buf *buf = malloc(sizeof(*buf));
    uint8_t *data = malloc(len ? len : 1);
    assert_true(buf && data);
    for (size_t i = 0; i < len; i++)
        data[i] = (uint8_t)(i * 7 + 1);
    gn_buf_init(buf, data, len, count_release, NULL);
    created_bytes += (int)len;
    return buf;
}

static void assert_payload(const struct gn_buf *buf, size_t len)
{
    assert_int_equal(buf ? buf->len : 0, len);
    for (size_t i = 0; i < len; i++)
        assert_int_equal(buf->data[i], (uint8_t)(i * 7 + 1));
}

static struct gn_conn *make_conn(int fd, enum gn_wire_direction receive, size_t max_queued)
{
    assert_int_equal(fcntl(fd, F_SETFL, O_NONBLOCK), 0);
    struct gn_conn_options opts = {.receive = receive, .fd = fd, .max_queued_bytes = max_queued};
    struct gn_conn *conn;
    assert_int_equal(gn_conn_create(&opts, &conn), 0);
    return conn;
}

static void make_pair(int fds[static 2])
{
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fds), 0);
}

/** The bytes of one message with its payload. Returns their number. */
static size_t make_bytes(enum gn_wire_type type, uint8_t *out, size_t cap)
{
    union gn_wire_message m;
    uint32_t payload_len = sample_message(type, &m);
    size_t len;
    assert_int_equal(gn_wire_encode(type, &m, payload_len, out, cap, &len, NULL), 0);
    assert_true(len + payload_len <= cap);
    for (size_t i = 0; i < payload_len; i++)
        out[len + i] = (uint8_t)(i * 7 + 1);
    return len + payload_len;
}

/** Read one message that must be there whole. */
static void read_whole(struct gn_conn *conn, enum gn_wire_type type)
{
    struct gn_conn_message message;
    union gn_wire_message want, got;
    uint32_t payload_len = sample_message(type, &want);
    assert_int_equal(gn_conn_read(conn, &message), 1);
    assert_int_equal(message.envelope.type, type);
    assert_payload(message.payload, payload_len);
    assert_int_equal(gn_conn_decode(&message, &got, NULL), 0);
    uint8_t a[GN_WIRE_HEAD_BYTES], b[GN_WIRE_HEAD_BYTES];
    size_t a_len, b_len;
    assert_int_equal(gn_wire_encode(type, &want, payload_len, a, sizeof(a), &a_len, NULL), 0);
    assert_int_equal(gn_wire_encode(type, &got, payload_len, b, sizeof(b), &b_len, NULL), 0);
    assert_int_equal(a_len, b_len);
    assert_memory_equal(a, b, a_len);
    gn_buf_unref(&message.payload);
}

static void test_split_at_every_byte(void **state)
{
    (void)state;
    const enum gn_wire_type types[] = {GN_WIRE_FRAME, GN_WIRE_PING, GN_WIRE_ENVIRONMENT_FRAME};
    uint8_t bytes[8192];
    size_t len = 0;
    for (size_t i = 0; i < GN_ARRAY_LEN(types); i++)
        len += make_bytes(types[i], bytes + len, sizeof(bytes) - len);
    for (size_t cut = 1; cut < len; cut++) {
        int fds[2];
        make_pair(fds);
        struct gn_conn *conn = make_conn(fds[0], GN_WIRE_TO_SERVER, 0);
        struct gn_conn_message message;
        size_t got = 0;
        const size_t parts[2] = {cut, len - cut};
        const uint8_t *from = bytes;
        for (int p = 0; p < 2; p++) {
            assert_int_equal(write(fds[1], from, parts[p]), parts[p]);
            from += parts[p];
            int n;
            while ((n = gn_conn_read(conn, &message)) == 1) {
                assert_int_equal(message.envelope.type, types[got++]);
                union gn_wire_message out;
                assert_int_equal(gn_conn_decode(&message, &out, NULL), 0);
                assert_payload(message.payload, message.envelope.payload_bytes);
                gn_buf_unref(&message.payload);
            }
            assert_int_equal(n, 0);
        }
        assert_int_equal(got, GN_ARRAY_LEN(types));
        close(fds[1]);
        assert_int_equal(gn_conn_read(conn, &message), -ENODATA);
        gn_conn_destroy(&conn);
        assert_null(conn);
    }
}

static void test_slow_drip_and_closed_at_every_byte(void **state)
{
    (void)state;
    uint8_t bytes[4096];
    size_t len = make_bytes(GN_WIRE_FRAME, bytes, sizeof(bytes));
    for (size_t stop = 0; stop < len; stop++) {
        int fds[2];
        make_pair(fds);
        struct gn_conn *conn = make_conn(fds[0], GN_WIRE_TO_SERVER, 0);
        struct gn_conn_message message;
        for (size_t i = 0; i < stop; i++) {
            assert_int_equal(write(fds[1], bytes + i, 1), 1);
            assert_int_equal(gn_conn_read(conn, &message), 0);
        }
        close(fds[1]);
        int want = stop == 0 ? -ENODATA : -ECONNRESET;
        assert_int_equal(gn_conn_read(conn, &message), want);
        assert_int_equal(gn_conn_read(conn, &message), want); // and so it stays
        assert_string_not_equal(gn_conn_get_fault(conn), "");
        gn_conn_destroy(&conn);
    }
}

static void test_every_type_arrives(void **state)
{
    (void)state;
    for (size_t row = 0; gn_wire_get_row(row); row++) {
        const struct gn_wire_info *info = gn_wire_get_row(row);
        int fds[2];
        make_pair(fds);
        bool to_server = info->direction & GN_WIRE_TO_SERVER;
        struct gn_conn *from =
            make_conn(fds[1], to_server ? GN_WIRE_TO_CLIENT : GN_WIRE_TO_SERVER, 0);
        struct gn_conn *to =
            make_conn(fds[0], to_server ? GN_WIRE_TO_SERVER : GN_WIRE_TO_CLIENT, 0);
        union gn_wire_message m;
        uint32_t payload_len = sample_message(info->type, &m);
        struct gn_buf *payload = payload_len ? make_payload(payload_len) : NULL;
        struct gn_wire_fault fault;
        assert_int_equal(gn_conn_send(from, info->type, &m, payload, &fault), 0);
        gn_buf_unref(&payload);
        assert_true(gn_conn_get_queued_bytes(from) > payload_len);
        assert_int_equal(gn_conn_flush(from), 1);
        assert_int_equal(gn_conn_get_queued_bytes(from), 0);
        assert_int_equal(created_bytes, 0); // given back once written
        read_whole(to, info->type);
        gn_conn_destroy(&from);
        gn_conn_destroy(&to);
    }
}

/** Feed an envelope; reading must end with want and say something that contains names. */
static void expect_refused(struct gn_envelope envelope, enum gn_wire_direction receive,
                           uint32_t max_payload, int want, enum gn_msg_error_code code,
                           const char *names)
{
    int fds[2];
    make_pair(fds);
    struct gn_conn *conn = make_conn(fds[0], receive, 0);
    gn_conn_set_max_payload(conn, max_payload);
    uint8_t bytes[GN_ENVELOPE_BYTES];
    gn_envelope_encode(&envelope, bytes);
    assert_int_equal(write(fds[1], bytes, sizeof(bytes)), sizeof(bytes));
    struct gn_conn_message message;
    assert_int_equal(gn_conn_read(conn, &message), want);
    assert_non_null(strstr(gn_conn_get_fault(conn), names));
    assert_int_equal(gn_wire_get_error_code(want), code);
    if (want) {
        struct gn_envelope seen = gn_conn_get_envelope(conn);
        assert_memory_equal(&seen, &envelope, sizeof(seen));
        assert_int_equal(gn_conn_read(conn, &message), want);
    }
    gn_conn_destroy(&conn);
    close(fds[1]);
}

static void test_bad_envelopes(void **state)
{
    (void)state;
    const uint32_t any = UINT32_MAX;
    expect_refused((struct gn_envelope){2, 0, GN_WIRE_HELLO, 0, 0, 0}, GN_WIRE_TO_SERVER, any,
                   -EPROTONOSUPPORT, GN_MSG_ERROR_CODE_VERSION, "speaks 1 to 1");
    expect_refused((struct gn_envelope){1, 0, 999, 0, 0, 0}, GN_WIRE_TO_SERVER, any, -ENOMSG,
                   GN_MSG_ERROR_CODE_MALFORMED, "999");
    expect_refused((struct gn_envelope){1, 4, GN_WIRE_PING, 0, 0, 0}, GN_WIRE_TO_SERVER, any,
                   -EPROTO, GN_MSG_ERROR_CODE_MALFORMED, "flags 4");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_RESULT, 0, 0, 0}, GN_WIRE_TO_SERVER, any,
                   -EOPNOTSUPP, GN_MSG_ERROR_CODE_UNEXPECTED, "RESULT");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_FRAME, 0, 0, 0}, GN_WIRE_TO_CLIENT, any,
                   -EOPNOTSUPP, GN_MSG_ERROR_CODE_UNEXPECTED, "FRAME");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_FRAME, 0, UINT32_MAX, 0}, GN_WIRE_TO_SERVER,
                   any, -EMSGSIZE, GN_MSG_ERROR_CODE_TOO_LARGE, "FRAME");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_FRAME, 0, 1, GN_LIMIT_FRAME_BYTES + 1},
                   GN_WIRE_TO_SERVER, any, -EMSGSIZE, GN_MSG_ERROR_CODE_TOO_LARGE, "33554432");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_FRAME, 0, 1, 1001}, GN_WIRE_TO_SERVER, 1000,
                   -EMSGSIZE, GN_MSG_ERROR_CODE_TOO_LARGE, "1000 here");
    expect_refused((struct gn_envelope){1, 0, GN_WIRE_FRAME, 0, 1, 1000}, GN_WIRE_TO_SERVER, 1000,
                   0, GN_MSG_ERROR_CODE_INTERNAL, "");
}

static void test_wrong_magic(void **state)
{
    (void)state;
    int fds[2];
    make_pair(fds);
    struct gn_conn *conn = make_conn(fds[0], GN_WIRE_TO_SERVER, 0);
    assert_int_equal(write(fds[1], "GET / HTTP/1.1\r\nHost: x\r\n", 25), 25);
    struct gn_conn_message message;
    assert_int_equal(gn_conn_read(conn, &message), -EBADMSG);
    assert_int_equal(gn_conn_get_envelope(conn).type, 0);
    gn_conn_destroy(&conn);
    close(fds[1]);
}

static void test_queue_is_bounded(void **state)
{
    (void)state;
    int fds[2];
    make_pair(fds);
    struct gn_conn *conn = make_conn(fds[0], GN_WIRE_TO_CLIENT, 1000);
    union gn_wire_message m = {0};
    m.frame = (struct gn_msg_frame){.id = 1, .views_count = 1};
    m.frame.views[0].picture_format = GN_MSG_PICTURE_FORMAT_JPEG;
    m.frame.views[0].payload_length = 600;
    struct gn_buf *payload = make_payload(600);
    assert_int_equal(gn_conn_send(conn, GN_WIRE_FRAME, &m, payload, NULL), 0);
    size_t queued = gn_conn_get_queued_bytes(conn);
    struct gn_wire_fault fault = {""};
    assert_int_equal(gn_conn_send(conn, GN_WIRE_FRAME, &m, payload, &fault), -ENOBUFS);
    assert_non_null(strstr(fault.text, "wait"));
    assert_int_equal(gn_conn_get_queued_bytes(conn), queued);
    assert_int_equal(gn_conn_get_queued_messages(conn), 1);
    struct gn_buf vast; // its bytes are never looked at
    gn_buf_init(&vast, payload->data, (size_t)UINT32_MAX + 2, count_release, NULL);
    assert_int_equal(gn_conn_send(conn, GN_WIRE_FRAME, &m, &vast, &fault), -EMSGSIZE);
    assert_non_null(strstr(fault.text, "at most 33554432"));
    gn_buf_unref(&payload);
    assert_int_equal(created_bytes, 600);
    gn_conn_destroy(&conn); // gives back what is queued
    assert_int_equal(created_bytes, 0);
    close(fds[1]);

    make_pair(fds);
    conn = make_conn(fds[0], GN_WIRE_TO_CLIENT, 0);
    struct gn_msg_ping ping = {1};
    int sent = 0;
    while (sent < 1000 && gn_conn_send(conn, GN_WIRE_PING, &ping, NULL, NULL) == 0)
        sent++;
    assert_int_equal(sent, 64);
    gn_conn_drop_queued(conn); // none had begun: the stream is still good
    assert_int_equal(gn_conn_send(conn, GN_WIRE_PING, &ping, NULL, NULL), 0);
    gn_conn_destroy(&conn);
    close(fds[1]);
}

static void test_partial_writes(void **state)
{
    (void)state;
    int fds[2], small = 4096;
    make_pair(fds);
    assert_int_equal(setsockopt(fds[0], SOL_SOCKET, SO_SNDBUF, &small, sizeof(small)), 0);
    struct gn_conn *from = make_conn(fds[0], GN_WIRE_TO_CLIENT, 0);
    struct gn_conn *to = make_conn(fds[1], GN_WIRE_TO_SERVER, 0);
    union gn_wire_message m = {0};
    const uint32_t len = 2500001; // more than one call reads
    for (uint64_t id = 1; id <= 3; id++) {
        m.frame = (struct gn_msg_frame){.id = id, .views_count = 1};
        m.frame.views[0].picture_format = GN_MSG_PICTURE_FORMAT_JPEG;
        m.frame.views[0].payload_length = len;
        struct gn_buf *payload = make_payload(len);
        assert_int_equal(gn_conn_send(from, GN_WIRE_FRAME, &m, payload, NULL), 0);
        gn_buf_unref(&payload);
    }
    assert_int_equal(gn_conn_flush(from), 0);
    uint64_t got = 0;
    for (int turns = 0; got < 3; turns++) {
        assert_true(turns < 1000000);
        assert_true(gn_conn_flush(from) >= 0);
        struct gn_conn_message message;
        int n = gn_conn_read(to, &message);
        assert_true(n >= 0);
        if (n == 0)
            continue;
        union gn_wire_message out;
        assert_int_equal(gn_conn_decode(&message, &out, NULL), 0);
        assert_int_equal(out.frame.id, ++got);
        assert_payload(message.payload, len);
        gn_buf_unref(&message.payload);
    }
    assert_int_equal(created_bytes, 0);
    assert_int_equal(gn_conn_get_queued_messages(from), 0);

    // A message given up half way tears the stream.
    struct gn_buf *payload = make_payload(len);
    assert_int_equal(gn_conn_send(from, GN_WIRE_FRAME, &m, payload, NULL), 0);
    gn_buf_unref(&payload);
    assert_int_equal(gn_conn_flush(from), 0);
    gn_conn_drop_queued(from);
    assert_int_equal(created_bytes, 0);
    assert_int_equal(gn_conn_send(from, GN_WIRE_PING, &(struct gn_msg_ping){1}, NULL, NULL),
                     -EPIPE);
    gn_conn_destroy(&from);
    gn_conn_destroy(&to);
}

static void test_peer_gone_while_writing(void **state)
{
    (void)state;
    int fds[2];
    make_pair(fds);
    struct gn_conn *conn = make_conn(fds[0], GN_WIRE_TO_CLIENT, 0);
    close(fds[1]);
    assert_int_equal(gn_conn_send(conn, GN_WIRE_PING, &(struct gn_msg_ping){1}, NULL, NULL), 0);
    assert_int_equal(gn_conn_flush(conn), -EPIPE); // and no signal
    gn_conn_destroy(&conn);
}

/** What a stream says of itself, TLS for one, may be any errno: also those of bad envelopes. */
static ssize_t failing_read(void *ctx, void *buf, size_t len)
{
    (void)buf;
    (void)len;
    return *(const int *)ctx;
}

static void nothing_to_close(void *ctx)
{
    (void)ctx;
}

static void test_errors_of_the_stream(void **state)
{
    (void)state;
    const struct gn_conn_io table = {.read = failing_read, .close = nothing_to_close};
    int errors[] = {-EMSGSIZE, -EPROTO, -EBADMSG, -EOPNOTSUPP, -ECONNRESET, -EIO};
    for (size_t i = 0; i < GN_ARRAY_LEN(errors); i++) {
        struct gn_conn_options opts = {
            .receive = GN_WIRE_TO_SERVER, .io = &table, .io_ctx = &errors[i]};
        struct gn_conn *conn;
        struct gn_conn_message message;
        char want[96];
        snprintf(want, sizeof(want), "cannot read: %s", strerror(-errors[i]));
        assert_int_equal(gn_conn_create(&opts, &conn), 0);
        assert_int_equal(gn_conn_read(conn, &message), errors[i]);
        assert_string_equal(gn_conn_get_fault(conn), want);
        gn_conn_destroy(&conn);
    }
}

struct counting_io {
    size_t given; // bytes asked of us so far
    size_t largest;
    bool closed;
};

static ssize_t counting_read(void *ctx, void *buf, size_t len)
{
    struct counting_io *io = ctx;
    memset(buf, 0, len);
    io->given += len;
    if (len > io->largest)
        io->largest = len;
    if (io->given == GN_ENVELOPE_BYTES) {
        // An endless environment frame.
        gn_envelope_encode(&(struct gn_envelope){1, 0, GN_WIRE_ENVIRONMENT_FRAME, 0, 0, 64u << 20},
                           buf);
    }
    return (ssize_t)len;
}

static ssize_t counting_writev(void *ctx, const struct iovec *iov, int count)
{
    (void)ctx;
    (void)iov;
    (void)count;
    return -EAGAIN;
}

static void counting_close(void *ctx)
{
    ((struct counting_io *)ctx)->closed = true;
}

static void test_another_io_and_a_turns_share(void **state)
{
    (void)state;
    struct counting_io io = {0};
    const struct gn_conn_io table = {counting_read, counting_writev, counting_close};
    struct gn_conn_options opts = {.receive = GN_WIRE_TO_SERVER, .io = &table, .io_ctx = &io};
    struct gn_conn *conn;
    assert_int_equal(gn_conn_create(&opts, &conn), 0);
    assert_int_equal(gn_conn_get_fd(conn), -1);
    struct gn_conn_message message;
    assert_int_equal(gn_conn_read(conn, &message), 0);
    assert_int_equal(io.given, GN_CONN_READ_BYTES); // though more was there
    assert_int_equal(gn_conn_send(conn, GN_WIRE_PING, &(struct gn_msg_ping){1}, NULL, NULL), 0);
    assert_int_equal(gn_conn_flush(conn), 0);
    gn_conn_destroy(&conn);
    assert_true(io.closed);
    opts.receive = GN_WIRE_BOTH_WAYS;
    assert_int_equal(gn_conn_create(&opts, &conn), -EINVAL);
    assert_null(conn);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_split_at_every_byte),
        cmocka_unit_test(test_slow_drip_and_closed_at_every_byte),
        cmocka_unit_test(test_every_type_arrives),
        cmocka_unit_test(test_bad_envelopes),
        cmocka_unit_test(test_wrong_magic),
        cmocka_unit_test(test_queue_is_bounded),
        cmocka_unit_test(test_partial_writes),
        cmocka_unit_test(test_peer_gone_while_writing),
        cmocka_unit_test(test_errors_of_the_stream),
        cmocka_unit_test(test_another_io_and_a_turns_share),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
