/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/v4l2_pixels.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <string.h>

#include "common/image.h"
#include "proto/attr.h"

/** Fixed point of the conversion: the largest sum is below 2^11 codes, so 2^31 is not reached. */
#define FIXED_BITS 20
/** A row may be so many times longer than its pixels, which leaves room for any alignment. */
#define MAX_STRIDE_FACTOR 4
#define MAX_ROW_PADDING 65536

static const struct gn_v4l2_pixels table[] = {
    {V4L2_PIX_FMT_Y16, "Y16", 16, 16},   {V4L2_PIX_FMT_Y12, "Y12", 16, 12},
    {V4L2_PIX_FMT_Y10, "Y10", 16, 10},   {V4L2_PIX_FMT_RGB24, "RGB3", 24, 8},
    {V4L2_PIX_FMT_BGR24, "BGR3", 24, 8}, {V4L2_PIX_FMT_YUYV, "YUYV", 16, 8},
    {V4L2_PIX_FMT_NV12, "NV12", 8, 8},   {V4L2_PIX_FMT_MJPEG, "MJPG", 0, 8},
    {V4L2_PIX_FMT_JPEG, "JPEG", 0, 8},   {V4L2_PIX_FMT_GREY, "GREY", 8, 8},
};

const struct gn_v4l2_pixels *gn_v4l2_pixels_get(int i)
{
    return i < (int)GN_ARRAY_LEN(table) ? &table[i] : NULL;
}

const struct gn_v4l2_pixels *gn_v4l2_pixels_find(uint32_t fourcc)
{
    for (size_t i = 0; i < GN_ARRAY_LEN(table); i++) {
        if (table[i].fourcc == fourcc)
            return &table[i];
    }
    return NULL;
}

void gn_v4l2_pixels_print_fourcc(uint32_t fourcc, char out[static 8])
{
    int n = 0;
    for (int i = 0; i < 4; i++) {
        unsigned char c = (unsigned char)(fourcc >> (8 * i) & 0x7f);
        out[i] = (char)(isprint(c) ? c : '?');
        if (c != ' ')
            n = i + 1;
    }
    strcpy(out + n, fourcc >> 31 ? "-BE" : "");
}

/** Shares of red and blue in luma. Returns false for an encoding that is none of these. */
static bool get_weights(uint32_t encoding, double *kr, double *kb)
{
    switch (encoding) {
    case V4L2_YCBCR_ENC_601:
    case V4L2_YCBCR_ENC_XV601:
    case V4L2_YCBCR_ENC_SYCC:
        *kr = 0.299, *kb = 0.114; // BT.601-7, 2.5.1
        return true;
    case V4L2_YCBCR_ENC_709:
    case V4L2_YCBCR_ENC_XV709:
        *kr = 0.2126, *kb = 0.0722; // BT.709-6, 3.2
        return true;
    case V4L2_YCBCR_ENC_BT2020:
        *kr = 0.2627, *kb = 0.0593; // BT.2020-2, table 4
        return true;
    default:
        return false;
    }
}

static int32_t to_fixed(double x)
{
    return (int32_t)lround(x * (1 << FIXED_BITS));
}

/** The matrix and range that the driver names, or those that V4L2 lays down where it names none. */
static int init_yuv(const struct v4l2_pix_format *pix, struct gn_v4l2_yuv *yuv,
                    struct gn_error *out_error)
{
    uint32_t encoding =
        pix->ycbcr_enc ? pix->ycbcr_enc : (uint32_t)V4L2_MAP_YCBCR_ENC_DEFAULT(pix->colorspace);
    uint32_t range = pix->quantization
                         ? pix->quantization
                         : (uint32_t)V4L2_MAP_QUANTIZATION_DEFAULT(0, pix->colorspace, encoding);
    double kr, kb;
    if (!get_weights(encoding, &kr, &kb))
        return gn_error_set(out_error, -EINVAL,
                            "colours in encoding %u of V4L2, which we do not know; right would be "
                            "BT.601, BT.709 or BT.2020",
                            encoding);
    bool is_full = range == V4L2_QUANTIZATION_FULL_RANGE;
    double kg = 1 - kr - kb, luma = is_full ? 1 : 255.0 / 219, chroma = is_full ? 1 : 255.0 / 224;
    yuv->luma = to_fixed(luma);
    yuv->black = is_full ? 0 : 16;
    yuv->v_r = to_fixed(chroma * 2 * (1 - kr));
    yuv->u_g = to_fixed(-chroma * 2 * (1 - kb) * kb / kg);
    yuv->v_g = to_fixed(-chroma * 2 * (1 - kr) * kr / kg);
    yuv->u_b = to_fixed(chroma * 2 * (1 - kb));
    return 0;
}

