/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/texture.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/jpeg.h"
#include "common/png.h"

/** Linear values of the codes of R, G, B; of sRGB by IEC 61966-2-1. */
static void fill_linear(struct gn_texture *texture)
{
    for (int i = 0; i < 256; i++) {
        double x = i / 255.0;
        if (texture->is_srgb)
            x = x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
        texture->linear[i] = (float)x;
    }
}

/** Linear value of a code of channel k. */
static float decode(const struct gn_texture *texture, int k, uint8_t code)
{
    return k < 3 ? texture->linear[code] : (float)code / 255.0f;
}

/** The nearest code; sRGB by search, since its curve rises. */
static uint8_t encode(const struct gn_texture *texture, int k, float value)
{
    if (!texture->is_srgb || k == 3)
        return (uint8_t)(fminf(fmaxf(value, 0), 1) * 255.0f + 0.5f);
    int lo = 0;
    int hi = 255;
    while (lo < hi) { // the first code whose upper bound is not below the value
        int mid = (lo + hi) / 2;
        if (0.5f * (texture->linear[mid] + texture->linear[mid + 1]) < value)
            lo = mid + 1;
        else
            hi = mid;
    }
    return (uint8_t)lo;
}

static int half_side(int side)
{
    return side > 1 ? side / 2 : 1;
}

static const uint8_t *get_texel(const struct gn_texture *texture, int level, int width, int x,
                                int y)
{
    return texture->levels[level] + 4 * ((size_t)y * (size_t)width + (size_t)x);
}

/** Share of texel j of a side that texel i of the half side covers, so that odd sides lose and
 * count none twice; [0, 1]. */
static double get_share(int j, int i, int side, int half)
{
    double first = (double)i * side / half;
    double last = (double)(i + 1) * side / half;
    return fmin(j + 1, last) - fmax(j, first);
}

/** A texel of the next level: the mean of linear values. */
static void average(struct gn_texture *texture, int level, int width, int height, int x, int y,
                    uint8_t out[static 4])
{
    int w = half_side(width);
    int h = half_side(height);
    double sum[5] = {0};
    for (int j = (int)((long)y * height / h); j < height && get_share(j, y, height, h) > 0; j++) {
        for (int i = (int)((long)x * width / w); i < width && get_share(i, x, width, w) > 0; i++) {
            const uint8_t *texel = get_texel(texture, level, width, i, j);
            double share = get_share(j, y, height, h) * get_share(i, x, width, w);
            for (int k = 0; k < 4; k++)
                sum[k] += share * (double)decode(texture, k, texel[k]);
            sum[4] += share;
        }
    }
    for (int k = 0; k < 4; k++)
        out[k] = encode(texture, k, (float)(sum[k] / sum[4]));
}

static void halve(struct gn_texture *texture, int level, int width, int height)
{
    int w = half_side(width);
    int h = half_side(height);
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++)
            average(texture, level, width, height, x, y,
                    texture->levels[level + 1] + 4 * ((size_t)y * (size_t)w + (size_t)x));
    }
}

int gn_texture_init(struct gn_texture *texture, const uint8_t *rgba, int width, int height,
                    bool is_srgb)
{
    *texture = (struct gn_texture){.width = width, .height = height, .is_srgb = is_srgb};
    if (width < 1 || height < 1 || width > GN_IMAGE_MAX_SIDE || height > GN_IMAGE_MAX_SIDE ||
        (long)width * height > GN_IMAGE_MAX_PIXELS) {
        *texture = (struct gn_texture){0};
        return -EINVAL;
    }
    int w = width;
    int h = height;
    for (int level = 0;; level++) {
        texture->levels[level] = malloc(4 * (size_t)w * (size_t)h);
        if (!texture->levels[level]) {
            gn_texture_finish(texture);
            return -ENOMEM;
        }
        texture->n_levels = level + 1;
        if (w == 1 && h == 1)
            break;
        w = half_side(w);
        h = half_side(h);
    }
    fill_linear(texture);
    memcpy(texture->levels[0], rgba, 4 * (size_t)width * (size_t)height);
    w = width;
    h = height;
    for (int level = 0; level + 1 < texture->n_levels; level++) {
        halve(texture, level, w, h);
        w = half_side(w);
        h = half_side(h);
    }
    return 0;
}

void gn_texture_finish(struct gn_texture *texture)
{
    for (int i = 0; i < GN_TEXTURE_MAX_LEVELS; i++)
        free(texture->levels[i]);
    *texture = (struct gn_texture){0};
}

/** Codes of 1, 3 or 4 channels as RGBA. */
static int init_from_codes(struct gn_texture *texture, const struct gn_image8 *codes, bool is_srgb)
{
    size_t n = (size_t)codes->width * (size_t)codes->height;
    uint8_t *rgba = malloc(4 * n);
    if (!rgba)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const uint8_t *in = codes->data + (size_t)codes->channels * i;
        for (int k = 0; k < 3; k++)
            rgba[4 * i + (size_t)k] = in[codes->channels == 1 ? 0 : k];
        rgba[4 * i + 3] = codes->channels == 4 ? in[3] : 255;
    }
    int ret = gn_texture_init(texture, rgba, codes->width, codes->height, is_srgb);
    free(rgba);
    return ret;
}

static int check_texels(long texels, long max_texels, struct gn_error *out_error)
{
    return texels <= max_texels
               ? 0
               : gn_error_set(out_error, -EINVAL, "a picture of %ld texels, where %ld are left",
                              texels, max_texels);
}

