/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The log: what the filter lets through, what the ring loses and says, and the rate limit.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/thread.h"
#include "tests/unit/cmocka_setup.h"

GN_LOG_TOPIC("net.session");
static struct gn_log_topic light_topic = {.name = "light"};

static int pipe_fds[2];

static void sleep_ms(int ms)
{
    nanosleep(&(struct timespec){.tv_nsec = ms * GN_NS_PER_MS}, NULL);
}

static int set_up(void **unused)
{
    (void)unused;
    if (pipe(pipe_fds) != 0 || fcntl(pipe_fds[0], F_SETFL, O_NONBLOCK) != 0)
        return -1;
    gn_log_set_fd(pipe_fds[1]);
    return gn_log_set_filter("", NULL);
}

static int tear_down(void **unused)
{
    (void)unused;
    gn_log_stop();
    gn_log_set_fd(STDERR_FILENO);
    close(pipe_fds[0]);
    close(pipe_fds[1]);
    return 0;
}

/* What was written since the last call. */
static const char *read_log(void)
{
    static char text[65536];
    ssize_t n = read(pipe_fds[0], text, sizeof(text) - 1);
    text[n < 0 ? 0 : n] = '\0';
    return text;
}

static void expect_filter(const char *filter, int net_level, int light_level)
{
    assert_int_equal(gn_log_set_filter(filter, NULL), 0);
    for (int level = 0; level < GN_LOG_LEVEL_COUNT; level++) {
        assert_int_equal(gn_log_is_on(&gn_log_topic_here, (enum gn_log_level)level),
                         level <= net_level);
        assert_int_equal(gn_log_is_on(&light_topic, (enum gn_log_level)level),
                         level <= light_level);
    }
}

static void test_filter(void **unused)
{
    (void)unused;
    expect_filter("", GN_LOG_INFO, GN_LOG_INFO);
    expect_filter("W", GN_LOG_WARN, GN_LOG_WARN);
    expect_filter("W,net.*:D", GN_LOG_DEBUG, GN_LOG_WARN);
    expect_filter("net.*:T,E", GN_LOG_ERROR, GN_LOG_ERROR);
    expect_filter("light:trace,net.session:ERROR", GN_LOG_ERROR, GN_LOG_TRACE);
    expect_filter("net:D", GN_LOG_INFO, GN_LOG_INFO);
    setenv("GN_LOG", "light:D", 1);
    expect_filter(NULL, GN_LOG_INFO, GN_LOG_DEBUG);
    unsetenv("GN_LOG");
}

static void test_filter_errors(void **unused)
{
    (void)unused;
    static const char *const bad[] = {"X",  "net:",    "net:Q",
                                      ":D", ",W",      "W,,D",
                                      "WA", "net:D:E", "a-topic-that-is-longer-than-31-bytes:D"};
    expect_filter("D", GN_LOG_DEBUG, GN_LOG_DEBUG);
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        struct gn_error e = {0};
        assert_int_equal(gn_log_set_filter(bad[i], &e), -EINVAL);
        assert_non_null(strstr(e.text, "log filter '"));
        assert_true(gn_log_is_on(&light_topic, GN_LOG_DEBUG)); // nothing has changed
    }
}

static void test_line(void **unused)
{
    (void)unused;
    time_t before = time(NULL);
    gn_log(GN_LOG_WARN, "a %s\nb %d", "client", 7);
    gn_log(GN_LOG_DEBUG, "not this");
    const char *text = read_log();
    struct tm tm = {0};
    const char *rest = strptime(text, "%Y-%m-%dT%H:%M:%S", &tm);
    assert_non_null(rest);
    assert_true(rest[0] == '.' && strspn(rest + 1, "0123456789") == 3);
    assert_string_equal(rest + 4, "Z WARN  net.session: a client?b 7\n");
    setenv("TZ", "UTC", 1);
    assert_true(mktime(&tm) >= before && mktime(&tm) <= time(NULL));
}

static void test_long_line(void **unused)
{
    (void)unused;
    char text[2000];
    memset(text, 'x', sizeof(text) - 1);
    text[sizeof(text) - 1] = '\0';
    gn_log(GN_LOG_INFO, "%s", text);
    const char *line = read_log();
    assert_true(strlen(line) > 900 && strlen(line) < 1000);
    assert_int_equal(strcspn(line, "\n"), strlen(line) - 1);
}

#define N_THREADS 4
#define N_LINES 60

