/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/still.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "server/room/scheduler.h"

/** Lights of a pass: as many as the view has, within these. */
#define LIGHTS_MIN 8
#define LIGHTS_MAX 128
/** Share of a new pass in what passes are known to take. */
#define PASS_SHARE 0.25
/** Frames in a row without time for a pass, after which a place is given up in which nothing can be
 * seen yet: time that is left varies. */
#define UNFIT_MAX 8
/** Views that are remembered: all that a room can have. */
#define VIEWS_MAX (GN_ROOM_MAX_VIEWERS * GN_LIMIT_VIEWS)

static const char no_time[] = "a pass takes longer than the frame's budget";

/** A picture that is refined, and its memory. */
struct slot {
    bool is_taken;
    bool is_begun;                      // the progressive picture is the view's
    int64_t left_ns;                    // when the last view left it
    struct gn_progressive *progressive; // NULL: it has no memory
};

/** A view of late, still or not. */
struct seen {
    bool is_known;
    const char *why_broken; // refining it failed; until it changes
    uint64_t session_id;
    size_t index;
    struct gn_camera camera;
    struct gn_lighting_state *light; // a reference
    struct gn_render_options options;
    uint64_t version; // of the scene
    int64_t seen_ns;
    double left_ms;     // of the budget of the frame seen last
    double ordinary_ms; // that rendering it takes
    int n_lights;
    double pass_ms;    // that a pass takes, smoothed; 0: not known
    int64_t pass_ns;   // when the last one was
    int n_unfit;       // frames in a row without time for one
    struct slot *slot; // NULL: it is not refined
};

struct gn_still {
    const struct gn_scene *scene; // borrowed: as it stands now
    struct gn_pool *pool;         // borrowed, may be NULL
    struct gn_renderer *renderer; // its own: the room's keeps its caches
    struct slot slots[GN_STILL_VIEWS];
    struct seen seen[VIEWS_MAX];
};

int gn_still_create(const struct gn_scene *scene, struct gn_pool *pool, struct gn_still **out_still,
                    struct gn_error *out_error)
{
    *out_still = NULL;
    struct gn_still *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->scene = scene;
    s->pool = pool;
    int rc = gn_renderer_create(scene, pool, &s->renderer, out_error);
    if (rc < 0)
        gn_still_destroy(&s);
    *out_still = s;
    return rc;
}

/** The slot's memory stays for the next view, for a while. */
static void leave_slot(struct seen *seen, int64_t now_ns)
{
    struct slot *slot = seen->slot;
    seen->slot = NULL;
    seen->n_unfit = 0;
    if (!slot)
        return;
    if (slot->progressive)
        gn_progressive_rest(slot->progressive);
    slot->is_taken = slot->is_begun = false;
    slot->left_ns = now_ns;
}

static void forget(struct seen *seen, int64_t now_ns)
{
    struct slot *slot = seen->slot;
    leave_slot(seen, now_ns);
    if (slot)
        gn_progressive_destroy(&slot->progressive);
    gn_lighting_state_unref(&seen->light);
    *seen = (struct seen){0};
}

void gn_still_cancel(struct gn_still *still)
{
    gn_renderer_cancel(still->renderer);
}

void gn_still_destroy(struct gn_still **still)
{
    struct gn_still *s = *still;
    *still = NULL;
    if (!s)
        return;
    for (int i = 0; i < VIEWS_MAX; i++)
        forget(&s->seen[i], 0);
    for (int i = 0; i < GN_STILL_VIEWS; i++)
        gn_progressive_destroy(&s->slots[i].progressive);
    gn_renderer_destroy(&s->renderer);
    free(s);
}

void gn_still_set_scene(struct gn_still *still, const struct gn_scene *posed)
{
    still->scene = posed;
    gn_renderer_set_scene(still->renderer, posed);
}

static bool is_same_camera(const struct gn_camera *a, const struct gn_camera *b)
{
    return a->width == b->width && a->height == b->height && a->fx == b->fx && a->fy == b->fy &&
           a->cx == b->cx && a->cy == b->cy &&
           memcmp(a->distortion, b->distortion, sizeof(a->distortion)) == 0 &&
           memcmp(a->world_from_camera.rotation, b->world_from_camera.rotation,
                  sizeof(a->world_from_camera.rotation)) == 0 &&
           memcmp(a->world_from_camera.translation, b->world_from_camera.translation,
                  sizeof(a->world_from_camera.translation)) == 0;
}

/** True where smoothed lights are within a thousandth of all light of each other: what is refined
 * tends to the map's own light, and to begin while lights still follow it would show a step. */
