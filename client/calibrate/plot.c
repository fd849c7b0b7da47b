/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/plot.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/file.h"
#include "common/response.h"

enum { PLOT_W = 760, PLOT_H = 420, LEFT = 70, RIGHT = 20, TOP = 40, BOTTOM = 50 };

struct range {
    double low, high; // log10 of light
    double error;     // the axis runs from -error to error
};

/* Light that a code says to within 5 %: what the axes are made for. */
static bool is_known(const struct gn_chart_point *p)
{
    return p->uncertainty < 0.05;
}

static struct range find_range(const struct gn_chart_response *r)
{
    struct range range = {INFINITY, -INFINITY, 0.02};
    for (int i = 0; i < r->n_points; i++) {
        const struct gn_chart_point *p = &r->points[i];
        if (p->is_clipped || !(p->light > 0) || !isfinite(p->error) || !is_known(p))
            continue;
        range.low = fmin(range.low, floor(log10(p->light)));
        range.high = fmax(range.high, ceil(log10(p->light)));
        if (!p->is_outlier)
            range.error = fmax(range.error, fmin(fabs(p->error), 0.5));
    }
    if (!(range.high > range.low))
        range = (struct range){0, 1, range.error};
    range.error = ceil(range.error * 50) / 50;
    return range;
}

static double get_x(const struct range *range, double log_light)
{
    return LEFT + (PLOT_W - LEFT - RIGHT) * (log_light - range->low) / (range->high - range->low);
}

static double get_y(const struct range *range, double error)
{
    double share = fmin(fmax(error / range->error, -1.04), 1.04);
    return (TOP + PLOT_H - BOTTOM) / 2.0 - share * (PLOT_H - TOP - BOTTOM) / 2.0;
}

static void print_frame(FILE *out, const struct range *range)
{
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "font-family=\"sans-serif\" font-size=\"13\">\n"
            "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n"
            "<text x=\"%d\" y=\"24\">Light of each patch by the fitted response, against what all "
            "its pictures agree on</text>\n",
            PLOT_W, PLOT_H, LEFT);
    for (double e = range->low; e <= range->high + 0.5; e++)
        fprintf(out,
                "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\" stroke=\"#ddd\"/>\n"
                "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">1e%+.0f</text>\n",
                get_x(range, e), get_x(range, e), TOP, PLOT_H - BOTTOM, get_x(range, e),
                PLOT_H - BOTTOM + 18, e);
    for (int i = -2; i <= 2; i++) {
        double error = range->error * i / 2;
        fprintf(out,
                "<line x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"%s\"/>\n"
                "<text x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%+.1f %%</text>\n",
                LEFT, PLOT_W - RIGHT, get_y(range, error), get_y(range, error),
                i == 0 ? "#888" : "#ddd", LEFT - 6, get_y(range, error) + 4, 100 * error);
    }
    fprintf(out,
            "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">light, a perfect white in the first "
            "picture = 1 (hollow: left out; pale: codes too coarse to say it to 5 %%)</text>\n",
            (LEFT + PLOT_W - RIGHT) / 2, PLOT_H - 12);
}

static void print_point(FILE *out, const struct range *range, const struct gn_chart_point *p)
{
    static const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    if (!(p->light > 0) || !isfinite(p->error) || p->is_clipped || log10(p->light) < range->low)
        return;
    double rho[3];
    int code[3];
    gn_chart_get_reflectance(p->patch, rho);
    for (int c = 0; c < 3; c++)
        code[c] =
            p->patch >= GN_CHART_WHITE ? 0 : (int)(255 * gn_response_encode(&srgb, (float)rho[c]));
    char colour[16];
    snprintf(colour, sizeof(colour), "#%02x%02x%02x", code[0] & 255, code[1] & 255, code[2] & 255);
    fprintf(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" stroke=\"%s\" fill=\"%s\"%s/>\n",
            get_x(range, log10(p->light)), get_y(range, p->error), colour,
            p->is_outlier ? "none" : colour,
            is_known(p) ? "" : " fill-opacity=\"0.25\" stroke-opacity=\"0.25\"");
}

int gn_plot_chart(const char *path, const struct gn_chart_response *response,
                  struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    struct range range = find_range(response);
    print_frame(out, &range);
    for (int i = 0; i < response->n_points; i++)
        print_point(out, &range, &response->points[i]);
    fprintf(out, "</svg>\n");
    int err = fclose(out) == 0 ? 0 : gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = gn_file_write(path, text, size, out_error);
    free(text);
    return err;
}