static void write_lines(void *context)
{
    const int *id = context;
    for (int i = 0; i < N_LINES; i++)
        gn_log(GN_LOG_INFO, "thread %d line %d end", *id, i);
}

/* Every line arrives whole, once, and in order within its thread. */
static void test_ring(void **unused)
{
    (void)unused;
    struct gn_thread threads[N_THREADS] = {0};
    int ids[N_THREADS], next[N_THREADS] = {0}, n_lines = 0;
    uint64_t lost_before = gn_log_get_lost_count();
    assert_int_equal(gn_log_start(), 0);
    assert_int_equal(gn_log_start(), -EALREADY);
    for (int i = 0; i < N_THREADS; i++) {
        ids[i] = i;
        assert_int_equal(gn_thread_start(&threads[i], "writer", write_lines, &ids[i]), 0);
    }
    for (int i = 0; i < N_THREADS; i++)
        gn_thread_join(&threads[i]);
    gn_log_stop();
    for (const char *line = read_log(); *line != '\0'; line += strcspn(line, "\n") + 1) {
        int id = -1, number = -1, length = 0;
        assert_int_equal(
            sscanf(strstr(line, "thread"), "thread %d line %d end%n", &id, &number, &length), 2);
        assert_true(id >= 0 && id < N_THREADS && length > 0);
        assert_int_equal(number, next[id]++);
        n_lines++;
    }
    assert_int_equal(n_lines, N_THREADS * N_LINES);
    assert_int_equal(gn_log_get_lost_count(), lost_before);
    gn_log_stop();
}

/* Nobody reads the pipe: the ring fills, the caller goes on, and the log owns up. */
static void test_overflow(void **unused)
{
    (void)unused;
    const int n_sent = 5000;
    uint64_t lost_before = gn_log_get_lost_count();
    assert_int_equal(gn_log_start(), 0);
    for (int i = 0; i < n_sent; i++)
        gn_log(GN_LOG_INFO, "line %d %0200d", i, 0);
    uint64_t n_lost = gn_log_get_lost_count() - lost_before;
    assert_true(n_lost > 0 && n_lost < (uint64_t)n_sent);
    /* Read on while the log thread writes, or it would never end. */
    uint64_t n_seen = 0, n_said = 0;
    int64_t deadline_ns = gn_clock_get_monotonic_ns() + 10 * GN_NS_PER_S;
    char text[65536];
    size_t kept = 0;
    while (n_seen + n_said < (uint64_t)n_sent && gn_clock_get_monotonic_ns() < deadline_ns) {
        ssize_t n = read(pipe_fds[0], text + kept, sizeof(text) - kept);
        if (n <= 0) {
            sleep_ms(1);
            continue;
        }
        kept += (size_t)n;
        char *line = text;
        for (char *end; (end = memchr(line, '\n', kept)) != NULL; line = end + 1) {
            kept -= (size_t)(end + 1 - line);
            *end = '\0';
            const char *lost = strstr(line, "WARN  log: ");
            n_seen += lost == NULL ? 1 : 0;
            n_said += lost == NULL ? 0 : strtoull(lost + 11, NULL, 10);
        }
        memmove(text, line, kept);
    }
    assert_int_equal(n_said, n_lost);
    assert_int_equal(n_seen, (uint64_t)n_sent - n_lost);
    gn_log_stop();
}

static int count_lines(const char *text)
{
    int n = 0;
    for (; *text != '\0'; text++)
        n += *text == '\n' ? 1 : 0;
    return n;
}

static void test_limiter(void **unused)
{
    (void)unused;
    struct gn_log_limiter limiter = {.burst = 3, .interval_ns = 50 * GN_NS_PER_MS};
    for (int i = 0; i < 10; i++)
        gn_log_limited(&limiter, GN_LOG_WARN, "peer says %d", i);
    assert_int_equal(count_lines(read_log()), 3);
    sleep_ms(60);
    gn_log_limited(&limiter, GN_LOG_WARN, "peer says again");
    const char *text = read_log();
    assert_int_equal(count_lines(text), 2);
    assert_non_null(strstr(text, "WARN  net.session: 7 lines like the next were held back\n"));
    assert_non_null(strstr(text, "peer says again\n"));
    gn_log_limited(&limiter, GN_LOG_DEBUG, "off: costs no share");
    gn_log_limited(&limiter, GN_LOG_WARN, "two");
    gn_log_limited(&limiter, GN_LOG_WARN, "three");
    assert_int_equal(count_lines(read_log()), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_filter, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_filter_errors, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_line, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_long_line, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_ring, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_overflow, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_limiter, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
