/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_series.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static int list_files(struct gn_calibrate_series *series, const char *pattern, int most,
                      struct gn_error *out_error)
{
    struct gn_file_list list = {0};
    int err = gn_file_list_find(pattern, 1, &list, out_error);
    if (!err && list.n_entries > most)
        err = gn_error_set(out_error, -EINVAL, "%s: %d pictures, at most %d are taken", pattern,
                           list.n_entries, most);
    for (int k = 0; !err && k < list.n_entries; k++) {
        series->names[k] = strdup(list.entries[k].path);
        series->n += series->names[k] != NULL;
        if (!series->names[k])
            err = gn_error_set(out_error, -ENOMEM, "out of memory");
    }
    gn_file_list_finish(&list);
    return err;
}

int gn_calibrate_series_list(struct gn_calibrate_series *series, const char *pattern, int most,
                             const char *times_text, struct gn_error *out_error)
{
    int err = list_files(series, pattern, most, out_error);
    if (!err && times_text) {
        int n = gn_calibrate_read_numbers("times", times_text, series->n, GN_SERIES_MAX,
                                          series->times, out_error);
        err = n < 0 ? n : 0;
        series->has_times = !err;
    }
    for (int k = 0; !err && series->has_times && k < series->n; k++)
        if (!(series->times[k] > 0))
            err =
                gn_error_set(out_error, -EINVAL, "--times: %g for %s; an exposure time is above 0",
                             series->times[k], series->names[k]);
    return err;
}

int gn_calibrate_series_read(const struct gn_calibrate_series *series, int k,
                             struct gn_image *out_image, double *out_code_step,
                             struct gn_error *out_error)
{
    const char *name = series->names[k];
    double step = 0;
    int err = series->taken ? gn_calibrate_convert(name, &series->taken[k], &series->format,
                                                   out_image, &step, out_error)
                            : gn_calibrate_read(name, &series->format, out_image, &step, out_error);
    if (!err && series->bits > 0 && step > 0)
        step = 1.0 / ((1 << series->bits) - 1);
    if (!err && out_code_step)
        *out_code_step = step;
    return err;
}

int gn_calibrate_series_get_codes8(struct gn_calibrate_series *series, int k,
                                   struct gn_image8 *out_image, struct gn_error *out_error)
{
    struct gn_image_file file = {.kind = GN_IMAGE_LINEAR};
    int err = 0;
    if (series->taken) {
        file = series->taken[k];
        memset(&series->taken[k], 0, sizeof(series->taken[k]));
    } else {
        err = gn_image_read_file(series->names[k], &file, out_error);
    }
    if (!err && file.kind != GN_IMAGE_CODES8)
        err = gn_error_set(out_error, -EINVAL,
                           "%s: a stack is of 8-bit pictures, PNG or JPEG; for other sensors take "
                           "a chart",
                           series->names[k]);
    if (!err) {
        *out_image = file.codes8;
        file.codes8 = (struct gn_image8){0};
    }
    gn_image_file_finish(&file);
    return err;
}

void gn_calibrate_series_finish(struct gn_calibrate_series *series)
{
    if (!series)
        return;
    for (int k = 0; k < GN_SERIES_MAX; k++) {
        free(series->names[k]);
        if (series->taken)
            gn_image_file_finish(&series->taken[k]);
    }
    free(series->taken);
    memset(series, 0, sizeof(*series));
}
