/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/image_file.h"

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "common/exr.h"
#include "common/file.h"
#include "common/hdr.h"
#include "common/jpeg.h"
#include "common/png.h"

static const size_t max_file_bytes = (size_t)1 << 30;

void gn_image_file_finish(struct gn_image_file *file)
{
    gn_image_finish(&file->linear);
    gn_image8_finish(&file->codes8);
    gn_image16_finish(&file->codes16);
    *file = (struct gn_image_file){0};
}

static int read_png(const void *data, size_t size, struct gn_image_file *file,
                    struct gn_error *error)
{
    struct gn_png png;
    int r = gn_png_read_memory(data, size, &png, error);
    file->kind = png.codes16.data ? GN_IMAGE_CODES16 : GN_IMAGE_CODES8;
    file->codes8 = png.codes8;
    file->codes16 = png.codes16;
    return r;
}

static int read_jpeg(const void *data, size_t size, struct gn_image_file *file,
                     struct gn_error *error)
{
    struct gn_jpeg *jpeg;
    int width, height, channels, r = gn_jpeg_create(&jpeg);
    if (r)
        return gn_error_set(error, r, "JPEG picture: out of memory");
    file->kind = GN_IMAGE_CODES8;
    r = gn_jpeg_get_size(jpeg, data, size, &width, &height, &channels, error);
    if (!r) {
        r = gn_image8_init(&file->codes8, width, height, channels);
        if (r)
            gn_error_set(error, r, "JPEG picture: out of memory");
    }
    if (!r)
        r = gn_jpeg_decode(jpeg, data, size, &file->codes8, error);
    gn_jpeg_destroy(&jpeg);
    return r;
}

int gn_image_read_file(const char *path, struct gn_image_file *out_file, struct gn_error *out_error)
{
    *out_file = (struct gn_image_file){0};
    uint8_t *data = NULL;
    size_t size = 0;
    int r = gn_file_read(path, max_file_bytes, &data, &size, out_error);
    if (r)
        return r;
    struct gn_error inner = {0};
    if (gn_exr_is_exr(data, size)) {
        free(data); // gn_exr_read_file takes it up again: DWA needs the name
        return gn_exr_read_file(path, &out_file->linear, &out_file->is_saturated, out_error);
    }
    if (gn_png_is_png(data, size))
        r = read_png(data, size, out_file, &inner);
    else if (gn_jpeg_is_jpeg(data, size))
        r = read_jpeg(data, size, out_file, &inner);
    else if (gn_hdr_is_hdr(data, size))
        r = gn_hdr_read_memory(data, size, &out_file->linear, &inner);
    else
        r = gn_error_set(&inner, -EINVAL,
                         "not a picture we know (EXR, Radiance .hdr, PNG, JPEG), by its content");
    free(data);
    if (r) {
        gn_image_file_finish(out_file);
        gn_error_set(out_error, r, "%s: %s", path, inner.text);
    }
    return r;
}

int gn_image_file_to_float(const struct gn_image_file *file, int full_scale16,
                           struct gn_image *out_image)
{
    const struct gn_image *f = &file->linear;
    const struct gn_image8 *c8 = &file->codes8;
    const struct gn_image16 *c16 = &file->codes16;
    int width = f->data ? f->width : c8->data ? c8->width : c16->width;
    int height = f->data ? f->height : c8->data ? c8->height : c16->height;
    int channels = f->data ? f->channels : c8->data ? c8->channels : c16->channels;
    int n_kept = channels >= 3 ? 3 : 1;
    int r = gn_image_init(out_image, width, height, n_kept);
    if (r)
        return r;
    size_t n = (size_t)width * (size_t)height;
    float full16 = (float)(full_scale16 > 0 ? full_scale16 : 65535);
    float *out = out_image->data;
    for (size_t i = 0; i < n; i++) {
        for (int c = 0; c < n_kept; c++) {
            size_t from = i * (size_t)channels + (size_t)c;
            *out++ = f->data    ? f->data[from]
                     : c8->data ? (float)c8->data[from] / 255.0f
                                : (float)c16->data[from] / full16;
        }
    }
    return 0;
}
