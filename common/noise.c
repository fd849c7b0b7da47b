/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/noise.h"

#include <math.h>
#include <stdbool.h>

static double get_density(double x)
{
    return exp(-0.5 * x * x) / sqrt(2 * acos(-1.0));
}

/* Where the normal distribution reaches the share (1/2, 1), by Newton's steps from `from`, which
 * lies below: there it is concave, so no step goes too far. */
static double find_quantile(double share, double from)
{
    double x = from;
    for (int i = 0; i < 100; i++) {
        double step = (share - 1 + 0.5 * erfc(x / sqrt(2.0))) / get_density(x);
        x += step;
        if (fabs(step) < 1e-12)
            break;
    }
    return x;
}

void gn_noise_init(struct gn_noise *noise)
{
    enum { HALF = GN_NOISE_VALUES / 2 };
    double mean[HALF], begin = 0, sum = 0;
    for (int i = 0; i < HALF; i++) {
        bool is_last = i == HALF - 1;
        double end = is_last ? 0 : find_quantile(0.5 + (i + 1.0) / GN_NOISE_VALUES, begin);
        mean[i] = (get_density(begin) - (is_last ? 0 : get_density(end))) * GN_NOISE_VALUES;
        sum += mean[i] * mean[i];
        begin = end;
    }
    double scale = 1 / sqrt(sum / HALF);
    for (int i = 0; i < HALF; i++) {
        noise->deviate[HALF + i] = (float)(scale * mean[i]);
        noise->deviate[HALF - 1 - i] = (float)(-scale * mean[i]);
    }
}

uint32_t gn_noise_get_key(uint64_t number)
{
    /* The finalizer of splitmix64: Steele, Lea and Flood, OOPSLA 2014. */
    uint64_t z = number + 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)((z ^ (z >> 31)) >> 32);
}
