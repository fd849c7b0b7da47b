/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/sheet.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/feature.h"
#include "client/vision/markers.h"
#include "common/file.h"

/** White around everything, at least, and what is below it for text and ruler, mm. */
enum { MARGIN_MM = 10, FOOT_MM = 14 };
/** A printer's and a ruler's tolerance, m: markers this far from a plane lie in it. */
#define FLAT_M 1e-4

/** A sheet being written. y runs down. */
struct sheet {
    FILE *out;
    char *text;
    size_t size;
    struct gn_sheet_size is;
    double left_mm, top_mm; // where the drawing begins
    double bottom_mm;       // where it ends
};

/** The drawing's size and the white around it; the sheet is as wide as its text at least, up to 75
 * letters of 1.6 mm. */
static int begin(struct sheet *s, const char *path, double width_mm, double height_mm,
                 double margin_mm, struct gn_error *out_error)
{
    *s = (struct sheet){0};
    s->out = open_memstream(&s->text, &s->size);
    if (!s->out)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    margin_mm = fmax(margin_mm, MARGIN_MM);
    s->is.ruler_mm = 100;
    s->is.width_mm = fmax(width_mm + 2 * margin_mm, s->is.ruler_mm + 4 * MARGIN_MM);
    s->is.height_mm = height_mm + 2 * margin_mm + FOOT_MM;
    s->left_mm = (s->is.width_mm - width_mm) / 2;
    s->top_mm = margin_mm;
    s->bottom_mm = s->is.height_mm - FOOT_MM;
    fprintf(s->out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.4fmm\" height=\"%.4fmm\" "
            "viewBox=\"0 0 %.4f %.4f\">\n<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n"
            "<path d=\"",
            s->is.width_mm, s->is.height_mm, s->is.width_mm, s->is.height_mm);
    return 0;
}

/** A black quadrangle, mm from the drawing's upper left corner. All are in one path: renderers
 * leave no seams between them. */
static void put(struct sheet *s, double corners_mm[4][2])
{
    for (int k = 0; k < 4; k++)
        fprintf(s->out, "%c%.4f %.4f", k ? 'L' : 'M', s->left_mm + corners_mm[k][0],
                s->top_mm + corners_mm[k][1]);
    fprintf(s->out, "z\n");
}

static void put_square(struct sheet *s, double x_mm, double y_mm, double side_mm)
{
    double corners[4][2] = {{x_mm, y_mm},
                            {x_mm + side_mm, y_mm},
                            {x_mm + side_mm, y_mm + side_mm},
                            {x_mm, y_mm + side_mm}};
    put(s, corners);
}

/** A marker with these corners, from its own top left clockwise; each row's black runs. */
static int put_marker(struct sheet *s, int dictionary, int id, double corners_mm[4][2],
                      struct gn_error *out_error)
{
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    int side = gn_marker_get_cells(dictionary, id, cells);
    if (side == 0)
        return gn_error_set(out_error, -EINVAL,
                            "the board needs more markers than the dictionary's %d",
                            gn_marker_count_ids(dictionary));
    for (int row = 0; row < side; row++) {
        for (int begin = 0, end; begin < side; begin = end + 1) {
            for (end = begin; end < side && !cells[row * side + end]; end++)
                continue;
            const int at[4][2] = {{begin, row}, {end, row}, {end, row + 1}, {begin, row + 1}};
            double run[4][2];
            for (int k = 0; k < 4; k++)
                for (int i = 0; i < 2; i++)
                    run[k][i] = corners_mm[0][i] +
                                (corners_mm[1][i] - corners_mm[0][i]) * at[k][0] / side +
                                (corners_mm[3][i] - corners_mm[0][i]) * at[k][1] / side;
            if (end > begin)
                put(s, run);
        }
    }
    return 0;
}

/** Ends the drawing; then the text is to be printed. */
static void begin_text(struct sheet *s)
{
    fprintf(s->out, "\"/>\n<text x=\"%d\" y=\"%.4f\" font-family=\"sans-serif\" font-size=\"3\">",
            MARGIN_MM, s->bottom_mm + 3);
}

/** Ruler, end, file. err: what went wrong until now. */
static int finish(struct sheet *s, const char *path, int err, struct gn_sheet_size *out_size,
                  struct gn_error *out_error)
{
    double y = s->bottom_mm + 6;
    fprintf(s->out,
            "</text>\n<path fill=\"none\" stroke=\"#000\" stroke-width=\"0.2\" "
            "d=\"M%d %.4fv3m0-1.5h%dm0-1.5v3\"/>\n<text x=\"%d\" y=\"%.4f\" "
            "font-family=\"sans-serif\" font-size=\"3\">%d mm, if printed at 100 %%</text>\n"
            "</svg>\n",
            MARGIN_MM, y, s->is.ruler_mm, MARGIN_MM + 2, y + 5, s->is.ruler_mm);
    if (fclose(s->out) != 0 && !err)
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    if (!err && strcmp(path, "-") == 0) {
        if (fwrite(s->text, 1, s->size, stdout) != s->size || fflush(stdout) != 0)
            err = gn_error_set(out_error, -EIO, "standard output: %s", strerror(errno));
    } else if (!err) {
        err = gn_file_write(path, s->text, s->size, out_error);
    }
    if (!err)
        *out_size = s->is;
    free(s->text);
    return err;
}

