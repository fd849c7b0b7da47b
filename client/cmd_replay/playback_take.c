/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What comes back in a playback, beside what came back when it was recorded. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/cmd_replay/playback_internal.h"
#include "common/text.h"

static bool is_answer(const struct gn_recording_entry *entry)
{
    return entry->kind == GN_RECORDING_RECEIVED &&
           (entry->type == GN_WIRE_RESULT || entry->type == GN_WIRE_DROPPED);
}

static int compare_answers(const void *a, const void *b)
{
    const struct gn_recording_entry *const *x = a, *const *y = b;
    if ((*x)->stream != (*y)->stream)
        return (*x)->stream < (*y)->stream ? -1 : 1;
    return ((*x)->id > (*y)->id) - ((*x)->id < (*y)->id);
}

const struct gn_recording_entry *gn_playback_find_answer(const struct gn_playback *p,
                                                         uint32_t stream, uint64_t id)
{
    const struct gn_recording_entry key = {.stream = stream, .id = id}, *at = &key;
    const struct gn_recording_entry **found =
        p->n_answers ? bsearch(&at, p->answers, p->n_answers, sizeof(*p->answers), compare_answers)
                     : NULL;
    return found ? *found : NULL;
}

int gn_playback_sort_answers(struct gn_playback *p)
{
    const struct gn_recording_index *x = p->index;
    for (size_t i = 0; i < x->n_entries; i++)
        p->n_answers += is_answer(&x->entries[i]);
    p->answers = calloc(p->n_answers ? p->n_answers : 1, sizeof(*p->answers));
    if (!p->answers)
        return -ENOMEM;
    size_t n = 0;
    for (size_t i = 0; i < x->n_entries; i++) {
        if (is_answer(&x->entries[i]))
            p->answers[n++] = &x->entries[i];
    }
    if (n > 0)
        qsort(p->answers, n, sizeof(*p->answers), compare_answers);
    return 0;
}

/** Where the frame with this id waits for its answer. */
static struct gn_playback_pending *find_pending(struct gn_playback_stream *s, uint64_t id)
{
    for (int i = 0; id != 0 && i < GN_PLAYBACK_MAX_PENDING; i++) {
        if (s->pending[i].id == id)
            return &s->pending[i];
    }
    return NULL;
}

/** Bytes that differ, and by how much at most. */
static void say_difference(const struct gn_playback_stream *s, uint64_t id, const uint8_t *now,
                           size_t n_now, const uint8_t *then, size_t n_then, uint64_t light,
                           uint64_t recorded_light)
{
    size_t n_other = 0, n = n_now < n_then ? n_now : n_then;
    int most = 0;
    for (size_t i = 0; i < n; i++) {
        int difference = abs((int)now[i] - (int)then[i]);
        n_other += difference != 0;
        most = difference > most ? difference : most;
    }
    printf("stream %u, frame %llu: not the recorded composite: ", s->number,
           (unsigned long long)id);
    if (n_now != n_then)
        printf("%zu bytes, recorded %zu", n_now, n_then);
    else
        printf("%zu of %zu bytes differ, by %d at most", n_other, n_now, most);
    printf("; lit by environment frame %llu, recorded %llu\n", (unsigned long long)light,
           (unsigned long long)recorded_light);
}

/** Compares a result with the recorded one. */
static int compare_result(struct gn_playback *p, const struct gn_playback_stream *s,
                          const struct gn_client_event *event, struct gn_error *out_error)
{
    const struct gn_msg_result *result = &event->message.result;
    const struct gn_recording_entry *then = gn_playback_find_answer(p, s->number, result->id);
    if (!then || then->type != GN_WIRE_RESULT) {
        p->counts->n_new++;
        return 0;
    }
    size_t head_bytes = GN_ENVELOPE_BYTES + (size_t)then->header_bytes;
    size_t n = then->bytes - head_bytes;
    int err = gn_playback_grow(&p->compared, &p->compared_cap, n, out_error);
    if (!err)
        err = gn_recording_reader_load(p->index->reader, then->offset + head_bytes, n, p->compared,
                                       out_error);
    if (err)
        return err;
    if (n == event->payload_bytes && (n == 0 || memcmp(p->compared, event->payload, n) == 0)) {
        p->counts->n_equal++;
        return 0;
    }
    p->counts->n_different++;
    say_difference(s, result->id, event->payload, event->payload_bytes, p->compared, n,
                   result->receipt.lighting_sequence, (uint64_t)then->value);
    return 0;
}

