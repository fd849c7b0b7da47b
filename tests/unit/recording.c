/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Recordings: what was written is read, whoever wrote beside it, was killed, or bent the file. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "client/recording/format.h"
#include "client/recording/index.h"
#include "client/recording/recording.h"
#include "common/clock.h"
#include "common/file.h"
#include "tests/folder.h"
#include "tests/sanitized.h"
#include "tests/unit/cmocka_setup.h"

#define MAX_RECORDS 64
#define MAX_BODY 200

/** What a test compares: the records of a file. */
struct listing {
    int n;
    struct {
        uint16_t kind;
        uint32_t stream;
        uint32_t bytes;
        uint8_t body[MAX_BODY];
    } records[MAX_RECORDS];
    struct gn_recording_damage damage;
};

static char path[128];

static int set_up(void **state)
{
    (void)state;
    if (gn_test_folder_create() != 0)
        return -1;
    snprintf(path, sizeof(path), "%s", gn_test_folder_get_path("r.gnr"));
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    return gn_test_folder_remove((const char *[]){"r.gnr"}, 1);
}

static struct gn_recording_writer *open_writer(uint64_t max_bytes)
{
    struct gn_recording_writer *writer = NULL;
    struct gn_error error = {0};
    if (gn_recording_writer_open(path, max_bytes, &writer, &error) != 0)
        fail_msg("%s", error.text);
    return writer;
}

static int put(struct gn_recording_writer *writer, enum gn_recording_kind kind, const void *body,
               size_t n)
{
    // In two parts, as a message's head and payload are.
    const struct gn_recording_part parts[2] = {{body, n / 2},
                                               {(const uint8_t *)body + n / 2, n - n / 2}};
    struct gn_error error = {0};
    int err = gn_recording_writer_put(writer, kind, gn_clock_get_monotonic_ns(), parts, 2, &error);
    assert_true((err != 0) == (error.text[0] != 0));
    return err;
}

static void put_text(struct gn_recording_writer *writer, const char *text)
{
    assert_int_equal(put(writer, GN_RECORDING_SENT, text, strlen(text)), 0);
}

/** Two streams of one file, in turn. */
static void write_sample(void)
{
    unlink(path);
    struct gn_recording_writer *a = open_writer(0), *b = open_writer(0);
    assert_int_equal(put(a, GN_RECORDING_STREAM, "hello a", 7), 0);
    assert_int_equal(put(b, GN_RECORDING_STREAM, "hello b", 7), 0);
    put_text(a, "first");
    put_text(b, "");
    put_text(b, "\xf3rec: not a head");
    put_text(a, "last of a, and of all");
    assert_int_equal(gn_recording_writer_get_stream(a), 1);
    assert_int_equal(gn_recording_writer_get_stream(b), 2);
    gn_recording_writer_close(&a);
    gn_recording_writer_close(&b);
    assert_null(a);
}

/** Reads what is there. Returns 0, or the errno of opening, with a sentence. */
static int list(struct listing *out)
{
    struct gn_recording_reader *reader = NULL;
    struct gn_error error = {0};
    struct gn_recording_record record;
    memset(out, 0, sizeof(*out));
    int err = gn_recording_reader_open(path, &reader, &error);
    if (err) {
        assert_null(reader);
        assert_true(strncmp(error.text, path, strlen(path)) == 0);
        return err;
    }
    int got;
    int64_t last_ns = 0;
    while ((got = gn_recording_reader_next(reader, &record, &error)) > 0) {
        assert_true(out->n < MAX_RECORDS && record.bytes <= MAX_BODY);
        assert_true(record.time_ns >= last_ns);
        last_ns = record.time_ns;
        out->records[out->n].kind = record.kind;
        out->records[out->n].stream = record.stream;
        out->records[out->n].bytes = record.bytes;
        if (record.bytes)
            memcpy(out->records[out->n].body, record.body, record.bytes);
        uint8_t again[MAX_BODY];
        assert_int_equal(
            gn_recording_reader_load(reader, record.offset, record.bytes, again, &error), 0);
        assert_memory_equal(again, out->records[out->n].body, record.bytes);
        out->n++;
    }
    assert_int_equal(got, 0);
    out->damage = gn_recording_reader_get_damage(reader);
    gn_recording_reader_close(&reader);
    return 0;
}

static bool is_whole(const struct listing *l)
{
    const struct gn_recording_damage none = {0};
    return memcmp(&l->damage, &none, sizeof(none)) == 0;
}

