/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/unit/v4l2_fake.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "tests/unit/cmocka_setup.h"

enum { FD = 77 };

static int fake_open(void *context, const char *path)
{
    struct gn_fake *f = context;
    if (f->fail_open)
        return f->fail_open;
    if (f->is_gone || strcmp(path, "/dev/video3") != 0)
        return -ENOENT;
    assert_int_equal(f->n_open, 0);
    f->n_open++;
    f->n_opened++;
    return FD;
}

static void forget_buffers(struct gn_fake *f)
{
    memset(f->is_queued, 0, sizeof(f->is_queued));
    f->n_filled = 0;
}

static void fake_close(void *context, int fd)
{
    struct gn_fake *f = context;
    assert_int_equal(fd, FD);
    assert_int_equal(f->n_mapped, 0); // or the kernel keeps the buffers
    f->n_open--;
    f->n_streaming = 0;
    forget_buffers(f);
}

static int query_capability(const struct gn_fake *f, struct v4l2_capability *cap)
{
    snprintf((char *)cap->driver, sizeof(cap->driver), "%s", f->driver);
    snprintf((char *)cap->card, sizeof(cap->card), "%s", f->card);
    cap->capabilities = V4L2_CAP_DEVICE_CAPS;
    cap->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    return 0;
}

static int list_format(const struct gn_fake *f, struct v4l2_fmtdesc *desc)
{
    uint32_t i = 0;
    while (i < desc->index && f->formats[i])
        i++;
    if (f->is_endless && !f->formats[i])
        i = 0;
    desc->pixelformat = f->formats[i];
    return f->formats[i] ? 0 : -EINVAL;
}

static int list_size(const struct gn_fake *f, struct v4l2_frmsizeenum *size)
{
    uint32_t width = f->is_endless ? 320 : 320u << size->index;
    size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size->discrete.width = width;
    size->discrete.height = width * 3 / 4;
    return width <= f->max_width ? 0 : -EINVAL;
}

static int list_rate(const struct gn_fake *f, struct v4l2_frmivalenum *rate)
{
    rate->type = V4L2_FRMIVAL_TYPE_DISCRETE;
    rate->discrete.numerator = 1;
    rate->discrete.denominator = rate->index ? 10 : 25;
    if (f->is_silent)
        return -ENOTTY;
    return f->is_endless || rate->index < 2 ? 0 : -EINVAL;
}

static void complete_format(struct gn_fake *f, struct v4l2_pix_format *pix)
{
    bool is_known = false;
    for (const uint32_t *p = f->formats; *p; p++)
        is_known = is_known || *p == pix->pixelformat;
    if (!is_known)
        pix->pixelformat = f->formats[0];
    if (pix->width > f->max_width) { // as drivers do: the nearest that they have
        pix->width = f->max_width;
        pix->height = f->max_width * 3 / 4;
    }
    bool is_jpeg = pix->pixelformat == V4L2_PIX_FMT_MJPEG;
    pix->bytesperline = is_jpeg ? 0 : 2 * pix->width;
    pix->sizeimage = 2 * pix->width * pix->height;
    pix->colorspace = V4L2_COLORSPACE_SRGB;
    pix->field = V4L2_FIELD_NONE;
    if (f->bend_format)
        f->bend_format(pix);
}

static int set_format(struct gn_fake *f, struct v4l2_format *format)
{
    if (f->fail_format)
        return f->fail_format;
    complete_format(f, &format->fmt.pix);
    f->pix = format->fmt.pix;
    return 0;
}

static int request_buffers(struct gn_fake *f, struct v4l2_requestbuffers *r)
{
    if (f->fail_buffers)
        return f->fail_buffers;
    if (f->n_given)
        r->count = f->n_given;
    for (int i = 0; i < GN_FAKE_BUFFERS; i++) {
        free(f->memory[i]);
        f->memory[i] = NULL;
    }
    return 0;
}

static int query_buffer(struct gn_fake *f, struct v4l2_buffer *b)
{
    b->length = f->length ? f->length : f->pix.sizeimage;
    b->m.offset = b->index << 16;
    return 0;
}

static int dequeue(struct gn_fake *f, struct v4l2_buffer *b)
{
    if (f->fail_dequeue)
        return f->fail_dequeue;
    if (f->is_endless && !f->n_filled) {
        for (uint32_t i = 0; i < GN_FAKE_BUFFERS; i++) {
            if (f->is_queued[i]) {
                gn_fake_fill(f, 0, 0);
                break;
            }
        }
    }
    if (!f->n_filled)
        return -EAGAIN;
    *b = f->filled[0];
    f->n_filled--;
    memmove(f->filled, f->filled + 1, (size_t)f->n_filled * sizeof(f->filled[0]));
    return 0;
}

