/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* /api/v1/status and /readyz. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "common/clock.h"
#include "common/text.h"
#include "server/http/http_internal.h"
#include "server/render/budget.h"

static double get_ms_since(int64_t then_ns)
{
    return gn_clock_get_ms_between(then_ns, gn_clock_get_monotonic_ns());
}

/** json_object_set_new() fails where value is NULL: out of memory is found once, at the end. */
static void put(json_t *object, const char *key, json_t *value, bool *is_short)
{
    if (json_object_set_new(object, key, value) < 0)
        *is_short = true;
}

static void append(json_t *array, json_t *value, bool *is_short)
{
    if (json_array_append_new(array, value) < 0)
        *is_short = true;
}

static const char *get_role_name(enum gn_msg_role role)
{
    return role == GN_MSG_ROLE_PROBE     ? "probe"
           : role == GN_MSG_ROLE_SCREEN  ? "screen"
           : role == GN_MSG_ROLE_TRACKER ? "tracker"
                                         : "viewer";
}

static json_t *make_sessions(struct gn_room *room, bool *is_short)
{
    struct gn_session_figures *sessions = calloc(GN_HTTP_MAX_SESSIONS, sizeof(*sessions));
    json_t *list = json_array();
    if (!sessions || !list)
        *is_short = true;
    int n = sessions ? gn_room_get_sessions(room, sessions, GN_HTTP_MAX_SESSIONS) : 0;
    for (int i = 0; i < n; i++) {
        const struct gn_session_figures *s = &sessions[i];
        append(list,
               json_pack("{s:I, s:s, s:s, s:s, s:f, s:I, s:I, s:I, s:I, s:I, s:f}", //
                         "id", (json_int_t)s->id, "role", get_role_name(s->role), "name", s->name,
                         "peer", s->peer, "age_s", get_ms_since(s->since_ns) * 1e-3, //
                         "frames_in", (json_int_t)s->frames_in, "frames_out",
                         (json_int_t)s->frames_out, "frames_dropped", (json_int_t)s->frames_dropped,
                         "environment_frames_in", (json_int_t)s->environment_in, "poses_in",
                         (json_int_t)s->poses_in, "last_latency_ms", s->last_latency_ms),
               is_short);
    }
    free(sessions);
    return list;
}

static json_t *make_ids(const uint64_t *ids, int n, bool *is_short)
{
    json_t *list = json_array();
    for (int i = 0; i < n; i++)
        append(list, json_integer((json_int_t)ids[i]), is_short);
    return list;
}

static json_t *make_probes(struct gn_room *room, bool *is_short)
{
    struct gn_probe_figures probes[GN_PROBES_MAX];
    json_t *list = json_array();
    int n = gn_room_get_probes(room, probes);
    for (int i = 0; i < n; i++) {
        const struct gn_probe_figures *p = &probes[i];
        append(list,
               json_pack("{s:I, s:b, s:[f, f, f], s:i, s:I, s:I, s:i, s:i, s:i, s:f, s:f, s:o}", //
                         "session", (json_int_t)p->session_id, "has_left", p->has_left,
                         "position_m", p->position[0], p->position[1], p->position[2], //
                         "lights", p->n_lights, "sequence", (json_int_t)p->sequence, "published",
                         (json_int_t)p->n_lit, "clipped_texels", p->n_clipped, "mended_texels",
                         p->n_mended, "out_of_gamut_texels", p->n_out_of_gamut, "rate_hz",
                         p->rate_hz, "age_ms", get_ms_since(p->capture_ns), "same_place_as",
                         make_ids(p->same_place, p->n_same_place, is_short)),
               is_short);
    }
    return list;
}

/** Objects that move, and who moves them. */
static json_t *make_movable(struct gn_room *room, bool *is_short)
{
    struct gn_mover_figures movers[GN_MOVER_FIGURES_MAX];
    json_t *list = json_array();
    int n = gn_room_get_movers(room, 0, GN_MOVER_FIGURES_MAX, movers);
    for (int i = 0; i < n; i++) {
        const struct gn_mover_figures *m = &movers[i];
        gn_text_clean(movers[i].name); // the operator's: any bytes
        append(list,
               json_pack("{s:s, s:s, s:[f, f, f], s:I, s:f, s:o, s:o}", //
                         "name", m->name, "role", m->is_virtual ? "virtual" : "real", "position_m",
                         m->position[0], m->position[1], m->position[2], //
                         "poses", (json_int_t)m->n_poses, "rate_hz", m->rate_hz, "session",
                         m->n_poses ? json_integer((json_int_t)m->session_id) : json_null(),
                         "age_ms", m->n_poses ? json_real(get_ms_since(m->time_ns)) : json_null()),
               is_short);
    }
    return list;
}

