/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/pace.h"

#include <string.h>

/** A viewer without a frame among so many of the room is not looked at. */
enum { OF_LATE = 4 * GN_ROOM_MAX_VIEWERS };
/** Lights of a state where the options say none. */
enum { DEFAULT_LIGHTS = 64 };

static struct gn_pace *get_pace(struct gn_paces *paces, uint64_t session_id)
{
    struct gn_pace *pace = &paces->paces[0];
    paces->n_frames++;
    for (int i = 0; i < GN_ROOM_MAX_VIEWERS; i++) {
        struct gn_pace *each = &paces->paces[i];
        if (each->session_id == session_id) {
            each->used = paces->n_frames;
            return each;
        }
        if (each->used < pace->used)
            pace = each;
    }
    memset(pace, 0, sizeof(*pace));
    pace->session_id = session_id;
    pace->used = paces->n_frames;
    return pace;
}

int gn_paces_get_wanted(const struct gn_paces *paces)
{
    int most = 0;
    for (int i = 0; i < GN_ROOM_MAX_VIEWERS; i++) {
        const struct gn_pace *pace = &paces->paces[i];
        if (pace->session_id == 0 || paces->n_frames - pace->used >= OF_LATE)
            continue;
        if (pace->n_wanted == 0)
            return 0;
        most = pace->n_wanted > most ? pace->n_wanted : most;
    }
    return most;
}

/** Lights of all probes. */
struct light_count {
    int n; // that there are, fading ones among them
    int n_probes;
    int each; // of a probe if all were wished; 0: its number cannot be wished
};

static struct light_count count_lights(const struct gn_room_options *options,
                                       const struct gn_lighting_state *light)
{
    struct light_count count = {.n = light->n_lights, .n_probes = 1 + light->n_others};
    for (int i = 0; i < light->n_others; i++)
        count.n += light->others[i]->n_lights;
    if (options->light.method != GN_LIGHT_PARTITION_SEED && count.n > 0)
        count.each = options->light.n_lights > 0 ? options->light.n_lights : DEFAULT_LIGHTS;
    return count;
}

/** What each probe should make so that all have n together; 0: all. */
static int get_wish(const struct light_count *count, int n)
{
    int each = (n + count->n_probes - 1) / count->n_probes;
    return each < count->each ? each : 0;
}

/** What a frame without its objects or shadows took says nothing of those with them. */
static void follow_asking(struct gn_pace *pace, const struct gn_msg_frame *frame)
{
    if (pace->no_virtual == frame->no_virtual && pace->no_shadow == frame->no_shadow)
        return;
    pace->no_virtual = frame->no_virtual;
    pace->no_shadow = frame->no_shadow;
    pace->budget = (struct gn_budget){.n_misses = pace->budget.n_misses,
                                      .n_switches = pace->budget.n_switches};
    memset(pace->sums, 0, sizeof(pace->sums));
    pace->n_asked = 0;
}

/** The part of the pixels to ask. A setting or size that the sums are not of forgets them. */
static int get_part(struct gn_pace *pace, const struct gn_budget_setting *setting, int width,
                    int height)
{
    if (memcmp(&pace->setting, setting, sizeof(*setting)) != 0 || pace->width != width ||
        pace->height != height) {
        memset(pace->sums, 0, sizeof(pace->sums));
        pace->n_asked = 0;
    }
    pace->setting = *setting;
    pace->width = width;
    pace->height = height;
    return (int)(pace->n_asked % GN_ERROR_PARTS);
}

