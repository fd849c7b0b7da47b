/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/views.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#include "client/calibrate/solve.h"
#include "common/draw.h"

int gn_board_check(const struct gn_board *board, struct gn_error *out_error)
{
    if (board->columns < 3 || board->rows < 3 || board->columns > 33 || board->rows > 33)
        return gn_error_set(out_error, -EINVAL, "a board has 3 to 33 squares a side, this %d x %d",
                            board->columns, board->rows);
    if (!(board->square_m > 0 && board->square_m < 100))
        return gn_error_set(out_error, -EINVAL, "squares of %g m", board->square_m);
    if (board->is_charuco && !(board->marker_m > 0 && board->marker_m < board->square_m))
        return gn_error_set(out_error, -EINVAL,
                            "markers of %g m do not lie in squares of %g m: right would be about "
                            "0.7 of the square's side",
                            board->marker_m, board->square_m);
    if (!board->is_charuco && (board->columns + board->rows) % 2 == 0)
        return gn_error_set(
            out_error, -EINVAL,
            "a chessboard of %d x %d squares looks the same upside down, so its corners have two "
            "numberings; right would be one side odd and one even, as 10 x 7, or a ChArUco board",
            board->columns, board->rows);
    return 0;
}

static int get_cell(double x, int size, int cells)
{
    int cell = (int)(x * cells / size);
    return cell < 0 ? 0 : cell >= cells ? cells - 1 : cell;
}

static int count_cells(const struct gn_board_view *views, int n, int width, int height,
                       bool is_hit[GN_VIEWS_ROWS][GN_VIEWS_COLUMNS])
{
    int count = 0;
    for (int v = 0; v < n; v++)
        for (int i = 0; i < views[v].n; i++) {
            const double *xy = views[v].corners[i].xy;
            bool *cell = &is_hit[get_cell(xy[1], height, GN_VIEWS_ROWS)]
                                [get_cell(xy[0], width, GN_VIEWS_COLUMNS)];
            count += !*cell;
            *cell = true;
        }
    return count;
}

/*
 * By how much the board's distance changes over the board, relative, along its columns and its
 * rows: the homography from the board to the picture divides by it. Board coordinates centred and
 * scaled to [-1, 1].
 */
static void get_tilts(const struct gn_board_view *view, double out_tilts[static 2])
{
    double a[2 * GN_BOARD_MAX_CORNERS * 8] = {0}, b[2 * GN_BOARD_MAX_CORNERS], h[8];
    double mean[4] = {0}, size[4] = {1e-9, 1e-9, 1e-9, 1e-9};
    for (int i = 0; i < view->n; i++) {
        const struct gn_board_corner *c = &view->corners[i];
        double p[4] = {c->column, c->row, c->xy[0], c->xy[1]};
        for (int k = 0; k < 4; k++)
            mean[k] += p[k] / view->n;
    }
    for (int i = 0; i < view->n; i++) {
        const struct gn_board_corner *c = &view->corners[i];
        double p[4] = {c->column, c->row, c->xy[0], c->xy[1]};
        for (int k = 0; k < 4; k++)
            size[k] = fmax(size[k], fabs(p[k] - mean[k]));
    }
    for (int i = 0; i < view->n; i++) {
        const struct gn_board_corner *c = &view->corners[i];
        double x = (c->column - mean[0]) / size[0], y = (c->row - mean[1]) / size[1];
        for (int k = 0; k < 2; k++) {
            double *row = a + 8 * (2 * i + k), t = (c->xy[k] - mean[2 + k]) / size[2 + k];
            row[3 * k] = x;
            row[3 * k + 1] = y;
            row[3 * k + 2] = 1;
            row[6] = -x * t;
            row[7] = -y * t;
            b[2 * i + k] = t;
        }
    }
    bool is_known = view->n >= 4 && gn_solve_least_squares(a, b, 2 * view->n, 8, h) == 0;
    for (int k = 0; k < 2; k++)
        out_tilts[k] = is_known ? 2 * h[6 + k] : 0;
}

static double get_tilt(const struct gn_board_view *view)
{
    double tilts[2];
    get_tilts(view, tilts);
    return hypot(tilts[0], tilts[1]);
}

double gn_views_get_shift(const struct gn_board_view *a, const struct gn_board_view *b)
{
    const struct gn_board_corner *grid[32][32] = {{NULL}}; // boards have up to 33 squares a side
    double largest = 0;
    int n = 0;
    for (int i = 0; i < a->n; i++)
        grid[a->corners[i].row][a->corners[i].column] = &a->corners[i];
    for (int i = 0; i < b->n; i++) {
        const struct gn_board_corner *there = &b->corners[i];
        const struct gn_board_corner *here = grid[there->row][there->column];
        if (!here)
            continue;
        largest = fmax(largest, hypot(here->xy[0] - there->xy[0], here->xy[1] - there->xy[1]));
        n++;
    }
    return n < 4 ? INFINITY : largest;
}

bool gn_views_are_alike(const struct gn_board_view *a, const struct gn_board_view *b, int width,
                        int height)
{
    double s[2], t[2];
    if (gn_views_get_shift(a, b) > GN_VIEWS_ALIKE_SHIFT * hypot(width, height))
        return false;
    get_tilts(a, s);
    get_tilts(b, t);
    return hypot(s[0] - t[0], s[1] - t[1]) < GN_VIEWS_ALIKE_TILT;
}

/* Which third of so many cells: the outer ones are a quarter of them and more. */
static int get_third(int cell, int cells)
{
    int outer = (cells + 2) / 4;
    return cell < outer ? 0 : cell >= cells - outer ? 2 : 1;
}

