/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/composite.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Rows that one worker takes at a time. */
#define ROWS 16
/* A positive float's bits over this shift: its exponent and 6 bits of mantissa, steps of 1/64. */
#define GUIDE_SHIFT 17
#define GUIDE_SIZE (1 << (31 - GUIDE_SHIFT))

/*
 * Linear values to 8-bit codes without evaluating the curve: code k begins at edges[k], and a guide
 * says where to begin looking. The same codes as gn_response_encode and rounding, up to the float
 * spacing at an edge.
 */
struct encoder {
    float edges[257];          // [0] 0, [256] infinity
    uint8_t guide[GUIDE_SIZE]; // the code of the smallest float of the bucket
};

/* One picture's work, shared by all workers. */
struct job {
    const struct gn_composite_layers *layers;
    int width, height;
    const struct gn_image8 *codes;
    const struct gn_response *response;
    bool encoded_multiply;
    float linear[256];              // the response's curve at every code
    double radiance_from_device[9]; // row-major; the response's matrix and scale
    double device_from_radiance[9];
    struct encoder encoder;
    struct gn_image8 *out_codes;
    const struct gn_image *radiance;
    struct gn_image *out_radiance;
};

/* The layers at one pixel. */
struct touch {
    float shadow[3], added[3];
    const float *rgba;
};

/* False where the pixel is left as it is. */
static bool get_touch(const struct gn_composite_layers *layers, int x, int y, struct touch *out)
{
    const float *shadow = layers->shadow ? gn_image_at(layers->shadow, x, y) : NULL;
    const float *added = layers->added ? gn_image_at(layers->added, x, y) : NULL;
    out->rgba = gn_image_at(layers->virtual_rgba, x, y);
    bool is_touched = false;
    for (int c = 0; c < 3; c++) {
        out->shadow[c] = shadow ? shadow[c] : 1;
        out->added[c] = added ? added[c] : 0;
        is_touched = is_touched || out->shadow[c] != 1 || out->added[c] != 0 || out->rgba[c] != 0;
    }
    return is_touched || out->rgba[3] != 0;
}

/* rgb: shadowed background in, composite out. */
static void blend(const struct touch *t, float rgb[static 3])
{
    for (int c = 0; c < 3; c++)
        rgb[c] = (rgb[c] + t->added[c]) * (1 - t->rgba[3]) + t->rgba[c];
}

static uint32_t get_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    return bits;
}

/* The linear value from which on the code is this one; infinity where none has it. */
static float find_edge(const struct gn_response *response, int code)
{
    float edge = gn_response_decode(response, ((float)code - 0.5f) / 255);
    const float least = (float)code - 0.501f; // 0.001: rounding in encode
    /* Where a table is flat, encode gives the lowest code of the flat part; the others begin above.
     */
    if (gn_response_encode(response, edge) * 255 < least)
        edge = nextafterf(edge, INFINITY);
    return gn_response_encode(response, edge) * 255 < least ? INFINITY : edge;
}

static void init_encoder(const struct gn_response *response, struct encoder *out)
{
    out->edges[0] = 0;
    for (int k = 1; k < 256; k++)
        out->edges[k] = find_edge(response, k);
    out->edges[256] = INFINITY;
    int code = 0;
    for (uint32_t i = 0; i < GUIDE_SIZE; i++) {
        uint32_t bits = i << GUIDE_SHIFT;
        float smallest;
        memcpy(&smallest, &bits, sizeof(smallest));
        while (code < 255 && smallest >= out->edges[code + 1]) // false for the NaNs at the end
            code++;
        out->guide[i] = (uint8_t)code;
    }
}

static uint8_t encode(const struct encoder *encoder, float linear)
{
    if (!(linear > 0)) // NaN too
        return encoder->guide[0];
    int code = encoder->guide[get_bits(linear) >> GUIDE_SHIFT];
    while (code < 255 && linear >= encoder->edges[code + 1])
        code++;
    return (uint8_t)code;
}

