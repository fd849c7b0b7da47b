/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdio.h>

#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "client/cmd_calibrate/calibrate_live.h"
#include "client/cmd_calibrate/calibrate_probe.h"

#define MAX_PICTURES 64

/* The mean of a camera's or video's pictures. */
static int take_picture(struct gn_probe_run *run, struct gn_image *out, struct gn_error *out_error)
{
    const struct gn_projection *p = &run->setup.projection;
    const struct gn_live_options wanted = {.width = p->width, .height = p->height};
    struct gn_source *source = NULL;
    int n = gn_probe_run_has(run, "frames")
                ? (int)gn_options_get_int(run->options, NULL, NULL, "frames")
                : 1;
    int full_scale = gn_probe_run_has(run, "full-scale")
                         ? (int)gn_options_get_int(run->options, NULL, NULL, "full-scale")
                         : 0;
    gn_cmd_catch_signals();
    int err = gn_calibrate_open(run->options, &wanted, &source, out_error);
    if (!err)
        err =
            gn_calibrate_take_mean(run->program, source, n, full_scale, out, &run->step, out_error);
    gn_source_close(&source);
    return err;
}

static int read_picture(struct gn_probe_run *run, int i, struct gn_image *out,
                        struct gn_error *out_error)
{
    const char *path = run->list.entries[i].path;
    struct gn_calibrate_format format = {.full_scale16 = run->setup.is_12_bit ? 4095 : 65535};
    if (gn_probe_run_has(run, "full-scale"))
        format.full_scale16 = gn_options_get_int(run->options, NULL, NULL, "full-scale");
    int err = gn_calibrate_is_live(run->options)
                  ? take_picture(run, out, out_error)
                  : gn_calibrate_read(path, &format, out, &run->step, out_error);
    struct gn_projection *p = &run->setup.projection;
    if (!err && p->width == 0 && p->height == 0) {
        p->width = out->width;
        p->height = out->height;
    }
    if (!err && (p->width != out->width || p->height != out->height)) {
        err = gn_error_set(out_error, -EINVAL,
                           "%s: %d x %d, but the probe's pictures are %d x %d: calibrate with "
                           "pictures of the mode that the probe runs in",
                           path, out->width, out->height, p->width, p->height);
        gn_image_finish(out);
    }
    return err;
}

/* One channel: the light's luminance. */
static int make_light(const struct gn_probe_run *run, const struct gn_image *image,
                      struct gn_image *out)
{
    enum { AT_ONCE = 512 };
    long n = (long)image->width * image->height;
    int err = gn_image_init(out, image->width, image->height, 1), channels = image->channels;
    for (long from = 0; !err && from < n; from += AT_ONCE) {
        float rgb[AT_ONCE][3];
        int count = (int)(n - from < AT_ONCE ? n - from : AT_ONCE);
        for (int i = 0; i < count; i++)
            for (int c = 0; c < 3; c++)
                rgb[i][c] = image->data[(from + i) * channels + (channels == 3 ? c : 0)];
        if (run->step > 0)
            gn_response_to_radiance(&run->setup.response, rgb[0], count);
        for (int i = 0; i < count; i++)
            out->data[from + i] = 0.2126f * rgb[i][0] + 0.7152f * rgb[i][1] + 0.0722f * rgb[i][2];
    }
    return err;
}

int gn_probe_run_read_light(struct gn_probe_run *run, int i, struct gn_image *out,
                            struct gn_error *out_error)
{
    if (run->live.data) {
        *out = run->live;
        run->live = (struct gn_image){0};
        return 0;
    }
    struct gn_image image = {0};
    int err = read_picture(run, i, &image, out_error);
    if (!err && make_light(run, &image, out) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    gn_image_finish(&image);
    return err;
}

/* The larger value of each pixel, where there was a picture before. */
static int keep_largest(struct gn_image *kept, const struct gn_image *more)
{
    long n = (long)more->width * more->height;
    bool is_first = !kept->data;
    if (is_first && gn_image_init(kept, more->width, more->height, 1) < 0)
        return -ENOMEM;
    for (long i = 0; i < n; i++)
        kept->data[i] = is_first ? more->data[i] : fmaxf(kept->data[i], more->data[i]);
    return 0;
}

/* What a person may have forgotten to say about codes: light is wrong then. */
static void hint(const struct gn_probe_run *run, const struct gn_image *image)
{
    long n = (long)image->width * image->height * image->channels;
    float largest = 0;
    for (long i = 0; i < n; i++)
        largest = fmaxf(largest, image->data[i]);
    if (!run->setup.has_response)
        printf("%s says no response: codes are taken as linear light\n",
               gn_probe_run_get(run, "out"));
    if (run->step < 1.5 / 65535 && largest <= 4095.5F / 65535)
        printf("no code is above 4095 of 65535: for 12 bits say --full-scale 4095, or pixel_format "
               "log12 in %s\n",
               gn_probe_run_get(run, "out"));
}

/* Adds a picture to those that were read. */
static int add_picture(struct gn_probe_run *run, int i, struct gn_error *out_error)
{
    struct gn_image image = {0}, gray = {0}, light = {0};
    int err = read_picture(run, i, &image, out_error);
    if (!err &&
        (gn_calibrate_make_gray(&image, &gray) < 0 || make_light(run, &image, &light) < 0 ||
         keep_largest(&run->first, &gray) < 0 || keep_largest(&run->first_light, &light) < 0))
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && i == 0 && run->step > 0 && !gn_probe_run_has(run, "ball"))
        hint(run, &image);
    if (!err && run->n_lamps > 0)
        err = gn_probe_run_look_for_lamps(run, i, &light, out_error);
    if (!err && gn_calibrate_is_live(run->options)) {
        run->live = light;
        light = (struct gn_image){0};
    }
    gn_image_finish(&image);
    gn_image_finish(&gray);
    gn_image_finish(&light);
    return err;
}

int gn_probe_run_read_all(struct gn_probe_run *run, struct gn_error *out_error)
{
    struct gn_file_entry *live;
    int err = 0;
    if (!gn_calibrate_is_live(run->options))
        err = gn_file_list_find(gn_probe_run_get(run, "files"), 1, &run->list, out_error);
    else if (gn_file_list_add(&run->list, "camera", &live) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && run->list.n_entries > MAX_PICTURES)
        err = gn_error_set(out_error, -E2BIG, "%s: %d pictures, at most %d are taken",
                           gn_probe_run_get(run, "files"), run->list.n_entries, MAX_PICTURES);
    for (int i = 0; !err && i < run->list.n_entries; i++)
        err = add_picture(run, i, out_error);
    return err;
}