static bool has_settled(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    double moved = 0, all = 0;
    if (a->n_lights != b->n_lights)
        return false;
    for (int k = 0; k < 3; k++) {
        moved += fabs(a->total_irradiance[k] - b->total_irradiance[k]);
        all += b->total_irradiance[k];
    }
    for (int i = 0; i < a->n_lights; i++) {
        const struct gn_light *x = &a->lights[i], *y = &b->lights[i];
        for (int k = 0; k < 3; k++) {
            moved += fabs((double)x->irradiance[k] - y->irradiance[k]);
            moved += (double)y->irradiance[k] * fabs((double)x->dir_world[k] - y->dir_world[k]);
        }
    }
    return moved <= 1e-3 * all;
}

/** The maps and emitters themselves, and lights that have followed them. */
static bool is_same_light(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    bool is_same = a->map == b->map && a->emission == b->emission && a->n_others == b->n_others &&
                   has_settled(a, b);
    for (int i = 0; i < a->n_others && is_same; i++)
        is_same = a->others[i]->map == b->others[i]->map && has_settled(a->others[i], b->others[i]);
    return is_same;
}

/** Forgets who has left, and frees what nobody has used for as long. */
static void sweep(struct gn_still *still, int64_t now_ns)
{
    for (int i = 0; i < VIEWS_MAX; i++) {
        struct seen *seen = &still->seen[i];
        if (seen->is_known && now_ns - seen->seen_ns > GN_STILL_REST_NS)
            forget(seen, now_ns);
    }
    for (int i = 0; i < GN_STILL_VIEWS; i++) {
        struct slot *slot = &still->slots[i];
        if (!slot->is_taken && now_ns - slot->left_ns > GN_STILL_REST_NS)
            gn_progressive_destroy(&slot->progressive);
    }
}

/** The view as it was, or a place for it: that of the one seen longest ago where all are taken. */
static struct seen *find_seen(struct gn_still *still, const struct gn_still_view *view)
{
    struct seen *place = &still->seen[0];
    for (int i = 0; i < VIEWS_MAX; i++) {
        struct seen *seen = &still->seen[i];
        if (seen->is_known && seen->session_id == view->session_id && seen->index == view->index)
            return seen;
        if (place->is_known && (!seen->is_known || seen->seen_ns < place->seen_ns))
            place = seen;
    }
    forget(place, view->now_ns);
    return place;
}

static const char *find_change(const struct gn_still *still, const struct seen *seen,
                               const struct gn_still_view *view)
{
    if (!seen->is_known)
        return "the view's first frame";
    if (seen->options.quality != view->options->quality)
        return "another quality than the last frame's";
    if (seen->options.no_virtual != view->options->no_virtual ||
        seen->options.no_shadow != view->options->no_shadow)
        return "other things are asked for than in the last frame";
    if (!is_same_camera(&seen->camera, view->camera))
        return "the camera has moved since the last frame";
    if (!is_same_light(seen->light, view->light))
        return "the light has changed since the last frame";
    if (seen->version != still->scene->version)
        return "an object has moved since the last frame";
    return NULL;
}

/** The view is another than it was; what its passes take is about the same, the size being so. */
static void follow(struct gn_still *still, struct seen *seen, const struct gn_still_view *view)
{
    leave_slot(seen, view->now_ns);
    if (seen->camera.width != view->camera->width || seen->camera.height != view->camera->height)
        seen->pass_ms = 0;
    seen->is_known = true;
    seen->why_broken = NULL;
    seen->session_id = view->session_id;
    seen->index = view->index;
    seen->camera = *view->camera;
    gn_lighting_state_unref(&seen->light);
    seen->light = gn_lighting_state_ref(view->light);
    seen->version = still->scene->version;
}

/** A pass that is not known is taken to be as long as an ordinary picture: one will tell. */
static bool has_time(const struct seen *seen)
{
    return (seen->pass_ms > 0 ? seen->pass_ms : seen->ordinary_ms) <= seen->left_ms;
}

/** Why a view that holds still is not refined; NULL: it is, and has a slot. */
static const char *take_slot(struct gn_still *still, struct seen *seen)
{
    if (!has_time(seen))
        return no_time;
    for (int i = 0; i < GN_STILL_VIEWS && !seen->slot; i++) {
        if (!still->slots[i].is_taken)
            seen->slot = &still->slots[i];
    }
    if (!seen->slot)
        return "two other views are being refined";
    seen->slot->is_taken = true;
    return NULL;
}

/** As above, of a view that has a slot. What passes have made better is shown in any case: that
 * takes no time. */
static const char *keep_slot(struct seen *seen)
{
    const struct gn_progressive_figures *f =
        seen->slot->is_begun ? gn_progressive_get_figures(seen->slot->progressive) : NULL;
    if (has_time(seen) || (f && (f->why_done || f->error >= 0))) {
        seen->n_unfit = 0;
        return NULL;
    }
    if (++seen->n_unfit >= UNFIT_MAX)
        leave_slot(seen, seen->seen_ns);
    return no_time;
}

