/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/grey.h"

#include <errno.h>
#include <string.h>

/** Weights of Rec.601 luma, as JPEG has it, of 256. */
static inline unsigned get_luma(unsigned r, unsigned g, unsigned b)
{
    return (77 * r + 150 * g + 29 * b + 128) >> 8;
}

static inline unsigned get_code16(const uint8_t *p)
{
    return (unsigned)p[0] | (unsigned)p[1] << 8;
}

static uint8_t narrow(unsigned code, int shift)
{
    code >>= shift;
    return (uint8_t)(code > 255 ? 255 : code);
}

int gn_grey_from_capture(const struct gn_capture *capture, struct gn_jpeg *jpeg,
                         struct gn_image8 *grey, struct gn_error *out_error)
{
    static const int channels[] = {3, 1, 3, 1, 3, 3, 0}, bytes[] = {4, 2, 2, 2, 2, 1, 0};
    size_t n = (size_t)capture->width * (size_t)capture->height;
    enum gn_capture_format format = capture->format;
    if (capture->width != grey->width || capture->height != grey->height || grey->channels != 1)
        return gn_error_set(out_error, -EINVAL,
                            "%s is %dx%d, but the camera was calibrated at %dx%d", capture->name,
                            capture->width, capture->height, grey->width, grey->height);
    if (format == GN_CAPTURE_JPEG) {
        int err = gn_jpeg_decode(jpeg, capture->data, capture->data_bytes, grey, out_error);
        return err == -EINVAL ? -EBADMSG : err;
    }
    if (format == GN_CAPTURE_RGB_F32)
        return gn_error_set(out_error, -EINVAL,
                            "%s holds linear floats; markers are looked for in pictures of 8 to 16 "
                            "bits",
                            capture->name);
    if (capture->data_bytes < n * (size_t)(channels[format] * bytes[format]))
        return gn_error_set(out_error, -EINVAL, "%s has too few bytes for %dx%d", capture->name,
                            capture->width, capture->height);
    int shift = format == GN_CAPTURE_MONO12 || format == GN_CAPTURE_RGB12 ? 4 : 8;
    const uint8_t *p = capture->data;
    uint8_t *out = grey->data;
    if (format == GN_CAPTURE_RGB8) {
        for (size_t i = 0; i < n; i++, p += 3)
            out[i] = (uint8_t)get_luma(p[0], p[1], p[2]);
    } else if (channels[format] == 1) {
        for (size_t i = 0; i < n; i++, p += 2)
            out[i] = narrow(get_code16(p), shift);
    } else {
        for (size_t i = 0; i < n; i++, p += 6)
            out[i] = narrow(get_luma(get_code16(p), get_code16(p + 2), get_code16(p + 4)), shift);
    }
    return 0;
}
