/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/exr.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/exr_private.h"
#include "common/file.h"
#include "common/half.h"

/* Largest EXR file that is taken, and most decompressed samples of it. */
#define MAX_FILE_BYTES ((size_t)1 << 30)
#define MAX_SAMPLE_BYTES ((uint64_t)1 << 32)
/* Largest single piece of memory OpenEXR may ask for: a chunk of 256 scanlines and more. */
#define MAX_PIECE_BYTES ((size_t)1 << 28)
#define MAX_NAME 64

bool gn_exr_is_exr(const void *data, size_t size)
{
    static const uint8_t magic[4] = {0x76, 0x2f, 0x31, 0x01};
    return size >= sizeof(magic) && memcmp(data, magic, sizeof(magic)) == 0;
}

void gn_exr_keep_message(exr_const_context_t context, exr_result_t code, const char *message)
{
    void *user_data = NULL;
    (void)code;
    if (context && exr_get_user_data(context, &user_data) == EXR_ERR_SUCCESS && user_data) {
        struct gn_exr_stream *stream = user_data;
        if (stream->message.text[0] == '\0')
            gn_error_set(&stream->message, 0, "%s", message);
    }
}

int gn_exr_set_error(const struct gn_exr_stream *stream, exr_result_t code, const char *doing,
                     struct gn_error *out_error)
{
    const char *message =
        stream->message.text[0] ? stream->message.text : exr_get_default_error_message(code);
    return gn_error_set(out_error, code == EXR_ERR_OUT_OF_MEMORY ? -ENOMEM : -EINVAL, "%s: %s",
                        doing, message);
}

static void *allocate_bounded(size_t n_bytes)
{
    return n_bytes <= MAX_PIECE_BYTES ? malloc(n_bytes) : NULL;
}

static int64_t read_stream(exr_const_context_t context, void *user_data, void *buffer, uint64_t n,
                           uint64_t offset, exr_stream_error_func_ptr_t error)
{
    (void)context;
    (void)error;
    const struct gn_exr_stream *stream = user_data;
    if (offset >= stream->size)
        return 0;
    if (n > stream->size - offset)
        n = stream->size - offset;
    memcpy(buffer, stream->data + offset, n);
    return (int64_t)n;
}

static int64_t get_stream_size(exr_const_context_t context, void *user_data)
{
    (void)context;
    return (int64_t)((const struct gn_exr_stream *)user_data)->size;
}

/* A file whose header has been read and checked. */
struct reader {
    struct gn_exr_stream stream;
    exr_context_t context;
    exr_attr_box2i_t window;
    exr_storage_t storage;
    exr_compression_t compression;
    const exr_attr_chlist_t *channels;
    struct gn_exr_info info;
};

static const exr_attr_chlist_entry_t *find_channel(const struct reader *reader, const char *name)
{
    for (int i = 0; i < reader->channels->num_channels; i++)
        if (strcmp(reader->channels->entries[i].name.str, name) == 0)
            return &reader->channels->entries[i];
    return NULL;
}