const char *gn_still_look(struct gn_still *still, const struct gn_still_view *view, int *out_place)
{
    const char *why = gn_progressive_get_obstacle(still->scene, view->camera, view->options);
    *out_place = -1;
    sweep(still, view->now_ns);
    if (why)
        return why;
    struct seen *seen = find_seen(still, view);
    *out_place = (int)(seen - still->seen);
    why = find_change(still, seen, view);
    if (why)
        follow(still, seen, view);
    seen->options = *view->options;
    seen->seen_ns = view->now_ns;
    seen->left_ms = view->left_ms;
    if (seen->seen_ns - seen->pass_ns > GN_STILL_PASS_NS)
        seen->pass_ms = 0;
    if (!why)
        why = seen->why_broken;
    if (why)
        return why;
    return seen->slot ? keep_slot(seen) : take_slot(still, seen);
}

void gn_still_note(struct gn_still *still, int place, const struct gn_render_report *report)
{
    if (place < 0)
        return;
    still->seen[place].ordinary_ms = report->ms_total;
    still->seen[place].n_lights = report->n_lights;
}

/** The first step renders once more; those to come add passes. */
static int begin(struct gn_still *still, struct seen *seen, struct gn_render_report *report,
                 struct gn_error *out_error)
{
    struct slot *slot = seen->slot;
    int n = seen->n_lights < LIGHTS_MIN ? LIGHTS_MIN : seen->n_lights;
    const struct gn_progressive_options own = {.n_lights = n > LIGHTS_MAX ? LIGHTS_MAX : n};
    int rc = 0;
    if (!slot->progressive)
        rc = gn_progressive_create(still->renderer, still->pool, &slot->progressive, out_error);
    if (rc == 0)
        rc = gn_progressive_begin(slot->progressive, &seen->camera, seen->light, &seen->options,
                                  &own, report, out_error);
    slot->is_begun = rc == 0;
    return rc;
}

/** What a view that gets no pass leaves out: it has converged, or has no time. */
static void tell_rest(const char *why, gn_still_report_fn tell, void *context)
{
    static const char *const passes[] = {"primary", "shade", "shadow"};
    struct gn_render_report report = {.estimated_error = -1};
    for (int i = 0; i < 3; i++)
        report.plan[report.n_plan++] = (struct gn_plan_entry){
            passes[i], false, "nothing has changed since the last frame: its layers are shown"};
    gn_progressive_add_plan(&report, false, why);
    tell(context, &report);
}

static void learn_pass(struct seen *seen, double ms, int64_t now_ns)
{
    seen->pass_ms = seen->pass_ms > 0 ? seen->pass_ms + PASS_SHARE * (ms - seen->pass_ms) : ms;
    seen->pass_ns = now_ns;
}

/** At least one, for which there is time. */
static int add_passes(struct seen *seen, gn_still_report_fn tell, void *context,
                      struct gn_error *out_error)
{
    struct gn_progressive *progressive = seen->slot->progressive;
    const struct gn_progressive_figures *f = gn_progressive_get_figures(progressive);
    int64_t start_ns = gn_clock_get_monotonic_ns();
    double spent_ms = 0, most_ms = fmin(seen->ordinary_ms, seen->left_ms);
    do {
        struct gn_render_report report;
        int rc = gn_progressive_add_pass(progressive, &report, out_error);
        if (rc < 0)
            return rc;
        gn_progressive_add_plan(&report, true, "nothing has changed since the last frame");
        tell(context, &report);
        double now_ms = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
        learn_pass(seen, now_ms - spent_ms, seen->seen_ns);
        spent_ms = now_ms;
    } while (!f->why_done && spent_ms + seen->pass_ms <= most_ms);
    return 0;
}

static int refine(struct gn_still *still, struct seen *seen, gn_still_report_fn tell, void *context,
                  struct gn_error *out_error)
{
    if (!seen->slot->is_begun) {
        struct gn_render_report report;
        int rc = begin(still, seen, &report, out_error);
        if (rc < 0)
            return rc;
        gn_progressive_add_plan(&report, true, "nothing has changed since the last frame");
        tell(context, &report);
        return 0;
    }
    const char *why_done = gn_progressive_get_figures(seen->slot->progressive)->why_done;
    if (!why_done && has_time(seen))
        return add_passes(seen, tell, context, out_error);
    tell_rest(why_done ? why_done : no_time, tell, context);
    return 0;
}

int gn_still_refine(struct gn_still *still, int place, gn_still_report_fn tell, void *context,
                    struct gn_still_picture *out_picture, struct gn_error *out_error)
{
    struct seen *seen = &still->seen[place];
    struct slot *slot = seen->slot;
    int rc = refine(still, seen, tell, context, out_error);
    if (rc < 0) {
        leave_slot(seen, seen->seen_ns);
        gn_progressive_destroy(&slot->progressive);
        seen->why_broken = "refining failed: no memory";
        return rc;
    }
    *out_picture = (struct gn_still_picture){gn_progressive_get_layers(slot->progressive),
                                             *gn_progressive_get_figures(slot->progressive)};
    return 0;
}
