/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* /metrics. Source of the format: Prometheus, "Exposition formats", text format 0.0.4. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/http/http_internal.h"

/** What one room is sampled into, and its label. */
struct sample {
    char label[80]; // room="NAME"; a room's name holds nothing to escape
    struct gn_room_figures figures;
};

static void put_head(FILE *out, const char *name, const char *type, const char *help)
{
    fprintf(out, "# HELP %s %s\n# TYPE %s %s\n", name, help, name, type);
}

/** A metric of each room that is one number. */
struct metric {
    const char *name, *type, *help;
    double (*get)(const struct gn_room_figures *figures);
};

#define GETTER(field)                                                                              \
    static double get_##field(const struct gn_room_figures *f)                                     \
    {                                                                                              \
        return (double)f->field;                                                                   \
    }
GETTER(n_viewers)
GETTER(n_probes)
GETTER(frames_in)
GETTER(frames_out)
GETTER(environment_in)
GETTER(environment_superseded)
GETTER(environment_refused)
GETTER(emitter_in)
GETTER(emitter_superseded)
GETTER(emitter_refused)
GETTER(n_trackers)
GETTER(n_movable)
GETTER(poses_in)
GETTER(poses_late)
GETTER(poses_refused)
GETTER(budget_frames)
GETTER(budget_misses)
GETTER(holdable_fps_room)
GETTER(light_published)
GETTER(n_lights)
GETTER(environment_same)
GETTER(light_without_sh)
GETTER(light_without_lights)
GETTER(light_births)
GETTER(light_deaths)
GETTER(light_snaps)
GETTER(light_holds)

static double get_light_tau_s(const struct gn_room_figures *f)
{
    return 1e-3 * f->light_in_time.tau_ms;
}

static double get_n_fading(const struct gn_room_figures *f)
{
    return f->light_in_time.n_fading;
}

static double get_light_age_s(const struct gn_room_figures *f)
{
    if (!f->has_capture)
        return -1;
    return 1e-3 * gn_clock_get_ms_between(f->light_capture_ns, gn_clock_get_monotonic_ns());
}

static const struct metric metrics[] = {
    {"gnomon_viewers", "gauge", "Viewers in the room.", get_n_viewers},
    {"gnomon_probes", "gauge", "Probes in the room.", get_n_probes},
    {"gnomon_frames_received_total", "counter", "Camera frames received.", get_frames_in},
    {"gnomon_frames_rendered_total", "counter", "Results made.", get_frames_out},
    {"gnomon_environment_frames_received_total", "counter", "Environment frames received.",
     get_environment_in},
    {"gnomon_environment_frames_superseded_total", "counter",
     "Environment frames that a later one replaced unread.", get_environment_superseded},
    {"gnomon_environment_frames_refused_total", "counter", "Environment frames that were bad.",
     get_environment_refused},
    {"gnomon_emitter_frames_received_total", "counter", "Pictures of emitters received.",
     get_emitter_in},
    {"gnomon_emitter_frames_superseded_total", "counter",
     "Pictures of emitters that a later one replaced unread.", get_emitter_superseded},
    {"gnomon_emitter_frames_refused_total", "counter", "Pictures of emitters that were bad.",
     get_emitter_refused},
    {"gnomon_trackers", "gauge", "Trackers in the room.", get_n_trackers},
    {"gnomon_movable_objects", "gauge", "Objects of the scene that can move.", get_n_movable},
    {"gnomon_object_poses_received_total", "counter", "Poses of objects received.", get_poses_in},
    {"gnomon_object_poses_late_total", "counter",
     "Poses of objects captured no later than the one that was there.", get_poses_late},
    {"gnomon_object_poses_refused_total", "counter", "Poses of objects that were bad.",
     get_poses_refused},
    {"gnomon_lighting_states_total", "counter", "Lighting states published.", get_light_published},
    {"gnomon_lights", "gauge", "Lights of the lighting state.", get_n_lights},
    {"gnomon_environment_frames_same_total", "counter",
     "Environment frames that equalled the last one worked on within the sensor's noise.",
     get_environment_same},
    {"gnomon_lighting_states_without_sh_total", "counter",
     "Lighting states made without harmonics: nobody needed them.", get_light_without_sh},
    {"gnomon_lighting_states_without_lights_total", "counter",
     "Lighting states made without lights: nobody needed them.", get_light_without_lights},
    {"gnomon_light_births_total", "counter", "Lights that faded in.", get_light_births},
    {"gnomon_light_deaths_total", "counter", "Lights that faded out.", get_light_deaths},
    {"gnomon_light_snaps_total", "counter", "Lights that took a new value at once.",
     get_light_snaps},
    {"gnomon_light_holds_total", "counter",
     "Environment frames whose capture time did not rise: the light stayed.", get_light_holds},
    {"gnomon_light_tau_seconds", "gauge",
     "Time constant by which the last frame was followed; 0: taken as it was.", get_light_tau_s},
    {"gnomon_lights_fading", "gauge", "Lights published that the map has no more.", get_n_fading},
    {"gnomon_lighting_age_seconds", "gauge",
     "Now minus the capture time of the lighting state; -1: no light yet.", get_light_age_s},
    {"gnomon_budget_frames_total", "counter", "Results of frames that had a budget.",
     get_budget_frames},
    {"gnomon_budget_misses_total", "counter", "Those that took longer than it.", get_budget_misses},
    {"gnomon_holdable_fps", "gauge",
     "Frames per second at 640x480 that the room can hold; 0: not measured yet.",
     get_holdable_fps_room},
};