static bool is_text(const struct listing *l, int i, uint32_t stream, const char *text)
{
    return i < l->n && l->records[i].stream == stream && l->records[i].bytes == strlen(text) &&
           memcmp(l->records[i].body, text, strlen(text)) == 0;
}

static uint8_t *read_file(size_t *n)
{
    uint8_t *data = NULL;
    struct gn_error error = {0};
    if (gn_file_read(path, 1 << 24, &data, n, &error) != 0)
        fail_msg("%s", error.text);
    return data;
}

static void write_file(const void *data, size_t n)
{
    gn_test_folder_write("r.gnr", data, n);
}

static void test_round_trip(void **state)
{
    (void)state;
    struct listing l;
    write_sample();
    assert_int_equal(list(&l), 0);
    assert_int_equal(l.n, 6);
    assert_true(is_whole(&l));
    assert_true(is_text(&l, 0, 1, "hello a") && l.records[0].kind == GN_RECORDING_STREAM);
    assert_true(is_text(&l, 1, 2, "hello b") && l.records[1].kind == GN_RECORDING_STREAM);
    assert_true(is_text(&l, 2, 1, "first") && l.records[2].kind == GN_RECORDING_SENT);
    assert_true(is_text(&l, 3, 2, ""));
    assert_true(is_text(&l, 4, 2, "\xf3rec: not a head"));
    assert_true(is_text(&l, 5, 1, "last of a, and of all"));
}

/* Cut anywhere, a file gives all records that are whole in it, and says that something is missing.
 */
static void test_cut(void **state)
{
    (void)state;
    struct listing all, l;
    size_t n = 0;
    write_sample();
    assert_int_equal(list(&all), 0);
    uint8_t *data = read_file(&n);
    for (size_t cut = 0; cut < n; cut++) {
        write_file(data, cut);
        if (cut < GN_RECORDING_HEADER_BYTES) {
            assert_int_equal(list(&l), -EBADMSG);
            continue;
        }
        assert_int_equal(list(&l), 0);
        size_t at = GN_RECORDING_HEADER_BYTES;
        int n_whole = 0;
        for (; n_whole < all.n; n_whole++) {
            at += GN_RECORDING_HEAD_BYTES + all.records[n_whole].bytes;
            if (at > cut)
                break;
        }
        assert_int_equal(l.n, n_whole);
        assert_memory_equal(l.records, all.records, (size_t)n_whole * sizeof(l.records[0]));
        assert_true(l.damage.missing_bytes == n - cut);
        assert_int_equal(l.damage.n_damaged, 0);
    }
    free(data);
}

/* No flipped bit gives a record that nobody wrote, and none goes unseen. */
static void test_flipped_bits(void **state)
{
    (void)state;
    struct listing all, l;
    size_t n = 0;
    write_sample();
    assert_int_equal(list(&all), 0);
    uint8_t *data = read_file(&n);
    for (size_t bit = 0; bit < 8 * n; bit++) {
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        write_file(data, n);
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        int err = list(&l);
        if (bit / 8 < GN_RECORDING_STATE_OFFSET) {
            assert_int_equal(err, -EBADMSG);
            continue;
        }
        assert_int_equal(err, 0);
        bool is_state = bit / 8 < GN_RECORDING_STATE_OFFSET + GN_RECORDING_STATE_BYTES;
        bool is_spare = bit / 8 < GN_RECORDING_HEADER_BYTES && !is_state;
        assert_int_equal(l.n, is_state || is_spare ? all.n : all.n - 1);
        assert_int_equal(is_whole(&l), is_spare);
        int k = 0;
        for (int i = 0; i < l.n; i++, k++) {
            while (k < all.n && memcmp(&l.records[i], &all.records[k], sizeof(l.records[0])) != 0)
                k++;
            assert_true(k < all.n);
        }
    }
    free(data);
}

/** A file of one record with this head and body. */
static void write_head(const struct gn_recording_head *head, const void *body, size_t n)
{
    uint8_t data[GN_RECORDING_HEADER_BYTES + GN_RECORDING_HEAD_BYTES + MAX_BODY] = {0};
    size_t size = GN_RECORDING_HEADER_BYTES + GN_RECORDING_HEAD_BYTES + n;
    gn_recording_header_encode(&(struct gn_recording_header){{0}, 1, 2}, data);
    gn_recording_state_encode(&(struct gn_recording_state){size, 1},
                              data + GN_RECORDING_STATE_OFFSET);
    gn_recording_head_encode(head, data + GN_RECORDING_HEADER_BYTES);
    memcpy(data + GN_RECORDING_HEADER_BYTES + GN_RECORDING_HEAD_BYTES, body, n);
    write_file(data, size);
}

