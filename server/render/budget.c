/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/budget.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"
#include "proto/attr.h"

/** Frames until times are predicted, and until rises have to rest. */
enum { LEARNING = 2, CLIMBING = 16 };
/** Frames that a setting must look too long before it is left for that. */
enum { LASTING = 8 };
/** Frames for which a setting is new. */
enum { NEW = 2 };
/** Frames that a rise rests for at first, and at most. */
enum { REST = 12, LONGEST_REST = 768 };
/** Share of the load at the last fall from which on waiting starts anew. */
#define RELIEF 0.7
/** Ratios in the level; fewer after a change of load. */
enum { LEVEL = 9 };
/** Frames of which the spread is known; before, it is taken for FIRST_MARGIN. */
enum { SPREAD_LEAST = 8 };
#define FIRST_MARGIN 1.15
/** A level from which on, or under whose reciprocal, it is a change of load. */
#define MOVED 1.15
/** The margin's interval. */
#define LEAST_MARGIN 1.02
#define LARGEST_MARGIN 1.5
/** The dead band: over the margin by less than this a setting is kept. */
#define KEEP 1.06
/** Less error than this share is a reason to rise. */
#define WORTH 0.9
/** A rise, while frames are few, takes up to this times longer. */
#define CLIMB 1.5
/** Share of its weight that a point keeps with each new one. */
#define KEEP_TIMES 0.95
#define KEEP_ERRORS 0.7
/** Frames for which is remembered what a setting took. */
enum { REMEMBERED = 600 };
/** Weight of what is known beforehand beside all points together. */
#define TIME_PRIOR 0.01
#define ERROR_PRIOR 0.5
/** Beforehand: lights that take as long as all that does not depend on them. */
#define LIGHTS_PLAN 64
#define LIGHTS_SHADE 8
#define LIGHTS_SHADOW 16
/** Beforehand: share of pixels that get a grid. */
#define REFINED_SHARE 0.1
/** Beforehand: error c N^-e, between the partition's of 16 and of 64 lights (docs/error.md). */
#define ERROR_EXPONENT 0.7
#define ERROR_FACTOR 0.28

/** What is more than that, ms, counts as that. */
#define LARGEST 1e9

static const int steps[3] = {1, 2, 4};
/** Taken beforehand: time of the shadow pass with that step, and RMS error of what is between. The
 * rig's room (640 x 480, 122 lights) has 0.54 and 0.0032 with a step of 2. */
static const double step_shares[3] = {1, 0.45, 0.3};
static const double step_errors[3] = {0, 0.004, 0.012};
/** Taken beforehand: RMS error of the shadow by the grid at edges. Against 4 x 4 rays everywhere
 * the rig's room (means over 59, 122, 178 lights, 320 x 240 and 640 x 480) has 0.028, 0.0095,
 * 0.005. */
static const double grid_errors[4] = {0, 0.02, 0.009, 0.006};

/** A setting's place among the tables. */
struct rung {
    struct gn_budget_setting setting;
    double ms;    // predicted, without the factor
    double error; // predicted
};

static double get_number(double x)
{
    return isfinite(x) && x > 0 ? fmin(x, LARGEST) : 0;
}

/* Lines */

static void add_point(struct gn_budget_line *line, double keep, double x, double y)
{
    line->weight = keep * line->weight + 1;
    line->x = keep * line->x + x;
    line->y = keep * line->y + y;
    line->xx = keep * line->xx + x * x;
    line->xy = keep * line->xy + x * y;
}

/**
 * y = a + b x through the points' mean, a, b >= 0; b of the least squares, pulled to a = b x0,
 * which says what the points leave open.
 */
static double get_time(const struct gn_budget_line *line, double x0, double x)
{
    if (!(line->weight > 0))
        return 0;
    double w = 1 / line->weight;
    double mx = w * line->x, my = w * line->y;
    double cxx = fmax(w * line->xx - mx * mx, 0), cxy = w * line->xy - mx * my;
    double pull = TIME_PRIOR * (x0 + mx) * (x0 + mx);
    double b = (cxy + pull * my / (x0 + mx)) / (cxx + pull);
    b = fmin(fmax(b, 0), mx > 0 ? my / mx : b);
    return my + b * (x - mx);
}

