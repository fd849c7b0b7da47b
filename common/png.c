/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/png.h"

#include <errno.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include <png.h>

#include "common/file.h"

/*
 * All state of one call, so that libpng's longjmp finds no changed local variable. libpng leaves
 * its functions only by longjmp to `jump`, from functions that hold nothing else.
 */
struct job {
    png_structp png;
    png_infop info;
    jmp_buf jump;
    char message[128];
    int code;            // of the failure, 0: -EINVAL
    const uint8_t *data; // reading
    size_t size;
    size_t at;
    bool is_narrow; // 16 bits become 8
    struct gn_png pixels;
    uint8_t *out; // writing; owned
    size_t out_size;
    size_t out_capacity;
};

bool gn_png_is_png(const void *data, size_t size)
{
    return size >= 8 && png_sig_cmp(data, 0, 8) == 0;
}

void gn_png_finish(struct gn_png *png)
{
    gn_image8_finish(&png->codes8);
    gn_image16_finish(&png->codes16);
}

static void on_error(png_structp png, png_const_charp message)
{
    struct job *job = png_get_error_ptr(png);
    strncpy(job->message, message, sizeof(job->message) - 1);
    longjmp(job->jump, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message; // of metadata that we do not use
}

static void on_read(png_structp png, png_bytep out, size_t n)
{
    struct job *job = png_get_io_ptr(png);
    if (n > job->size - job->at)
        png_error(png, "it ends too early");
    memcpy(out, job->data + job->at, n);
    job->at += n;
}

static void on_write(png_structp png, png_bytep data, size_t n)
{
    struct job *job = png_get_io_ptr(png);
    if (n > job->out_capacity - job->out_size) {
        size_t capacity = (job->out_capacity + n) * 2;
        uint8_t *out = realloc(job->out, capacity);
        if (!out) {
            job->code = -ENOMEM;
            png_error(png, "out of memory");
        }
        job->out = out;
        job->out_capacity = capacity;
    }
    memcpy(job->out + job->out_size, data, n);
    job->out_size += n;
}

static void on_flush(png_structp png)
{
    (void)png;
}

/* Asks libpng for what gn_png promises; returns the channels of the result. */
static int choose_transforms(struct job *job, int depth, int color)
{
    if (depth == 16 && !job->is_narrow) {
        png_set_strip_alpha(job->png);
        png_set_swap(job->png); // big-endian in the file
        return color & PNG_COLOR_MASK_COLOR ? 3 : 1;
    }
    if (depth == 16)
        png_set_scale_16(job->png);
    bool has_alpha =
        (color & PNG_COLOR_MASK_ALPHA) || png_get_valid(job->png, job->info, PNG_INFO_tRNS);
    png_set_expand(job->png);
    if (has_alpha && !(color & PNG_COLOR_MASK_COLOR))
        png_set_gray_to_rgb(job->png);
    return has_alpha ? 4 : color & PNG_COLOR_MASK_COLOR ? 3 : 1;
}

static void read_pixels(struct job *job)
{
    png_uint_32 width, height;
    int depth, color, interlace;
    png_set_user_limits(job->png, GN_IMAGE_MAX_SIDE, GN_IMAGE_MAX_SIDE);
    png_set_chunk_malloc_max(job->png, 1 << 22);
    png_set_chunk_cache_max(job->png, 64);
    png_set_read_fn(job->png, job, on_read);
    png_read_info(job->png, job->info);
    png_get_IHDR(job->png, job->info, &width, &height, &depth, &color, &interlace, NULL, NULL);
    /* Deflate makes at most 1032 bytes of one. */
    uint64_t n_bits =
        (uint64_t)width * height * (unsigned)depth * png_get_channels(job->png, job->info);
    if (n_bits / 8 / 1032 > job->size)
        png_error(job->png, "it is too short for its size in pixels");
    int n_passes = png_set_interlace_handling(job->png);
    int channels = choose_transforms(job, depth, color);
    png_read_update_info(job->png, job->info);
    bool is_wide = depth == 16 && !job->is_narrow;
    int r = is_wide ? gn_image16_init(&job->pixels.codes16, (int)width, (int)height, channels)
                    : gn_image8_init(&job->pixels.codes8, (int)width, (int)height, channels);
    job->code = r;
    if (r)
        png_error(job->png, r == -ENOMEM ? "out of memory" : "more than 67108864 pixels");
    size_t row_bytes = (size_t)width * (size_t)channels * (is_wide ? 2 : 1);
    if (png_get_rowbytes(job->png, job->info) != row_bytes)
        png_error(job->png, "unexpected layout");
    uint8_t *pixels = is_wide ? (uint8_t *)job->pixels.codes16.data : job->pixels.codes8.data;
    for (int pass = 0; pass < n_passes; pass++)
        for (size_t y = 0; y < height; y++)
            png_read_row(job->png, pixels + y * row_bytes, NULL);
    png_read_end(job->png, NULL);
}

static int run_read(struct job *job)
{
    if (setjmp(job->jump))
        return job->code ? job->code : -EINVAL;
    job->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, job, on_error, on_warning);
    job->info = job->png ? png_create_info_struct(job->png) : NULL;
    if (!job->info)
        return -ENOMEM;
    read_pixels(job);
    return 0;
}

