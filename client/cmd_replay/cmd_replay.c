/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon replay: sends what was recorded again.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "client/cmd.h"
#include "client/cmd_replay/playback.h"
#include "common/clock.h"
#include "proto/attr.h"

/** In the order of enum gn_msg_role, from 1 on. */
#define ROLE_NAMES "probe|viewer|tracker|screen"
static const char *const role_names[] = {"probe", "viewer", "tracker", "screen"};

static const struct gn_option option_table[] = {
    GN_CMD_CONNECT_OPTIONS,
    {.key = "info",
     .flag = "info",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Only say what is in the file: streams, messages, times, sizes, damage. Needs no "
             "server."},
    {.key = "streams",
     .flag = "streams",
     .type = GN_OPTION_SET,
     .choices = ROLE_NAMES,
     .default_value = "all",
     .help = "Whose messages are sent."},
    {.key = "rate-factor",
     .flag = "rate-factor",
     .type = GN_OPTION_DOUBLE,
     .min = 1e-3,
     .max = 1e3,
     .default_value = "1",
     .value_name = "X",
     .help = "How much faster than it was recorded; capture times are drawn together likewise."},
    {.key = "as-fast-as-possible",
     .flag = "as-fast-as-possible",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Keep the order, not the times: a message goes as soon as the answers are there that "
             "had come before it when it was recorded."},
    {.key = "open-loop",
     .flag = "open-loop",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Send by the clock alone, whether answers have come or not: for load. Without it a "
             "message also waits for the answers that had come before it."},
    {.key = "pin-light",
     .flag = "pin-light",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Have each frame wait for the light that its recorded result had, as if it had been "
             "recorded with --sync-light. For recordings with one probe."},
    {.key = "loop",
     .flag = "loop",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Begin again at the end, until Ctrl-C, each time with new sessions."},
    {.key = "out",
     .flag = "out",
     .type = GN_OPTION_STRING,
     .value_name = "DIR",
     .help =
         "Write the composites that come back and view.json into DIR/stream-N for each viewer."},
    {.key = "expect-equal",
     .flag = "expect-equal",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Fail unless every recorded composite comes back equal to the bit."},
};

static const struct gn_program program = {
    .name = "gnomon replay",
    .usage = "FILE [OPTION]...",
    .summary = "Sends what gnomon probe, view, track and screen --record FILE recorded again: the "
               "same messages at the same relative times, each stream in a session of its own, and "
               "compares the composites that come back with those that came when it was recorded.",
    .notes = "Examples:\n"
             "  gnomon replay --info bug.gnr\n"
             "  gnomon replay bug.gnr --expect-equal\n"
             "  gnomon replay bug.gnr --rate-factor 2 --open-loop --loop\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
    .min_arguments = 1,
    .max_arguments = 1,
};

static const char *find_misuse(const struct gn_options *options)
{
    bool is_fast = gn_options_get_bool(options, NULL, NULL, "as-fast-as-possible");
    bool is_open = gn_options_get_bool(options, NULL, NULL, "open-loop");
    bool is_looped = gn_options_get_bool(options, NULL, NULL, "loop");
    const char *misuse = gn_cmd_find_misuse(options);
    if (misuse)
        return misuse;
    if (gn_options_get_bool(options, NULL, NULL, "info") &&
        (is_fast || is_open || is_looped || gn_options_is_set(options, NULL, NULL, "out") ||
         gn_options_is_set(options, NULL, NULL, "record") ||
         gn_options_get_bool(options, NULL, NULL, "expect-equal")))
        return "--info replays nothing: leave out what is for a replay";
    if (is_fast && gn_options_is_set(options, NULL, NULL, "rate-factor") &&
        !gn_options_is_default(options, NULL, NULL, "rate-factor"))
        return "give --rate-factor or --as-fast-as-possible, one of them";
    if (is_fast && is_open)
        return "--as-fast-as-possible goes by the answers and --open-loop by the clock: give one";
    if (is_fast && is_looped)
        return "--loop needs the recorded times: poses that come again must be captured later";
    if (gn_options_get_set(options, NULL, NULL, "streams") == 0)
        return "--streams none: nothing to replay";
    return NULL;
}

static void print_counts(const char *what, const uint32_t counts[static GN_RECORDING_N_TYPES],
                         uint64_t bytes)
{
    printf("  %s", what);
    bool is_first = true;
    for (uint16_t type = 0; type < GN_RECORDING_N_TYPES; type++) {
        if (counts[type] == 0)
            continue;
        printf("%s %u %s", is_first ? "" : ",", counts[type], gn_wire_get_info(type)->name);
        is_first = false;
    }
    if (is_first)
        printf(" nothing");
    printf("; %.1f MiB\n", (double)bytes / 1048576);
}

static void print_stream(const struct gn_recording_stream *s, uint32_t number)
{
    const char *role =
        s->is_known && s->hello.role >= 1 && (size_t)s->hello.role <= GN_ARRAY_LEN(role_names)
            ? role_names[s->hello.role - 1]
            : "of unknown role: its HELLO is missing";
    printf("stream %u: %s", number, role);
    if (s->is_known)
        printf(" '%s', room '%s'", s->hello.client_name, s->hello.room);
    printf(", from %.3f s to %.3f s%s\n", (double)s->first_ns * 1e-9, (double)s->last_ns * 1e-9,
           s->has_bye ? "" : ", not ended by BYE");
    print_counts("sent", s->n_sent, s->sent_bytes);
    print_counts("received", s->n_received, s->received_bytes);
    if (s->n_unreadable)
        printf("  %u messages that this version cannot read: left out\n", s->n_unreadable);
}

/** What is wrong with the file, a line for each. Whether anything of a whole record is lost. */
static bool print_damage(const struct gn_recording_index *x, FILE *to)
{
    const struct gn_recording_damage *d = &x->damage;
    if (d->tail_bytes)
        fprintf(to, "the last record was not written to its end: %llu bytes left out\n",
                (unsigned long long)d->tail_bytes);
    if (d->missing_bytes)
        fprintf(to, "the file is cut: %llu bytes are missing at its end\n",
                (unsigned long long)d->missing_bytes);
    if (d->n_damaged)
        fprintf(to, "damaged in %llu places: %llu bytes left out\n",
                (unsigned long long)d->n_damaged, (unsigned long long)d->damaged_bytes);
    if (x->n_unknown)
        fprintf(to, "%llu records of a later version's kind: left out\n",
                (unsigned long long)x->n_unknown);
    return d->missing_bytes > 0 || d->n_damaged > 0;
}

static int print_info(const struct gn_recording_index *x, const char *path)
{
    int64_t last_ns = 0;
    for (uint32_t i = 0; i < x->n_streams; i++)
        last_ns = x->streams[i].last_ns > last_ns ? x->streams[i].last_ns : last_ns;
    time_t begin = (time_t)(gn_recording_reader_get_realtime_ns(x->reader) / GN_NS_PER_S);
    struct tm tm;
    char when[64] = "at an unknown time";
    if (gmtime_r(&begin, &tm))
        strftime(when, sizeof(when), "%Y-%m-%d %H:%M:%S UTC", &tm);
    printf("%s: %.1f MiB, %u streams, %zu records, %.3f s, begun %s\n", path,
           (double)gn_recording_reader_get_bytes(x->reader) / 1048576, x->n_streams, x->n_entries,
           (double)last_ns * 1e-9, when);
    for (uint32_t i = 0; i < x->n_streams; i++)
        print_stream(&x->streams[i], i + 1);
    return print_damage(x, stdout) ? 1 : 0;
}

static void print_counts_of_run(const struct gn_playback_counts *c)
{
    printf("%ld streams, %ld messages sent; %ld frames, %ld results, %ld dropped", c->n_streams,
           c->n_sent, c->n_frames, c->n_results, c->n_dropped);
    printf("; %ld composites equal to the bit to those recorded, %ld not", c->n_equal,
           c->n_different);
    if (c->n_new)
        printf(", %ld without a recorded one", c->n_new);
    if (c->n_errors)
        printf("; %ld errors from the server", c->n_errors);
    if (c->late_ns > 100 * GN_NS_PER_MS)
        printf("; up to %.1f s behind schedule", (double)c->late_ns * 1e-9);
    printf("\n");
}

/** Replays an index; the exit status. */
static int run(const struct gn_recording_index *x, const struct gn_options *options)
{
    const struct gn_playback_options wanted = {
        .program = &program,
        .options = options,
        .rate_factor = gn_options_get_double(options, NULL, NULL, "rate-factor"),
        .is_fast = gn_options_get_bool(options, NULL, NULL, "as-fast-as-possible"),
        .is_open_loop = gn_options_get_bool(options, NULL, NULL, "open-loop"),
        .pins_light = gn_options_get_bool(options, NULL, NULL, "pin-light"),
        .roles = gn_options_get_set(options, NULL, NULL, "streams"),
        .dir = gn_options_get_string(options, NULL, NULL, "out"),
    };
    bool is_looped = gn_options_get_bool(options, NULL, NULL, "loop");
    struct gn_playback_counts counts = {0};
    struct gn_error error = {0};
    int err;
    do
        err = gn_playback_run(&wanted, x, &counts, &error);
    while (!err && is_looped);
    if (err == -EINTR && is_looped)
        err = 0;
    if (err)
        gn_cmd_fail(&program, err == -EINTR ? "interrupted" : error.text);
    print_counts_of_run(&counts);
    if (!err && gn_options_get_bool(options, NULL, NULL, "expect-equal") &&
        (counts.n_different || counts.n_now_dropped || counts.n_equal == 0)) {
        snprintf(error.text, sizeof(error.text), "%ld of %ld composites are not as recorded",
                 counts.n_different + counts.n_now_dropped,
                 counts.n_different + counts.n_now_dropped + counts.n_equal);
        err = -EBADMSG;
        gn_cmd_fail(&program,
                    counts.n_equal + counts.n_different + counts.n_now_dropped
                        ? error.text
                        : "no composite came back that is recorded, so none can be compared");
    }
    return err || counts.n_lost ? 1 : 0;
}

int gn_cmd_replay(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    int go = gn_cmd_load(&program, argc, argv, &options);
    if (go <= 0)
        return go ? 2 : 0;
    gn_cmd_catch_signals();
    const char *misuse = find_misuse(options), *path = gn_options_get_argument(options, 0);
    struct gn_recording_index index = {0};
    struct gn_error error = {0};
    int status = 1;
    if (misuse) {
        gn_cmd_fail(&program, misuse);
        status = 2;
    } else if (gn_recording_index_read(path, &index, &error) < 0) {
        gn_cmd_fail(&program, error.text);
    } else if (gn_options_get_bool(options, NULL, NULL, "info")) {
        status = print_info(&index, path);
    } else {
        print_damage(&index, stdout);
        status = run(&index, options);
    }
    gn_recording_index_finish(&index);
    gn_options_destroy(&options);
    return status;
}