/* Heads whose checksum is right and whose numbers are not. */
static void test_hostile_heads(void **state)
{
    (void)state;
    struct listing l;
    const struct gn_recording_head good = {
        .kind = 2, .stream = 1, .bytes = 4, .body_crc = gn_recording_crc(0, "body", 4)};
    write_head(&good, "body", 4);
    assert_int_equal(list(&l), 0);
    assert_true(is_text(&l, 0, 1, "body") && is_whole(&l));
    struct gn_recording_head bad[6] = {good, good, good, good, good, good};
    bad[0].bytes = UINT32_MAX;
    bad[1].bytes = GN_RECORDING_MAX_BODY_BYTES + 1;
    bad[2].stream = 0;
    bad[3].stream = GN_RECORDING_MAX_STREAMS + 1;
    bad[4].time_ns = -1;
    bad[5].time_ns = INT64_MAX;
    for (size_t i = 0; i < 6; i++) {
        write_head(&bad[i], "body", 4);
        assert_int_equal(list(&l), 0);
        assert_int_equal(l.n, 0);
        assert_int_equal(l.damage.n_damaged, 1);
    }
    // Longer than the file: no memory is taken for it. A limit on it would show; not under
    // sanitizers, which reserve more than any.
    struct rlimit old, low;
    assert_int_equal(getrlimit(RLIMIT_AS, &old), 0);
    low = old;
    if (!GN_TEST_IS_SANITIZED)
        low.rlim_cur = 48u << 20;
    struct gn_recording_head much = good;
    much.bytes = GN_RECORDING_MAX_BODY_BYTES;
    write_head(&much, "body", 4);
    assert_int_equal(setrlimit(RLIMIT_AS, &low), 0);
    int err = list(&l);
    assert_int_equal(setrlimit(RLIMIT_AS, &old), 0);
    assert_int_equal(err, 0);
    assert_int_equal(l.n, 0);
    assert_true(l.damage.tail_bytes == GN_RECORDING_HEAD_BYTES + 4);
}

static void expect_refusal(const char *words)
{
    struct gn_recording_reader *reader = NULL;
    struct gn_recording_writer *writer = NULL;
    struct gn_error error = {0};
    size_t n = 0, n_after = 0;
    uint8_t *before = read_file(&n);
    assert_int_equal(gn_recording_reader_open(path, &reader, &error), -EBADMSG);
    if (!strstr(error.text, words))
        fail_msg("'%s' is not in '%s'", words, error.text);
    assert_int_equal(gn_recording_writer_open(path, 0, &writer, &error), -EEXIST);
    assert_non_null(strstr(error.text, words));
    assert_non_null(strstr(error.text, "will not be overwritten"));
    uint8_t *after = read_file(&n_after);
    assert_true(n == n_after && memcmp(before, after, n) == 0);
    free(before);
    free(after);
}

/* What is something else is refused with the reason, and not written to. */
static void test_other_files(void **state)
{
    (void)state;
    size_t n = 0;
    write_file("a", 1);
    expect_refusal("too short");
    write_file("\x89PNG\r\n\x1a\n and then a hundred bytes more of something that is no recording "
               "at all, which is longer than a header",
               110);
    expect_refusal("does not begin as one does");
    write_sample();
    uint8_t *data = read_file(&n);
    uint8_t *copy = malloc(n);
    assert_non_null(copy);
    memcpy(copy, data, n);
    memcpy(copy + 8, (uint8_t[]){0x0a, 0x0b, 0x0c, 0x0d}, 4);
    write_file(copy, n);
    expect_refusal("another order");
    memcpy(copy, data, n);
    copy[12] = 2;
    write_file(copy, n);
    expect_refusal("another version");
    // Of another machine, or another start of this one: read, but not added to.
    memcpy(copy, data, n);
    memset(copy + 16, 0xee, GN_RECORDING_BOOT_BYTES);
    copy[52] = 0;
    uint32_t crc = gn_recording_crc(0, copy, 52);
    for (int i = 0; i < 4; i++)
        copy[52 + i] = (uint8_t)(crc >> (8 * i));
    write_file(copy, n);
    struct listing l;
    struct gn_recording_writer *writer = NULL;
    struct gn_error error = {0};
    assert_int_equal(list(&l), 0);
    assert_int_equal(l.n, 6);
    assert_int_equal(gn_recording_writer_open(path, 0, &writer, &error), -EEXIST);
    assert_non_null(strstr(error.text, "another machine"));
    // No file, and none that can be made.
    assert_int_equal(gn_recording_writer_open("/dev/null", 0, &writer, &error), -EINVAL);
    assert_int_equal(gn_recording_writer_open("/nowhere/r.gnr", 0, &writer, &error), -ENOENT);
    free(data);
    free(copy);
}

