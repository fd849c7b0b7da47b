/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>

/** The plan's lines, in the order of the passes. */
enum line {
    PRIMARY,
    REFINE,
    SHADE,
    MIRROR,
    GLOSSY,
    SHADOW,
    BLOCKERS,
    NEAR,
    ADDED,
    OPTICS,
    CAUSTICS,
    BOUNCES,
    COARSE,
    N_LINES
};

static const char *const pass_names[N_LINES] = {
    [PRIMARY] = "primary", [REFINE] = "refine", [SHADE] = "shade",       [MIRROR] = "mirror",
    [GLOSSY] = "glossy",   [SHADOW] = "shadow", [BLOCKERS] = "blockers", [NEAR] = "near",
    [ADDED] = "added",     [OPTICS] = "optics", [CAUSTICS] = "caustics", [BOUNCES] = "bounces",
    [COARSE] = "coarse",
};

/** why_not NULL: the pass runs, because of why. */
static void set_line(struct gn_render_report *report, enum line line, const char *why_not,
                     const char *why)
{
    report->plan[line] = (struct gn_plan_entry){
        .pass = pass_names[line], .ran = !why_not, .why = why_not ? why_not : why};
}

/** May a ray of the picture meet the box? False only where one plane of the pyramid of all rays, or
 * the camera's own plane, has the whole box outside. */
static bool is_box_in_view(const struct frame *frame, const struct box *box,
                           const double slopes[static 4])
{
    int n_outside[5] = {0};
    for (int corner = 0; corner < 8; corner++) {
        double world[3];
        double p[3];
        for (int k = 0; k < 3; k++)
            world[k] = (double)(corner >> k & 1 ? box->max[k] : box->min[k]) - frame->origin[k];
        for (int k = 0; k < 3; k++) // the transpose: camera_from_world
            p[k] = frame->world_from_camera[k] * world[0] +
                   frame->world_from_camera[3 + k] * world[1] +
                   frame->world_from_camera[6 + k] * world[2];
        n_outside[0] += p[2] <= 0;
        n_outside[1] += p[0] < slopes[0] * p[2];
        n_outside[2] += p[0] > slopes[1] * p[2];
        n_outside[3] += p[1] < slopes[2] * p[2];
        n_outside[4] += p[1] > slopes[3] * p[2];
    }
    for (int i = 0; i < 5; i++) {
        if (n_outside[i] == 8)
            return false;
    }
    return true;
}