/** The header's own width and height: big-endian, behind the signature and the chunk's head. */
static long get_png_texels(const uint8_t *data, size_t size)
{
    uint32_t side[2] = {0};
    for (int i = 0; i < 8 && size >= 24; i++)
        side[i / 4] = side[i / 4] << 8 | data[16 + i];
    if (side[0] > GN_IMAGE_MAX_SIDE || side[1] > GN_IMAGE_MAX_SIDE)
        return 0; // the decoder says so
    return (long)side[0] * (long)side[1];
}

static int read_png(const void *data, size_t size, bool is_srgb, long max_texels,
                    struct gn_texture *texture, struct gn_error *out_error)
{
    struct gn_image8 codes = {0};
    int ret = check_texels(get_png_texels(data, size), max_texels, out_error);
    if (ret == 0)
        ret = gn_png_read_memory8(data, size, &codes, out_error);
    if (ret < 0)
        return ret;
    ret = init_from_codes(texture, &codes, is_srgb);
    gn_image8_finish(&codes);
    return ret < 0 ? gn_error_set(out_error, ret, "no memory for the picture") : 0;
}

static int read_jpeg(const void *data, size_t size, bool is_srgb, long max_texels,
                     struct gn_texture *texture, struct gn_error *out_error)
{
    struct gn_jpeg *jpeg = NULL;
    struct gn_image8 codes = {0};
    int width, height, channels;
    int ret = gn_jpeg_create(&jpeg);
    if (ret < 0)
        return gn_error_set(out_error, ret, "no memory for the picture");
    ret = gn_jpeg_get_size(jpeg, data, size, &width, &height, &channels, out_error);
    if (ret == 0)
        ret = check_texels((long)width * height, max_texels, out_error);
    if (ret < 0)
        goto out;
    ret = gn_image8_init(&codes, width, height, channels);
    if (ret < 0) {
        ret = gn_error_set(out_error, ret, "no memory for the picture");
        goto out;
    }
    ret = gn_jpeg_decode(jpeg, data, size, &codes, out_error);
    if (ret == 0 && (ret = init_from_codes(texture, &codes, is_srgb)) < 0)
        ret = gn_error_set(out_error, ret, "no memory for the picture");
out:
    gn_image8_finish(&codes);
    gn_jpeg_destroy(&jpeg);
    return ret;
}

int gn_texture_read_memory(const void *data, size_t size, bool is_srgb, long max_texels,
                           struct gn_texture *out_texture, struct gn_error *out_error)
{
    *out_texture = (struct gn_texture){0};
    if (gn_png_is_png(data, size))
        return read_png(data, size, is_srgb, max_texels, out_texture, out_error);
    if (gn_jpeg_is_jpeg(data, size))
        return read_jpeg(data, size, is_srgb, max_texels, out_texture, out_error);
    return gn_error_set(out_error, -EINVAL, "a picture that is neither PNG nor JPEG");
}

static int wrap(long i, int side, enum gn_texture_wrap wrap)
{
    if (wrap == GN_WRAP_CLAMP)
        return (int)(i < 0 ? 0 : i >= side ? side - 1 : i);
    long copy = i >= 0 ? i / side : -((side - 1 - i) / side);
    int within = (int)(i - copy * side);
    return wrap == GN_WRAP_MIRROR && copy % 2 != 0 ? side - 1 - within : within;
}

/** A coordinate taken into its period (or far enough to the edge), so that texels fit integers. */
static double reduce(double x, enum gn_texture_wrap wrap)
{
    return wrap == GN_WRAP_CLAMP ? fmin(fmax(x, -1), 2) : x - 2 * floor(x / 2);
}

static void sample_level(const struct gn_texture_slot *slot, double u, double v, int level,
                         double weight, double rgba[static 4])
{
    const struct gn_texture *t = slot->texture;
    int w = t->width >> level > 0 ? t->width >> level : 1;
    int h = t->height >> level > 0 ? t->height >> level : 1;
    double x = reduce(u, slot->wrap_u) * w - 0.5;
    double y = reduce(v, slot->wrap_v) * h - 0.5;
    long x0 = (long)floor(x);
    long y0 = (long)floor(y);
    for (int j = 0; j < 2; j++) {
        for (int i = 0; i < 2; i++) {
            double share = (i ? x - (double)x0 : 1 - (x - (double)x0)) *
                           (j ? y - (double)y0 : 1 - (y - (double)y0));
            const uint8_t *texel = get_texel(t, level, w, wrap(x0 + i, w, slot->wrap_u),
                                             h - 1 - wrap(y0 + j, h, slot->wrap_v));
            for (int k = 0; k < 4; k++)
                rgba[k] += weight * share * (double)decode(t, k, texel[k]);
        }
    }
}

void gn_texture_sample(const struct gn_texture_slot *slot, const float uv[static 2], float texels,
                       float out_rgba[static 4])
{
    double rgba[4] = {0};
    int last = slot->texture->n_levels - 1;
    double lod = texels > 1 ? fmin(log2((double)texels), last) : 0;
    int level = (int)lod;
    sample_level(slot, uv[0], uv[1], level, 1 - (lod - level), rgba);
    if (lod > level)
        sample_level(slot, uv[0], uv[1], level + 1, lod - level, rgba);
    for (int k = 0; k < 4; k++)
        out_rgba[k] = (float)rgba[k];
}
