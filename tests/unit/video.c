/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Video files: colours by matrix and range, times, loops; hostile files end with a sentence. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>

#include "client/capture/video.h"
#include "common/file.h"
#include "tests/folder.h"
#include "tests/unit/cmocka_setup.h"

#define WIDTH 64
#define HEIGHT 48
#define N_PICTURES 5

/** How a test's video is written. */
struct recipe {
    const char *name; // the container by its extension
    enum AVCodecID codec;
    enum AVPixelFormat format;
    enum AVColorSpace matrix;
    enum AVColorRange range;
    int64_t pts[N_PICTURES]; // ms
    int width;               // px; 0: WIDTH
};

static const struct recipe plain = {"v.mkv",         AV_CODEC_ID_FFV1, AV_PIX_FMT_YUV444P,
                                    AVCOL_SPC_BT709, AVCOL_RANGE_MPEG, {0, 40, 80, 160, 200}};

static int set_up(void **state)
{
    (void)state;
    return gn_test_folder_create();
}

static int tear_down(void **state)
{
    (void)state;
    const char *const names[] = {"v.mkv", "v.mp4", "v.avi", "v.y4m", "bad.mkv", "v.m2v"};
    return gn_test_folder_remove(names, sizeof(names) / sizeof(*names));
}

/** The R, G, B of a pixel of picture i, [0, 1]: smooth, so that any codec keeps it. */
static void get_rgb(int i, int x, int y, double out[static 3])
{
    out[0] = 0.1 + 0.8 * x / (WIDTH - 1);
    out[1] = 0.1 + 0.8 * y / (HEIGHT - 1);
    out[2] = 0.1 + 0.16 * i;
}

/** Y', Cb, Cr codes as ITU-R BT.601 and BT.709 define them (BT.709-6, items 3.2 to 3.5; full range:
 * JFIF 1.02), for a depth of 8 or more bits. */
static void get_codes(const struct recipe *r, int depth, const double rgb[static 3],
                      int out[static 3])
{
    double kr = r->matrix == AVCOL_SPC_BT709 ? 0.2126 : 0.299;
    double kb = r->matrix == AVCOL_SPC_BT709 ? 0.0722 : 0.114;
    double y = kr * rgb[0] + (1 - kr - kb) * rgb[1] + kb * rgb[2];
    double cb = (rgb[2] - y) / (2 * (1 - kb)), cr = (rgb[0] - y) / (2 * (1 - kr));
    double one = 1 << (depth - 8), full = (1 << depth) - 1;
    if (r->range == AVCOL_RANGE_JPEG) {
        out[0] = (int)lround(full * y);
        out[1] = (int)lround(full * cb + 128 * one);
        out[2] = (int)lround(full * cr + 128 * one);
    } else {
        out[0] = (int)lround((219 * y + 16) * one);
        out[1] = (int)lround((224 * cb + 128) * one);
        out[2] = (int)lround((224 * cr + 128) * one);
    }
}

static void fill_picture(const struct recipe *r, int i, AVFrame *frame)
{
    bool is_deep = r->format == AV_PIX_FMT_YUV444P10LE;
    int half = r->format == AV_PIX_FMT_YUV420P || r->format == AV_PIX_FMT_YUVJ420P;
    for (int c = 0; c < 3; c++) {
        int shift = c > 0 && half;
        for (int y = 0; y < HEIGHT >> shift; y++) {
            for (int x = 0; x < frame->width >> shift; x++) {
                double rgb[3];
                int codes[3];
                get_rgb(i, x << shift, y << shift, rgb);
                get_codes(r, is_deep ? 10 : 8, rgb, codes);
                uint8_t *row = frame->data[c] + y * frame->linesize[c];
                if (is_deep) {
                    row[2 * x] = (uint8_t)codes[c];
                    row[2 * x + 1] = (uint8_t)(codes[c] >> 8);
                } else {
                    row[x] = (uint8_t)codes[c];
                }
            }
        }
    }
}

