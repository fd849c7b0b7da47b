/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/v4l2_stream.h"

#include <errno.h>
#include <string.h>

/** Buffers asked of the driver: one being read, one newest, the others being filled. */
#define N_BUFFERS 5
/** Fewest that can be streamed with. */
#define MIN_BUFFERS 2
/** Fewest with which the driver always has one to fill while one is lent and one is newest. */
#define MIN_BUFFERS_TO_LEND 3
/** Largest buffer that is mapped. */
#define MAX_BUFFER_BYTES ((size_t)1 << 29)
/** A gap larger than this in the driver's numbers is no count of pictures. */
#define MAX_GAP 100000u

static struct v4l2_buffer make_buffer(uint32_t index)
{
    return (struct v4l2_buffer){
        .index = index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
}

static int queue(struct gn_v4l2_stream *s, uint32_t index)
{
    struct v4l2_buffer b = make_buffer(index);
    return gn_v4l2_device_call(s->device, VIDIOC_QBUF, &b);
}

static int map_buffer(struct gn_v4l2_stream *s, uint32_t index, struct gn_error *out_error)
{
    const struct gn_v4l2_device *d = s->device;
    struct gn_v4l2_buffer *buffer = &s->buffers[index];
    struct v4l2_buffer b = make_buffer(index);
    int err = gn_v4l2_device_call(d, VIDIOC_QUERYBUF, &b);
    if (!err && (b.length < 1 || b.length > MAX_BUFFER_BYTES || b.length < s->layout->n_bytes))
        return gn_error_set(out_error, -EPROTO,
                            "%s (%s): a buffer of %u bytes; a picture takes %zu, and %zu are the "
                            "limit",
                            d->path, d->card, b.length, s->layout->n_bytes, MAX_BUFFER_BYTES);
    if (!err)
        err = d->io->map(d->io->context, d->fd, b.length, b.m.offset, &buffer->start);
    if (!err) {
        buffer->n_bytes = b.length;
        err = queue(s, index);
    }
    if (err)
        return gn_error_set(out_error, err, "%s (%s): buffer %u: %s", d->path, d->card, index,
                            strerror(-err));
    return 0;
}

int gn_v4l2_stream_start(struct gn_v4l2_stream *stream, struct gn_error *out_error)
{
    const struct gn_v4l2_device *d = stream->device;
    struct v4l2_requestbuffers r = {
        .count = N_BUFFERS, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    int err = gn_v4l2_device_call(d, VIDIOC_REQBUFS, &r);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): no buffers: %s", d->path, d->card,
                            err == -EBUSY ? "another program streams from it" : strerror(-err));
    if (r.count < MIN_BUFFERS || r.count > VIDEO_MAX_FRAME)
        return gn_error_set(out_error, -EPROTO, "%s (%s): gives %u buffers; %d to %d are needed",
                            d->path, d->card, r.count, MIN_BUFFERS, VIDEO_MAX_FRAME);
    stream->n_buffers = r.count;
    for (uint32_t i = 0; !err && i < r.count; i++)
        err = map_buffer(stream, i, out_error);
    if (err)
        return err;
    struct v4l2_event_subscription sub = {.type = V4L2_EVENT_SOURCE_CHANGE};
    (void)gn_v4l2_device_call(d, VIDIOC_SUBSCRIBE_EVENT, &sub); // few have it
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    err = gn_v4l2_device_call(d, VIDIOC_STREAMON, &type);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): does not stream: %s", d->path, d->card,
                            err == -EBUSY ? "another program streams from it" : strerror(-err));
    return 0;
}

void gn_v4l2_stream_stop(struct gn_v4l2_stream *stream)
{
    const struct gn_v4l2_device *d = stream->device;
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (stream->n_buffers)
        (void)gn_v4l2_device_call(d, VIDIOC_STREAMOFF, &type);
    for (uint32_t i = 0; i < stream->n_buffers; i++) {
        if (stream->buffers[i].start)
            d->io->unmap(d->io->context, stream->buffers[i].start, stream->buffers[i].n_bytes);
    }
    *stream = (struct gn_v4l2_stream){.device = stream->device,
                                      .layout = stream->layout,
                                      .jpeg = stream->jpeg,
                                      .counts = stream->counts};
}

