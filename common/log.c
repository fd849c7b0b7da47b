/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/log.h"

#include <assert.h>
#include <errno.h>
#include <fnmatch.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/text.h"
#include "common/thread.h"

#define LINE_BYTES 900
#define RING_LINES 512 // a power of two
#define MAX_RULES 32

static_assert((RING_LINES & (RING_LINES - 1)) == 0, "positions are masked");

static const char *const level_names[GN_LOG_LEVEL_COUNT] = {"ERROR", "WARN", "INFO", "DEBUG",
                                                            "TRACE"};

/* One rule of the filter: topics that match get the level. */
struct rule {
    char topic[32]; // glob; "*" for a bare level
    enum gn_log_level level;
};

struct filter {
    struct rule rules[MAX_RULES];
    int n_rules;
};

struct line {
    int64_t realtime_ns;
    enum gn_log_level level;
    const char *topic; // a literal
    char text[LINE_BYTES];
};

/*
 * Bounded queue, many producers, one consumer. A slot is free for position p when its sequence is
 * p, and holds the line of position p when it is p + 1.
 * Source: D. Vyukov, Bounded MPMC queue, 1024cores.net.
 */
struct slot {
    atomic_uint_fast64_t sequence; // atomic: release after writing the line, acquire before reading
    struct line line;
};

/*
 * The log of the process. Static so that a line can be written before anything is set up and
 * after everything is torn down.
 */
static struct {
    struct filter filter;   // written before threads start
    atomic_uint generation; // atomic: 0 no filter yet; release in set, acquire in is_on
    int fd;                 // written before threads start
    struct slot slots[RING_LINES];
    atomic_uint_fast64_t head; // atomic: next position to fill; claimed by compare and swap
    uint64_t tail;             // owner: log thread
    atomic_bool is_started;    // atomic: release in start, acquire in write
    atomic_bool is_stopping;   // atomic: release in stop, acquire in the log thread
    atomic_bool is_woken;      // atomic: a post is under way, no second one needed
    atomic_uint_fast64_t n_lost;
    uint64_t n_lost_said; // owner: log thread
    sem_t wake;
    struct gn_thread thread;
} state = {.fd = STDERR_FILENO};

static struct gn_log_topic own_topic = {.name = "log"};

/* Writes the line as far as it goes: a log that cannot be written is not worth dying for. */
static void write_line(const struct line *line)
{
    char buffer[LINE_BYTES + 128];
    time_t seconds = (time_t)(line->realtime_ns / GN_NS_PER_S);
    int ms = (int)(line->realtime_ns % GN_NS_PER_S / GN_NS_PER_MS);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    size_t n = strftime(buffer, sizeof(buffer), "%Y-%m-%dT%H:%M:%S", &utc);
    int m = snprintf(buffer + n, sizeof(buffer) - n, ".%03dZ %-5s %s: %s\n", ms,
                     level_names[line->level], line->topic, line->text);
    n += m > 0 ? (size_t)m : 0;
    if (n > sizeof(buffer) - 1) {
        n = sizeof(buffer) - 1;
        buffer[n - 1] = '\n';
    }
    for (size_t done = 0; done < n;) {
        ssize_t written = write(state.fd, buffer + done, n - done);
        if (written < 0 && errno != EINTR)
            return;
        done += written > 0 ? (size_t)written : 0;
    }
}

static bool parse_level(const char *text, size_t size, enum gn_log_level *out_level)
{
    for (int i = 0; i < GN_LOG_LEVEL_COUNT; i++) {
        if (strncasecmp(text, level_names[i], size) == 0 &&
            (size == 1 || size == strlen(level_names[i]))) {
            *out_level = (enum gn_log_level)i;
            return true;
        }
    }
    return false;
}

