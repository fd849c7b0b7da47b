/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The commands of the program `gnomon`, and what all that connect share.
 */
#ifndef GN_CLIENT_CMD_H
#define GN_CLIENT_CMD_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "client/capture/source.h"
#include "client/lib/gnomon.h"
#include "common/device_json.h"
#include "common/options.h"

/** argv[0] is the command's name. Each returns the process's exit status. */
int gn_cmd_calibrate(int argc, char *const argv[]);
int gn_cmd_probe(int argc, char *const argv[]);
int gn_cmd_replay(int argc, char *const argv[]);
int gn_cmd_screen(int argc, char *const argv[]);
int gn_cmd_track(int argc, char *const argv[]);
int gn_cmd_view(int argc, char *const argv[]);
int gn_cmd_doctor(int argc, char *const argv[]);

/** Rows of the option table that say where the server is. */
#define GN_CMD_SERVER_OPTIONS                                                                      \
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

/** Rows of the option table that every command has whose session can be recorded. */
#define GN_CMD_CONNECT_OPTIONS                                                                     \
    GN_CMD_SERVER_OPTIONS,                                                                         \
        {.key = "record",                                                                          \
         .flag = "record",                                                                         \
         .type = GN_OPTION_STRING,                                                                 \
         .value_name = "FILE",                                                                     \
         .help = "Record all that is sent and comes back, with its times, for gnomon replay. "     \
                 "Commands that run on one machine may share the file; a recording that is there " \
                 "is added to."},                                                                  \
    {                                                                                              \
        .key = "record-max", .flag = "record-max", .type = GN_OPTION_BYTES, .min = 4096,           \
        .max = 1e15, .default_value = "4GiB",                                                      \
        .help = "The recording ends, and the session goes on, where the file would grow larger."   \
    }

/**
 * Reads the command line. Returns 1 where the command shall run; 0 where --help or --version was
 * dealt with; a negative errno where a sentence went to stderr.
 */
int gn_cmd_load(const struct gn_program *program, int argc, char *const argv[],
                struct gn_options **out_options);

/** What is wrong with the options of GN_CMD_CONNECT_OPTIONS together; NULL: nothing. */
const char *gn_cmd_find_misuse(const struct gn_options *options);

/** "gnomon COMMAND: sentence" on stderr. Returns 1, the exit status. */
int gn_cmd_fail(const struct gn_program *program, const char *sentence);

/** A connection as the command line has it. All borrowed. */
struct gn_cmd_link {
    const struct gn_program *program;
    const struct gn_options *options; // --server, --room and --token
    enum gn_msg_role role;
    bool wants_light; // LIGHTING_STATE
    bool wants_maps;  // ... with maps
    bool wants_statistics;
    const char *room;               // where --room is not given, default the server's first
    const char *client_name;        // default the program's
    int timeout_ms;                 // of each step, > 0, default 5000
    const atomic_bool *is_given_up; // atomic: connecting ends as by Ctrl-C; default NULL
};
/** Connects, synchronises the clock, and records as --record says, if the command has that. Returns
 * 0, -EINTR (Ctrl-C before there was an answer), or another negative errno, and a sentence.
 * Thread-safety: safe. */
GN_MUST_USE int gn_cmd_connect_as(const struct gn_cmd_link *link, struct gn_client **out_client,
                                  struct gn_error *out_error);

/**
 * Connects as --server, --room and --token say, synchronises the clock, and records as --record
 * says, if the command has that. Returns 0, or a negative errno and a sentence.
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

/** Camera responses and rigid poses as the wire has them. */
void gn_cmd_make_response(const struct gn_response *response, struct gn_msg_response *out);
void gn_cmd_make_transform(const struct gn_pose *pose, struct gn_msg_transform *out);

/** From now on Ctrl-C, SIGTERM and SIGHUP only set what gn_cmd_is_interrupted tells. */
void gn_cmd_catch_signals(void);
bool gn_cmd_is_interrupted(void);

#endif
