/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/overlay.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/** Units: from the window's edge to a panel, from that to its text. */
enum { MARGIN = 6, PAD = 6 };
/** Most lines of a panel and letters of one: longer ones are hard to read. */
enum { MAX_LINES = 64, MAX_LETTERS = 60 };
/** Letters of the left column, a gap among them. */
enum { LABEL_LETTERS = 9 };

static const struct gn_color panel_color = {{12, 14, 18, 216}};
static const struct gn_color warning_color = {{120, 24, 16, 240}};
static const struct gn_color label_color = {{255, 200, 120, 255}};
static const struct gn_color text_color = {{245, 245, 245, 255}};

/** Lines that are being put together. */
struct block {
    int label_letters; // of the left column; 0: there is none
    int columns;       // letters of the right one
    int max_lines;
    int n, n_left; // lines; those that did not fit
    char label[MAX_LINES][MAX_LETTERS + 1];
    char text[MAX_LINES][MAX_LETTERS + 1];
};

static int get_min(int a, int b)
{
    return a < b ? a : b;
}

static int get_max(int a, int b)
{
    return a > b ? a : b;
}

/** Letters of a line that begins with the text: as many words as fit, or what fits of the first. */
static int get_cut(const char *text, int columns)
{
    int n = (int)strlen(text);
    if (n <= columns)
        return n;
    for (int i = columns; i > 0; i--) {
        if (text[i] == ' ')
            return i;
    }
    return columns;
}

static void put(struct block *b, const char *label, const char *text)
{
    do {
        int n = get_cut(text, b->columns);
        if (b->n == b->max_lines) {
            b->n_left++;
        } else {
            // A peer's label may be longer than the column.
            snprintf(b->label[b->n], sizeof(b->label[0]), "%.*s", get_max(b->label_letters - 1, 0),
                     label);
            snprintf(b->text[b->n++], sizeof(b->text[0]), "%.*s", n, text);
        }
        label = "";
        text += n + (text[n] == ' ');
    } while (*text);
}

static void print(struct block *b, const char *label, const char *format, ...) GN_PRINTF(3, 4);

static void print(struct block *b, const char *label, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof(text), format, arguments);
    va_end(arguments);
    put(b, label, text);
}

/** A block for the width and height of the canvas, units. */
static void begin(struct block *b, int label_letters, int width, int height)
{
    b->label_letters = label_letters;
    b->columns = (width - 2 * MARGIN - 2 * PAD) / GN_FONT_ADVANCE - label_letters;
    b->columns = get_min(get_max(b->columns, 1), MAX_LETTERS - label_letters);
    b->max_lines = (height - 2 * MARGIN - 2 * PAD) / GN_CANVAS_LINE;
    b->max_lines = get_min(get_max(b->max_lines, 1), MAX_LINES);
    b->n = b->n_left = 0;
}

static struct gn_overlay_box measure(const struct block *b)
{
    int letters = 0;
    for (int i = 0; i < b->n; i++)
        letters = get_max(letters, b->label_letters + (int)strlen(b->text[i]));
    return (struct gn_overlay_box){
        .x = MARGIN,
        .y = MARGIN,
        .width = letters * GN_FONT_ADVANCE + 2 * PAD,
        .height = b->n * GN_CANVAS_LINE + 2 * PAD - (GN_CANVAS_LINE - GN_FONT_ROWS),
    };
}

static void draw(struct gn_canvas *canvas, const struct block *b, struct gn_overlay_box at,
                 struct gn_color color)
{
    gn_canvas_fill(canvas, at.x, at.y, at.width, at.height, color);
    for (int i = 0; i < b->n; i++) {
        int x = at.x + PAD, y = at.y + PAD + i * GN_CANVAS_LINE;
        gn_canvas_write(canvas, x, y, label_color, b->label[i]);
        gn_canvas_write(canvas, x + b->label_letters * GN_FONT_ADVANCE, y, text_color, b->text[i]);
    }
}

