/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/quad.h"

#include <math.h>

void gn_quad_map(double c[4][2], double u, double v, double out_px[static 2])
{
    double s[2], d1[2], d2[2];
    for (int a = 0; a < 2; a++) {
        s[a] = c[0][a] - c[1][a] + c[2][a] - c[3][a];
        d1[a] = c[1][a] - c[2][a];
        d2[a] = c[3][a] - c[2][a];
    }
    double det = d1[0] * d2[1] - d1[1] * d2[0];
    double g = (s[0] * d2[1] - s[1] * d2[0]) / det, h = (d1[0] * s[1] - d1[1] * s[0]) / det;
    double w = g * u + h * v + 1;
    for (int a = 0; a < 2; a++)
        out_px[a] = ((c[1][a] - c[0][a] + g * c[1][a]) * u + (c[3][a] - c[0][a] + h * c[3][a]) * v +
                     c[0][a]) /
                    w;
}

double gn_quad_get_side(double c[4][2])
{
    double shortest = INFINITY;
    for (int k = 0; k < 4; k++)
        shortest = fmin(shortest, hypot(c[k][0] - c[(k + 1) % 4][0], c[k][1] - c[(k + 1) % 4][1]));
    return shortest;
}

double gn_grey_sample(const struct gn_grey *g, double x, double y)
{
    double fx = floor(x - 0.5), fy = floor(y - 0.5);
    double u = x - 0.5 - fx, v = y - 0.5 - fy;
    const uint8_t *p = g->pixels + (long)fy * g->width + (long)fx;
    const uint8_t *q = p + g->width;
    const float *l = g->linear;
    return (1 - v) * ((1 - u) * (double)l[p[0]] + u * (double)l[p[1]]) +
           v * ((1 - u) * (double)l[q[0]] + u * (double)l[q[1]]);
}

bool gn_quad_sample_cells(const struct gn_grey *g, int n, double corners_px[4][2],
                          double *out_light)
{
    for (int i = 0; i < n * n; i++) {
        double p[2];
        gn_quad_map(corners_px, (i % n + 0.5) / n, (i / n + 0.5) / n, p);
        if (!(p[0] >= 1 && p[1] >= 1 && p[0] <= g->width - 1 && p[1] <= g->height - 1))
            return false;
        out_light[i] = gn_grey_sample(g, p[0], p[1]);
    }
    return true;
}