/** Error by the lights: exp(a) n^-e, e pulled to what is known beforehand. */
static double get_light_error(const struct gn_budget_line *line, int n_lights)
{
    if (n_lights == 0)
        return 0;
    if (!(line->weight > 0))
        return ERROR_FACTOR * pow(n_lights, -ERROR_EXPONENT);
    double w = 1 / line->weight;
    double mx = w * line->x, my = w * line->y;
    double cxx = fmax(w * line->xx - mx * mx, 0), cxy = w * line->xy - mx * my;
    double e = (ERROR_PRIOR * ERROR_EXPONENT - cxy) / (ERROR_PRIOR + cxx);
    e = fmin(fmax(e, 0.2), 1.5);
    return exp(my + e * (mx - log(n_lights)));
}

/* What a setting takes and gives */

static int find_step(int step)
{
    return step >= 4 ? 2 : step >= 2 ? 1 : 0;
}

static double get_refined_share(const struct gn_budget *b)
{
    return b->refined_share > 0 ? b->refined_share : REFINED_SHARE;
}

static double count_samples(const struct gn_budget *b, const struct gn_budget_setting *s,
                            int64_t n_pixels)
{
    double refined = s->grid > 1 ? get_refined_share(b) * s->grid * s->grid : 0;
    return (double)n_pixels * (1 + refined);
}

static double get_step_share(const struct gn_budget *b, int step)
{
    int i = find_step(step);
    return b->step_share[i] > 0 ? b->step_share[i] : step_shares[i];
}

static double predict_shape(const struct gn_budget *b, const struct gn_budget_setting *s,
                            int64_t n_pixels)
{
    double samples = count_samples(b, s, n_pixels);
    double shadow =
        get_time(&b->shadow, LIGHTS_SHADOW, s->n_lights) * get_step_share(b, s->shadow_step);
    return get_time(&b->plan, LIGHTS_PLAN, s->n_lights) +
           samples * (get_time(&b->primary, 1, 0) + shadow +
                      get_time(&b->shade, LIGHTS_SHADE, s->n_lights)) +
           (double)n_pixels * get_time(&b->rest, 1, 0);
}

/** Place of a number of lights among 4, 6, 8, 11, ... */
static int find_count(int n_lights)
{
    int i = n_lights > 0 ? (int)lrint(2 * log2(n_lights / 4.0)) + 4 : 0;
    return i < 0 ? 0 : i < GN_BUDGET_COUNTS ? i : GN_BUDGET_COUNTS - 1;
}

/** What the setting takes, between what is remembered of those of less and of more work. */
static double predict_ms(const struct gn_budget *b, const struct gn_budget_setting *s,
                         int64_t n_pixels)
{
    int count = find_count(s->n_lights), step = find_step(s->shadow_step);
    double least = 0, most = INFINITY, unit = b->load * (double)n_pixels;
    for (int i = 0; i < GN_BUDGET_COUNTS * 9; i++) {
        int c = i / 9, g = i / 3 % 3, t = i % 3;
        const struct gn_budget_memory *m = &b->memory[c][g][t];
        if (!(m->ms > 0) || b->n_frames - m->frame > REMEMBERED)
            continue;
        if (c == count && g == s->grid - 1 && t == step)
            return m->ms * unit;
        if (c <= count && g <= s->grid - 1 && t >= step)
            least = fmax(least, m->ms * unit);
        else if (c >= count && g >= s->grid - 1 && t <= step)
            most = fmin(most, m->ms * unit);
    }
    return fmax(fmin(predict_shape(b, s, n_pixels), most), least);
}

/** Without the lights' part. */
static double get_other_error2(const struct gn_budget_setting *s)
{
    double grid = grid_errors[s->grid], step = step_errors[find_step(s->shadow_step)];
    return grid * grid + step * step;
}

static double predict_error(const struct gn_budget *b, const struct gn_budget_setting *s)
{
    double light = get_light_error(&b->error, s->n_lights);
    return sqrt(light * light + get_other_error2(s));
}

/* The past */

/** The value of that rank, 0 the least. */
static double get_ranked(const double *values, int n, int rank)
{
    double sorted[GN_BUDGET_KEPT];
    memcpy(sorted, values, (size_t)n * sizeof(*values));
    qsort(sorted, (size_t)n, sizeof(*sorted), gn_compare_doubles);
    return sorted[rank];
}

/** level[n_level - 1] is the newest. */
static double get_level(const struct gn_budget *b, int n)
{
    n = n < b->n_level ? n : b->n_level;
    return n == 0 ? 1 : get_ranked(b->level + b->n_level - n, n, n / 2);
}

