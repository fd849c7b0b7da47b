/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/probes.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/room/same_frame.h"

void gn_probe_finish(struct gn_probe *probe)
{
    if (probe->has_frame)
        gn_buf_unref(&probe->job.payload);
    gn_lighting_state_unref(&probe->light);
    if (probe->worked)
        gn_worked_frame_finish(probe->worked);
    free(probe->worked);
    memset(probe, 0, sizeof(*probe));
}

void gn_probes_finish(struct gn_probes *probes)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        gn_probe_finish(&probes->slots[i]);
    memset(probes, 0, sizeof(*probes));
}

static struct gn_probe *find(struct gn_probes *probes, uint64_t session_id)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        if (probes->slots[i].session_id == session_id)
            return &probes->slots[i];
    return NULL;
}

/* True for one that lights the room, or is about to. */
static bool may_light(const struct gn_probe *probe)
{
    return probe->light || probe->has_frame || probe->is_at_work;
}

/* A slot for one more probe: a free one, that of one that has left, that of one that was of no use.
 */
static struct gn_probe *find_room(struct gn_probes *probes)
{
    struct gn_probe *useless = NULL;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *p = &probes->slots[i];
        if (p->session_id == 0 || (p->has_left && !may_light(p)))
            return p;
        if (p->was_refused && !p->is_at_work)
            useless = p;
    }
    return useless;
}

int gn_probes_put(struct gn_probes *probes, const struct gn_environment_job *job, bool is_new,
                  struct gn_probe *out_old)
{
    memset(out_old, 0, sizeof(*out_old));
    struct gn_probe *p = find(probes, job->session_id);
    if (p) {
        out_old->has_frame = p->has_frame;
        out_old->job = p->job;
    } else {
        p = find_room(probes);
        if (!p)
            return -EUSERS;
        *out_old = *p;
        *p = (struct gn_probe){.session_id = job->session_id,
                               .began = is_new ? ++probes->n_begun : 0};
    }
    p->job = *job;
    p->has_frame = true;
    return out_old->has_frame;
}

bool gn_probes_take(struct gn_probes *probes, bool all, struct gn_probe_work *out_work)
{
    struct gn_probe *next = NULL, *left = NULL;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *p = &probes->slots[i];
        if (p->has_frame && (all || !p->light) && (!next || p->turn < next->turn))
            next = p;
        if (p->has_left && p->light)
            left = p;
    }
    if (!next)
        return false;
    const struct gn_probe *last = next->light || !left ? next : left;
    *out_work = (struct gn_probe_work){
        .job = next->job,
        .light = last->light ? gn_lighting_state_ref(last->light) : NULL,
        .worked = next->worked,
    };
    next->worked = NULL;
    next->has_frame = false;
    next->is_at_work = true;
    next->turn = ++probes->turn;
    return true;
}

bool gn_probes_has_frame(const struct gn_probes *probes)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        if (probes->slots[i].has_frame)
            return true;
    return false;
}

/* Frees the slot. */
static void move_out(struct gn_probe *probe, struct gn_probe *out)
{
    *out = *probe;
    memset(probe, 0, sizeof(*probe));
}

bool gn_probes_set_light(struct gn_probes *probes, uint64_t session_id,
                         struct gn_lighting_state *light, struct gn_worked_frame *worked,
                         int64_t now_ns, struct gn_probe out_old[static GN_PROBES_MAX], int *out_n)
{
    struct gn_probe *p = find(probes, session_id);
    struct gn_probe *last = &out_old[0];
    *last = (struct gn_probe){0};
    *out_n = 1;
    if (!p) {
        last->light = light;
        last->worked = worked;
        return false;
    }
    last->light = p->light;
    *(p->has_left ? &last->worked : &p->worked) = worked;
    if (p->light)
        gn_time_window_add(&p->interval, gn_clock_get_ms_between(p->lit_ns, now_ns));
    p->light = light;
    p->lit_ns = now_ns;
    p->n_lit++;
    p->is_at_work = p->was_refused = false;
    if (p->began == 0)
        p->began = ++probes->n_begun;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *other = &probes->slots[i];
        if (other != p && other->has_left)
            move_out(other, &out_old[(*out_n)++]);
    }
    return true;
}

void gn_probes_refuse(struct gn_probes *probes, uint64_t session_id, struct gn_worked_frame *worked,
                      struct gn_probe *out_old)
{
    struct gn_probe *p = find(probes, session_id);
    *out_old = (struct gn_probe){0};
    *(!p || p->has_left ? &out_old->worked : &p->worked) = worked;
    if (!p)
        return;
    p->is_at_work = p->is_owed = false;
    if (!p->light) {
        p->was_refused = true;
        p->began = 0;
    }
}