/** Stride and size of a picture that is not compressed. */
static int init_rows(const struct v4l2_pix_format *pix, struct gn_v4l2_layout *l,
                     struct gn_error *out_error)
{
    bool is_nv12 = pix->pixelformat == V4L2_PIX_FMT_NV12;
    size_t width = pix->width, rows = pix->height + (is_nv12 ? pix->height / 2 : 0);
    size_t row_bytes = width * (size_t)l->pixels->bits / 8;
    bool has_pairs = is_nv12 || pix->pixelformat == V4L2_PIX_FMT_YUYV;
    if ((has_pairs && width % 2) || (is_nv12 && pix->height % 2))
        return gn_error_set(out_error, -EINVAL, "%s pictures of %ux%u: chroma needs even sides",
                            l->pixels->name, pix->width, pix->height);
    l->stride = pix->bytesperline ? pix->bytesperline : row_bytes;
    if (l->stride < row_bytes || l->stride > MAX_STRIDE_FACTOR * row_bytes + MAX_ROW_PADDING)
        return gn_error_set(out_error, -EINVAL,
                            "%s rows of %zu bytes cannot hold %u pixels, which take %zu",
                            l->pixels->name, l->stride, pix->width, row_bytes);
    l->n_bytes = l->stride * (rows - 1) + row_bytes;
    if (pix->sizeimage < l->n_bytes)
        return gn_error_set(out_error, -EINVAL,
                            "buffers of %u bytes cannot hold %s pictures of %ux%u, which take %zu",
                            pix->sizeimage, l->pixels->name, pix->width, pix->height, l->n_bytes);
    return 0;
}

/** As what pictures are given. */
static void init_output(bool is_8_bit, struct gn_v4l2_layout *l)
{
    size_t n = (size_t)l->width * (size_t)l->height;
    if (l->pixels->bits == 0) {
        l->format = GN_CAPTURE_JPEG;
        l->is_borrowed = true;
        return;
    }
    bool is_wide = !is_8_bit && (l->pixels->depth > 8 || l->pixels->fourcc == V4L2_PIX_FMT_GREY);
    l->format = !is_wide                 ? GN_CAPTURE_RGB8
                : l->pixels->depth == 12 ? GN_CAPTURE_MONO12
                                         : GN_CAPTURE_MONO16;
    l->n_out_bytes = n * (is_wide ? 2 : 3);
    bool has_same_pixels =
        l->pixels->fourcc == V4L2_PIX_FMT_RGB24 || (is_wide && l->pixels->depth >= 12);
    l->is_borrowed = has_same_pixels && l->n_bytes == l->n_out_bytes;
}

int gn_v4l2_layout_init(const struct v4l2_pix_format *pix, bool is_8_bit,
                        struct gn_v4l2_layout *out, struct gn_error *out_error)
{
    struct gn_v4l2_layout l = {.pixels = gn_v4l2_pixels_find(pix->pixelformat)};
    memset(out, 0, sizeof(*out));
    char name[8];
    gn_v4l2_pixels_print_fourcc(pix->pixelformat, name);
    if (!l.pixels)
        return gn_error_set(out_error, -EINVAL, "pixel format '%s' is none that we read", name);
    if (pix->width < 1 || pix->width > GN_IMAGE_MAX_SIDE || pix->height < 1 ||
        pix->height > GN_IMAGE_MAX_SIDE || pix->width * pix->height > GN_IMAGE_MAX_PIXELS)
        return gn_error_set(out_error, -EINVAL,
                            "pictures of %ux%u: sides are in [1, %d] and pixels at most %d",
                            pix->width, pix->height, GN_IMAGE_MAX_SIDE, GN_IMAGE_MAX_PIXELS);
    if (pix->field != V4L2_FIELD_NONE && pix->field != V4L2_FIELD_ANY)
        return gn_error_set(out_error, -EINVAL, "interlaced pictures (field order %u of V4L2)",
                            pix->field);
    l.width = (int)pix->width;
    l.height = (int)pix->height;
    int err = l.pixels->bits ? init_rows(pix, &l, out_error) : 0;
    if (!err && (pix->pixelformat == V4L2_PIX_FMT_YUYV || pix->pixelformat == V4L2_PIX_FMT_NV12))
        err = init_yuv(pix, &l.yuv, out_error);
    bool is_rgb = pix->pixelformat == V4L2_PIX_FMT_RGB24 || pix->pixelformat == V4L2_PIX_FMT_BGR24;
    if (!err && is_rgb && pix->quantization == V4L2_QUANTIZATION_LIM_RANGE)
        err = gn_error_set(out_error, -EINVAL, "RGB in limited range; ask for YUYV or NV12");
    if (err)
        return err;
    init_output(is_8_bit, &l);
    *out = l;
    return 0;
}

static inline uint8_t clamp8(int32_t fixed)
{
    int32_t code = fixed >> FIXED_BITS;
    return (uint8_t)(code < 0 ? 0 : code > 255 ? 255 : code);
}

/** Chroma's part of R, G, B, and the half that rounds. */
struct chroma {
    int32_t r, g, b;
};

static inline struct chroma get_chroma(struct gn_v4l2_yuv yuv, int u, int v)
{
    int32_t half = 1 << (FIXED_BITS - 1);
    u -= 128;
    v -= 128;
    return (struct chroma){yuv.v_r * v + half, yuv.u_g * u + yuv.v_g * v + half,
                           yuv.u_b * u + half};
}