/** By how much a frame takes longer than its prediction, but for one in ten. */
static double get_margin(const struct gn_budget *b)
{
    if (b->n_spread < SPREAD_LEAST)
        return FIRST_MARGIN;
    double margin = get_ranked(b->spread, b->n_spread, b->n_spread - 1 - b->n_spread / 10);
    return fmin(fmax(margin, LEAST_MARGIN), LARGEST_MARGIN);
}

/* Choosing */

/** Numbers of lights: 4, 6, 8, 11, 16, 23, ...; all of them last. Returns the next. */
static int get_next_count(int n, int n_lights)
{
    int next = (int)lrint(GN_BUDGET_LEAST_LIGHTS * exp2(0.5 * lrint(2 * log2(n / 4.0) + 1)));
    return next < n_lights ? next : n_lights;
}

static int get_least_lights(const struct gn_budget_frame *frame)
{
    return frame->n_lights < GN_BUDGET_LEAST_LIGHTS ? frame->n_lights : GN_BUDGET_LEAST_LIGHTS;
}

/** Is a a better choice than b? Where the errors are alike, the faster one. */
static bool is_better(const struct rung *a, const struct rung *b)
{
    return a->error < b->error || (!(a->error > b->error) && a->ms < b->ms);
}

/**
 * The setting of the least error up to `limit`, ms without the factor; where there is none, the
 * fastest. Returns whether there was one.
 */
static bool find_best(const struct gn_budget *b, const struct gn_budget_frame *frame, double limit,
                      struct rung *out)
{
    bool fits = false;
    struct rung fastest = {.ms = INFINITY}, best = {.error = INFINITY};
    for (int n = get_least_lights(frame);; n = get_next_count(n, frame->n_lights)) {
        for (int i = 0; i < 9 && steps[i / 3] <= frame->max_step; i++) {
            struct rung r = {.setting = {n, 1 + i % 3, steps[i / 3]}};
            r.ms = predict_ms(b, &r.setting, frame->n_pixels);
            r.error = predict_error(b, &r.setting);
            if (r.ms < fastest.ms)
                fastest = r;
            if (r.ms <= limit && (!fits || is_better(&r, &best))) {
                best = r;
                fits = true;
            }
        }
        if (n >= frame->n_lights)
            break;
    }
    *out = fits ? best : fastest;
    return fits;
}

static struct rung get_current(const struct gn_budget *b, const struct gn_budget_frame *frame)
{
    struct rung r = {.setting = b->setting};
    r.setting.n_lights =
        r.setting.n_lights < frame->n_lights ? r.setting.n_lights : frame->n_lights;
    // The lights have changed: all are still all.
    if (b->setting.n_lights >= b->frame.n_lights)
        r.setting.n_lights = frame->n_lights;
    if (r.setting.shadow_step > frame->max_step)
        r.setting.shadow_step = 1;
    r.ms = predict_ms(b, &r.setting, frame->n_pixels);
    r.error = predict_error(b, &r.setting);
    return r;
}

/** Where the level has moved, all that was learned moves with it: points before and after a change
 * of load would make no line. */
static void move_times(struct gn_budget *b, bool is_late)
{
    struct gn_budget_line *lines[] = {&b->plan, &b->primary, &b->shade, &b->shadow, &b->rest};
    double level = get_level(b, LEVEL);
    if ((level < MOVED && level * MOVED > 1) || (!is_late && b->n_level < LEVEL))
        return;
    for (size_t i = 0; i < GN_ARRAY_LEN(lines); i++) {
        lines[i]->y *= level;
        lines[i]->xy *= level;
    }
    for (int i = 0; i < b->n_level; i++)
        b->level[i] /= level;
    b->load *= level;
}

/** After a change of load only the last frames say what the level is now; nor are they spread. */
static void take_new_level(struct gn_budget *b)
{
    int n = b->n_level < 3 ? b->n_level : 3;
    memmove(b->level, b->level + b->n_level - n, (size_t)n * sizeof(*b->level));
    b->n_level = n;
    for (int i = 1; i <= 3 && i <= b->n_spread; i++)
        b->spread[(b->next_spread + GN_BUDGET_KEPT - i) % GN_BUDGET_KEPT] = 1;
    b->late = 0;
}

static void fall(struct gn_budget *b)
{
    // A rise that had to be taken back soon was a mistake: the next one waits longer.
    if (b->has_risen && b->rested < 2 * b->wait)
        b->wait = 2 * b->wait < LONGEST_REST ? 2 * b->wait : LONGEST_REST;
    b->has_risen = false;
    b->fallen_at = b->load * b->factor;
}