/** Writes what the encoder has. */
static void write_packets(AVFormatContext *format, AVCodecContext *codec, AVPacket *packet)
{
    int err;
    while ((err = avcodec_receive_packet(codec, packet)) == 0) {
        packet->duration =
            40 * (int64_t)codec->time_base.den / 1000; // else MP4 cuts the last one off
        av_packet_rescale_ts(packet, codec->time_base, format->streams[0]->time_base);
        assert_int_equal(av_interleaved_write_frame(format, packet), 0);
    }
    assert_true(err == AVERROR(EAGAIN) || err == AVERROR_EOF);
}

/** A video made by libav's own encoder, from codes that we computed. */
static void write_video(const struct recipe *r)
{
    const char *path = gn_test_folder_get_path(r->name);
    AVFormatContext *format = NULL;
    assert_true(avformat_alloc_output_context2(&format, NULL, NULL, path) >= 0);
    const AVCodec *encoder = avcodec_find_encoder(r->codec);
    assert_non_null(encoder);
    AVCodecContext *codec = avcodec_alloc_context3(encoder);
    AVStream *stream = avformat_new_stream(format, NULL);
    AVFrame *frame = av_frame_alloc();
    AVPacket *packet = av_packet_alloc();
    assert_true(codec && stream && frame && packet);
    codec->width = r->width ? r->width : WIDTH;
    codec->height = HEIGHT;
    codec->pix_fmt = r->format;
    codec->time_base = (AVRational){1, 1000};
    codec->colorspace = r->matrix;
    codec->color_range = r->range;
    codec->flags |= AV_CODEC_FLAG_QSCALE;
    codec->global_quality = 2 * FF_QP2LAMBDA;
    codec->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
    codec->thread_count = 1;
    if (r->codec == AV_CODEC_ID_MPEG4 || r->codec == AV_CODEC_ID_MJPEG ||
        r->codec == AV_CODEC_ID_MPEG2VIDEO)
        codec->time_base = (AVRational){1, 25};
    if (format->oformat->flags & AVFMT_GLOBALHEADER)
        codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    assert_int_equal(avcodec_open2(codec, encoder, NULL), 0);
    assert_true(avcodec_parameters_from_context(stream->codecpar, codec) >= 0);
    stream->time_base = codec->time_base;
    assert_true(avio_open(&format->pb, path, AVIO_FLAG_WRITE) >= 0);
    assert_true(avformat_write_header(format, NULL) >= 0);
    for (int i = 0; i < N_PICTURES; i++) {
        frame->format = r->format;
        frame->width = codec->width;
        frame->height = HEIGHT;
        frame->pts = r->pts[i] * codec->time_base.den / 1000;
        frame->quality = codec->global_quality;
        frame->colorspace = r->matrix;
        frame->color_range = r->range;
        assert_true(av_frame_get_buffer(frame, 0) >= 0);
        fill_picture(r, i, frame);
        assert_int_equal(avcodec_send_frame(codec, frame), 0);
        write_packets(format, codec, packet);
        av_frame_unref(frame);
    }
    assert_int_equal(avcodec_send_frame(codec, NULL), 0);
    write_packets(format, codec, packet);
    assert_int_equal(av_write_trailer(format), 0);
    avio_closep(&format->pb);
    av_frame_free(&frame);
    av_packet_free(&packet);
    avcodec_free_context(&codec);
    avformat_free_context(format);
}

static struct gn_source *open_video(const char *name, const struct gn_video_options *options)
{
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    if (gn_video_source_open(gn_test_folder_get_path(name), options, &source, &error) != 0)
        fail_msg("%s", error.text);
    assert_false(source->is_live);
    return source;
}

static void read_picture(struct gn_source *source, struct gn_capture *out)
{
    struct gn_error error = {0};
    int got = gn_source_read(source, out, &error);
    if (got != 1)
        fail_msg("%d: %s", got, error.text);
}

