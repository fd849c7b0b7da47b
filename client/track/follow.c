/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/follow.h"

#include <math.h>
#include <string.h>

/** Cells that may look wrong, of all. */
static const double wrong_share = 0.05;
/** Least difference between the means of white and of black cells, of full scale. */
static const double min_contrast = 0.02;

/** Picture position of (u, v) in [0, 1]^2 of a square with these corners (Heckbert 1989, 2.2.3). */
static void map_unit(double c[4][2], double u, double v, double out[static 2])
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
        out[a] = ((c[1][a] - c[0][a] + g * c[1][a]) * u + (c[3][a] - c[0][a] + h * c[3][a]) * v +
                  c[0][a]) /
                 w;
}

static bool has_cells(const struct gn_grey *grey, const struct gn_follow_pattern *pattern,
                      double corners_px[4][2])
{
    enum { MAX_CELLS = 16 };
    double light[MAX_CELLS * MAX_CELLS], sum[2] = {0};
    int n = pattern->cells, count[2] = {0}, n_wrong = 0;
    if (n < 1 || n > MAX_CELLS)
        return false;
    for (int i = 0; i < n * n; i++) {
        double p[2];
        map_unit(corners_px, (i % n + 0.5) / n, (i / n + 0.5) / n, p);
        if (!(p[0] >= 1 && p[1] >= 1 && p[0] < grey->width - 1 && p[1] < grey->height - 1))
            return false;
        light[i] = (double)grey->linear[grey->pixels[(long)p[1] * grey->width + (long)p[0]]];
        sum[pattern->white[i]] += light[i];
        count[pattern->white[i]]++;
    }
    if (count[0] == 0 || count[1] == 0)
        return false;
    double black = sum[0] / count[0], white = sum[1] / count[1];
    if (!(white - black > min_contrast))
        return false;
    for (int i = 0; i < n * n; i++)
        n_wrong += (light[i] > (white + black) / 2) != pattern->white[i];
    return n_wrong <= wrong_share * n * n;
}

bool gn_follow_marker(const struct gn_grey *grey, const struct gn_camera *camera,
                      const struct gn_follow_pattern *pattern, double corners_px[4][2])
{
    double found[4][2];
    memcpy(found, corners_px, sizeof(found));
    if (!gn_edges_refine(grey, camera, pattern->cells, found) || !has_cells(grey, pattern, found))
        return false;
    memcpy(corners_px, found, sizeof(found));
    return true;
}