static int parse_filter(const char *text, struct filter *out_filter, struct gn_error *out_error)
{
    struct filter filter = {.rules = {{.topic = "*", .level = GN_LOG_INFO}}, .n_rules = 1};
    while (*text != '\0') {
        size_t size = strcspn(text, ",");
        const char *colon = memchr(text, ':', size);
        const char *level = colon == NULL ? text : colon + 1;
        size_t topic_size = colon == NULL ? 0 : (size_t)(colon - text);
        struct rule rule = {.topic = "*"};
        if (topic_size >= sizeof(rule.topic) || filter.n_rules == MAX_RULES)
            return gn_error_set(out_error, -EINVAL,
                                "log filter '%.64s': a topic is longer than %d bytes or there are "
                                "more than %d rules",
                                text, (int)sizeof(rule.topic) - 1, MAX_RULES - 1);
        if (colon != NULL) {
            memcpy(rule.topic, text, topic_size);
            rule.topic[topic_size] = '\0';
        }
        if (!parse_level(level, size - (size_t)(level - text), &rule.level) ||
            rule.topic[0] == '\0')
            return gn_error_set(out_error, -EINVAL,
                                "log filter '%.*s': expected LEVEL or TOPIC:LEVEL with LEVEL one "
                                "of E, W, I, D, T, as in W,net.*:D",
                                (int)(size > 64 ? 64 : size), text);
        filter.rules[filter.n_rules++] = rule;
        text += size;
        text += *text == ',' ? 1 : 0;
    }
    *out_filter = filter;
    return 0;
}

int gn_log_set_filter(const char *text, struct gn_error *out_error)
{
    if (text == NULL)
        text = getenv("GN_LOG");
    int ret = parse_filter(text == NULL ? "" : text, &state.filter, out_error);
    if (ret == 0)
        atomic_fetch_add_explicit(&state.generation, 1, memory_order_release);
    return ret;
}

static void set_first_filter(void)
{
    struct gn_error error = {0};
    if (gn_log_set_filter(NULL, &error) == 0)
        return;
    if (gn_log_set_filter("", NULL) == 0)
        gn_log_write(&own_topic, GN_LOG_WARN, "GN_LOG is ignored: %s", error.text);
}

bool gn_log_is_on(struct gn_log_topic *topic, enum gn_log_level level)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    unsigned generation = atomic_load_explicit(&state.generation, memory_order_acquire);
    if (generation == 0) {
        pthread_once(&once, set_first_filter);
        generation = atomic_load_explicit(&state.generation, memory_order_acquire);
    }
    unsigned cached = atomic_load_explicit(&topic->state, memory_order_relaxed);
    if (cached >> 3 != generation) {
        cached = generation << 3;
        for (int i = 0; i < state.filter.n_rules; i++)
            if (fnmatch(state.filter.rules[i].topic, topic->name, 0) == 0)
                cached = generation << 3 | (unsigned)state.filter.rules[i].level;
        atomic_store_explicit(&topic->state, cached, memory_order_relaxed);
    }
    return (unsigned)level <= (cached & 7);
}

/* The slot to fill and its position, or NULL where the ring is full. */
static struct slot *claim_slot(uint_fast64_t *out_position)
{
    uint_fast64_t position = atomic_load_explicit(&state.head, memory_order_relaxed);
    for (;;) {
        struct slot *slot = &state.slots[position & (RING_LINES - 1)];
        uint_fast64_t sequence = atomic_load_explicit(&slot->sequence, memory_order_acquire);
        int64_t lead = (int64_t)(sequence - position);
        if (lead < 0)
            return NULL;
        if (lead > 0) {
            position = atomic_load_explicit(&state.head, memory_order_relaxed);
            continue;
        }
        if (atomic_compare_exchange_weak_explicit(&state.head, &position, position + 1,
                                                  memory_order_relaxed, memory_order_relaxed)) {
            *out_position = position;
            return slot;
        }
    }
}

static void wake_log_thread(void)
{
    if (!atomic_exchange(&state.is_woken, true))
        sem_post(&state.wake);
}

void gn_log_write(const struct gn_log_topic *topic, enum gn_log_level level, const char *format,
                  ...)
{
    struct line direct;
    struct line *line = &direct;
    struct slot *slot = NULL;
    uint_fast64_t position = 0;
    bool is_ringed = atomic_load_explicit(&state.is_started, memory_order_acquire);
    if (is_ringed) {
        slot = claim_slot(&position);
        if (slot == NULL) {
            atomic_fetch_add_explicit(&state.n_lost, 1, memory_order_relaxed);
            wake_log_thread();
            return;
        }
        line = &slot->line;
    }
    line->realtime_ns = gn_clock_get_realtime_ns();
    line->level = level;
    line->topic = topic->name;
    va_list args;
    va_start(args, format);
    vsnprintf(line->text, sizeof(line->text), format, args);
    va_end(args);
    gn_text_clean(line->text);
    if (!is_ringed) {
        write_line(line);
        return;
    }
    atomic_store_explicit(&slot->sequence, position + 1, memory_order_release);
    wake_log_thread();
}

