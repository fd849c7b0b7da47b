/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/file.h"

#include <dirent.h>
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/image_file.h"
#include "common/jpeg.h"

/** Largest file that is sent as it is. */
#define MAX_JPEG_BYTES (64L << 20)

void gn_file_list_finish(struct gn_file_list *list)
{
    for (int i = 0; i < list->n_entries; i++)
        free(list->entries[i].path);
    free(list->entries);
    memset(list, 0, sizeof(*list));
}

int gn_file_list_add(struct gn_file_list *list, const char *path, struct gn_file_entry **out_entry)
{
    if (list->n_entries == GN_FILE_SOURCE_MAX)
        return -E2BIG;
    // Grows at powers of two.
    int n = list->n_entries;
    if ((n & (n - 1)) == 0) {
        size_t capacity = n ? 2 * (size_t)n : 1;
        struct gn_file_entry *grown = realloc(list->entries, capacity * sizeof(*grown));
        if (!grown)
            return -ENOMEM;
        list->entries = grown;
    }
    struct gn_file_entry *entry = &list->entries[n];
    memset(entry, 0, sizeof(*entry));
    entry->path = strdup(path);
    if (!entry->path)
        return -ENOMEM;
    list->n_entries = n + 1;
    if (out_entry)
        *out_entry = entry;
    return 0;
}

static bool is_regular(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

/** A folder stands for all in it: "DIR/" followed by '*', the folder's own special characters kept.
 */
static char *make_pattern(const char *pattern)
{
    struct stat st;
    if (stat(pattern, &st) != 0 || !S_ISDIR(st.st_mode))
        return strdup(pattern);
    char *out = malloc(2 * strlen(pattern) + 3);
    if (!out)
        return NULL;
    char *p = out;
    for (const char *c = pattern; *c; c++) {
        if (strchr("*?[\\", *c))
            *p++ = '\\';
        *p++ = *c;
    }
    memcpy(p, "/*", 3);
    return out;
}

int gn_file_list_find(const char *pattern, double rate_hz, struct gn_file_list *list,
                      struct gn_error *out_error)
{
    glob_t found = {0};
    char *whole = make_pattern(pattern);
    int err = whole ? 0 : -ENOMEM;
    if (!err) {
        int got = glob(whole, 0, NULL, &found); // sorts by name
        if (got == GLOB_NOSPACE)
            err = -ENOMEM;
        else if (got != 0 && got != GLOB_NOMATCH)
            err = -EIO;
    }
    for (size_t i = 0; !err && i < found.gl_pathc; i++) {
        if (!is_regular(found.gl_pathv[i]))
            continue;
        struct gn_file_entry *entry = NULL;
        err = gn_file_list_add(list, found.gl_pathv[i], &entry);
        if (!err)
            entry->time_s = rate_hz > 0 ? (list->n_entries - 1) / rate_hz : 0;
    }
    globfree(&found);
    free(whole);
    if (!err && list->n_entries == 0)
        err = -ENOENT;
    if (err) {
        gn_file_list_finish(list);
        gn_error_set(out_error, err, "%s: %s", pattern,
                     err == -ENOENT
                         ? "no file there (a folder, or a pattern such as 'frames/*.png')"
                     : err == -E2BIG ? "too many files"
                                     : strerror(-err));
    }
    return err;
}

struct file_source {
    struct gn_source head;
    struct gn_file_list list;
    struct gn_file_source_options options;
    int next;        // index into list
    double loop_s;   // added to times: length of the loops that have passed
    char name[256];  // of the last capture
    uint8_t *buffer; // its pixels where they are not those of `picture`; owned
    struct gn_image_file picture;
    struct gn_jpeg *jpeg;
};

static void set_name(struct file_source *s, const char *path)
{
    const char *base = strrchr(path, '/');
    base = base ? base + 1 : path;
    snprintf(s->name, sizeof(s->name), "%s", base);
    char *dot = strrchr(s->name, '.');
    if (dot && dot != s->name)
        *dot = '\0';
}

/** Reads a whole JPEG file. 1: it is one; 0: it is none. */
static int read_jpeg(struct file_source *s, const char *path, struct gn_capture *out,
                     struct gn_error *out_error)
{
    FILE *f = fopen(path, "rb");
    if (!f)
        return gn_error_set(out_error, -errno, "%s: %s", path, strerror(errno));
    unsigned char head[4] = {0};
    int err = 0;
    if (fread(head, 1, sizeof(head), f) != sizeof(head) || !gn_jpeg_is_jpeg(head, sizeof(head)))
        goto out;
    long size = fseek(f, 0, SEEK_END) == 0 ? ftell(f) : -1;
    if (size < 0 || size > MAX_JPEG_BYTES) {
        err = gn_error_set(out_error, -EFBIG, "%s: larger than %ld bytes", path, MAX_JPEG_BYTES);
        goto out;
    }
    rewind(f);
    s->buffer = malloc((size_t)size);
    if (!s->buffer) {
        err = -ENOMEM;
        goto out;
    }
    if (fread(s->buffer, 1, (size_t)size, f) != (size_t)size) {
        err = gn_error_set(out_error, -EIO, "%s: could not be read", path);
        goto out;
    }
    if (!s->jpeg)
        err = gn_jpeg_create(&s->jpeg);
    struct gn_error why = {0};
    int channels;
    if (!err)
        err = gn_jpeg_get_size(s->jpeg, s->buffer, (size_t)size, &out->width, &out->height,
                               &channels, &why);
    if (err) {
        gn_error_set(out_error, err, "%s: %s", path, why.text);
        goto out;
    }
    out->format = GN_CAPTURE_JPEG;
    out->data = s->buffer;
    out->data_bytes = (size_t)size;
    err = 1;
out:
    fclose(f);
    return err;
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
    int got = read_jpeg(s, path, out, out_error);
    if (got != 0)
        return got < 0 ? got : 0;
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
    set_name(s, entry->path);
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
    s->head.ops = &file_ops;
    if (options)
        s->options = *options;
    s->list = *list;
    memset(list, 0, sizeof(*list));
    *out_source = &s->head;
    return 0;
}
