/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One pass of a progressive picture (progressive.h): one ray a pixel and a drawn list of light,
 * through the renderer's own passes, into sums instead of layers. All light that is not distant and
 * all glossy reflection is taken as the reference takes it, by random choice.
 */
#ifndef GN_SERVER_RENDER_PASS_H
#define GN_SERVER_RENDER_PASS_H

#include "server/render/render.h"

struct frame;
struct light_list;
struct places;
struct sample;
struct scratch;
struct sums;
struct tile_figures;

/** Borrowed during the pass. */
struct pass {
    const struct light_list *lights;
    const struct places *places;
    struct sums *sums;
    bool is_centred;     // every ray goes through its pixel's centre
    int sequence, index; // else through this point of this one of the pixel's sequences
};

/** As gn_renderer_render, into the pass' sums; the report is the pass' own. */
GN_MUST_USE int gn_renderer_add_pass(struct gn_renderer *renderer, const struct gn_camera *camera,
                                     const struct gn_lighting_state *light,
                                     const struct gn_render_options *options,
                                     const struct pass *pass, struct gn_render_report *out_report,
                                     struct gn_error *out_error);

/** Where in pixel (x, y) its ray goes through, [0, 1) from its corner. */
void gn_pass_get_point(const struct pass *pass, int x, int y, double out[static 2]);
/** Near light, and the modelled surfaces' of the global model, on the virtual samples. */
void gn_pass_shade(const struct frame *frame, struct scratch *scratch, int n,
                   struct tile_figures *figures);
/** The same on the receivers: adds to open, cut and gain. */
void gn_pass_light_receivers(const struct frame *frame, struct scratch *scratch, int n,
                             struct tile_figures *figures);
/** A pixel's sample. Several threads may add samples of different pixels. */
void gn_pass_add_sample(const struct pass *pass, int x, int y, const struct sample *sample);

#endif