/** Can any light's ray from real geometry meet the virtual objects? */
static bool can_any_light_cast(const struct frame *frame)
{
    const struct light_list *lights = frame->lights;
    for (int l = 0; l < lights->n; l++) {
        const float dir[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
        bool is_dark = !(lights->irradiance[0][l] > 0 || lights->irradiance[1][l] > 0 ||
                         lights->irradiance[2][l] > 0);
        if (!is_dark && gn_box_may_meet_from_box(&frame->virtual_box, &frame->real_box, dir))
            return true;
    }
    return gn_near_can_cast(frame, &frame->real_box);
}

static bool is_real_flat(const struct frame *frame)
{
    for (int k = 0; k < 3; k++) {
        if (frame->real_box.min[k] == frame->real_box.max[k])
            return true;
    }
    return false;
}

static bool has_virtual(const struct frame *frame, unsigned types)
{
    return (frame->scene->virtual_materials & types) != 0;
}

static const char *const not_asked_for = "not asked for";

/** Only what needs proof is left to all_passes; what was not asked for is not done. */
static const char *why_not_virtual(const struct frame *frame, const double slopes[static 4])
{
    if (frame->options.no_virtual)
        return not_asked_for;
    if (frame->options.all_passes)
        return NULL;
    if (!frame->has_virtual)
        return "the scene has no virtual object";
    if (!is_box_in_view(frame, &frame->virtual_box, slopes))
        return "no virtual object in view";
    return NULL;
}

static const char *why_not_light_loop(const struct frame *frame)
{
    const struct gn_render_options *options = &frame->options;
    if (frame->near.n > 0)
        return NULL;
    if (options->shading == GN_SHADING_IRRADIANCE && options->quality != GN_QUALITY_REFERENCE)
        return "irradiance shading needs no loop over lights";
    if (frame->lights->n + frame->places->n == 0)
        return "no light";
    return NULL;
}

static const char *why_not_shadow(const struct frame *frame)
{
    if (!frame->has_virtual)
        return "the scene has no virtual object";
    if (!frame->has_real)
        return "the scene has no real object to receive one";
    if (frame->lights->n + frame->places->n + frame->near.n == 0)
        return "no light";
    if (!frame->pass && !frame->run_bounces && frame->places->n == 0 && !can_any_light_cast(frame))
        return "no light throws a shadow of a virtual object onto a real one";
    return NULL;
}

static const char *why_not_blockers(const struct frame *frame)
{
    if (frame->options.shadow_ignore_real)
        return "not asked for: real objects hide no light";
    if (!frame->options.all_passes && is_real_flat(frame))
        return "the real geometry is one plane: it hides no light from itself";
    return NULL;
}

static const char *why_not_near(const struct frame *frame, const char *no_virtual,
                                const char *no_shadow)
{
    if (!frame->blend.state[0]->emission && frame->near.n == 0)
        return "no lamp and no emissive mesh in the scene";
    if (frame->near.n == 0)
        return "every lamp and emissive mesh is dark";
    return no_virtual && no_shadow ? no_shadow : NULL;
}

static const char *why_not_optics(const struct frame *frame)
{
    if (!frame->has_virtual)
        return "the scene has no virtual object";
    if (!gn_optics_is_needed(frame->scene))
        return "no mirror or glass among the real objects";
    if (frame->options.no_virtual)
        return not_asked_for;
    return NULL;
}

static const char *why_not_caustics(const struct frame *frame)
{
    if (frame->options.quality != GN_QUALITY_REFERENCE)
        return "caustics are of the reference quality";
    if (!has_virtual(frame, CLEAR_MATERIALS))
        return "no mirror or glass among the virtual objects";
    if (!frame->has_real)
        return "the scene has no real object to receive one";
    if (frame->lights->n_lit + frame->near.n == 0)
        return "no distant light and no lamp";
    return NULL;
}

/** Indirect light. What virtual objects send on of the light they receive, colour bleeding, takes a
 * walk's length of noisy rays from every receiver; an interactive frame has none for it. */
static const char *why_not_bounces(const struct frame *frame)
{
    if (frame->run_bounces)
        return NULL;
    return frame->options.quality == GN_QUALITY_REFERENCE
               ? "0 bounces were asked for"
               : "indirect light, such as colour bleeding, is of the reference quality: it takes "
                 "hundreds of rays from each pixel";
}

static const char *why_added(const struct frame *frame)
{
    return frame->near.n_virtual > 0 ? "light of virtual lamps and screens on real surfaces"
                                     : "light that virtual objects send to real ones";
}

static const char *why_not_coarse(const struct frame *frame)
{
    if (frame->options.shadow_step <= 1)
        return "every pixel's own shadow was asked for";
    if (frame->options.quality != GN_QUALITY_INTERACTIVE)
        return "a coarser shadow is of the interactive quality";
    if (!frame->run_shadow)
        return "no shadow";
    if (frame->run_optics)
        return "real mirrors or glass show shadows of their own";
    return frame->skips ? NULL : "every pixel is needed";
}

void gn_plan_make(struct frame *frame, const double slopes[static 4],
                  struct gn_render_report *report)
{
    const struct gn_render_options *options = &frame->options;
    bool all = options->all_passes;
    frame->cull = !all;
    frame->run_bounces = options->bounces > 0;
    frame->seen = options->no_virtual ? GN_RT_REAL : GN_RT_ALL;
    report->n_plan = N_LINES;
    set_line(report, PRIMARY,
             frame->is_seen ? "camera and scene rest: what the pixels' centres see is kept" : NULL,
             "one ray through each pixel's centre");
    set_line(report, REFINE,
             frame->rule.grid > 1  ? NULL
             : options->single_ray ? "one ray for each pixel was asked for"
                                   : "this quality has one ray for each pixel",
             "edges get a grid of rays");

    const char *no_virtual = why_not_virtual(frame, slopes);
    const char *no_loop = why_not_light_loop(frame);
    frame->run_light_loop = !no_virtual && !no_loop;
    set_line(report, SHADE, no_virtual ? no_virtual : no_loop, "virtual objects may be in view");
    const char *no_mirror = has_virtual(frame, 1u << GN_MATERIAL_MIRROR)
                                ? no_virtual
                                : "no mirror among the virtual objects";
    set_line(report, MIRROR, no_mirror, "a mirror among the virtual objects");
    bool has_glossy = has_virtual(frame, 1u << GN_MATERIAL_GGX | 1u << GN_MATERIAL_GLASS);
    set_line(report, GLOSSY,
             has_glossy ? no_virtual : "neither ggx nor glass among the virtual objects",
             "ggx or glass among the virtual objects");

    const char *no_shadow = options->no_shadow ? not_asked_for : all ? NULL : why_not_shadow(frame);
    const char *no_blockers = why_not_blockers(frame);
    frame->run_shadow = !no_shadow;
    frame->run_blockers = !no_blockers;
    frame->skips = !all && !options->supersample_all && !frame->pass && !frame->run_bounces &&
                   options->quality != GN_QUALITY_REFERENCE && frame->near.n_virtual == 0;
    set_line(report, SHADOW, no_shadow, "virtual objects may hide light from real ones");
    set_line(report, BLOCKERS, no_shadow ? no_shadow : no_blockers,
             "real objects may hide light from real ones");
    set_line(
        report, NEAR, why_not_near(frame, no_virtual, no_shadow),
        frame->near.n_placed > 0
            ? "lights at finite places, modelled surfaces among them, are tried from each surface"
            : "lamps and emissive meshes are tried from each surface");
    const char *no_caustics = options->no_shadow ? not_asked_for : why_not_caustics(frame);
    frame->run_caustics = !no_caustics;
    set_line(report, CAUSTICS, no_caustics,
             "virtual mirrors or glass may throw light onto real ones");
    const char *no_optics = why_not_optics(frame);
    frame->run_optics = !no_optics;
    const char *no_coarse = why_not_coarse(frame);
    frame->shadow_step = no_coarse ? 1 : options->shadow_step;
    set_line(report, COARSE, no_coarse, "the shadow is worked out for some pixels, smooth between");
    set_line(report, OPTICS, no_optics, "a real mirror or glass may show virtual objects");
    set_line(report, BOUNCES, why_not_bounces(frame), "bounces were asked for");
    bool can_add = frame->run_bounces || frame->near.n_virtual > 0;
    const char *no_added =
        frame->run_caustics || frame->run_optics ? NULL
        : !can_add
            ? "0 bounces: nothing is added; light by way of mirrors and glass is not followed"
            : no_shadow;
    set_line(report, ADDED, no_added, why_added(frame));
}

/** The pass was ready to run and found no work. */
static void withdraw(struct gn_render_report *report, enum line line, bool is_idle, const char *why)
{
    if (is_idle && report->plan[line].ran)
        set_line(report, line, why, NULL);
}

void gn_plan_finish(const struct frame *frame, const struct tile_figures *sum,
                    struct gn_render_report *report)
{
    if (frame->options.all_passes)
        return;
    withdraw(report, REFINE, sum->n_refined_pixels == 0, "no edge in view");
    withdraw(report, SHADE, sum->n_lit == 0, "no pixel shows a diffuse virtual surface");
    withdraw(report, MIRROR, sum->n_mirrors == 0, "no pixel shows a virtual mirror");
    withdraw(report, GLOSSY, sum->n_glossy == 0, "no pixel shows a ggx or glass surface");
    withdraw(report, BLOCKERS, sum->n_receivers == 0, "no diffuse real surface in view");
    withdraw(report, SHADOW, sum->n_receivers == 0, "no diffuse real surface in view");
    withdraw(report, BLOCKERS, sum->n_rays_real == 0, "no pixel loses light to a virtual object");
    withdraw(report, NEAR, sum->n_near == 0,
             "no near light reaches a virtual surface, or a real one by way of a virtual object");
    withdraw(report, SHADOW, sum->rays_shadow == 0,
             "no light's ray from a pixel comes near a virtual object");
    withdraw(report, CAUSTICS, frame->n_photons == 0, "the camera sees none");
    withdraw(report, OPTICS, sum->n_optics == 0, "no real mirror or glass in view");
    withdraw(report, ADDED, sum->n_receivers + sum->n_optics == 0,
             "no diffuse real surface in view");
}