/** What was not worked out because nobody needed it, or because it was there. */
static json_t *make_spared(const struct gn_room_figures *f)
{
    return json_pack("{s:I, s:I, s:I}", "same_frames", (json_int_t)f->environment_same,
                     "states_without_sh", (json_int_t)f->light_without_sh, "states_without_lights",
                     (json_int_t)f->light_without_lights);
}

static json_t *make_in_time(const struct gn_room_figures *f)
{
    static const char *const verdicts[] = {"off", "start", "follow", "hold"};
    const struct gn_temporal_figures *t = &f->light_in_time;
    return json_pack("{s:s, s:f, s:f, s:f, s:i, s:I, s:I, s:I, s:I}", //
                     "verdict", verdicts[t->verdict], "dt_ms", t->dt_ms, "tau_ms", t->tau_ms,
                     "alpha", t->alpha, "fading", t->n_fading, "births",
                     (json_int_t)f->light_births, "deaths", (json_int_t)f->light_deaths, "snaps",
                     (json_int_t)f->light_snaps, "holds", (json_int_t)f->light_holds);
}

static json_t *make_light(const struct gn_room_figures *f)
{
    if (!f->has_light)
        return json_pack("{s:b, s:b}", "lit", 0, "environment_frame_waiting",
                         f->has_environment_waiting);
    json_t *sh = f->has_sh ? json_pack("{s:i, s:i, s:f, s:f}", "order", f->sh_order, "lights",
                                       f->n_sh_lights, "dering_lambda", f->sh_lambda,
                                       "min_irradiance", f->sh_min)
                           : json_null();
    return json_pack(
        "{s:b, s:b, s:I, s:o, s:i, s:I, s:o, s:{s:f, s:f, s:f, s:f, s:f}, s:o, s:o}", //
        "lit", 1, "environment_frame_waiting", f->has_environment_waiting, "sequence",
        (json_int_t)f->light_sequence, "age_ms",
        f->has_capture ? json_real(get_ms_since(f->light_capture_ns)) : json_null(), "lights",
        f->n_lights, "published",
        (json_int_t)f->light_published, //
        "sh", sh, "ms", "decode", f->light_ms_decode, "map", f->light_ms_map, "sh", f->light_ms_sh,
        "lights", f->light_ms_lights, "temporal", f->light_ms_temporal, "spared", make_spared(f),
        "in_time", make_in_time(f));
}

static json_t *make_number(double x)
{
    return x >= 0 ? json_real(x) : json_null();
}

static json_t *make_budget(const struct gn_room_figures *f)
{
    const struct gn_msg_budget_use *b = &f->last_receipt.budget;
    if (!f->last_receipt.has_budget)
        return json_null();
    return json_pack("{s:f, s:f, s:s, s:o, s:o, s:{s:I, s:I, s:I}, s:I, s:I}", "budget_ms",
                     b->budget_ms, "busy_ms", b->busy_ms, "verdict",
                     gn_budget_get_verdict_name((enum gn_budget_verdict)b->verdict), "predicted_ms",
                     make_number((double)b->predicted_ms), "predicted_error",
                     make_number((double)b->predicted_error), "setting", "lights",
                     (json_int_t)b->lights, "grid", (json_int_t)b->grid, "shadow_step",
                     (json_int_t)b->shadow_step, "misses", (json_int_t)b->misses, "switches",
                     (json_int_t)b->switches);
}

