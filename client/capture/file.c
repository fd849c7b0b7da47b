/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/file.h"
#include "common/image_file.h"
#include "common/jpeg.h"

/** Largest file that is sent as it is. */
#define MAX_JPEG_BYTES ((size_t)64 << 20)

struct file_source {
    struct gn_source head;
    struct gn_file_list list;
    struct gn_file_source_options options;
    int next;                      // index into list
    double loop_s;                 // added to times: length of the loops that have passed
    char name[GN_FILE_NAME_BYTES]; // of the last capture
    uint8_t *buffer;               // its pixels where they are not those of `picture`; owned
    struct gn_image_file picture;
    struct gn_jpeg *jpeg;
};

/** Whether the file begins as a JPEG does. Not, where it cannot be read: its reader says why. */
static bool is_jpeg_file(const char *path)
{
    unsigned char head[4];
    struct stat st;
    FILE *f = stat(path, &st) == 0 && S_ISREG(st.st_mode) ? fopen(path, "rb") : NULL;
    bool is_jpeg =
        f && fread(head, 1, sizeof(head), f) == sizeof(head) && gn_jpeg_is_jpeg(head, sizeof(head));
    if (f)
        fclose(f);
    return is_jpeg;
}

/** Reads a JPEG file as it is: the server decodes it. */
static int read_jpeg(struct file_source *s, const char *path, struct gn_capture *out,
                     struct gn_error *out_error)
{
    size_t size = 0;
    int err = gn_file_read(path, MAX_JPEG_BYTES, &s->buffer, &size, out_error);
    if (err)
        return err;
    struct gn_error why = {0};
    int channels;
    if (!s->jpeg)
        err = gn_jpeg_create(&s->jpeg);
    if (err)
        gn_error_set(&why, err, "out of memory");
    else
        err =
            gn_jpeg_get_size(s->jpeg, s->buffer, size, &out->width, &out->height, &channels, &why);
    if (err)
        return gn_error_set(out_error, err, "%s: %s", path, why.text);
    out->format = GN_CAPTURE_JPEG;
    out->data = s->buffer;
    out->data_bytes = size;
    return 0;
}

/** Linear float picture of 1 or 3 channels to RGB float32. */
static int use_linear(struct file_source *s, struct gn_capture *out)
{
    const struct gn_image *image = &s->picture.linear;
    size_t n = (size_t)image->width * (size_t)image->height;
    out->format = GN_CAPTURE_RGB_F32;
    out->width = image->width;
    out->height = image->height;
    out->data_bytes = n * 3 * sizeof(float);
    out->data = (const uint8_t *)image->data;
    if (image->channels == 3)
        return 0;
    float *rgb = malloc(out->data_bytes);
    if (!rgb)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = image->data[i];
    s->buffer = (uint8_t *)rgb;
    out->data = s->buffer;
    return 0;
}

static int use_codes8(struct file_source *s, struct gn_capture *out)
{
    const struct gn_image8 *image = &s->picture.codes8;
    size_t n = (size_t)image->width * (size_t)image->height;
    bool is_wide = s->options.is_8_bit_16;
    out->format = is_wide ? GN_CAPTURE_RGB16 : GN_CAPTURE_RGB8;
    out->width = image->width;
    out->height = image->height;
    out->data_bytes = n * (is_wide ? 6 : 3);
    out->data = image->data;
    if (image->channels == 3 && !is_wide)
        return 0;
    s->buffer = malloc(out->data_bytes);
    if (!s->buffer)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < 3; c++) {
            uint8_t code = image->data[i * (size_t)image->channels + (image->channels < 3 ? 0 : c)];
            if (is_wide) // code * 257 has the same share of full scale
                s->buffer[6 * i + 2 * c] = s->buffer[6 * i + 2 * c + 1] = code;
            else
                s->buffer[3 * i + c] = code;
        }
    }
    out->data = s->buffer;
    return 0;
}

static int use_codes16(struct file_source *s, struct gn_capture *out, const char *path,
                       struct gn_error *out_error)
{
    const struct gn_image16 *image = &s->picture.codes16;
    bool is_mono = image->channels == 1, is_12 = s->options.is_12_bit;
    size_t n = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    for (size_t i = 0; is_12 && i < n; i++) {
        if (image->data[i] > 4095)
            return gn_error_set(out_error, -EDOM,
                                "%s: code %d is no 12-bit code [0, 4095]; is the setup's "
                                "pixel_format wrong?",
                                path, image->data[i]);
    }
    out->format = is_12 ? (is_mono ? GN_CAPTURE_MONO12 : GN_CAPTURE_RGB12)
                        : (is_mono ? GN_CAPTURE_MONO16 : GN_CAPTURE_RGB16);
    out->width = image->width;
    out->height = image->height;
    out->data = (const uint8_t *)image->data;
    out->data_bytes = n * 2;
    return 0;
}

static int read_picture(struct file_source *s, const char *path, struct gn_capture *out,
                        struct gn_error *out_error)
{
    free(s->buffer);
    s->buffer = NULL;
    gn_image_file_finish(&s->picture);
    if (is_jpeg_file(path))
        return read_jpeg(s, path, out, out_error);
    int err = gn_image_read_file(path, &s->picture, out_error);
    if (err)
        return err;
    switch (s->picture.kind) {
    case GN_IMAGE_LINEAR:
        err = use_linear(s, out);
        break;
    case GN_IMAGE_CODES8:
        err = use_codes8(s, out);
        break;
    case GN_IMAGE_CODES16:
        return use_codes16(s, out, path, out_error);
    }
    if (err)
        gn_error_set(out_error, err, "%s: %s", path, strerror(-err));
    return err;
}

static int file_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    struct file_source *s = (struct file_source *)source;
    if (s->next == s->list.n_entries) {
        if (!s->options.is_looped)
            return 0;
        // The pause before the first picture of the next round is the one before the last.
        int n = s->list.n_entries;
        double last = s->list.entries[n - 1].time_s;
        double step = n > 1 ? last - s->list.entries[n - 2].time_s : 1;
        s->loop_s += last - s->list.entries[0].time_s + step;
        s->next = 0;
    }
    const struct gn_file_entry *entry = &s->list.entries[s->next];
    struct gn_capture capture = {
        .time_s = entry->time_s - s->list.entries[0].time_s + s->loop_s,
        .has_pose = entry->has_pose,
        .world_from_camera = entry->world_from_camera,
    };
    int err = read_picture(s, entry->path, &capture, out_error);
    if (err)
        return err;
    gn_file_get_name(entry->path, s->name);
    capture.name = s->name;
    s->next++;
    *out = capture;
    return 1;
}

static void file_close(struct gn_source *source)
{
    struct file_source *s = (struct file_source *)source;
    gn_file_list_finish(&s->list);
    gn_image_file_finish(&s->picture);
    gn_jpeg_destroy(&s->jpeg);
    free(s->buffer);
    free(s);
}

static const struct gn_source_ops file_ops = {.read = file_read, .close = file_close};

int gn_file_source_open(struct gn_file_list *list, const struct gn_file_source_options *options,
                        struct gn_source **out_source)
{
    *out_source = NULL;
    struct file_source *s = calloc(1, sizeof(*s));
    if (!s)
        return -ENOMEM;
    s->head = (struct gn_source){.ops = &file_ops, .fd = -1};
    if (options)
        s->options = *options;
    s->list = *list;
    memset(list, 0, sizeof(*list));
    *out_source = &s->head;
    return 0;
}