struct gn_lighting_state *gn_probes_replace_light(struct gn_probes *probes,
                                                  const struct gn_lighting_state *old,
                                                  struct gn_lighting_state *light)
{
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *p = &probes->slots[i];
        if (p->light == old) {
            struct gn_lighting_state *replaced = p->light;
            p->light = light;
            return replaced;
        }
    }
    return light;
}

void gn_probes_leave(struct gn_probes *probes, uint64_t session_id, struct gn_probe *out_old)
{
    struct gn_probe *p = find(probes, session_id);
    bool has_others = false; // that are still there
    *out_old = (struct gn_probe){0};
    if (!p)
        return;
    for (int i = 0; i < GN_PROBES_MAX; i++)
        has_others = has_others || (&probes->slots[i] != p && probes->slots[i].light &&
                                    !probes->slots[i].has_left);
    p->has_left = true;
    if (has_others || !may_light(p)) {
        move_out(p, out_old);
    } else {
        out_old->worked = p->worked;
        p->worked = NULL;
    }
}

void gn_probes_owe(struct gn_probes *probes)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        probes->slots[i].is_owed = probes->slots[i].has_frame || probes->slots[i].is_at_work;
}

void gn_probes_settle(struct gn_probes *probes, uint64_t session_id)
{
    struct gn_probe *p = find(probes, session_id);
    if (p)
        p->is_owed = false;
}

bool gn_probes_is_owing(const struct gn_probes *probes)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        if (probes->slots[i].is_owed)
            return true;
    return false;
}

uint64_t gn_probes_get_newest(const struct gn_probes *probes)
{
    const struct gn_probe *newest = NULL;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        const struct gn_probe *p = &probes->slots[i];
        if (p->began > 0 && (may_light(p) || !p->has_left) && (!newest || p->began > newest->began))
            newest = p;
    }
    return newest ? newest->session_id : 0;
}

int gn_probes_get_lights(const struct gn_probes *probes,
                         struct gn_lighting_state *out_lights[static GN_PROBES_MAX],
                         int *out_newest)
{
    int n = 0;
    int64_t newest_ns = INT64_MIN;
    *out_newest = 0;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        const struct gn_probe *p = &probes->slots[i];
        if (!p->light)
            continue;
        if (p->lit_ns > newest_ns) {
            newest_ns = p->lit_ns;
            *out_newest = n;
        }
        out_lights[n++] = gn_lighting_state_ref(p->light);
    }
    return n;
}

static const double *get_position(const struct gn_probe *probe)
{
    return probe->light->map->world_from_probe.translation;
}

int gn_probes_find_same_place(const struct gn_probes *probes, uint64_t session_id,
                              uint64_t out_ids[static GN_PROBES_MAX])
{
    const struct gn_probe *mine = NULL;
    int n = 0;
    for (int i = 0; i < GN_PROBES_MAX; i++)
        if (probes->slots[i].session_id == session_id && probes->slots[i].light)
            mine = &probes->slots[i];
    for (int i = 0; mine && i < GN_PROBES_MAX; i++) {
        const struct gn_probe *p = &probes->slots[i];
        if (p == mine || !p->light)
            continue;
        const double *a = get_position(mine), *b = get_position(p);
        double apart = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
        if (apart < GN_PROBES_SAME_PLACE_M)
            out_ids[n++] = p->session_id;
    }
    return n;
}

int gn_probes_get_figures(const struct gn_probes *probes,
                          struct gn_probe_figures out_figures[static GN_PROBES_MAX],
                          struct gn_time_window out_intervals[static GN_PROBES_MAX])
{
    int n = 0;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        const struct gn_probe *p = &probes->slots[i];
        if (!p->light)
            continue;
        out_intervals[n] = p->interval;
        struct gn_probe_figures *f = &out_figures[n++];
        const struct gn_radiance_map_figures *m = &p->light->map->figures;
        *f = (struct gn_probe_figures){.session_id = p->session_id,
                                       .has_left = p->has_left,
                                       .n_lights = p->light->n_lights,
                                       .sequence = p->light->sequence,
                                       .n_lit = p->n_lit,
                                       .n_clipped = m->n_clipped,
                                       .n_mended = m->n_nan + m->n_inf + m->n_negative,
                                       .n_out_of_gamut = m->n_out_of_gamut,
                                       .capture_ns = p->light->capture_time_ns};
        memcpy(f->position, get_position(p), sizeof(f->position));
        f->n_same_place = gn_probes_find_same_place(probes, p->session_id, f->same_place);
    }
    return n;
}