/** At the upper left. Lines that would lie under `taken` give way to one that says so. */
static void draw_left(struct gn_canvas *canvas, struct block *b, struct gn_overlay_box taken)
{
    struct gn_overlay_box at = measure(b);
    if (taken.width > 0 && at.x + at.width > taken.x && at.y + at.height > taken.y) {
        int n = get_max((taken.y - MARGIN - at.y - 2 * PAD) / GN_CANVAS_LINE, 1);
        b->n_left += b->n - get_min(b->n, n);
        b->n = get_min(b->n, n);
    }
    if (b->n_left > 0) {
        snprintf(b->label[b->n - 1], sizeof(b->label[0]), "...");
        snprintf(b->text[b->n - 1], sizeof(b->text[0]), "and %d lines more", b->n_left + 1);
    }
    draw(canvas, b, measure(b), panel_color);
}

int gn_overlay_print_budget(const struct gn_msg_receipt *receipt, char *text, size_t size)
{
    static const char *const verdicts[] = {"learns", "fits", "too small"};
    const struct gn_msg_budget_use *u = &receipt->budget;
    if (!receipt->has_budget)
        return snprintf(text, size, "%s", "");
    return snprintf(text, size,
                    "%.1f of %.1f ms (%s): %u lights, grid %u, step %u; %" PRIu64 " late",
                    (double)u->busy_ms, (double)u->budget_ms, verdicts[u->verdict], u->lights,
                    u->grid, u->shadow_step, u->misses);
}

int gn_overlay_print_refined(const struct gn_msg_receipt *receipt, char *text, size_t size)
{
    if (receipt->refined_passes == 0)
        return snprintf(text, size, "%s", "");
    if (receipt->refined_error < 0)
        return snprintf(text, size, "%u passes", receipt->refined_passes);
    return snprintf(text, size, "%u passes, error %.4f", receipt->refined_passes,
                    (double)receipt->refined_error);
}

/** Age in the unit that is read most easily. */
static void print_light(struct block *b, const struct gn_msg_receipt *r)
{
    double age_s = (double)r->lighting_age_ms * 1e-3;
    if (r->lighting_sequence == 0)
        print(b, "light", "%u lights of the scene", r->lights_used);
    else if (age_s < 10)
        print(b, "light", "%u lights, %.0f ms old", r->lights_used, age_s * 1e3);
    else
        print(b, "light", "%u lights, %.0f s old", r->lights_used, age_s);
}

static void print_latency(struct block *b, const struct gn_overlay_figures *f)
{
    const struct gn_msg_receipt *r = f->receipt;
    const struct {
        const char *name;
        float ms;
    } stages[] = {{"queue", r->queue_ms},         {"decode", r->decode_ms},
                  {"plan", r->plan_ms},           {"primary", r->primary_ms},
                  {"shade", r->shade_ms},         {"shadow", r->shadow_ms},
                  {"composite", r->composite_ms}, {"encode", r->encode_ms}};
    char text[512] = "";
    size_t n = 0;
    double sum = 0;
    for (size_t i = 0; i < GN_ARRAY_LEN(stages); i++) {
        sum += (double)stages[i].ms;
        n += (size_t)snprintf(text + n, sizeof(text) - n, "%s %.1f, ", stages[i].name,
                              (double)stages[i].ms);
    }
    double rest = f->latency_ms > sum ? f->latency_ms - sum : 0;
    print(b, "latency", "%.1f ms, %.1f at most", f->latency_ms, f->latency_max_ms);
    print(b, "stages", "%selsewhere %.1f", text, rest);
}

static void print_left_out(struct block *b, const struct gn_msg_receipt *r)
{
    char text[GN_ARRAY_LEN(r->left_out) * (sizeof(r->left_out[0].pass) + 2) + 1] = "";
    size_t n = 0;
    for (size_t i = 0; i < r->left_out_count; i++)
        n += (size_t)snprintf(text + n, sizeof(text) - n, "%s%s", i ? ", " : "",
                              r->left_out[i].pass);
    if (n > 0)
        put(b, "left out", text);
}

