/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/environment.h"

#include <errno.h>
#include <string.h>

#include "common/exr.h"
#include "common/jpeg.h"
#include "server/room/convert.h"

void gn_environment_decoder_finish(struct gn_environment_decoder *decoder)
{
    gn_image_finish(&decoder->codes);
    gn_image8_finish(&decoder->codes8);
    gn_jpeg_destroy(&decoder->jpeg);
}

static float get_f32(const uint8_t *p)
{
    uint32_t bits =
        (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

/** How the light code names a format that is rows of numbers, and its largest code. */
static enum gn_pixel_layout get_layout(enum gn_msg_pixel_format format, int *out_code_max)
{
    *out_code_max = 0;
    switch (format) {
    case GN_MSG_PIXEL_FORMAT_RGB_F32:
        return GN_PIXELS_RGB_F32;
    case GN_MSG_PIXEL_FORMAT_RGB_F16:
        return GN_PIXELS_RGB_F16;
    case GN_MSG_PIXEL_FORMAT_MONO12:
        *out_code_max = 4095;
        return GN_PIXELS_MONO_U16;
    case GN_MSG_PIXEL_FORMAT_RGB12:
        *out_code_max = 4095;
        return GN_PIXELS_RGB_U16;
    case GN_MSG_PIXEL_FORMAT_MONO16:
        *out_code_max = 65535;
        return GN_PIXELS_MONO_U16;
    case GN_MSG_PIXEL_FORMAT_RGB16:
        *out_code_max = 65535;
        return GN_PIXELS_RGB_U16;
    case GN_MSG_PIXEL_FORMAT_RGB8:
        *out_code_max = 255;
        return GN_PIXELS_RGB_U8;
    default:
        return GN_PIXELS_IMAGE;
    }
}

/** The formats that are rows of numbers: borrowed as they are. */
static int take_raw(const struct gn_msg_environment_frame *m, const uint8_t *pixels, size_t n_bytes,
                    struct gn_environment_frame *frame, struct gn_error *error)
{
    size_t pixel_bytes = gn_wire_get_pixel_bytes(m->pixel_format);
    size_t wanted = (size_t)m->width * m->height * pixel_bytes;
    if (pixel_bytes == 0)
        return gn_error_set(error, -EINVAL, "pixel format %d is none that this server knows",
                            (int)m->pixel_format);
    if (n_bytes != wanted)
        return gn_error_set(error, -EINVAL, "%zu bytes of pixels, but %ux%u need %zu", n_bytes,
                            m->width, m->height, wanted);
    frame->layout = get_layout(m->pixel_format, &frame->code_max);
    frame->raw = pixels;
    return 0;
}

static int decode_jpeg(struct gn_environment_decoder *d, const struct gn_msg_environment_frame *m,
                       const uint8_t *bytes, size_t n_bytes, struct gn_environment_frame *frame,
                       struct gn_error *error)
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
    frame->layout = GN_PIXELS_RGB_U8;
    frame->raw = d->codes8.data;
    frame->code_max = 255;
    return gn_jpeg_decode(d->jpeg, bytes, n_bytes, &d->codes8, error);
}

static int decode_exr(struct gn_environment_decoder *d, const struct gn_msg_environment_frame *m,
                      const uint8_t *bytes, size_t n_bytes, struct gn_environment_frame *frame,
                      struct gn_error *error)
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
    frame->codes = &d->codes;
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

    struct gn_environment_frame frame = {
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
        rc = decode_jpeg(decoder, message, bytes, n_bytes, &frame, out_error);
        break;
    case GN_MSG_PIXEL_FORMAT_EXR:
        rc = decode_exr(decoder, message, bytes, n_bytes, &frame, out_error);
        break;
    default:
        rc = take_raw(message, bytes, n_bytes, &frame, out_error);
    }
    if (rc == 0)
        *out_frame = frame;
    return rc;
}
