/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/code_table.h"

#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

static bool is_same_curve(const struct gn_response *a, const struct gn_response *b)
{
    return a->type == b->type && a->gamma == b->gamma && a->log_a == b->log_a &&
           a->log_b == b->log_b && a->log_c == b->log_c && a->type != GN_RESPONSE_TABLE;
}

int gn_code_table_create(const struct gn_response *response, int code_max,
                         struct gn_code_table *previous, struct gn_code_table **out_table)
{
    if (previous && previous->code_max == code_max && is_same_curve(&previous->curve, response)) {
        atomic_fetch_add_explicit(&previous->references, 1, memory_order_relaxed);
        *out_table = previous;
        return 0;
    }
    size_t n = (size_t)code_max + 1;
    struct gn_code_table *t = calloc(1, sizeof(*t) + n * sizeof(t->linear[0]));
    *out_table = t;
    if (!t)
        return -ENOMEM;
    atomic_init(&t->references, 1);
    t->curve = (struct gn_response){.type = response->type,
                                    .gamma = response->gamma,
                                    .log_a = response->log_a,
                                    .log_b = response->log_b,
                                    .log_c = response->log_c};
    t->code_max = code_max;
    for (size_t i = 0; i < n; i++)
        t->linear[i] = gn_response_decode(response, (float)i / (float)code_max);
    return 0;
}

void gn_code_table_unref(struct gn_code_table **table)
{
    struct gn_code_table *t = *table;
    *table = NULL;
    if (t && atomic_fetch_sub_explicit(&t->references, 1, memory_order_acq_rel) == 1)
        free(t);
}
