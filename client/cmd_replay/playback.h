/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Sends the messages of a recording again, each stream on a connection of its own. */
#ifndef GN_CLIENT_CMD_REPLAY_PLAYBACK_H
#define GN_CLIENT_CMD_REPLAY_PLAYBACK_H

#include <stdbool.h>
#include <stdint.h>

#include "client/cmd.h"
#include "client/recording/index.h"

struct gn_playback_options {
    const struct gn_program *program;
    const struct gn_options *options; // for connecting; borrowed
    double rate_factor;               // (0, inf); default 1
    bool is_fast;                     // by the order of the recording, not by its times
    bool is_open_loop;                // do not wait for answers
    bool pins_light;                  // name for each frame the light that its result had
    unsigned roles;                   // bit i: enum gn_msg_role i + 1
    const char *dir;                  // where composites go; NULL: nowhere
};

/** What came of it. */
struct gn_playback_counts {
    long n_streams; // opened
    long n_sent;    // messages
    long n_frames;  // of these
    long n_results, n_dropped;
    long n_equal;       // results with the recorded one's bytes
    long n_different;   // with others
    long n_new;         // results of frames for which none is recorded
    long n_now_dropped; // frames dropped that had a result when recorded
    long n_errors;      // that the server spoke of
    long n_lost;        // streams that ended too early
    int64_t late_ns;    // of the message that was sent latest
};

/**
 * One round, from the first message to the last answer. Returns 0, -EINTR (Ctrl-C), or another
 * negative errno and a sentence. *counts is added to.
 */
GN_MUST_USE int gn_playback_run(const struct gn_playback_options *options,
                                const struct gn_recording_index *index,
                                struct gn_playback_counts *counts, struct gn_error *out_error);

#endif
