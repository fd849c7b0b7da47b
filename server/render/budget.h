/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Quality under a deadline: of the settings whose predicted time fits a frame's budget, the one of
 * the least predicted error. Pure: no clock inside; whoever renders says what each frame took.
 *
 * Time: each pass takes a + b N for each of its samples, N the lights, both learned from the
 * frames; what is common to all, the machine's load above all, is one factor, the median of the
 * last frames. No line knows a jump, say of a lamp that comes in: what a setting took is remembered
 * for a while, and bounds those of less and of more work. Error: squares of independent parts add
 * up: of the lights c N^-e, c and e learned from the errors that were estimated; of the grid at
 * edges and of the shadow's step.
 *
 * So that it does not swing: a setting is entered where its time fits with the margin that the last
 * frames' spread asks for, and left only where it is over that by more than a dead band, or where
 * three of the last four frames were late; one late frame is the machine's hiccup. What is better
 * is entered only for a tenth less error, or for any where half the budget is enough, and after a
 * rest, which doubles whenever that went wrong.
 */
#ifndef GN_SERVER_RENDER_BUDGET_H
#define GN_SERVER_RENDER_BUDGET_H

#include <stdbool.h>
#include <stdint.h>

#include "server/render/render.h"

/** Least lights that are chosen where there are more. */
#define GN_BUDGET_LEAST_LIGHTS 4

/** Coarser shadows are not offered: a step of 4 is slower than one of 2 where shadows have edges,
 * as more of what is between has to be worked out. */
#define GN_BUDGET_MAX_STEP 2

/** What a controller chooses; fields as in struct gn_render_options. */
struct gn_budget_setting {
    int n_lights;
    int grid;
    int shadow_step;
};

/** What is known of a frame before it is rendered. */
struct gn_budget_frame {
    double budget_ms; // (0, infinity); what is not, counts as no time at all
    int64_t n_pixels; // of all views
    int n_lights;     // distant lights that there are, >= 0
    int max_step;     // largest shadow_step; 0: 1
};

enum gn_budget_verdict {
    GN_BUDGET_LEARNS = 0, // too few frames were seen: nothing is predicted
    GN_BUDGET_FITS = 1,
    GN_BUDGET_TOO_SMALL = 2, // even the least setting takes longer, as far as can be predicted
};

struct gn_budget_choice {
    struct gn_budget_setting setting;
    enum gn_budget_verdict verdict;
    double predicted_ms;    // of the whole frame, the median; < 0: not known
    double predicted_error; // as a report's estimated_error; < 0: not known
};

/** What the frame took. */
struct gn_budget_outcome {
    double ms;                                       // the whole frame, against the budget
    double ms_plan, ms_primary, ms_shade, ms_shadow; // as in the reports, sums over the views
    int64_t n_refined_pixels;
    double estimated_error; // of frames of this setting; < 0: not known
    int n_lights;           // that it had where there were fewer than chosen; 0: as chosen
};

/** Straight line through weighted points; old ones count less and less. */
struct gn_budget_line {
    double weight, x, y, xx, xy; // sums
};

/** Numbers of lights that times are remembered of. */
#define GN_BUDGET_COUNTS 24

/** What a setting took when it was used last. */
struct gn_budget_memory {
    double ms;      // for each pixel, at load 1; 0: not known
    uint64_t frame; // when
};

/** Ratios of measured to predicted times that are kept. */
#define GN_BUDGET_KEPT 64

/** One stream of frames: a viewer's. A value; zeroed: nothing is known. Thread-safety: unsafe. */
struct gn_budget {
    uint64_t n_frames, n_misses, n_switches; // misses: longer than the budget
    struct gn_budget_setting setting;        // of the frame at hand, or the last one
    struct gn_budget_frame frame;
    struct gn_budget_line plan, primary, shade, shadow, rest;
    struct gn_budget_memory memory[GN_BUDGET_COUNTS][3][3]; // by lights, grid, step
    double step_share[3];        // of the shadow pass at step 1, 2, 4; 0: not seen
    double refined_share;        // of pixels; < 0 or, where n_frames is 0, 0: not seen
    struct gn_budget_line error; // logarithms of the lights' part over those of N
    double shape_ms;             // of the frame at hand, before the factor
    double level[GN_BUDGET_KEPT], spread[GN_BUDGET_KEPT];
    int n_level, n_spread, next_spread;
    double factor;    // that the frame at hand was predicted with
    unsigned late;    // bit i: the frame i frames ago was a miss
    int rested, wait; // frames since the last switch; that a rise waits for
    int n_long;       // frames for which the setting has looked too long
    bool has_risen;   // the last switch was one
    double load;      // by which times have grown since the first frame
    double fallen_at; // load and factor at the last fall
};

/**
 * What the next frame should be rendered with. Numbers that are none (NaN, infinite, negative)
 * count as 0.
 */
void gn_budget_choose(struct gn_budget *budget, const struct gn_budget_frame *frame,
                      struct gn_budget_choice *out_choice);
/** What that frame took. A time that is none, or none at all, teaches nothing. */
void gn_budget_learn(struct gn_budget *budget, const struct gn_budget_outcome *outcome);

/** "learns", "fits", "too small". */
const char *gn_budget_get_verdict_name(enum gn_budget_verdict verdict);

#endif
