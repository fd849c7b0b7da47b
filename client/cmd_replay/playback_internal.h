/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Inside of a playback: its state, what is sent, what comes back. */
#ifndef GN_CLIENT_CMD_REPLAY_PLAYBACK_INTERNAL_H
#define GN_CLIENT_CMD_REPLAY_PLAYBACK_INTERNAL_H

#include "client/cmd_replay/playback.h"
#include "client/view/record.h"

/** Most frames of a stream that may be unanswered; one more is waited with. */
#define GN_PLAYBACK_MAX_PENDING 64

/** A frame that has been sent and not answered. id 0: free. */
struct gn_playback_pending {
    uint64_t id;
    int64_t sent_ns;
    bool is_reference;
    uint64_t light; // sequence that lit its recorded result; 0: there is none
};

/** A recorded session while it is replayed. */
struct gn_playback_stream {
    uint32_t number;
    const struct gn_recording_stream *recorded;
    bool is_played;
    struct gn_client *client;          // NULL: not yet, or no more
    struct gn_record *record;          // of its composites; NULL: none
    int64_t clock_ns;                  // server minus recorder, when it was recorded
    long n_frames, n_owed, n_answered; // owed: answers that had come in the recording by now
    int n_pending;
    struct gn_playback_pending pending[GN_PLAYBACK_MAX_PENDING];
};

struct gn_playback {
    const struct gn_playback_options *options;
    const struct gn_recording_index *index;
    struct gn_playback_counts *counts;
    struct gn_playback_stream *streams;        // [index->n_streams], owned
    const struct gn_recording_entry **answers; // [n_answers], owned; by stream, then id
    size_t n_answers;
    int n_probes;              // streams of environment frames that are played
    int64_t first_ns, last_ns; // of what is played, in the recording
    int64_t base_ns;           // own clock: what was recorded at first_ns is due
    int64_t capture_base_ns;   // own clock: what was captured at first_ns is said to be captured
    uint8_t *message;          // [message_cap], owned: as recorded
    size_t message_cap;
    uint8_t *compared; // [compared_cap], owned: a recorded payload
    size_t compared_cap;
};

/** Lists the recorded answers, for the next. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_playback_sort_answers(struct gn_playback *p);

/** The recorded RESULT or DROPPED of a frame; NULL: there is none. */
const struct gn_recording_entry *gn_playback_find_answer(const struct gn_playback *p,
                                                         uint32_t stream, uint64_t id);

/** Room for that many bytes. Returns 0, or -ENOMEM and a sentence. */
GN_MUST_USE int gn_playback_grow(uint8_t **data, size_t *cap, size_t bytes,
                                 struct gn_error *out_error);

/** Sends one recorded message as it is but for what has to be another. Returns 0, also where the
 * stream is lost by it, or a negative errno and a sentence. */
GN_MUST_USE int gn_playback_send(struct gn_playback *p, struct gn_playback_stream *s,
                                 const struct gn_recording_entry *entry,
                                 struct gn_error *out_error);

/** Takes what the server has said to this stream so far. Returns 0, or a negative errno and a
 * sentence: the disk, not the server, which may be lost. */
GN_MUST_USE int gn_playback_take_events(struct gn_playback *p, struct gn_playback_stream *s,
                                        struct gn_error *out_error);

/** Says that the stream ends before its time, and lets go of it. */
void gn_playback_lose_stream(struct gn_playback *p, struct gn_playback_stream *s, const char *why);

#endif