static int take_answer(struct gn_playback *p, struct gn_playback_stream *s,
                       const struct gn_client_event *event, struct gn_error *out_error)
{
    bool is_result = event->type == GN_WIRE_RESULT;
    const struct gn_msg_dropped *dropped = &event->message.dropped;
    uint64_t id = is_result ? event->message.result.id : dropped->id;
    struct gn_playback_pending *pending = find_pending(s, id);
    if (!pending)
        return gn_error_set(out_error, -EPROTO, "frame %llu came back though it was not out",
                            (unsigned long long)id);
    double latency_ms = (double)(event->received_ns - pending->sent_ns) * 1e-6;
    char name[32];
    int err = 0;
    snprintf(name, sizeof(name), "frame-%06llu", (unsigned long long)id);
    pending->id = 0;
    s->n_pending--;
    s->n_answered++;
    if (is_result) {
        p->counts->n_results++;
        err = compare_result(p, s, event, out_error);
        if (!err && s->record)
            err = gn_record_add_result(s->record, name, &event->message.result, event->payload,
                                       latency_ms, out_error);
        return err;
    }
    const struct gn_recording_entry *then = gn_playback_find_answer(p, s->number, id);
    p->counts->n_dropped++;
    if (then && then->type == GN_WIRE_RESULT) {
        char why[256];
        snprintf(why, sizeof(why), "%s",
                 dropped->sentence[0] ? dropped->sentence : gn_wire_get_drop_text(dropped->reason));
        gn_text_clean(why);
        p->counts->n_now_dropped++;
        printf("stream %u, frame %llu: dropped, though recorded with a result: %s\n", s->number,
               (unsigned long long)id, why);
    }
    return s->record ? gn_record_add_dropped(s->record, name, dropped, out_error) : 0;
}

void gn_playback_lose_stream(struct gn_playback *p, struct gn_playback_stream *s, const char *why)
{
    char text[256];
    snprintf(text, sizeof(text), "%s", why);
    gn_text_clean(text);
    fprintf(stderr, "%s: stream %u (%s) is lost: %s\n", p->options->program->name, s->number,
            s->recorded->hello.client_name, text);
    p->counts->n_lost++;
    s->is_played = false;
    s->n_pending = 0;
    memset(s->pending, 0, sizeof(s->pending));
    gn_client_destroy(&s->client);
}

int gn_playback_take_events(struct gn_playback *p, struct gn_playback_stream *s,
                            struct gn_error *out_error)
{
    while (s->client) {
        struct gn_client_event event;
        int err = 0, got = gn_client_poll(s->client, 0, &event);
        if (got == 0)
            return 0;
        if (got < 0) {
            gn_playback_lose_stream(p, s, gn_client_get_fault(s->client));
        } else if (event.type == GN_WIRE_RESULT || event.type == GN_WIRE_DROPPED) {
            err = take_answer(p, s, &event, out_error);
        } else if (event.type == GN_WIRE_BYE) {
            gn_playback_lose_stream(p, s, gn_wire_get_bye_text(event.message.bye.reason));
        } else if (event.type == GN_WIRE_ERROR) {
            char text[512];
            snprintf(text, sizeof(text), "%s", event.message.error.sentence);
            gn_text_clean(text);
            p->counts->n_errors++;
            printf("stream %u (%s), the server: %s\n", s->number, s->recorded->hello.client_name,
                   text);
        }
        if (err)
            return err;
    }
    return 0;
}
