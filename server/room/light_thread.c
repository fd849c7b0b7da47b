/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The light thread: the probes' newest environment frames, in turn, to published lighting states.
 */
#include "server/room/light_thread.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/log.h"
#include "server/room/environment.h"
#include "server/room/same_frame.h"

GN_LOG_TOPIC("room");

/** What of a lighting state somebody in the room can use now. */
struct wants {
    bool sh, lights, pyramid;
    int n_lights; // 0: as the options say
};

/** What there is to do. */
struct work {
    struct wants wants;
    bool is_short; // a probe's light lacks some of that
    bool has_job;
    struct gn_probe_work probe; // where has_job
    bool is_stale;              // the probes' lights are to be joined anew
    bool has_picture;
    struct gn_emitter_job picture;   // where has_picture
    struct gn_subscribers newcomers; // who has not been sent the states that are there
    int n_lights;                    // > 0 where newcomers.n > 0
    struct gn_lighting_state *lights[GN_PROBES_MAX]; // references: each probe's
};

/**
 * Frames rest in their slots while nobody needs light. But until light was made from one frame of a
 * probe, its frames are worked on: it is told what is wrong with them though nobody looks.
 */
static bool is_light_wanted_locked(struct gn_room *room) GN_REQUIRES(room->mu)
{
    if (room->n_viewers > 0 || room->n_subscribers > 0)
        return true;
    return room->light_asked_ns > 0 &&
           gn_clock_get_monotonic_ns() - room->light_asked_ns < GN_ROOM_LOOK_NS;
}

static struct wants get_wants_locked(const struct gn_room *room) GN_REQUIRES(room->mu)
{
    bool is_looked_at = room->light_asked_ns > 0 &&
                        gn_clock_get_monotonic_ns() - room->light_asked_ns < GN_ROOM_LOOK_NS;
    return (struct wants){.n_lights = room->wanted_lights,
                          .pyramid = !room->needs.why_no_pyramid,
                          .sh = !room->needs.why_no_sh || room->n_subscribers > 0,
                          .lights = !room->needs.why_no_lights || room->n_subscribers > 0 ||
                                    is_looked_at};
}

static bool lacks(const struct gn_lighting_state *light, struct wants wants)
{
    return (wants.sh && !light->has_sh) || (wants.lights && !light->has_lights) ||
           (wants.pyramid && !light->pyramid);
}

/** False where completing it has failed: that is tried again with the next frame only. */
static bool is_light_short_locked(const struct gn_room *room, struct wants wants)
    GN_REQUIRES(room->mu)
{
    for (int i = 0; i < GN_PROBES_MAX && !room->has_failed_to_complete; i++) {
        const struct gn_lighting_state *light = room->probes.slots[i].light;
        if (light && lacks(light, wants))
            return true;
    }
    return false;
}

/** Waits for something to do. False: the room stops. */
static bool wait_for_work(struct gn_room *room, struct work *out)
{
    memset(out, 0, sizeof(*out));
    gn_mutex_lock(&room->mu);
    while (!room->is_stopping) {
        out->wants = get_wants_locked(room);
        out->is_short = is_light_short_locked(room, out->wants);
        if (out->is_short)
            break; // before anybody is told of it
        gn_subscribers_take_locked(room, true, &out->newcomers);
        int newest;
        if (out->newcomers.n > 0)
            out->n_lights = gn_probes_get_lights(&room->probes, out->lights, &newest);
        out->has_job = gn_probes_take(&room->probes, is_light_wanted_locked(room), &out->probe);
        out->has_picture =
            gn_screens_take(&room->screens, is_light_wanted_locked(room), &out->picture);
        out->is_stale = room->is_light_stale;
        if (out->has_job || out->has_picture || out->n_lights > 0 || out->is_stale)
            break;
        gn_cond_wait(&room->light_wake, &room->mu);
    }
    gn_mutex_unlock(&room->mu);
    return out->has_job || out->has_picture || out->n_lights > 0 || out->is_stale || out->is_short;
}

/** What is told of a state's making. */
static void count_state_locked(struct gn_room *room, const struct gn_lighting_state *state,
                               bool is_same) GN_REQUIRES(room->mu)
{
    struct gn_room_figures *f = &room->figures;
    f->light_published++;
    f->light_ms_map = state->ms_map;
    f->has_sh = state->has_sh;
    f->sh_order = state->irradiance.order;
    f->n_sh_lights = state->irradiance.n_lights;
    f->sh_lambda = state->irradiance.lambda;
    f->sh_min = state->irradiance.min_luminance;
    f->light_ms_sh = state->ms_sh;
    f->light_ms_lights = state->ms_lights;
    f->light_ms_temporal = state->ms_temporal;
    f->environment_same += is_same;
    f->light_without_sh += !state->has_sh;
    f->light_without_lights += !state->has_lights;
    f->light_in_time = state->in_time;
    f->light_births += (uint64_t)state->in_time.n_births;
    f->light_deaths += (uint64_t)state->in_time.n_deaths;
    f->light_snaps += (uint64_t)state->in_time.n_snaps;
    f->light_holds += state->in_time.verdict == GN_TEMPORAL_HOLD;
}

