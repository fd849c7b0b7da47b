/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Makes a V4L2 loopback device a webcam that looks at a picture: writes it as YUYV again and again,
 * until it is ended. The encoder is written apart from the client's decoder.
 * usage: feed DEVICE HZ PICTURE
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "common/clock.h"
#include "common/image_file.h"

/** Y, U, V as shares of R, G, B in [0, 255], and their codes at 0: BT.601-7 2.5, limited range. */
static const double yuv_from_rgb[3][4] = {
    {0.299 * 219 / 255, 0.587 * 219 / 255, 0.114 * 219 / 255, 16},
    {-0.299 / 1.772 * 224 / 255, -0.587 / 1.772 * 224 / 255, 0.886 / 1.772 * 224 / 255, 128},
    {0.701 / 1.402 * 224 / 255, -0.587 / 1.402 * 224 / 255, -0.114 / 1.402 * 224 / 255, 128},
};

static uint8_t encode(const double weights[4], const double rgb[3])
{
    return (uint8_t)lround(weights[0] * rgb[0] + weights[1] * rgb[1] + weights[2] * rgb[2] +
                           weights[3]);
}

/** Two pixels beside each other, which share their mean chroma. */
static void encode_pair(const uint8_t *left, const uint8_t *right, uint8_t out[4])
{
    double a[3], b[3], mean[3];
    for (int c = 0; c < 3; c++) {
        a[c] = left[c];
        b[c] = right[c];
        mean[c] = (a[c] + b[c]) / 2;
    }
    out[0] = encode(yuv_from_rgb[0], a);
    out[1] = encode(yuv_from_rgb[1], mean);
    out[2] = encode(yuv_from_rgb[0], b);
    out[3] = encode(yuv_from_rgb[2], mean);
}

/** Sets the device to YUYV of the picture's size. Returns the descriptor, or -1 and says why. */
static int open_device(const char *path, const struct gn_image8 *picture)
{
    struct v4l2_format format = {
        .type = V4L2_BUF_TYPE_VIDEO_OUTPUT,
        .fmt.pix = {.width = (uint32_t)picture->width,
                    .height = (uint32_t)picture->height,
                    .pixelformat = V4L2_PIX_FMT_YUYV,
                    .field = V4L2_FIELD_NONE,
                    .bytesperline = 2 * (uint32_t)picture->width,
                    .sizeimage = 2 * (uint32_t)picture->width * (uint32_t)picture->height,
                    .colorspace = V4L2_COLORSPACE_SRGB},
    };
    int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0 || ioctl(fd, VIDIOC_S_FMT, &format) < 0) {
        fprintf(stderr, "feed: %s: %s\n", path, strerror(errno));
        if (fd >= 0)
            close(fd);
        return -1;
    }
    return fd;
}

/** Until the device takes no more. */
static void feed(int fd, const uint8_t *data, size_t n_bytes, double rate_hz)
{
    int64_t frame_ns = (int64_t)((double)GN_NS_PER_S / rate_hz);
    struct timespec pause = {frame_ns / GN_NS_PER_S, frame_ns % GN_NS_PER_S};
    for (bool is_first = true; write(fd, data, n_bytes) == (ssize_t)n_bytes; is_first = false) {
        if (is_first && (puts("ready") < 0 || fflush(stdout) != 0))
            return;
        nanosleep(&pause, NULL);
    }
    fprintf(stderr, "feed: the device takes no more: %s\n", strerror(errno));
}

int main(int argc, char *argv[])
{
    double rate_hz = argc == 4 ? atof(argv[2]) : 0;
    if (!(rate_hz >= 0.1 && rate_hz <= 1000)) {
        fprintf(stderr, "usage: feed DEVICE HZ PICTURE\n");
        return 2;
    }
    struct gn_image_file file = {0};
    struct gn_error error = {0};
    if (gn_image_read_file(argv[3], &file, &error) < 0) {
        fprintf(stderr, "feed: %s\n", error.text);
        return 1;
    }
    const struct gn_image8 *picture = &file.codes8;
    size_t n_pixels = (size_t)picture->width * (size_t)picture->height;
    uint8_t *data = malloc(2 * n_pixels + 1);
    int fd = -1;
    if (file.kind != GN_IMAGE_CODES8 || picture->channels < 3 || picture->width % 2)
        fprintf(stderr, "feed: %s: right would be 8-bit colours and an even width\n", argv[3]);
    else if (data)
        fd = open_device(argv[1], picture);
    if (fd >= 0) {
        for (size_t i = 0; i < n_pixels; i += 2) {
            const uint8_t *left = picture->data + i * (size_t)picture->channels;
            encode_pair(left, left + picture->channels, data + 2 * i);
        }
        feed(fd, data, 2 * n_pixels, rate_hz);
        close(fd);
    }
    free(data);
    gn_image_file_finish(&file);
    return 1;
}
