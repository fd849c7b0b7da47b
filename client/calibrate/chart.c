/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/chart.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/solve.h"
#include "common/compare.h"

/* L*a*b*, D50, 2 degrees. Source: X-Rite, "New color specifications for ColorChecker SG and Classic
 * charts", the values for charts made before November 2014. */
static const struct {
    const char *name;
    double lab[3];
} patches[GN_CHART_PATCHES] = {
    {"dark skin", {37.986, 13.555, 14.059}},
    {"light skin", {65.711, 18.13, 17.81}},
    {"blue sky", {49.927, -4.88, -21.925}},
    {"foliage", {43.139, -13.095, 21.905}},
    {"blue flower", {55.112, 8.844, -25.399}},
    {"bluish green", {70.719, -33.397, -0.199}},
    {"orange", {62.661, 36.067, 57.096}},
    {"purplish blue", {40.02, 10.41, -45.964}},
    {"moderate red", {51.124, 48.239, 16.248}},
    {"purple", {30.325, 22.976, -21.587}},
    {"yellow green", {72.532, -23.709, 57.255}},
    {"orange yellow", {71.941, 19.363, 67.857}},
    {"blue", {28.778, 14.179, -50.297}},
    {"green", {55.261, -38.342, 31.37}},
    {"red", {42.101, 53.378, 28.19}},
    {"yellow", {81.733, 4.039, 79.819}},
    {"magenta", {51.935, 49.986, -14.574}},
    {"cyan", {51.038, -28.631, -28.638}},
    {"white", {96.539, -0.425, 1.186}},
    {"grey 8", {81.257, -0.638, -0.335}},
    {"grey 6.5", {66.766, -0.734, -0.504}},
    {"grey 5", {50.867, -0.153, -0.27}},
    {"grey 3.5", {35.656, -0.421, -1.231}},
    {"black", {20.461, -0.079, -0.973}},
};

/* Half the side of what is measured of a patch; patches are 10/11 of their distance wide. */
#define HALF 0.27

static const double luminance[3] = {0.2126, 0.7152, 0.0722};

const char *gn_chart_get_name(int patch)
{
    return patches[patch].name;
}

/* CIE 15: the inverse of f(t) = t^(1/3), linear below (6/29)^3. */
static double invert_lab(double f)
{
    return f > 6.0 / 29 ? f * f * f : 3 * (6.0 / 29) * (6.0 / 29) * (f - 4.0 / 29);
}

void gn_chart_get_reflectance(int patch, double out_rgb[static 3])
{
    /* XYZ of D50 to linear Rec.709 of D65, Bradford. Source: B. Lindbloom, "RGB/XYZ Matrices". */
    static const double m[9] = {3.1338561, -1.6168667, -0.4906146, -0.9787684, 1.9161415,
                                0.0334540, 0.0719453,  -0.2289914, 1.4052427};
    static const double white[3] = {0.96422, 1, 0.82521};
    const double *lab = patches[patch].lab;
    double f = (lab[0] + 16) / 116;
    double xyz[3] = {white[0] * invert_lab(f + lab[1] / 500), white[1] * invert_lab(f),
                     white[2] * invert_lab(f - lab[2] / 200)};
    for (int i = 0; i < 3; i++)
        out_rgb[i] = m[3 * i] * xyz[0] + m[3 * i + 1] * xyz[1] + m[3 * i + 2] * xyz[2];
}

/* Picture position of chart position (column, row): patch centres at whole numbers. */
static void map_point(const double h[static 9], double x, double y, double out[2])
{
    double w = h[6] * x + h[7] * y + h[8];
    out[0] = (h[0] * x + h[1] * y + h[2]) / w;
    out[1] = (h[3] * x + h[4] * y + h[5]) / w;
}

static int find_homography(const struct gn_chart_place *place, double h[9], double inverse[9],
                           struct gn_error *out_error)
{
    static const double chart[8] = {0, 0, 5, 0, 5, 3, 0, 3};
    if (gn_solve_homography(chart, place->corners, h) < 0 ||
        gn_solve_homography(place->corners, chart, inverse) < 0)
        return gn_error_set(out_error, -EINVAL,
                            "the chart's corners lie on a line; right would be the centres of "
                            "patches 1, 6, 24 and 19, in that order");
    return 0;
}