static int set_rate(struct gn_fake *f, struct v4l2_streamparm *parm)
{
    struct v4l2_fract *t = &parm->parm.capture.timeperframe;
    uint32_t ms = t->numerator * 1000 / t->denominator;
    f->interval_ms = ms < 70 ? 40 : 100; // the nearer of its two
    t->numerator = f->interval_ms;
    t->denominator = 1000;
    return 0;
}

static int query_control(struct gn_fake *f, struct v4l2_queryctrl *q)
{
    uint32_t id = q->id & ~V4L2_CTRL_FLAG_NEXT_CTRL;
    bool is_next = q->id & V4L2_CTRL_FLAG_NEXT_CTRL;
    const struct v4l2_queryctrl *best = NULL; // the kernel's list is in the order of numbers
    for (int i = 0; i < GN_FAKE_CONTROLS; i++) {
        const struct v4l2_queryctrl *c = &f->controls[i].query;
        if (c->id && (is_next ? c->id > id : c->id == id) && (!best || c->id < best->id))
            best = c;
    }
    if (!best)
        return -EINVAL;
    *q = *best;
    return 0;
}

static int fake_control(void *context, int fd, unsigned long request, void *argument)
{
    struct gn_fake *f = context;
    assert_int_equal(fd, FD);
    assert_int_equal(f->n_open, 1);
    struct v4l2_control *c = argument;
    struct v4l2_buffer *b = argument;
    struct v4l2_streamparm *parm = argument;
    if (f->is_gone)
        return -ENODEV;
    switch (request) {
    case VIDIOC_QUERYCAP:
        return query_capability(f, argument);
    case VIDIOC_ENUM_FMT:
        return list_format(f, argument);
    case VIDIOC_ENUM_FRAMESIZES:
        return list_size(f, argument);
    case VIDIOC_ENUM_FRAMEINTERVALS:
        return list_rate(f, argument);
    case VIDIOC_G_FMT:
        ((struct v4l2_format *)argument)->fmt.pix = f->pix;
        return 0;
    case VIDIOC_S_FMT:
        return set_format(f, argument);
    case VIDIOC_G_PARM:
        parm->parm.capture.timeperframe = (struct v4l2_fract){f->interval_ms, 1000};
        return 0;
    case VIDIOC_S_PARM:
        return set_rate(f, argument);
    case VIDIOC_REQBUFS:
        return request_buffers(f, argument);
    case VIDIOC_QUERYBUF:
        return query_buffer(f, argument);
    case VIDIOC_QBUF:
        if (b->index >= GN_FAKE_BUFFERS || f->is_queued[b->index])
            fail_msg("buffer %u is queued twice", b->index);
        f->is_queued[b->index] = true;
        return 0;
    case VIDIOC_DQBUF:
        return dequeue(f, argument);
    case VIDIOC_STREAMON:
        f->n_streaming = 1;
        return 0;
    case VIDIOC_STREAMOFF:
        f->n_streaming = 0;
        forget_buffers(f);
        return 0;
    case VIDIOC_QUERYCTRL:
        return query_control(f, argument);
    case VIDIOC_G_CTRL:
        c->value = gn_fake_get_control(f, c->id)->value;
        return 0;
    case VIDIOC_S_CTRL: {
        struct gn_fake_control *control = gn_fake_get_control(f, c->id);
        int step = control->query.step;
        control->value = step > 1 ? c->value / step * step : c->value;
        return 0;
    }
    case VIDIOC_DQEVENT:
        if (!f->has_event)
            return -ENOENT;
        f->has_event = false;
        ((struct v4l2_event *)argument)->type = V4L2_EVENT_SOURCE_CHANGE;
        return 0;
    default:
        return -ENOTTY;
    }
}

static int fake_map(void *context, int fd, size_t n_bytes, int64_t offset, uint8_t **out_start)
{
    struct gn_fake *f = context;
    assert_int_equal(fd, FD);
    assert_true(n_bytes <= f->pix.sizeimage || f->length);
    uint8_t **memory = &f->memory[offset >> 16];
    *memory = malloc(f->pix.sizeimage);
    assert_non_null(*memory);
    *out_start = *memory;
    f->n_mapped++;
    return 0;
}

