/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/video_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include <libavutil/display.h>
#include <libavutil/opt.h>

/**
 * Containers of video. Not those that name other files (playlists, concat, image sequences): a file
 * that is handed over must not make us open another.
 */
#define FORMATS                                                                                    \
    "mov,mp4,matroska,webm,avi,mpegts,mpeg,mpegvideo,m4v,h264,hevc,mjpeg,ivf,yuv4mpegpipe,"        \
    "nut,ogg,flv,asf,dv,mxf,obu"
#define MAX_STREAMS 32
/** Packets in a row that give no picture before the file is given up. */
#define MAX_BARREN_PACKETS 1000

/** The sentence for an error of libav. Returns a negative errno. */
static int set_error(const char *path, const char *what, int err, struct gn_error *out_error)
{
    char text[AV_ERROR_MAX_STRING_SIZE] = "";
    if (err == AVERROR(ENOMEM))
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    av_strerror(err, text, sizeof(text));
    return gn_error_set(out_error, -EBADMSG, "%s: %s: %s", path, what, text);
}

/** Options for the decoders that look into the streams before one is opened. */
static int find_streams(AVFormatContext *format)
{
    AVDictionary *options[MAX_STREAMS] = {0};
    unsigned n = format->nb_streams;
    int err = n <= MAX_STREAMS ? 0 : AVERROR_INVALIDDATA;
    for (unsigned i = 0; !err && i < n; i++) {
        err = av_dict_set_int(&options[i], "max_pixels", GN_VIDEO_MAX_PIXELS, 0);
        if (err >= 0)
            err = av_dict_set(&options[i], "threads", "1", 0);
    }
    if (err >= 0)
        err = avformat_find_stream_info(format, n ? options : NULL);
    for (unsigned i = 0; i < MAX_STREAMS; i++)
        av_dict_free(&options[i]);
    return err < 0 ? err : 0;
}

static int open_format(struct gn_video_file *v, const char *path, struct gn_error *out_error)
{
    struct stat st;
    char url[4200];
    if (stat(path, &st) != 0)
        return gn_error_set(out_error, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode))
        return gn_error_set(out_error, -EINVAL, "%s: no file; --video reads one", path);
    // "file:" keeps a name such as "concat:a" what it is.
    int n = snprintf(url, sizeof(url), "file:%s", path);
    if (n < 0 || (size_t)n >= sizeof(url))
        return gn_error_set(out_error, -ENAMETOOLONG, "%s: %s", path, strerror(ENAMETOOLONG));
    AVDictionary *options = NULL;
    int err = av_dict_set(&options, "protocol_whitelist", "file", 0);
    if (err >= 0)
        err = av_dict_set(&options, "format_whitelist", FORMATS, 0);
    if (err >= 0)
        err = av_dict_set_int(&options, "max_streams", MAX_STREAMS, 0);
    if (err >= 0)
        err = avformat_open_input(&v->format, url, NULL, &options);
    av_dict_free(&options);
    if (err < 0)
        return set_error(path, "no video file that can be read", err, out_error);
    err = find_streams(v->format);
    return err ? set_error(path, "no video in it that can be read", err, out_error) : 0;
}

/** A picture that is shown turned has other intrinsics than it is stored with. */
static int check_rotation(const AVStream *stream, const char *path, struct gn_error *out_error)
{
    size_t bytes = 0;
    const uint8_t *data = av_stream_get_side_data(stream, AV_PKT_DATA_DISPLAYMATRIX, &bytes);
    if (!data || bytes < 9 * sizeof(int32_t))
        return 0;
    int32_t matrix[9];
    memcpy(matrix, data, sizeof(matrix));
    double degrees = av_display_rotation_get(matrix);
    if (degrees > -0.5 && degrees < 0.5)
        return 0;
    return gn_error_set(out_error, -ENOTSUP,
                        "%s: is meant to be shown turned by %.0f degrees, which is not done here; "
                        "turn its pixels first, as ffmpeg does when it copies a file",
                        path, -degrees);
}

