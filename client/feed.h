/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the commands share that send picture after picture: their options, when each picture is due,
 * the way from the command line to the exit status. Pictures of a live source are not paced: each
 * is sent when it comes, and the newest wins.
 */
#ifndef GN_CLIENT_FEED_H
#define GN_CLIENT_FEED_H

#include <stdbool.h>
#include <stdint.h>

#include "client/capture/file.h"
#include "client/cmd.h"
#include "client/live.h"

/** Rows of the option table that every command that streams recorded pictures has. */
#define GN_FEED_OPTIONS                                                                            \
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
        GN_FEED_VIDEO_OPTION,                                                                      \
        GN_FEED_PACE_OPTIONS("Without it a sequence and a video keep their own times; files go "   \
                             "at 10.")

/** Row of the option table that every command has that can stream a video file. */
#define GN_FEED_VIDEO_OPTION                                                                       \
    {                                                                                              \
        .key = "video", .flag = "video", .type = GN_OPTION_STRING, .value_name = "FILE",           \
        .help = "Instead: the pictures of a video file, such as MP4, Matroska, AVI or Y4M."        \
    }

/** Rows of the option table that every command that streams pictures has; default_rate: a sentence
 * that says at which rate where --rate is not given. */
#define GN_FEED_PACE_OPTIONS(default_rate)                                                         \
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

/** One run of a command; each command's own state begins with it. */
struct gn_feed {
    const struct gn_program *program;
    struct gn_cmd_link link;  // how to connect; what it says beside role is open's to change
    struct gn_client *client; // owned; NULL until connected
    struct gn_source *source; // owned
    bool is_looped;
    double rate_hz;     // 0: the pictures' own times
    long n_wanted;      // 0: all
    long n_sent;        // counted by the command
    bool is_complete;   // the last picture has been sent and the end waited for
    bool has_start;     // the next field is known
    int64_t start_ns;   // own monotonic clock, of the first picture
    int64_t shifted_ns; // by how much the schedule has been moved
    int64_t clock_ns;   // when the server's clock was measured
};

/** A command. Where a function returns a negative errno it has set a sentence. */
struct gn_feed_command {
    const struct gn_program *program;
    enum gn_msg_role role;
    bool takes_sequences; // has GN_FEED_OPTIONS
    /** What is wrong with the options together; NULL: nothing. */
    const char *(*find_misuse)(const struct gn_options *options);
    /** Opens the source and reads its options, borrowed for the whole run. */
    int (*open)(struct gn_feed *r, const struct gn_options *options, struct gn_error *out_error);
    /** Connects; NULL: as link says, with one try. */
    int (*connect)(struct gn_feed *r, struct gn_error *out_error);
    /** The first messages, once connected; NULL: none. */
    int (*begin)(struct gn_feed *r, struct gn_error *out_error);
    /**
     * Before a live source is read: takes what the server has said, and waits until another picture
     * may be sent. -EINTR: Ctrl-C. NULL: all pictures may be sent at once, and nothing but trouble
     * is expected.
     */
    int (*serve)(struct gn_feed *r, struct gn_error *out_error);
    /** Waits until the picture is due, sends it and counts it. */
    int (*send)(struct gn_feed *r, const struct gn_capture *capture, struct gn_error *out_error);
    /** Waits for the server's last words; NULL: for 200 ms. */
    int (*end)(struct gn_feed *r, struct gn_error *out_error);
    /** Says what was done; err, error: how it ended. Returns the exit status. */
    int (*report)(struct gn_feed *r, int err, const struct gn_error *error);
};

/** Runs a command with its zeroed state. Returns the exit status. */
int gn_feed_run(const struct gn_feed_command *command, struct gn_feed *r, int argc,
                char *const argv[]);

/** What is wrong with the options of GN_FEED_OPTIONS and GN_LIVE_OPTIONS together; NULL: nothing
 * but that there may be no source, or several. */
const char *gn_feed_find_misuse(const struct gn_options *options);

/**
 * Opens what --video names. keeps_bits: more than 8 bits a channel stay as they are. Returns 0, or
 * a negative errno and a sentence.
 */
GN_MUST_USE int gn_feed_open_video(struct gn_feed *r, const struct gn_options *options,
                                   bool keeps_bits, struct gn_error *out_error);

/** Opens the files as the source. Returns 0, or -ENOMEM and a sentence. */
GN_MUST_USE int gn_feed_open_files(struct gn_feed *r, struct gn_file_list *list,
                                   const struct gn_file_source_options *options,
                                   struct gn_error *out_error);

/** When the picture was taken, in the server's clock: a recording's is taken when it is sent. */
int64_t gn_feed_get_capture_ns(const struct gn_feed *r, const struct gn_capture *capture);

/**
 * When the next picture is due, own monotonic clock; a live source's is due at once. Without
 * --start-at the first is due now. A first picture that is late at all, and a later one that is
 * more than 2 s late, is due now and shifts all that follow, so that nothing bursts.
 */
int64_t gn_feed_get_due_ns(struct gn_feed *r, const struct gn_capture *capture);

/** Milliseconds to wait in one gn_client_poll: until due_ns, but Ctrl-C must be seen meanwhile. */
int gn_feed_get_timeout_ms(int64_t due_ns);

/** Begins to measure the clock again where that was a minute ago; who serves the connection takes
 * the answers. Returns 0, or a negative errno and a sentence: the connection is lost. */
GN_MUST_USE int gn_feed_keep_clock(struct gn_feed *r, struct gn_error *out_error);

/**
 * Serves a connection on which nothing but trouble is expected, and its clock, until the picture is
 * due. Returns 0, -EINTR (Ctrl-C), or a negative errno and a sentence.
 */
GN_MUST_USE int gn_feed_wait(struct gn_feed *r, const struct gn_capture *capture,
                             struct gn_error *out_error);

/** Serves it for 200 ms more: an ERROR about the last picture is on its way, if there is one. Same
 * returns. */
GN_MUST_USE int gn_feed_wait_last(struct gn_feed *r, struct gn_error *out_error);

/** ", N s behind schedule" to stdout where it was shifted. */
void gn_feed_print_shift(const struct gn_feed *r);

#endif
