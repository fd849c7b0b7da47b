/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What is written over the composite: the receipt's figures, the plan, the keys, news. Everything
 * stands on dark panels, so that it can be read over any picture. Draws only; knows no window.
 * Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_VIEW_OVERLAY_H
#define GN_CLIENT_VIEW_OVERLAY_H

#include <stddef.h>

#include "client/capture/source.h"
#include "client/lib/gnomon.h"
#include "client/view/canvas.h"

/** What the figures are drawn from; all borrowed for the call. */
struct gn_overlay_figures {
    const struct gn_msg_receipt *receipt; // of the picture that is shown; NULL: none yet
    double rate_hz;                       // results per second of late; 0: not known
    double latency_ms, latency_max_ms;    // from sending to having it; the largest of late
    long n_sent, n_results, n_dropped, n_lost;
    const char *last_drop;                 // why a frame was dropped; "": none was
    const struct gn_source_counts *counts; // of a camera; NULL: a recording has none
};

/** A line of a panel with two columns. */
struct gn_overlay_line {
    const char *label, *text;
};

/** A box of the canvas that is taken, units; all 0: none. */
struct gn_overlay_box {
    int x, y, width, height;
};

/** Panels in the upper left corner, as long as fits above `taken` where they reach it: figures;
 * or the passes that the plan left out, with their reasons. */
void gn_overlay_draw_figures(struct gn_canvas *canvas, const struct gn_overlay_figures *figures,
                             struct gn_overlay_box taken);
void gn_overlay_draw_plan(struct gn_canvas *canvas, const struct gn_msg_receipt *receipt,
                          struct gn_overlay_box taken);

/** A word in the upper left corner. */
void gn_overlay_draw_hint(struct gn_canvas *canvas, const char *text);

/** A panel in the middle. */
void gn_overlay_draw_help(struct gn_canvas *canvas, const char *title,
                          const struct gn_overlay_line *lines, int n);

/** A sentence at the lower left, beside `taken`; one that is a warning stands out. */
void gn_overlay_draw_note(struct gn_canvas *canvas, const char *text, bool is_warning,
                          struct gn_overlay_box taken);

/**
 * The budget and the refining of a receipt in a few words, "" where there was neither. Returns as
 * snprintf.
 */
int gn_overlay_print_budget(const struct gn_msg_receipt *receipt, char *text, size_t size);
int gn_overlay_print_refined(const struct gn_msg_receipt *receipt, char *text, size_t size);

#endif