static void put_dropped(FILE *out, const struct sample *samples, int n)
{
    static const char name[] = "gnomon_frames_dropped_total";
    put_head(out, name, "counter", "Frames that gave no result, by reason.");
    for (int i = 0; i < n; i++) {
        for (int r = 1; r <= GN_MSG_DROP_REASON_INTERNAL; r++)
            fprintf(out, "%s{%s,reason=\"%s\"} %llu\n", name, samples[i].label,
                    gn_wire_get_drop_text((enum gn_msg_drop_reason)r),
                    (unsigned long long)samples[i].figures.dropped_by_reason[r]);
    }
}

static void put_histogram(FILE *out, const char *name, const char *label,
                          const struct gn_time_histogram *h)
{
    uint64_t sum = 0;
    for (int i = 0; i < GN_FIGURES_BUCKETS; i++) {
        sum += h->counts[i];
        fprintf(out, "%s_bucket{%s,le=\"%g\"} %llu\n", name, label, gn_figures_bounds_ms[i] * 1e-3,
                (unsigned long long)sum);
    }
    fprintf(out, "%s_bucket{%s,le=\"+Inf\"} %llu\n", name, label, (unsigned long long)h->n);
    fprintf(out, "%s_sum{%s} %.9g\n", name, label, h->sum_ms * 1e-3);
    fprintf(out, "%s_count{%s} %llu\n", name, label, (unsigned long long)h->n);
}

static void put_transport(FILE *out, const struct gn_http_view *view)
{
    struct gn_transport_figures t = {0};
    view->options.get_transport(view->options.transport_context, &t);
    put_head(out, "gnomon_connections", "gauge", "Connections of clients.");
    fprintf(out, "gnomon_connections %d\n", t.connections);
    const struct {
        const char *name, *help;
        uint64_t value;
    } counters[] = {
        {"gnomon_connections_accepted_total", "Connections taken.", t.accepted},
        {"gnomon_connections_refused_total", "Connections refused: the server was full.",
         t.refused_full},
        {"gnomon_protocol_errors_total", "Messages that were refused.", t.protocol_errors},
        {"gnomon_timeouts_total", "Clients closed for silence.", t.timeouts},
        {"gnomon_stalled_total", "Clients closed because they read nothing.", t.stalled},
        {"gnomon_received_bytes_total", "Bytes of whole messages received.", t.bytes_in},
        {"gnomon_sent_bytes_total", "Bytes of messages handed to the sockets.", t.bytes_out},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(counters); i++) {
        put_head(out, counters[i].name, "counter", counters[i].help);
        fprintf(out, "%s %llu\n", counters[i].name, (unsigned long long)counters[i].value);
    }
}

