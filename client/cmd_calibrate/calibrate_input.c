/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_input.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/compare.h"
#include "common/file.h"
#include "common/image_file.h"

#define MAX_NUMBERS_BYTES ((size_t)1 << 20)

/* A mosaic's squares of four as pixels; the greens' mean. */
static int bin_mosaic(const char *bayer, struct gn_image *image)
{
    struct gn_image binned;
    int err = gn_image_init(&binned, image->width / 2, image->height / 2, 3);
    if (err)
        return err;
    for (int y = 0; y < binned.height; y++)
        for (int x = 0; x < binned.width; x++)
            for (int i = 0; i < 4; i++) {
                int c = bayer[i] == 'r' ? 0 : bayer[i] == 'g' ? 1 : 2;
                float code = *gn_image_at(image, 2 * x + (i & 1), 2 * y + (i >> 1));
                gn_image_at(&binned, x, y)[c] += c == 1 ? code / 2 : code;
            }
    gn_image_finish(image);
    *image = binned;
    return 0;
}

int gn_calibrate_read(const char *path, const struct gn_calibrate_format *format,
                      struct gn_image *out_image, double *out_code_step, struct gn_error *out_error)
{
    struct gn_image_file file = {.kind = GN_IMAGE_LINEAR};
    int err = gn_image_read_file(path, &file, out_error);
    if (!err)
        err = gn_calibrate_convert(path, &file, format, out_image, out_code_step, out_error);
    gn_image_file_finish(&file);
    return err;
}

int gn_calibrate_convert(const char *name, const struct gn_image_file *file,
                         const struct gn_calibrate_format *format, struct gn_image *out_image,
                         double *out_code_step, struct gn_error *out_error)
{
    struct gn_image image = {0};
    int err = gn_image_file_to_float(file, format->full_scale16, &image);
    bool is_linear = file->kind == GN_IMAGE_LINEAR;
    int full_scale = format->full_scale16 > 0 ? format->full_scale16 : 65535;
    double step = is_linear ? 0 : 1.0 / (file->kind == GN_IMAGE_CODES8 ? 255 : full_scale);
    if (err)
        return gn_error_set(out_error, err, "%s: out of memory", name);
    if (format->bayer && (image.channels != 1 || image.width < 2 || image.height < 2))
        err = gn_error_set(out_error, -EINVAL,
                           "%s: --bayer is for gray pictures of at least 2 x 2 pixels", name);
    else if (format->bayer && bin_mosaic(format->bayer, &image) < 0)
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", name);
    for (long i = 0; !err && i < (long)image.width * image.height * image.channels; i++)
        if (!is_linear && image.data[i] > 1)
            err =
                gn_error_set(out_error, -EINVAL, "%s: a code of %.0f is above the full scale of %d",
                             name, (double)image.data[i] * full_scale, full_scale);
    if (err) {
        gn_image_finish(&image);
        return err;
    }
    if (out_code_step)
        *out_code_step = step;
    *out_image = image;
    return 0;
}

/* The 1st and 99th percentile of some thousands of values. */
static int find_percentiles(const struct gn_image *image, float *out_low, float *out_high)
{
    long n = (long)image->width * image->height * image->channels, stride = 1 + n / 65536, m = 0;
    float *values = malloc((size_t)(n / stride + 1) * sizeof(*values));
    if (!values)
        return -ENOMEM;
    for (long i = 0; i < n; i += stride)
        values[m++] = isfinite(image->data[i]) ? image->data[i] : 0;
    qsort(values, (size_t)m, sizeof(*values), gn_compare_floats);
    *out_low = values[m / 100];
    *out_high = values[m - 1 - m / 100];
    free(values);
    return 0;
}

static int stretch(const struct gn_image *image, int channels, struct gn_image8 *out_image)
{
    float low, high;
    if (find_percentiles(image, &low, &high) < 0 ||
        gn_image8_init(out_image, image->width, image->height, channels) < 0)
        return -ENOMEM;
    float span = high > low ? high - low : 1;
    long n = (long)image->width * image->height;
    for (long i = 0; i < n; i++) {
        const float *p = image->data + i * image->channels;
        for (int c = 0; c < channels; c++) {
            float v = image->channels == 1 ? p[0] : channels == 3 ? p[c] : (p[0] + p[1] + p[2]) / 3;
            float t = (v - low) / span;
            out_image->data[i * channels + c] = (uint8_t)(t > 0 ? (t < 1 ? 255 * t : 255) : 0);
        }
    }
    return 0;
}

int gn_calibrate_stretch(const struct gn_image *image, struct gn_image8 *out_image)
{
    return stretch(image, 3, out_image);
}

int gn_calibrate_stretch_gray(const struct gn_image *image, struct gn_image8 *out_image)
{
    return stretch(image, 1, out_image);
}

bool gn_calibrate_take_number(const char **at, double *out)
{
    char *end = NULL;
    double value = strtod(*at, &end);
    if (end == *at)
        return false;
    *at = end;
    if (*end == '/') {
        double below = strtod(end + 1, &end);
        if (end == *at + 1 || below == 0)
            return false;
        value /= below;
        *at = end;
    }
    *out = value;
    return isfinite(value);
}

int gn_calibrate_read_numbers(const char *option, const char *text, int n, int capacity,
                              double *out_values, struct gn_error *out_error)
{
    char *list = NULL;
    size_t size = 0;
    int count = 0;
    if (access(text, R_OK) == 0) {
        int err = gn_file_read_text(text, MAX_NUMBERS_BYTES, &list, &size, out_error);
        if (err)
            return err;
    } else if (!(list = strdup(text))) {
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    for (const char *at = list; *at;) {
        if (*at == '#') {
            at += strcspn(at, "\n");
        } else if (isspace((unsigned char)*at) || *at == ',') {
            at++;
        } else if (count >= capacity || !gn_calibrate_take_number(&at, &out_values[count])) {
            count = gn_error_set(out_error, -EINVAL,
                                 "--%s: number %d is none, or one too many; right would be up to "
                                 "%d numbers without a unit, as 0.5,1/60,2, or a file with them",
                                 option, count + 1, n > 0 ? n : capacity);
            break;
        } else {
            count++;
        }
    }
    free(list);
    if (count >= 0 && n > 0 && count != n)
        return gn_error_set(out_error, -EINVAL, "--%s: %d numbers for %d pictures", option, count,
                            n);
    return count;
}

int gn_calibrate_make_gray(const struct gn_image *image, struct gn_image *out_image)
{
    int err = gn_image_init(out_image, image->width, image->height, 1);
    for (long i = 0; !err && i < (long)image->width * image->height; i++) {
        const float *p = image->data + i * image->channels;
        out_image->data[i] = image->channels == 3 ? (p[0] + p[1] + p[2]) / 3 : p[0];
    }
    return err;
}

int gn_calibrate_parse_board(const char *text, struct gn_board *board, struct gn_error *out_error)
{
    char rest;
    if (sscanf(text, "%3dx%3d%c", &board->columns, &board->rows, &rest) != 2)
        return gn_error_set(out_error, -EINVAL,
                            "--board %s: right would be squares as COLUMNSxROWS, for example 10x7",
                            text);
    return 0;
}
