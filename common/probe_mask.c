/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/probe_mask.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define RING 96
#define OUTSIDE_PX 1.5

struct picture {
    void *pixels;
    int width, height, channels;
    enum gn_probe_mask_sample sample;
};

/* What lies around a mask. */
struct ring {
    double angle[RING];
    double code[RING][4];
    int n;
};

static double get(const struct picture *p, int x, int y, int c)
{
    size_t i = ((size_t)y * (size_t)p->width + (size_t)x) * (size_t)p->channels + (size_t)c;
    if (p->sample == GN_PROBE_MASK_U8)
        return ((const uint8_t *)p->pixels)[i];
    if (p->sample == GN_PROBE_MASK_U16)
        return ((const uint16_t *)p->pixels)[i];
    double v = (double)((const float *)p->pixels)[i];
    return isfinite(v) ? v : 0;
}

static void put(const struct picture *p, int x, int y, int c, double v)
{
    size_t i = ((size_t)y * (size_t)p->width + (size_t)x) * (size_t)p->channels + (size_t)c;
    if (p->sample == GN_PROBE_MASK_U8)
        ((uint8_t *)p->pixels)[i] = (uint8_t)(v + 0.5);
    else if (p->sample == GN_PROBE_MASK_U16)
        ((uint16_t *)p->pixels)[i] = (uint16_t)(v + 0.5);
    else
        ((float *)p->pixels)[i] = (float)v;
}

static void look_around(const struct picture *p, const struct gn_probe_mask *mask,
                        struct ring *ring)
{
    ring->n = 0;
    for (int i = 0; i < RING; i++) {
        double angle = 6.283185307179586 * i / RING, r = mask->radius + OUTSIDE_PX;
        double x = floor(mask->center[0] + r * cos(angle));
        double y = floor(mask->center[1] + r * sin(angle));
        if (!(x >= 0 && y >= 0 && x < p->width && y < p->height))
            continue;
        ring->angle[ring->n] = angle;
        for (int c = 0; c < p->channels; c++)
            ring->code[ring->n][c] = get(p, (int)x, (int)y, c);
        ring->n++;
    }
}

static void fill_pixel(const struct picture *p, const struct gn_probe_mask *mask,
                       const struct ring *ring, int x, int y)
{
    double dx = x + 0.5 - mask->center[0], dy = y + 0.5 - mask->center[1];
    double rho = hypot(dx, dy) / (mask->radius + OUTSIDE_PX), angle = atan2(dy, dx);
    double sum[4] = {0}, weights = 0;
    for (int i = 0; i < ring->n; i++) {
        double w = 1 / (1 - 2 * rho * cos(ring->angle[i] - angle) + rho * rho);
        weights += w;
        for (int c = 0; c < p->channels; c++)
            sum[c] += w * ring->code[i][c];
    }
    for (int c = 0; c < p->channels; c++)
        put(p, x, y, c, weights > 0 ? sum[c] / weights : 0);
}

void gn_probe_mask_fill(const struct gn_probe_mask *masks, int n_masks, void *pixels, int width,
                        int height, int channels, enum gn_probe_mask_sample sample)
{
    struct picture p = {pixels, width, height, channels, sample};
    for (int m = 0; m < n_masks && channels <= 4; m++) {
        const struct gn_probe_mask *mask = &masks[m];
        struct ring ring;
        look_around(&p, mask, &ring);
        int y0 = (int)fmin(fmax(floor(mask->center[1] - mask->radius), 0), height);
        int x0 = (int)fmin(fmax(floor(mask->center[0] - mask->radius), 0), width);
        for (int y = y0; y < height && y + 0.5 <= mask->center[1] + mask->radius; y++)
            for (int x = x0; x < width && x + 0.5 <= mask->center[0] + mask->radius; x++)
                if (hypot(x + 0.5 - mask->center[0], y + 0.5 - mask->center[1]) <= mask->radius)
                    fill_pixel(&p, mask, &ring, x, y);
    }
}