/* Median, 1.4826 times the median deviation, share clipped; values are sorted and overwritten. */
static void summarise(float *values, int n, double rail, double *out_code, double *out_spread,
                      double *out_clipped)
{
    int clipped = 0;
    for (int i = 0; i < n; i++)
        clipped += (double)values[i] < rail || (double)values[i] > 1 - rail;
    qsort(values, (size_t)n, sizeof(*values), gn_compare_floats);
    double median = ((double)values[n / 2] + (double)values[(n - 1) / 2]) / 2;
    // Codes are steps: the mean of the middle half is finer than the median, and as robust here.
    double sum = 0;
    int low = n / 4, high = n - n / 4;
    for (int i = low; i < high; i++)
        sum += (double)values[i];
    for (int i = 0; i < n; i++)
        values[i] = (float)fabs((double)values[i] - median);
    qsort(values, (size_t)n, sizeof(*values), gn_compare_floats);
    *out_code = sum / (high - low);
    *out_spread = 1.4826 * (double)values[n / 2];
    *out_clipped = (double)clipped / n;
}

/* The pixels of a patch's middle: their values of channel c to values (NULL: only counted). */
static int collect(const struct gn_image *image, const double h[9], const double inverse[9],
                   int patch, int channel, float *values)
{
    const double half = HALF;
    double column = patch % GN_CHART_COLUMNS, row = patch / GN_CHART_COLUMNS;
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9}, p[2];
    for (int i = 0; i < 4; i++) {
        map_point(h, column + (i & 1 ? half : -half), row + (i & 2 ? half : -half), p);
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], p[k]);
            high[k] = fmax(high[k], p[k]);
        }
    }
    if (!(low[0] >= 0 && low[1] >= 0 && high[0] <= image->width && high[1] <= image->height))
        return -1;
    int n = 0;
    for (int y = (int)low[1]; y < high[1] && y < image->height; y++) {
        for (int x = (int)low[0]; x < high[0] && x < image->width; x++) {
            map_point(inverse, x + 0.5, y + 0.5, p);
            if (!(fabs(p[0] - column) <= half && fabs(p[1] - row) <= half))
                continue;
            if (values)
                values[n] = gn_image_at(image, x, y)[image->channels == 3 ? channel : 0];
            n++;
        }
    }
    return n;
}

int gn_chart_measure(const struct gn_image *image, const struct gn_chart_place *place, double rail,
                     struct gn_chart_patch out_patches[static 24], struct gn_error *out_error)
{
    double h[9], inverse[9];
    int err = find_homography(place, h, inverse, out_error);
    for (int j = 0; !err && j < GN_CHART_PATCHES; j++) {
        struct gn_chart_patch *patch = &out_patches[j];
        *patch = (struct gn_chart_patch){.n_pixels = collect(image, h, inverse, j, 0, NULL)};
        if (patch->n_pixels < 0)
            return gn_error_set(out_error, -EINVAL,
                                "patch %d (%s) of the chart lies outside the %d x %d picture",
                                j + 1, patches[j].name, image->width, image->height);
        if (patch->n_pixels < 5)
            return gn_error_set(out_error, -EINVAL,
                                "patch %d (%s) of the chart has %d pixels, at least 5 are needed: "
                                "show the chart larger",
                                j + 1, patches[j].name, patch->n_pixels);
        float *values = malloc((size_t)patch->n_pixels * sizeof(*values));
        if (!values)
            return gn_error_set(out_error, -ENOMEM, "out of memory");
        for (int c = 0; c < 3; c++) {
            collect(image, h, inverse, j, c, values);
            summarise(values, patch->n_pixels, rail, &patch->code[c], &patch->spread[c],
                      &patch->clipped[c]);
        }
        free(values);
    }
    return err;
}