static void fake_unmap(void *context, uint8_t *start, size_t n_bytes)
{
    struct gn_fake *f = context;
    assert_true(n_bytes > 0);
    for (int i = 0; i < GN_FAKE_BUFFERS; i++) {
        if (f->memory[i] == start) {
            free(start); // so that a read after unmapping is seen
            f->memory[i] = NULL;
            f->n_mapped--;
            return;
        }
    }
    fail_msg("unmapped what was not mapped");
}

static int fake_wait(void *context, int fd, int timeout_ms)
{
    struct gn_fake *f = context;
    assert_in_range(timeout_ms, 0, 50);
    bool is_open = fd == FD;
    int events = is_open && (f->n_filled || f->is_gone) ? (f->is_gone ? POLLERR : POLLIN) : 0;
    if (is_open && f->has_event)
        events |= POLLPRI;
    if (is_open)
        events |= f->wait_events;
    if (!events)
        f->now_ns += timeout_ms * GN_NS_PER_MS;
    return events;
}

static int64_t fake_now_ns(void *context)
{
    return ((struct gn_fake *)context)->now_ns;
}

void gn_fake_init(struct gn_fake *fake)
{
    static const uint32_t yuyv[] = {V4L2_PIX_FMT_YUYV, 0};
    *fake = (struct gn_fake){
        .io = {.context = fake,
               .open = fake_open,
               .close = fake_close,
               .control = fake_control,
               .map = fake_map,
               .unmap = fake_unmap,
               .wait = fake_wait,
               .now_ns = fake_now_ns},
        .driver = "fake",
        .card = "Fake",
        .formats = yuyv,
        .max_width = 640,
        .interval_ms = 40,
        .now_ns = 1000 * GN_NS_PER_S,
    };
    fake->pix = (struct v4l2_pix_format){.width = 640, .height = 480};
    complete_format(fake, &fake->pix);
    gn_fake_add_control(fake, V4L2_CID_GAIN, "Gain", 0, 255, 7);
    gn_fake_add_control(fake, V4L2_CID_EXPOSURE_AUTO, "Exposure, Auto", 0, 3,
                        V4L2_EXPOSURE_APERTURE_PRIORITY);
    gn_fake_add_control(fake, V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure (Absolute)", 3, 2047, 250);
}

void gn_fake_finish(struct gn_fake *fake)
{
    assert_int_equal(fake->n_open, 0);
    assert_int_equal(fake->n_mapped, 0);
    for (int i = 0; i < GN_FAKE_BUFFERS; i++)
        free(fake->memory[i]);
}

struct v4l2_buffer *gn_fake_fill(struct gn_fake *fake, uint32_t sequence, int value)
{
    uint32_t i = 0;
    while (i < GN_FAKE_BUFFERS && !fake->is_queued[i])
        i++;
    if (i == GN_FAKE_BUFFERS)
        fail_msg("no buffer is queued");
    fake->is_queued[i] = false;
    memset(fake->memory[i], value, fake->pix.sizeimage);
    struct v4l2_buffer *b = &fake->filled[fake->n_filled++];
    *b = (struct v4l2_buffer){
        .index = i,
        .type = V4L2_BUF_TYPE_VIDEO_CAPTURE,
        .memory = V4L2_MEMORY_MMAP,
        .bytesused = fake->pix.sizeimage,
        .flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
        .timestamp = {.tv_sec = fake->now_ns / GN_NS_PER_S,
                      .tv_usec = fake->now_ns % GN_NS_PER_S / 1000},
        .sequence = sequence,
    };
    return b;
}

struct gn_fake_control *gn_fake_get_control(struct gn_fake *fake, uint32_t id)
{
    for (int i = 0; i < GN_FAKE_CONTROLS; i++) {
        if (fake->controls[i].query.id == id)
            return &fake->controls[i];
    }
    fail_msg("control %x is asked for, which there is not", id);
    return NULL;
}

struct gn_fake_control *gn_fake_add_control(struct gn_fake *fake, uint32_t id, const char *name,
                                            int minimum, int maximum, int value)
{
    int i = 0;
    while (fake->controls[i].query.id)
        i++;
    struct gn_fake_control *c = &fake->controls[i];
    *c = (struct gn_fake_control){.query = {.id = id,
                                            .type = V4L2_CTRL_TYPE_INTEGER,
                                            .minimum = minimum,
                                            .maximum = maximum,
                                            .step = 1},
                                  .value = value};
    snprintf((char *)c->query.name, sizeof(c->query.name), "%s", name);
    return c;
}
