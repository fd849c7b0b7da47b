/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* --budget-ms: the picture again and again, as a stream would have it, until a setting holds. */
#include "server/render_cli/cli.h"

/** Least frames, frames that a setting has to hold, and most frames. */
enum { LEAST = 20, HOLD = 8, MOST = 64 };
/** Lights to choose from where --lights says nothing. */
enum { LIGHTS = 256 };

/** The light with so many lights, in the place of *light. */
static int make_light(const struct gn_cli_request *request, const struct gn_cli_scene *scene,
                      int n_lights, struct gn_lighting_state **light, struct gn_error *out_error)
{
    struct gn_cli_request other = *request;
    struct gn_lighting_state *made;
    other.light.n_lights = n_lights;
    int ret = gn_cli_make_light(&other, scene->scene, scene->needs, scene->pool, &made, out_error);
    if (ret < 0)
        return ret;
    gn_lighting_state_unref(light);
    *light = made;
    return 0;
}

static int count_lights(const struct gn_lighting_state *light)
{
    int n = light->n_lights;
    for (int i = 0; i < light->n_others; i++)
        n += light->others[i]->n_lights;
    return n;
}

static void learn(struct gn_cli_budget *budget, struct gn_budget *controller,
                  const struct gn_render_report *r)
{
    // The estimate serves the report, not the picture.
    budget->ms = r->ms_total - r->ms_estimate;
    const struct gn_budget_outcome outcome = {
        .ms = budget->ms,
        .ms_plan = r->ms_plan,
        .ms_primary = r->ms_primary,
        .ms_shade = r->ms_shade,
        .ms_shadow = r->ms_shadow,
        .n_refined_pixels = r->n_refined_pixels,
        .estimated_error = r->estimated_error,
    };
    gn_budget_learn(controller, &outcome);
}

int gn_cli_render_within(const struct gn_cli_request *request, const struct gn_cli_scene *scene,
                         struct gn_lighting_state **light, struct gn_layers *layers,
                         struct gn_render_report *out_report, struct gn_cli_budget *out,
                         struct gn_error *out_error)
{
    struct gn_budget controller = {0};
    struct gn_cli_budget budget = {.n_lights = request->light.n_lights};
    bool is_free = request->light.method != GN_LIGHT_PARTITION_SEED && (*light)->n_lights > 0;
    int n_made = -1, n_probes = 1 + (*light)->n_others;
    if (!is_free)
        budget.n_lights = count_lights(*light);
    else if (budget.n_lights <= 0)
        budget.n_lights = LIGHTS;
    struct gn_budget_frame frame = {
        .budget_ms = request->budget_ms,
        .n_pixels = (int64_t)scene->camera->width * scene->camera->height,
        .n_lights = is_free ? budget.n_lights * n_probes : budget.n_lights,
        .max_step = GN_BUDGET_MAX_STEP,
    };
    for (int held = 0; budget.n_frames < MOST && (budget.n_frames < LEAST || held < HOLD);) {
        uint64_t n_switches = controller.n_switches;
        gn_budget_choose(&controller, &frame, &budget.choice);
        const struct gn_budget_setting *setting = &budget.choice.setting;
        int each = setting->n_lights / n_probes > 1 ? setting->n_lights / n_probes : 1;
        int ret =
            is_free && each != n_made ? make_light(request, scene, each, light, out_error) : 0;
        n_made = each;
        struct gn_render_options options = request->render;
        options.n_lights = is_free ? 0 : setting->n_lights;
        options.grid = setting->grid;
        options.shadow_step = setting->shadow_step;
        if (ret == 0)
            ret = gn_renderer_render(scene->renderer, scene->camera, *light, &options, layers,
                                     out_report, out_error);
        if (ret < 0)
            return ret;
        learn(&budget, &controller, out_report);
        held = controller.n_switches == n_switches ? held + 1 : 0;
        budget.n_frames++;
    }
    budget.n_misses = controller.n_misses;
    budget.n_switches = controller.n_switches;
    *out = budget;
    return 0;
}