static void blend_codes8(const struct job *job, const struct touch *t, const uint8_t *in,
                         uint8_t *out)
{
    float rgb[3];
    for (int c = 0; c < 3; c++)
        rgb[c] = job->encoded_multiply
                     ? gn_response_decode(job->response, (float)in[c] / 255 * t->shadow[c])
                     : job->linear[in[c]];
    gn_response_multiply(job->radiance_from_device, rgb);
    if (!job->encoded_multiply)
        for (int c = 0; c < 3; c++)
            rgb[c] *= t->shadow[c];
    blend(t, rgb);
    gn_response_multiply(job->device_from_radiance, rgb);
    for (int c = 0; c < 3; c++)
        out[c] = encode(&job->encoder, rgb[c]);
}

static void composite_codes8_rows(void *context, int item, int worker)
{
    (void)worker;
    const struct job *job = context;
    for (int y = item * ROWS; y < (item + 1) * ROWS && y < job->height; y++) {
        for (int x = 0; x < job->width; x++) {
            const uint8_t *in = gn_image8_at(job->codes, x, y);
            uint8_t *out = gn_image8_at(job->out_codes, x, y);
            struct touch t;
            if (get_touch(job->layers, x, y, &t)) {
                blend_codes8(job, &t, in, out);
                continue;
            }
            for (int c = 0; c < 3; c++)
                out[c] = in[c];
        }
    }
}

static void composite_linear_rows(void *context, int item, int worker)
{
    (void)worker;
    const struct job *job = context;
    for (int y = item * ROWS; y < (item + 1) * ROWS && y < job->height; y++) {
        for (int x = 0; x < job->width; x++) {
            const float *in = gn_image_at(job->radiance, x, y);
            float *out = gn_image_at(job->out_radiance, x, y);
            struct touch t;
            bool is_touched = get_touch(job->layers, x, y, &t);
            for (int c = 0; c < 3; c++)
                out[c] = is_touched ? in[c] * t.shadow[c] : in[c];
            if (is_touched)
                blend(&t, out);
        }
    }
}

static bool has_shape(const struct gn_image *image, int width, int height, int channels)
{
    return image->data && image->width == width && image->height == height &&
           image->channels == channels;
}

static bool are_layers_ok(const struct gn_composite_layers *layers, int width, int height)
{
    return layers->virtual_rgba && has_shape(layers->virtual_rgba, width, height, 4) &&
           (!layers->shadow || has_shape(layers->shadow, width, height, 3)) &&
           (!layers->added || has_shape(layers->added, width, height, 3));
}

int gn_composite_image8(const struct gn_composite_layers *layers,
                        const struct gn_image8 *background, const struct gn_response *response,
                        bool encoded_multiply, struct gn_pool *pool, struct gn_image8 *out)
{
    int width = background->width, height = background->height;
    if (!background->data || background->channels != 3 || !out->data || out->channels != 3 ||
        out->width != width || out->height != height || !are_layers_ok(layers, width, height) ||
        gn_response_check(response, NULL))
        return -EINVAL;
    struct job job = {.layers = layers,
                      .width = width,
                      .height = height,
                      .codes = background,
                      .response = response,
                      .encoded_multiply = encoded_multiply,
                      .out_codes = out};
    gn_response_get_matrices(response, job.radiance_from_device, job.device_from_radiance);
    init_encoder(response, &job.encoder);
    for (int i = 0; i < 256; i++)
        job.linear[i] = gn_response_decode(response, (float)i / 255);
    gn_pool_run(pool, (height + ROWS - 1) / ROWS, composite_codes8_rows, &job);
    return 0;
}

int gn_composite_linear(const struct gn_composite_layers *layers, const struct gn_image *background,
                        struct gn_pool *pool, struct gn_image *out)
{
    int width = background->width, height = background->height;
    if (!has_shape(background, width, height, 3) || !has_shape(out, width, height, 3) ||
        !are_layers_ok(layers, width, height))
        return -EINVAL;
    struct job job = {.layers = layers,
                      .width = width,
                      .height = height,
                      .radiance = background,
                      .out_radiance = out};
    gn_pool_run(pool, (height + ROWS - 1) / ROWS, composite_linear_rows, &job);
    return 0;
}
