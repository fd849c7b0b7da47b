/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/picture_mean.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

/** Triangles of less are points, px^2. */
#define MIN_AREA 1e-6

/** Integrals round a triangle: area, channels, luminance times x, times y. */
enum { AREA, RED, GREEN, BLUE, MOMENT_X, MOMENT_Y, N_SUMS };

/** A triangle in pixels, x right and y down, relative to its own corner so that little cancels. */
struct outline {
    double x[3], y[3]; // less column and row
    int column, row;   // the first ones
    int last_row;
    int index;
    double sums[N_SUMS];
};

/** Integrals of a row of the picture from the left edge to each column. */
struct row {
    double *rgb;    // [w + 1][3]
    double *moment; // [w + 1] of x times luminance
    const float *pixels;
    int width;
};

static int compare_rows(const void *a, const void *b)
{
    const struct outline *oa = a, *ob = b;
    if (oa->row != ob->row)
        return oa->row < ob->row ? -1 : 1;
    return oa->index < ob->index ? -1 : oa->index > ob->index;
}

static void init_outline(const struct gn_image *image, const double uv[3][2], int index,
                         struct outline *out)
{
    double min_x = INFINITY;
    double min_y = INFINITY;
    double max_y = 0;
    memset(out, 0, sizeof(*out));
    out->index = index;
    for (int i = 0; i < 3; i++) {
        out->x[i] = fmin(fmax(uv[i][0], 0), 1) * image->width;
        out->y[i] = (1 - fmin(fmax(uv[i][1], 0), 1)) * image->height;
        min_x = fmin(min_x, out->x[i]);
        min_y = fmin(min_y, out->y[i]);
        max_y = fmax(max_y, out->y[i]);
    }
    out->column = (int)fmin(floor(min_x), image->width - 1);
    out->row = (int)fmin(floor(min_y), image->height - 1);
    out->last_row = (int)fmin(floor(max_y), image->height - 1);
    for (int i = 0; i < 3; i++) {
        out->x[i] -= out->column;
        out->y[i] -= out->row;
    }
}

static void fill_row(const struct gn_image *image, int y, struct row *row)
{
    row->pixels = gn_image_at(image, 0, y);
    row->width = image->width;
    for (int x = 0; x < image->width; x++) {
        const float *p = row->pixels + 3 * (size_t)x;
        for (int c = 0; c < 3; c++)
            row->rgb[3 * (x + 1) + c] = row->rgb[3 * x + c] + p[c];
        row->moment[x + 1] = row->moment[x] + gn_luminance(p) * (x + 0.5);
    }
}

/** From (x0, y0) to (x1, y1), within one pixel of the row. */
static void add_step(struct outline *o, const struct row *row, int pixel, double x0, double y0,
                     double x1, double y1)
{
    double dy = y1 - y0;
    double xm = 0.5 * (x0 + x1);
    int column = o->column + pixel;
    const float *p = row->pixels + 3 * (size_t)column;
    double before[3];
    double y_lum[3] = {0};
    double luminance = gn_luminance(p);
    const double xs[3] = {x0, xm, x1};
    const double ys[3] = {y0, 0.5 * (y0 + y1), y1};
    for (int c = 0; c < 3; c++) {
        before[c] = row->rgb[3 * column + c] - row->rgb[3 * o->column + c];
        o->sums[RED + c] += dy * (before[c] + p[c] * (xm - pixel));
    }
    o->sums[AREA] += dy * xm;
    // Simpson's rule is exact for these: quadratic along the step. x counts from the first column.
    double base = gn_luminance_of_sum(before);
    double moment_base = row->moment[column] - row->moment[o->column] - o->column * base;
    double mx[3];
    for (int i = 0; i < 3; i++) {
        double into = xs[i] - pixel;
        y_lum[i] = ys[i] * (base + luminance * into);
        mx[i] = moment_base + luminance * into * (pixel + 0.5 * into);
    }
    o->sums[MOMENT_X] += dy * (mx[0] + 4 * mx[1] + mx[2]) / 6;
    o->sums[MOMENT_Y] += dy * (y_lum[0] + 4 * y_lum[1] + y_lum[2]) / 6;
}

