/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <string.h>

static void sum_figures(const struct frame *frame, struct tile_figures *sum)
{
    memset(sum, 0, sizeof(*sum));
    for (int i = 0; i < frame->tiles_x * frame->tiles_y; i++) {
        const struct tile_figures *f = &frame->figures[i];
        sum->s_primary += f->s_primary;
        sum->s_shade += f->s_shade;
        sum->s_shadow += f->s_shadow;
        sum->rays_primary += f->rays_primary;
        sum->rays_mirror += f->rays_mirror;
        sum->rays_shade += f->rays_shade;
        sum->rays_shadow += f->rays_shadow;
        sum->n_mirrors += f->n_mirrors;
        sum->n_glossy += f->n_glossy;
        sum->n_optics += f->n_optics;
        sum->n_near += f->n_near;
        sum->n_lit += f->n_lit;
        sum->n_receivers += f->n_receivers;
        sum->n_rays_real += f->n_rays_real;
        sum->n_virtual_pixels += f->n_virtual_pixels;
        sum->n_shadow_pixels += f->n_shadow_pixels;
        sum->n_refined_pixels += f->n_refined_pixels;
    }
}

void gn_report_fill(const struct frame *frame, int n_workers, struct gn_render_report *report)
{
    struct tile_figures sum;
    sum_figures(frame, &sum);
    gn_plan_finish(frame, &sum, report);
    report->ms_primary = 1e3 * sum.s_primary / n_workers;
    report->ms_shade = 1e3 * sum.s_shade / n_workers;
    report->ms_shadow = 1e3 * sum.s_shadow / n_workers;
    report->rays_primary = sum.rays_primary;
    report->rays_mirror = sum.rays_mirror;
    report->rays_shade = sum.rays_shade + frame->rays_caustics;
    report->rays_shadow = sum.rays_shadow;
    report->n_lights = frame->lights->n_lit + frame->places->n + frame->near.n;
    report->n_virtual_pixels = sum.n_virtual_pixels;
    report->n_shadow_pixels = sum.n_shadow_pixels;
    report->n_refined_pixels = sum.n_refined_pixels;
}