static inline void put_pixel(struct gn_v4l2_yuv yuv, int y, struct chroma c, uint8_t *rgb)
{
    int32_t luma = yuv.luma * (y - yuv.black);
    rgb[0] = clamp8(luma + c.r);
    rgb[1] = clamp8(luma + c.g);
    rgb[2] = clamp8(luma + c.b);
}

/** What the loops read is kept in variables: bytes that are written might be anything else. */
static void convert_yuyv(const struct gn_v4l2_layout *l, const uint8_t *data, uint8_t *out)
{
    const struct gn_v4l2_yuv yuv = l->yuv;
    const int width = l->width, height = l->height;
    const size_t stride = l->stride;
    for (int y = 0; y < height; y++) {
        const uint8_t *row = data + (size_t)y * stride;
        for (int x = 0; x < width; x += 2, row += 4, out += 6) {
            struct chroma c = get_chroma(yuv, row[1], row[3]);
            put_pixel(yuv, row[0], c, out);
            put_pixel(yuv, row[2], c, out + 3);
        }
    }
}

static void convert_nv12(const struct gn_v4l2_layout *l, const uint8_t *data, uint8_t *out)
{
    const struct gn_v4l2_yuv yuv = l->yuv;
    const int width = l->width, height = l->height;
    const size_t stride = l->stride;
    const uint8_t *chroma = data + (size_t)height * stride;
    for (int y = 0; y < height; y++) {
        const uint8_t *row = data + (size_t)y * stride, *uv = chroma + (size_t)(y / 2) * stride;
        for (int x = 0; x < width; x += 2, out += 6) {
            struct chroma c = get_chroma(yuv, uv[x], uv[x + 1]);
            put_pixel(yuv, row[x], c, out);
            put_pixel(yuv, row[x + 1], c, out + 3);
        }
    }
}

/** RGB3 with padded rows, BGR3. */
static void convert_rgb(const struct gn_v4l2_layout *l, const uint8_t *data, uint8_t *out)
{
    bool is_bgr = l->pixels->fourcc == V4L2_PIX_FMT_BGR24;
    for (int y = 0; y < l->height; y++) {
        const uint8_t *row = data + (size_t)y * l->stride;
        if (!is_bgr) {
            memcpy(out, row, (size_t)l->width * 3);
            out += (size_t)l->width * 3;
            continue;
        }
        for (int x = 0; x < l->width; x++, row += 3, out += 3) {
            out[0] = row[2];
            out[1] = row[1];
            out[2] = row[0];
        }
    }
}

static unsigned get_code16(const uint8_t *p)
{
    return (unsigned)p[0] | (unsigned)p[1] << 8;
}

/** The upper eight bits of a luma, three times. */
static void convert_gray(const struct gn_v4l2_layout *l, const uint8_t *data, uint8_t *out)
{
    int shift = l->pixels->depth - 8;
    for (int y = 0; y < l->height; y++) {
        const uint8_t *row = data + (size_t)y * l->stride;
        for (int x = 0; x < l->width; x++, out += 3) {
            unsigned code = l->pixels->bits == 8 ? row[x] : get_code16(row + 2 * (size_t)x);
            out[0] = out[1] = out[2] = (uint8_t)(code >> shift);
        }
    }
}

/** Codes of 8 and 10 bits to the same share of 16; of 12 and 16 bits, whose rows are padded, as
 * they are. */
static void convert_wide(const struct gn_v4l2_layout *l, const uint8_t *data, uint8_t *out)
{
    for (int y = 0; y < l->height; y++) {
        const uint8_t *row = data + (size_t)y * l->stride;
        for (int x = 0; x < l->width; x++, out += 2) {
            unsigned code = l->pixels->bits == 8 ? row[x] : get_code16(row + 2 * (size_t)x);
            if (l->pixels->depth == 8)
                code *= 257;
            else if (l->pixels->depth == 10)
                code = code << 6 | code >> 4;
            out[0] = (uint8_t)code;
            out[1] = (uint8_t)(code >> 8);
        }
    }
}

void gn_v4l2_convert(const struct gn_v4l2_layout *layout, const uint8_t *data, uint8_t *out)
{
    switch (layout->pixels->fourcc) {
    case V4L2_PIX_FMT_YUYV:
        convert_yuyv(layout, data, out);
        return;
    case V4L2_PIX_FMT_NV12:
        convert_nv12(layout, data, out);
        return;
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_BGR24:
        convert_rgb(layout, data, out);
        return;
    default:
        if (layout->format == GN_CAPTURE_RGB8)
            convert_gray(layout, data, out);
        else
            convert_wide(layout, data, out);
    }
}

bool gn_v4l2_has_sound_codes(const struct gn_v4l2_layout *layout, const uint8_t *data)
{
    if (layout->pixels->depth != 10 && layout->pixels->depth != 12)
        return true;
    unsigned high = 0; // bits of the codes' upper bytes
    for (int y = 0; y < layout->height; y++) {
        const uint8_t *row = data + (size_t)y * layout->stride;
        for (int x = 0; x < layout->width; x++)
            high |= row[2 * x + 1];
    }
    return high >> (layout->pixels->depth - 8) == 0;
}
