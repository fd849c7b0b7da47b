/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/feed.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>

#include "client/capture/video.h"
#include "common/clock.h"

/** Lateness that is caught up. */
#define MAX_LATE_NS (2 * GN_NS_PER_S)
/** How long the server's word on the last picture is waited for. */
#define LAST_WORDS_NS (200 * GN_NS_PER_MS)
/** Pictures per second where neither the files nor --rate say. */
#define DEFAULT_RATE_HZ 10.0

const char *gn_feed_find_misuse(const struct gn_options *options)
{
    if (gn_live_count_asked(options) > 0 && (gn_options_is_set(options, NULL, NULL, "rate") ||
                                             gn_options_is_set(options, NULL, NULL, "start-at") ||
                                             gn_options_get_bool(options, NULL, NULL, "loop")))
        return "--rate, --start-at and --loop are for recordings; a camera has --frame-rate";
    return gn_live_find_misuse(options);
}

int gn_feed_open_files(struct gn_feed *r, struct gn_file_list *list,
                       const struct gn_file_source_options *options, struct gn_error *out_error)
{
    return gn_file_source_open(list, options, &r->source) < 0
               ? gn_error_set(out_error, -ENOMEM, "out of memory")
               : 0;
}

int gn_feed_open_video(struct gn_feed *r, const struct gn_options *options, bool keeps_bits,
                       struct gn_error *out_error)
{
    const struct gn_video_options wanted = {.is_looped = r->is_looped, .keeps_bits = keeps_bits};
    return gn_video_source_open(gn_options_get_string(options, NULL, NULL, "video"), &wanted,
                                &r->source, out_error);
}

static void read_pace(struct gn_feed *r, const struct gn_options *options, bool has_times)
{
    r->has_start = gn_options_is_set(options, NULL, NULL, "start-at");
    if (r->has_start) {
        double start_s = gn_options_get_double(options, NULL, NULL, "start-at");
        r->start_ns =
            gn_clock_get_monotonic_ns() + (int64_t)(start_s * 1e9) - gn_clock_get_realtime_ns();
    }
    r->rate_hz = has_times ? 0 : DEFAULT_RATE_HZ;
    if (gn_options_is_set(options, NULL, NULL, "rate"))
        r->rate_hz = gn_options_get_double(options, NULL, NULL, "rate");
    r->is_looped = gn_options_get_bool(options, NULL, NULL, "loop");
    r->n_wanted = gn_options_get_int(options, NULL, NULL, "count");
}

int64_t gn_feed_get_capture_ns(const struct gn_feed *r, const struct gn_capture *capture)
{
    return gn_client_to_server_ns(r->client,
                                  capture->time_ns ? capture->time_ns : gn_client_now_ns());
}

int64_t gn_feed_get_due_ns(struct gn_feed *r, const struct gn_capture *capture)
{
    if (r->source && r->source->is_live)
        return gn_clock_get_monotonic_ns();
    double since_start_s = r->rate_hz > 0 ? (double)r->n_sent / r->rate_hz : capture->time_s;
    int64_t since_start_ns = (int64_t)llround(since_start_s * 1e9);
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (!r->has_start) {
        r->has_start = true;
        r->start_ns = now_ns - since_start_ns;
    }
    int64_t late_ns = now_ns - (r->start_ns + since_start_ns);
    if (late_ns > (r->n_sent == 0 ? 0 : MAX_LATE_NS)) {
        if (r->n_sent == 0)
            fprintf(stderr, "%s: the time to start was %.1f s ago; starting now\n",
                    r->program->name, (double)late_ns * 1e-9);
        r->start_ns += late_ns;
        r->shifted_ns += late_ns;
    } else if (r->n_sent == 0 && late_ns < -GN_NS_PER_S) {
        printf("starting in %.1f s\n", (double)-late_ns * 1e-9);
        fflush(stdout);
    }
    return r->start_ns + since_start_ns;
}

void gn_feed_print_shift(const struct gn_feed *r)
{
    if (r->shifted_ns > 0)
        printf(", %.1f s behind schedule", (double)r->shifted_ns * 1e-9);
}

int gn_feed_get_timeout_ms(int64_t due_ns)
{
    int64_t left_ns = due_ns - gn_clock_get_monotonic_ns();
    if (left_ns <= 0)
        return 0;
    return left_ns > 200 * GN_NS_PER_MS ? 200 : (int)(left_ns / GN_NS_PER_MS) + 1;
}

int gn_feed_keep_clock(struct gn_feed *r, struct gn_error *out_error)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (now_ns - r->clock_ns < 60 * GN_NS_PER_S)
        return 0;
    r->clock_ns = now_ns;
    int err = gn_client_begin_clock_sync(r->client, 4);
    return err ? gn_cmd_set_fault(r->client, err, out_error) : 0;
}

static int serve_until(struct gn_feed *r, int64_t due_ns, struct gn_error *out_error)
{
    for (;;) {
        if (gn_cmd_is_interrupted())
            return -EINTR;
        int timeout_ms = gn_feed_get_timeout_ms(due_ns);
        struct gn_client_event event;
        int got = gn_client_poll(r->client, timeout_ms, &event);
        int err = got < 0   ? gn_cmd_set_fault(r->client, got, out_error)
                  : got > 0 ? gn_cmd_take_event(&event, out_error)
                            : gn_feed_keep_clock(r, out_error);
        if (err || (got == 0 && timeout_ms == 0))
            return err;
    }
}