void gn_chart_get_outline(const struct gn_chart_place *place, int patch, double out_xy[static 8])
{
    static const double ways[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    double h[9], inverse[9];
    memset(out_xy, 0, 8 * sizeof(*out_xy));
    if (find_homography(place, h, inverse, NULL) < 0)
        return;
    for (int i = 0; i < 4; i++)
        map_point(h, patch % GN_CHART_COLUMNS + HALF * ways[i][0],
                  patch / GN_CHART_COLUMNS + HALF * ways[i][1], out_xy + 2 * i);
}

/* Ranks less their mean; equal values share theirs: clipped patches tell nothing. */
static void rank(const double values[24], double out[24])
{
    for (int i = 0; i < 24; i++) {
        out[i] = -11.5;
        for (int j = 0; j < 24; j++)
            out[i] += values[j] < values[i] ? 1 : values[j] == values[i] && j != i ? 0.5 : 0;
    }
}

/* Spearman's rank correlation of 24 pairs. */
static double correlate_ranks(const double a[24], const double b[24])
{
    double ranks[2][24], ab = 0, aa = 0, bb = 0;
    rank(a, ranks[0]);
    rank(b, ranks[1]);
    for (int i = 0; i < 24; i++) {
        ab += ranks[0][i] * ranks[1][i];
        aa += ranks[0][i] * ranks[0][i];
        bb += ranks[1][i] * ranks[1][i];
    }
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : 0;
}

double gn_chart_get_likeness(const struct gn_image *image, const struct gn_chart_place *place)
{
    struct gn_chart_patch measured[24];
    double expected[4][24], best = -1;
    if (gn_chart_measure(image, place, 0, measured, NULL) < 0)
        return -1;
    for (int j = 0; j < 24; j++) {
        double rgb[3];
        gn_chart_get_reflectance(j, rgb);
        for (int c = 0; c < 3; c++)
            expected[c][j] = rgb[c];
        expected[3][j] = luminance[0] * rgb[0] + luminance[1] * rgb[1] + luminance[2] * rgb[2];
    }
    for (int i = 0; i < 4 * image->channels; i++) {
        double code[24]; // ranks: any response that rises keeps them
        for (int j = 0; j < 24; j++)
            code[j] = measured[j].code[i / 4];
        best = fmax(best, correlate_ranks(code, expected[i % 4]));
    }
    return best;
}

double gn_chart_orient(const struct gn_image *image, struct gn_chart_place *place)
{
    static const int ways[4][4] = {{0, 1, 2, 3}, {2, 3, 0, 1}, {1, 0, 3, 2}, {3, 2, 1, 0}};
    struct gn_chart_place best_place = *place;
    double best = -1;
    for (int w = 0; w < 4; w++) {
        struct gn_chart_place tried;
        for (int i = 0; i < 4; i++)
            memcpy(tried.corners + 2 * i, place->corners + 2 * ways[w][i], 2 * sizeof(double));
        double likeness = gn_chart_get_likeness(image, &tried);
        if (likeness > best) {
            best = likeness;
            best_place = tried;
        }
    }
    *place = best_place;
    return best;
}

static bool is_measured(const double device[72], int j)
{
    return isfinite(device[3 * j]) && isfinite(device[3 * j + 1]) && isfinite(device[3 * j + 2]);
}

static double get_weight(int j, double rho[3])
{
    gn_chart_get_reflectance(j, rho);
    return 1 / (luminance[0] * rho[0] + luminance[1] * rho[1] + luminance[2] * rho[2] + 0.02);
}

/* The greys' mean colour, device and true. */
static void get_white(const double device[72], const bool is_used[24], double x[3], double rho[3])
{
    memset(x, 0, 3 * sizeof(double));
    memset(rho, 0, 3 * sizeof(double));
    for (int j = GN_CHART_WHITE; j < 24; j++) {
        double r[3], w = is_used[j] ? get_weight(j, r) : 0;
        for (int c = 0; c < 3 && w > 0; c++) {
            x[c] += w * device[3 * j + c];
            rho[c] += w * r[c];
        }
    }
}

/*
 * A row of the matrix at a time. The constraint row . x = rho is kept exactly by solving for its
 * red and blue entries and taking green's from it: row_g = (rho - row_r x_r - row_b x_b) / x_g.
 */
static int solve_matrix(const double device[72], const bool is_used[24], bool keeps_white,
                        double out[9])
{
    double white[3], rho_white[3];
    get_white(device, is_used, white, rho_white);
    bool is_bound = keeps_white && white[1] > 0;
    for (int c = 0; c < 3; c++) {
        double a[72], b[24], rho[3], row[3];
        int m = 0, n = is_bound ? 2 : 3;
        for (int j = 0; j < 24; j++) {
            if (!is_used[j])
                continue;
            const double *x = device + 3 * j;
            double w = get_weight(j, rho);
            if (is_bound) {
                a[2 * m] = w * (x[0] - x[1] * white[0] / white[1]);
                a[2 * m + 1] = w * (x[2] - x[1] * white[2] / white[1]);
                b[m] = w * (rho[c] - x[1] * rho_white[c] / white[1]);
            } else {
                for (int k = 0; k < 3; k++)
                    a[3 * m + k] = w * x[k];
                b[m] = w * rho[c];
            }
            m++;
        }
        if (m < n || gn_solve_least_squares(a, b, m, n, row) < 0)
            return -EDOM;
        if (is_bound) {
            row[2] = row[1];
            row[1] = (rho_white[c] - row[0] * white[0] - row[2] * white[2]) / white[1];
        }
        memcpy(out + 3 * c, row, sizeof(row));
    }
    return 0;
}

static void find_errors(const double device[72], struct gn_chart_matrix *m)
{
    for (int j = 0; j < 24; j++) {
        double rho[3], w = get_weight(j, rho), sum = 0;
        for (int i = 0; i < 3; i++) {
            const double *row = m->to_rec709 + 3 * i, *x = device + 3 * j;
            double e = row[0] * x[0] + row[1] * x[1] + row[2] * x[2] - rho[i];
            sum += luminance[i] * e * e;
        }
        m->error[j] = is_measured(device, j) ? w * sqrt(sum) : NAN;
    }
}

/* Marks what lies off by more than 4 robust deviations, but not below 10 %. */
static int leave_out(const struct gn_chart_matrix *m, bool is_used[24])
{
    double sorted[24];
    int n = 0, n_out = 0;
    for (int j = 0; j < 24; j++)
        if (is_used[j])
            sorted[n++] = m->error[j];
    qsort(sorted, (size_t)n, sizeof(double), gn_compare_doubles);
    double bound = fmax(4 * 1.4826 * sorted[n / 2], 0.1);
    for (int j = 0; j < 24; j++) {
        if (is_used[j] && m->error[j] > bound) {
            is_used[j] = false;
            n_out++;
        }
    }
    return n_out;
}

int gn_chart_fit_matrix(const double device[static 72], bool keeps_white,
                        struct gn_chart_matrix *out_matrix, struct gn_error *out_error)
{
    struct gn_chart_matrix m = {{0}};
    bool is_used[24];
    double a[72], rho[3];
    for (int j = 0; j < 24; j++)
        is_used[j] = is_measured(device, j);
    for (int round = 0; round < 4; round++) {
        int n = 0;
        for (int j = 0; j < 24; j++) {
            double w = get_weight(j, rho);
            for (int c = 0; c < 3 && is_used[j]; c++)
                a[3 * n + c] = w * device[3 * j + c];
            n += is_used[j];
        }
        if (n < 6)
            return gn_error_set(out_error, -EDOM,
                                "%d patches of the chart are usable for the colour matrix, at "
                                "least 6 are needed: expose so that fewer are clipped",
                                n);
        m.condition = gn_solve_get_condition(a, n, 3);
        if (!(m.condition <= GN_CHART_MAX_CONDITION) ||
            solve_matrix(device, is_used, keeps_white, m.to_rec709) < 0)
            return gn_error_set(out_error, -EDOM,
                                "the patches' colours do not determine a matrix (condition number "
                                "%.3g, at most %g is right): is this a colour camera, and is the "
                                "light white?",
                                m.condition, GN_CHART_MAX_CONDITION);
        find_errors(device, &m);
        if (leave_out(&m, is_used) == 0)
            break;
    }
    double sum = 0;
    int n = 0;
    for (int j = 0; j < 24; j++) {
        m.is_outlier[j] = is_measured(device, j) && !is_used[j];
        sum += is_used[j] ? m.error[j] * m.error[j] : 0;
        n += is_used[j];
        if (j >= GN_CHART_WHITE && is_used[j])
            m.worst_grey = fmax(m.worst_grey, m.error[j]);
    }
    m.rms = sqrt(sum / n);
    if (!(m.rms <= GN_CHART_MAX_ERROR))
        return gn_error_set(
            out_error, -EDOM,
            "no matrix makes the chart's colours of these: the best is %.0f %% off "
            "(RMS, at most %.0f %% is right); is the light white, and are all three "
            "channels open? --no-matrix leaves it out",
            100 * m.rms, 100 * GN_CHART_MAX_ERROR);
    *out_matrix = m;
    return 0;
}
