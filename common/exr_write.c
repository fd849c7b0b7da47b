/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <string.h>

#include "common/exr.h"
#include "common/exr_private.h"
#include "common/file.h"

static int64_t write_stream(exr_const_context_t context, void *user_data, const void *buffer,
                            uint64_t n, uint64_t offset, exr_stream_error_func_ptr_t error)
{
    struct gn_exr_stream *stream = user_data;
    int r = gn_file_writer_put(stream->writer, buffer, n, offset);
    if (r) {
        error(context, EXR_ERR_WRITE_IO, "%s", strerror(-r));
        return -1;
    }
    return (int64_t)n;
}

static exr_result_t write_header(exr_context_t context, int width, int height,
                                 const struct gn_exr_channel *channels, int n_channels)
{
    exr_result_t code = exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, NULL);
    if (!code)
        code = exr_initialize_required_attr_simple(context, 0, width, height, EXR_COMPRESSION_ZIP);
    for (int i = 0; i < n_channels && !code; i++)
        code = exr_add_channel(context, 0, channels[i].name,
                               channels[i].is_half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT,
                               EXR_PERCEPTUALLY_LINEAR, 1, 1);
    return code ? code : exr_write_header(context);
}

/* Points the pipeline's channels at the pixels of its chunk. */
static void aim(exr_encode_pipeline_t *pipeline, int width, const struct gn_exr_channel *channels,
                int n_channels)
{
    size_t first = (size_t)pipeline->chunk.start_y * (size_t)width;
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        for (int c = 0; c < n_channels; c++) {
            if (strcmp(channel->channel_name, channels[c].name) != 0)
                continue;
            channel->encode_from_ptr =
                (const uint8_t *)(channels[c].data + first * (size_t)channels[c].stride);
            channel->user_bytes_per_element = sizeof(float);
            channel->user_data_type = EXR_PIXEL_FLOAT;
            channel->user_pixel_stride = (int32_t)sizeof(float) * channels[c].stride;
            channel->user_line_stride = channel->user_pixel_stride * width;
        }
    }
}

static exr_result_t write_chunks(exr_context_t context, int width, int height,
                                 const struct gn_exr_channel *channels, int n_channels)
{
    int32_t step = 0;
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_result_t code = exr_get_scanlines_per_chunk(context, 0, &step);
    for (int y = 0; !code && y < height; y += step) {
        exr_chunk_info_t chunk = {0};
        code = exr_write_scanline_chunk_info(context, 0, y, &chunk);
        if (!code)
            code = y == 0 ? exr_encoding_initialize(context, 0, &chunk, &pipeline)
                          : exr_encoding_update(context, 0, &chunk, &pipeline);
        if (code)
            break;
        aim(&pipeline, width, channels, n_channels);
        if (y == 0)
            code = exr_encoding_choose_default_routines(context, 0, &pipeline);
        if (!code)
            code = exr_encoding_run(context, 0, &pipeline);
    }
    exr_encoding_destroy(context, &pipeline);
    return code;
}

static const char *check(int width, int height, const struct gn_exr_channel *channels,
                         int n_channels)
{
    if (width < 1 || height < 1 || width > GN_IMAGE_MAX_SIDE || height > GN_IMAGE_MAX_SIDE ||
        (int64_t)width * height > GN_IMAGE_MAX_PIXELS)
        return "sides must lie in [1, 16384] px, pixels in [1, 67108864]";
    if (n_channels < 1 || n_channels > 64)
        return "1 to 64 channels are written";
    for (int i = 0; i < n_channels; i++) {
        size_t n = strlen(channels[i].name);
        if (n < 1 || n > 31 || channels[i].stride < 1 || channels[i].stride > 64)
            return "channel names have 1 to 31 bytes, strides are 1 to 64";
        for (int j = 0; j < i; j++)
            if (strcmp(channels[i].name, channels[j].name) == 0)
                return "two channels have one name";
    }
    return NULL;
}

int gn_exr_write_file(const char *path, int width, int height,
                      const struct gn_exr_channel *channels, int n_channels,
                      struct gn_error *out_error)
{
    const char *reason = check(width, height, channels, n_channels);
    if (reason)
        return gn_error_set(out_error, -EINVAL, "cannot write %s: %s", path, reason);
    struct gn_file_writer writer;
    int r = gn_file_writer_open(&writer, path, out_error);
    if (r)
        return r;
    struct gn_exr_stream stream = {.writer = &writer};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = gn_exr_keep_message;
    init.user_data = &stream;
    init.write_fn = write_stream;
    exr_context_t context = NULL;
    exr_result_t code = exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (!code)
        code = write_header(context, width, height, channels, n_channels);
    if (!code)
        code = write_chunks(context, width, height, channels, n_channels);
    exr_result_t end = exr_finish(&context); // writes the table of chunks
    if (code || end) {
        gn_file_writer_abort(&writer);
        struct gn_error doing;
        gn_error_set(&doing, 0, "cannot write %s", path);
        return gn_exr_set_error(&stream, code ? code : end, doing.text, out_error);
    }
    return gn_file_writer_commit(&writer, out_error);
}