bool gn_v4l2_stream_may_lend(const struct gn_v4l2_stream *stream)
{
    return stream->n_buffers >= MIN_BUFFERS_TO_LEND && !stream->device->is_careless;
}

size_t gn_v4l2_stream_get_room(const struct gn_v4l2_stream *stream)
{
    size_t most = 0;
    for (uint32_t i = 0; i < stream->n_buffers; i++)
        most = stream->buffers[i].n_bytes > most ? stream->buffers[i].n_bytes : most;
    return most;
}

int gn_v4l2_stream_release(struct gn_v4l2_stream *stream)
{
    if (!stream->has_held)
        return 0;
    stream->has_held = false;
    return queue(stream, stream->held);
}

/** Counts the pictures between the last one and this in the driver's numbers, which wrap. */
static void count_gap(struct gn_v4l2_stream *s, uint32_t sequence)
{
    uint32_t gap = sequence - s->last_sequence - 1;
    if (s->has_sequence && gap <= MAX_GAP)
        s->counts->n_lost += gap;
    s->last_sequence = sequence;
    s->has_sequence = true;
}

/** Whether a JPEG was cut off: all end with FF D9, which is nowhere in the compressed data (ITU-T
 * T.81, B.1.1.2 and F.1.2.3). Drivers leave anything behind it. */
static bool is_cut(const uint8_t *data, size_t n)
{
    while (n >= 2 && !(data[n - 2] == 0xff && data[n - 1] == 0xd9))
        n--;
    return n < 2;
}

/** Whether a filled buffer holds a whole picture; what cables do is no fault of the driver. */
static bool is_whole(struct gn_v4l2_stream *s, const struct v4l2_buffer *b)
{
    const struct gn_v4l2_buffer *buffer = &s->buffers[b->index];
    if (b->flags & V4L2_BUF_FLAG_ERROR)
        return false;
    if (b->bytesused > buffer->n_bytes)
        s->fault = "is said to hold more than it can";
    else if (b->bytesused < 1 || b->bytesused < s->layout->n_bytes)
        s->fault = "holds less than a picture";
    else if (s->layout->format == GN_CAPTURE_JPEG) {
        int width, height, channels;
        if (gn_jpeg_get_size(s->jpeg, buffer->start, b->bytesused, &width, &height, &channels,
                             NULL) < 0 ||
            width != s->layout->width || height != s->layout->height)
            s->fault = "holds no JPEG of the size that was set";
        else if (is_cut(buffer->start, b->bytesused))
            s->fault = "holds a JPEG without its end";
        else
            return true;
    } else if (!gn_v4l2_has_sound_codes(s->layout, buffer->start))
        s->fault = "holds codes with more bits than its format has";
    else
        return true;
    return false;
}

/** What becomes of one filled buffer: held, or given back. */
static int sort_buffer(struct gn_v4l2_stream *s, const struct v4l2_buffer *b,
                       struct gn_v4l2_picture *out)
{
    if (b->index >= s->n_buffers || (s->has_held && b->index == s->held))
        return -EPROTO;
    count_gap(s, b->sequence);
    if (!is_whole(s, b)) {
        s->counts->n_incomplete++;
        return queue(s, b->index);
    }
    s->counts->n_complete++;
    s->counts->n_skipped += s->has_held;
    int err = gn_v4l2_stream_release(s);
    s->has_held = true;
    s->held = b->index;
    *out = (struct gn_v4l2_picture){s->buffers[b->index].start, b->bytesused, *b};
    return err;
}

int gn_v4l2_stream_take(struct gn_v4l2_stream *stream, struct gn_v4l2_picture *out)
{
    for (uint32_t i = 0; i < 2 * stream->n_buffers; i++) { // a driver may never run dry
        struct v4l2_buffer b = make_buffer(0);
        int err = gn_v4l2_device_call(stream->device, VIDIOC_DQBUF, &b);
        if (err == -EAGAIN)
            break;
        if (!err)
            err = sort_buffer(stream, &b, out);
        if (err)
            return err;
    }
    return stream->has_held;
}