/** The largest difference from what was written, as a share of full scale. */
static double compare_picture(const struct gn_capture *c, int i)
{
    double most = 0;
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < c->width; x++) {
            double rgb[3];
            get_rgb(i, x, y, rgb);
            for (int k = 0; k < 3; k++) {
                size_t at = (size_t)(3 * (y * c->width + x) + k);
                double code = c->format == GN_CAPTURE_RGB16
                                  ? (c->data[2 * at] | c->data[2 * at + 1] << 8) / 65535.0
                                  : c->data[at] / 255.0;
                most = fmax(most, fabs(code - rgb[k]));
            }
        }
    }
    return most;
}

/** Writes and reads a recipe; fails where a picture is further off than tolerance. */
static void check_recipe(const struct recipe *r, bool keeps_bits, enum gn_capture_format wanted,
                         double tolerance)
{
    write_video(r);
    const struct gn_video_options options = {.keeps_bits = keeps_bits};
    struct gn_source *source = open_video(r->name, &options);
    struct gn_error error = {0};
    struct gn_capture c;
    for (int i = 0; i < N_PICTURES; i++) {
        char name[32];
        read_picture(source, &c);
        snprintf(name, sizeof(name), "v-%06d", i + 1);
        assert_string_equal(c.name, name);
        assert_true(c.width == WIDTH && c.height == HEIGHT && c.format == wanted);
        assert_true(c.data_bytes == (size_t)WIDTH * HEIGHT * (wanted == GN_CAPTURE_RGB16 ? 6 : 3));
        assert_false(c.has_pose);
        double off = compare_picture(&c, i);
        if (off > tolerance)
            fail_msg("%s, matrix %d, range %d, picture %d: off by %g", r->name, (int)r->matrix,
                     (int)r->range, i, off);
        if (fabs(c.time_s - (double)r->pts[i] * 1e-3) > 1e-6)
            fail_msg("picture %d at %g s, not %g", i, c.time_s, (double)r->pts[i] * 1e-3);
    }
    assert_int_equal(gn_source_read(source, &c, &error), 0);
    gn_source_close(&source);
}

/* Lossless codes come back as R, G, B within their rounding, by matrix and range; a wrong matrix
 * is off by 0.05 and more, a wrong range by 0.06. */
static void test_colours(void **state)
{
    (void)state;
    const enum AVColorSpace matrices[] = {AVCOL_SPC_BT709, AVCOL_SPC_SMPTE170M, AVCOL_SPC_BT470BG,
                                          AVCOL_SPC_UNSPECIFIED};
    const enum AVColorRange ranges[] = {AVCOL_RANGE_MPEG, AVCOL_RANGE_JPEG};
    for (size_t m = 0; m < 4; m++) {
        for (size_t k = 0; k < 2; k++) {
            struct recipe r = plain;
            r.matrix = matrices[m]; // unspecified and low: BT.601
            r.range = ranges[k];
            check_recipe(&r, false, GN_CAPTURE_RGB8, 3.1 / 255);
        }
    }
}

/* A stream may change its size in the middle; its colours stay what they are. */
static void test_other_size_in_the_middle(void **state)
{
    (void)state;
    struct recipe r = {"v.m2v",         AV_CODEC_ID_MPEG2VIDEO, AV_PIX_FMT_YUV420P,
                       AVCOL_SPC_BT709, AVCOL_RANGE_MPEG,       {0, 40, 80, 120, 160}};
    struct gn_error error = {0};
    static uint8_t whole[1 << 18];
    size_t n_whole = 0;
    for (int k = 0; k < 2; k++) {
        uint8_t *part = NULL;
        size_t n = 0;
        write_video(&r);
        assert_int_equal(gn_file_read(gn_test_folder_get_path(r.name), 1 << 17, &part, &n, &error),
                         0);
        memcpy(whole + n_whole, part, n);
        n_whole += n;
        free(part);
        r.width = WIDTH / 2;
    }
    gn_test_folder_write(r.name, whole, n_whole);
    struct gn_source *source = open_video(r.name, NULL);
    struct gn_capture c;
    int n[2] = {0}, got; // pictures of each size
    while ((got = gn_source_read(source, &c, &error)) == 1) {
        bool is_small = c.width == r.width;
        double off = compare_picture(&c, n[is_small]++);
        if (off > 0.04)
            fail_msg("picture %d of width %d: off by %g", n[is_small], c.width, off);
    }
    assert_int_equal(got, 0);
    // The decoder holds one back and forgets it at the change.
    assert_true(n[0] >= N_PICTURES - 1 && n[1] == N_PICTURES);
    gn_source_close(&source);
}

