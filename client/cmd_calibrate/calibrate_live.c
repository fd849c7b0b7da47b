/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_live.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "client/capture/file.h"
#include "client/capture/video.h"
#include "client/cmd_calibrate/calibrate_mean.h"
#include "common/jpeg.h"
#include "common/png.h"

static bool has(const struct gn_options *options, const char *key)
{
    return gn_options_is_set(options, NULL, NULL, key);
}

bool gn_calibrate_is_live(const struct gn_options *options)
{
    return has(options, "video") || gn_live_count_asked(options) > 0;
}

const char *gn_calibrate_find_misuse(const struct gn_options *options)
{
    const char *misuse = gn_live_find_misuse(options);
    if (!misuse &&
        has(options, "files") + has(options, "video") + gn_live_count_asked(options) != 1)
        misuse = "give --files PATTERN, --video FILE or a camera (--gige ID, --v4l2 DEVICE), one "
                 "of them";
    return misuse;
}

int gn_calibrate_open(const struct gn_options *options, const struct gn_live_options *wanted,
                      struct gn_source **out_source, struct gn_error *out_error)
{
    static const struct gn_video_options all_bits = {.keeps_bits = true};
    if (has(options, "video"))
        return gn_video_source_open(gn_options_get_string(options, NULL, NULL, "video"), &all_bits,
                                    out_source, out_error);
    return gn_live_open(options, wanted, out_source, out_error);
}

static int decode(const struct gn_capture *capture, struct gn_image8 *out,
                  struct gn_error *out_error)
{
    struct gn_jpeg *jpeg = NULL;
    int width, height, channels;
    int err = gn_jpeg_create(&jpeg);
    if (err)
        return gn_error_set(out_error, err, "out of memory");
    err = gn_jpeg_get_size(jpeg, capture->data, capture->data_bytes, &width, &height, &channels,
                           out_error);
    if (!err && gn_image8_init(out, width, height, channels) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err)
        err = gn_jpeg_decode(jpeg, capture->data, capture->data_bytes, out, out_error);
    gn_jpeg_destroy(&jpeg);
    return err;
}

int gn_calibrate_decode(const struct gn_capture *capture, struct gn_image_file *out,
                        int *out_full_scale, struct gn_error *out_error)
{
    memset(out, 0, sizeof(*out));
    const size_t values = (size_t)capture->width * (size_t)capture->height;
    bool is_12 = false;
    int channels = 3, err = 0;
    switch (capture->format) {
    case GN_CAPTURE_JPEG:
        out->kind = GN_IMAGE_CODES8;
        return decode(capture, &out->codes8, out_error);
    case GN_CAPTURE_RGB_F32:
        return gn_error_set(out_error, -EINVAL, "%s holds light, not a camera's codes",
                            capture->name);
    case GN_CAPTURE_RGB8:
        out->kind = GN_IMAGE_CODES8;
        err = gn_image8_init(&out->codes8, capture->width, capture->height, 3);
        if (!err)
            memcpy(out->codes8.data, capture->data, 3 * values);
        break;
    case GN_CAPTURE_MONO12:
    case GN_CAPTURE_MONO16:
        channels = 1; // fallthrough
    case GN_CAPTURE_RGB12:
    case GN_CAPTURE_RGB16:
        is_12 = capture->format == GN_CAPTURE_MONO12 || capture->format == GN_CAPTURE_RGB12;
        *out_full_scale = is_12 ? 4095 : 65535;
        out->kind = GN_IMAGE_CODES16;
        err = gn_image16_init(&out->codes16, capture->width, capture->height, channels);
        if (!err)
            memcpy(out->codes16.data, capture->data, 2 * values * (size_t)channels);
        break;
    }
    return err ? gn_error_set(out_error, err, "out of memory") : 0;
}

int gn_calibrate_wait(const struct gn_program *program, struct gn_source *source,
                      struct gn_capture *out, struct gn_error *out_error)
{
    int got = -EAGAIN;
    while (got == -EAGAIN) {
        if (gn_cmd_is_interrupted())
            return 0;
        got = gn_source_read(source, out, out_error);
        if (got == -EAGAIN && out_error->text[0])
            gn_cmd_fail(program, out_error->text);
    }
    return got;
}

int gn_calibrate_take(const struct gn_program *program, struct gn_source *source,
                      struct gn_image_file *out, int *out_full_scale, struct gn_error *out_error)
{
    struct gn_capture capture;
    memset(out, 0, sizeof(*out));
    int got = gn_calibrate_wait(program, source, &capture, out_error);
    if (got != 1)
        return got;
    int err = gn_calibrate_decode(&capture, out, out_full_scale, out_error);
    if (err)
        gn_image_file_finish(out);
    return err ? err : 1;
}

int gn_calibrate_take_mean(const struct gn_program *program, struct gn_source *source, int n,
                           int full_scale16, struct gn_image *out_image, double *out_code_step,
                           struct gn_error *out_error)
{
    struct gn_calibrate_mean mean;
    int err = gn_calibrate_mean_take(program, source, n, full_scale16, &mean, out_error);
    if (err)
        return err;
    *out_code_step = 1.0 / mean.full_scale;
    if (gn_calibrate_mean_get_floats(&mean, out_image) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    gn_calibrate_mean_finish(&mean);
    return err;
}

int gn_calibrate_make_folder(const char *option, const char *path, struct gn_error *out_error)
{
    struct gn_file_list list = {0};
    struct gn_error nothing = {0};
    if (mkdir(path, 0777) == 0)
        return 0;
    if (errno != EEXIST)
        return gn_error_set(out_error, -errno, "--%s %s: %s", option, path, strerror(errno));
    int err = gn_file_list_find(path, 1, &list, &nothing);
    gn_file_list_finish(&list);
    if (err)
        return 0;
    return gn_error_set(out_error, -EEXIST,
                        "--%s %s: pictures are there already; right would be a new folder", option,
                        path);
}

int gn_calibrate_write(const char *path, const struct gn_image_file *picture,
                       struct gn_error *out_error)
{
    return picture->kind == GN_IMAGE_CODES16
               ? gn_png_write_file16(path, &picture->codes16, out_error)
               : gn_png_write_file(path, &picture->codes8, out_error);
}