/** Whether to leave `current` for `best`. */
static bool decide(struct gn_budget *b, const struct rung *current, const struct rung *best,
                   const struct gn_budget_frame *frame, double margin, bool is_late)
{
    double ms = current->ms * b->factor;
    bool is_long = ms > frame->budget_ms || ms * margin > frame->budget_ms * KEEP;
    // Of another frame the time is foreseen; of the same ones it has to last.
    bool is_other = memcmp(frame, &b->frame, sizeof(*frame)) != 0;
    b->n_long = is_long ? b->n_long + 1 : 0;
    bool is_over = is_late || (is_long && (is_other || b->n_long >= LASTING));
    if (b->load * b->factor < RELIEF * b->fallen_at)
        b->wait = REST;
    if (memcmp(&current->setting, &best->setting, sizeof(current->setting)) == 0)
        return false;
    if (is_over && best->ms < current->ms) {
        fall(b);
        return true;
    }
    bool is_early = b->n_frames < CLIMBING;
    bool has_room = best->ms * b->factor * margin < 0.5 * frame->budget_ms;
    // What the last frames took may be a load that goes or comes.
    double level = get_level(b, 3) / get_level(b, LEVEL);
    if (level > MOVED || level * MOVED < 1)
        return false;
    if (!(best->error <= (has_room ? 1 : WORTH) * current->error) ||
        (!is_early && b->rested < b->wait))
        return false;
    b->has_risen = true;
    return true;
}

void gn_budget_choose(struct gn_budget *b, const struct gn_budget_frame *asked,
                      struct gn_budget_choice *out)
{
    struct gn_budget_frame frame = {.budget_ms = get_number(asked->budget_ms),
                                    .n_pixels = asked->n_pixels > 0 ? asked->n_pixels : 0,
                                    .n_lights = asked->n_lights > 0 ? asked->n_lights : 0,
                                    .max_step = asked->max_step > 1 ? asked->max_step : 1};
    struct rung best, current;
    if (b->n_frames == 0) {
        b->wait = REST;
        b->load = 1;
    }
    bool knows = b->n_frames >= LEARNING;
    bool is_late = __builtin_popcount(b->late & 15) >= 3;
    if (is_late)
        take_new_level(b);
    move_times(b, is_late);
    b->factor = get_level(b, LEVEL);
    double margin = get_margin(b), limit = frame.budget_ms / (b->factor * margin);
    current = get_current(b, &frame);
    if (knows && b->n_frames < CLIMBING)
        limit = fmin(limit, CLIMB * current.ms);
    bool fits = knows && find_best(b, &frame, limit, &best);
    if (!knows)
        best = (struct rung){.setting = {get_least_lights(&frame), 1, 1}};
    bool is_first = b->n_frames == 0;
    if (is_first || !knows || decide(b, &current, &best, &frame, margin, is_late)) {
        b->n_switches += !is_first && memcmp(&b->setting, &best.setting, sizeof(b->setting)) != 0;
        b->rested = 0;
        current = best;
    }
    b->setting = current.setting;
    b->frame = frame;
    b->shape_ms = current.ms;
    *out = (struct gn_budget_choice){
        .setting = current.setting,
        .verdict = !knows                                              ? GN_BUDGET_LEARNS
                   : fits || current.ms * b->factor <= frame.budget_ms ? GN_BUDGET_FITS
                                                                       : GN_BUDGET_TOO_SMALL,
        .predicted_ms = knows ? current.ms * b->factor : -1,
        .predicted_error = b->error.weight > 0 ? current.error : -1,
    };
}

/* Learning */

static void keep_level(struct gn_budget *b, double ratio)
{
    if (b->n_level == LEVEL) {
        memmove(b->level, b->level + 1, (LEVEL - 1) * sizeof(*b->level));
        b->n_level--;
    }
    b->level[b->n_level++] = ratio;
}

static void keep_spread(struct gn_budget *b, double ratio)
{
    b->spread[b->next_spread] = ratio;
    b->next_spread = (b->next_spread + 1) % GN_BUDGET_KEPT;
    if (b->n_spread < GN_BUDGET_KEPT)
        b->n_spread++;
}

static int get_lights(const struct gn_budget *b, const struct gn_budget_outcome *o)
{
    bool is_fewer = o->n_lights > 0 && o->n_lights < b->setting.n_lights;
    return is_fewer ? o->n_lights : b->setting.n_lights;
}

