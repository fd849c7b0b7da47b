/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/composite.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "common/encoder.h"
#include "common/noise.h"
#include "common/point_spread.h"
#include "common/vec4.h"

/* Rows that one worker takes at a time; more where each strip has neighbours to read besides. */
#define ROWS 16
#define SPREAD_ROWS 32
/* Pixels that are worked on side by side, and their values. */
#define BLOCK 16
#define VALUES (3 * BLOCK)

struct gn_compositor {
    struct gn_pool *pool; // borrowed, may be NULL
    int n_workers;
    struct gn_spread *spreads; // [n_workers], owned
    struct gn_noise noise;
    struct gn_response curve; // that these are of; of type TABLE: of none
    struct gn_encoder encoder;
    float linear[256];
    atomic_uint n_covered; // pixels of the last picture; relaxed, read after its work has ended
};

/* One picture's work, shared by all workers. */
struct job {
    struct gn_compositor *compositor;
    const struct gn_composite_layers *layers;
    int width, height, n_rows; // n_rows: of an item
    struct gn_spread_kernel kernel;
    const struct gn_image8 *codes;
    const struct gn_response *response;
    bool encoded_multiply, has_noise, is_diagonal; // the latter: matrix and inverse
    const float *linear;                           // [256], the response's curve at every code
    double radiance_from_device[9];                // row-major; the response's matrix and scale
    double device_from_radiance[9];
    float kept[9];   // row-major: what of a device channel is kept, from each radiance channel's f
    float gains[12]; // where the matrix is diagonal: device from radiance, R, G, B again and again
    float slope[3], offset[3];
    uint32_t key; // of the noise
    const struct gn_encoder *encoder;
    struct gn_image8 *out_codes;
    const struct gn_image *radiance;
    struct gn_image *out_radiance;
};

/* Some pixels of a row, side by side: background * factor + light. */
struct block {
    float factor[VALUES]; // shadow * open
    float light[VALUES];  // added * open + virtual; radiance
    float open[BLOCK];    // 1 - A
    float base[VALUES];   // background, device values
    float rgb[VALUES];    // composite, device values
};

/* True where all n values, which stand one after the other, are the value. */
static bool are_all(const float *values, int n, float value)
{
    gn_mask4 is_other = {0};
    for (int i = 0; i < n; i += 4)
        is_other |= gn_vec4_load(values + i) != value;
    return !gn_mask4_has_any(is_other);
}

/* Whether the whole block from x on keeps its bits, quickly. */
static bool is_block_untouched(const struct gn_composite_layers *layers, int x, int y)
{
    return are_all(gn_image_at(layers->virtual_rgba, x, y), 4 * BLOCK, 0) &&
           (!layers->shadow || are_all(gn_image_at(layers->shadow, x, y), VALUES, 1)) &&
           (!layers->added || are_all(gn_image_at(layers->added, x, y), VALUES, 0));
}

static void load_layers(const struct gn_composite_layers *layers, int x, int y, int n,
                        struct block *out)
{
    for (int i = 0; i < n; i++) {
        const float *shadow = layers->shadow ? gn_image_at(layers->shadow, x + i, y) : NULL;
        const float *added = layers->added ? gn_image_at(layers->added, x + i, y) : NULL;
        const float *rgba = gn_image_at(layers->virtual_rgba, x + i, y);
        float open = out->open[i] = 1 - rgba[3];
        for (int c = 0; c < 3; c++) {
            out->factor[3 * i + c] = shadow ? shadow[c] * open : open;
            out->light[3 * i + c] = added ? added[c] * open + rgba[c] : rgba[c];
        }
    }
}

/* The same of a row that was spread. */
static void load_spread(const struct gn_spread *spread, int x, int n, struct block *out)
{
    for (int i = 0; i < n; i++) {
        const float *rgba = spread->row[0] + 4 * (x + i);
        const float *lost = spread->row[1] + 3 * (x + i), *gained = spread->row[2] + 3 * (x + i);
        float open = out->open[i] = 1 - rgba[3];
        for (int c = 0; c < 3; c++) {
            float factor = open - lost[c];
            out->factor[3 * i + c] = factor > 0 ? factor : 0; // the weights' rounding
            out->light[3 * i + c] = gained[c] + rgba[c];
        }
    }
}