/** Says once of each probe that its sensor could not see how bright something is: the sun, or a
 * lamp, is darker in its map than in the room. */
static void warn_of_clipping(struct gn_room *room, uint64_t probe_id,
                             const struct gn_lighting_state *state)
{
    int n = state->map->figures.n_clipped;
    if (n == 0)
        return;
    gn_mutex_lock(&room->mu);
    struct gn_room_session *s = gn_room_find_locked(room, probe_id);
    bool is_first = s && !s->was_clipped;
    if (s)
        s->was_clipped = true;
    gn_mutex_unlock(&room->mu);
    if (is_first)
        gn_log(GN_LOG_WARN,
               "room %s: session %llu: environment frame %llu has %d clipped pixels, at the "
               "sensor's largest code: what is brighter is lost; a shorter exposure or a filter "
               "keeps it",
               room->name, (unsigned long long)probe_id, (unsigned long long)state->sequence, n);
}

/** Says once of each probe that another one's light is from the same place: the room then has the
 * mean of both, which is seldom meant. */
static void warn_of_same_place(struct gn_room *room, uint64_t probe_id)
{
    uint64_t others[GN_PROBES_MAX];
    char name[64] = "";
    gn_mutex_lock(&room->mu);
    struct gn_room_session *s = gn_room_find_locked(room, probe_id);
    int n = s && !s->was_doubled ? gn_probes_find_same_place(&room->probes, probe_id, others) : 0;
    bool is_first = n > 0;
    for (int i = 0; i < n; i++) { // one line says it of both
        struct gn_room_session *other = gn_room_find_locked(room, others[i]);
        if (other)
            other->was_doubled = true;
    }
    if (is_first) {
        s->was_doubled = true;
        memcpy(name, s->figures.name, sizeof(name));
    }
    gn_mutex_unlock(&room->mu);
    if (is_first)
        gn_log(
            GN_LOG_WARN,
            "room %s: session %llu (%s) lights the room from the same place as session %llu: the "
            "mean of both is taken; right would be one of them, or, in each one's setup, the "
            "\"position\" where it stands",
            room->name, (unsigned long long)probe_id, name, (unsigned long long)others[0]);
}

/** Makes the state, of the worked frame or NULL, its probe's light; takes both. */
static void publish(struct gn_room *room, uint64_t probe_id, struct gn_lighting_state *state,
                    struct gn_worked_frame *worked, double ms_decode, bool is_same)
{
    struct gn_subscribers subscribers;
    struct gn_lighting_state *mine = gn_lighting_state_ref(state);
    struct gn_probe old[GN_PROBES_MAX];
    int n_old;
    gn_mutex_lock(&room->mu);
    bool is_there = gn_probes_set_light(&room->probes, probe_id, state, worked,
                                        gn_clock_get_monotonic_ns(), old, &n_old);
    if (is_there) {
        room->figures.light_ms_decode = ms_decode;
        room->has_failed_to_complete = false;
        count_state_locked(room, mine, is_same);
    }
    gn_mutex_unlock(&room->mu);
    for (int i = 0; i < n_old; i++)
        gn_probe_finish(&old[i]);
    if (is_there) {
        warn_of_clipping(room, probe_id, mine);
        warn_of_same_place(room, probe_id);
        gn_light_join(room);
        gn_mutex_lock(&room->mu);
        is_there = gn_light_is_reached_locked(room, mine->stream); // its probe may have left
        gn_probes_settle(&room->probes, probe_id);
        gn_cond_signal(&room->render_wake);
        gn_subscribers_take_locked(room, false, &subscribers);
        gn_mutex_unlock(&room->mu);
        if (is_there && subscribers.n > 0)
            gn_subscribers_tell(room, mine, &subscribers);
    }
    gn_lighting_state_unref(&mine);
}

/** The probe's frame gave no light. Takes the worked frame, or NULL. */
static void refuse_environment(struct gn_room *room, const struct gn_environment_job *job,
                               struct gn_worked_frame *worked, int code, const char *sentence)
{
    struct gn_probe old;
    gn_mutex_lock(&room->mu);
    gn_probes_refuse(&room->probes, job->session_id, worked, &old);
    gn_cond_signal(&room->render_wake); // nobody waits for its light any more
    gn_mutex_unlock(&room->mu);
    gn_probe_finish(&old);
    gn_light_refuse(room, job->session_id, GN_WIRE_ENVIRONMENT_FRAME, job->frame.sequence, code,
                    sentence);
}

static struct gn_light_options get_light_options(const struct gn_room *room, struct wants wants)
{
    struct gn_light_options options = room->options.light;
    options.no_sh = !wants.sh;
    options.want_pyramid = wants.pyramid;
    options.no_lights = !wants.lights;
    if (wants.n_lights > 0 && wants.n_lights < GN_LIGHTS_MAX)
        options.n_lights = wants.n_lights;
    return options;
}

