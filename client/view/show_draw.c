/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <math.h>

#include "client/view/show_internal.h"
#include "proto/attr.h"

static const struct gn_overlay_line keys[] = {
    {"q, Esc", "quit"},
    {"f", "full screen"},
    {"o", "figures of the picture; the plan; none"},
    {"l", "the light, as a mirror ball sees it"},
    {"s", "shadows on, off"},
    {"v", "virtual objects on, off"},
    {"p", "keep this picture (PNG)"},
    {"r", "record all (PNG, receipts); end it"},
    {"h", "these keys"},
};

static void draw_page(struct gn_show *s, struct gn_overlay_box taken)
{
    struct gn_overlay_figures figures = {
        .receipt = s->picture.width > 0 ? &s->receipt : NULL,
        .n_sent = s->counts.n_sent,
        .n_results = s->counts.n_results,
        .n_dropped = s->counts.n_dropped,
        .n_lost = s->counts.n_lost,
        .last_drop = s->last_drop,
        .counts = s->counts.source,
    };
    if (s->page == GN_SHOW_PAGE_PLAN) {
        gn_overlay_draw_plan(&s->canvas, &s->receipt, taken);
        return;
    }
    uint64_t n = s->n_of_late < GN_SHOW_OF_LATE ? s->n_of_late : GN_SHOW_OF_LATE;
    for (uint64_t i = 0; i < n; i++)
        figures.latency_max_ms = fmax(figures.latency_max_ms, s->of_late[i].latency_ms);
    if (n > 0)
        figures.latency_ms = s->of_late[(s->n_of_late - 1) % GN_SHOW_OF_LATE].latency_ms;
    if (n > 1) {
        int64_t last_ns = s->of_late[(s->n_of_late - 1) % GN_SHOW_OF_LATE].at_ns;
        int64_t first_ns = s->of_late[(s->n_of_late - n) % GN_SHOW_OF_LATE].at_ns;
        if (last_ns > first_ns)
            figures.rate_hz = (double)(n - 1) * 1e9 / (double)(last_ns - first_ns);
    }
    gn_overlay_draw_figures(&s->canvas, &figures, taken);
}

/** The sentence at the lower left, if any: what is wrong, what is new, what is being done. */
static const char *get_note(const struct gn_show *s)
{
    if (s->state == GN_SHOW_TROUBLE)
        return s->sentence;
    if (s->note[0])
        return s->note;
    if (s->state == GN_SHOW_WAITING)
        return s->sentence;
    if (s->picture.width == 0)
        return s->last_drop[0] ? s->last_drop : "waiting for the first picture";
    return gn_keep_is_recording(s->keep) ? "recording" : NULL;
}

const struct gn_canvas *gn_show_draw(struct gn_show *show)
{
    struct gn_show *s = show;
    const char *note = get_note(s);
    if (!note && s->page == GN_SHOW_PAGE_NONE && !s->shows_light && !s->shows_help &&
        !s->is_hint_wanted)
        return NULL;
    int width, height;
    gn_window_get_size(s->window, &width, &height);
    if (gn_canvas_begin(&s->canvas, width, height) < 0)
        return NULL;
    struct gn_overlay_box taken = {0};
    if (s->shows_light && !s->shows_help) {
        taken = gn_light_ball_get_box(&s->canvas);
        gn_light_ball_draw(&s->light, &s->world_from_camera, &s->canvas);
    }
    if (s->shows_help)
        gn_overlay_draw_help(&s->canvas, "keys", keys, GN_ARRAY_LEN(keys));
    else if (s->page != GN_SHOW_PAGE_NONE)
        draw_page(s, taken);
    else if (s->is_hint_wanted)
        gn_overlay_draw_hint(&s->canvas, "h: keys");
    if (note)
        gn_overlay_draw_note(&s->canvas, note, s->state == GN_SHOW_TROUBLE, taken);
    return &s->canvas;
}
