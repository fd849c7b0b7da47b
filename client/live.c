/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/live.h"

#include <errno.h>
#include <stdlib.h>

#include "client/capture/gige.h"
#include "client/capture/v4l2.h"
#include "proto/attr.h"

/** Most pixels a side of a picture has. */
#define MAX_SIDE_PX 16384

static const struct {
    const char *flag;
    int (*open)(const struct gn_live_options *options, struct gn_source **out_source,
                struct gn_error *out_error);
} kinds[] = {
    {"gige", gn_gige_open},
    {"v4l2", gn_v4l2_open},
};

int gn_live_count_asked(const struct gn_options *options)
{
    int n = 0;
    for (size_t i = 0; i < GN_ARRAY_LEN(kinds); i++)
        n += gn_options_is_set(options, NULL, NULL, kinds[i].flag);
    return n;
}

static bool has_exposure(const struct gn_options *options)
{
    return gn_options_is_known(options, NULL, "exposure-us") &&
           gn_options_is_set(options, NULL, NULL, "exposure-us");
}

const char *gn_live_find_misuse(const struct gn_options *options)
{
    static const char *const settings[] = {"frame-size",   "frame-rate",         "gain",
                                           "pixel-format", "lock-white-balance", "controls"};
    static const char of_cameras[] =
        "--frame-size, --frame-rate, --gain and what else sets a camera are for cameras, and none "
        "is named";
    int n_cameras = gn_live_count_asked(options);
    if (n_cameras > 1)
        return "one camera can be read, not several";
    for (size_t i = 0; n_cameras == 0 && i < GN_ARRAY_LEN(settings); i++) {
        if (gn_options_is_set(options, NULL, NULL, settings[i]))
            return of_cameras;
    }
    return n_cameras == 0 && has_exposure(options) ? of_cameras : NULL;
}

static int read_size(const char *text, struct gn_live_options *live, struct gn_error *out_error)
{
    char *end = NULL;
    long width = strtol(text, &end, 10), height = 0;
    if (*end == 'x')
        height = strtol(end + 1, &end, 10);
    if (*end || width < 1 || width > MAX_SIDE_PX || height < 1 || height > MAX_SIDE_PX)
        return gn_error_set(out_error, -EINVAL,
                            "--frame-size %s: width x height in pixels, each in [1, %d], such as "
                            "640x480",
                            text, MAX_SIDE_PX);
    live->width = (int)width;
    live->height = (int)height;
    return 0;
}

int gn_live_open(const struct gn_options *options, const struct gn_live_options *wanted,
                 struct gn_source **out_source, struct gn_error *out_error)
{
    *out_source = NULL;
    struct gn_live_options live = *wanted;
    const char *size = gn_options_get_string(options, NULL, NULL, "frame-size");
    int err = size ? read_size(size, &live, out_error) : 0;
    if (err)
        return err;
    if (gn_options_is_set(options, NULL, NULL, "frame-rate"))
        live.frame_rate_hz = gn_options_get_double(options, NULL, NULL, "frame-rate");
    if (has_exposure(options))
        live.exposure_us = gn_options_get_double(options, NULL, NULL, "exposure-us");
    live.has_gain = gn_options_is_set(options, NULL, NULL, "gain");
    if (live.has_gain)
        live.gain = gn_options_get_double(options, NULL, NULL, "gain");
    live.pixel_format = gn_options_get_string(options, NULL, NULL, "pixel-format");
    live.is_white_balance_locked = gn_options_get_bool(options, NULL, NULL, "lock-white-balance");
    live.controls = gn_options_get_string(options, NULL, NULL, "controls");
    for (size_t i = 0; i < GN_ARRAY_LEN(kinds); i++) {
        live.id = gn_options_get_string(options, NULL, NULL, kinds[i].flag);
        if (live.id)
            return kinds[i].open(&live, out_source, out_error);
    }
    return gn_error_set(out_error, -EINVAL, "no camera is named");
}

void gn_live_print_counts(const struct gn_source *source, FILE *out)
{
    struct gn_source_counts c;
    gn_source_get_counts(source, &c);
    fprintf(out,
            "camera: %llu whole pictures, %llu incomplete, %llu lost, %llu skipped for newer ones; "
            "%llu packets lost, %llu resent; opened again %llu times; %.2f copies a picture\n",
            (unsigned long long)c.n_complete, (unsigned long long)c.n_incomplete,
            (unsigned long long)c.n_lost, (unsigned long long)c.n_skipped,
            (unsigned long long)c.n_lost_packets, (unsigned long long)c.n_resent_packets,
            (unsigned long long)c.n_reopened,
            c.read_bytes ? (double)c.copied_bytes / (double)c.read_bytes : 0);
}