static int read_memory(const void *data, size_t size, bool is_narrow, struct gn_png *out_png,
                       struct gn_error *out_error)
{
    struct job job = {
        .data = data, .size = size, .is_narrow = is_narrow, .message = "out of memory"};
    *out_png = (struct gn_png){0};
    int r = run_read(&job);
    png_destroy_read_struct(&job.png, &job.info, NULL);
    if (r) {
        gn_png_finish(&job.pixels);
        return gn_error_set(out_error, r, "bad PNG picture: %s", job.message);
    }
    *out_png = job.pixels;
    return 0;
}

int gn_png_read_memory(const void *data, size_t size, struct gn_png *out_png,
                       struct gn_error *out_error)
{
    return read_memory(data, size, false, out_png, out_error);
}

int gn_png_read_memory8(const void *data, size_t size, struct gn_image8 *out_image,
                        struct gn_error *out_error)
{
    struct gn_png png;
    int r = read_memory(data, size, true, &png, out_error);
    *out_image = png.codes8;
    return r;
}

static int run_write(struct job *job, const uint8_t *pixels, int width, int height, int channels,
                     int depth, int level)
{
    if (setjmp(job->jump))
        return job->code ? job->code : -EINVAL;
    job->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, job, on_error, on_warning);
    job->info = job->png ? png_create_info_struct(job->png) : NULL;
    if (!job->info)
        return -ENOMEM;
    png_set_write_fn(job->png, job, on_write, on_flush);
    png_set_user_limits(job->png, GN_IMAGE_MAX_SIDE, GN_IMAGE_MAX_SIDE);
    png_set_compression_level(job->png, level);
    int color = channels == 1   ? PNG_COLOR_TYPE_GRAY
                : channels == 3 ? PNG_COLOR_TYPE_RGB
                                : PNG_COLOR_TYPE_RGBA;
    png_set_IHDR(job->png, job->info, (png_uint_32)width, (png_uint_32)height, depth, color,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(job->png, job->info);
    if (depth == 16)
        png_set_swap(job->png);
    size_t row_bytes = (size_t)width * (size_t)channels * (size_t)depth / 8;
    for (size_t y = 0; y < (size_t)height; y++)
        png_write_row(job->png, pixels + y * row_bytes);
    png_write_end(job->png, job->info);
    return 0;
}

static int write_memory(const uint8_t *pixels, int width, int height, int channels, int depth,
                        int level, uint8_t **out_data, size_t *out_size, struct gn_error *out_error)
{
    if (channels < 1 || channels == 2 || channels > (depth == 16 ? 3 : 4) || level < 0 || level > 9)
        return gn_error_set(out_error, -EINVAL,
                            "cannot write a PNG of %d channels of %d bits at level %d", channels,
                            depth, level);
    struct job job = {.message = "out of memory"};
    int r = run_write(&job, pixels, width, height, channels, depth, level);
    png_destroy_write_struct(&job.png, &job.info);
    if (r) {
        free(job.out);
        return gn_error_set(out_error, r, "cannot write a PNG: %s", job.message);
    }
    *out_data = job.out;
    *out_size = job.out_size;
    return 0;
}

int gn_png_write_memory(const struct gn_image8 *image, int level, uint8_t **out_data,
                        size_t *out_size, struct gn_error *out_error)
{
    return write_memory(image->data, image->width, image->height, image->channels, 8, level,
                        out_data, out_size, out_error);
}

static int write_file(const char *path, const uint8_t *pixels, int width, int height, int channels,
                      int depth, struct gn_error *out_error)
{
    uint8_t *data = NULL;
    size_t size = 0;
    int r = write_memory(pixels, width, height, channels, depth, 6, &data, &size, out_error);
    if (!r)
        r = gn_file_write(path, data, size, out_error);
    free(data);
    return r;
}

int gn_png_write_file(const char *path, const struct gn_image8 *image, struct gn_error *out_error)
{
    return write_file(path, image->data, image->width, image->height, image->channels, 8,
                      out_error);
}

int gn_png_write_file16(const char *path, const struct gn_image16 *image,
                        struct gn_error *out_error)
{
    return write_file(path, (const uint8_t *)image->data, image->width, image->height,
                      image->channels, 16, out_error);
}