int gn_feed_wait(struct gn_feed *r, const struct gn_capture *capture, struct gn_error *out_error)
{
    return serve_until(r, gn_feed_get_due_ns(r, capture), out_error);
}

int gn_feed_wait_last(struct gn_feed *r, struct gn_error *out_error)
{
    return serve_until(r, gn_clock_get_monotonic_ns() + LAST_WORDS_NS, out_error);
}

/** Until the camera has something or look_ns, then true; or until the server alone has. */
static bool wait_for_camera(const struct gn_feed *r, int64_t look_ns)
{
    int64_t left_ns = look_ns - gn_clock_get_monotonic_ns();
    if (r->source->fd < 0 || left_ns <= 0)
        return true;
    struct pollfd fds[] = {{.fd = gn_client_get_fd(r->client), .events = POLLIN},
                           {.fd = r->source->fd, .events = POLLIN | POLLPRI}};
    (void)!poll(fds, 2, (int)(left_ns / GN_NS_PER_MS) + 1); // a signal is seen by who serves
    return !fds[0].revents || fds[1].revents;
}

/** Serves the connection and reads the camera until it has a picture. As gn_source_read. Reading
 * waits, so it comes when there is a picture, but every GN_SOURCE_WAIT_MS: a camera that is lost is
 * found by looking. */
static int read_live(const struct gn_feed_command *command, struct gn_feed *r,
                     struct gn_capture *out, struct gn_error *out_error)
{
    int64_t look_ns = gn_clock_get_monotonic_ns() + GN_SOURCE_WAIT_MS * GN_NS_PER_MS;
    for (;;) {
        int err = command->serve ? command->serve(r, out_error)
                                 : serve_until(r, gn_clock_get_monotonic_ns(), out_error);
        if (err)
            return err;
        if (!wait_for_camera(r, look_ns))
            continue;
        int got = gn_source_read(r->source, out, out_error);
        if (got != -EAGAIN)
            return got;
        if (out_error->text[0])
            gn_cmd_fail(r->program, out_error->text);
        look_ns = gn_clock_get_monotonic_ns() + GN_SOURCE_WAIT_MS * GN_NS_PER_MS;
    }
}

static int stream(const struct gn_feed_command *command, struct gn_feed *r,
                  struct gn_error *out_error)
{
    while (!r->n_wanted || r->n_sent < r->n_wanted) {
        struct gn_capture capture;
        int got = r->source->is_live ? read_live(command, r, &capture, out_error)
                                     : gn_source_read(r->source, &capture, out_error);
        if (got < 0)
            return got;
        if (got == 0)
            break;
        int err = command->send(r, &capture, out_error);
        if (err)
            return err;
    }
    return command->end ? command->end(r, out_error) : gn_feed_wait_last(r, out_error);
}

/** Runs with everything open; the exit status. */
static int run(const struct gn_feed_command *command, struct gn_feed *r)
{
    struct gn_error error = {0};
    int err = stream(command, r, &error);
    bool is_live = r->source->is_live;
    r->is_complete = !err || (err == -EINTR && is_live);
    if (err == -EINTR) // the only way to end a loop or a camera
        err = r->is_looped || is_live ? 0 : gn_error_set(&error, err, "interrupted");
    int status = command->report(r, err, &error);
    if (is_live)
        gn_live_print_counts(r->source, stdout);
    return status;
}

int gn_feed_run(const struct gn_feed_command *command, struct gn_feed *r, int argc,
                char *const argv[])
{
    struct gn_options *options = NULL;
    int go = gn_cmd_load(command->program, argc, argv, &options);
    if (go <= 0)
        return go ? 2 : 0;
    gn_cmd_catch_signals();
    struct gn_error error = {0};
    const char *misuse = gn_cmd_find_misuse(options);
    misuse = misuse ? misuse : command->find_misuse(options);
    int status = 1;
    r->program = command->program;
    r->link = (struct gn_cmd_link){
        .program = command->program, .options = options, .role = command->role};
    bool has_times =
        gn_options_is_set(options, NULL, NULL, "video") ||
        (command->takes_sequences && gn_options_is_set(options, NULL, NULL, "sequence"));
    read_pace(r, options, has_times);
    if (misuse) {
        gn_cmd_fail(command->program, misuse);
        status = 2;
    } else if (command->open(r, options, &error) < 0 ||
               (command->connect ? command->connect(r, &error)
                                 : gn_cmd_connect_as(&r->link, &r->client, &error)) < 0 ||
               (command->begin && command->begin(r, &error) < 0)) {
        gn_cmd_fail(command->program, error.text);
    } else {
        r->clock_ns = gn_clock_get_monotonic_ns();
        status = run(command, r);
    }
    gn_cmd_disconnect(&r->client);
    gn_source_close(&r->source);
    gn_options_destroy(&options);
    return status;
}
