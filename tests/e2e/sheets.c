/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/e2e/sheets.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "client/vision/markers.h"

int gn_test_print_sheet(const struct gn_bodies *bodies, int body, struct gn_rig_sheet *out)
{
    const struct gn_body *b = &bodies->bodies[body];
    memset(out, 0, sizeof(*out));
    for (int i = 0; i < b->n_markers && i < GN_RIG_SHEET_MARKERS; i++) {
        double(*c)[3] = b->markers[i].corners_body;
        struct gn_rig_printed *p = &out->printed[out->n_printed++];
        *p = (struct gn_rig_printed){
            .x = (c[0][0] + c[2][0]) / 2, .y = (c[0][1] + c[2][1]) / 2, .size = c[1][0] - c[0][0]};
        p->cells = gn_marker_get_cells(bodies->dictionary, b->markers[i].id, p->white);
        out->half_width = fmax(out->half_width, fabs(p->x) + 0.7 * p->size);
        out->half_height = fmax(out->half_height, fabs(p->y) + 0.7 * p->size);
    }
    return out->n_printed;
}

void gn_test_print_matrix(const char *name, const double m[static 16], const char *end)
{
    printf("\"%s\": [", name);
    for (int i = 0; i < 16; i++)
        printf("%s%.17g", i ? ", " : "", m[i]);
    printf("]%s", end);
}