/* True where the pixel keeps its bits. */
static bool is_untouched(const struct block *b, int i)
{
    const float *factor = b->factor + 3 * i, *light = b->light + 3 * i;
    return b->open[i] == 1 && factor[0] == 1 && factor[1] == 1 && factor[2] == 1 && light[0] == 0 &&
           light[1] == 0 && light[2] == 0;
}

/* How many of the first n pixels show a virtual surface. */
static unsigned count_covered(const struct block *b, int n)
{
    unsigned n_covered = 0;
    for (int i = 0; i < n; i++)
        n_covered += b->open[i] < 1;
    return n_covered;
}

/* rgb = base * factor + light in device values, where the matrix leaves the channels apart. */
static void blend_diagonal(const struct job *job, struct block *b)
{
    for (int i = 0; i < VALUES; i += 4) {
        gn_vec4 v = gn_vec4_load(b->base + i) * gn_vec4_load(b->factor + i) +
                    gn_vec4_load(b->light + i) * gn_vec4_load(job->gains + i % 12);
        gn_mask4 is_positive = v > 0;
        gn_vec4_store(b->rgb + i, (gn_vec4)((gn_mask4)v & is_positive)); // NaN to 0, too
    }
}

/* The same through any matrix. */
static void blend_mixed(const struct job *job, int n, struct block *b)
{
    for (int i = 0; i < 3 * n; i += 3) {
        float *rgb = b->rgb + i;
        memcpy(rgb, b->base + i, 3 * sizeof(*rgb));
        gn_response_multiply(job->radiance_from_device, rgb);
        for (int c = 0; c < 3; c++)
            rgb[c] = rgb[c] * b->factor[i + c] + b->light[i + c];
        gn_response_multiply(job->device_from_radiance, rgb);
    }
}

/* The same with the paper's literal reading: the shadow multiplies the codes. */
static void blend_codes(const struct job *job, const uint8_t *codes, int n, struct block *b)
{
    for (int i = 0; i < n; i++) {
        float *rgb = b->rgb + 3 * i, open = b->open[i];
        for (int c = 0; c < 3; c++) {
            float shadow = open > 1e-6f ? b->factor[3 * i + c] / open : 1;
            rgb[c] = gn_response_decode(job->response, (float)codes[3 * i + c] / 255 * shadow);
        }
        gn_response_multiply(job->radiance_from_device, rgb);
        for (int c = 0; c < 3; c++)
            rgb[c] = rgb[c] * open + b->light[3 * i + c];
        gn_response_multiply(job->device_from_radiance, rgb);
    }
}

static void add_noise(const struct job *job, int x, int y, int n, struct block *b)
{
    for (int i = 0; i < n; i++) {
        float deviates[3], *rgb = b->rgb + 3 * i;
        const float *factor = b->factor + 3 * i;
        gn_noise_get(&job->compositor->noise, job->key, (uint32_t)(x + i), (uint32_t)y, deviates);
        for (int c = 0; c < 3; c++) {
            const float *kept = job->kept + 3 * c;
            float f = kept[0] * factor[0] + kept[1] * factor[1] + kept[2] * factor[2];
            float missing = job->slope[c] * rgb[c] + job->offset[c] -
                            f * f * (job->slope[c] * b->base[3 * i + c] + job->offset[c]);
            rgb[c] += deviates[c] * sqrtf(missing > 0 ? missing : 0);
        }
    }
}

static void put_codes8(const struct job *job, int x, int y, int n, struct block *b)
{
    const uint8_t *in = gn_image8_at(job->codes, x, y);
    uint8_t *out = gn_image8_at(job->out_codes, x, y);
    for (int i = 0; i < 3 * n; i++)
        b->base[i] = job->linear[in[i]];
    if (job->encoded_multiply)
        blend_codes(job, in, n, b);
    else if (job->is_diagonal)
        blend_diagonal(job, b);
    else
        blend_mixed(job, n, b);
    if (job->has_noise)
        add_noise(job, x, y, n, b);
    for (int i = 0; i < n; i++) {
        if (is_untouched(b, i))
            continue;
        for (int c = 3 * i; c < 3 * i + 3; c++)
            out[c] = gn_encoder_get(job->encoder, b->rgb[c]);
    }
}

