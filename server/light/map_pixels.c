/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Pixels as they came in, to device values. */
#include "server/light/map_pixels.h"

#include <math.h>
#include <string.h>

#include "common/half.h"

int gn_pixel_layout_get_bytes(enum gn_pixel_layout layout)
{
    static const int bytes[GN_PIXELS_COUNT] = {
        [GN_PIXELS_RGB_F32] = 12, [GN_PIXELS_RGB_F16] = 6, [GN_PIXELS_MONO_U16] = 2,
        [GN_PIXELS_RGB_U16] = 6,  [GN_PIXELS_RGB_U8] = 3,
    };
    return bytes[layout];
}

static uint16_t get_u16(const uint8_t *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}

static uint32_t get_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static const uint8_t *get_raw(const struct gn_map_reader *r, int x, int y)
{
    size_t i = (size_t)y * (size_t)r->table->projection.width + (size_t)x;
    return r->frame->raw + i * (size_t)gn_pixel_layout_get_bytes(r->frame->layout);
}

/* Not a finite number >= 0, or -0: the sign bit, or exponents of infinity and NaN carried there. */
static uint32_t get_fault_bit(uint32_t bits)
{
    return (bits | (bits + 0x00800000u)) & 0x80000000u;
}

/* n floats as they are. Whether any of them has to be mended. */
static bool fetch_f32(const uint8_t *raw, int n, float *restrict out)
{
    uint32_t faults = 0;
    for (int i = 0; i < n; i++) {
        uint32_t bits = get_u32(raw + 4 * (size_t)i);
        faults |= get_fault_bit(bits);
        memcpy(out + i, &bits, sizeof(bits));
    }
    return faults != 0;
}

static bool fetch_f16(const uint8_t *raw, int n, float *restrict out)
{
    uint32_t faults = 0;
    for (int i = 0; i < n; i++) {
        uint32_t bits;
        out[i] = gn_half_to_float(get_u16(raw + 2 * (size_t)i));
        memcpy(&bits, out + i, sizeof(bits));
        faults |= get_fault_bit(bits);
    }
    return faults != 0;
}

/* The largest of n codes. */
static int get_largest_u16(const uint8_t *raw, int n)
{
    int largest = 0;
    for (int i = 0; i < n; i++) {
        int code = get_u16(raw + 2 * (size_t)i);
        largest = code > largest ? code : largest;
    }
    return largest;
}

/* Counts pixels with a code at the rail or above. */
static int count_clipped_u16(const uint8_t *raw, int n, int n_codes, int code_max)
{
    int n_clipped = 0;
    for (int i = 0; i < n; i++, raw += 2 * n_codes) {
        bool is_clipped = false;
        for (int c = 0; c < n_codes; c++)
            is_clipped = is_clipped || get_u16(raw + 2 * c) >= code_max;
        n_clipped += is_clipped;
    }
    return n_clipped;
}

/* n pixels of 16-bit codes, 1 or 3 of them each. A row with codes that are none stays black: the
 * frame is refused. */
static void fetch_u16(const struct gn_code_table *codes, const uint8_t *raw, int n, int n_codes,
                      float *restrict out, struct gn_map_row *row)
{
    const float *linear = codes->linear;
    row->largest_code = get_largest_u16(raw, n * n_codes);
    if (row->largest_code >= codes->code_max)
        row->n_clipped = count_clipped_u16(raw, n, n_codes, codes->code_max);
    if (row->largest_code > codes->code_max) {
        memset(out, 0, 3 * (size_t)n * sizeof(*out));
    } else if (n_codes == 1) {
        for (int i = 0; i < n; i++)
            out[3 * i] = out[3 * i + 1] = out[3 * i + 2] = linear[get_u16(raw + 2 * (size_t)i)];
    } else {
        for (int i = 0; i < 3 * n; i++)
            out[i] = linear[get_u16(raw + 2 * (size_t)i)];
    }
}

static void fetch_u8(const struct gn_code_table *codes, const uint8_t *raw, int n, float *out,
                     struct gn_map_row *row)
{
    for (int i = 0; i < n; i++, raw += 3, out += 3) {
        bool is_clipped = false;
        for (int c = 0; c < 3; c++) {
            out[c] = codes->linear[raw[c]];
            is_clipped = is_clipped || raw[c] == 255;
        }
        row->n_clipped += is_clipped;
    }
}

/* Of a float image, whose codes may be those of an integer format as shares of full scale. */
static bool fetch_image(const struct gn_map_reader *r, int x, int y, int n, float *out,
                        struct gn_map_row *row)
{
    const struct gn_image *image = r->frame->codes;
    bool is_mono = image->channels < 3, is_faulty = false;
    for (int i = 0; i < n; i++) {
        const float *code = gn_image_at(image, x + i, y);
        bool is_clipped = false;
        for (int c = 0; c < 3; c++) {
            float v = code[is_mono ? 0 : c];
            is_faulty = is_faulty || !(v >= 0 && v < INFINITY);
            is_clipped = is_clipped || (r->frame->code_max > 0 && v >= 1);
            if (r->codes && v >= 0)
                v = r->codes->linear[lrintf(fminf(v, 1) * (float)r->codes->code_max)];
            out[3 * i + c] = v;
        }
        row->n_clipped += is_clipped;
    }
    return is_faulty;
}

bool gn_map_pixels_fetch(const struct gn_map_reader *r, int x, int y, int n, float *out,
                         struct gn_map_row *row)
{
    enum gn_pixel_layout layout = r->frame->layout;
    switch (layout) {
    case GN_PIXELS_RGB_F32:
        return fetch_f32(get_raw(r, x, y), 3 * n, out);
    case GN_PIXELS_RGB_F16:
        return fetch_f16(get_raw(r, x, y), 3 * n, out);
    case GN_PIXELS_MONO_U16:
        fetch_u16(r->codes, get_raw(r, x, y), n, 1, out, row);
        return false;
    case GN_PIXELS_RGB_U16:
        fetch_u16(r->codes, get_raw(r, x, y), n, 3, out, row);
        return false;
    case GN_PIXELS_RGB_U8:
        fetch_u8(r->codes, get_raw(r, x, y), n, out, row);
        return false;
    default:
        return fetch_image(r, x, y, n, out, row);
    }
}

bool gn_map_pixels_is_infinite(const struct gn_map_reader *r, int x, int y)
{
    const struct gn_environment_frame *frame = r->frame;
    bool is_image = frame->layout == GN_PIXELS_IMAGE;
    int n = is_image && frame->codes->channels < 3 ? 1 : 3;
    for (int c = 0; c < n; c++) {
        float v = 0;
        if (is_image) {
            v = gn_image_at(frame->codes, x, y)[c];
        } else if (frame->layout == GN_PIXELS_RGB_F32) {
            uint32_t bits = get_u32(get_raw(r, x, y) + 4 * c);
            memcpy(&v, &bits, sizeof(v));
        } else if (frame->layout == GN_PIXELS_RGB_F16) {
            v = gn_half_to_float(get_u16(get_raw(r, x, y) + 2 * c));
        }
        if (v == INFINITY)
            return true;
    }
    return false;
}