static void learn_shape(struct gn_budget *b, const struct gn_budget_outcome *o)
{
    const struct gn_budget_setting *s = &b->setting;
    double samples = count_samples(b, s, b->frame.n_pixels), x = get_lights(b, o);
    double plan = get_number(o->ms_plan), primary = get_number(o->ms_primary);
    double shade = get_number(o->ms_shade), shadow = get_number(o->ms_shadow);
    double rest = get_number(o->ms - plan - primary - shade - shadow);
    int i = find_step(s->shadow_step);
    double full = get_time(&b->shadow, LIGHTS_SHADOW, x) * samples * b->factor;
    // What a step spares shows best in the first frames of it: then the load is the same.
    if (i > 0 && b->rested <= NEW && full > 0)
        b->step_share[i] = 0.5 * (get_step_share(b, steps[i]) + fmin(shadow / full, 1));
    add_point(&b->plan, KEEP_TIMES, x, plan);
    add_point(&b->primary, KEEP_TIMES, 0, primary / samples);
    add_point(&b->shade, KEEP_TIMES, x, shade / samples);
    add_point(&b->shadow, KEEP_TIMES, x, shadow / samples / get_step_share(b, steps[i]));
    add_point(&b->rest, KEEP_TIMES, 0, rest / (double)b->frame.n_pixels);
}

static void learn_error(struct gn_budget *b, double estimated, int n_lights)
{
    if (!(estimated >= 0 && estimated <= 1) || n_lights == 0)
        return;
    // An estimate sees no grid; what the step adds is known only beforehand.
    double step = step_errors[find_step(b->setting.shadow_step)];
    double light2 = fmax(estimated * estimated - step * step, 1e-2 * estimated * estimated);
    double light = fmax(sqrt(light2), 1e-5);
    add_point(&b->error, KEEP_ERRORS, log(n_lights), log(light));
}

/** The setting's time without the level. The first frame in new light is not like the others. */
static void remember(struct gn_budget *b, const struct gn_budget_outcome *o, double ms)
{
    const struct gn_budget_setting *s = &b->setting;
    struct gn_budget_memory *m =
        &b->memory[find_count(get_lights(b, o))][s->grid - 1][find_step(s->shadow_step)];
    double unit = ms / (b->load * (double)b->frame.n_pixels);
    bool is_usual = unit < 1.5 * m->ms && m->ms < 1.5 * unit;
    if (!(m->ms > 0) || b->n_frames - m->frame > REMEMBERED)
        m->ms = unit;
    else if (b->rested <= NEW || is_usual)
        m->ms += (unit - m->ms) * (b->rested <= NEW ? 0.5 : 0.1);
    m->frame = b->n_frames;
}

/** What surprises after a change of setting says what that takes; later, what the load is. */
static void learn_time(struct gn_budget *b, const struct gn_budget_outcome *o, double ms)
{
    double level = b->rested <= NEW ? b->factor : get_level(b, LEVEL);
    remember(b, o, ms / level);
    if (b->rested <= NEW || !(b->shape_ms > 0)) {
        learn_shape(b, o);
        return;
    }
    double ratio = ms / b->shape_ms;
    keep_level(b, ratio);
    keep_spread(b, ratio / b->factor);
    level = get_level(b, 3);
    // What stands out is not how the passes are.
    if (ratio < 1.5 * level && level < 1.5 * ratio)
        learn_shape(b, o);
}

void gn_budget_learn(struct gn_budget *b, const struct gn_budget_outcome *o)
{
    double ms = get_number(o->ms);
    if (!(ms > 0) || b->frame.n_pixels == 0)
        return;
    bool is_late = ms > b->frame.budget_ms;
    bool is_first = b->n_frames == 0;
    b->n_frames++;
    b->late = b->late << 1 | (ms > KEEP * b->frame.budget_ms);
    b->n_misses += is_late;
    b->rested++;
    if (b->setting.grid > 1 && o->n_refined_pixels >= 0) {
        double share = (double)o->n_refined_pixels / (double)b->frame.n_pixels;
        b->refined_share =
            b->refined_share > 0 ? 0.7 * b->refined_share + 0.3 * share : fmax(share, 1e-6);
    }
    if (!is_first) // which takes memory and fills caches, as no other does
        learn_time(b, o, ms);
    learn_error(b, o->estimated_error, get_lights(b, o));
}

const char *gn_budget_get_verdict_name(enum gn_budget_verdict verdict)
{
    static const char *const names[] = {"learns", "fits", "too small"};
    return names[verdict];
}
