/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "common/file.h"
#include "server/render_cli/cli.h"

static json_t *make_plan(const struct gn_render_report *report)
{
    json_t *plan = json_array();
    for (int i = 0; i < report->n_plan; i++) {
        const struct gn_plan_entry *entry = &report->plan[i];
        // A failure to append leaves the whole NULL in the end: json_pack refuses a NULL inside.
        if (json_array_append_new(plan, json_pack("{s:s, s:b, s:s}", "pass", entry->pass, "ran",
                                                  (int)entry->ran, "why", entry->why)) < 0) {
            json_decref(plan);
            return NULL;
        }
    }
    return plan;
}

static json_t *make_timings(const struct gn_cli_result *result)
{
    const struct gn_render_report *r = result->report;
    const struct gn_lighting_state *light = result->light;
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "scene",
                     result->ms_scene, "light", result->ms_light, "map", light->ms_map, "sh",
                     light->ms_sh, "lights", light->ms_lights, "plan", r->ms_plan, "primary",
                     r->ms_primary, "shade", r->ms_shade, "shadow", r->ms_shadow, "render",
                     r->ms_total, "total", result->ms_total);
}

static json_t *make_rays(const struct gn_render_report *r)
{
    return json_pack("{s:I, s:I, s:I, s:I}", "primary", (json_int_t)r->rays_primary, "mirror",
                     (json_int_t)r->rays_mirror, "shade", (json_int_t)r->rays_shade, "shadow",
                     (json_int_t)r->rays_shadow);
}

static json_t *make_map(const struct gn_radiance_map *map)
{
    const struct gn_radiance_map_figures *f = &map->figures;
    return json_pack("{s:s, s:i, s:i, s:f, s:f, s:i, s:i, s:i, s:i}", "projection",
                     gn_projection_get_name(map->projection.type), "width", map->projection.width,
                     "height", map->projection.height, "mean_luminance", f->mean_luminance,
                     "max_luminance", f->max_luminance, "nan_texels", f->n_nan, "inf_texels",
                     f->n_inf, "negative_texels", f->n_negative, "clipped_texels", f->n_clipped);
}

/** L_lm [R, G, B] one after the other, and what made them the irradiance. */
static json_t *make_sh(const struct gn_lighting_state *light)
{
    const struct gn_irradiance *irradiance = &light->irradiance;
    if (!light->has_sh)
        return json_null();
    json_t *coefficients = json_array(), *lights = json_array();
    for (int k = 0; k < gn_sh_get_count(irradiance->order); k++) {
        const double *l = light->sh[k];
        // As in make_plan(): what fails here makes the whole fail.
        if (json_array_append_new(coefficients, json_pack("[f, f, f]", l[0], l[1], l[2])) < 0)
            goto fail;
    }
    for (int i = 0; i < irradiance->n_lights; i++) {
        const double *d = irradiance->lights[i].dir_world, *e = irradiance->lights[i].irradiance;
        if (json_array_append_new(lights, json_pack("{s:[f, f, f], s:[f, f, f]}", "direction", d[0],
                                                    d[1], d[2], "irradiance", e[0], e[1], e[2])) <
            0)
            goto fail;
    }
    return json_pack("{s:i, s:o, s:o, s:f, s:f}", "order", irradiance->order, "radiance",
                     coefficients, "lights", lights, "dering_lambda", irradiance->lambda,
                     "min_irradiance", irradiance->min_luminance);
fail:
    json_decref(coefficients);
    json_decref(lights);
    return NULL;
}

/** Why parts of the lighting state were not made; null: they were. */
static json_t *make_left_out(const struct gn_cli_result *result)
{
    const struct gn_lighting_state *light = result->light;
    return json_pack("{s:s?, s:s?}", "sh", light->has_sh ? NULL : result->needs->why_no_sh,
                     "lights", light->has_lights ? NULL : result->needs->why_no_lights);
}

static json_t *make_number(double x)
{
    return x >= 0 ? json_real(x) : json_null();
}

/** null where there is none. */
static json_t *make_budget(const struct gn_cli_request *request, const struct gn_cli_budget *budget)
{
    if (!budget)
        return json_null();
    const struct gn_budget_choice *c = &budget->choice;
    return json_pack(
        "{s:f, s:f, s:s, s:o, s:o, s:{s:i, s:i, s:i}, s:i, s:i, s:I, s:I}", "budget_ms",
        request->budget_ms, "ms", budget->ms, "verdict", gn_budget_get_verdict_name(c->verdict),
        "predicted_ms", make_number(c->predicted_ms), "predicted_error",
        make_number(c->predicted_error), "setting", "lights", c->setting.n_lights, "grid",
        c->setting.grid, "shadow_step", c->setting.shadow_step, "lights_to_choose_from",
        budget->n_lights, "frames", budget->n_frames, "misses", (json_int_t)budget->n_misses,
        "switches", (json_int_t)budget->n_switches);
}

static json_t *make_refined(const struct gn_progressive_figures *f)
{
    if (!f)
        return json_null();
    return json_pack("{s:i, s:f, s:f, s:f}", "passes", f->n_passes, "error", f->error,
                     "error_shadow", f->error_shadow, "error_radiance", f->error_radiance);
}

/** NULL where memory runs out. */
static json_t *make_report(const struct gn_cli_request *request, const struct gn_cli_result *result)
{
    const struct gn_render_report *r = result->report;
    const struct gn_scene *scene = result->scene;
    return json_pack(
        "{s:s, s:s, s:i, s:i, s:i, s:i, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:i, s:o, s:o, s:o, "
        "s:I, s:I, s:I, s:{s:i, s:i, s:i}}",
        "version", GN_VERSION, "quality", gn_cli_get_quality_name(request->render.quality),
        "bounces", request->render.bounces, "width", result->camera->width, "height",
        result->camera->height, "threads", result->n_threads, "light_method",
        gn_light_method_get_name(request->light.method), "plan", make_plan(r), "timings_ms",
        make_timings(result), "rays", make_rays(r), "environment", make_map(result->light->map),
        "sh", make_sh(result->light), "light_left_out", make_left_out(result), "lights",
        r->n_lights, "estimated_error", make_number(r->estimated_error), "budget",
        make_budget(request, result->budget), "refined", make_refined(result->refined),
        "virtual_pixels", (json_int_t)r->n_virtual_pixels, "shadow_pixels",
        (json_int_t)r->n_shadow_pixels, "refined_pixels", (json_int_t)r->n_refined_pixels, "scene",
        "objects", scene->n_objects, "real_triangles", scene->n_real_triangles, "virtual_triangles",
        scene->n_virtual_triangles);
}

int gn_cli_write_report(const struct gn_cli_request *request, const struct gn_cli_result *result,
                        struct gn_error *out_error)
{
    json_t *report = make_report(request, result);
    char *text = report ? json_dumps(report, JSON_INDENT(2) | JSON_REAL_PRECISION(9)) : NULL;
    int ret = text ? gn_file_write(request->report, text, strlen(text), out_error)
                   : gn_error_set(out_error, -ENOMEM, "%s: out of memory", request->report);
    free(text);
    json_decref(report);
    return ret;
}