static void print_receipt(struct block *b, const struct gn_overlay_figures *f)
{
    const struct gn_msg_receipt *r = f->receipt;
    char text[256];
    print_latency(b, f);
    print_light(b, r);
    if (r->has_virtual_pixels)
        print(b, "objects", "in %u pixels", r->virtual_pixels);
    if (r->estimated_error >= 0)
        print(b, "error", "%.4f of the shadow, estimated", (double)r->estimated_error);
    else
        put(b, "error", "of the shadow not known");
    if (gn_overlay_print_refined(r, text, sizeof(text)) > 0)
        put(b, "refined", text);
    if (gn_overlay_print_budget(r, text, sizeof(text)) > 0)
        put(b, "budget", text);
    print_left_out(b, r);
}

void gn_overlay_draw_figures(struct gn_canvas *canvas, const struct gn_overlay_figures *f,
                             struct gn_overlay_box taken)
{
    struct block b;
    begin(&b, LABEL_LETTERS, canvas->width, canvas->height);
    if (f->rate_hz > 0)
        print(&b, "rate", "%.1f frames/s", f->rate_hz);
    if (f->receipt)
        print_receipt(&b, f);
    print(&b, "frames", "%ld sent, %ld shown, %ld dropped", f->n_sent, f->n_results, f->n_dropped);
    if (f->n_lost > 0)
        print(&b, "", "%ld lost with the server", f->n_lost);
    if (f->last_drop[0])
        print(&b, "dropped", "%s", f->last_drop);
    if (f->counts) {
        const struct gn_source_counts *c = f->counts;
        print(&b, "camera",
              "%" PRIu64 " whole, %" PRIu64 " incomplete, %" PRIu64 " skipped; packets: %" PRIu64
              " lost, %" PRIu64 " sent again; %" PRIu64 " times back",
              c->n_complete, c->n_incomplete, c->n_skipped, c->n_lost_packets, c->n_resent_packets,
              c->n_reopened);
    }
    draw_left(canvas, &b, taken);
}

void gn_overlay_draw_plan(struct gn_canvas *canvas, const struct gn_msg_receipt *receipt,
                          struct gn_overlay_box taken)
{
    struct block b;
    begin(&b, LABEL_LETTERS + 3, canvas->width, canvas->height);
    if (receipt->left_out_count == 0)
        put(&b, "plan", "nothing is left out");
    for (size_t i = 0; i < receipt->left_out_count; i++)
        put(&b, receipt->left_out[i].pass, receipt->left_out[i].why);
    draw_left(canvas, &b, taken);
}

void gn_overlay_draw_help(struct gn_canvas *canvas, const char *title,
                          const struct gn_overlay_line *lines, int n)
{
    struct block b;
    begin(&b, LABEL_LETTERS, canvas->width, canvas->height);
    put(&b, title, "");
    for (int i = 0; i < n; i++)
        put(&b, lines[i].label, lines[i].text);
    struct gn_overlay_box at = measure(&b);
    at.x = get_max((canvas->width - at.width) / 2, 0);
    at.y = get_max((canvas->height - at.height) / 2, 0);
    draw(canvas, &b, at, panel_color);
}

void gn_overlay_draw_hint(struct gn_canvas *canvas, const char *text)
{
    struct block b;
    begin(&b, 0, canvas->width, canvas->height);
    put(&b, "", text);
    draw(canvas, &b, measure(&b), panel_color);
}

void gn_overlay_draw_note(struct gn_canvas *canvas, const char *text, bool is_warning,
                          struct gn_overlay_box taken)
{
    struct block b;
    int width = taken.width > 0 ? taken.x + MARGIN : canvas->width;
    begin(&b, 0, width, canvas->height);
    put(&b, "", text);
    struct gn_overlay_box at = measure(&b);
    at.y = get_max(canvas->height - MARGIN - at.height, 0);
    draw(canvas, &b, at, is_warning ? warning_color : panel_color);
}
