/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_mean.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/compare.h"

/* Codes from this share of full scale on are clipped. */
#define BRIGHT_RAIL 0.99

/* A mean as it grows. */
struct sums {
    double squares;  // of the differences of each picture and the one before
    double level[2]; // least and largest mean code of a picture
};

static size_t count_values(const struct gn_calibrate_mean *m)
{
    return (size_t)m->width * (size_t)m->height * (size_t)m->channels;
}

static double get_code(const struct gn_image_file *picture, size_t i)
{
    return picture->kind == GN_IMAGE_CODES8 ? picture->codes8.data[i] : picture->codes16.data[i];
}

/* Adds a picture, which it takes over. */
static int add(struct gn_calibrate_mean *m, struct sums *s, struct gn_image_file *picture,
               struct gn_error *out_error)
{
    bool is_8 = picture->kind == GN_IMAGE_CODES8;
    int width = is_8 ? picture->codes8.width : picture->codes16.width;
    int height = is_8 ? picture->codes8.height : picture->codes16.height;
    int channels = is_8 ? picture->codes8.channels : picture->codes16.channels;
    if (m->n == 0) {
        m->width = width;
        m->height = height;
        m->channels = channels;
        m->sums = calloc(count_values(m), sizeof(*m->sums));
        if (!m->sums)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
    } else if (width != m->width || height != m->height || channels != m->channels ||
               picture->kind != m->last.kind) {
        return gn_error_set(out_error, -EINVAL, "the pictures are not of one size");
    }
    double level = 0;
    for (size_t i = 0; i < count_values(m); i++) {
        double code = get_code(picture, i), step = m->n > 0 ? code - get_code(&m->last, i) : 0;
        if (code > m->full_scale)
            return gn_error_set(out_error, -EINVAL, "a code of %.0f is above the full scale of %d",
                                code, m->full_scale);
        m->sums[i] += (uint32_t)code;
        level += code / (double)count_values(m);
        s->squares += step * step;
    }
    s->level[0] = m->n == 0 ? level : fmin(s->level[0], level);
    s->level[1] = m->n == 0 ? level : fmax(s->level[1], level);
    gn_image_file_finish(&m->last);
    m->last = *picture;
    memset(picture, 0, sizeof(*picture));
    m->n++;
    return 0;
}

static int take_one(const struct gn_program *program, struct gn_source *source, int full_scale16,
                    struct gn_calibrate_mean *m, struct sums *s, struct gn_error *out_error)
{
    struct gn_capture capture;
    struct gn_image_file picture = {.kind = GN_IMAGE_LINEAR};
    int full_scale = 255;
    int got = gn_calibrate_wait(program, source, &capture, out_error);
    if (got <= 0)
        return got < 0 ? got : -EINTR;
    int err = gn_calibrate_decode(&capture, &picture, &full_scale, out_error);
    if (!err) {
        m->full_scale =
            full_scale16 > 0 && picture.kind == GN_IMAGE_CODES16 ? full_scale16 : full_scale;
        m->bits = capture.bits > 0 ? capture.bits : (int)lround(log2(m->full_scale + 1.0));
        err = add(m, s, &picture, out_error);
    }
    gn_image_file_finish(&picture);
    return err;
}

int gn_calibrate_mean_take(const struct gn_program *program, struct gn_source *source, int n,
                           int full_scale16, struct gn_calibrate_mean *out,
                           struct gn_error *out_error)
{
    struct sums s = {0};
    int err = 0;
    memset(out, 0, sizeof(*out));
    while (!err && out->n < n)
        err = take_one(program, source, full_scale16, out, &s, out_error);
    if (err == -EINTR)
        gn_error_set(out_error, err, "%d of %d pictures came", out->n, n);
    if (err) {
        gn_calibrate_mean_finish(out);
        return err;
    }
    out->noise = n > 1 ? sqrt(s.squares / (2.0 * (n - 1) * (double)count_values(out))) : 0;
    out->unsteadiness = s.level[1] - s.level[0];
    return 0;
}

int gn_calibrate_mean_get_codes(const struct gn_calibrate_mean *mean, bool is_8_bit,
                                struct gn_image_file *out, int *out_full_scale)
{
    struct gn_image_file picture = {.kind = GN_IMAGE_CODES16};
    bool is_8 = is_8_bit && mean->last.kind == GN_IMAGE_CODES8;
    uint32_t n = (uint32_t)mean->n, finer = is_8 ? 1 : 65535 / (uint32_t)mean->full_scale;
    int err = is_8 ? gn_image8_init(&picture.codes8, mean->width, mean->height, mean->channels)
                   : gn_image16_init(&picture.codes16, mean->width, mean->height, mean->channels);
    if (err)
        return err;
    for (size_t i = 0; i < count_values(mean); i++) {
        uint32_t code = (uint32_t)(((uint64_t)mean->sums[i] * finer + n / 2) / n);
        if (is_8)
            picture.codes8.data[i] = (uint8_t)code;
        else
            picture.codes16.data[i] = (uint16_t)code;
    }
    picture.kind = is_8 ? GN_IMAGE_CODES8 : GN_IMAGE_CODES16;
    *out = picture;
    *out_full_scale = mean->full_scale * (int)finer;
    return 0;
}

int gn_calibrate_mean_get_floats(const struct gn_calibrate_mean *mean, struct gn_image *out)
{
    int err = gn_image_init(out, mean->width, mean->height, mean->channels < 3 ? 1 : 3);
    for (size_t i = 0; !err && i < (size_t)mean->width * (size_t)mean->height; i++)
        for (int c = 0; c < out->channels; c++) {
            uint32_t sum = mean->sums[i * (size_t)mean->channels + (size_t)c];
            out->data[i * (size_t)out->channels + (size_t)c] =
                (float)(sum / ((double)mean->n * mean->full_scale));
        }
    return err;
}

void gn_calibrate_mean_describe(const struct gn_calibrate_mean *mean, double *out_span,
                                double *out_clipped)
{
    enum { MOST = 4096 };
    double sample[MOST], clipped = 0;
    size_t n = 0, stride = 1 + count_values(mean) / MOST;
    for (size_t i = 0; i < count_values(mean); i += stride) {
        sample[n++] = mean->sums[i] / ((double)mean->n * mean->full_scale);
        clipped += sample[n - 1] >= BRIGHT_RAIL;
    }
    qsort(sample, n, sizeof(*sample), gn_compare_doubles);
    *out_span = sample[n - 1 - n / 100] - sample[n / 100];
    *out_clipped = clipped / (double)n;
}

void gn_calibrate_mean_finish(struct gn_calibrate_mean *mean)
{
    if (!mean)
        return;
    gn_image_file_finish(&mean->last);
    free(mean->sums);
    memset(mean, 0, sizeof(*mean));
}
