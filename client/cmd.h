/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The commands of the program `gnomon`, and what they share: connection options, pacing, Ctrl-C.
 */
#ifndef GN_CLIENT_CMD_H
#define GN_CLIENT_CMD_H

#include <stdbool.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/lib/gnomon.h"
#include "common/device_json.h"
#include "common/options.h"

/** argv[0] is the command's name. Each returns the process's exit status. */
int gn_cmd_probe(int argc, char *const argv[]);
int gn_cmd_screen(int argc, char *const argv[]);
int gn_cmd_view(int argc, char *const argv[]);
int gn_cmd_doctor(int argc, char *const argv[]);

/** Rows of the option table that every command which connects has. */
#define GN_CMD_CONNECT_OPTIONS                                                                     \
    {.key = "server",                                                                              \
     .flag = "server",                                                                             \
     .type = GN_OPTION_ADDRESS,                                                                    \
     .default_value = "127.0.0.1:7340",                                                            \
     .help = "The server's address."},                                                             \
        {.key = "room",                                                                            \
         .flag = "room",                                                                           \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "NAME",                                                                     \
         .help = "The room to enter; without it the server's first."},                             \
    {                                                                                              \
        .key = "token", .flag = "token", .type = GN_OPTION_STRING, .value_name = "SECRET",         \
        .is_secret = true,                                                                         \
        .help = "The secret that the server asks for, if it does; gnomond 0.1 knows none."         \
    }

/** Rows of the option table that every command which replays recordings has. */
#define GN_CMD_REPLAY_OPTIONS                                                                      \
    {.key = "sequence",                                                                            \
     .flag = "sequence",                                                                           \
     .type = GN_OPTION_STRING,                                                                     \
     .value_name = "DIR",                                                                          \
     .help = "A recorded sequence: the folder that holds sequence.json."},                         \
        {.key = "files",                                                                           \
         .flag = "files",                                                                          \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "PATTERN",                                                                  \
         .help = "Instead: a folder's pictures, or a pattern in quotes such as 'frames/*.png'; "   \
                 "EXR, Radiance, PNG or JPEG, in the order of their names."},                      \
        GN_CMD_PACE_OPTIONS("Without it a sequence keeps its own times; files go at 10.")

/** Rows of the option table that every command which replays pictures has; default_rate: a sentence
 * that says at which rate where --rate is not given. */
#define GN_CMD_PACE_OPTIONS(default_rate)                                                          \
    {.key = "rate",                                                                                \
     .flag = "rate",                                                                               \
     .type = GN_OPTION_DOUBLE,                                                                     \
     .min = 0.001,                                                                                 \
     .max = 1000,                                                                                  \
     .value_name = "HZ",                                                                           \
     .help = "Pictures per second. " default_rate                                                  \
             " Up to 2 s late a replay catches up; beyond, the rest is shifted and said."},        \
        {.key = "start-at",                                                                        \
         .flag = "start-at",                                                                       \
         .type = GN_OPTION_DOUBLE,                                                                 \
         .min = 0,                                                                                 \
         .max = 9e9,                                                                               \
         .value_name = "TIME",                                                                     \
         .help = "When the first picture is sent, in seconds since 1970 (date +%s), so that a "    \
                 "probe and a viewer can replay in step; default at once. Where it has passed, "   \
                 "the replay says so and begins with its first picture all the same."},            \
        {.key = "loop",                                                                            \
         .flag = "loop",                                                                           \
         .type = GN_OPTION_BOOL,                                                                   \
         .default_value = "false",                                                                 \
         .help = "Begin again at the end, until Ctrl-C."},                                         \
    {                                                                                              \
        .key = "count", .flag = "count", .type = GN_OPTION_INT, .min = 1, .max = 1e9,              \
        .value_name = "N", .help = "Stop after so many pictures."                                  \
    }

/**
 * Reads the command line. Returns 1 where the command shall run; 0 where --help or --version was
 * dealt with; a negative errno where a sentence went to stderr.
 */
int gn_cmd_load(const struct gn_program *program, int argc, char *const argv[],
                struct gn_options **out_options);

/** "gnomon COMMAND: sentence" on stderr. Returns 1, the exit status. */
int gn_cmd_fail(const struct gn_program *program, const char *sentence);

/**
 * Connects as --server, --room and --token say and synchronises the clock. Returns 0, or a negative
 * errno and a sentence.
 */
GN_MUST_USE int gn_cmd_connect(const struct gn_program *program, const struct gn_options *options,
                               enum gn_msg_role role, struct gn_client **out_client,
                               struct gn_error *out_error);

/** Ends the session politely, if the server is still there, and destroys the client. NULL-safe. */
void gn_cmd_disconnect(struct gn_client **client);

/** The sentence for a call of libgnomon that failed. Returns err. */
int gn_cmd_set_fault(const struct gn_client *client, int err, struct gn_error *out_error);

/**
 * What every command does with an event that is no answer: the server's ERROR or BYE ends it.
 * Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_cmd_take_event(const struct gn_client_event *event, struct gn_error *out_error);

/** Measures the clock again where that was a minute ago. Returns 0, or a negative errno and a
 * sentence: the connection is lost. */
GN_MUST_USE int gn_cmd_keep_clock(struct gn_client *client, int64_t *measured_ns,
                                  struct gn_error *out_error);

/** How long the server's word on the last picture is waited for. */
#define GN_CMD_LAST_WORDS_NS (200 * INT64_C(1000000))
/**
 * Serves a connection on which nothing but trouble is expected, and its clock, until the time has
 * come. Returns 0, -EINTR (Ctrl-C), or a negative errno and a sentence.
 */
GN_MUST_USE int gn_cmd_serve_until(struct gn_client *client, int64_t *clock_ns, int64_t due_ns,
                                   struct gn_error *out_error);

/** Milliseconds to wait in one gn_client_poll: until due_ns, but Ctrl-C must be seen meanwhile. */
int gn_cmd_get_timeout_ms(int64_t due_ns);

/** Camera responses and rigid poses as the wire has them. */
void gn_cmd_make_response(const struct gn_response *response, struct gn_msg_response *out);
void gn_cmd_make_transform(const struct gn_pose *pose, struct gn_msg_transform *out);

/** When picture after picture is due. */
struct gn_cmd_pace {
    const char *command; // said where the replay is late
    bool has_start;
    int64_t start_ns; // own monotonic clock, of the first picture; known once it is due
    double rate_hz;   // 0: the pictures' own times
    bool is_looped;
    long n_wanted;      // 0: all
    int64_t shifted_ns; // by how much the schedule has been moved
};
/** From --rate, --start-at, --loop and --count. */
void gn_cmd_pace_init(struct gn_cmd_pace *pace, const struct gn_program *program,
                      const struct gn_options *options, double default_rate_hz);
/**
 * When picture `index` (counted from 0) with time `time_s` is due, own monotonic clock. Without
 * --start-at the first is due now. A first picture that is late at all, and a later one that is
 * more than 2 s late, is due now and shifts all that follow, so that nothing bursts.
 */
int64_t gn_cmd_pace_get_due_ns(struct gn_cmd_pace *pace, long index, double time_s);
/** ", N s behind its schedule" to stdout where it was shifted. */
void gn_cmd_pace_print(const struct gn_cmd_pace *pace);

/** From now on Ctrl-C and SIGTERM only set what gn_cmd_is_interrupted tells. */
void gn_cmd_catch_signals(void);
bool gn_cmd_is_interrupted(void);

#endif
