/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/v4l2_device.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/text.h"

/** Most formats, sizes or rates of one list that are asked for: a driver may never end one. */
#define MAX_LISTED 256
/** A rate is met within this share: cameras say 29.97 for 30. */
#define RATE_TOLERANCE 0.01

int gn_v4l2_device_call(const struct gn_v4l2_device *device, unsigned long request, void *argument)
{
    return device->io->control(device->io->context, device->fd, request, argument);
}

void gn_v4l2_words_add(void *words, const char *word)
{
    struct gn_v4l2_words *w = words;
    size_t room = sizeof(w->text) - w->n, n = strlen(word);
    if (n + sizeof(", ...") > room) {
        if (room > sizeof(", ..."))
            snprintf(w->text + w->n, room, "%s", w->n ? ", ..." : "...");
        w->n = sizeof(w->text);
        return;
    }
    w->n += (size_t)snprintf(w->text + w->n, room, "%s%s", w->n ? ", " : "", word);
}

/** Whether the open node captures what we can read; sets its name. */
static int check_capability(struct gn_v4l2_device *d, struct gn_error *out_error)
{
    struct v4l2_capability cap = {0};
    int err = gn_v4l2_device_call(d, VIDIOC_QUERYCAP, &cap);
    if (err)
        return gn_error_set(out_error, -ENODEV, "%s: not a V4L2 device (%s)", d->path,
                            strerror(-err));
    snprintf(d->card, sizeof(d->card), "%.*s", (int)sizeof(cap.card), (const char *)cap.card);
    gn_text_clean(d->card);
    d->is_careless = strncmp((const char *)cap.driver, "v4l2 loopback", sizeof(cap.driver)) == 0;
    uint32_t caps = cap.capabilities & V4L2_CAP_DEVICE_CAPS ? cap.device_caps : cap.capabilities;
    if (!(caps & V4L2_CAP_VIDEO_CAPTURE))
        return gn_error_set(out_error, -ENODEV, "%s (%s): %s", d->path, d->card,
                            caps & V4L2_CAP_VIDEO_CAPTURE_MPLANE
                                ? "captures into several planes, which we do not read"
                                : "captures no video");
    if (!(caps & V4L2_CAP_STREAMING))
        return gn_error_set(out_error, -ENODEV, "%s (%s): does not stream into mapped buffers",
                            d->path, d->card);
    return 0;
}

int gn_v4l2_device_open(const struct gn_v4l2_io *io, const char *path, struct gn_v4l2_device *out,
                        struct gn_error *out_error)
{
    *out = (struct gn_v4l2_device){.io = io, .fd = -1};
    if (strlen(path) >= sizeof(out->path))
        return gn_error_set(out_error, -EINVAL,
                            "%s: too long for a device node such as /dev/video0", path);
    strcpy(out->path, path);
    int fd = io->open(io->context, path);
    if (fd == -ENOENT || fd == -ENODEV || fd == -ENXIO)
        return gn_error_set(out_error, -ENODEV, "%s: no camera there; gnomon doctor lists them",
                            path);
    if (fd == -EACCES || fd == -EPERM)
        return gn_error_set(out_error, fd, "%s: not allowed; is this user in the group 'video'?",
                            path);
    if (fd < 0)
        return gn_error_set(out_error, fd, "%s: %s", path, strerror(-fd));
    out->fd = fd;
    int err = check_capability(out, out_error);
    if (err)
        gn_v4l2_device_close(out);
    return err;
}

void gn_v4l2_device_close(struct gn_v4l2_device *device)
{
    if (device->fd >= 0)
        device->io->close(device->io->context, device->fd);
    device->fd = -1;
}