static int check_size(struct reader *r, struct gn_error *out_error)
{
    int64_t width = (int64_t)r->window.max.x - r->window.min.x + 1;
    int64_t height = (int64_t)r->window.max.y - r->window.min.y + 1;
    if (width < 1 || height < 1 || width > GN_IMAGE_MAX_SIDE || height > GN_IMAGE_MAX_SIDE ||
        width * height > GN_IMAGE_MAX_PIXELS)
        return gn_error_set(out_error, -EINVAL,
                            "EXR picture of %jd x %jd px: sides must lie in [1, %d], pixels in "
                            "[1, %d]",
                            (intmax_t)width, (intmax_t)height, GN_IMAGE_MAX_SIDE,
                            GN_IMAGE_MAX_PIXELS);
    r->info.width = (int)width;
    r->info.height = (int)height;
    uint64_t n_bytes = 0;
    bool is_dwa = r->compression == EXR_COMPRESSION_DWAA || r->compression == EXR_COMPRESSION_DWAB;
    r->info.is_core = !is_dwa;
    for (int i = 0; i < r->channels->num_channels; i++) {
        const exr_attr_chlist_entry_t *c = &r->channels->entries[i];
        uint64_t channel_bytes =
            (uint64_t)(width * height) * (c->pixel_type == EXR_PIXEL_HALF ? 2 : 4);
        if (c->x_sampling != 1 || c->y_sampling != 1)
            r->info.is_core = false;
        if (c->x_sampling > 1)
            channel_bytes /= (uint64_t)c->x_sampling;
        if (c->y_sampling > 1)
            channel_bytes /= (uint64_t)c->y_sampling;
        n_bytes += channel_bytes;
    }
    /* Deflate, the tightest of the codecs, makes at most 1032 bytes of one; before it deflates,
     * PXR24 packs 4 into 3 and DWA 64 into 1. */
    uint64_t ratio = is_dwa                                    ? 64 * 1032
                     : r->compression == EXR_COMPRESSION_PXR24 ? 1032 / 3 * 4
                                                               : 1032;
    if (n_bytes / ratio > r->stream.size)
        return gn_error_set(out_error, -EINVAL, "EXR picture: %jd x %jd px cannot be in %ju bytes",
                            (intmax_t)width, (intmax_t)height, (uintmax_t)r->stream.size);
    if (n_bytes > MAX_SAMPLE_BYTES)
        return gn_error_set(out_error, -EINVAL,
                            "EXR picture of %jd x %jd px with %d channels: more than 4 GiB",
                            (intmax_t)width, (intmax_t)height, r->channels->num_channels);
    return 0;
}

/* Opens and checks the first part; on failure the reader is closed. */
static int open_reader(struct reader *r, const void *data, size_t size, struct gn_error *out_error)
{
    *r = (struct reader){.stream = {.data = data, .size = size}};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = gn_exr_keep_message;
    init.alloc_fn = allocate_bounded;
    init.free_fn = free;
    init.user_data = &r->stream;
    init.read_fn = read_stream;
    init.size_fn = get_stream_size;
    init.max_image_width = init.max_tile_width = GN_IMAGE_MAX_SIDE;
    init.max_image_height = init.max_tile_height = GN_IMAGE_MAX_SIDE;
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;

    int status;
    exr_result_t code = exr_start_read(&r->context, "memory", &init);
    if (!code)
        code = exr_get_storage(r->context, 0, &r->storage);
    if (!code)
        code = exr_get_data_window(r->context, 0, &r->window);
    if (!code)
        code = exr_get_channels(r->context, 0, &r->channels);
    if (!code)
        code = exr_get_compression(r->context, 0, &r->compression);
    if (code) {
        status = gn_exr_set_error(&r->stream, code, "bad EXR picture", out_error);
        goto fail;
    }
    if (r->storage != EXR_STORAGE_SCANLINE && r->storage != EXR_STORAGE_TILED) {
        status = gn_error_set(out_error, -ENOTSUP,
                              "EXR picture: deep data; only scanlines and tiles are read");
        goto fail;
    }
    status = check_size(r, out_error);
    if (status)
        goto fail;
    if (find_channel(r, "R") && find_channel(r, "G") && find_channel(r, "B"))
        r->info.channels = 3;
    else if (find_channel(r, "Y"))
        r->info.channels = find_channel(r, "RY") && find_channel(r, "BY") ? 3 : 1;
    return 0;
fail:
    exr_finish(&r->context);
    return status;
}

/* One channel of the file to one of image's. */
struct target {
    const char *name;
    int channel;
};

/* Points the pipeline's channels at the pixels of its chunk, from (x, y) on. */
static void aim(exr_decode_pipeline_t *pipeline, int x, int y, const struct target *targets,
                int n_targets, struct gn_image *image)
{
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        channel->decode_to_ptr = NULL;
        for (int t = 0; t < n_targets; t++) {
            if (strcmp(channel->channel_name, targets[t].name) != 0)
                continue;
            channel->decode_to_ptr = (uint8_t *)(gn_image_at(image, x, y) + targets[t].channel);
            channel->user_bytes_per_element = sizeof(float);
            channel->user_data_type = EXR_PIXEL_FLOAT;
            channel->user_pixel_stride = (int32_t)sizeof(float) * image->channels;
            channel->user_line_stride = channel->user_pixel_stride * image->width;
        }
    }
}