static int open_decoder(struct gn_video_file *v, const char *path, struct gn_error *out_error)
{
    const AVCodec *decoder = NULL;
    v->stream = av_find_best_stream(v->format, AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    const AVStream *stream = v->stream >= 0 ? v->format->streams[v->stream] : NULL;
    if (!stream || (stream->disposition & AV_DISPOSITION_ATTACHED_PIC))
        return gn_error_set(out_error, -ENODATA, "%s: no video stream in it that can be decoded",
                            path);
    const AVCodecParameters *p = stream->codecpar;
    if (p->width < 1 || p->height < 1 || p->width > GN_VIDEO_MAX_SIDE ||
        p->height > GN_VIDEO_MAX_SIDE || (int64_t)p->width * p->height > GN_VIDEO_MAX_PIXELS)
        return gn_error_set(out_error, -EFBIG,
                            "%s: is %dx%d; a video has 1 to %d px a side, and "
                            "%d Mi pixels at most",
                            path, p->width, p->height, GN_VIDEO_MAX_SIDE,
                            GN_VIDEO_MAX_PIXELS >> 20);
    int err = check_rotation(stream, path, out_error);
    if (err)
        return err;
    v->packet = av_packet_alloc();
    v->frame = av_frame_alloc();
    v->codec = avcodec_alloc_context3(decoder);
    if (!v->packet || !v->frame || !v->codec)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    err = avcodec_parameters_to_context(v->codec, p);
    v->codec->pkt_timebase = stream->time_base;
    v->codec->max_pixels = GN_VIDEO_MAX_PIXELS;
    v->codec->thread_count = 1;
    v->codec->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
    if (err >= 0)
        err = avcodec_open2(v->codec, decoder, NULL);
    return err < 0 ? set_error(path, "its video cannot be decoded", err, out_error) : 0;
}

int gn_video_file_open(struct gn_video_file *file, const char *path, struct gn_error *out_error)
{
    av_log_set_level(AV_LOG_QUIET); // what is wrong is said in our own sentences, once
    int err = open_format(file, path, out_error);
    if (!err)
        err = open_decoder(file, path, out_error);
    if (err)
        gn_video_file_close(file);
    return err;
}

/** Gives the decoder the next packet of the stream, or the end. Returns 0, or a libav error. */
static int feed_decoder(struct gn_video_file *v)
{
    for (int i = 0; i < MAX_BARREN_PACKETS; i++) {
        int err = av_read_frame(v->format, v->packet);
        if (err == AVERROR_EOF && (!v->format->pb || v->format->pb->error >= 0)) {
            v->is_draining = true;
            return avcodec_send_packet(v->codec, NULL);
        }
        if (err < 0)
            return err == AVERROR_EOF ? v->format->pb->error : err;
        bool is_ours = v->packet->stream_index == v->stream;
        // Demuxers mark what is shorter than it should be.
        if (is_ours && (v->packet->flags & AV_PKT_FLAG_CORRUPT))
            err = AVERROR_INVALIDDATA;
        else if (is_ours)
            err = avcodec_send_packet(v->codec, v->packet);
        av_packet_unref(v->packet);
        if (is_ours || err < 0)
            return err;
    }
    return AVERROR_INVALIDDATA;
}

int gn_video_file_read(struct gn_video_file *file, const char *path, struct gn_error *out_error)
{
    struct gn_video_file *v = file;
    char what[64];
    snprintf(what, sizeof(what), "picture %ld is damaged or cut short", v->n_pictures + 1);
    for (int i = 0; i < MAX_BARREN_PACKETS; i++) {
        int err = avcodec_receive_frame(v->codec, v->frame);
        if (err == AVERROR_EOF)
            return 0;
        if (err == 0 && (v->frame->decode_error_flags || (v->frame->flags & AV_FRAME_FLAG_CORRUPT)))
            err = AVERROR_INVALIDDATA;
        if (err == 0) {
            v->n_pictures++;
            return 1;
        }
        if (err != AVERROR(EAGAIN) || v->is_draining)
            return set_error(path, what, err, out_error);
        err = feed_decoder(v);
        if (err < 0)
            return set_error(path, what, err, out_error);
    }
    return set_error(path, what, AVERROR_INVALIDDATA, out_error);
}

void gn_video_file_close(struct gn_video_file *file)
{
    av_frame_free(&file->frame);
    av_packet_free(&file->packet);
    avcodec_free_context(&file->codec);
    avformat_close_input(&file->format);
    memset(file, 0, sizeof(*file));
}
