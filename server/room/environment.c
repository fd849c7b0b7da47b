/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/environment.h"

#include <errno.h>
#include <string.h>

#include "common/exr.h"
#include "common/half.h"
#include "common/jpeg.h"
#include "server/room/convert.h"

void gn_environment_decoder_finish(struct gn_environment_decoder *decoder)
{
    gn_image_finish(&decoder->codes);
    gn_image8_finish(&decoder->codes8);
    gn_jpeg_destroy(&decoder->jpeg);
}

static uint16_t get_u16(const uint8_t *p)
{
    return (uint16_t)(p[0] | p[1] << 8);
}

static float get_f32(const uint8_t *p)
{
    uint32_t bits =
        (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

/** The largest code of an integer format; 1: floats pass as they are. */
static double get_full_scale(enum gn_msg_pixel_format format)
{
    switch (format) {
    case GN_MSG_PIXEL_FORMAT_MONO12:
    case GN_MSG_PIXEL_FORMAT_RGB12:
        return 4095;
    case GN_MSG_PIXEL_FORMAT_MONO16:
    case GN_MSG_PIXEL_FORMAT_RGB16:
        return 65535;
    case GN_MSG_PIXEL_FORMAT_JPEG:
        return 255;
    default:
        return 1;
    }
}

/** Makes the image that size, keeping its memory where it is already. */
static int resize(struct gn_image *image, int width, int height, int channels)
{
    if (image->width == width && image->height == height && image->channels == channels)
        return 0;
    gn_image_finish(image);
    return gn_image_init(image, width, height, channels);
}

/** The formats that are rows of numbers. */
static int decode_raw(struct gn_environment_decoder *d, const struct gn_msg_environment_frame *m,
                      const uint8_t *pixels, size_t n_bytes, struct gn_error *error)
{
    size_t pixel_bytes = gn_wire_get_pixel_bytes(m->pixel_format);
    size_t wanted = (size_t)m->width * m->height * pixel_bytes;
    if (pixel_bytes == 0)
        return gn_error_set(error, -EINVAL, "pixel format %d is none that this server knows",
                            (int)m->pixel_format);
    if (n_bytes != wanted)
        return gn_error_set(error, -EINVAL, "%zu bytes of pixels, but %ux%u need %zu", n_bytes,
                            m->width, m->height, wanted);
    bool is_mono = m->pixel_format == GN_MSG_PIXEL_FORMAT_MONO12 ||
                   m->pixel_format == GN_MSG_PIXEL_FORMAT_MONO16;
    if (resize(&d->codes, (int)m->width, (int)m->height, is_mono ? 1 : 3) < 0)
        return gn_error_set(error, -ENOMEM, "out of memory for %ux%u", m->width, m->height);
    size_t n = (size_t)m->width * m->height * (is_mono ? 1 : 3);
    float *out = d->codes.data;
    float scale = (float)(1 / get_full_scale(m->pixel_format));
    unsigned largest = 0;
    switch (m->pixel_format) {
    case GN_MSG_PIXEL_FORMAT_RGB_F32:
        for (size_t i = 0; i < n; i++)
            out[i] = get_f32(pixels + 4 * i);
        return 0;
    case GN_MSG_PIXEL_FORMAT_RGB_F16:
        for (size_t i = 0; i < n; i++)
            out[i] = gn_half_to_float(get_u16(pixels + 2 * i));
        return 0;
    default:
        for (size_t i = 0; i < n; i++) {
            unsigned code = get_u16(pixels + 2 * i);
            largest = code > largest ? code : largest;
            out[i] = (float)code * scale;
        }
    }
    if (largest > (unsigned)get_full_scale(m->pixel_format))
        return gn_error_set(error, -EINVAL, "a code of %u in a 12-bit format: 0 to 4095 are right",
                            largest);
    return 0;
}

static int decode_jpeg(struct gn_environment_decoder *d, const struct gn_msg_environment_frame *m,
                       const uint8_t *bytes, size_t n_bytes, struct gn_error *error)
{
    if (!d->jpeg && gn_jpeg_create(&d->jpeg) < 0)
        return gn_error_set(error, -ENOMEM, "out of memory");
    int width, height, channels; // before memory is taken for what the header claims
    int rc = gn_jpeg_get_size(d->jpeg, bytes, n_bytes, &width, &height, &channels, error);
    if (rc < 0)
        return rc;
    if (width != (int)m->width || height != (int)m->height)
        return gn_error_set(error, -EINVAL, "a JPEG of %dx%d in a frame of %ux%u", width, height,
                            m->width, m->height);
    if (d->codes8.width != (int)m->width || d->codes8.height != (int)m->height) {
        gn_image8_finish(&d->codes8);
        if (gn_image8_init(&d->codes8, (int)m->width, (int)m->height, 3) < 0)
            return gn_error_set(error, -ENOMEM, "out of memory for %ux%u", m->width, m->height);
    }
    if (resize(&d->codes, (int)m->width, (int)m->height, 3) < 0)
        return gn_error_set(error, -ENOMEM, "out of memory for %ux%u", m->width, m->height);
    rc = gn_jpeg_decode(d->jpeg, bytes, n_bytes, &d->codes8, error);
    if (rc < 0)
        return rc;
    size_t n = (size_t)m->width * m->height * 3;
    for (size_t i = 0; i < n; i++)
        d->codes.data[i] = (float)d->codes8.data[i] * (1.0f / 255.0f);
    return 0;
}

static int decode_exr(struct gn_environment_decoder *d, const struct gn_msg_environment_frame *m,
                      const uint8_t *bytes, size_t n_bytes, struct gn_error *error)
{
    struct gn_exr_info info;
    int rc = gn_exr_get_info(bytes, n_bytes, &info, error);
    if (rc < 0)
        return rc;
    if (info.width != (int)m->width || info.height != (int)m->height)
        return gn_error_set(error, -EINVAL, "an EXR of %dx%d in a frame of %ux%u", info.width,
                            info.height, m->width, m->height);
    struct gn_image image = {0};
    rc = gn_exr_read_memory(bytes, n_bytes, &image, NULL, error);
    if (rc < 0)
        return rc;
    gn_image_finish(&d->codes);
    d->codes = image;
    return 0;
}

int gn_environment_decode(struct gn_environment_decoder *decoder,
                          const struct gn_msg_environment_frame *message,
                          const struct gn_buf *payload, struct gn_environment_frame *out_frame,
                          struct gn_error *out_error)
{
    const uint8_t *bytes = payload ? payload->data : NULL;
    size_t n_bytes = payload ? payload->len : 0;
    size_t n_table =
        message->response.type == GN_MSG_RESPONSE_TYPE_TABLE ? message->response.table_entries : 0;
    if (n_table > GN_LIMIT_TABLE_ENTRIES || n_bytes < 4 * n_table)
        return gn_error_set(out_error, -EINVAL, "%zu bytes, but the response's table has %zu of 4",
                            n_bytes, n_table);
    for (size_t i = 0; i < n_table; i++)
        decoder->table[i] = get_f32(bytes + 4 * i);
    bytes += 4 * n_table;
    n_bytes -= 4 * n_table;
    if (n_bytes == 0)
        return gn_error_set(out_error, -EINVAL, "no pixels");

    double full_scale = get_full_scale(message->pixel_format);
    struct gn_environment_frame frame = {
        .codes = &decoder->codes,
        .code_max = full_scale > 1 ? (int)full_scale : 0,
        .capture_time_ns = message->capture_time_ns,
        .sequence = message->sequence,
    };
    int rc = gn_convert_projection(&message->projection, (int)message->width, (int)message->height,
                                   &frame.projection, out_error);
    if (rc == 0)
        rc = gn_convert_response(&message->response, message->matrix_to_rec709, message->scale,
                                 decoder->table, &frame.response, out_error);
    struct gn_pose pose;
    if (rc == 0)
        rc = gn_convert_transform(message->has_world_from_probe, &message->world_from_probe, &pose,
                                  out_error);
    if (rc < 0)
        return rc;
    memcpy(frame.world_from_probe, pose.rotation, sizeof(frame.world_from_probe));
    memcpy(frame.position, pose.translation, sizeof(frame.position));
    switch (message->pixel_format) {
    case GN_MSG_PIXEL_FORMAT_JPEG:
        rc = decode_jpeg(decoder, message, bytes, n_bytes, out_error);
        break;
    case GN_MSG_PIXEL_FORMAT_EXR:
        rc = decode_exr(decoder, message, bytes, n_bytes, out_error);
        break;
    default:
        rc = decode_raw(decoder, message, bytes, n_bytes, out_error);
    }
    if (rc == 0)
        *out_frame = frame;
    return rc;
}
