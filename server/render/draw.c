/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/draw.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/render/reference_lights.h"

/** Side of a square, texels; of a group of the fill's cells too. */
#define SIDE 16
#define GOLDEN 0.6180339887498949

double gn_draw_hash(uint64_t a, uint64_t b)
{
    // Splitmix64 of the pair. Source: Steele, Lea and Flood, OOPSLA 2014.
    uint64_t z = a * UINT64_C(0x9e3779b97f4a7c15) + b * UINT64_C(0xd1342543de82ef95) + 1;
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/** Place `d` on the Hilbert curve that fills a square of 2^k cells a side. Source: Hilbert, Math.
 * Ann. 38, 1891. */
static void get_hilbert(uint32_t side, uint64_t d, uint32_t out[static 2])
{
    uint32_t x = 0, y = 0;
    for (uint32_t s = 1; s < side; s *= 2, d /= 4) {
        uint32_t right = (uint32_t)(d / 2) & 1, up = (uint32_t)(d ^ right) & 1;
        if (up == 0) {
            if (right == 1) {
                x = s - 1 - x;
                y = s - 1 - y;
            }
            uint32_t t = x;
            x = y;
            y = t;
        }
        x += s * right;
        y += s * up;
    }
    out[0] = x;
    out[1] = y;
}

/** The share of all light, mean over the channels, that has an irradiance. */
static double get_share(const struct draw_map *m, const double irradiance[static 3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += m->total[k] > 0 ? irradiance[k] / m->total[k] : 0;
    return sum / 3;
}

/** Texel i of a square; false: it is none. */
static bool get_texel(const struct draw_map *m, uint32_t square, int i, int out[static 2])
{
    uint32_t at[2];
    get_hilbert(SIDE, (uint64_t)i, at);
    out[0] = (int)(square % (uint32_t)m->n_squares_x) * SIDE + (int)at[0];
    out[1] = (int)(square / (uint32_t)m->n_squares_x) * SIDE + (int)at[1];
    return out[0] < m->map->radiance.width && out[1] < m->map->radiance.height;
}

/** Cell i of an item: a texel of a square, or a cell of the fill. Its share. */
static double get_cell_share(const struct draw_map *m, int item, int i)
{
    double irradiance[3];
    if (item >= m->n_squares) {
        double cell = m->fill_scale * gn_reference_get_fill_cell(m->map, item - m->n_squares, i);
        for (int k = 0; k < 3; k++)
            irradiance[k] = (double)m->map->fill[k] * cell;
    } else {
        int at[2];
        if (!get_texel(m, m->square[item], i, at))
            return 0;
        size_t texel = (size_t)at[1] * (size_t)m->map->radiance.width + (size_t)at[0];
        for (size_t k = 0; k < 3; k++)
            irradiance[k] =
                (double)m->map->radiance.data[3 * texel + k] * m->map->solid_angle[texel];
    }
    return get_share(m, irradiance);
}

static int reserve(struct draw_map *m, int n_items)
{
    if (n_items <= m->capacity)
        return 0;
    free(m->square);
    free(m->cdf);
    m->square = malloc((size_t)n_items * sizeof(*m->square));
    m->cdf = malloc((size_t)n_items * sizeof(*m->cdf));
    m->capacity = m->square && m->cdf ? n_items : 0;
    return m->capacity ? 0 : -ENOMEM;
}

/** The squares along the curve. */
static void order_squares(struct draw_map *m, uint32_t n_x, uint32_t n_y)
{
    uint32_t side = 1;
    int n = 0;
    while (side < n_x || side < n_y)
        side *= 2;
    for (uint64_t d = 0; d < (uint64_t)side * side; d++) {
        uint32_t at[2];
        get_hilbert(side, d, at);
        if (at[0] < n_x && at[1] < n_y)
            m->square[n++] = at[1] * n_x + at[0];
    }
}

static int make_map(struct draw_map *m, const struct gn_radiance_map *map)
{
    int n_x = (map->radiance.width + SIDE - 1) / SIDE;
    int n_y = (map->radiance.height + SIDE - 1) / SIDE;
    m->map = map;
    m->n_squares = n_x * n_y;
    m->n_squares_x = n_x;
    m->fill_scale = gn_reference_get_fill_scale(map);
    m->n_items = m->n_squares + (m->fill_scale > 0 ? GN_FILL_GROUPS : 0);
    int ret = reserve(m, m->n_items);
    if (ret < 0)
        return ret;
    order_squares(m, (uint32_t)n_x, (uint32_t)n_y);
    gn_reference_sum_map(map, m->total);
    m->luminance = gn_luminance_of_sum(m->total);
    for (int k = 0; k < 3; k++)
        m->total[k] += m->fill_scale > 0 ? (double)map->fill[k] * map->fill_solid_angle : 0;
    double sum = 0;
    for (int item = 0; item < m->n_items; item++) {
        double part = 0;
        for (int i = 0; i < GROUP; i++)
            part += get_cell_share(m, item, i);
        m->cdf[item] = sum += part;
    }
    return 0;
}

int gn_draw_make(struct draw *draw, const struct gn_blend *blend)
{
    draw->n = blend->n;
    for (int p = 0; p < blend->n; p++) {
        int ret = make_map(&draw->maps[p], blend->state[p]->map);
        if (ret < 0)
            return ret;
    }
    return 0;
}

void gn_draw_finish(struct draw *draw)
{
    for (int p = 0; p < GN_PROBES_MAX; p++) {
        free(draw->maps[p].square);
        free(draw->maps[p].cdf);
    }
    *draw = (struct draw){0};
}

/** What was drawn: which part of which cell, and the probability of the part. */
struct drawn {
    int item, cell;
    double within; // [0, 1) of the cell's share
    double share;  // of the cell
};

/** What lies at u [0, cdf's end). False: nothing does. */
static bool find(const struct draw_map *m, double u, struct drawn *out)
{
    int low = 0, high = m->n_items;
    while (low < high) {
        int mid = low + (high - low) / 2;
        if (m->cdf[mid] > u)
            high = mid;
        else
            low = mid + 1;
    }
    if (low == m->n_items)
        return false;
    double rest = u - (low > 0 ? m->cdf[low - 1] : 0);
    out->item = low;
    out->share = 0;
    for (int i = 0; i < GROUP; i++) {
        double share = get_cell_share(m, low, i);
        if (!(share > 0))
            continue;
        out->cell = i;
        out->share = share;
        out->within = fmin(fmax(rest / share, 0), 1 - 0x1p-32);
        if (rest < share)
            break;
        rest -= share; // rounding may leave some after the last: then that one is it
    }
    return out->share > 0;
}

/** Adds the reference's lights of the cell to the lists' ends. */
static void list_cell(const struct draw_map *m, const struct drawn *drawn, struct light_list *list,
                      struct places *places)
{
    int at[2];
    if (drawn->item >= m->n_squares)
        gn_reference_add_fill_cell(m->map, drawn->item - m->n_squares, drawn->cell, m->fill_scale,
                                   list, places);
    else if (get_texel(m, m->square[drawn->item], drawn->cell, at))
        gn_reference_add_texel(m->map, at[0], at[1], m->luminance, list, places);
}

/** Keeps of the lights from `first` on only one, with `scale` times its power. */
static void keep_light(struct light_list *list, int first, int one, double scale)
{
    for (int k = 0; k < 3; k++) {
        list->dir[k][first] = list->dir[k][one];
        list->irradiance[k][first] = (float)((double)list->irradiance[k][one] * scale);
    }
    list->n = list->n_lit = first + 1;
}

/** Adds the light that was drawn with a probability; returns which of its cell it is. */
static void add_drawn(const struct draw_map *m, const struct drawn *drawn, double probability,
                      struct light_list *list, struct places *places)
{
    int first = list->n, first_place = places->n;
    list_cell(m, drawn, list, places);
    int n = list->n - first, n_places = places->n - first_place;
    if (n + n_places == 0)
        return;
    int one = (int)(drawn->within * (n + n_places));
    double scale = (n + n_places) / probability;
    if (one < n) {
        keep_light(list, first, first + one, scale);
        places->n = first_place;
        return;
    }
    list->n = list->n_lit = first;
    struct place *place = &places->lights[first_place];
    *place = places->lights[first_place + one - n];
    for (int k = 0; k < 3; k++)
        place->intensity[k] = (float)((double)place->intensity[k] * scale);
    places->n = first_place + 1;
}

/** The light at the end was drawn just before too: adds up. */
static void merge_last(struct light_list *list, int begin)
{
    int a = list->n - 2, b = list->n - 1;
    if (a < begin || list->dir[0][a] != list->dir[0][b] || list->dir[1][a] != list->dir[1][b] ||
        list->dir[2][a] != list->dir[2][b])
        return;
    for (int k = 0; k < 3; k++)
        list->irradiance[k][a] += list->irradiance[k][b];
    list->n--;
    list->n_lit--;
}

static void draw_map_lights(const struct draw_map *m, uint64_t sequence, int index, int n,
                            struct light_list *list, struct places *places)
{
    double end = m->n_items > 0 ? m->cdf[m->n_items - 1] : 0;
    int begin = list->n;
    for (int j = 0; j < n && end > 0; j++) {
        struct drawn drawn;
        double at = gn_draw_hash(sequence, (uint64_t)j) + index * GOLDEN;
        if (!find(m, (j + at - floor(at)) / n * end, &drawn))
            continue;
        add_drawn(m, &drawn, n * drawn.share / end, list, places);
        merge_last(list, begin);
    }
}

void gn_draw_lights(const struct draw *draw, int sequence, int index, int n,
                    struct light_list *list, struct places *places)
{
    list->n = list->n_lit = places->n = 0;
    for (int p = 0; p < draw->n; p++) {
        draw_map_lights(&draw->maps[p], (uint64_t)sequence * GN_PROBES_MAX + (uint64_t)p, index,
                        (n + draw->n - 1) / draw->n, list, places);
        list->ends[p] = list->n;
        places->ends[p] = places->n;
    }
    memset(list->total, 0, sizeof(list->total));
    for (int p = 0; p < draw->n; p++) {
        for (int k = 0; k < 3; k++)
            list->total[k] += draw->maps[p].total[k];
    }
    gn_reference_fill_cdf(list);
    gn_places_fill_cdf(places);
}