static json_t *make_receipt(const struct gn_room_figures *f, bool *is_short)
{
    const struct gn_msg_receipt *r = &f->last_receipt;
    static const char *const qualities[] = {"interactive", "seed", "reference"};
    if (!f->has_receipt)
        return json_null();
    json_t *left_out = json_array();
    for (size_t i = 0; i < r->left_out_count; i++)
        append(left_out,
               json_pack("{s:s, s:s}", "pass", r->left_out[i].pass, "why", r->left_out[i].why),
               is_short);
    // clang-format off
    return json_pack(
        "{s:i, s:i, s:s, s:{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f},"
        " s:I, s:f, s:I, s:{s:I, s:I, s:I}, s:f, s:o, s:{s:i, s:f}, s:I, s:o}",
        "width", f->last_width, "height", f->last_height,
        "quality", (unsigned)r->quality < 3 ? qualities[r->quality] : "?",
        "ms", "queue", r->queue_ms, "decode", r->decode_ms, "plan", r->plan_ms,
            "primary", r->primary_ms, "shade", r->shade_ms, "shadow", r->shadow_ms,
            "composite", r->composite_ms, "encode", r->encode_ms,
        "lighting_sequence", (json_int_t)r->lighting_sequence,
        "lighting_age_ms", r->lighting_age_ms,
        "lights_used", (json_int_t)r->lights_used,
        "rays", "primary", (json_int_t)r->rays_primary, "shadow", (json_int_t)r->rays_shadow,
            "secondary", (json_int_t)r->rays_secondary,
        "estimated_error", r->estimated_error, "budget", make_budget(f),
        "refined", "passes", (int)r->refined_passes, "error", r->refined_error,
        "virtual_pixels", (json_int_t)r->virtual_pixels, "left_out", left_out);
    // clang-format on
}

static json_t *make_dropped(const struct gn_room_figures *f, bool *is_short)
{
    json_t *list = json_array();
    for (int i = 0; i <= GN_MSG_DROP_REASON_INTERNAL; i++) {
        if (f->dropped_by_reason[i])
            append(list,
                   json_pack("{s:i, s:s, s:I}", "reason", i, "text",
                             gn_wire_get_drop_text((enum gn_msg_drop_reason)i), "count",
                             (json_int_t)f->dropped_by_reason[i]),
                   is_short);
    }
    return list;
}

static json_t *make_room(struct gn_room *room, bool *is_short)
{
    struct gn_room_figures *f = calloc(1, sizeof(*f));
    if (!f)
        return NULL;
    gn_room_get_figures(room, f);
    // clang-format off
    json_t *json = json_pack(
        "{s:s, s:{s:i, s:i, s:i}, s:i, s:i, s:I, s:I, s:I, s:o, s:I, s:I, s:I,"
        " s:I, s:I, s:I, s:I, s:i, s:i, s:I, s:I, s:I, s:o,"
        " s:{s:f, s:f, s:f}, s:f, s:{s:f, s:f}, s:{s:f, s:I, s:I}, s:o, s:o, s:o, s:o}",
        "name", gn_room_get_options(room)->name,
        "scene", "objects", f->n_objects, "real_triangles", f->n_real_triangles,
            "virtual_triangles", f->n_virtual_triangles,
        "viewers", f->n_viewers, "probes", f->n_probes,
        "frames_in", (json_int_t)f->frames_in, "frames_out", (json_int_t)f->frames_out,
        "frames_dropped", (json_int_t)f->frames_dropped, "dropped", make_dropped(f, is_short),
        "environment_frames_in", (json_int_t)f->environment_in,
        "environment_frames_superseded", (json_int_t)f->environment_superseded,
        "environment_frames_refused", (json_int_t)f->environment_refused,
        "emitter_frames_in", (json_int_t)f->emitter_in,
        "emitter_frames_superseded", (json_int_t)f->emitter_superseded,
        "emitter_frames_refused", (json_int_t)f->emitter_refused,
        "emitter_frames_shown", (json_int_t)f->emitter_shown, "near_lights", f->n_near,
        "trackers", f->n_trackers, "poses_in", (json_int_t)f->poses_in,
        "poses_late", (json_int_t)f->poses_late, "poses_refused", (json_int_t)f->poses_refused,
        "movable", make_movable(room, is_short),
        "latency_ms", "p50", f->latency_p50_ms, "p90", f->latency_p90_ms, "p99", f->latency_p99_ms,
        "busy_p50_ms", f->busy_p50_ms,
        "holdable_fps_640x480", "room", f->holdable_fps_room, "viewer", f->holdable_fps_viewer,
        "budget", "ms", gn_room_get_options(room)->budget_ms,
            "frames", (json_int_t)f->budget_frames, "misses", (json_int_t)f->budget_misses,
        "light", make_light(f), "lit_by", make_probes(room, is_short),
        "last_receipt", make_receipt(f, is_short),
        "sessions", make_sessions(room, is_short));
    // clang-format on
    free(f);
    return json;
}