/** Somebody can use now what the lights there were made without. */
static void complete_lights(struct gn_room *room, struct wants wants)
{
    struct gn_lighting_state *lights[GN_PROBES_MAX], *complete;
    struct gn_light_options options = get_light_options(room, wants);
    struct gn_error error = {0};
    int newest;
    gn_mutex_lock(&room->mu);
    int n = gn_probes_get_lights(&room->probes, lights, &newest);
    gn_mutex_unlock(&room->mu);
    for (int i = 0; i < n; i++) {
        if (!lacks(lights[i], wants))
            continue;
        int rc =
            gn_lighting_state_complete(lights[i], &options, room->options.pool, &complete, &error);
        if (rc < 0)
            gn_log(GN_LOG_WARN, "room %s: light of frame %llu not completed: %s", room->name,
                   (unsigned long long)lights[i]->sequence, error.text);
        struct gn_lighting_state *old = NULL;
        gn_mutex_lock(&room->mu);
        if (rc == 0)
            old = gn_probes_replace_light(&room->probes, lights[i], complete);
        room->has_failed_to_complete = room->has_failed_to_complete || rc < 0;
        gn_mutex_unlock(&room->mu);
        gn_lighting_state_unref(&old);
    }
    gn_light_unref_all(lights, n);
    gn_light_join(room);
}

/** The frame is what its probe's next ones are compared with; where there is no memory they are all
 * worked on. */
static void keep_worked(struct gn_worked_frame **worked, const struct gn_environment_job *job)
{
    if (!*worked)
        *worked = calloc(1, sizeof(**worked));
    if (*worked)
        gn_worked_frame_keep(*worked, job);
}

/** Puts the completed state in the state's place. */
static int complete(struct gn_room *room, const struct gn_light_options *options,
                    struct gn_lighting_state **state, struct gn_error *out_error)
{
    struct gn_lighting_state *old = *state;
    int rc = gn_lighting_state_complete(old, options, room->options.pool, state, out_error);
    gn_lighting_state_unref(&old);
    return rc;
}

/** From one frame to its probe's light; takes the work. decoder: NULL where there is no memory. */
static void make_light(struct gn_room *room, struct gn_environment_decoder *decoder,
                       struct gn_probe_work *work, struct wants wants)
{
    struct gn_error error = {0};
    struct gn_environment_frame frame;
    struct gn_lighting_state *state = NULL;
    struct gn_light_options options = get_light_options(room, wants);
    struct gn_environment_job *job = &work->job;
    const struct gn_lighting_state *previous = work->light; // its tables are used again
    int64_t start_ns = gn_clock_get_monotonic_ns();
    double ms_decode = 0;
    int rc = 0;
    options.previous = previous;
    options.stream = job->session_id;
    bool is_same = work->worked && previous && previous->stream == job->session_id &&
                   previous->n_asked == options.n_lights &&
                   gn_worked_frame_is_same(work->worked, job, room->options.environment_noise);
    if (is_same) {
        rc = gn_lighting_state_advance(previous, job->frame.sequence, job->frame.capture_time_ns,
                                       &options, &state);
        if (rc < 0)
            (void)gn_error_set(&error, rc, "out of memory");
        else if (lacks(state, wants))
            rc = complete(room, &options, &state, &error);
    } else {
        rc = decoder ? gn_environment_decode(decoder, &job->frame, job->payload, &frame, &error)
                     : gn_error_set(&error, -ENOMEM, "out of memory");
        ms_decode = gn_clock_get_ms_between(start_ns, gn_clock_get_monotonic_ns());
        if (rc == 0)
            rc = gn_lighting_state_create(&frame, &room->options.map, &options, room->options.pool,
                                          &state, &error);
        if (rc == 0)
            keep_worked(&work->worked, job);
    }
    if (rc < 0)
        refuse_environment(room, job, work->worked, rc, error.text);
    else
        publish(room, job->session_id, state, work->worked, ms_decode, is_same);
    gn_buf_unref(&job->payload);
    gn_lighting_state_unref(&work->light);
}

void gn_room_run_light(void *context)
{
    struct gn_room *room = context;
    struct gn_environment_decoder *decoder = calloc(1, sizeof(*decoder));
    struct gn_screen_decoder screen_decoder = {0};
    struct work work;
    while (wait_for_work(room, &work)) {
        if (work.is_short)
            complete_lights(room, work.wants);
        if (work.is_stale)
            gn_light_join(room);
        for (int i = 0; i < work.n_lights; i++)
            gn_subscribers_tell(room, work.lights[i], &work.newcomers);
        gn_light_unref_all(work.lights, work.n_lights);
        if (work.has_picture)
            gn_light_show_picture(room, &screen_decoder, &work.picture);
        if (work.has_job)
            make_light(room, decoder, &work.probe, work.wants);
    }
    gn_screen_decoder_finish(&screen_decoder);
    if (decoder)
        gn_environment_decoder_finish(decoder);
    free(decoder);
}
