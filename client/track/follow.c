/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/follow.h"

#include <math.h>
#include <string.h>

/** Cells that may look wrong, of all. */
static const double wrong_share = 0.05;
/** Least difference between the means of white and of black cells, of full scale. */
static const double min_contrast = 0.02;
/** Least correlation with its pattern of a marker too small to have edges. */
static const double min_correlation = 0.85;

static bool has_cells(const struct gn_grey *grey, const struct gn_pattern *pattern,
                      double corners_px[4][2])
{
    enum { MAX_CELLS = 16 };
    double light[MAX_CELLS * MAX_CELLS], sum[2] = {0};
    int n = pattern->cells, count[2] = {0}, n_wrong = 0;
    if (n < 1 || n > MAX_CELLS)
        return false;
    for (int i = 0; i < n * n; i++) {
        double p[2];
        gn_quad_map(corners_px, (i % n + 0.5) / n, (i / n + 0.5) / n, p);
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
                      const struct gn_pattern *pattern, double corners_px[4][2])
{
    double found[4][2];
    memcpy(found, corners_px, sizeof(found));
    bool is_small = gn_quad_get_side(found) < GN_EDGES_MIN_CELL_PX * pattern->cells;
    if (is_small ? !(gn_pattern_fit(grey, pattern, found) >= min_correlation)
                 : !gn_edges_refine(grey, camera, pattern->cells, found) ||
                       !has_cells(grey, pattern, found))
        return false;
    memcpy(corners_px, found, sizeof(found));
    return true;
}