/* A record of a kind that later versions may have is handed out; only its use is unknown. */
static void test_unknown_kind(void **state)
{
    (void)state;
    struct gn_recording_index x;
    struct gn_error error = {0};
    const struct gn_recording_head head = {
        .kind = 77, .stream = 3, .bytes = 4, .body_crc = gn_recording_crc(0, "body", 4)};
    write_head(&head, "body", 4);
    assert_int_equal(gn_recording_index_read(path, &x, &error), 0);
    assert_int_equal(x.n_unknown, 1);
    assert_int_equal(x.n_entries, 0);
    gn_recording_index_finish(&x);
}

/* Killed at any moment, a writer leaves whole records, and the next writes on. */
static void test_killed_writers(void **state)
{
    (void)state;
    unlink(path);
    uint8_t body[MAX_BODY];
    for (int i = 0; i < 12; i++) {
        pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0) {
            struct gn_recording_writer *writer = NULL;
            if (gn_recording_writer_open(path, 0, &writer, NULL) != 0)
                _exit(1);
            for (int k = 0;; k++) {
                memset(body, k, sizeof(body));
                const struct gn_recording_part part = {body, (size_t)(1 + k % MAX_BODY)};
                if (gn_recording_writer_put(writer, GN_RECORDING_SENT, 0, &part, 1, NULL) != 0)
                    _exit(1);
            }
        }
        nanosleep(&(struct timespec){.tv_nsec = 3000000 + 500000 * i}, NULL);
        kill(child, SIGKILL);
        int status;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_true(WIFSIGNALED(status));
    }
    // What a write that was cut short leaves behind the end goes, too.
    int fd = open(path, O_WRONLY | O_APPEND);
    assert_true(fd >= 0 && write(fd, "\xf3rec half a record of some length", 34) == 34);
    close(fd);
    struct gn_recording_writer *last = open_writer(0);
    put_text(last, "last");
    uint32_t n_streams = gn_recording_writer_get_stream(last);
    gn_recording_writer_close(&last);
    assert_true(n_streams >= 2 && n_streams <= 13);
    struct gn_recording_reader *reader = NULL;
    struct gn_recording_record record;
    assert_int_equal(gn_recording_reader_open(path, &reader, NULL), 0);
    uint32_t next[16] = {0};
    int n = 0;
    bool is_last = false;
    while (gn_recording_reader_next(reader, &record, NULL) > 0) {
        is_last = record.stream == n_streams;
        if (is_last)
            break;
        uint32_t k = next[record.stream]++;
        assert_int_equal(record.bytes, 1 + k % MAX_BODY);
        assert_int_equal(record.body[0], (uint8_t)k);
        n++;
    }
    assert_true(is_last && n > 20);
    assert_int_equal(record.bytes, 4);
    assert_int_equal(gn_recording_reader_next(reader, &record, NULL), 0);
    struct gn_recording_damage damage = gn_recording_reader_get_damage(reader);
    assert_true(damage.n_damaged == 0 && damage.missing_bytes == 0);
    gn_recording_reader_close(&reader);
}