void gn_pace_begin(struct gn_paces *paces, const struct gn_room_options *options,
                   const struct gn_frame_job *job, const struct gn_lighting_state *light,
                   struct gn_pace_turn *out)
{
    const struct gn_msg_frame *frame = &job->frame;
    struct gn_budget_frame known = {.budget_ms = options->budget_ms,
                                    .max_step = GN_BUDGET_MAX_STEP};
    *out = (struct gn_pace_turn){.pace = get_pace(paces, job->answer->session_id)};
    follow_asking(out->pace, frame);
    if (frame->budget_ms > 0 && (!(known.budget_ms > 0) || frame->budget_ms < known.budget_ms))
        known.budget_ms = (double)frame->budget_ms;
    if (known.budget_ms > 0 && frame->quality == GN_MSG_QUALITY_INTERACTIVE) {
        for (size_t i = 0; i < frame->views_count; i++)
            known.n_pixels += (int64_t)job->cameras[i].width * job->cameras[i].height;
        const struct light_count count = count_lights(options, light);
        known.n_lights = count.each > 0 ? count.n_probes * count.each : count.n;
        gn_budget_choose(&out->pace->budget, &known, &out->choice);
        out->budget_ms = known.budget_ms;
        out->outcome.n_lights = count.n;
        out->pace->n_wanted = get_wish(&count, out->choice.setting.n_lights);
    } else {
        out->pace->n_wanted = 0;
    }
    out->part =
        get_part(out->pace, &out->choice.setting, job->cameras[0].width, job->cameras[0].height);
}

void gn_pace_set_options(const struct gn_pace_turn *turn, struct gn_render_options *options)
{
    // Lights are made in about the number wanted: merging a few is worse than having them.
    int n = turn->choice.setting.n_lights + turn->choice.setting.n_lights / 4;
    options->n_lights = n < GN_LIGHTS_MAX ? n : GN_LIGHTS_MAX;
    options->grid = turn->choice.setting.grid;
    options->shadow_step = turn->choice.setting.shadow_step;
    options->estimate_error = true;
    options->estimate_parts = GN_ERROR_PARTS;
    options->estimate_part = turn->part;
}

void gn_pace_put_report(struct gn_pace_turn *turn, int view, const struct gn_render_report *report)
{
    turn->pace->sums[view][turn->part] = report->error;
    turn->outcome.n_refined_pixels += report->n_refined_pixels;
}

/** Of all parts known, the largest of the views; < 0: not known. */
static double get_error(const struct gn_pace *pace, size_t n_views)
{
    double largest = -1;
    for (size_t i = 0; i < n_views; i++) {
        double error = gn_error_sums_get(pace->sums[i], GN_ERROR_PARTS);
        largest = error > largest ? error : largest;
    }
    return largest;
}

void gn_pace_end(struct gn_pace_turn *turn, const struct gn_frame_job *job, double busy_ms,
                 struct gn_msg_receipt *receipt)
{
    struct gn_pace *pace = turn->pace;
    struct gn_budget_outcome *outcome = &turn->outcome;
    pace->n_asked++;
    double error = get_error(pace, job->frame.views_count);
    receipt->estimated_error = (float)error;
    if (!(turn->budget_ms > 0))
        return;
    outcome->ms = busy_ms;
    outcome->ms_plan = (double)receipt->plan_ms;
    outcome->ms_primary = (double)receipt->primary_ms;
    outcome->ms_shade = (double)receipt->shade_ms;
    outcome->ms_shadow = (double)receipt->shadow_ms;
    outcome->estimated_error = pace->n_asked >= GN_ERROR_PARTS ? error : -1;
    gn_budget_learn(&pace->budget, outcome);
    receipt->has_budget = true;
    receipt->budget = (struct gn_msg_budget_use){
        .budget_ms = (float)turn->budget_ms,
        .busy_ms = (float)busy_ms,
        .verdict = (enum gn_msg_budget_verdict)turn->choice.verdict,
        .predicted_ms = (float)turn->choice.predicted_ms,
        .predicted_error = (float)turn->choice.predicted_error,
        .lights = (uint32_t)turn->choice.setting.n_lights,
        .grid = (uint32_t)turn->choice.setting.grid,
        .shadow_step = (uint32_t)turn->choice.setting.shadow_step,
        .misses = pace->budget.n_misses,
        .switches = pace->budget.n_switches,
    };
}
