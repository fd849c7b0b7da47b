/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/hdr.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"

/* What is left of the file. */
struct cursor {
    const uint8_t *at;
    size_t n;
};

/* How scanlines lie in the picture. */
struct layout {
    int n_scans, length;             // scanlines, pixels of one
    bool is_column;                  // scanlines run along y
    bool is_x_falling, is_y_falling; // as stored: -X; +Y (rows from the bottom)
};

struct header {
    int width, height;
    struct layout layout;
    double scale[3]; // radiance per file unit
};

/* Takes one line, without its end, into line[size]; longer ones are cut. False at the end. */
static bool take_line(struct cursor *c, char *line, size_t size)
{
    const uint8_t *end = c->n ? memchr(c->at, '\n', c->n) : NULL;
    if (!end)
        return false;
    size_t n = (size_t)(end - c->at), kept = n < size - 1 ? n : size - 1;
    memcpy(line, c->at, kept);
    line[kept] = '\0';
    line[strcspn(line, "\r")] = '\0';
    c->at += n + 1;
    c->n -= n + 1;
    return true;
}

bool gn_hdr_is_hdr(const void *data, size_t size)
{
    if (size >= 2 && memcmp(data, "#?", 2) == 0)
        return true;
    /* Converters once wrote their own first line: then the FORMAT line tells. */
    struct cursor c = {data, size < 4096 ? size : 4096};
    char line[64];
    while (take_line(&c, line, sizeof(line)) && line[0] != '\0')
        if (strncmp(line, "FORMAT=32-bit_rle_", 18) == 0)
            return true;
    return false;
}

/* "-Y 512 +X 1024" and its seven sisters. */
static bool parse_resolution(const char *line, struct header *h)
{
    char s1, a1, s2, a2;
    int n1, n2, end = 0;
    if (sscanf(line, "%c%c %9d %c%c %9d %n", &s1, &a1, &n1, &s2, &a2, &n2, &end) != 6 || !end ||
        line[end] != '\0')
        return false;
    if (!((a1 == 'Y' && a2 == 'X') || (a1 == 'X' && a2 == 'Y')) || (s1 != '-' && s1 != '+') ||
        (s2 != '-' && s2 != '+'))
        return false;
    bool is_column = a1 == 'X';
    h->width = is_column ? n1 : n2;
    h->height = is_column ? n2 : n1;
    h->layout = (struct layout){.n_scans = n1,
                                .length = n2,
                                .is_column = is_column,
                                .is_x_falling = (is_column ? s1 : s2) == '-',
                                .is_y_falling = (is_column ? s2 : s1) == '+'};
    return true;
}

/* Returns NULL, or what is wrong. */
static const char *parse_header(struct cursor *c, struct header *out)
{
    struct header h = {.scale = {1, 1, 1}};
    char line[256];
    for (int n_lines = 0;; n_lines++) {
        if (n_lines == 1000 || !take_line(c, line, sizeof(line)))
            return "the header does not end";
        if (line[0] == '\0')
            break;
        double v[3];
        if (strncmp(line, "FORMAT=", 7) == 0 && !strstr(line, "32-bit_rle_rgbe"))
            return "only FORMAT=32-bit_rle_rgbe is read";
        if (sscanf(line, "EXPOSURE=%lf", &v[0]) == 1)
            v[2] = v[1] = v[0];
        else if (sscanf(line, "COLORCORR=%lf %lf %lf", &v[0], &v[1], &v[2]) != 3)
            continue;
        for (int i = 0; i < 3; i++) {
            h.scale[i] /= v[i];
            if (!(v[i] > 0 && h.scale[i] > 1e-30 && h.scale[i] < 1e30))
                return "EXPOSURE and COLORCORR must be positive and their products sane";
        }
    }
    if (!take_line(c, line, sizeof(line)) || !parse_resolution(line, &h))
        return "the resolution line is missing or not like \"-Y 512 +X 1024\"";
    *out = h;
    return NULL;
}