/* Ten bits come as more codes than 256 where they are asked for. swscale's white of narrow range is
 * 255/256 of full scale then: 0.4 %. */
static void test_deep(void **state)
{
    (void)state;
    struct recipe r = plain;
    r.format = AV_PIX_FMT_YUV444P10LE;
    check_recipe(&r, true, GN_CAPTURE_RGB16, 1.4 / 255);
    check_recipe(&r, false, GN_CAPTURE_RGB8, 1.6 / 255);
    const struct gn_video_options options = {.keeps_bits = true};
    struct gn_source *source = open_video(r.name, &options);
    struct gn_capture c;
    read_picture(source, &c);
    int n_between = 0; // codes that 8 bits do not have
    for (size_t i = 0; i < c.data_bytes; i += 2)
        n_between += abs(c.data[i + 1] - c.data[i]) > 16;
    gn_source_close(&source);
    assert_true(n_between > WIDTH * HEIGHT / 2);
    r.range = AVCOL_RANGE_JPEG;
    check_recipe(&r, true, GN_CAPTURE_RGB16, 0.7 / 255);
    check_recipe(&plain, true, GN_CAPTURE_RGB8, 3.1 / 255);
}

/* What cameras and players write: lossy, with halved colour, in other containers. */
static void test_codecs(void **state)
{
    (void)state;
    const struct recipe recipes[] = {
        {"v.mp4",
         AV_CODEC_ID_MPEG4,
         AV_PIX_FMT_YUV420P,
         AVCOL_SPC_UNSPECIFIED,
         AVCOL_RANGE_MPEG,
         {0, 40, 80, 120, 160}},
        {"v.avi",
         AV_CODEC_ID_MJPEG,
         AV_PIX_FMT_YUVJ420P,
         AVCOL_SPC_UNSPECIFIED,
         AVCOL_RANGE_JPEG,
         {0, 40, 80, 120, 160}},
    };
    for (size_t i = 0; i < 2; i++)
        check_recipe(&recipes[i], false, GN_CAPTURE_RGB8, 12.0 / 255);
}

/* A second round goes on where the first one ended, after the pause before its last picture. */
static void test_loop(void **state)
{
    (void)state;
    write_video(&plain);
    const struct gn_video_options options = {.is_looped = true};
    struct gn_source *source = open_video(plain.name, &options);
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < N_PICTURES; i++) {
            struct gn_capture c;
            read_picture(source, &c);
            double wanted_s = (double)plain.pts[i] * 1e-3 + round * 0.24;
            if (fabs(c.time_s - wanted_s) > 1e-6)
                fail_msg("round %d, picture %d at %g s, not %g", round, i, c.time_s, wanted_s);
            assert_true(compare_picture(&c, i) < 3.1 / 255);
            assert_true(c.name[strlen(c.name) - 1] == '1' + i);
        }
    }
    gn_source_close(&source);
}

/** Opens and reads a file to its end, whatever it holds. Returns the errno that ended it, or how
 * many pictures it gave. */