/* Several processes at once: every record of each is there, whole and in its order. */
static void test_writers_at_once(void **state)
{
    (void)state;
    enum { N_WRITERS = 4, N_RECORDS = 2000 };
    int start[2];
    unlink(path);
    pid_t children[N_WRITERS];
    assert_int_equal(pipe(start), 0);
    for (int i = 0; i < N_WRITERS; i++) {
        children[i] = fork();
        assert_true(children[i] >= 0);
        if (children[i] > 0)
            continue;
        struct gn_recording_writer *writer = NULL;
        uint8_t body[MAX_BODY];
        close(start[1]);
        if (read(start[0], body, 1) != 0) // until all are there
            _exit(1);
        int err = gn_recording_writer_open(path, 0, &writer, NULL);
        for (int k = 0; !err && k < N_RECORDS; k++) {
            memset(body, k, sizeof(body));
            const struct gn_recording_part part = {body, (size_t)(1 + k % MAX_BODY)};
            err = gn_recording_writer_put(writer, GN_RECORDING_SENT, 0, &part, 1, NULL);
        }
        _exit(err != 0);
    }
    close(start[0]);
    close(start[1]);
    for (int i = 0; i < N_WRITERS; i++) {
        int status;
        assert_int_equal(waitpid(children[i], &status, 0), children[i]);
        assert_int_equal(status, 0);
    }
    struct gn_recording_reader *reader = NULL;
    struct gn_recording_record record;
    uint32_t next[N_WRITERS + 1] = {0};
    assert_int_equal(gn_recording_reader_open(path, &reader, NULL), 0);
    while (gn_recording_reader_next(reader, &record, NULL) > 0) {
        assert_in_range(record.stream, 1, N_WRITERS);
        uint32_t k = next[record.stream]++;
        assert_true(record.bytes == 1 + k % MAX_BODY && record.body[0] == (uint8_t)k);
    }
    for (int i = 1; i <= N_WRITERS; i++)
        assert_int_equal(next[i], N_RECORDS);
    struct gn_recording_damage damage = gn_recording_reader_get_damage(reader);
    assert_true(damage.n_damaged + damage.missing_bytes + damage.tail_bytes == 0);
    gn_recording_reader_close(&reader);
}

/* A file that can grow no further keeps what it has, and takes more once there is room. */
static void test_no_room(void **state)
{
    (void)state;
    struct listing l;
    struct rlimit old, low;
    unlink(path);
    signal(SIGXFSZ, SIG_IGN);
    struct gn_recording_writer *writer = open_writer(0);
    put_text(writer, "before");
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    low = old;
    low.rlim_cur = 180;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &low), 0);
    uint8_t body[MAX_BODY] = {0};
    int err = put(writer, GN_RECORDING_SENT, body, sizeof(body));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    assert_int_equal(err, -EFBIG);
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    assert_int_equal(st.st_size, gn_recording_writer_get_bytes(writer));
    assert_int_equal(list(&l), 0);
    assert_int_equal(l.n, 1);
    assert_true(is_whole(&l));
    put_text(writer, "after");
    gn_recording_writer_close(&writer);
    // A bound of our own: what fits to the byte goes in.
    writer = open_writer((uint64_t)st.st_size + 5 + GN_RECORDING_HEAD_BYTES + 40);
    assert_int_equal(put(writer, GN_RECORDING_SENT, body, 41 - GN_RECORDING_HEAD_BYTES), -EFBIG);
    assert_int_equal(put(writer, GN_RECORDING_SENT, body, 40 - GN_RECORDING_HEAD_BYTES), 0);
    gn_recording_writer_close(&writer);
    assert_int_equal(list(&l), 0);
    assert_int_equal(l.n, 3);
    assert_true(is_text(&l, 1, 1, "after") && is_whole(&l));
}

/* A writer does not hang on another one that holds the file and stands still. */
static void test_held_lock(void **state)
{
    (void)state;
    unlink(path);
    struct gn_recording_writer *writer = open_writer(0);
    int fd = open(path, O_RDONLY);
    assert_true(fd >= 0 && flock(fd, LOCK_EX) == 0);
    int64_t begin_ns = gn_clock_get_monotonic_ns();
    assert_int_equal(put(writer, GN_RECORDING_SENT, "x", 1), -ETIMEDOUT);
    assert_true(gn_clock_get_monotonic_ns() - begin_ns >= GN_RECORDING_LOCK_MS * GN_NS_PER_MS);
    close(fd);
    put_text(writer, "y");
    gn_recording_writer_close(&writer);
}

/** Encodes a message; its header's bytes. */
static const uint8_t *encode(uint16_t type, const void *message, uint32_t payload_bytes, size_t *n)
{
    static uint8_t head[GN_WIRE_HEAD_BYTES];
    struct gn_wire_fault fault = {{0}};
    if (gn_wire_encode(type, message, payload_bytes, head, sizeof(head), n, &fault) != 0)
        fail_msg("%s", fault.text);
    *n -= GN_ENVELOPE_BYTES;
    return head + GN_ENVELOPE_BYTES;
}

