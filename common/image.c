/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/image.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static bool is_size_ok(int width, int height, int channels)
{
    return width >= 1 && width <= GN_IMAGE_MAX_SIDE && height >= 1 && height <= GN_IMAGE_MAX_SIDE &&
           (int64_t)width * height <= GN_IMAGE_MAX_PIXELS && channels >= 1 && channels <= 4;
}

static int allocate_zeroed(int width, int height, int channels, size_t sample_bytes,
                           void **out_data)
{
    *out_data = NULL;
    if (!is_size_ok(width, height, channels))
        return -EINVAL;
    size_t n_bytes = (size_t)width * (size_t)height * (size_t)channels * sample_bytes;
    void *data = aligned_alloc(64, (n_bytes + 63) / 64 * 64);
    if (!data)
        return -ENOMEM;
    memset(data, 0, n_bytes);
    *out_data = data;
    return 0;
}

int gn_image_init(struct gn_image *image, int width, int height, int channels)
{
    void *data;
    int rc = allocate_zeroed(width, height, channels, sizeof(float), &data);
    *image = rc < 0 ? (struct gn_image){0} : (struct gn_image){width, height, channels, data};
    return rc;
}

void gn_image_finish(struct gn_image *image)
{
    free(image->data);
    *image = (struct gn_image){0};
}

int gn_image8_init(struct gn_image8 *image, int width, int height, int channels)
{
    void *data;
    int rc = allocate_zeroed(width, height, channels, sizeof(uint8_t), &data);
    *image = rc < 0 ? (struct gn_image8){0} : (struct gn_image8){width, height, channels, data};
    return rc;
}

void gn_image8_finish(struct gn_image8 *image)
{
    free(image->data);
    *image = (struct gn_image8){0};
}

int gn_image16_init(struct gn_image16 *image, int width, int height, int channels)
{
    void *data;
    int rc = allocate_zeroed(width, height, channels, sizeof(uint16_t), &data);
    *image = rc < 0 ? (struct gn_image16){0} : (struct gn_image16){width, height, channels, data};
    return rc;
}

void gn_image16_finish(struct gn_image16 *image)
{
    free(image->data);
    *image = (struct gn_image16){0};
}