/* New run lengths: the four bytes of all pixels, one after the other. False where damaged. */
static bool take_new_scan(struct cursor *c, int length, uint8_t *rgbe)
{
    for (int byte = 0; byte < 4; byte++) {
        for (int x = 0; x < length;) {
            if (c->n < 2)
                return false;
            int count = c->at[0];
            bool is_run = count > 128;
            if (is_run)
                count -= 128;
            size_t n_used = is_run ? 2 : 1 + (size_t)count;
            if (count == 0 || count > length - x || n_used > c->n)
                return false;
            for (int i = 0; i < count; i++)
                rgbe[4 * (x + i) + byte] = c->at[is_run ? 1 : 1 + i];
            x += count;
            c->at += n_used;
            c->n -= n_used;
        }
    }
    return true;
}

/* Flat pixels, where (1, 1, 1, n) repeats the last one n times, the next such n << 8 times, ... */
static bool take_old_scan(struct cursor *c, int length, uint8_t *rgbe)
{
    int shift = 0;
    for (int x = 0; x < length;) {
        if (c->n < 4)
            return false;
        const uint8_t *p = c->at;
        c->at += 4;
        c->n -= 4;
        if (p[0] != 1 || p[1] != 1 || p[2] != 1) {
            memcpy(rgbe + 4 * x++, p, 4);
            shift = 0;
            continue;
        }
        long count = (long)p[3] << shift;
        shift += 8;
        if (x == 0 || shift > 24 || count > length - x)
            return false;
        for (; count > 0; count--, x++)
            memcpy(rgbe + 4 * x, rgbe + 4 * (x - 1), 4);
    }
    return true;
}

static bool take_scan(struct cursor *c, int length, uint8_t *rgbe)
{
    bool is_new = length >= 8 && length < 32768 && c->n >= 4 && c->at[0] == 2 && c->at[1] == 2 &&
                  c->at[2] < 128;
    if (!is_new)
        return take_old_scan(c, length, rgbe);
    if ((c->at[2] << 8 | c->at[3]) != length)
        return false;
    c->at += 4;
    c->n -= 4;
    return take_new_scan(c, length, rgbe);
}

static void store_scan(const struct header *h, int scan, const uint8_t *rgbe,
                       struct gn_image *image)
{
    const struct layout *l = &h->layout;
    for (int i = 0; i < l->length; i++, rgbe += 4) {
        int x = l->is_column ? scan : i, y = l->is_column ? i : scan;
        float *out = gn_image_at(image, l->is_x_falling ? h->width - 1 - x : x,
                                 l->is_y_falling ? h->height - 1 - y : y);
        double unit = rgbe[3] ? ldexp(1, rgbe[3] - 136) : 0;
        for (int k = 0; k < 3; k++)
            out[k] = (float)fmin(unit * rgbe[k] * h->scale[k], 3.4028234663852886e38);
    }
}

int gn_hdr_read_memory(const void *data, size_t size, struct gn_image *out_image,
                       struct gn_error *out_error)
{
    struct cursor c = {data, size};
    struct header h;
    struct gn_image image = {0};
    uint8_t *rgbe = NULL;
    const char *reason = parse_header(&c, &h);
    if (reason)
        return gn_error_set(out_error, -EINVAL, "bad Radiance picture: %s", reason);
    /* No scanline takes less than 4 bytes: no picture out of nothing. */
    if (h.width < 1 || h.height < 1 || (size_t)h.layout.n_scans > c.n / 4)
        return gn_error_set(out_error, -EINVAL,
                            "bad Radiance picture: %d x %d px cannot be in %zu bytes", h.width,
                            h.height, c.n);
    int r = gn_image_init(&image, h.width, h.height, 3);
    if (r) {
        gn_error_set(out_error, r, "Radiance picture of %d x %d px: %s", h.width, h.height,
                     r == -ENOMEM ? "out of memory" : "larger than 16384 px or 67108864 pixels");
        goto out;
    }
    rgbe = malloc((size_t)h.layout.length * 4);
    if (!rgbe) {
        r = gn_error_set(out_error, -ENOMEM, "Radiance picture: out of memory");
        goto out;
    }
    for (int scan = 0; scan < h.layout.n_scans; scan++) {
        if (!take_scan(&c, h.layout.length, rgbe)) {
            r = gn_error_set(out_error, -EINVAL,
                             "bad Radiance picture: scanline %d of %d is damaged or cut", scan,
                             h.layout.n_scans);
            goto out;
        }
        store_scan(&h, scan, rgbe, &image);
    }
    *out_image = image;
    image = (struct gn_image){0};
out:
    free(rgbe);
    gn_image_finish(&image);
    return r;
}

