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
        .is_secret = true, .help = "The secret that the server asks for, if it does."              \
    }

/** Rows of the option table that every command which replays pictures has. */
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
         .help = "Instead: a folder, or a pattern in quotes such as 'frames/*.png'; EXR, "         \
                 "Radiance, PNG or JPEG, in the order of their names."},                           \
        {.key = "rate",                                                                            \
         .flag = "rate",                                                                           \
         .type = GN_OPTION_DOUBLE,                                                                 \
         .min = 0.001,                                                                             \
         .max = 1000,                                                                              \
         .value_name = "HZ",                                                                       \
         .help = "Pictures per second. Without it a sequence keeps its own times; files go at "    \
                 "10."},                                                                           \
        {.key = "start-at",                                                                        \
         .flag = "start-at",                                                                       \
         .type = GN_OPTION_DOUBLE,                                                                 \
         .min = 0,                                                                                 \
         .max = 1e11,                                                                              \
         .value_name = "TIME",                                                                     \
         .help = "When the first picture is sent, in seconds since 1970 (date +%s), so that a "    \
                 "probe and a viewer can replay in step; default at once."},                       \
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

/** Connects as --server, --room and --token say and synchronises the clock. 0, or said on stderr.
 */
int gn_cmd_connect(const struct gn_program *program, const struct gn_options *options,
                   enum gn_msg_role role, struct gn_client **out_client);

/** Ends the session politely and destroys the client. */
void gn_cmd_disconnect(struct gn_client **client);

/** Camera responses and rigid poses as the wire has them. */
void gn_cmd_make_response(const struct gn_response *response, struct gn_msg_response *out);
void gn_cmd_make_transform(const struct gn_pose *pose, struct gn_msg_transform *out);

/** When picture after picture is due. */
struct gn_cmd_pace {
    int64_t start_ns; // own monotonic clock, of the first picture
    double rate_hz;   // 0: the pictures' own times
    bool is_looped;
    long n_wanted; // 0: all
};
/** From --rate, --start-at, --loop and --count; the start is now where --start-at is not given. */
void gn_cmd_pace_init(struct gn_cmd_pace *pace, const struct gn_options *options,
                      double default_rate_hz);
/** When picture `index` (counted from 0) with time `time_s` is due, own monotonic clock. */
int64_t gn_cmd_pace_get_due_ns(const struct gn_cmd_pace *pace, long index, double time_s);

/** From now on Ctrl-C and SIGTERM only set what gn_cmd_is_interrupted tells. */
void gn_cmd_catch_signals(void);
bool gn_cmd_is_interrupted(void);

#endif
