/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What others read of a room while it runs. */
#include "server/room/room.h"

#include <string.h>

#include "server/room/room_internal.h"

/**
 * Frames/s at 640 x 480 of all viewers together: the margin's share of what the median of the last
 * frames' times, each scaled to that size by its pixels, would allow.
 */
static double get_holdable(const struct gn_room *room, const struct gn_time_window *vga_ms)
{
    double ms = gn_time_window_get(vga_ms, 0.5);
    return ms > 0 ? room->options.holdable_margin * 1000 / ms : 0;
}

double gn_room_get_holdable_fps_with(struct gn_room *room, int more_viewers)
{
    gn_mutex_lock(&room->mu);
    struct gn_time_window vga = room->vga_ms;
    int n = room->n_viewers + more_viewers;
    gn_mutex_unlock(&room->mu);
    return get_holdable(room, &vga) / (n > 1 ? n : 1);
}

void gn_room_get_figures(struct gn_room *room, struct gn_room_figures *out_figures)
{
    gn_mutex_lock(&room->mu);
    *out_figures = room->figures;
    out_figures->n_viewers = room->n_viewers;
    out_figures->n_probes = room->n_probes;
    out_figures->n_screens = room->n_screens;
    out_figures->n_trackers = room->n_trackers;
    out_figures->has_capture = room->n_reached > 0;
    out_figures->has_environment_waiting = gn_probes_has_frame(&room->probes);
    struct gn_time_window vga = room->vga_ms;
    struct gn_time_window latency = room->latency_ms;
    struct gn_time_window busy = room->busy_ms;
    gn_mutex_unlock(&room->mu);

    int n = out_figures->n_viewers > 1 ? out_figures->n_viewers : 1;
    out_figures->holdable_fps_room = get_holdable(room, &vga);
    out_figures->holdable_fps_viewer = out_figures->holdable_fps_room / n;
    out_figures->latency_p50_ms = gn_time_window_get(&latency, 0.5);
    out_figures->latency_p90_ms = gn_time_window_get(&latency, 0.9);
    out_figures->latency_p99_ms = gn_time_window_get(&latency, 0.99);
    out_figures->busy_p50_ms = gn_time_window_get(&busy, 0.5);
}

void gn_room_get_statistics(struct gn_room *room, struct gn_msg_statistics *out_statistics)
{
    struct gn_room_figures f;
    gn_room_get_figures(room, &f);
    int64_t now_ns = gn_clock_get_monotonic_ns();
    memset(out_statistics, 0, sizeof(*out_statistics));
    gn_wire_set_string(out_statistics->room, sizeof(out_statistics->room), room->name);
    out_statistics->sessions = (uint32_t)(f.n_viewers + f.n_probes + f.n_screens + f.n_trackers);
    out_statistics->has_probes = true;
    out_statistics->probes = (uint32_t)f.n_probes;
    out_statistics->frames_in = f.frames_in;
    out_statistics->frames_out = f.frames_out;
    out_statistics->frames_dropped = f.frames_dropped;
    out_statistics->environment_frames_in = f.environment_in;
    out_statistics->environment_frames_superseded = f.environment_superseded;
    out_statistics->median_frame_ms = (float)f.latency_p50_ms;
    out_statistics->holdable_fps = (float)f.holdable_fps_viewer;
    out_statistics->lighting_age_ms =
        f.has_capture ? (float)gn_clock_get_ms_between(f.light_capture_ns, now_ns) : -1;
}

int gn_room_get_sessions(struct gn_room *room, struct gn_session_figures *out_sessions, int cap)
{
    int n = 0;
    gn_mutex_lock(&room->mu);
    for (const struct gn_room_session *s = room->sessions; s && n < cap; s = s->next)
        out_sessions[n++] = s->figures;
    gn_mutex_unlock(&room->mu);
    return n;
}

static bool is_reached(const struct gn_reached *reached, int n, uint64_t session_id)
{
    for (int i = 0; i < n; i++)
        if (reached[i].stream == session_id)
            return true;
    return false;
}

int gn_room_get_probes(struct gn_room *room,
                       struct gn_probe_figures out_probes[static GN_PROBES_MAX])
{
    struct gn_time_window intervals[GN_PROBES_MAX];
    struct gn_reached reached[GN_PROBES_MAX];
    gn_mutex_lock(&room->mu);
    int n_lit = gn_probes_get_figures(&room->probes, out_probes, intervals);
    int n_reached = room->n_reached, n = 0;
    memcpy(reached, room->reached, sizeof(reached));
    gn_mutex_unlock(&room->mu);
    for (int i = 0; i < n_lit; i++) {
        double ms = gn_time_window_get(&intervals[i], 0.5);
        if (!is_reached(reached, n_reached, out_probes[i].session_id))
            continue; // its first light is not shown yet
        out_probes[n] = out_probes[i];
        out_probes[n++].rate_hz = ms > 0 ? 1000 / ms : 0;
    }
    return n;
}

struct gn_lighting_state *gn_room_get_light(struct gn_room *room)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    gn_mutex_lock(&room->mu);
    room->light_asked_ns = now_ns;
    struct gn_lighting_state *light = room->light ? gn_lighting_state_ref(room->light) : NULL;
    gn_cond_signal(&room->light_wake);
    gn_mutex_unlock(&room->mu);
    return light;
}

struct gn_snapshot *gn_room_get_composite(struct gn_room *room)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    gn_mutex_lock(&room->mu);
    room->composite_asked_ns = now_ns;
    struct gn_snapshot *snapshot = room->composite;
    if (snapshot)
        atomic_fetch_add_explicit(&snapshot->references, 1, memory_order_relaxed);
    gn_mutex_unlock(&room->mu);
    return snapshot;
}