static void encode_pixel(const float rgb[static 3], uint8_t out[static 4])
{
    double v[3], max = 0;
    for (int i = 0; i < 3; i++) {
        v[i] = rgb[i] > 0 ? fmin((double)rgb[i], 0x1.fep126) : 0; // largest: 255 * 2^119
        max = fmax(max, v[i]);
    }
    memset(out, 0, 4);
    int e;
    frexp(max, &e);
    if (ldexp(max, 8 - e) >= 255.5) // would round to 256
        e++;
    if (max <= 0 || e + 128 < 1)
        return;
    for (int i = 0; i < 3; i++)
        out[i] = (uint8_t)lround(ldexp(v[i], 8 - e));
    out[3] = (uint8_t)(e + 128);
}

/* One byte of each pixel as runs of at least 4 equal ones and stretches of others; returns the end.
 */
static uint8_t *put_runs(const uint8_t *rgbe, int n, uint8_t *out)
{
    for (int x = 0; x < n;) {
        int run = 1;
        while (run < 127 && x + run < n && rgbe[4 * (x + run)] == rgbe[4 * x])
            run++;
        if (run >= 4) {
            *out++ = (uint8_t)(128 + run);
            *out++ = rgbe[4 * x];
            x += run;
            continue;
        }
        int start = x;
        for (run = 0; x < n && x - start < 128 && run < 4; x++)
            run = x > start && rgbe[4 * x] == rgbe[4 * (x - 1)] ? run + 1 : 1;
        if (run == 4)
            x -= 4; // the run that begins here
        *out++ = (uint8_t)(x - start);
        for (int i = start; i < x; i++)
            *out++ = rgbe[4 * i];
    }
    return out;
}

int gn_hdr_write_file(const char *path, const struct gn_image *image, struct gn_error *out_error)
{
    if (image->channels != 3)
        return gn_error_set(out_error, -EINVAL, "cannot write %s: %d channels, 3 are needed", path,
                            image->channels);
    size_t width = (size_t)image->width, row_bytes = 4 + 4 * (width + width / 64 + 2);
    uint8_t *bytes = malloc(128 + row_bytes * (size_t)image->height), *rgbe = malloc(4 * width);
    int r = -ENOMEM;
    if (!bytes || !rgbe) {
        gn_error_set(out_error, r, "cannot write %s: out of memory", path);
        goto out;
    }
    uint8_t *at = bytes;
    at += snprintf((char *)bytes, 128, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n",
                   image->height, image->width);
    for (int y = 0; y < image->height; y++) {
        for (int x = 0; x < image->width; x++)
            encode_pixel(gn_image_at(image, x, y), rgbe + 4 * x);
        if (width < 8) { // too short for run lengths
            memcpy(at, rgbe, 4 * width);
            at += 4 * width;
            continue;
        }
        memcpy(at, (uint8_t[4]){2, 2, (uint8_t)(width >> 8), (uint8_t)(width & 255)}, 4);
        at += 4;
        for (int byte = 0; byte < 4; byte++)
            at = put_runs(rgbe + byte, image->width, at);
    }
    r = gn_file_write(path, bytes, (size_t)(at - bytes), out_error);
out:
    free(bytes);
    free(rgbe);
    return r;
}
