/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_replay/playback.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "client/cmd_replay/playback_internal.h"
#include "common/clock.h"

/** How long a frame's answer is waited for; of reference quality, which takes minutes. */
#define ANSWER_NS (60 * GN_NS_PER_S)
#define REFERENCE_ANSWER_NS (3600 * GN_NS_PER_S)
/** How long the server's word on the last message is waited for. */
#define LAST_WORDS_NS (200 * GN_NS_PER_MS)
/** Longest wait before Ctrl-C is looked for. */
#define MAX_WAIT_MS 200

/** Refuses to wait any longer for a frame that is out. */
static int check_answers(const struct gn_playback *p, struct gn_error *out_error)
{
    int64_t now_ns = gn_client_now_ns();
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        const struct gn_playback_stream *s = &p->streams[i];
        for (int k = 0; s->n_pending > 0 && k < GN_PLAYBACK_MAX_PENDING; k++) {
            const struct gn_playback_pending *f = &s->pending[k];
            int64_t limit_ns = f->is_reference ? REFERENCE_ANSWER_NS : ANSWER_NS;
            if (f->id && now_ns - f->sent_ns > limit_ns)
                return gn_error_set(out_error, -ETIMEDOUT,
                                    "stream %u, frame %llu was not answered in %d s", s->number,
                                    (unsigned long long)f->id, (int)(limit_ns / GN_NS_PER_S));
        }
    }
    return 0;
}

/** Waits for the servers' next words, at most timeout_ms, and takes them. */
static int serve(struct gn_playback *p, int timeout_ms, struct gn_error *out_error)
{
    struct pollfd fds[GN_RECORDING_MAX_STREAMS];
    nfds_t n = 0;
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        if (p->streams[i].client)
            fds[n++] = (struct pollfd){gn_client_get_fd(p->streams[i].client), POLLIN, 0};
    }
    if (poll(fds, n, timeout_ms) < 0 && errno != EINTR)
        return gn_error_set(out_error, -errno, "cannot wait for the server: %s", strerror(errno));
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        int err = gn_playback_take_events(p, &p->streams[i], out_error);
        if (err)
            return err;
    }
    if (gn_cmd_is_interrupted())
        return -EINTR;
    return check_answers(p, out_error);
}

/** Whether a frame is out that was lit, when recorded, by an environment frame before this one. */
static bool would_relight(const struct gn_playback *p, const struct gn_recording_entry *entry)
{
    // Numbers of several probes say nothing about each other.
    if (entry->type != GN_WIRE_ENVIRONMENT_FRAME || p->n_probes > 1)
        return false;
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        const struct gn_playback_stream *s = &p->streams[i];
        for (int k = 0; s->n_pending > 0 && k < GN_PLAYBACK_MAX_PENDING; k++) {
            if (s->pending[k].id && s->pending[k].light && s->pending[k].light < entry->id)
                return true;
        }
    }
    return false;
}

/** Whether something has to come back before the message may go. */
static bool is_held(const struct gn_playback *p, const struct gn_playback_stream *s,
                    const struct gn_recording_entry *entry)
{
    if (entry->type == GN_WIRE_FRAME && s->n_pending == GN_PLAYBACK_MAX_PENDING)
        return true;
    if (entry->type == GN_WIRE_BYE && s->n_pending > 0)
        return true;
    if (p->options->is_open_loop)
        return false;
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        const struct gn_playback_stream *other = &p->streams[i];
        // Answers to frames that are not played are not waited for.
        if (other->n_pending > 0 && other->n_answered < other->n_owed)
            return true;
    }
    return would_relight(p, entry);
}

/** When something recorded then is due, own clock. */
static int64_t get_due_ns(const struct gn_playback *p, int64_t time_ns)
{
    if (p->options->is_fast)
        return p->base_ns;
    double since_ns = (double)(time_ns - p->first_ns) / p->options->rate_factor;
    return p->base_ns + (int64_t)fmin(since_ns, 4e18);
}

/** Until the message is due and nothing holds it. */
static int wait_for(struct gn_playback *p, const struct gn_playback_stream *s,
                    const struct gn_recording_entry *entry, struct gn_error *out_error)
{
    int64_t due_ns = get_due_ns(p, entry->time_ns);
    for (;;) {
        int64_t left_ns = due_ns - gn_client_now_ns();
        bool is_due = left_ns <= 0;
        int timeout_ms = MAX_WAIT_MS;
        if (is_due && !is_held(p, s, entry))
            timeout_ms = 0;
        else if (!is_due && left_ns < MAX_WAIT_MS * GN_NS_PER_MS)
            timeout_ms = (int)(left_ns / GN_NS_PER_MS) + 1;
        int err = serve(p, timeout_ms, out_error);
        if (err || !s->is_played) // lost while we waited
            return err;
        if (timeout_ms == 0) {
            int64_t late_ns = gn_client_now_ns() - due_ns;
            if (!p->options->is_fast && late_ns > p->counts->late_ns)
                p->counts->late_ns = late_ns;
            return 0;
        }
    }
}

/** Until every frame of the stream (NULL: of all) is answered. */
static int wait_for_answers(struct gn_playback *p, const struct gn_playback_stream *stream,
                            struct gn_error *out_error)
{
    for (;;) {
        bool is_out = false;
        for (uint32_t i = 0; i < p->index->n_streams; i++) {
            const struct gn_playback_stream *s = &p->streams[i];
            is_out = is_out || ((!stream || s == stream) && s->n_pending > 0);
        }
        if (!is_out)
            return 0;
        int err = serve(p, MAX_WAIT_MS, out_error);
        if (err)
            return err;
    }
}

