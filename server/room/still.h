/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Views that hold still. A view whose pose, light and scene are those of its last frame is not
 * rendered again but refined (render/progressive.h), for as long as rendering it took and within
 * the frame's budget, until it has converged; then it costs nothing. Any change is an ordinary
 * frame at once. A view that moves keeps no other from being refined. Owner: the render thread.
 */
#ifndef GN_SERVER_ROOM_STILL_H
#define GN_SERVER_ROOM_STILL_H

#include "common/clock.h"
#include "server/render/progressive.h"

/** Views that are refined at one time: a stereo headset's, or two viewers'. */
#define GN_STILL_VIEWS 2
/** A view that has not been seen for so long is forgotten, its memory freed when any other view of
 * the room is looked at. */
#define GN_STILL_REST_NS (2 * GN_NS_PER_S)
/** So long what a pass took is believed where there is no time for another. */
#define GN_STILL_PASS_NS (30 * GN_NS_PER_S)

/** Thread-safety: unsafe. */
struct gn_still;

/** One view of a frame. Borrowed. */
struct gn_still_view {
    uint64_t session_id;
    size_t index; // of the frame's views
    const struct gn_camera *camera;
    struct gn_lighting_state *light;
    const struct gn_render_options *options;
    int64_t now_ns;
    double left_ms; // of the frame's budget, for this view; INFINITY: it has none
};

/** scene and pool (may be NULL) are borrowed until destroy. 0 or a negative errno and a sentence.
 */
GN_MUST_USE int gn_still_create(const struct gn_scene *scene, struct gn_pool *pool,
                                struct gn_still **out_still, struct gn_error *out_error);
/** Ends a pass, and all later ones, soon. Thread-safety: safe, at any time until destroy. */
void gn_still_cancel(struct gn_still *still);
/** NULL-safe; nulls *still. */
void gn_still_destroy(struct gn_still **still);
/** As gn_renderer_set_scene: posed is borrowed until the next call, or destroy. */
void gn_still_set_scene(struct gn_still *still, const struct gn_scene *posed);

/**
 * Why the view has to be rendered as any, a static sentence; NULL: it is to be refined. *out_place:
 * the view's, until the next look, to be told what becomes of it; -1: nothing.
 */
const char *gn_still_look(struct gn_still *still, const struct gn_still_view *view, int *out_place);
/** The view was rendered as any. */
void gn_still_note(struct gn_still *still, int place, const struct gn_render_report *report);

/** What a refined view shows. */
struct gn_still_picture {
    const struct gn_layers *layers; // borrowed until the next call
    struct gn_progressive_figures figures;
};
/** Of each step's report. */
typedef void (*gn_still_report_fn)(void *context, const struct gn_render_report *report);
/**
 * Refines the view that was looked at by the time that rendering it took, at least one pass, but by
 * no pass that is not expected to fit what is left of the budget. On failure, a negative errno and
 * a sentence, it has to be rendered as any; it will not be tried again until something changes.
 */
GN_MUST_USE int gn_still_refine(struct gn_still *still, int place, gn_still_report_fn tell,
                                void *context, struct gn_still_picture *out_picture,
                                struct gn_error *out_error);

#endif
