/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/draw.h"

#include <math.h>

static void put(struct gn_image8 *image, int x, int y, struct gn_ink ink)
{
    if (x < 0 || y < 0 || x >= image->width || y >= image->height)
        return;
    uint8_t *p = gn_image8_at(image, x, y);
    p[0] = ink.r;
    p[1] = ink.g;
    p[2] = ink.b;
}

void gn_draw_box(struct gn_image8 *image, int x0, int y0, int x1, int y1, struct gn_ink ink)
{
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++)
            put(image, x, y, ink);
}

void gn_draw_dot(struct gn_image8 *image, double x, double y, double radius, struct gn_ink ink)
{
    if (!(fabs(x) < 1e6 && fabs(y) < 1e6))
        return;
    for (int v = (int)floor(y - radius); v <= y + radius; v++)
        for (int u = (int)floor(x - radius); u <= x + radius; u++)
            if (hypot(u + 0.5 - x, v + 0.5 - y) <= radius)
                put(image, u, v, ink);
}

void gn_draw_line(struct gn_image8 *image, const double from[static 2], const double to[static 2],
                  struct gn_ink ink)
{
    double length = fmax(fabs(to[0] - from[0]), fabs(to[1] - from[1]));
    if (!(length < 1e5 && fabs(from[0]) < 1e6 && fabs(from[1]) < 1e6))
        return;
    int n = (int)ceil(length) + 1;
    for (int i = 0; i <= n; i++) {
        double t = (double)i / n;
        put(image, (int)floor(from[0] + t * (to[0] - from[0])),
            (int)floor(from[1] + t * (to[1] - from[1])), ink);
    }
}

void gn_draw_circle(struct gn_image8 *image, double x, double y, double radius, struct gn_ink ink)
{
    if (!(radius < 1e5))
        return;
    int n = (int)(8 * radius) + 16;
    for (int i = 0; i < n; i++) {
        double angle = 6.283185307179586 * i / n;
        double at_x = x + radius * cos(angle), at_y = y + radius * sin(angle);
        if (fabs(at_x) < 1e6 && fabs(at_y) < 1e6)
            put(image, (int)floor(at_x), (int)floor(at_y), ink);
    }
}
