/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/jpeg.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <turbojpeg.h>

struct gn_jpeg {
    tjhandle encoder;
    tjhandle decoder;
};

bool gn_jpeg_is_jpeg(const void *data, size_t size)
{
    static const uint8_t start[3] = {0xff, 0xd8, 0xff};
    return size >= sizeof(start) && memcmp(data, start, sizeof(start)) == 0;
}

int gn_jpeg_create(struct gn_jpeg **out_jpeg)
{
    *out_jpeg = NULL;
    struct gn_jpeg *jpeg = calloc(1, sizeof(*jpeg));
    if (!jpeg)
        return -ENOMEM;
    jpeg->encoder = tjInitCompress();
    jpeg->decoder = tjInitDecompress();
    if (!jpeg->encoder || !jpeg->decoder) {
        gn_jpeg_destroy(&jpeg);
        return -ENOMEM;
    }
    *out_jpeg = jpeg;
    return 0;
}

void gn_jpeg_destroy(struct gn_jpeg **jpeg)
{
    struct gn_jpeg *j = *jpeg;
    if (!j)
        return;
    if (j->encoder)
        tjDestroy(j->encoder);
    if (j->decoder)
        tjDestroy(j->decoder);
    free(j);
    *jpeg = NULL;
}

int gn_jpeg_get_size(struct gn_jpeg *jpeg, const void *data, size_t size, int *out_width,
                     int *out_height, int *out_channels, struct gn_error *out_error)
{
    int width = 0, height = 0, subsampling = 0, colorspace = 0;
    if (tjDecompressHeader3(jpeg->decoder, data, size, &width, &height, &subsampling,
                            &colorspace) != 0)
        return gn_error_set(out_error, -EINVAL, "bad JPEG picture: %s",
                            tjGetErrorStr2(jpeg->decoder));
    if (width < 1 || height < 1 || width > GN_IMAGE_MAX_SIDE || height > GN_IMAGE_MAX_SIDE ||
        (int64_t)width * height > GN_IMAGE_MAX_PIXELS)
        return gn_error_set(out_error, -EINVAL,
                            "JPEG picture of %d x %d px: sides must lie in [1, %d], pixels in "
                            "[1, %d]",
                            width, height, GN_IMAGE_MAX_SIDE, GN_IMAGE_MAX_PIXELS);
    if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
        return gn_error_set(out_error, -EINVAL, "JPEG picture: CMYK; gray and RGB are read");
    *out_width = width;
    *out_height = height;
    *out_channels = colorspace == TJCS_GRAY ? 1 : 3;
    return 0;
}

int gn_jpeg_decode(struct gn_jpeg *jpeg, const void *data, size_t size, struct gn_image8 *image,
                   struct gn_error *out_error)
{
    int width, height, channels;
    int r = gn_jpeg_get_size(jpeg, data, size, &width, &height, &channels, out_error);
    if (r)
        return r;
    if (width != image->width || height != image->height ||
        (image->channels != 1 && image->channels != 3))
        return gn_error_set(out_error, -EINVAL,
                            "JPEG picture of %d x %d px where %d x %d px of 1 or 3 channels are "
                            "expected",
                            width, height, image->width, image->height);
    int format = image->channels == 1 ? TJPF_GRAY : TJPF_RGB;
    if (tjDecompress2(jpeg->decoder, data, size, image->data, width, width * image->channels,
                      height, format, TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0)
        return gn_error_set(out_error, -EINVAL, "bad JPEG picture: %s",
                            tjGetErrorStr2(jpeg->decoder));
    return 0;
}

size_t gn_jpeg_get_bound(int width, int height)
{
    return tjBufSize(width, height, TJSAMP_444);
}

int gn_jpeg_encode(struct gn_jpeg *jpeg, const struct gn_image8 *image,
                   const struct gn_jpeg_options *options, uint8_t *out, size_t capacity,
                   size_t *out_size, struct gn_error *out_error)
{
    int quality = options && options->quality ? options->quality : 90;
    bool is_full_chroma = options && options->is_full_chroma, is_gray = image->channels == 1;
    if ((image->channels != 1 && image->channels != 3) || quality < 1 || quality > 100 ||
        capacity < gn_jpeg_get_bound(image->width, image->height))
        return gn_error_set(out_error, -EINVAL,
                            "cannot write a JPEG of %d channels at quality %d into %zu bytes",
                            image->channels, quality, capacity);
    unsigned long n = capacity;
    int subsampling = is_gray ? TJSAMP_GRAY : is_full_chroma ? TJSAMP_444 : TJSAMP_420;
    if (tjCompress2(jpeg->encoder, image->data, image->width, image->width * image->channels,
                    image->height, is_gray ? TJPF_GRAY : TJPF_RGB, &out, &n, subsampling, quality,
                    TJFLAG_NOREALLOC) != 0)
        return gn_error_set(out_error, -EINVAL, "cannot write a JPEG: %s",
                            tjGetErrorStr2(jpeg->encoder));
    *out_size = n;
    return 0;
}