double gn_views_describe_bare(const struct gn_board_view *views, int n, int width, int height,
                              char out_text[static GN_VIEWS_BARE_BYTES])
{
    static const char *const names[9] = {"top left",    "top",    "top right",
                                         "left",        "middle", "right",
                                         "bottom left", "bottom", "bottom right"};
    bool is_hit[GN_VIEWS_ROWS][GN_VIEWS_COLUMNS] = {{false}};
    int balance[9] = {0}; // cells without corners less those with
    int n_hit = count_cells(views, n, width, height, is_hit);
    size_t used = 0;
    for (int y = 0; y < GN_VIEWS_ROWS; y++)
        for (int x = 0; x < GN_VIEWS_COLUMNS; x++)
            balance[3 * get_third(y, GN_VIEWS_ROWS) + get_third(x, GN_VIEWS_COLUMNS)] +=
                is_hit[y][x] ? -1 : 1;
    out_text[0] = '\0';
    for (int i = 0; i < 9; i++)
        if (balance[i] > 0)
            used += (size_t)snprintf(out_text + used, GN_VIEWS_BARE_BYTES - used, "%s%s",
                                     used ? ", " : "", names[i]);
    return (double)n_hit / (GN_VIEWS_ROWS * GN_VIEWS_COLUMNS);
}

int gn_views_check(const struct gn_board_view *views, int n, int width, int height,
                   struct gn_views_figures *out_figures, struct gn_error *out_error)
{
    struct gn_views_figures f = {0};
    if (n < GN_VIEWS_MIN)
        return gn_error_set(out_error, -EDOM,
                            "%d pictures show the board, at least %d are needed and 10 to 20 are "
                            "right, the board tilted differently in each",
                            n, GN_VIEWS_MIN);
    double largest = 0;
    for (int v = 0; v < n; v++) {
        double tilt = get_tilt(&views[v]);
        f.n_tilted += tilt > GN_VIEWS_MIN_TILT;
        f.tilt = fmax(f.tilt, fmin(tilt, largest));
        largest = fmax(largest, tilt);
    }
    if (f.n_tilted < 2)
        return gn_error_set(out_error, -EDOM,
                            "in %d of %d pictures the board is parallel to the picture, which does "
                            "not tell the focal length from the distance; tilt it by 20 to 45 "
                            "degrees, about both of its sides",
                            n - f.n_tilted, n);
    bool is_hit[GN_VIEWS_ROWS][GN_VIEWS_COLUMNS] = {{false}};
    f.coverage =
        (double)count_cells(views, n, width, height, is_hit) / (GN_VIEWS_ROWS * GN_VIEWS_COLUMNS);
    if (f.coverage < GN_VIEWS_MIN_COVERAGE)
        return gn_error_set(out_error, -EDOM,
                            "corners were seen in %.0f %% of the picture, at least %.0f %% is "
                            "needed: the lens is not known where no corner was; move the board "
                            "to the edges and corners of the picture",
                            100 * f.coverage, 100 * GN_VIEWS_MIN_COVERAGE);
    *out_figures = f;
    return 0;
}

int gn_views_judge(const struct gn_intrinsics *in, int width, double max_rms_px,
                   struct gn_error *out_error)
{
    double focal = fmax(in->deviation[0] / in->fx, in->deviation[1] / in->fy);
    double centre = fmax(in->deviation[2], in->deviation[3]) / width;
    if (!(focal < 0.02 && centre < 0.02))
        return gn_error_set(out_error, -EDOM,
                            "the views leave the focal length uncertain by %.1f %% and the centre "
                            "by %.1f %% of the picture, 2 %% is right: more views, tilted more",
                            100 * focal, 100 * centre);
    if (!(in->rms_px <= max_rms_px))
        return gn_error_set(out_error, -EDOM,
                            "corners lie off by %.2f px (RMS), at most %.2f is right: is the board "
                            "flat, its number of squares as said, nothing blurred by motion, the "
                            "lens no fisheye?",
                            in->rms_px, max_rms_px);
    return 0;
}

int gn_views_draw(const struct gn_board_view *views, int n, int width, int height, double gain,
                  struct gn_image8 *out_image)
{
    static const struct gn_ink paper = {245, 245, 245}, empty = {255, 205, 205},
                               dot = {40, 90, 200}, line = {220, 40, 0};
    bool is_hit[GN_VIEWS_ROWS][GN_VIEWS_COLUMNS] = {{false}};
    int err = gn_image8_init(out_image, width, height, 3);
    if (err)
        return err;
    count_cells(views, n, width, height, is_hit);
    for (int y = 0; y < GN_VIEWS_ROWS; y++)
        for (int x = 0; x < GN_VIEWS_COLUMNS; x++)
            gn_draw_box(out_image, x * width / GN_VIEWS_COLUMNS, y * height / GN_VIEWS_ROWS,
                        (x + 1) * width / GN_VIEWS_COLUMNS - 1,
                        (y + 1) * height / GN_VIEWS_ROWS - 1, is_hit[y][x] ? paper : empty);
    for (int v = 0; v < n; v++)
        for (int i = 0; i < views[v].n; i++) {
            const double *xy = views[v].corners[i].xy, *e = views[v].residuals + 2 * i;
            double tip[2] = {xy[0] + gain * e[0], xy[1] + gain * e[1]};
            gn_draw_line(out_image, xy, tip, line);
            gn_draw_dot(out_image, xy[0], xy[1], 1.5, dot);
        }
    return 0;
}