/** A side's part in the row from y0 to y1 (rising), pixel by pixel. */
static void add_run(struct outline *o, const struct row *row, double x0, double y0, double x1,
                    double y1)
{
    double dx = x1 - x0;
    int last = row->width - 1 - o->column;
    int pixel = (int)floor(x0);
    int end = (int)floor(x1);
    int step = dx < 0 ? -1 : 1;
    double x = x0;
    double y = y0;
    pixel = pixel < 0 ? 0 : pixel > last ? last : pixel;
    end = end < 0 ? 0 : end > last ? last : end;
    for (; pixel != end; pixel += step) {
        double edge = step > 0 ? pixel + 1 : pixel;
        double y_edge = y0 + (y1 - y0) * ((edge - x0) / dx);
        add_step(o, row, pixel, x, y, edge, y_edge);
        x = edge;
        y = y_edge;
    }
    add_step(o, row, end, x, y, x1, y1);
}

static void add_row(struct outline *o, const struct row *row, int y_row)
{
    double top = y_row - o->row;
    for (int i = 0; i < 3; i++) {
        double xa = o->x[i];
        double ya = o->y[i];
        double xb = o->x[(i + 1) % 3];
        double yb = o->y[(i + 1) % 3];
        double lo = fmax(fmin(ya, yb), top);
        double hi = fmin(fmax(ya, yb), top + 1);
        if (!(hi > lo))
            continue;
        double from = ya < yb ? lo : hi;
        double to = ya < yb ? hi : lo;
        add_run(o, row, xa + (xb - xa) * ((from - ya) / (yb - ya)), from,
                xa + (xb - xa) * ((to - ya) / (yb - ya)), to);
    }
}

static void finish_mean(const struct gn_image *image, const struct outline *o,
                        struct gn_picture_mean *out)
{
    double area = o->sums[AREA];
    double cx = (o->x[0] + o->x[1] + o->x[2]) / 3;
    double cy = (o->y[0] + o->y[1] + o->y[2]) / 3;
    if (fabs(area) < MIN_AREA) {
        int x = (int)fmin(o->column + cx, image->width - 1);
        int y = (int)fmin(o->row + cy, image->height - 1);
        for (int c = 0; c < 3; c++)
            out->rgb[c] = gn_image_at(image, x, y)[c];
    } else {
        for (int c = 0; c < 3; c++)
            out->rgb[c] = fmax(o->sums[RED + c] / area, 0);
        double luminance = gn_luminance_of_sum(out->rgb) * area;
        if (fabs(luminance) > 0) {
            cx = o->sums[MOMENT_X] / luminance;
            cy = o->sums[MOMENT_Y] / luminance;
        }
    }
    out->centroid_uv[0] = (o->column + cx) / image->width;
    out->centroid_uv[1] = 1 - (o->row + cy) / image->height;
}

int gn_picture_get_means(const struct gn_image *image, const struct gn_picture_triangle *triangles,
                         int n, struct gn_picture_mean *out_means)
{
    size_t width = (size_t)image->width;
    struct outline *outlines = malloc(((size_t)n + 1) * sizeof(*outlines));
    int *active = malloc(((size_t)n + 1) * sizeof(*active));
    struct row row = {.rgb = calloc(width + 1, 3 * sizeof(double)),
                      .moment = calloc(width + 1, sizeof(double))};
    int ret = outlines && active && row.rgb && row.moment ? 0 : -ENOMEM;
    int n_active = 0;
    int next = 0;
    for (int i = 0; i < n && ret == 0; i++)
        init_outline(image, triangles[i].uvs, i, &outlines[i]);
    if (ret == 0)
        qsort(outlines, (size_t)n, sizeof(*outlines), compare_rows);
    for (int y = 0; y < image->height && ret == 0 && (next < n || n_active > 0); y++) {
        while (next < n && outlines[next].row == y)
            active[n_active++] = next++;
        if (n_active == 0)
            continue;
        fill_row(image, y, &row);
        int kept = 0;
        for (int i = 0; i < n_active; i++) {
            struct outline *o = &outlines[active[i]];
            add_row(o, &row, y);
            if (o->last_row > y)
                active[kept++] = active[i];
        }
        n_active = kept;
    }
    for (int i = 0; i < n && ret == 0; i++)
        finish_mean(image, &outlines[i], &out_means[outlines[i].index]);
    free(outlines);
    free(active);
    free(row.rgb);
    free(row.moment);
    return ret;
}
