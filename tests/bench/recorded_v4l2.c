/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Puts recorded buffers in the place of the kernel's cameras: linked into gnomon, it makes
 * --v4l2 FOLDER a camera that fills a buffer with each PNG of the folder, in turn and again, in the
 * --pixel-format asked for (YUYV or MJPG). Nothing is written while it runs, as a camera's DMA
 * takes nothing of the processor.
 */
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "client/capture/v4l2_io.h"
#include "common/clock.h"
#include "common/image_file.h"
#include "tests/rig/v4l2_picture.h"

/** As many as a driver may give. */
enum { MAX_BUFFERS = VIDEO_MAX_FRAME };

static struct {
    int n_buffers;
    uint8_t *data[MAX_BUFFERS];
    uint32_t n_bytes[MAX_BUFFERS], room; // room: of a buffer
    bool is_queued[MAX_BUFFERS];
    struct v4l2_pix_format pix;
    struct v4l2_fract interval;
    uint32_t sequence;
} recorded;

int __wrap_gn_v4l2_open(const struct gn_live_options *options, struct gn_source **out_source,
                        struct gn_error *out_error);

/** Encodes one PNG as a buffer's content. */
static int record(const char *path, const char *fourcc, int i, struct gn_error *out_error)
{
    struct gn_image_file file = {0};
    int err = gn_image_read_file(path, &file, out_error);
    if (!err && file.kind != GN_IMAGE_CODES8)
        err = gn_error_set(out_error, -EINVAL, "%s: no picture of 8 bits", path);
    if (!err)
        err = gn_rig_encode_v4l2(&file.codes8, fourcc, &recorded.pix, &recorded.data[i], out_error);
    if (!err) {
        recorded.n_bytes[i] = recorded.pix.sizeimage;
        recorded.room = recorded.n_bytes[i] > recorded.room ? recorded.n_bytes[i] : recorded.room;
    }
    gn_image_file_finish(&file);
    return err;
}

static int recorded_open(void *context, const char *path)
{
    (void)context, (void)path;
    int fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    return fd < 0 ? -errno : fd;
}

static void recorded_close(void *context, int fd)
{
    (void)context;
    (void)close(fd);
}

static int start_timer(int fd)
{
    int64_t ns = GN_NS_PER_S * recorded.interval.numerator / recorded.interval.denominator;
    const struct timespec step = {.tv_sec = ns / GN_NS_PER_S, .tv_nsec = ns % GN_NS_PER_S};
    const struct itimerspec every = {.it_interval = step, .it_value = step};
    return timerfd_settime(fd, 0, &every, NULL) < 0 ? -errno : 0;
}

/** The buffer that is due, if it was given to be filled. */
static int dequeue(int fd, struct v4l2_buffer *b)
{
    uint64_t n_due = 0;
    if (read(fd, &n_due, sizeof(n_due)) != sizeof(n_due))
        return -EAGAIN;
    recorded.sequence += (uint32_t)n_due;
    uint32_t i = recorded.sequence % (uint32_t)recorded.n_buffers;
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (!recorded.is_queued[i])
        return -EAGAIN;
    recorded.is_queued[i] = false;
    *b = (struct v4l2_buffer){.index = i,
                              .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
                              .memory = V4L2_MEMORY_MMAP,
                              .bytesused = recorded.n_bytes[i],
                              .flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
                              .timestamp = {.tv_sec = now_ns / GN_NS_PER_S,
                                            .tv_usec = now_ns % GN_NS_PER_S / GN_NS_PER_US},
                              .sequence = recorded.sequence};
    return 0;
}

static int recorded_control(void *context, int fd, unsigned long request, void *argument)
{
    (void)context;
    struct v4l2_fmtdesc *listed = argument;
    struct v4l2_format *format = argument;
    struct v4l2_capability *cap = argument;
    struct v4l2_streamparm *parm = argument;
    struct v4l2_buffer *b = argument;
    switch (request) {
    case VIDIOC_QUERYCAP:
        snprintf((char *)cap->card, sizeof(cap->card), "recorded buffers");
        cap->capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
    case VIDIOC_ENUM_FMT:
        listed->pixelformat = recorded.pix.pixelformat;
        return listed->index ? -EINVAL : 0;
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
        format->fmt.pix = recorded.pix;
        format->fmt.pix.sizeimage = recorded.room;
        return 0;
    case VIDIOC_S_PARM:
        recorded.interval = parm->parm.capture.timeperframe;
        return 0;
    case VIDIOC_G_PARM:
        parm->parm.capture.timeperframe = recorded.interval;
        return 0;
    case VIDIOC_REQBUFS:
        ((struct v4l2_requestbuffers *)argument)->count = (uint32_t)recorded.n_buffers;
        return 0;
    case VIDIOC_QUERYBUF:
        b->length = recorded.room;
        b->m.offset = b->index;
        return 0;
    case VIDIOC_QBUF:
        recorded.is_queued[b->index] = true;
        return 0;
    case VIDIOC_DQBUF:
        return dequeue(fd, argument);
    case VIDIOC_STREAMON:
        return start_timer(fd);
    case VIDIOC_STREAMOFF:
        return 0;
    default:
        return -ENOTTY;
    }
}

static int recorded_map(void *context, int fd, size_t n_bytes, int64_t offset, uint8_t **out_start)
{
    (void)context, (void)fd;
    uint8_t *grown = realloc(recorded.data[offset], n_bytes);
    if (!grown)
        return -ENOMEM;
    *out_start = recorded.data[offset] = grown;
    return 0;
}

/** What is recorded stays: a camera that is opened again has it again. */
static void recorded_unmap(void *context, uint8_t *start, size_t n_bytes)
{
    (void)context, (void)start, (void)n_bytes;
}

int __wrap_gn_v4l2_open(const struct gn_live_options *options, struct gn_source **out_source,
                        struct gn_error *out_error)
{
    static struct gn_v4l2_io io;
    const char *fourcc = options->pixel_format ? options->pixel_format : "YUYV";
    struct gn_live_options mine = *options;
    char pattern[4096];
    glob_t found = {0};
    int err = 0;
    *out_source = NULL;
    snprintf(pattern, sizeof(pattern), "%s/*.png", options->id);
    if (glob(pattern, 0, NULL, &found) != 0 || found.gl_pathc > MAX_BUFFERS)
        return gn_error_set(out_error, -ENOENT, "%s: no pictures, or more than %d", pattern,
                            MAX_BUFFERS);
    recorded.interval = (struct v4l2_fract){1, 30};
    recorded.n_buffers = (int)found.gl_pathc;
    for (int i = 0; i < recorded.n_buffers && !err; i++)
        err = record(found.gl_pathv[i], fourcc, i, out_error);
    globfree(&found);
    if (err)
        return err;
    io = gn_v4l2_kernel;
    io.open = recorded_open;
    io.close = recorded_close;
    io.control = recorded_control;
    io.map = recorded_map;
    io.unmap = recorded_unmap;
    mine.id = "recorded";
    return gn_v4l2_open_through(&io, &mine, out_source, out_error);
}
