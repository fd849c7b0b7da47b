/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal_change.h"

#include <math.h>
#include <string.h>

static const double cos_window = 0.766044443118978; // 40 degrees: each place is in about 7 windows
static const double cos_middle = 0.866025403784439; // 30: no place is further from a middle than 15
static const double ratio_changed = 4, share_changed = 0.02;

void gn_change_init(struct gn_change *change)
{
    memset(change, 0, sizeof(*change));
    const double golden_angle = 2.39996322972865332; // pi (3 - sqrt 5): a spiral of even density
    for (int i = 0; i < GN_CHANGE_WINDOWS; i++) {
        double z = 1 - (2 * i + 1.0) / GN_CHANGE_WINDOWS, r = sqrt(1 - z * z);
        change->middle[i][0] = r * cos(golden_angle * i);
        change->middle[i][1] = r * sin(golden_angle * i);
        change->middle[i][2] = z;
    }
}

static double get_cosine(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void gn_change_add(struct gn_change *change, bool is_after, const double dir[static 3],
                   double luminance)
{
    double *sums = is_after ? change->after : change->before;
    *(is_after ? &change->total_after : &change->total_before) += luminance;
    for (int i = 0; i < GN_CHANGE_WINDOWS; i++) {
        double c = get_cosine(change->middle[i], dir);
        if (c > cos_window) // falls to 0 at the rim, so that a light that moves makes no step
            sums[i] += luminance * (c - cos_window) / (1 - cos_window);
    }
}

void gn_change_find(struct gn_change *change)
{
    double all = fmax(change->total_before, change->total_after), floor = share_changed * all;
    change->any = false;
    change->deviation = 0;
    for (int i = 0; i < GN_CHANGE_WINDOWS; i++) {
        double a = change->before[i], b = change->after[i];
        change->is_changed[i] = fmax(a, b) > ratio_changed * fmin(a, b) && fabs(a - b) > floor;
        change->any = change->any || change->is_changed[i];
        if (all > 0)
            change->deviation = fmax(change->deviation, fabs(a - b) / all);
    }
}

bool gn_change_has(const struct gn_change *change, const double dir[static 3])
{
    for (int i = 0; i < GN_CHANGE_WINDOWS && change->any; i++) {
        if (change->is_changed[i] && get_cosine(change->middle[i], dir) > cos_middle)
            return true;
    }
    return false;
}