static int read_all(const char *name, struct gn_error *error)
{
    struct gn_source *source = NULL;
    struct gn_capture c;
    *error = (struct gn_error){0};
    int n = 0, got = gn_video_source_open(gn_test_folder_get_path(name), NULL, &source, error);
    for (; got >= 0 && (got = gn_source_read(source, &c, error)) > 0; n++)
        assert_true(n < 1000 && c.data_bytes == (size_t)c.width * (size_t)c.height * 3);
    gn_source_close(&source);
    if (got < 0 && !strstr(error->text, name))
        fail_msg("no sentence about %s: '%s'", name, error->text);
    return got < 0 ? got : n;
}

/* Cut short, or of noise, a file ends with a sentence, or gives the pictures that it has whole. */
static void test_hostile(void **state)
{
    (void)state;
    struct gn_error error = {0};
    uint8_t *data = NULL;
    size_t n = 0;
    unsigned random = 1;
    write_video(&plain);
    assert_int_equal(gn_file_read(gn_test_folder_get_path("v.mkv"), 1 << 24, &data, &n, &error), 0);
    int n_refused = 0;
    for (size_t cut = 0; cut < n; cut += n / 40 + 1) {
        gn_test_folder_write("bad.mkv", data, cut);
        int got = read_all("bad.mkv", &error);
        n_refused += got < 0;
        assert_true(got <= N_PICTURES && got != 0 && (got < N_PICTURES || 10 * cut > 8 * n));
    }
    assert_true(n_refused >= 5);
    int n_spoilt = 0;
    for (int round = 0; round < 60; round++) {
        uint8_t *bad = malloc(n);
        assert_non_null(bad);
        memcpy(bad, data, n);
        for (int k = 0; k < 1 + round; k++) {
            random = random * 1664525 + 1013904223; // Numerical Recipes, ranqd1
            bad[(random >> 8) % n] = (uint8_t)(random >> 4);
        }
        gn_test_folder_write("bad.mkv", bad, n);
        n_spoilt += read_all("bad.mkv", &error) < N_PICTURES;
        free(bad);
    }
    assert_true(n_spoilt > 0);
    for (size_t i = 0; i < n; i++) {
        random = random * 1664525 + 1013904223;
        data[i] = (uint8_t)(random >> 16);
    }
    gn_test_folder_write("bad.mkv", data, n);
    assert_int_equal(read_all("bad.mkv", &error), -EBADMSG);
    assert_non_null(strstr(error.text, "no video file that can be read"));
    free(data);
}

/* What is no video, or one that is too large, or names other files. */
static void test_refusals(void **state)
{
    (void)state;
    struct gn_error error = {0};
    assert_int_equal(read_all("none.mkv", &error), -ENOENT);
    gn_test_folder_write_text("v.y4m", "");
    assert_int_equal(read_all("v.y4m", &error), -EBADMSG);
    gn_test_folder_write_text("v.y4m",
                              "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n/etc/passwd\n");
    assert_int_equal(read_all("v.y4m", &error), -EBADMSG);
    gn_test_folder_write_text("v.y4m", "ffconcat version 1.0\nfile v.mkv\n");
    assert_int_equal(read_all("v.y4m", &error), -EBADMSG);
    gn_test_folder_write_text("v.y4m", "YUV4MPEG2 W30000 H30000 F25:1 C420jpeg\nFRAME\n");
    assert_true(read_all("v.y4m", &error) < 0);
    gn_test_folder_write_text("v.y4m", "YUV4MPEG2 W16 H16 F25:1 C420jpeg\nFRAME\nshort");
    assert_true(read_all("v.y4m", &error) < 0);
    struct gn_source *source = NULL;
    assert_int_equal(gn_video_source_open("/dev/zero", NULL, &source, &error), -EINVAL);
    assert_null(source);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_colours),  cmocka_unit_test(test_other_size_in_the_middle),
        cmocka_unit_test(test_deep),     cmocka_unit_test(test_codecs),
        cmocka_unit_test(test_loop),     cmocka_unit_test(test_hostile),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