/** The i-th pixel format the driver offers; 0 at the end. */
static uint32_t get_fourcc(const struct gn_v4l2_device *d, uint32_t i)
{
    struct v4l2_fmtdesc f = {.index = i, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    return i < MAX_LISTED && gn_v4l2_device_call(d, VIDIOC_ENUM_FMT, &f) == 0 ? f.pixelformat : 0;
}

/** The i-th size, or range of sizes. */
static bool get_size(const struct gn_v4l2_device *d, uint32_t fourcc, uint32_t i,
                     struct v4l2_frmsize_stepwise *out)
{
    struct v4l2_frmsizeenum f = {.index = i, .pixel_format = fourcc};
    if (i >= MAX_LISTED || gn_v4l2_device_call(d, VIDIOC_ENUM_FRAMESIZES, &f) != 0)
        return false;
    if (f.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
        uint32_t w = f.discrete.width, h = f.discrete.height;
        *out = (struct v4l2_frmsize_stepwise){w, w, 1, h, h, 1};
        return true;
    }
    *out = f.stepwise;
    return i == 0; // a range is the only entry
}

static double get_rate_hz(const struct v4l2_fract *interval)
{
    return interval->numerator ? (double)interval->denominator / interval->numerator : 0;
}

/** The i-th rate, or range of rates, Hz. */
static bool get_rate(const struct gn_v4l2_device *d, uint32_t fourcc, uint32_t width,
                     uint32_t height, uint32_t i, double out_hz[static 2])
{
    struct v4l2_frmivalenum f = {
        .index = i, .pixel_format = fourcc, .width = width, .height = height};
    if (i >= MAX_LISTED || gn_v4l2_device_call(d, VIDIOC_ENUM_FRAMEINTERVALS, &f) != 0)
        return false;
    if (f.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
        out_hz[0] = out_hz[1] = get_rate_hz(&f.discrete);
        return true;
    }
    out_hz[0] = get_rate_hz(&f.stepwise.max);
    out_hz[1] = get_rate_hz(&f.stepwise.min);
    return i == 0;
}

static bool is_rate(double hz, double wanted_hz)
{
    return fabs(hz - wanted_hz) <= RATE_TOLERANCE * wanted_hz;
}

/** Whether the format is offered at that size and rate (0: at any), as far as the driver says. */
static bool is_offered(const struct gn_v4l2_device *d, uint32_t fourcc, uint32_t width,
                       uint32_t height, double rate_hz)
{
    struct v4l2_frmsize_stepwise s;
    bool has_size = !get_size(d, fourcc, 0, &s);
    for (uint32_t i = 0; !has_size && get_size(d, fourcc, i, &s); i++)
        has_size = width >= s.min_width && width <= s.max_width && height >= s.min_height &&
                   height <= s.max_height;
    double hz[2];
    bool has_rate = rate_hz == 0 || !get_rate(d, fourcc, width, height, 0, hz);
    for (uint32_t i = 0; !has_rate && get_rate(d, fourcc, width, height, i, hz); i++)
        has_rate = is_rate(rate_hz, rate_hz < hz[0] ? hz[0] : rate_hz > hz[1] ? hz[1] : rate_hz);
    return has_size && has_rate;
}

void gn_v4l2_device_list_formats(const struct gn_v4l2_device *device, gn_v4l2_word_fn word,
                                 void *context)
{
    uint32_t fourcc;
    for (uint32_t i = 0; (fourcc = get_fourcc(device, i)); i++) {
        char name[8];
        gn_v4l2_pixels_print_fourcc(fourcc, name);
        word(context, name);
    }
}

void gn_v4l2_device_list_sizes(const struct gn_v4l2_device *device, uint32_t fourcc,
                               gn_v4l2_word_fn word, void *context)
{
    struct v4l2_frmsize_stepwise s;
    for (uint32_t i = 0; get_size(device, fourcc, i, &s); i++) {
        char text[96];
        double hz[2], best_hz = 0;
        for (uint32_t k = 0; get_rate(device, fourcc, s.max_width, s.max_height, k, hz); k++)
            best_hz = fmax(best_hz, hz[1]);
        int n = s.min_width == s.max_width
                    ? snprintf(text, sizeof(text), "%ux%u", s.max_width, s.max_height)
                    : snprintf(text, sizeof(text), "%ux%u to %ux%u", s.min_width, s.min_height,
                               s.max_width, s.max_height);
        if (best_hz > 0)
            snprintf(text + n, sizeof(text) - (size_t)n, "@%.4g", best_hz);
        word(context, text);
    }
}

/** "what is not there; there are ...": formats, sizes of one, or rates of one. */
static int refuse_format(const struct gn_v4l2_device *d, const char *what, struct gn_error *error)
{
    struct gn_v4l2_words words = {0};
    for (int i = 0; gn_v4l2_pixels_get(i); i++) {
        for (uint32_t k = 0, fourcc; (fourcc = get_fourcc(d, k)); k++) {
            if (fourcc == gn_v4l2_pixels_get(i)->fourcc)
                gn_v4l2_words_add(&words, gn_v4l2_pixels_get(i)->name);
        }
    }
    if (!words.n)
        gn_v4l2_device_list_formats(d, gn_v4l2_words_add, &words);
    return gn_error_set(error, -EINVAL, "%s (%s): no %s; it has %s", d->path, d->card, what,
                        words.n ? words.text : "no pixel format at all");
}

static int refuse_size(const struct gn_v4l2_device *d, uint32_t fourcc, uint32_t width,
                       uint32_t height, struct gn_error *error)
{
    struct gn_v4l2_words words = {0};
    char name[8];
    gn_v4l2_pixels_print_fourcc(fourcc, name);
    gn_v4l2_device_list_sizes(d, fourcc, gn_v4l2_words_add, &words);
    return gn_error_set(error, -EINVAL, "%s (%s): no %ux%u in %s; it has %s", d->path, d->card,
                        width, height, name, words.n ? words.text : "sizes of its own choice");
}

static int refuse_rate(const struct gn_v4l2_device *d, const struct v4l2_pix_format *pix,
                       double rate_hz, struct gn_error *error)
{
    struct gn_v4l2_words words = {0};
    double hz[2];
    for (uint32_t i = 0; get_rate(d, pix->pixelformat, pix->width, pix->height, i, hz); i++) {
        char text[64];
        if (hz[0] == hz[1])
            snprintf(text, sizeof(text), "%.4g", hz[0]);
        else
            snprintf(text, sizeof(text), "%.4g to %.4g", hz[0], hz[1]);
        gn_v4l2_words_add(&words, text);
    }
    char name[8];
    gn_v4l2_pixels_print_fourcc(pix->pixelformat, name);
    return gn_error_set(error, -EINVAL, "%s (%s): no %g pictures/s at %ux%u in %s; it has %s",
                        d->path, d->card, rate_hz, pix->width, pix->height, name,
                        words.n ? words.text : "rates of its own choice");
}

/** Order in which formats are taken where none is asked for. */
static int get_rank(const struct gn_v4l2_pixels *pixels, int i, bool is_8_bit)
{
    return is_8_bit && pixels->depth > 8 ? i + MAX_LISTED : i;
}

/** The pixel format: that of the options, or the first in order that has the size and rate. */
static int choose(const struct gn_v4l2_device *d, const struct gn_live_options *options,
                  uint32_t width, uint32_t height, uint32_t *out_fourcc, struct gn_error *out_error)
{
    int best = INT32_MAX;
    uint32_t any = 0; // one that we read, whatever its sizes
    for (int i = 0; gn_v4l2_pixels_get(i); i++) {
        const struct gn_v4l2_pixels *p = gn_v4l2_pixels_get(i);
        bool is_there = false, is_wanted = !options->pixel_format;
        for (uint32_t k = 0, fourcc; !is_there && (fourcc = get_fourcc(d, k)); k++)
            is_there = fourcc == p->fourcc;
        if (options->pixel_format)
            is_wanted = strcmp(options->pixel_format, p->name) == 0;
        if (!is_there || !is_wanted)
            continue;
        int rank = get_rank(p, i, options->is_8_bit);
        any = any ? any : p->fourcc;
        if (rank < best && is_offered(d, p->fourcc, width, height, options->frame_rate_hz)) {
            best = rank;
            *out_fourcc = p->fourcc;
        }
    }
    if (best < INT32_MAX)
        return 0;
    if (!any) {
        char what[64] = "pixel format that we read";
        if (options->pixel_format)
            snprintf(what, sizeof(what), "pixel format '%.24s' that we read",
                     options->pixel_format);
        return refuse_format(d, what, out_error);
    }
    struct v4l2_pix_format pix = {.pixelformat = any, .width = width, .height = height};
    if (is_offered(d, any, width, height, 0))
        return refuse_rate(d, &pix, options->frame_rate_hz, out_error);
    return refuse_size(d, any, width, height, out_error);
}

/** The rate, set where it is asked for. */
static int set_rate(const struct gn_v4l2_device *d, const struct v4l2_pix_format *pix,
                    double wanted_hz, int64_t *out_frame_ns, struct gn_error *out_error)
{
    struct v4l2_streamparm parm = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    int err = gn_v4l2_device_call(d, VIDIOC_G_PARM, &parm);
    if (!err && wanted_hz > 0) {
        parm.parm.capture.timeperframe.numerator = 1000;
        parm.parm.capture.timeperframe.denominator = (uint32_t)lround(wanted_hz * 1000);
        err = gn_v4l2_device_call(d, VIDIOC_S_PARM, &parm);
    }
    double hz = err ? 0 : get_rate_hz(&parm.parm.capture.timeperframe);
    if (wanted_hz > 0 && (err || !is_rate(hz, wanted_hz)))
        return refuse_rate(d, pix, wanted_hz, out_error);
    *out_frame_ns = hz > 1e-3 ? (int64_t)(1e9 / hz) : 0;
    return 0;
}

int gn_v4l2_device_set_format(const struct gn_v4l2_device *device,
                              const struct gn_live_options *options,
                              struct gn_v4l2_layout *out_layout, int64_t *out_frame_ns,
                              struct gn_error *out_error)
{
    struct v4l2_format f = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    struct v4l2_pix_format *pix = &f.fmt.pix;
    int err = gn_v4l2_device_call(device, VIDIOC_G_FMT, &f);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): it does not say its format: %s", device->path,
                            device->card, strerror(-err));
    uint32_t width = options->width ? (uint32_t)options->width : pix->width;
    uint32_t height = options->height ? (uint32_t)options->height : pix->height;
    uint32_t fourcc = 0;
    err = choose(device, options, width, height, &fourcc, out_error);
    if (err)
        return err;
    *pix = (struct v4l2_pix_format){.width = width,
                                    .height = height,
                                    .pixelformat = fourcc,
                                    .field = V4L2_FIELD_NONE,
                                    .priv = V4L2_PIX_FMT_PRIV_MAGIC};
    err = gn_v4l2_device_call(device, VIDIOC_S_FMT, &f);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): %s", device->path, device->card,
                            err == -EBUSY ? "another program streams from it" : strerror(-err));
    if (pix->priv != V4L2_PIX_FMT_PRIV_MAGIC) // an old driver: what follows is not its word
        pix->ycbcr_enc = pix->quantization = 0;
    bool is_other_size =
        (options->width && pix->width != width) || (options->height && pix->height != height);
    if (pix->pixelformat != fourcc || is_other_size)
        return refuse_size(device, fourcc, width, height, out_error);
    struct gn_error why = {0};
    err = gn_v4l2_layout_init(pix, options->is_8_bit, out_layout, &why);
    if (err)
        return gn_error_set(out_error, err, "%s (%s): %s", device->path, device->card, why.text);
    return set_rate(device, pix, options->frame_rate_hz, out_frame_ns, out_error);
}
