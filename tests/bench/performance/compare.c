/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/performance/performance.h"

#include <math.h>

struct gn_shadow_difference gn_performance_compare(const struct gn_image *a,
                                                   const struct gn_image *b)
{
    static const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    const double limit = 1.0 / 255;
    struct gn_shadow_difference d = {0};
    for (size_t i = 0; i < (size_t)a->width * (size_t)a->height; i++) {
        bool is_off = false;
        for (size_t k = 3 * i; k < 3 * i + 3; k++) {
            double factor = fabs((double)a->data[k] - b->data[k]);
            double code = fabs((double)gn_response_encode(&srgb, a->data[k]) -
                               gn_response_encode(&srgb, b->data[k]));
            d.largest = fmax(d.largest, factor);
            d.largest_code = fmax(d.largest_code, code);
            is_off |= !(factor <= limit) || !(code <= limit); // a NaN is off
        }
        d.n_off += is_off;
    }
    return d;
}
