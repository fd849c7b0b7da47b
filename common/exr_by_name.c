/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/exr_private.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include <ImfCRgbaFile.h>

#include "common/half.h"

/*
 * Where light may have been cut. DWA moves 65504 to 64704 .. 65248 at its default level 45, where
 * 62016 is the largest value that surely survives (openexr #2606).
 */
#define SATURATED 62016.0f

int gn_exr_read_by_name(const char *path, const struct gn_exr_info *info,
                        struct gn_image *out_image, bool *out_saturated, struct gn_error *out_error)
{
    struct gn_image image = {0};
    ImfRgba *row = NULL;
    bool saturated = false;
    int x0, y0, x1, y1, r = gn_image_init(&image, info->width, info->height, info->channels);
    ImfInputFile *file = r ? NULL : ImfOpenInputFile(path);
    if (!r)
        row = malloc((size_t)info->width * sizeof(*row));
    if (r || !row) {
        r = gn_error_set(out_error, -ENOMEM, "EXR picture: out of memory");
        goto out;
    }
    if (!file)
        goto broken;
    ImfHeaderDataWindow(ImfInputHeader(file), &x0, &y0, &x1, &y1);
    if ((int64_t)x1 - x0 + 1 != info->width || (int64_t)y1 - y0 + 1 != info->height) {
        r = gn_error_set(out_error, -EINVAL, "EXR picture: it changed while it was read");
        goto out;
    }
    /* The frame buffer's base is where pixel (0, 0) would be; a row stride of 0 keeps one row. */
    ImfRgba *base = (ImfRgba *)((uintptr_t)row - (uintptr_t)(intptr_t)x0 * sizeof(*row));
    if (!ImfInputSetFrameBuffer(file, base, 1, 0))
        goto broken;
    for (int y = 0; y < info->height; y++) {
        if (!ImfInputReadPixels(file, y0 + y, y0 + y))
            goto broken;
        for (int x = 0; x < info->width; x++) {
            const ImfHalf rgb[3] = {row[x].r, row[x].g, row[x].b};
            for (int c = 0; c < info->channels; c++) {
                float v = gn_half_to_float(rgb[c]);
                saturated = saturated || fabsf(v) >= SATURATED;
                gn_image_at(&image, x, y)[c] = v;
            }
        }
    }
    *out_image = image;
    image = (struct gn_image){0};
    if (out_saturated)
        *out_saturated = saturated;
    goto out;
broken:
    r = gn_error_set(out_error, -EINVAL, "bad EXR picture: %s", ImfErrorMessage());
out:
    if (file)
        ImfCloseInputFile(file);
    free(row);
    gn_image_finish(&image);
    return r;
}