/** Markers count along the rows' white squares, as those of cv::aruco::CharucoBoard of 4.6. */
static int put_board(struct sheet *s, const struct gn_board *b, struct gn_error *out_error)
{
    double square = 1e3 * b->square_m, marker = 1e3 * b->marker_m, gap = (square - marker) / 2;
    int n_markers = 0, err = 0;
    for (int row = 0; row < b->rows; row++) {
        for (int column = 0; column < b->columns && !err; column++) {
            double x = column * square, y = row * square;
            double corners[4][2] = {{x + gap, y + gap},
                                    {x + gap + marker, y + gap},
                                    {x + gap + marker, y + gap + marker},
                                    {x + gap, y + gap + marker}};
            if ((column + row) % 2 == 0)
                put_square(s, x, y, square);
            else if (b->is_charuco)
                err = put_marker(s, b->dictionary, n_markers++, corners, out_error);
        }
    }
    return err;
}

int gn_sheet_write_board(const char *path, const struct gn_board *board,
                         struct gn_sheet_size *out_size, struct gn_error *out_error)
{
    struct sheet s;
    char name[32];
    double square = 1e3 * board->square_m;
    if (board->is_charuco && !gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    int err = begin(&s, path, board->columns * square, board->rows * square, square / 3, out_error);
    if (err)
        return err;
    err = put_board(&s, board, out_error);
    begin_text(&s);
    fprintf(s.out, "%s %dx%d, squares of %g mm", board->is_charuco ? "ChArUco board" : "chessboard",
            board->columns, board->rows, square);
    if (board->is_charuco) {
        gn_marker_print_name(board->dictionary, name, sizeof(name));
        fprintf(s.out, ", markers of %g mm, %s", 1e3 * board->marker_m, name);
    }
    return finish(&s, path, err, out_size, out_error);
}

/** The body's markers as one sees them: where they begin and how far they reach, m; and the widest
 * cell. */
struct extent {
    double low[2], high[2];
    double side_m;
};

static int measure(const struct gn_body *body, struct extent *out, struct gn_error *out_error)
{
    *out = (struct extent){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 0};
    for (int i = 0; i < body->n_markers; i++) {
        double(*c)[3] = body->markers[i].corners_body;
        double facing =
            (c[1][0] - c[0][0]) * (c[3][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[3][0] - c[0][0]);
        for (int k = 0; k < 4; k++) {
            if (fabs(c[k][2]) > FLAT_M || facing > 0)
                return gn_error_set(out_error, -EINVAL,
                                    "body \"%s\": marker %d does not lie in the plane z = 0 facing "
                                    "z: print it by itself, with --marker",
                                    body->name, body->markers[i].id);
            for (int d = 0; d < 2; d++) {
                out->low[d] = fmin(out->low[d], c[k][d]);
                out->high[d] = fmax(out->high[d], c[k][d]);
            }
        }
        out->side_m = fmax(out->side_m, hypot(c[1][0] - c[0][0], c[1][1] - c[0][1]));
    }
    return 0;
}

int gn_sheet_write_body(const char *path, const struct gn_bodies *bodies, int body,
                        struct gn_sheet_size *out_size, struct gn_error *out_error)
{
    const struct gn_body *b = &bodies->bodies[body];
    struct extent e;
    struct sheet s;
    char name[32];
    if (!gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    int err = measure(b, &e, out_error);
    // A cell of white; the coarsest marker has six to a side.
    if (!err)
        err = begin(&s, path, 1e3 * (e.high[0] - e.low[0]), 1e3 * (e.high[1] - e.low[1]),
                    1e3 * e.side_m / 6, out_error);
    if (err)
        return err;
    for (int i = 0; i < b->n_markers && !err; i++) {
        double corners[4][2];
        for (int k = 0; k < 4; k++) {
            corners[k][0] = 1e3 * (b->markers[i].corners_body[k][0] - e.low[0]);
            corners[k][1] = 1e3 * (e.high[1] - b->markers[i].corners_body[k][1]);
        }
        err = put_marker(&s, bodies->dictionary, b->markers[i].id, corners, out_error);
    }
    begin_text(&s);
    gn_marker_print_name(bodies->dictionary, name, sizeof(name));
    fputs(name, s.out);
    if (b->n_markers == 1)
        fprintf(s.out, ", marker %d of %g mm", b->markers[0].id, 1e3 * e.side_m);
    else
        fprintf(s.out, ", %d markers", b->n_markers);
    fprintf(s.out, "; x to the right, y up");
    return finish(&s, path, err, out_size, out_error);
}
