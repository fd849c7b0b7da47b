/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/exr.h"
#include "common/font.h"
#include "tests/rig/sequence.h"
#include "tests/rig/view.h"

#define MARGIN 28
#define GAP 10
#define HEAD 84     // title and column names
#define ROW_TEXT 20 // under each picture
#define MAX_CELL 480
#define MAX_COLUMNS 6

static const unsigned char paper[3] = {22, 23, 26}, ink[3] = {224, 222, 216};
static const unsigned char quiet[3] = {138, 138, 140}, accent[3] = {232, 164, 74};

enum column { CAMERA, COMPOSITE, TRUTH, DIFFERENCE, LIGHT, SHADOW };

static const char *const column_names[MAX_COLUMNS] = {
    "camera", "composite", "truth", "difference * 8", "light", "shadow factor"};

struct sheet {
    const struct gn_rig_sequence *sequence;
    const struct gn_rig_sheet_options *o;
    struct gn_image8 image;
    enum column columns[MAX_COLUMNS];
    int n_columns;
    int cell_width, cell_height;
};

static void fill(struct gn_image8 *image, int x0, int y0, int w, int h, const unsigned char rgb[3])
{
    for (int y = y0; y < y0 + h; y++)
        for (int x = x0; x < x0 + w; x++)
            if (x >= 0 && y >= 0 && x < image->width && y < image->height)
                memcpy(gn_image8_at(image, x, y), rgb, 3);
}

static int get_text_width(const char *text, int zoom)
{
    return (int)strlen(text) * 6 * zoom - zoom;
}

static void draw_text(struct gn_image8 *image, int x, int y, int zoom, const unsigned char rgb[3],
                      const char *text)
{
    for (; *text; text++, x += 6 * zoom) {
        int c = toupper((unsigned char)*text) & 127;
        for (int row = 0; row < 7; row++)
            for (int column = 0; column < 5; column++)
                if (gn_font_rows[c][row] >> (4 - column) & 1)
                    fill(image, x + column * zoom, y + row * zoom, zoom, zoom, rgb);
    }
}

/* Mean of the source pixels under one pixel of the cell; larger cells repeat pixels. */
static void take_mean(const struct gn_image8 *image, double x0, double y0, double side,
                      unsigned char out[3])
{
    int xa = (int)x0, ya = (int)y0, xb = (int)ceil(x0 + side), yb = (int)ceil(y0 + side);
    long sum[3] = {0}, n = 0;
    for (int y = ya; y < yb && y < image->height; y++)
        for (int x = xa; x < xb && x < image->width; x++, n++)
            for (int k = 0; k < 3; k++)
                sum[k] += gn_image8_at(image, x, y)[k];
    for (int k = 0; k < 3; k++)
        out[k] = n ? (unsigned char)((sum[k] + n / 2) / n) : paper[k];
}

/* The picture as large as fits the cell, in its middle. */
static void draw_picture(struct sheet *s, int x0, int y0, const struct gn_image8 *image)
{
    double side =
        fmax((double)image->width / s->cell_width, (double)image->height / s->cell_height);
    int w = (int)(image->width / side + 0.5), h = (int)(image->height / side + 0.5);
    x0 += (s->cell_width - w) / 2;
    y0 += (s->cell_height - h) / 2;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            unsigned char rgb[3];
            take_mean(image, x * side, y * side, side, rgb);
            fill(&s->image, x0 + x, y0 + y, 1, 1, rgb);
        }
}

static int read_shadow(const struct sheet *s, const char *name, struct gn_image8 *out,
                       struct gn_error *error)
{
    char path[4096];
    int stem = (int)strcspn(name, ".");
    snprintf(path, sizeof(path), "%s/%.*s.exr", s->o->shadow, stem, name);
    if (access(path, R_OK))
        return gn_rig_read_picture(s->o->shadow, name, out, error);
    struct gn_image layer;
    int result = gn_exr_read_layer(path, "shadow", "RGB", &layer, error);
    if (result)
        return result;
    result = gn_image8_init(out, layer.width, layer.height, 3);
    for (int i = 0; result == 0 && i < 3 * layer.width * layer.height; i++)
        out->data[i] = (uint8_t)(255 * fminf(1, fmaxf(0, layer.data[i])) + 0.5f);
    gn_image_finish(&layer);
    return result;
}

/* |composite - truth| times 8 over a dark ground. */
static int make_difference(const struct gn_image8 *a, const struct gn_image8 *b,
                           struct gn_image8 *out, struct gn_error *error)
{
    if (a->width != b->width || a->height != b->height)
        return gn_error_set(error, -EINVAL, "composite %d x %d px, truth %d x %d", a->width,
                            a->height, b->width, b->height);
    int result = gn_image8_init(out, a->width, a->height, 3);
    for (int i = 0; result == 0 && i < 3 * a->width * a->height; i++) {
        int d = 8 * abs(a->data[i] - b->data[i]);
        out->data[i] = (uint8_t)(d > 255 ? 255 : d);
    }
    return result;
}

