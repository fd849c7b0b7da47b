/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/video.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libavutil/pixdesc.h>
#include <libswscale/swscale.h>

#include "client/capture/file.h"
#include "client/capture/video_file.h"
#include "common/text.h"

/** Bytes behind the last row: swscale's wide stores may run over its end. */
#define PADDING_BYTES 64
/** Longest pause between two pictures that is believed. */
#define MAX_PAUSE_S 3600.0
/** Pictures per second where the file says nothing at all. */
#define DEFAULT_RATE_HZ 25.0
/** From this height on the matrix of a video that does not name it is BT.709's, below BT.601's:
 * what encoders mean (ITU-R BT.709 is that of high definition). */
#define HD_HEIGHT_PX 720

struct video_source {
    struct gn_source head;
    char *path; // owned
    struct gn_video_options options;
    struct gn_video_file file;
    struct SwsContext *sws; // owned
    uint8_t *pixels;        // owned
    size_t pixels_cap;
    bool has_start;
    double start_s; // the file's time of its first picture
    double last_s;  // of the picture before, from the first of all; < 0: none
    double step_s;  // between the last two
    double loop_s;  // when this round began
    char base[GN_FILE_NAME_BYTES];
    char name[GN_FILE_NAME_BYTES + 32];
};

/** The file's name without folder and extension, fit for a file's name. */
static void set_base(struct video_source *s)
{
    const char *base = strrchr(s->path, '/');
    snprintf(s->base, sizeof(s->base), "%s", base ? base + 1 : s->path);
    char *dot = strrchr(s->base, '.');
    if (dot && dot != s->base)
        *dot = 0;
    gn_text_clean(s->base);
}

/** swscale's number of the picture's matrix; -1: there is none. */
static int get_matrix(const AVFrame *frame)
{
    switch (frame->colorspace) {
    case AVCOL_SPC_BT709:
        return SWS_CS_ITU709;
    case AVCOL_SPC_FCC:
        return SWS_CS_FCC;
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
        return SWS_CS_ITU601;
    case AVCOL_SPC_SMPTE240M:
        return SWS_CS_SMPTE240M;
    case AVCOL_SPC_BT2020_NCL:
        return SWS_CS_BT2020;
    case AVCOL_SPC_RGB: // not used: these are R, G, B
    case AVCOL_SPC_UNSPECIFIED:
    case AVCOL_SPC_RESERVED:
        return frame->height >= HD_HEIGHT_PX ? SWS_CS_ITU709 : SWS_CS_ITU601;
    default:
        return -1;
    }
}

/** Old formats say their full range by their name. */
static bool is_full_range(const AVFrame *frame)
{
    return frame->color_range == AVCOL_RANGE_JPEG || frame->format == AV_PIX_FMT_YUVJ420P ||
           frame->format == AV_PIX_FMT_YUVJ422P || frame->format == AV_PIX_FMT_YUVJ444P ||
           frame->format == AV_PIX_FMT_YUVJ440P || frame->format == AV_PIX_FMT_YUVJ411P;
}

/** A converter from the picture at hand to R, G, B. */
static int prepare_sws(struct video_source *s, const AVFrame *f, enum AVPixelFormat to,
                       struct gn_error *out_error)
{
    int matrix = get_matrix(f);
    if (matrix < 0)
        return gn_error_set(out_error, -ENOTSUP, "%s: no conversion from the colour space %s",
                            s->path, av_color_space_name(f->colorspace));
    s->sws = sws_getCachedContext(s->sws, f->width, f->height, f->format, f->width, f->height, to,
                                  SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT, NULL, NULL,
                                  NULL);
    if (!s->sws)
        return gn_error_set(out_error, -ENOTSUP, "%s: no conversion from the pixel format %s",
                            s->path, av_get_pix_fmt_name(f->format));
    const int one = 1 << 16; // contrast and saturation; brightness 0
    // Where nothing has changed this does nothing. What is R, G, B already has no matrix: then it
    // is declined, and rightly.
    (void)sws_setColorspaceDetails(s->sws, sws_getCoefficients(matrix), is_full_range(f),
                                   sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, one, one);
    return 0;
}

