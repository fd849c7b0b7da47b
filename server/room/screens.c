/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/screens.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/half.h"
#include "server/room/convert.h"

int gn_screens_init(struct gn_screens *screens, const struct gn_emitters *emitters)
{
    int n = gn_emitters_get_stream_count(emitters);
    *screens = (struct gn_screens){.n = n};
    if (n == 0)
        return 0;
    screens->slots = calloc((size_t)n, sizeof(*screens->slots));
    if (!screens->slots) {
        screens->n = 0;
        return -ENOMEM;
    }
    for (int i = 0; i < n; i++)
        screens->slots[i].name = gn_emitters_get_stream_name(emitters, i);
    return 0;
}

void gn_screens_finish(struct gn_screens *screens)
{
    for (int i = 0; i < screens->n; i++)
        if (screens->slots[i].has_picture)
            gn_buf_unref(&screens->slots[i].job.payload);
    free(screens->slots);
    *screens = (struct gn_screens){0};
}

int gn_screens_find(const struct gn_screens *screens, const char *name, struct gn_error *out_error)
{
    char names[256] = "";
    size_t used = 0;
    for (int i = 0; i < screens->n; i++) {
        if (strcmp(screens->slots[i].name, name) == 0)
            return i;
        int n = snprintf(names + used, sizeof(names) - used, "%s%s", i ? ", " : "",
                         screens->slots[i].name);
        used = n > 0 && used + (size_t)n < sizeof(names) ? used + (size_t)n : sizeof(names) - 1;
    }
    if (screens->n == 0)
        return gn_error_set(out_error, -ENOENT,
                            "stream '%s': no material of the scene has an \"emission_stream\"",
                            name);
    return gn_error_set(out_error, -ENOENT, "stream '%s': the scene's streams are %s", name, names);
}

void gn_screens_put(struct gn_screens *screens, const struct gn_emitter_job *job,
                    struct gn_buf **out_superseded)
{
    struct gn_screen *s = &screens->slots[job->stream];
    *out_superseded = s->has_picture ? s->job.payload : NULL;
    s->job = *job;
    s->has_picture = true;
}

bool gn_screens_take(struct gn_screens *screens, bool all, struct gn_emitter_job *out_job)
{
    struct gn_screen *next = NULL;
    for (int i = 0; i < screens->n; i++) {
        struct gn_screen *s = &screens->slots[i];
        if (s->has_picture && (all || s->turn == 0) && (!next || s->turn < next->turn))
            next = s;
    }
    if (!next)
        return false;
    *out_job = next->job;
    next->has_picture = false;
    next->turn = ++screens->turn;
    return true;
}

void gn_screen_decoder_finish(struct gn_screen_decoder *decoder)
{
    gn_image_finish(&decoder->linear);
    gn_image8_finish(&decoder->codes);
    gn_jpeg_destroy(&decoder->jpeg);
}

static int decode_jpeg(struct gn_screen_decoder *d, const struct gn_msg_emitter_frame *m,
                       const struct gn_buf *payload, struct gn_error *error)
{
    if (!d->jpeg && gn_jpeg_create(&d->jpeg) < 0)
        return gn_error_set(error, -ENOMEM, "out of memory");
    int width, height, channels; // before memory is taken for what the header claims
    int rc =
        gn_jpeg_get_size(d->jpeg, payload->data, payload->len, &width, &height, &channels, error);
    if (rc < 0)
        return rc;
    if (width != (int)m->width || height != (int)m->height)
        return gn_error_set(error, -EINVAL, "a JPEG of %dx%d in a picture of %ux%u", width, height,
                            m->width, m->height);
    if (d->codes.width != width || d->codes.height != height) {
        gn_image8_finish(&d->codes);
        if (gn_image8_init(&d->codes, width, height, 3) < 0)
            return gn_error_set(error, -ENOMEM, "out of memory for %dx%d", width, height);
    }
    return gn_jpeg_decode(d->jpeg, payload->data, payload->len, &d->codes, error);
}

/* Codes of 8 bits are few: each is decoded once. */
static void decode_codes(const struct gn_response *response, const uint8_t *codes, size_t n,
                         float *out)
{
    float linear[256];
    for (int i = 0; i < 256; i++)
        linear[i] = gn_response_decode(response, (float)i / 255) * (float)response->scale;
    for (size_t i = 0; i < n; i++)
        out[i] = linear[codes[i]];
}

static void decode_halves(const struct gn_response *response, const uint8_t *bytes, size_t n,
                          float *out)
{
    for (size_t i = 0; i < n; i++) {
        uint16_t half = (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
        out[i] = gn_response_decode(response, gn_half_to_float(half)) * (float)response->scale;
    }
}

int gn_screen_decode(struct gn_screen_decoder *decoder, const struct gn_msg_emitter_frame *frame,
                     const struct gn_buf *payload, struct gn_error *out_error)
{
    static const double no_matrix[9] = {0};
    struct gn_response response;
    int width = (int)frame->width, height = (int)frame->height;
    bool is_half = frame->pixel_format == GN_MSG_PIXEL_FORMAT_RGB_F16;
    bool is_jpeg = frame->pixel_format == GN_MSG_PIXEL_FORMAT_JPEG;
    size_t n = 3 * (size_t)width * (size_t)height;
    int rc =
        gn_convert_response(&frame->response, no_matrix, frame->scale, NULL, &response, out_error);
    if (rc < 0)
        return rc;
    if (!payload || (!is_jpeg && payload->len != n * (is_half ? 2 : 1)))
        return gn_error_set(out_error, -EINVAL, "its pixels do not fit %dx%d", width, height);
    if (is_jpeg)
        rc = decode_jpeg(decoder, frame, payload, out_error);
    if (rc < 0)
        return rc;
    struct gn_image *linear = &decoder->linear;
    if (linear->width != width || linear->height != height) {
        gn_image_finish(linear);
        if (gn_image_init(linear, width, height, 3) < 0)
            return gn_error_set(out_error, -ENOMEM, "out of memory for %dx%d", width, height);
    }
    if (is_half)
        decode_halves(&response, payload->data, n, linear->data);
    else
        decode_codes(&response, is_jpeg ? decoder->codes.data : payload->data, n, linear->data);
    return 0;
}