static int get_picture(const struct sheet *s, enum column column, int index, struct gn_image8 *out,
                       struct gn_error *error)
{
    const char *directory = s->sequence->directory,
               *name = gn_rig_sequence_get_name(s->sequence, index);
    const char *truth = gn_rig_sequence_get_text(s->sequence, index, "truth");
    struct gn_image8 a = {0}, b = {0};
    int result = 0;
    if (!truth)
        return gn_error_set(error, -EINVAL, "%s: frame %d has no truth", directory, index);
    switch (column) {
    case CAMERA:
        return gn_rig_read_picture(
            directory, gn_rig_sequence_get_text(s->sequence, index, "picture"), out, error);
    case COMPOSITE:
        return gn_rig_read_picture(s->o->composites, name, out, error);
    case TRUTH:
        return gn_rig_read_picture(directory, truth, out, error);
    case LIGHT:
        return gn_rig_read_picture(s->o->light, name, out, error);
    case SHADOW:
        return read_shadow(s, name, out, error);
    case DIFFERENCE:
        result = gn_rig_read_picture(s->o->composites, name, &a, error);
        if (result == 0)
            result = gn_rig_read_picture(directory, truth, &b, error);
        if (result == 0)
            result = make_difference(&a, &b, out, error);
        gn_image8_finish(&a);
        gn_image8_finish(&b);
    }
    return result;
}

static int draw_row(struct sheet *s, int row, int index, struct gn_error *error)
{
    const char *label = gn_rig_sequence_get_text(s->sequence, index, "label");
    char text[128];
    int y = HEAD + row * (s->cell_height + ROW_TEXT + GAP);
    for (int c = 0; c < s->n_columns; c++) {
        struct gn_image8 picture = {0};
        int result = get_picture(s, s->columns[c], index, &picture, error);
        if (result)
            return result;
        draw_picture(s, MARGIN + c * (s->cell_width + GAP), y, &picture);
        gn_image8_finish(&picture);
    }
    snprintf(text, sizeof(text), "%.*s  %.80s", 4, gn_rig_sequence_get_name(s->sequence, index),
             label ? label : "");
    draw_text(&s->image, MARGIN, y + s->cell_height + 7, 1, quiet, text);
    return 0;
}

static void draw_head(struct sheet *s)
{
    draw_text(&s->image, MARGIN, MARGIN, 3, ink, s->o->title ? s->o->title : "");
    for (int c = 0; c < s->n_columns; c++) {
        int x = MARGIN + c * (s->cell_width + GAP);
        const char *name = column_names[s->columns[c]];
        draw_text(&s->image, x, HEAD - 16, 1, s->columns[c] == COMPOSITE ? accent : quiet,
                  get_text_width(name, 1) <= s->cell_width ? name : "");
    }
}

static void choose_columns(struct sheet *s)
{
    const bool wanted[MAX_COLUMNS] = {true,
                                      s->o->composites != NULL,
                                      true,
                                      s->o->composites != NULL,
                                      s->o->light != NULL,
                                      s->o->shadow != NULL};
    for (int c = 0; c < MAX_COLUMNS; c++)
        if (wanted[c])
            s->columns[s->n_columns++] = (enum column)c;
}

/* The cells are as large as the first camera frame, MAX_CELL at most. */
static int size_cells(struct sheet *s, struct gn_error *error)
{
    struct gn_image8 first = {0};
    int result = get_picture(s, CAMERA, 0, &first, error);
    if (result)
        return result;
    double shrink = fmax(1, fmax(first.width, first.height) / (double)MAX_CELL);
    s->cell_width = (int)fmax(120, first.width / shrink);
    s->cell_height = (int)fmax(90, first.height / shrink);
    gn_image8_finish(&first);
    return 0;
}

int gn_rig_draw_sheet(const struct gn_rig_sequence *sequence,
                      const struct gn_rig_sheet_options *options, struct gn_image8 *out_sheet,
                      struct gn_error *out_error)
{
    struct sheet s = {.sequence = sequence, .o = options};
    int n = (int)json_array_size(sequence->frames);
    int rows = options->n_rows > 0 && options->n_rows < n ? options->n_rows : n;
    choose_columns(&s);
    int result = size_cells(&s, out_error);
    if (result)
        return result;
    int width = 2 * MARGIN + s.n_columns * (s.cell_width + GAP) - GAP;
    int height = HEAD + rows * (s.cell_height + ROW_TEXT + GAP) + MARGIN - GAP;
    result = gn_image8_init(&s.image, width, height, 3);
    if (result)
        return gn_error_set(out_error, result, "no sheet of %d x %d px: show fewer rows", width,
                            height);
    fill(&s.image, 0, 0, width, height, paper);
    draw_head(&s);
    for (int row = 0; result == 0 && row < rows; row++)
        result = draw_row(&s, row, rows > 1 ? row * (n - 1) / (rows - 1) : 0, out_error);
    if (result) {
        gn_image8_finish(&s.image);
        return result;
    }
    *out_sheet = s.image;
    return 0;
}
