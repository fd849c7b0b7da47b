/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/scheduler.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>

struct slot {
    bool is_used;
    bool is_full;
    struct gn_frame_job job; // where is_full
};

struct gn_scheduler {
    int next; // the slot whose turn it is
    struct slot slots[GN_ROOM_MAX_VIEWERS];
};

int gn_scheduler_create(struct gn_scheduler **out_scheduler)
{
    *out_scheduler = calloc(1, sizeof(**out_scheduler));
    return *out_scheduler ? 0 : -ENOMEM;
}

void gn_scheduler_destroy(struct gn_scheduler **scheduler)
{
    free(*scheduler);
    *scheduler = NULL;
}

int gn_scheduler_add(struct gn_scheduler *scheduler)
{
    for (int i = 0; i < GN_ROOM_MAX_VIEWERS; i++) {
        if (!scheduler->slots[i].is_used) {
            scheduler->slots[i].is_used = true;
            return i;
        }
    }
    return -EUSERS;
}

bool gn_scheduler_remove(struct gn_scheduler *scheduler, int slot, struct gn_frame_job *out_job)
{
    struct slot *s = &scheduler->slots[slot];
    bool was_full = s->is_full;
    if (was_full)
        *out_job = s->job;
    s->is_full = false;
    s->is_used = false;
    return was_full;
}

bool gn_scheduler_put(struct gn_scheduler *scheduler, int slot, const struct gn_frame_job *job,
                      struct gn_frame_job *out_superseded)
{
    struct slot *s = &scheduler->slots[slot];
    assert(s->is_used);
    bool was_full = s->is_full;
    if (was_full)
        *out_superseded = s->job;
    s->job = *job;
    s->is_full = true;
    return was_full;
}

enum gn_scheduler_verdict gn_scheduler_take(struct gn_scheduler *scheduler, int64_t now_ns,
                                            struct gn_scheduler_light light,
                                            struct gn_frame_job *out_job, int64_t *out_deadline_ns)
{
    int64_t first_deadline_ns = INT64_MAX;
    for (int i = 0; i < GN_ROOM_MAX_VIEWERS; i++) {
        int index = (scheduler->next + i) % GN_ROOM_MAX_VIEWERS;
        struct slot *s = &scheduler->slots[index];
        if (!s->is_full)
            continue;
        const struct gn_msg_frame *frame = &s->job.frame;
        int64_t deadline_ns = s->job.received_ns + (int64_t)frame->lighting_wait_ms * 1000000;
        bool is_lit =
            light.is_there && !light.is_behind && light.sequence >= frame->lighting_min_sequence;
        if (!is_lit && now_ns < deadline_ns) {
            s->job.has_waited = true;
            if (deadline_ns < first_deadline_ns)
                first_deadline_ns = deadline_ns;
            continue;
        }
        *out_job = s->job;
        s->is_full = false;
        scheduler->next = (index + 1) % GN_ROOM_MAX_VIEWERS;
        return light.is_there ? GN_SCHEDULER_RENDER : GN_SCHEDULER_NO_LIGHT;
    }
    *out_deadline_ns = first_deadline_ns;
    return GN_SCHEDULER_NOTHING;
}