struct config_list {
    json_t *list;
    bool *is_short;
};

static void add_value(void *context, const char *section, const char *name, const char *key,
                      const char *value, const char *source)
{
    struct config_list *c = context;
    char *texts[] = {strdup(value), strdup(source)}; // they hold paths: any bytes
    for (size_t i = 0; i < GN_ARRAY_LEN(texts) && texts[i]; i++)
        gn_text_clean(texts[i]);
    append(c->list,
           json_pack("{s:s?, s:s?, s:s, s:s, s:s}", "section", section, "name", name, "key", key,
                     "value", texts[0], "source", texts[1]),
           c->is_short);
    free(texts[0]);
    free(texts[1]);
}

static json_t *make_transport(const struct gn_http_view *view)
{
    struct gn_transport_figures t = {0};
    view->options.get_transport(view->options.transport_context, &t);
    return json_pack("{s:i, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", //
                     "connections", t.connections, "accepted", (json_int_t)t.accepted,
                     "refused_full", (json_int_t)t.refused_full, "protocol_errors",
                     (json_int_t)t.protocol_errors, "timeouts", (json_int_t)t.timeouts, "stalled",
                     (json_int_t)t.stalled, "bytes_in", (json_int_t)t.bytes_in, "bytes_out",
                     (json_int_t)t.bytes_out);
}

/** Prints and frees json. */
static int finish(json_t *json, bool is_short, struct gn_document *out)
{
    char *text =
        json && !is_short ? json_dumps(json, JSON_INDENT(1) | JSON_REAL_PRECISION(7)) : NULL;
    json_decref(json);
    if (!text)
        return -ENOMEM;
    *out = (struct gn_document){text, strlen(text), "application/json"};
    return 0;
}

int gn_http_make_status(const struct gn_http_view *view, struct gn_document *out)
{
    bool is_short = false;
    json_t *json = json_object(), *rooms = json_array(), *values = json_array();
    for (int i = 0; i < view->options.n_rooms; i++)
        append(rooms, make_room(view->options.rooms[i], &is_short), &is_short);
    struct config_list list = {values, &is_short};
    gn_options_visit(view->options.config, add_value, &list);
    put(json, "name", json_string(view->options.server_name), &is_short);
    put(json, "version", json_string(GN_VERSION), &is_short);
    put(json, "protocol",
        json_pack("{s:i, s:i}", "min", GN_PROTO_VERSION_MIN, "max", GN_PROTO_VERSION_MAX),
        &is_short);
    put(json, "uptime_s", json_real(get_ms_since(view->start_ns) * 1e-3), &is_short);
    put(json, "network", make_transport(view), &is_short);
    put(json, "rooms", rooms, &is_short);
    put(json, "configuration", values, &is_short);
    return finish(json, is_short, out);
}

int gn_http_make_ready(const struct gn_http_view *view, bool *out_is_ready, struct gn_document *out)
{
    bool is_short = false;
    struct gn_transport_figures transport = {0};
    view->options.get_transport(view->options.transport_context, &transport);
    json_t *rooms = json_array();
    for (int i = 0; i < view->options.n_rooms; i++) {
        struct gn_room_figures f;
        gn_room_get_figures(view->options.rooms[i], &f);
        // A room exists only with its scene committed and its threads running.
        append(rooms,
               json_pack("{s:s, s:b, s:i, s:b}", "name",
                         gn_room_get_options(view->options.rooms[i])->name, "scene", 1, "triangles",
                         f.n_real_triangles + f.n_virtual_triangles, "lit", f.has_light),
               &is_short);
    }
    *out_is_ready = transport.is_serving;
    return finish(json_pack("{s:b, s:o}", "ready", transport.is_serving, "rooms", rooms), is_short,
                  out);
}