/* What a picture is decoded with. */
struct job {
    struct reader *reader;
    const struct target *targets;
    int n_targets;
    struct gn_image *image;
    exr_decode_pipeline_t pipeline;
    bool is_running; // the pipeline has begun
};

/* Decodes one chunk to the pixels from (x, y) on. */
static exr_result_t decode_chunk(struct job *job, const exr_chunk_info_t *chunk, int x, int y)
{
    struct reader *r = job->reader;
    if (chunk->unpacked_size > MAX_PIECE_BYTES || chunk->packed_size > r->stream.size)
        return EXR_ERR_CORRUPT_CHUNK;
    if (chunk->width < 1 || chunk->height < 1 || chunk->width > job->image->width - x ||
        chunk->height > job->image->height - y)
        return EXR_ERR_CORRUPT_CHUNK; // never outside the picture, whatever the library says
    exr_result_t code = job->is_running
                            ? exr_decoding_update(r->context, 0, chunk, &job->pipeline)
                            : exr_decoding_initialize(r->context, 0, chunk, &job->pipeline);
    if (code)
        return code;
    aim(&job->pipeline, x, y, job->targets, job->n_targets, job->image);
    if (!job->is_running)
        code = exr_decoding_choose_default_routines(r->context, 0, &job->pipeline);
    job->is_running = true;
    return code ? code : exr_decoding_run(r->context, 0, &job->pipeline);
}

static exr_result_t decode_scanlines(struct job *job)
{
    struct reader *r = job->reader;
    int32_t step = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(r->context, 0, &step);
    if (!code && step < 1)
        code = EXR_ERR_INVALID_ATTR;
    for (int y = 0; !code && y < r->info.height; y += step) {
        exr_chunk_info_t chunk = {0};
        code = exr_read_scanline_chunk_info(r->context, 0, r->window.min.y + y, &chunk);
        if (!code)
            code = decode_chunk(job, &chunk, 0, y);
    }
    return code;
}

static exr_result_t decode_tiles(struct job *job)
{
    struct reader *r = job->reader;
    int32_t width = 0, height = 0;
    exr_result_t code = exr_get_tile_sizes(r->context, 0, 0, 0, &width, &height);
    if (!code && (width < 1 || height < 1))
        code = EXR_ERR_INVALID_ATTR;
    for (int y = 0; !code && y < r->info.height; y += height) {
        for (int x = 0; !code && x < r->info.width; x += width) {
            exr_chunk_info_t chunk = {0};
            code = exr_read_tile_chunk_info(r->context, 0, x / width, y / height, 0, 0, &chunk);
            if (!code)
                code = decode_chunk(job, &chunk, x, y);
        }
    }
    return code;
}

static int decode(struct reader *r, const struct target *targets, int n_targets, int n_channels,
                  struct gn_image *out_image, struct gn_error *out_error)
{
    struct gn_image image;
    int status = gn_image_init(&image, r->info.width, r->info.height, n_channels);
    if (status)
        return gn_error_set(out_error, status, "EXR picture: out of memory");
    struct job job = {.reader = r, .targets = targets, .n_targets = n_targets, .image = &image};
    exr_result_t code =
        r->storage == EXR_STORAGE_TILED ? decode_tiles(&job) : decode_scanlines(&job);
    exr_decoding_destroy(r->context, &job.pipeline);
    if (code) {
        gn_image_finish(&image);
        return gn_exr_set_error(&r->stream, code, "bad EXR picture", out_error);
    }
    *out_image = image;
    return 0;
}

static bool has_saturated_half(const struct reader *r, const struct target *targets, int n_targets,
                               const struct gn_image *image)
{
    size_t n = (size_t)image->width * (size_t)image->height;
    for (int t = 0; t < n_targets; t++) {
        if (find_channel(r, targets[t].name)->pixel_type != EXR_PIXEL_HALF)
            continue;
        for (size_t i = 0; i < n; i++)
            if (fabsf(image->data[i * (size_t)image->channels + (size_t)targets[t].channel]) >=
                GN_HALF_MAX)
                return true;
    }
    return false;
}

