/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/internal.h"

#include <math.h>
#include <string.h>

int gn_layers_init(struct gn_layers *layers, int width, int height)
{
    memset(layers, 0, sizeof(*layers));
    int ret = gn_image_init(&layers->virtual_rgba, width, height, 4);
    if (ret == 0)
        ret = gn_image_init(&layers->shadow, width, height, 3);
    if (ret == 0)
        ret = gn_image_init(&layers->added, width, height, 3);
    if (ret == 0)
        ret = gn_image_init(&layers->depth, width, height, 1);
    if (ret < 0) {
        gn_layers_finish(layers);
        return ret;
    }
    layers->width = width;
    layers->height = height;
    return 0;
}

void gn_layers_finish(struct gn_layers *layers)
{
    gn_image_finish(&layers->virtual_rgba);
    gn_image_finish(&layers->shadow);
    gn_image_finish(&layers->added);
    gn_image_finish(&layers->depth);
    memset(layers, 0, sizeof(*layers));
}

void gn_layers_write_plain(const struct frame *frame, int x, int y,
                           const float depths[static LANES])
{
    struct gn_layers *layers = frame->layers;
    int n = layers->width - x < BLOCK ? layers->width - x : BLOCK;
    for (int row = 0; row < BLOCK && y + row < layers->height; row++) {
        float *shadow = gn_image_at(&layers->shadow, x, y + row);
        memset(gn_image_at(&layers->virtual_rgba, x, y + row), 0, 4 * sizeof(float) * (size_t)n);
        memset(gn_image_at(&layers->added, x, y + row), 0, 3 * sizeof(float) * (size_t)n);
        memcpy(gn_image_at(&layers->depth, x, y + row), depths + (size_t)row * BLOCK,
               sizeof(float) * (size_t)n);
        for (int i = 0; i < 3 * n; i++)
            shadow[i] = 1;
    }
}

/** Most pixels by far: one sample of what is real and loses no light. */
static bool is_plain(const struct sample *s, int n)
{
    return n == 1 && s->kind != SAMPLE_VIRTUAL && !(s->lost[0] > 0) && !(s->lost[1] > 0) &&
           !(s->lost[2] > 0);
}

static void resolve_plain(const struct frame *frame, int x, int y, const struct sample *s)
{
    float *rgba = gn_image_at(&frame->layers->virtual_rgba, x, y);
    float *shadow = gn_image_at(&frame->layers->shadow, x, y);
    float *added = gn_image_at(&frame->layers->added, x, y);
    for (int k = 0; k < 3; k++) {
        rgba[k] = 0;
        shadow[k] = 1;
        added[k] = (float)s->gain[k];
    }
    rgba[3] = 0;
}

void gn_layers_resolve(const struct frame *frame, int x, int y, const struct sample *samples, int n)
{
    if (is_plain(samples, n)) {
        resolve_plain(frame, x, y, samples);
        return;
    }
    int n_virtual = 0;
    double radiance[3] = {0};
    double base[3] = {0};
    double lost[3] = {0};
    double gain[3] = {0};
    for (int i = 0; i < n; i++) {
        const struct sample *s = &samples[i];
        bool is_virtual = s->kind == SAMPLE_VIRTUAL;
        n_virtual += is_virtual;
        for (int k = 0; k < 3; k++) {
            if (is_virtual) {
                radiance[k] += s->radiance[k];
            } else {
                base[k] += s->base[k];
                lost[k] += s->lost[k];
                gain[k] += s->gain[k];
            }
        }
    }
    float *rgba = gn_image_at(&frame->layers->virtual_rgba, x, y);
    float *shadow = gn_image_at(&frame->layers->shadow, x, y);
    float *added = gn_image_at(&frame->layers->added, x, y);
    for (int k = 0; k < 3; k++) {
        rgba[k] = (float)(radiance[k] / n);
        // Written so that a NaN, were there one, would become 1 and not spread.
        double factor = lost[k] > 0 && base[k] > 0 ? 1 - lost[k] / base[k] : 1;
        shadow[k] = (float)fmin(fmax(factor, 0), 1);
        added[k] = n_virtual < n ? (float)(gain[k] / (n - n_virtual)) : 0;
    }
    rgba[3] = (float)n_virtual / (float)n;
}