static void write_lost(void)
{
    uint64_t n_lost = atomic_load_explicit(&state.n_lost, memory_order_relaxed);
    if (n_lost == state.n_lost_said)
        return;
    struct line line = {
        .realtime_ns = gn_clock_get_realtime_ns(), .level = GN_LOG_WARN, .topic = own_topic.name};
    snprintf(line.text, sizeof(line.text), "%llu lines lost: more came than could be written",
             (unsigned long long)(n_lost - state.n_lost_said));
    state.n_lost_said = n_lost;
    write_line(&line);
}

static void drain(void)
{
    for (;;) {
        struct slot *slot = &state.slots[state.tail & (RING_LINES - 1)];
        if (atomic_load_explicit(&slot->sequence, memory_order_acquire) != state.tail + 1)
            break;
        write_line(&slot->line);
        atomic_store_explicit(&slot->sequence, state.tail + RING_LINES, memory_order_release);
        state.tail++;
    }
    write_lost();
}

static void run_log_thread(void *context)
{
    (void)context;
    while (!atomic_load_explicit(&state.is_stopping, memory_order_acquire)) {
        while (sem_wait(&state.wake) != 0 && errno == EINTR)
            ;
        // An exchange, not a store: it reads what the wakers wrote, and so sees their lines.
        (void)atomic_exchange(&state.is_woken, false);
        drain();
    }
}

int gn_log_start(void)
{
    if (atomic_load(&state.is_started))
        return -EALREADY;
    if (sem_init(&state.wake, 0, 0) != 0)
        return -errno;
    for (size_t i = 0; i < RING_LINES; i++)
        atomic_store_explicit(&state.slots[i].sequence, i, memory_order_relaxed);
    atomic_store(&state.head, 0);
    state.tail = 0;
    atomic_store(&state.is_stopping, false);
    atomic_store(&state.is_woken, false);
    int ret = gn_thread_start(&state.thread, "gn-log", run_log_thread, NULL);
    if (ret < 0) {
        sem_destroy(&state.wake);
        return ret;
    }
    atomic_store_explicit(&state.is_started, true, memory_order_release);
    return 0;
}

void gn_log_stop(void)
{
    if (!atomic_load(&state.is_started))
        return;
    atomic_store_explicit(&state.is_started, false, memory_order_release);
    atomic_store_explicit(&state.is_stopping, true, memory_order_release);
    sem_post(&state.wake);
    gn_thread_join(&state.thread);
    drain();
    sem_destroy(&state.wake);
}

void gn_log_set_fd(int fd)
{
    state.fd = fd;
}

uint64_t gn_log_get_lost_count(void)
{
    return atomic_load_explicit(&state.n_lost, memory_order_relaxed);
}

bool gn_log_limiter_allow(struct gn_log_limiter *limiter, const struct gn_log_topic *topic,
                          enum gn_log_level level)
{
    unsigned burst = limiter->burst == 0 ? 5 : limiter->burst;
    int64_t interval_ns = limiter->interval_ns == 0 ? 10 * GN_NS_PER_S : limiter->interval_ns;
    int64_t now_ns = gn_clock_get_monotonic_ns();
    long long start_ns = atomic_load(&limiter->window_start_ns);
    if ((start_ns == 0 || now_ns - start_ns >= interval_ns) &&
        atomic_compare_exchange_strong(&limiter->window_start_ns, &start_ns, now_ns)) {
        unsigned n_before = atomic_exchange(&limiter->n_lines, 0);
        if (n_before > burst)
            gn_log_write(topic, level, "%u lines like the next were held back", n_before - burst);
    }
    return atomic_fetch_add(&limiter->n_lines, 1) < burst;
}
