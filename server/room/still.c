/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/still.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"

/** A view that has not been seen for so long gives its place away. */
#define REST_NS (2 * GN_NS_PER_S)
/** Lights of a pass: as many as the view has, within these. */
#define LIGHTS_MIN 8
#define LIGHTS_MAX 128

/** One view. */
struct slot {
    bool is_taken;
    bool is_begun; // the progressive picture is the view's
    const char *why_broken;
    uint64_t session_id;
    size_t index;
    struct gn_camera camera;
    struct gn_lighting_state *light; // a reference
    struct gn_render_options options;
    uint64_t version; // of the scene
    int64_t seen_ns;
    double ordinary_ms; // that rendering it takes
    int n_lights;
    struct gn_progressive *progressive;
};

struct gn_still {
    const struct gn_scene *scene; // borrowed: as it stands now
    struct gn_renderer *renderer; // its own: the room's keeps its caches
    struct slot slots[GN_STILL_VIEWS];
};

int gn_still_create(const struct gn_scene *scene, struct gn_pool *pool, struct gn_still **out_still,
                    struct gn_error *out_error)
{
    *out_still = NULL;
    struct gn_still *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->scene = scene;
    int rc = gn_renderer_create(scene, pool, &s->renderer, out_error);
    for (int i = 0; i < GN_STILL_VIEWS && rc == 0; i++)
        rc = gn_progressive_create(s->renderer, pool, &s->slots[i].progressive, out_error);
    if (rc < 0)
        gn_still_destroy(&s);
    *out_still = s;
    return rc;
}

static void give_up(struct slot *slot)
{
    gn_progressive_rest(slot->progressive);
    gn_lighting_state_unref(&slot->light);
    slot->is_taken = slot->is_begun = false;
    slot->why_broken = NULL;
}

void gn_still_destroy(struct gn_still **still)
{
    struct gn_still *s = *still;
    *still = NULL;
    if (!s)
        return;
    for (int i = 0; i < GN_STILL_VIEWS; i++) {
        gn_lighting_state_unref(&s->slots[i].light);
        gn_progressive_destroy(&s->slots[i].progressive);
    }
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

/** The maps and emitters themselves: lights that are still being smoothed tend to them. */
static bool is_same_light(const struct gn_lighting_state *a, const struct gn_lighting_state *b)
{
    bool is_same = a->map == b->map && a->emission == b->emission && a->n_others == b->n_others;
    for (int i = 0; i < a->n_others && is_same; i++)
        is_same = a->others[i]->map == b->others[i]->map;
    return is_same;
}

static struct slot *find_slot(struct gn_still *still, const struct gn_still_view *view)
{
    struct slot *free_slot = NULL;
    for (int i = 0; i < GN_STILL_VIEWS; i++) {
        struct slot *slot = &still->slots[i];
        if (slot->is_taken && slot->session_id == view->session_id && slot->index == view->index)
            return slot;
        if (slot->is_taken && view->now_ns - slot->seen_ns > REST_NS)
            give_up(slot);
        if (!slot->is_taken && !free_slot)
            free_slot = slot;
    }
    return free_slot;
}

static const char *find_change(const struct gn_still *still, const struct slot *slot,
                               const struct gn_still_view *view)
{
    if (!slot->is_taken)
        return "the view's first frame";
    if (slot->options.quality != view->options->quality)
        return "another quality than the last frame's";
    if (!is_same_camera(&slot->camera, view->camera))
        return "the camera has moved since the last frame";
    if (!is_same_light(slot->light, view->light))
        return "the light has changed since the last frame";
    if (slot->version != still->scene->version)
        return "an object has moved since the last frame";
    return NULL;
}

const char *gn_still_look(struct gn_still *still, const struct gn_still_view *view, int *out_slot)
{
    const char *why = gn_progressive_get_obstacle(still->scene, view->camera, view->options);
    *out_slot = -1;
    if (why)
        return why;
    struct slot *slot = find_slot(still, view);
    if (!slot)
        return "two other views are being refined";
    *out_slot = (int)(slot - still->slots);
    why = find_change(still, slot, view);
    if (why) {
        give_up(slot);
        slot->is_taken = true;
        slot->session_id = view->session_id;
        slot->index = view->index;
        slot->camera = *view->camera;
        slot->light = gn_lighting_state_ref(view->light);
        slot->version = still->scene->version;
    }
    slot->options = *view->options;
    slot->seen_ns = view->now_ns;
    return why ? why : slot->why_broken;
}

void gn_still_note(struct gn_still *still, int slot, const struct gn_render_report *report)
{
    if (slot < 0)
        return;
    still->slots[slot].ordinary_ms = report->ms_total;
    still->slots[slot].n_lights = report->n_lights;
}

/** The first step renders once more; those to come add passes. */
static int begin(struct slot *slot, struct gn_render_report *report, struct gn_error *out_error)
{
    int n = slot->n_lights < LIGHTS_MIN ? LIGHTS_MIN : slot->n_lights;
    const struct gn_progressive_options own = {.n_lights = n > LIGHTS_MAX ? LIGHTS_MAX : n};
    int rc = gn_progressive_begin(slot->progressive, &slot->camera, slot->light, &slot->options,
                                  &own, report, out_error);
    slot->is_begun = rc == 0;
    return rc;
}

/** What a view that has converged leaves out. */
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

static int add_passes(struct slot *slot, gn_still_report_fn tell, void *context,
                      struct gn_error *out_error)
{
    const struct gn_progressive_figures *f = gn_progressive_get_figures(slot->progressive);
    int64_t start_ns = gn_clock_get_monotonic_ns();
    double spent_ms = 0, pass_ms = 0;
    while (!f->why_done && spent_ms + pass_ms <= slot->ordinary_ms) {
        struct gn_render_report report;
        int rc = gn_progressive_add_pass(slot->progressive, &report, out_error);
        if (rc < 0)
            return rc;
        gn_progressive_add_plan(&report, true, "nothing has changed since the last frame");
        tell(context, &report);
        double now_ms = 1e-6 * (double)(gn_clock_get_monotonic_ns() - start_ns);
        pass_ms = now_ms - spent_ms;
        spent_ms = now_ms;
    }
    return 0;
}

int gn_still_refine(struct gn_still *still, int index, gn_still_report_fn tell, void *context,
                    struct gn_still_picture *out_picture, struct gn_error *out_error)
{
    struct slot *slot = &still->slots[index];
    const struct gn_progressive_figures *f = gn_progressive_get_figures(slot->progressive);
    int rc = 0;
    if (!slot->is_begun) {
        struct gn_render_report report;
        rc = begin(slot, &report, out_error);
        if (rc == 0) {
            gn_progressive_add_plan(&report, true, "nothing has changed since the last frame");
            tell(context, &report);
        }
    } else if (f->why_done) {
        tell_rest(f->why_done, tell, context);
    } else {
        rc = add_passes(slot, tell, context, out_error);
    }
    if (rc < 0) {
        gn_progressive_rest(slot->progressive);
        slot->is_begun = false;
        slot->why_broken = "refining failed: no memory";
        return rc;
    }
    *out_picture = (struct gn_still_picture){gn_progressive_get_layers(slot->progressive), *f};
    return 0;
}
