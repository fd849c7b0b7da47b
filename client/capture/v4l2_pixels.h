/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The pixel formats of V4L2 that we read: how a driver's buffer must lie, and what becomes of it.
 */
#ifndef GN_CLIENT_CAPTURE_V4L2_PIXELS_H
#define GN_CLIENT_CAPTURE_V4L2_PIXELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <linux/videodev2.h>

#include "client/capture/source.h"
#include "common/error.h"
#include "proto/attr.h"

/** One pixel format. Static. */
struct gn_v4l2_pixels {
    uint32_t fourcc;
    char name[5]; // as in "YUYV", without trailing blanks
    int bits;     // of a pixel in a row; 0: compressed
    int depth;    // significant bits of a code
};

/** The formats that we read, the one that tells most first, NULL at the end of i. */
const struct gn_v4l2_pixels *gn_v4l2_pixels_get(int i);
/** NULL: none that we read. */
const struct gn_v4l2_pixels *gn_v4l2_pixels_find(uint32_t fourcc);

/** A code of four characters as text: printable, without trailing blanks; big-endian ones end with
 * "-BE". */
void gn_v4l2_pixels_print_fourcc(uint32_t fourcc, char out[static 8]);

/** YUV to RGB in 2^20ths: what luma above black counts, and how U and V get into R, G, B. */
struct gn_v4l2_yuv {
    int32_t luma, black, v_r, u_g, v_g, u_b;
};

/** How the pictures of a camera lie in its buffers, checked. A value. */
struct gn_v4l2_layout {
    const struct gn_v4l2_pixels *pixels;
    int width, height; // px
    size_t stride;     // bytes from row to row
    size_t n_bytes;    // of a whole picture, at least; 0: compressed
    enum gn_capture_format format;
    size_t n_out_bytes; // of a picture as it is given; 0: compressed
    bool is_borrowed;   // given as it lies in the buffer
    struct gn_v4l2_yuv yuv;
};

/**
 * Checks what a driver says it will deliver. is_8_bit: as RGB8 (or JPEG) whatever comes. Returns 0,
 * or -EINVAL and a sentence: interlaced, sizes 0 or absurd, rows shorter than their pixels, a
 * picture larger than its buffers (pix->sizeimage), an encoding of colours that we do not know.
 */
GN_MUST_USE int gn_v4l2_layout_init(const struct v4l2_pix_format *pix, bool is_8_bit,
                                    struct gn_v4l2_layout *out, struct gn_error *out_error);

/**
 * One picture: data[n_bytes of the layout] to out[n_out_bytes]. For layouts that are neither
 * borrowed nor compressed. Chroma is that of its pair or square of pixels, not interpolated.
 *   R = s_y (Y - Y0) + s_c 2 (1 - Kr) (V - 128),  B likewise with U and Kb, and G from
 *   Y = Kr R + Kg G + Kb B;  s_y = 255/219, s_c = 255/224, Y0 = 16 in limited range, else 1, 1, 0.
 * Source: ITU-R BT.601-7 2.5, BT.709-6 3, BT.2020-2 table 4. Rounded to the nearest code, but for
 * what is within 0.001 of a half; clamped. Checked by tests/unit/v4l2_pixels.c.
 * Thread-safety: safe.
 */
void gn_v4l2_convert(const struct gn_v4l2_layout *layout, const uint8_t *data, uint8_t *out);

/** Whether all codes of a picture are below 2^depth: where they are not, they lie otherwise than
 * the format says. True for formats whose codes fill their bytes. */
bool gn_v4l2_has_sound_codes(const struct gn_v4l2_layout *layout, const uint8_t *data);

#endif