static int open_record(struct gn_playback *p, struct gn_playback_stream *s,
                       struct gn_error *out_error)
{
    char path[4096];
    int n = snprintf(path, sizeof(path), "%s/stream-%u", p->options->dir, s->number);
    if (n < 0 || (size_t)n >= sizeof(path))
        return gn_error_set(out_error, -ENAMETOOLONG, "%s: too long", p->options->dir);
    if (mkdir(p->options->dir, 0777) != 0 && errno != EEXIST)
        return gn_error_set(out_error, -errno, "%s: %s", p->options->dir, strerror(errno));
    return gn_record_open(path, &s->record, out_error);
}

/** Connects a stream as it was connected when it was recorded. */
static int open_stream(struct gn_playback *p, struct gn_playback_stream *s,
                       struct gn_error *out_error)
{
    const struct gn_msg_hello *hello = &s->recorded->hello;
    const struct gn_cmd_link link = {
        .program = p->options->program,
        .options = p->options->options,
        .role = hello->role,
        .wants_light = hello->want_lighting_states,
        .wants_maps = hello->want_lighting_maps,
        .wants_statistics = hello->want_statistics,
        .room = hello->room,
        .client_name = hello->client_name,
    };
    int err = gn_cmd_connect_as(&link, &s->client, out_error);
    if (!err && p->options->dir && hello->role == GN_MSG_ROLE_VIEWER)
        err = open_record(p, s, out_error);
    p->counts->n_streams += !err;
    return err;
}

static int play_entry(struct gn_playback *p, const struct gn_recording_entry *entry,
                      struct gn_error *out_error)
{
    struct gn_playback_stream *s = &p->streams[entry->stream - 1];
    if (!s->is_played)
        return 0;
    if (entry->kind == GN_RECORDING_CLOCK) {
        s->clock_ns = entry->value;
        return 0;
    }
    if (entry->kind == GN_RECORDING_RECEIVED) {
        s->n_owed += entry->type == GN_WIRE_RESULT || entry->type == GN_WIRE_DROPPED;
        return 0;
    }
    int err = wait_for(p, s, entry, out_error);
    if (err || !s->is_played)
        return err;
    if (entry->kind == GN_RECORDING_STREAM)
        return s->client ? 0 : open_stream(p, s, out_error);
    if (!s->client)
        return 0;
    err = gn_playback_send(p, s, entry, out_error);
    if (entry->type == GN_WIRE_BYE)
        gn_client_destroy(&s->client);
    return err;
}

/** What is played, and from when to when. */
static int choose(struct gn_playback *p, struct gn_error *out_error)
{
    const struct gn_recording_index *x = p->index;
    int n_played = 0;
    p->streams = calloc(x->n_streams ? x->n_streams : 1, sizeof(*p->streams));
    if (!p->streams || gn_playback_sort_answers(p) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    for (uint32_t i = 0; i < x->n_streams; i++) {
        const struct gn_recording_stream *recorded = &x->streams[i];
        struct gn_playback_stream *s = &p->streams[i];
        s->number = i + 1;
        s->recorded = recorded;
        s->is_played = recorded->is_known && recorded->hello.role > 0 &&
                       (p->options->roles >> (recorded->hello.role - 1) & 1);
        if (!s->is_played)
            continue;
        p->n_probes += recorded->hello.role == GN_MSG_ROLE_PROBE;
        if (n_played == 0 || recorded->first_ns < p->first_ns)
            p->first_ns = recorded->first_ns;
        if (recorded->last_ns > p->last_ns)
            p->last_ns = recorded->last_ns;
        n_played++;
    }
    return n_played ? 0
                    : gn_error_set(out_error, -ENODATA,
                                   "nothing to replay: the recording has no stream of such a role");
}

/** Ends what is still open. */
static int end_streams(struct gn_playback *p, bool is_complete, int err, struct gn_error *out_error)
{
    for (uint32_t i = 0; i < p->index->n_streams; i++) {
        struct gn_playback_stream *s = &p->streams[i];
        gn_cmd_disconnect(&s->client);
        struct gn_error error = {0};
        int record_err = gn_record_close(&s->record, s->n_frames, is_complete, NULL, &error);
        if (record_err && !err)
            err = gn_error_set(out_error, record_err, "%s", error.text);
    }
    return err;
}

int gn_playback_run(const struct gn_playback_options *options,
                    const struct gn_recording_index *index, struct gn_playback_counts *counts,
                    struct gn_error *out_error)
{
    struct gn_playback p = {.options = options, .index = index, .counts = counts};
    int err = choose(&p, out_error);
    if (!err) {
        p.base_ns = gn_client_now_ns();
        // In a hurry everything was captured before now: nothing lies in the server's future.
        p.capture_base_ns = p.base_ns - (options->is_fast ? p.last_ns - p.first_ns : 0);
        for (size_t i = 0; i < index->n_entries && !err; i++)
            err = play_entry(&p, &index->entries[i], out_error);
        if (!err)
            err = wait_for_answers(&p, NULL, out_error);
        int64_t end_ns = gn_client_now_ns() + LAST_WORDS_NS;
        while (!err && gn_client_now_ns() < end_ns)
            err = serve(&p, (int)(LAST_WORDS_NS / GN_NS_PER_MS), out_error);
        err = end_streams(&p, !err, err, out_error);
    }
    free(p.streams);
    free(p.answers);
    free(p.message);
    free(p.compared);
    return err;
}