static void put_probes(FILE *out, const struct gn_http_view *view, const struct sample *samples)
{
    static const struct {
        const char *name, *type, *help;
    } heads[] = {
        {"gnomon_probe_age_seconds", "gauge",
         "Now minus the capture time of the probe's light, by session."},
        {"gnomon_probe_states_total", "counter", "Frames of the probe that gave light."},
    };
    for (size_t m = 0; m < GN_ARRAY_LEN(heads); m++) {
        put_head(out, heads[m].name, heads[m].type, heads[m].help);
        for (int i = 0; i < view->options.n_rooms; i++) {
            struct gn_probe_figures probes[GN_PROBES_MAX];
            int n = gn_room_get_probes(view->options.rooms[i], probes);
            for (int p = 0; p < n; p++)
                fprintf(out, "%s{%s,session=\"%llu\"} %.9g\n", heads[m].name, samples[i].label,
                        (unsigned long long)probes[p].session_id,
                        m == 0 ? gn_clock_get_ms_between(probes[p].capture_ns,
                                                         gn_clock_get_monotonic_ns()) *
                                     1e-3
                               : (double)probes[p].n_lit);
        }
    }
}

static void put_rooms(FILE *out, const struct sample *samples, int n)
{
    for (size_t m = 0; m < GN_ARRAY_LEN(metrics); m++) {
        put_head(out, metrics[m].name, metrics[m].type, metrics[m].help);
        for (int i = 0; i < n; i++)
            fprintf(out, "%s{%s} %.9g\n", metrics[m].name, samples[i].label,
                    metrics[m].get(&samples[i].figures));
    }
    put_dropped(out, samples, n);
    put_head(out, "gnomon_frame_latency_seconds", "histogram",
             "From a frame's last byte received to its result queued; frames that waited for "
             "light are not counted.");
    for (int i = 0; i < n; i++)
        put_histogram(out, "gnomon_frame_latency_seconds", samples[i].label,
                      &samples[i].figures.latency);
    put_head(out, "gnomon_frame_busy_seconds", "histogram",
             "The render thread's time for a frame: decode, render, composite, encode.");
    for (int i = 0; i < n; i++)
        put_histogram(out, "gnomon_frame_busy_seconds", samples[i].label, &samples[i].figures.busy);
}

int gn_http_make_metrics(const struct gn_http_view *view, struct gn_document *out)
{
    int n = view->options.n_rooms;
    struct sample *samples = calloc((size_t)n, sizeof(*samples));
    char *text = NULL;
    size_t size = 0;
    FILE *file = samples ? open_memstream(&text, &size) : NULL;
    if (!file) {
        free(samples);
        return -ENOMEM;
    }
    for (int i = 0; i < n; i++) {
        snprintf(samples[i].label, sizeof(samples[i].label), "room=\"%s\"",
                 gn_room_get_options(view->options.rooms[i])->name);
        gn_room_get_figures(view->options.rooms[i], &samples[i].figures);
    }
    put_head(file, "gnomon_build_info", "gauge", "The server's version.");
    fprintf(file, "gnomon_build_info{version=\"%s\"} 1\n", GN_VERSION);
    put_head(file, "gnomon_uptime_seconds", "gauge", "Since the server's start.");
    fprintf(file, "gnomon_uptime_seconds %.3f\n",
            (double)(gn_clock_get_monotonic_ns() - view->start_ns) * 1e-9);
    put_transport(file, view);
    put_rooms(file, samples, n);
    put_probes(file, view, samples);
    free(samples);
    bool is_short = ferror(file) != 0;
    if (fclose(file) != 0 || is_short) {
        free(text);
        return -ENOMEM;
    }
    *out = (struct gn_document){text, size, "text/plain; version=0.0.4; charset=utf-8"};
    return 0;
}
