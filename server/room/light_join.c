/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/light_thread.h"

#include <string.h>

#include "common/log.h"
#include "server/light/blend.h"

GN_LOG_TOPIC("room");

void gn_light_unref_all(struct gn_lighting_state **lights, int n)
{
    for (int i = 0; i < n; i++)
        gn_lighting_state_unref(&lights[i]);
}

/** Makes the state the room's light; takes the reference. n_lights: distant ones, < 0: as before.
 */
static void show(struct gn_room *room, struct gn_lighting_state *state, int n_lights)
{
    gn_mutex_lock(&room->mu);
    struct gn_lighting_state *old = room->light;
    room->light = state;
    room->figures.has_light = true;
    room->figures.light_sequence = state->sequence;
    room->figures.light_capture_ns = state->capture_time_ns;
    room->figures.n_near = state->n_near;
    if (n_lights >= 0)
        room->figures.n_lights = n_lights;
    gn_cond_signal(&room->render_wake);
    gn_mutex_unlock(&room->mu);
    gn_lighting_state_unref(&old);
}

static bool gives_light(const struct gn_emission *emission)
{
    for (int i = 0; emission && i < emission->n_lights; i++)
        for (int c = 0; c < 3; c++)
            if (emission->lights[i].intensity[c] > 0)
                return true;
    return false;
}

/** Shows what the emitters send now, in the light that is there or, where they give some, in the
 * dark. 0 or a negative errno. */
static int show_emission(struct gn_room *room)
{
    struct gn_emission *emission = gn_emitters_get_emission(room->emitters);
    struct gn_lighting_state *state = NULL;
    struct gn_error error;
    gn_mutex_lock(&room->mu);
    struct gn_lighting_state *light = room->light ? gn_lighting_state_ref(room->light) : NULL;
    gn_mutex_unlock(&room->mu);
    int rc = 0;
    if (light)
        rc = gn_lighting_state_replace_emission(light, emission, &state);
    else if (gives_light(emission))
        rc = gn_lighting_state_create_dark(emission, &room->options.light,
                                           gn_clock_get_monotonic_ns(), &state, &error);
    if (rc == 0 && state)
        show(room, state, light ? -1 : 0);
    gn_lighting_state_unref(&light);
    gn_emission_unref(&emission);
    return rc;
}

void gn_light_show_picture(struct gn_room *room, struct gn_screen_decoder *decoder,
                           struct gn_emitter_job *job)
{
    struct gn_error error = {0};
    int rc = gn_screen_decode(decoder, &job->frame, job->payload, &error);
    if (rc == 0)
        rc = gn_emitters_set_picture(room->emitters, job->stream, &decoder->linear, &error);
    if (rc == 0 && (rc = show_emission(room)) < 0)
        gn_error_set(&error, rc, "out of memory");
    if (rc < 0) {
        gn_light_refuse(room, job->session_id, GN_WIRE_EMITTER_FRAME, job->frame.sequence, rc,
                        error.text);
    } else {
        gn_mutex_lock(&room->mu);
        room->figures.emitter_shown++;
        gn_mutex_unlock(&room->mu);
    }
    gn_buf_unref(&job->payload);
}

static bool has_stream(struct gn_lighting_state *const *lights, int n, uint64_t stream)
{
    for (int i = 0; i < n; i++)
        if (lights[i]->stream == stream)
            return true;
    return false;
}

/** How far each probe's light has come that is the room's now: frames may wait for it, and
 * subscribers forget the others. */
static void set_reached(struct gn_room *room, struct gn_lighting_state *const *lights, int n)
{
    struct gn_reached gone[GN_PROBES_MAX];
    int n_gone = 0;
    gn_mutex_lock(&room->mu);
    for (int i = 0; i < room->n_reached; i++)
        if (!has_stream(lights, n, room->reached[i].stream))
            gone[n_gone++] = room->reached[i];
    room->n_reached = n;
    for (int i = 0; i < n; i++) {
        room->reached[i].stream = lights[i]->stream;
        room->reached[i].sequence = lights[i]->sequence;
    }
    gn_cond_signal(&room->render_wake);
    gn_mutex_unlock(&room->mu);
    for (int i = 0; i < n_gone; i++)
        gn_subscribers_tell_gone(room, &gone[i]);
}

bool gn_light_is_reached_locked(const struct gn_room *room, uint64_t stream)
{
    for (int i = 0; i < room->n_reached; i++)
        if (room->reached[i].stream == stream)
            return true;
    return false;
}

void gn_light_join(struct gn_room *room)
{
    struct gn_lighting_state *lights[GN_PROBES_MAX], *joined;
    int newest, n_lights = 0;
    gn_mutex_lock(&room->mu);
    int n = gn_probes_get_lights(&room->probes, lights, &newest);
    room->is_light_stale = false; // a probe that leaves from here on makes it so again
    gn_mutex_unlock(&room->mu);
    if (n == 0) {
        if (show_emission(room) < 0)
            gn_log(GN_LOG_WARN, "room %s: the scene's own light not shown: out of memory",
                   room->name);
        return;
    }
    for (int i = 0; i < n; i++)
        n_lights += lights[i]->n_lights;
    struct gn_emission *emission = gn_emitters_get_emission(room->emitters);
    int rc = gn_lighting_state_join(lights, n, newest, &joined);
    if (rc == 0 && emission) {
        struct gn_lighting_state *dark = joined;
        rc = gn_lighting_state_replace_emission(dark, emission, &joined);
        gn_lighting_state_unref(&dark);
    }
    gn_emission_unref(&emission);
    if (rc == 0) {
        show(room, joined, n_lights);
        set_reached(room, lights, n);
    } else {
        gn_log(GN_LOG_WARN, "room %s: the lights of %d probes not joined: %s", room->name, n,
               strerror(-rc));
    }
    gn_light_unref_all(lights, n);
}
