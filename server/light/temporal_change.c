/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal_change.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_rows.h"
#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;
static const double golden_angle = 2.39996322972865332; // pi (3 - sqrt 5)

static const double cos_window = 0.766044443118978; // 40 degrees: each place is in about 7 windows
static const double cos_middle = 0.866025403784439; // 30: no place is further from a middle than 15
static const double ratio_changed = 4, share_changed = 0.02;

enum { N_FILL = 256 };

/* The i-th of n directions on a spiral of even density. */
static void get_spiral(int i, int n, double out_dir[static 3])
{
    double z = 1 - (2 * i + 1.0) / n, r = sqrt(1 - z * z);
    out_dir[0] = r * cos(golden_angle * i);
    out_dir[1] = r * sin(golden_angle * i);
    out_dir[2] = z;
}

static void get_middles(double out_middles[static GN_CHANGE_WINDOWS][3])
{
    for (int i = 0; i < GN_CHANGE_WINDOWS; i++)
        get_spiral(i, GN_CHANGE_WINDOWS, out_middles[i]);
}

static double get_cosine(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void add(double middles[static GN_CHANGE_WINDOWS][3], const double dir[static 3],
                double luminance, double sums[static GN_CHANGE_SUMS])
{
    for (int i = 0; i < GN_CHANGE_WINDOWS; i++) {
        double c = get_cosine(middles[i], dir);
        if (c > cos_window) // falls to 0 at the rim, so that a light that moves makes no step
            sums[i] += luminance * (c - cos_window) / (1 - cos_window);
    }
    sums[GN_CHANGE_WINDOWS] += luminance;
}

void gn_change_add(double sums[static GN_CHANGE_SUMS], const double dir[static 3], double luminance)
{
    double middles[GN_CHANGE_WINDOWS][3];
    get_middles(middles);
    add(middles, dir, luminance, sums);
}

/* A patch's share of a window. */
struct share {
    int window;
    double weight;
};

struct gn_change_windows {
    double fill[GN_CHANGE_SUMS]; // of a fill of luminance 1
    int n_columns, n_rows;       // of patches
    struct share *shares;        // owned
    size_t start[];              // [n_rows * n_columns + 1] each patch's first share
};

/* Where a patch looks: its middle, or where the map does not show that, its first texel shown.
 * False: it shows none. */
static bool get_patch_direction(const struct gn_map_table *t, int x0, int y0,
                                double out_dir[static 3])
{
    int width = t->projection.width, height = t->projection.height, side = t->patch_side;
    int x1 = x0 + side < width ? x0 + side : width, y1 = y0 + side < height ? y0 + side : height;
    size_t place = (size_t)((y0 + y1) / 2) * (size_t)width + (size_t)((x0 + x1) / 2);
    bool is_shown = t->solid_angle[place] > 0;
    for (int y = y0; y < y1 && !is_shown; y++) {
        for (int x = x0; x < x1 && !is_shown; x++) {
            place = (size_t)y * (size_t)width + (size_t)x;
            is_shown = t->solid_angle[place] > 0;
        }
    }
    for (int c = 0; c < 3; c++)
        out_dir[c] = (double)t->direction_world[3 * place + (size_t)c];
    return is_shown;
}

/* The fill as the even light of a cap about the axis' other end. */
static void add_fill(const struct gn_map_table *t, double middles[static GN_CHANGE_WINDOWS][3],
                     double sums[static GN_CHANGE_SUMS])
{
    double dirs[N_FILL][3], rim = 1 - t->fill_solid_angle / (2 * pi);
    int n = 0;
    for (int i = 0; i < N_FILL && t->fill_solid_angle > 0; i++) {
        get_spiral(i, N_FILL, dirs[n]);
        n += -get_cosine(dirs[n], t->axis_world) > rim;
    }
    for (int i = 0; i < n; i++)
        add(middles, dirs[i], t->fill_solid_angle / n, sums);
}

int gn_change_windows_create(const struct gn_map_table *table,
                             struct gn_change_windows **out_windows)
{
    int side = table->patch_side, n_columns = (table->projection.width + side - 1) / side;
    int n_rows = (table->projection.height + side - 1) / side;
    size_t n = (size_t)n_rows * (size_t)n_columns, n_shares = 0;
    struct gn_change_windows *w = calloc(1, sizeof(*w) + (n + 1) * sizeof(w->start[0]));
    *out_windows = NULL;
    if (!w)
        return -ENOMEM;
    w->shares = malloc(n * GN_CHANGE_SUMS * sizeof(*w->shares));
    if (!w->shares) {
        free(w);
        return -ENOMEM;
    }
    w->n_columns = n_columns;
    w->n_rows = n_rows;
    double middles[GN_CHANGE_WINDOWS][3], dir[3];
    get_middles(middles);
    for (size_t i = 0; i < n; i++) {
        int x = (int)(i % (size_t)n_columns) * side, y = (int)(i / (size_t)n_columns) * side;
        double of_patch[GN_CHANGE_SUMS] = {0};
        if (get_patch_direction(table, x, y, dir))
            add(middles, dir, 1, of_patch);
        for (int k = 0; k < GN_CHANGE_SUMS; k++)
            if (of_patch[k] > 0)
                w->shares[n_shares++] = (struct share){k, of_patch[k]};
        w->start[i + 1] = n_shares;
    }
    struct share *fewer = realloc(w->shares, (n_shares + 1) * sizeof(*fewer));
    w->shares = fewer ? fewer : w->shares;
    add_fill(table, middles, w->fill);
    *out_windows = w;
    return 0;
}

void gn_change_windows_destroy(struct gn_change_windows **windows)
{
    if (*windows)
        free((*windows)->shares);
    free(*windows);
    *windows = NULL;
}

void gn_change_measure(const struct gn_radiance_map *map, double out_sums[static GN_CHANGE_SUMS])
{
    const struct gn_change_windows *w = map->table->windows;
    int side = map->table->patch_side, height = map->radiance.height;
    double fill = gn_luminance(map->fill);
    for (int k = 0; k < GN_CHANGE_SUMS; k++)
        out_sums[k] = fill * w->fill[k];
    for (int row = 0; row < w->n_rows; row++) {
        double luminance[GN_MAP_PATCHES] = {0};
        int y0 = row * side, y1 = y0 + side < height ? y0 + side : height;
        for (int y = y0; y < y1; y++)
            for (int k = 0; k < GN_MAP_PATCHES; k++)
                luminance[k] += map->rows[y].luminance[k];
        for (int k = 0; k < w->n_columns; k++) {
            size_t patch = (size_t)row * (size_t)w->n_columns + (size_t)k;
            for (size_t i = w->start[patch]; i < w->start[patch + 1]; i++)
                out_sums[w->shares[i].window] += luminance[k] * w->shares[i].weight;
        }
    }
}

void gn_change_find(struct gn_change *change, const double before[static GN_CHANGE_SUMS],
                    const double after[static GN_CHANGE_SUMS])
{
    double all = fmax(before[GN_CHANGE_WINDOWS], after[GN_CHANGE_WINDOWS]);
    double floor = share_changed * all;
    get_middles(change->middle);
    change->any = false;
    change->deviation = 0;
    for (int i = 0; i < GN_CHANGE_SUMS; i++) {
        double a = before[i], b = after[i];
        change->is_changed[i] = fmax(a, b) > ratio_changed * fmin(a, b) && fabs(a - b) > floor;
        change->any = change->any || change->is_changed[i];
        if (all > 0 && i < GN_CHANGE_WINDOWS)
            change->deviation = fmax(change->deviation, fabs(a - b) / all);
    }
}

bool gn_change_has(const struct gn_change *change, const double dir[static 3])
{
    for (int i = 0; i < GN_CHANGE_WINDOWS && change->any; i++) {
        if (change->is_changed[i] && get_cosine(change->middle[i], dir) > cos_middle)
            return true;
    }
    return false;
}