/** The decoded picture as R, G, B, in one go. */
static int convert(struct video_source *s, struct gn_capture *out, struct gn_error *out_error)
{
    const AVFrame *f = s->file.frame;
    const AVPixFmtDescriptor *description = av_pix_fmt_desc_get(f->format);
    if (f->width < 1 || f->height < 1 || f->width > GN_VIDEO_MAX_SIDE ||
        f->height > GN_VIDEO_MAX_SIDE || (int64_t)f->width * f->height > GN_VIDEO_MAX_PIXELS)
        return gn_error_set(out_error, -EFBIG, "%s: picture %ld is %dx%d", s->path,
                            s->file.n_pictures, f->width, f->height);
    bool is_deep = s->options.keeps_bits && description && description->comp[0].depth > 8;
    size_t pixel_bytes = is_deep ? 6 : 3;
    int err = prepare_sws(s, f, is_deep ? AV_PIX_FMT_RGB48LE : AV_PIX_FMT_RGB24, out_error);
    if (err)
        return err;
    size_t row = (size_t)f->width * pixel_bytes, bytes = row * (size_t)f->height;
    if (bytes + PADDING_BYTES > s->pixels_cap) {
        uint8_t *grown = realloc(s->pixels, bytes + PADDING_BYTES);
        if (!grown)
            return gn_error_set(out_error, -ENOMEM, "%s: out of memory", s->path);
        s->pixels = grown;
        s->pixels_cap = bytes + PADDING_BYTES;
    }
    uint8_t *planes[4] = {s->pixels};
    const int strides[4] = {(int)row};
    if (sws_scale(s->sws, (const uint8_t *const *)f->data, f->linesize, 0, f->height, planes,
                  strides) != f->height)
        return gn_error_set(out_error, -EBADMSG, "%s: picture %ld cannot be converted", s->path,
                            s->file.n_pictures);
    out->format = is_deep ? GN_CAPTURE_RGB16 : GN_CAPTURE_RGB8;
    out->width = f->width;
    out->height = f->height;
    out->data = s->pixels;
    out->data_bytes = bytes;
    return 0;
}

/** When the picture at hand is shown, from the first of all; later than the one before. */
static int get_time(struct video_source *s, double *out, struct gn_error *out_error)
{
    const AVFrame *f = s->file.frame;
    const AVStream *stream = s->file.format->streams[s->file.stream];
    double rate_hz = av_q2d(stream->avg_frame_rate);
    if (!(rate_hz > 0 && rate_hz < 1e6))
        rate_hz = DEFAULT_RATE_HZ;
    if (s->step_s <= 0)
        s->step_s = 1 / rate_hz;
    double time_s = s->last_s < 0 ? 0 : s->last_s + s->step_s;
    if (f->best_effort_timestamp != AV_NOPTS_VALUE) {
        double file_s = (double)f->best_effort_timestamp * av_q2d(stream->time_base);
        if (!s->has_start)
            s->start_s = file_s;
        s->has_start = true;
        double told_s = file_s - s->start_s + s->loop_s;
        if (told_s - s->last_s > MAX_PAUSE_S)
            return gn_error_set(out_error, -EBADMSG,
                                "%s: picture %ld comes %.0f s after the one before", s->path,
                                s->file.n_pictures, told_s - s->last_s);
        if (told_s > s->last_s)
            time_s = told_s;
    }
    if (s->last_s >= 0 && time_s > s->last_s)
        s->step_s = time_s - s->last_s;
    s->last_s = time_s;
    *out = time_s;
    return 0;
}

/** Begins again. The pause before is the one before the last picture. */
static int begin_round(struct video_source *s, struct gn_error *out_error)
{
    s->loop_s = s->last_s + s->step_s;
    s->has_start = false;
    gn_video_file_close(&s->file);
    return gn_video_file_open(&s->file, s->path, out_error);
}

static int video_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    struct video_source *s = (struct video_source *)source;
    struct gn_capture capture = {.name = s->name};
    int got = gn_video_file_read(&s->file, s->path, out_error);
    if (got == 0 && s->file.n_pictures == 0)
        return gn_error_set(out_error, -ENODATA, "%s: no picture in it", s->path);
    if (got == 0 && s->options.is_looped) {
        got = begin_round(s, out_error);
        if (got == 0)
            got = gn_video_file_read(&s->file, s->path, out_error);
    }
    if (got <= 0)
        return got;
    int err = get_time(s, &capture.time_s, out_error);
    if (!err)
        err = convert(s, &capture, out_error);
    if (err)
        return err;
    snprintf(s->name, sizeof(s->name), "%s-%06ld", s->base, s->file.n_pictures);
    *out = capture;
    return 1;
}

static void video_close(struct gn_source *source)
{
    struct video_source *s = (struct video_source *)source;
    gn_video_file_close(&s->file);
    sws_freeContext(s->sws);
    free(s->pixels);
    free(s->path);
    free(s);
}

static const struct gn_source_ops video_ops = {.read = video_read, .close = video_close};

int gn_video_source_open(const char *path, const struct gn_video_options *options,
                         struct gn_source **out_source, struct gn_error *out_error)
{
    *out_source = NULL;
    struct video_source *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->head.ops = &video_ops;
    s->head.fd = -1;
    s->last_s = -1;
    if (options)
        s->options = *options;
    s->path = strdup(path);
    int err = s->path ? gn_video_file_open(&s->file, path, out_error)
                      : gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err) {
        video_close(&s->head);
        return err;
    }
    set_base(s);
    *out_source = &s->head;
    return 0;
}