/* One number is changed in place, every other byte stays. */
static void test_set_field(void **state)
{
    (void)state;
    const struct gn_msg_pose pose = {
        .object = "teapot",
        .has_world_from_object = true,
        .world_from_object = {.orientation = {1, 0, 0, 0}, .position_m = {1, 2, 3}},
        .time_ns = 1234567890123,
        .confidence = 0.5f};
    size_t n = 0, n_out = 0, n_wanted = 0;
    uint8_t out[GN_WIRE_HEAD_BYTES], copy[GN_WIRE_HEAD_BYTES];
    memcpy(copy, encode(GN_WIRE_POSE, &pose, 0, &n), sizeof(copy) - GN_ENVELOPE_BYTES);
    const int64_t times[] = {1, 127, 128, -1, INT64_MIN, INT64_MAX, 1234567890123};
    uint32_t field = gn_recording_get_time_field(GN_WIRE_POSE);
    for (size_t i = 0; i < sizeof(times) / sizeof(*times); i++) {
        assert_int_equal(
            gn_recording_set_field(copy, n, field, (uint64_t)times[i], out, sizeof(out), &n_out),
            0);
        struct gn_msg_pose wanted = pose;
        wanted.time_ns = times[i];
        const uint8_t *bytes = encode(GN_WIRE_POSE, &wanted, 0, &n_wanted);
        assert_true(n_out == n_wanted && memcmp(out, bytes, n_out) == 0);
    }
    // Absent: it comes last, and is read.
    struct gn_msg_pose read;
    struct gn_msg_pose timeless = pose;
    timeless.time_ns = 0;
    memcpy(copy, encode(GN_WIRE_POSE, &timeless, 0, &n), sizeof(copy) - GN_ENVELOPE_BYTES);
    assert_int_equal(gn_recording_set_field(copy, n, field, 77, out, sizeof(out), &n_out), 0);
    assert_int_equal(gn_wire_decode(GN_WIRE_POSE, out, n_out, 0, &read, NULL), 0);
    assert_true(read.time_ns == 77 && strcmp(read.object, "teapot") == 0);
    assert_memory_equal(out, copy, n);
    // No room, and no protobuf.
    assert_int_equal(gn_recording_set_field(copy, n, field, 77, out, n_out - 1, &n_out), -ENOBUFS);
    for (size_t cut = 1; cut < n; cut++) {
        uint8_t *exact = malloc(cut);
        assert_non_null(exact);
        memcpy(exact, copy, cut);
        int err = gn_recording_set_field(exact, cut, field, 1, out, sizeof(out), &n_out);
        assert_true(err == 0 || err == -EBADMSG);
        free(exact);
    }
    const char *bad[] = {"\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", "\x0a\x7f", "\x0b",
                         "\x0d\1\2", "\x0a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
        assert_int_equal(gn_recording_set_field((const uint8_t *)bad[i], strlen(bad[i]), field, 1,
                                                out, sizeof(out), &n_out),
                         -EBADMSG);
}

/* The fields that are changed are those that gnomon.proto names so. */
static void test_field_numbers(void **state)
{
    (void)state;
    size_t n = 0, n_out = 0;
    uint8_t out[GN_WIRE_HEAD_BYTES];
    union gn_wire_message m = {0};
    struct gn_msg_frame frame = {.id = 1, .views_count = 1};
    const uint8_t *header = encode(GN_WIRE_FRAME, &frame, 0, &n);
    const uint32_t fields[] = {gn_recording_get_time_field(GN_WIRE_FRAME),
                               GN_RECORDING_FRAME_LIGHTING_MIN_SEQUENCE,
                               GN_RECORDING_FRAME_LIGHTING_WAIT_MS};
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(
            gn_recording_set_field(header, n, fields[i], 55 + i, out, sizeof(out), &n_out), 0);
        assert_int_equal(gn_wire_decode(GN_WIRE_FRAME, out, n_out, 0, &m, NULL), 0);
        assert_int_equal(m.frame.capture_time_ns, i == 0 ? 55 : 0);
        assert_int_equal(m.frame.lighting_min_sequence, i == 1 ? 56 : 0);
        assert_int_equal(m.frame.lighting_wait_ms, i == 2 ? 57 : 0);
    }
    struct gn_msg_environment_frame environment = {
        .sequence = 1,
        .width = 1,
        .height = 1,
        .has_projection = true,
        .pixel_format = GN_MSG_PIXEL_FORMAT_RGB_F32,
        .projection = {.type = GN_MSG_PROJECTION_TYPE_LATLONG}};
    header = encode(GN_WIRE_ENVIRONMENT_FRAME, &environment, 12, &n);
    assert_int_equal(gn_recording_set_field(header, n,
                                            gn_recording_get_time_field(GN_WIRE_ENVIRONMENT_FRAME),
                                            99, out, sizeof(out), &n_out),
                     0);
    assert_int_equal(gn_wire_decode(GN_WIRE_ENVIRONMENT_FRAME, out, n_out, 12, &m, NULL), 0);
    assert_int_equal(m.environment_frame.capture_time_ns, 99);
    struct gn_msg_emitter_frame emitter = {.stream = "tv",
                                           .sequence = 1,
                                           .width = 1,
                                           .height = 1,
                                           .pixel_format = GN_MSG_PIXEL_FORMAT_RGB8};
    header = encode(GN_WIRE_EMITTER_FRAME, &emitter, 3, &n);
    assert_int_equal(gn_recording_set_field(header, n,
                                            gn_recording_get_time_field(GN_WIRE_EMITTER_FRAME), 98,
                                            out, sizeof(out), &n_out),
                     0);
    assert_int_equal(gn_wire_decode(GN_WIRE_EMITTER_FRAME, out, n_out, 3, &m, NULL), 0);
    assert_int_equal(m.emitter_frame.capture_time_ns, 98);
}