static void put_linear(const struct job *job, int x, int y, int n, struct block *b)
{
    const float *in = gn_image_at(job->radiance, x, y);
    float *out = gn_image_at(job->out_radiance, x, y);
    memcpy(b->base, in, 3 * (size_t)n * sizeof(*in));
    for (int i = 0; i < 3 * n; i++)
        b->rgb[i] = in[i] * b->factor[i] + b->light[i];
    for (int i = 0; job->has_noise && i < n; i++) {
        gn_response_multiply(job->device_from_radiance, b->base + 3 * i);
        gn_response_multiply(job->device_from_radiance, b->rgb + 3 * i);
    }
    if (job->has_noise)
        add_noise(job, x, y, n, b);
    for (int i = 0; i < n; i++) {
        if (is_untouched(b, i))
            continue;
        if (job->has_noise)
            gn_response_multiply(job->radiance_from_device, b->rgb + 3 * i);
        memcpy(out + 3 * i, b->rgb + 3 * i, 3 * sizeof(*out));
    }
}

/* A row's pixels [begin, end). spread: its row is there, NULL: the layers as they are. Returns how
 * many show a virtual surface. */
static unsigned composite_span(const struct job *job, const struct gn_spread *spread, int y,
                               int begin, int end)
{
    struct block b = {0};
    unsigned n_covered = 0;
    for (int x = begin; x < end; x += BLOCK) {
        int n = x + BLOCK <= end ? BLOCK : end - x;
        if (spread)
            load_spread(spread, x, n, &b);
        else if (n == BLOCK && is_block_untouched(job->layers, x, y))
            continue;
        else
            load_layers(job->layers, x, y, n, &b);
        n_covered += count_covered(&b, n);
        if (job->codes)
            put_codes8(job, x, y, n, &b);
        else
            put_linear(job, x, y, n, &b);
    }
    return n_covered;
}

/* The picture as it is, to be touched where layers are. */
static void copy_rows(const struct job *job, int y, int n)
{
    size_t values = 3 * (size_t)job->width * (size_t)n;
    if (job->codes && job->codes->data != job->out_codes->data)
        memcpy(gn_image8_at(job->out_codes, 0, y), gn_image8_at(job->codes, 0, y), values);
    if (job->radiance && job->radiance->data != job->out_radiance->data)
        memcpy(gn_image_at(job->out_radiance, 0, y), gn_image_at(job->radiance, 0, y),
               values * sizeof(float));
}

