/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/v4l2_picture.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <linux/videodev2.h>

#include "common/jpeg.h"

/** Y, U, V as shares of R, G, B in [0, 255], and their codes at 0: BT.601-7 2.5, limited range. */
static const double yuv_from_rgb[3][4] = {
    {0.299 * 219 / 255, 0.587 * 219 / 255, 0.114 * 219 / 255, 16},
    {-0.299 / 1.772 * 224 / 255, -0.587 / 1.772 * 224 / 255, 0.886 / 1.772 * 224 / 255, 128},
    {0.701 / 1.402 * 224 / 255, -0.587 / 1.402 * 224 / 255, -0.114 / 1.402 * 224 / 255, 128},
};

static uint8_t encode(const double weights[4], const double rgb[3])
{
    return (uint8_t)lround(weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2] +
                           weights[3]);
}

/** Two pixels beside each other, which share their mean chroma. */
static void encode_pair(const uint8_t *left, const uint8_t *right, uint8_t out[4])
{
    double a[3], b[3], mean[3];
    for (int c = 0; c < 3; c++) {
        a[c] = left[c];
        b[c] = right[c];
        mean[c] = (a[c] + b[c]) / 2;
    }
    out[0] = encode(yuv_from_rgb[0], a);
    out[1] = encode(yuv_from_rgb[1], mean);
    out[2] = encode(yuv_from_rgb[0], b);
    out[3] = encode(yuv_from_rgb[2], mean);
}

static int encode_jpeg(const struct gn_image8 *picture, uint8_t *data, size_t capacity,
                       struct v4l2_pix_format *pix, struct gn_error *out_error)
{
    struct gn_jpeg *jpeg = NULL;
    size_t n = 0;
    int err = gn_jpeg_create(&jpeg);
    if (err)
        return gn_error_set(out_error, err, "out of memory");
    err = gn_jpeg_encode(jpeg, picture, NULL, data, capacity, &n, out_error);
    pix->sizeimage = (uint32_t)n;
    gn_jpeg_destroy(&jpeg);
    return err;
}

int gn_rig_encode_v4l2(const struct gn_image8 *picture, const char *fourcc,
                       struct v4l2_pix_format *out_pix, uint8_t **out_data,
                       struct gn_error *out_error)
{
    int width = picture->width, height = picture->height;
    bool is_jpeg = strcmp(fourcc, "MJPG") == 0;
    size_t n_pixels = (size_t)width * (size_t)height, capacity = gn_jpeg_get_bound(width, height);
    struct v4l2_pix_format pix = {.width = (uint32_t)width,
                                  .height = (uint32_t)height,
                                  .pixelformat = is_jpeg ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV,
                                  .field = V4L2_FIELD_NONE,
                                  .bytesperline = is_jpeg ? 0 : 2 * (uint32_t)width,
                                  .sizeimage = 2 * (uint32_t)n_pixels,
                                  .colorspace =
                                      is_jpeg ? V4L2_COLORSPACE_JPEG : V4L2_COLORSPACE_SRGB};
    if ((!is_jpeg && strcmp(fourcc, "YUYV") != 0) || picture->channels < 3 || width % 2)
        return gn_error_set(out_error, -EINVAL,
                            "%s of %dx%d, %d channels: right would be YUYV or MJPG, 8-bit colours "
                            "and an even width",
                            fourcc, width, height, picture->channels);
    uint8_t *data = malloc(2 * n_pixels > capacity ? 2 * n_pixels : capacity);
    if (!data)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int err = is_jpeg ? encode_jpeg(picture, data, capacity, &pix, out_error) : 0;
    for (size_t i = 0; !is_jpeg && i < n_pixels; i += 2) {
        const uint8_t *left = picture->data + i * (size_t)picture->channels;
        encode_pair(left, left + picture->channels, data + 2 * i);
    }
    if (err) {
        free(data);
        return err;
    }
    *out_pix = pix;
    *out_data = data;
    return 0;
}