/* Whole records with no message in them, or one that goes the other way. */
static void test_hostile_messages(void **state)
{
    (void)state;
    uint8_t message[GN_WIRE_HEAD_BYTES];
    size_t n = 0;
    struct gn_recording_index x;
    struct gn_error error = {0};
    const struct gn_msg_hello hello = {.version_min = 1, .version_max = 1, .role = 2};
    const struct gn_msg_dropped dropped = {.id = 9, .reason = GN_MSG_DROP_REASON_LATE};
    unlink(path);
    struct gn_recording_writer *writer = open_writer(0);
    assert_int_equal(gn_wire_encode(GN_WIRE_HELLO, &hello, 0, message, sizeof(message), &n, NULL),
                     0);
    assert_int_equal(put(writer, GN_RECORDING_STREAM, message, n), 0);
    assert_int_equal(put(writer, GN_RECORDING_SENT, message, n - 1), 0);
    message[4] = 9;
    assert_int_equal(put(writer, GN_RECORDING_SENT, message, n), 0);
    assert_int_equal(
        gn_wire_encode(GN_WIRE_DROPPED, &dropped, 0, message, sizeof(message), &n, NULL), 0);
    assert_int_equal(put(writer, GN_RECORDING_SENT, message, n), 0);
    assert_int_equal(put(writer, GN_RECORDING_STREAM, message, n), 0);
    assert_int_equal(put(writer, GN_RECORDING_RECEIVED, message, n), 0);
    assert_int_equal(put(writer, GN_RECORDING_CLOCK, message, 7), 0);
    assert_int_equal(put(writer, GN_RECORDING_SENT, "", 0), 0);
    gn_recording_writer_close(&writer);
    assert_int_equal(gn_recording_index_read(path, &x, &error), 0);
    assert_int_equal(x.n_streams, 1);
    assert_int_equal(x.n_entries, 2);
    assert_int_equal(x.streams[0].n_unreadable, 6);
    assert_true(x.streams[0].is_known && x.streams[0].hello.role == GN_MSG_ROLE_VIEWER);
    assert_true(x.entries[1].type == GN_WIRE_DROPPED && x.entries[1].id == 9);
    assert_int_equal(x.streams[0].n_received[GN_WIRE_DROPPED], 1);
    gn_recording_index_finish(&x);
    assert_int_equal(gn_recording_index_read("/nowhere", &x, &error), -ENOENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),       cmocka_unit_test(test_cut),
        cmocka_unit_test(test_flipped_bits),     cmocka_unit_test(test_hostile_heads),
        cmocka_unit_test(test_other_files),      cmocka_unit_test(test_unknown_kind),
        cmocka_unit_test(test_killed_writers),   cmocka_unit_test(test_writers_at_once),
        cmocka_unit_test(test_no_room),          cmocka_unit_test(test_held_lock),
        cmocka_unit_test(test_set_field),        cmocka_unit_test(test_field_numbers),
        cmocka_unit_test(test_hostile_messages),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