/* path is NULL for a picture that is only in memory. */
static int read_default(const void *data, size_t size, const char *path, struct gn_image *out_image,
                        bool *out_saturated, struct gn_error *out_error)
{
    static const struct target rgb[3] = {{"R", 0}, {"G", 1}, {"B", 2}}, luminance[1] = {{"Y", 0}};
    struct reader r;
    int status = open_reader(&r, data, size, out_error);
    if (status)
        return status;
    const struct target *targets = r.info.channels == 3 ? rgb : luminance;
    if (r.info.channels == 0) {
        status =
            gn_error_set(out_error, -EINVAL, "EXR picture: it has neither channels R, G, B nor Y");
    } else if (r.info.is_core) {
        status = decode(&r, targets, r.info.channels, r.info.channels, out_image, out_error);
        if (!status && out_saturated)
            *out_saturated = has_saturated_half(&r, targets, r.info.channels, out_image);
    } else if (path) {
        status = gn_exr_read_by_name(path, &r.info, out_image, out_saturated, out_error);
    } else {
        status = gn_error_set(out_error, -ENOTSUP,
                              "EXR picture: DWA compression and subsampled chroma are read from "
                              "files only, not from a stream; send ZIP or PIZ, full resolution");
    }
    exr_finish(&r.context);
    return status;
}

int gn_exr_get_info(const void *data, size_t size, struct gn_exr_info *out_info,
                    struct gn_error *out_error)
{
    struct reader r;
    int status = open_reader(&r, data, size, out_error);
    if (status)
        return status;
    *out_info = r.info;
    exr_finish(&r.context);
    return 0;
}

int gn_exr_read_memory(const void *data, size_t size, struct gn_image *out_image,
                       bool *out_saturated, struct gn_error *out_error)
{
    return read_default(data, size, NULL, out_image, out_saturated, out_error);
}

/* "what" to "path: what". */
static int add_path(int status, const char *path, struct gn_error *error)
{
    if (!status || !error)
        return status;
    struct gn_error inner = *error;
    return gn_error_set(error, status, "%s: %s", path, inner.text);
}

int gn_exr_read_file(const char *path, struct gn_image *out_image, bool *out_saturated,
                     struct gn_error *out_error)
{
    uint8_t *data = NULL;
    size_t size = 0;
    int status = gn_file_read(path, MAX_FILE_BYTES, &data, &size, out_error);
    if (status)
        return status;
    status = read_default(data, size, path, out_image, out_saturated, out_error);
    free(data);
    return add_path(status, path, out_error);
}

static int read_layer(const void *data, size_t size, const char *layer, const char *letters,
                      struct gn_image *out_image, struct gn_error *out_error)
{
    char names[4][MAX_NAME];
    struct target targets[4];
    int n = (int)strlen(letters);
    struct reader r;
    int status = open_reader(&r, data, size, out_error);
    if (status)
        return status;
    for (int i = 0; i < n && !status; i++) {
        snprintf(names[i], MAX_NAME, "%s%s%c", layer, layer[0] ? "." : "", letters[i]);
        targets[i] = (struct target){names[i], i};
        if (!find_channel(&r, names[i]))
            status = gn_error_set(out_error, -ENOENT, "EXR picture: no channel %s", names[i]);
    }
    if (!status && !r.info.is_core)
        status = gn_error_set(out_error, -ENOTSUP,
                              "EXR picture: layers are not read from DWA or subsampled pictures");
    if (!status)
        status = decode(&r, targets, n, n, out_image, out_error);
    exr_finish(&r.context);
    return status;
}

int gn_exr_read_layer(const char *path, const char *layer, const char *letters,
                      struct gn_image *out_image, struct gn_error *out_error)
{
    uint8_t *data = NULL;
    size_t size = 0, n = strlen(letters);
    if (n < 1 || n > 4 || strlen(layer) > MAX_NAME - 4)
        return gn_error_set(out_error, -EINVAL, "%s: a layer has 1 to 4 letters", path);
    int status = gn_file_read(path, MAX_FILE_BYTES, &data, &size, out_error);
    if (status)
        return status;
    status = read_layer(data, size, layer, letters, out_image, out_error);
    free(data);
    return add_path(status, path, out_error);
}