static void composite_rows(void *context, int item, int worker)
{
    const struct job *job = context;
    const struct gn_composite_layers *layers = job->layers;
    struct gn_spread *spread = NULL;
    int y = item * job->n_rows, begin = 0, end = job->width;
    int n = y + job->n_rows < job->height ? job->n_rows : job->height - y;
    unsigned n_covered = 0;
    copy_rows(job, y, n);
    if (job->kernel.radius > 0) {
        spread = &job->compositor->spreads[worker];
        gn_spread_load(spread, &job->kernel, layers->virtual_rgba, layers->shadow, layers->added, y,
                       n);
    }
    for (int i = 0; i < n; i++) {
        if (spread)
            gn_spread_get_row(spread, &job->kernel, i, &begin, &end);
        n_covered += composite_span(job, spread, y + i, begin, end);
    }
    atomic_fetch_add_explicit(&job->compositor->n_covered, n_covered, memory_order_relaxed);
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

/* Encoder and codes of the response's curve; as they are where it is the last picture's. */
static void keep_curve(struct gn_compositor *c, const struct gn_response *response)
{
    const struct gn_response *old = &c->curve;
    if (response->type != GN_RESPONSE_TABLE && response->type == old->type &&
        response->gamma == old->gamma && response->log_a == old->log_a &&
        response->log_b == old->log_b && response->log_c == old->log_c)
        return;
    gn_encoder_init(response, &c->encoder);
    for (int i = 0; i < 256; i++)
        c->linear[i] = gn_response_decode(response, (float)i / 255);
    c->curve = *response; // its table is borrowed no longer, and not read
}

static void init_noise(struct job *job, const struct gn_composite_options *options)
{
    job->has_noise = gn_match_has_noise(&options->match);
    job->key = gn_noise_get_key(options->frame);
    for (int i = 0; i < 3; i++) {
        job->slope[i] = (float)options->match.noise_slope[i];
        job->offset[i] = (float)options->match.noise_offset[i];
        for (int k = 0; k < 3; k++)
            job->kept[3 * i + k] = (float)(job->device_from_radiance[3 * i + k] *
                                           job->radiance_from_device[3 * k + i]);
    }
}

/* Runs a job whose pictures are set. */
static int run(struct gn_compositor *compositor, const struct gn_composite_options *options,
               struct job *job)
{
    if (!are_layers_ok(job->layers, job->width, job->height) ||
        gn_response_check(job->response, NULL) || gn_match_check(&options->match, NULL))
        return -EINVAL;
    job->compositor = compositor;
    job->n_rows = ROWS;
    gn_response_get_matrices(job->response, job->radiance_from_device, job->device_from_radiance);
    const double *m = job->device_from_radiance;
    job->is_diagonal = m[1] == 0 && m[2] == 0 && m[3] == 0 && m[5] == 0 && m[6] == 0 && m[7] == 0;
    for (int i = 0; i < 12; i++)
        job->gains[i] = (float)m[4 * (i % 3)];
    init_noise(job, options);
    if (options->match.blur_px > 0)
        gn_spread_make_kernel(options->match.blur_px, &job->kernel);
    if (job->kernel.radius > 0) {
        job->n_rows = SPREAD_ROWS;
        for (int i = 0; i < compositor->n_workers; i++) {
            int ret = gn_spread_reserve(&compositor->spreads[i], job->width, job->n_rows,
                                        job->kernel.radius);
            if (ret < 0)
                return ret;
        }
    }
    if (job->codes) {
        keep_curve(compositor, job->response);
        job->encoder = &compositor->encoder;
        job->linear = compositor->linear;
    }
    atomic_store_explicit(&compositor->n_covered, 0, memory_order_relaxed);
    gn_pool_run(compositor->pool, (job->height + job->n_rows - 1) / job->n_rows, composite_rows,
                job);
    return 0;
}

int gn_compositor_create(struct gn_pool *pool, struct gn_compositor **out_compositor)
{
    struct gn_compositor *c = calloc(1, sizeof(*c));
    *out_compositor = NULL;
    if (!c)
        return -ENOMEM;
    c->pool = pool;
    c->n_workers = gn_pool_get_size(pool);
    c->spreads = calloc((size_t)c->n_workers, sizeof(*c->spreads));
    if (!c->spreads) {
        gn_compositor_destroy(&c);
        return -ENOMEM;
    }
    gn_noise_init(&c->noise);
    c->curve.type = GN_RESPONSE_TABLE;
    *out_compositor = c;
    return 0;
}

void gn_compositor_destroy(struct gn_compositor **compositor)
{
    struct gn_compositor *c = *compositor;
    if (!c)
        return;
    for (int i = 0; c->spreads && i < c->n_workers; i++)
        gn_spread_finish(&c->spreads[i]);
    free(c->spreads);
    free(c);
    *compositor = NULL;
}

uint32_t gn_compositor_get_n_covered(const struct gn_compositor *compositor)
{
    return atomic_load_explicit(&compositor->n_covered, memory_order_relaxed);
}

int gn_compositor_put_image8(struct gn_compositor *compositor,
                             const struct gn_composite_layers *layers,
                             const struct gn_image8 *background, const struct gn_response *response,
                             const struct gn_composite_options *options, struct gn_image8 *out)
{
    int width = background->width, height = background->height;
    if (!background->data || background->channels != 3 || !out->data || out->channels != 3 ||
        out->width != width || out->height != height)
        return -EINVAL;
    struct job job = {.layers = layers,
                      .width = width,
                      .height = height,
                      .codes = background,
                      .response = response,
                      .encoded_multiply = options->encoded_multiply,
                      .out_codes = out};
    return run(compositor, options, &job);
}

int gn_compositor_put_linear(struct gn_compositor *compositor,
                             const struct gn_composite_layers *layers,
                             const struct gn_image *background, const struct gn_response *response,
                             const struct gn_composite_options *options, struct gn_image *out)
{
    int width = background->width, height = background->height;
    if (!has_shape(background, width, height, 3) || !has_shape(out, width, height, 3))
        return -EINVAL;
    struct job job = {.layers = layers,
                      .width = width,
                      .height = height,
                      .response = response,
                      .radiance = background,
                      .out_radiance = out};
    return run(compositor, options, &job);
}
