/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A picture that converges to the reference while nothing changes. Each pass goes once through the
 * renderer: one ray through another point of each pixel, and lights drawn anew from the whole maps
 * (draw.h), near light and glossy reflection by random choice. Sums over the passes are taken
 * before the shadow's ratio is, so that what is shown tends to what the reference quality shows
 * without bounces and caustics, every pixel having rays all over it. Passes come in rounds of four;
 * after each round the picture is the best mean of the interactive one, which it starts from, and
 * the sums (sums.h): the first is no worse, and there is no jump to the next.
 */
#ifndef GN_SERVER_RENDER_PROGRESSIVE_H
#define GN_SERVER_RENDER_PROGRESSIVE_H

#include "server/render/render.h"

/** Most pixels of a picture: 153 bytes are kept for each. */
#define GN_PROGRESSIVE_PIXELS_MAX (1 << 21)
/** Passes after which the picture is made anew. */
#define GN_PROGRESSIVE_ROUND 4
#define GN_PROGRESSIVE_PASSES_MAX 1024

/** One view's picture. Thread-safety: unsafe. */
struct gn_progressive;

/** All-zero is the default. */
struct gn_progressive_options {
    double error;   // at which it is done, as figures.error, [1e-6, 1], default 1e-3
    int max_passes; // at which it is done, [4, GN_PROGRESSIVE_PASSES_MAX], default that
    int n_lights;   // drawn in each pass, [1, 1024], default 64
};

/** How far it is. */
struct gn_progressive_figures {
    int n_passes;
    /**
     * Standard errors of what is shown, estimated from the spread of four independent sequences of
     * passes; negative before there are two rounds. shadow: of the shadow factor times the share of
     * the pixel that is real, RMS over the pixels and channels that a shadow changes. radiance: of
     * what is put over the picture, virtual and added, where something is: RMS over its mean, of
     * values cut off at 4 times the mean, so that a lamp in a mirror is not all that counts.
     */
    double error_shadow, error_radiance;
    double error;         // the larger of the two
    const char *why_done; // NULL: further passes make it better; static
};

/** renderer and pool (may be NULL) are borrowed until destroy; the renderer may serve others
 * between calls. Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_progressive_create(struct gn_renderer *renderer, struct gn_pool *pool,
                                      struct gn_progressive **out_progressive,
                                      struct gn_error *out_error);
/** NULL-safe; nulls *progressive. */
void gn_progressive_destroy(struct gn_progressive **progressive);

/** Why such a picture cannot be refined, a static sentence; NULL: it can. */
const char *gn_progressive_get_obstacle(const struct gn_scene *scene,
                                        const struct gn_camera *camera,
                                        const struct gn_render_options *options);

/**
 * For a picture without an obstacle: renders the interactive one, from which the passes to come
 * begin. Keeps a reference to light; a scene that is changed in the renderer later needs another
 * begin. Takes memory only where the picture, or a map, is larger than before. Returns as
 * gn_renderer_render does.
 */
GN_MUST_USE int
gn_progressive_begin(struct gn_progressive *progressive, const struct gn_camera *camera,
                     struct gn_lighting_state *light, const struct gn_render_options *options,
                     const struct gn_progressive_options *progressive_options,
                     struct gn_render_report *out_report, struct gn_error *out_error);
/** One more pass; the report is of this pass. After why_done it may not be called. */
GN_MUST_USE int gn_progressive_add_pass(struct gn_progressive *progressive,
                                        struct gn_render_report *out_report,
                                        struct gn_error *out_error);
/** After a begin. Borrowed until the next pass, begin or destroy. */
const struct gn_layers *gn_progressive_get_layers(const struct gn_progressive *progressive);
const struct gn_progressive_figures *
gn_progressive_get_figures(const struct gn_progressive *progressive);
/** Gives back the light; the memory for pixels stays. */
void gn_progressive_rest(struct gn_progressive *progressive);

/** Adds the line "progressive" to a report's plan. why: static. */
void gn_progressive_add_plan(struct gn_render_report *report, bool ran, const char *why);

#endif
