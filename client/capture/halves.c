/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/halves.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "common/half.h"

bool gn_halves_are_exact(const float *values, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        float back = gn_half_to_float(gn_half_from_float(values[i]));
        if (!(back == values[i]) && !(isnan(back) && isnan(values[i])))
            return false;
    }
    return true;
}

double gn_halves_pack(const float *values, size_t n, uint8_t *out)
{
    float largest = 0;
    for (size_t i = 0; i < n; i++) {
        float v = fabsf(values[i]);
        largest = v > largest && v < INFINITY ? v : largest;
    }
    double scale = 1;
    while ((double)largest / scale > (double)GN_HALF_MAX)
        scale *= 2;
    float factor = (float)(1 / scale); // a power of two: exact
    for (size_t i = 0; i < n; i++) {
        uint16_t half = gn_half_from_float(values[i] * factor);
        out[2 * i] = (uint8_t)half;
        out[2 * i + 1] = (uint8_t)(half >> 8);
    }
    return scale;
}

int gn_halves_fill(struct gn_halves *halves, const float *values, size_t n, double *out_scale)
{
    if (halves->n < n) {
        gn_halves_finish(halves);
        halves->data = malloc(2 * n);
        if (!halves->data)
            return -ENOMEM;
        halves->n = n;
    }
    *out_scale = gn_halves_pack(values, n, halves->data);
    return 0;
}

void gn_halves_finish(struct gn_halves *halves)
{
    free(halves->data);
    *halves = (struct gn_halves){0};
}
