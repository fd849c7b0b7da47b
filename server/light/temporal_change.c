/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/temporal_change.h"

#include <math.h>
#include <string.h>

#include "server/light/map_table.h"

static const double pi = 3.14159265358979323846;
static const double golden_angle = 2.39996322972865332; // pi (3 - sqrt 5)

static const double cos_window = 0.766044443118978; // 40 degrees: each place is in about 7 windows
static const double cos_middle = 0.866025403784439; // 30: no place is further from a middle than 15
static const double ratio_changed = 4, share_changed = 0.02;

enum { N_PATCHES = 48, N_FILL = 256 };

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

/* The light of a patch of texels; false: it shows none. Its direction is that of its middle, where
 * the map does not show that, of its first texel shown. */
static bool get_patch(const struct gn_radiance_map *map, int x0, int y0, int side,
                      double out_dir[static 3], double *out_luminance)
{
    int width = map->radiance.width, height = map->radiance.height;
    int x1 = x0 + side < width ? x0 + side : width, y1 = y0 + side < height ? y0 + side : height;
    size_t place = (size_t)((y0 + y1) / 2) * (size_t)width + (size_t)((x0 + x1) / 2);
    bool is_shown = map->solid_angle[place] > 0;
    double sum = 0;
    for (int y = y0; y < y1; y++) {
        size_t row = (size_t)y * (size_t)width;
        for (size_t i = row + (size_t)x0; i < row + (size_t)x1; i++) {
            const float *l = map->radiance.data + 3 * i;
            if (!is_shown && map->solid_angle[i] > 0) {
                is_shown = true;
                place = i;
            }
            sum +=
                (double)(map->solid_angle[i] * (0.2126f * l[0] + 0.7152f * l[1] + 0.0722f * l[2]));
        }
    }
    for (int c = 0; c < 3; c++)
        out_dir[c] = (double)map->direction_world[3 * place + (size_t)c];
    *out_luminance = sum;
    return is_shown;
}

/* The fill as the even light of a cap about the axis' other end. */
static void add_fill(const struct gn_radiance_map *map, double middles[static GN_CHANGE_WINDOWS][3],
                     double sums[static GN_CHANGE_SUMS])
{
    double luminance =
        map->fill_solid_angle * (0.2126 * (double)map->fill[0] + 0.7152 * (double)map->fill[1] +
                                 0.0722 * (double)map->fill[2]);
    double dirs[N_FILL][3], rim = 1 - map->fill_solid_angle / (2 * pi);
    int n = 0;
    for (int i = 0; i < N_FILL && luminance > 0; i++) {
        get_spiral(i, N_FILL, dirs[n]);
        n += -get_cosine(dirs[n], map->table->axis_world) > rim;
    }
    for (int i = 0; i < n; i++)
        add(middles, dirs[i], luminance / n, sums);
}

void gn_change_measure(const struct gn_radiance_map *map, double out_sums[static GN_CHANGE_SUMS])
{
    double middles[GN_CHANGE_WINDOWS][3], dir[3], luminance;
    int width = map->radiance.width, height = map->radiance.height;
    int side = ((width > height ? width : height) + N_PATCHES - 1) / N_PATCHES;
    get_middles(middles);
    memset(out_sums, 0, GN_CHANGE_SUMS * sizeof(*out_sums));
    for (int y = 0; y < height; y += side) {
        for (int x = 0; x < width; x += side) {
            if (get_patch(map, x, y, side, dir, &luminance) && luminance > 0)
                add(middles, dir, luminance, out_sums);
        }
    }
    add_fill(map, middles, out_sums);
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
