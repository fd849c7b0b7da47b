/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Makes a V4L2 loopback device a webcam that looks at a picture: writes it as YUYV or MJPG again
 * and again, until it is ended.
 * usage: feed DEVICE HZ FORMAT PICTURE
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "common/clock.h"
#include "common/image_file.h"
#include "tests/rig/v4l2_picture.h"

/** Returns the descriptor, or -1 and says why. */
static int open_device(const char *path, const struct v4l2_pix_format *pix)
{
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT, .fmt.pix = *pix};
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
    double rate_hz = argc == 5 ? atof(argv[2]) : 0;
    if (!(rate_hz >= 0.1 && rate_hz <= 1000)) {
        fprintf(stderr, "usage: feed DEVICE HZ FORMAT PICTURE\n");
        return 2;
    }
    struct gn_image_file file = {0};
    struct gn_error error = {0};
    struct v4l2_pix_format pix;
    uint8_t *data = NULL;
    int err = gn_image_read_file(argv[4], &file, &error);
    if (!err && file.kind != GN_IMAGE_CODES8)
        err = gn_error_set(&error, -EINVAL, "%s: no picture of 8 bits", argv[4]);
    if (!err)
        err = gn_rig_encode_v4l2(&file.codes8, argv[3], &pix, &data, &error);
    if (err)
        fprintf(stderr, "feed: %s\n", error.text);
    int fd = err ? -1 : open_device(argv[1], &pix);
    if (fd >= 0) {
        feed(fd, data, pix.sizeimage, rate_hz);
        close(fd);
    }
    free(data);
    gn_image_file_finish(&file);
    return 1;
}
