/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/probes.h"

#include <errno.h>
#include <string.h>

#include "common/clock.h"

void gn_probes_finish(struct gn_probes *probes)
{
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *p = &probes->slots[i];
        if (p->has_frame)
            gn_buf_unref(&p->job.payload);
        gn_lighting_state_unref(&p->light);
    }
    memset(probes, 0, sizeof(*probes));
}

static struct gn_probe *find(struct gn_probes *probes, uint64_t session_id)
{
    for (int i = 0; i < GN_PROBES_MAX; i++)
        if (probes->slots[i].session_id == session_id)
            return &probes->slots[i];
    return NULL;
}

int gn_probes_put(struct gn_probes *probes, const struct gn_environment_job *job,
                  struct gn_environment_job *out_superseded)
{
    memset(out_superseded, 0, sizeof(*out_superseded));
    struct gn_probe *p = find(probes, job->session_id);
    for (int i = 0; i < GN_PROBES_MAX && !p; i++) {
        struct gn_probe *slot = &probes->slots[i];
        if (slot->session_id == 0 || (slot->has_left && !slot->light && !slot->has_frame))
            p = slot;
    }
    if (!p)
        return -EUSERS;
    if (p->session_id != job->session_id)
        *p = (struct gn_probe){.session_id = job->session_id};
    bool had_frame = p->has_frame;
    if (had_frame)
        *out_superseded = p->job;
    p->job = *job;
    p->has_frame = true;
    return had_frame;
}

bool gn_probes_take(struct gn_probes *probes, bool all, struct gn_environment_job *out_job,
                    struct gn_lighting_state **out_light)
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
    *out_job = next->job;
    const struct gn_probe *last = next->light || !left ? next : left;
    *out_light = last->light ? gn_lighting_state_ref(last->light) : NULL;
    next->has_frame = false;
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

/* Frees the slot; its light is the caller's. */
static struct gn_lighting_state *clear(struct gn_probe *probe)
{
    struct gn_lighting_state *light = probe->light;
    if (probe->has_frame)
        gn_buf_unref(&probe->job.payload);
    memset(probe, 0, sizeof(*probe));
    return light;
}

void gn_probes_set_light(struct gn_probes *probes, uint64_t session_id,
                         struct gn_lighting_state *light, int64_t now_ns,
                         struct gn_lighting_state *out_old[static GN_PROBES_MAX], int *out_n)
{
    struct gn_probe *p = find(probes, session_id);
    *out_n = 0;
    if (!p) { // it left meanwhile, and others have lit the room
        out_old[(*out_n)++] = light;
        return;
    }
    if (p->light) {
        out_old[(*out_n)++] = p->light;
        gn_time_window_add(&p->interval, gn_clock_get_ms_between(p->lit_ns, now_ns));
    }
    p->light = light;
    p->lit_ns = now_ns;
    p->n_lit++;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        struct gn_probe *other = &probes->slots[i];
        if (other != p && other->has_left)
            out_old[(*out_n)++] = clear(other);
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

struct gn_lighting_state *gn_probes_leave(struct gn_probes *probes, uint64_t session_id)
{
    struct gn_probe *p = find(probes, session_id);
    bool has_others = false;
    if (!p)
        return NULL;
    for (int i = 0; i < GN_PROBES_MAX; i++)
        has_others = has_others || (&probes->slots[i] != p && probes->slots[i].light);
    p->has_left = true;
    return has_others ? clear(p) : NULL;
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

int gn_probes_get_figures(const struct gn_probes *probes,
                          struct gn_probe_figures out_figures[static GN_PROBES_MAX])
{
    int n = 0;
    for (int i = 0; i < GN_PROBES_MAX; i++) {
        const struct gn_probe *p = &probes->slots[i];
        if (!p->light)
            continue;
        struct gn_probe_figures *f = &out_figures[n++];
        const struct gn_radiance_map_figures *m = &p->light->map->figures;
        double interval_ms = gn_time_window_get(&p->interval, 0.5);
        *f = (struct gn_probe_figures){.session_id = p->session_id,
                                       .has_left = p->has_left,
                                       .n_lights = p->light->n_lights,
                                       .sequence = p->light->sequence,
                                       .n_lit = p->n_lit,
                                       .n_clipped = m->n_clipped,
                                       .n_mended = m->n_nan + m->n_inf + m->n_negative,
                                       .n_out_of_gamut = m->n_out_of_gamut,
                                       .capture_ns = p->light->capture_time_ns,
                                       .rate_hz = interval_ms > 0 ? 1000 / interval_ms : 0};
        memcpy(f->position, p->light->map->world_from_probe.translation, sizeof(f->position));
    }
    return n;
}
