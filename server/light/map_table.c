/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/map_table.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/radiance_map.h"
#include "server/light/sh.h"
#include "server/light/temporal_change.h"

static const double pi = 3.14159265358979323846;

static bool is_same_projection(const struct gn_projection *a, const struct gn_projection *b)
{
    bool is_same = a->type == b->type && a->width == b->width && a->height == b->height &&
                   a->center[0] == b->center[0] && a->center[1] == b->center[1] &&
                   a->radius == b->radius && a->theta_max == b->theta_max;
    for (int i = 0; i < 4; i++)
        is_same = is_same && a->k[i] == b->k[i];
    for (int i = 0; i < 3; i++)
        is_same = is_same && a->vignetting[i] == b->vignetting[i];
    return is_same;
}

/* The position of the texel's centre, drawn into the circle where it lies outside. */
static bool clamp_to_circle(const struct gn_projection *p, double margin, double xy[static 2])
{
    if (!gn_projection_is_radial(p->type))
        return false;
    double dx = xy[0] - p->center[0], dy = xy[1] - p->center[1], r = hypot(dx, dy);
    if (r <= p->radius)
        return false;
    double scale = fmax(p->radius - margin, 0) / r;
    xy[0] = fmin(fmax(p->center[0] + scale * dx, 0), p->width);
    xy[1] = fmin(fmax(p->center[1] + scale * dy, 0), p->height);
    return true;
}

static void address_row(void *context, int y, int worker)
{
    (void)worker;
    struct gn_map_table *t = context;
    const struct gn_projection *p = &t->projection;
    for (int x = 0; x < p->width; x++) {
        size_t i = (size_t)y * (size_t)p->width + (size_t)x;
        double solid_angle = gn_projection_get_solid_angle(p, x, y);
        double xy[2] = {x + 0.5, y + 0.5}, dir[3] = {0, 0, 1};
        bool has_light = solid_angle > 0;
        if (has_light)
            clamp_to_circle(p, 0.25, xy);
        if (!gn_projection_get_direction(p, xy[0], xy[1], dir))
            has_light = false;
        t->solid_angle[i] = has_light ? (float)solid_angle : 0;
        for (int c = 0; c < 3; c++)
            t->direction_probe[3 * i + (size_t)c] = (float)dir[c];
    }
}

static void rotate_row(void *context, int y, int worker)
{
    (void)worker;
    struct gn_map_table *t = context;
    const double *m = t->world_from_probe;
    size_t width = (size_t)t->projection.width, start = (size_t)y * width;
    for (size_t i = start; i < start + width; i++) {
        const float *d = t->direction_probe + 3 * i;
        for (int c = 0; c < 3; c++)
            t->direction_world[3 * i + (size_t)c] =
                (float)(m[3 * c] * (double)d[0] + m[3 * c + 1] * (double)d[1] +
                        m[3 * c + 2] * (double)d[2]);
    }
}

/* Pairs the texels whose centres lie outside the circle with inner ones, one texel further in. */
static int list_rim(struct gn_map_table *t)
{
    const struct gn_projection *p = &t->projection;
    if (!gn_projection_is_radial(p->type))
        return 0;
    for (int pass = 0; pass < 2; pass++) {
        int n = 0;
        for (int y = 0; y < p->height; y++) {
            for (int x = 0; x < p->width; x++) {
                size_t i = (size_t)y * (size_t)p->width + (size_t)x;
                double xy[2] = {x + 0.5, y + 0.5};
                if (!(t->solid_angle[i] > 0) || !clamp_to_circle(p, 0.75, xy))
                    continue;
                if (pass == 1) {
                    int ix = (int)fmin(xy[0], p->width - 1), iy = (int)fmin(xy[1], p->height - 1);
                    t->rim[2 * n] = (uint32_t)i;
                    t->rim[2 * n + 1] = (uint32_t)iy * (uint32_t)p->width + (uint32_t)ix;
                }
                n++;
            }
        }
        t->n_rim = n;
        if (pass == 0 && n > 0 && !(t->rim = calloc((size_t)n, 2 * sizeof(*t->rim))))
            return -ENOMEM;
    }
    return 0;
}

/* Where each row's light begins and ends: a circle leaves no holes. */
static int find_spans(struct gn_map_table *t)
{
    int width = t->projection.width, height = t->projection.height;
    t->span = calloc((size_t)height, 2 * sizeof(*t->span));
    if (!t->span)
        return -ENOMEM;
    for (int y = 0; y < height; y++) {
        const float *row = t->solid_angle + (size_t)y * (size_t)width;
        int begin = 0, end = width;
        while (begin < end && !(row[begin] > 0))
            begin++;
        while (end > begin && !(row[end - 1] > 0))
            end--;
        t->span[2 * y] = begin;
        t->span[2 * y + 1] = end;
    }
    return 0;
}

static int make_gain(struct gn_map_table *t)
{
    const struct gn_projection *p = &t->projection;
    if (!gn_projection_has_vignetting(p))
        return 0;
    size_t n = (size_t)p->width * (size_t)p->height;
    t->gain = malloc(n * sizeof(*t->gain));
    if (!t->gain)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        double x = (double)(i % (size_t)p->width) + 0.5, y = (double)(i / (size_t)p->width) + 0.5;
        t->gain[i] = (float)(1 / gn_projection_get_vignetting(p, x, y));
    }
    return 0;
}

static double get_upward(const struct gn_map_table *t, size_t texel)
{
    const float *d = t->direction_world + 3 * texel;
    const double *a = t->axis_world;
    double up = a[0] * (double)d[0] + a[1] * (double)d[1] + a[2] * (double)d[2];
    return up > 0 ? up * (double)t->solid_angle[texel] : 0;
}

/* Sums read each texel's weight; the rim's weights are moved to where its light is taken from. */
static int make_weights(struct gn_map_table *t)
{
    size_t n = (size_t)t->projection.width * (size_t)t->projection.height;
    t->weight = t->solid_angle;
    t->has_row_weights = t->projection.type == GN_PROJECTION_LATLONG ||
                         t->projection.type == GN_PROJECTION_OCTAHEDRAL;
    if (t->n_rim > 0) {
        t->own_weight = malloc(n * sizeof(*t->own_weight));
        if (!t->own_weight)
            return -ENOMEM;
        memcpy(t->own_weight, t->solid_angle, n * sizeof(*t->own_weight));
        t->weight = t->own_weight;
    }
    if (t->fill_solid_angle > 0) {
        t->up_weight = malloc(n * sizeof(*t->up_weight));
        if (!t->up_weight)
            return -ENOMEM;
        for (size_t i = 0; i < n; i++)
            t->up_weight[i] = (float)get_upward(t, i);
    }
    for (int i = 0; i < t->n_rim; i++) {
        t->own_weight[t->rim[2 * i]] = 0;
        if (t->up_weight)
            t->up_weight[t->rim[2 * i]] = 0;
    }
    for (int i = 0; i < t->n_rim; i++) {
        t->own_weight[t->rim[2 * i + 1]] += t->solid_angle[t->rim[2 * i]];
        if (t->up_weight)
            t->up_weight[t->rim[2 * i + 1]] += (float)get_upward(t, t->rim[2 * i]);
    }
    return 0;
}

/* Integrals of the harmonics over the complement of the cap theta <= theta_max about z: those
 * without azimuth, of P_l from -1 to cos theta_max. */
static void integrate_complement(struct gn_map_table *t)
{
    double c = cos(t->projection.theta_max), before = 1, legendre = c;
    t->fill_harmonics[0] = sqrt(pi) * (1 + c);
    for (int l = 1; l <= 4; l++) {
        double next = ((2 * l + 1) * c * legendre - l * before) / (l + 1);
        t->fill_harmonics[l * (l + 1)] = sqrt(pi / (2 * l + 1)) * (next - before);
        before = legendre;
        legendre = next;
    }
}

/* The same where the picture's border cuts the circle: what the texels leave of the sphere, a
 * texel's extent included as in sh_project.c. */
static void subtract_texels(struct gn_map_table *t)
{
    double h[GN_SH_MAX] = {2 * sqrt(pi)};
    size_t n = (size_t)t->projection.width * (size_t)t->projection.height;
    for (size_t i = 0; i < n; i++) {
        const float *d = t->direction_probe + 3 * i;
        double w = (double)t->solid_angle[i], basis[GN_SH_MAX];
        if (!(w > 0))
            continue;
        gn_sh_get_basis(4, (double[3]){(double)d[0], (double)d[1], (double)d[2]}, basis);
        for (int l = 0; l <= 4; l++)
            for (int k = l * l; k < (l + 1) * (l + 1); k++)
                h[k] -= w * (1 - w * l * (l + 1) / 24) * basis[k];
    }
    memcpy(t->fill_harmonics, h, sizeof(h));
    t->fill_harmonics[0] = fmax(h[0], 0);
}

static void sum_solid_angles(struct gn_map_table *t)
{
    const struct gn_projection *p = &t->projection;
    for (int y = 0; y < p->height; y++) {
        double row = 0;
        for (int x = 0; x < p->width; x++)
            row += (double)t->solid_angle[(size_t)y * (size_t)p->width + (size_t)x];
        t->shown_solid_angle += row;
    }
    double reach = p->radius * (1 - 1e-6);
    bool is_cut = p->center[0] < reach || p->center[0] + reach > p->width || p->center[1] < reach ||
                  p->center[1] + reach > p->height;
    if (gn_projection_is_full_sphere(p))
        return;
    if (is_cut)
        subtract_texels(t);
    else
        integrate_complement(t);
    t->fill_solid_angle = 2 * sqrt(pi) * t->fill_harmonics[0];
}

static void fill_matrix(struct gn_map_table *t)
{
    struct gn_pose pose = {0};
    memcpy(pose.rotation, t->rotation, sizeof(pose.rotation));
    double m[16];
    gn_pose_to_matrix(&pose, m);
    for (int i = 0; i < 9; i++)
        t->world_from_probe[i] = m[4 * (i / 3) + i % 3];
    for (int i = 0; i < 3; i++)
        t->axis_world[i] = t->world_from_probe[3 * i + 2];
}

/* Whole numbers of four texels are summed faster. */
static int choose_patch_side(const struct gn_projection *p)
{
    int longer = p->width > p->height ? p->width : p->height;
    int side = (longer + GN_MAP_PATCHES - 1) / GN_MAP_PATCHES;
    return side < 16 ? side : (side + 3) / 4 * 4;
}

static int fill_table(struct gn_map_table *t, const struct gn_map_table *previous,
                      struct gn_pool *pool)
{
    size_t n = (size_t)t->projection.width * (size_t)t->projection.height;
    t->solid_angle = calloc(n, sizeof(*t->solid_angle));
    t->direction_probe = calloc(n, 3 * sizeof(*t->direction_probe));
    t->direction_world = calloc(n, 3 * sizeof(*t->direction_world));
    if (!t->solid_angle || !t->direction_probe || !t->direction_world)
        return -ENOMEM;
    if (previous && is_same_projection(&previous->projection, &t->projection)) {
        memcpy(t->solid_angle, previous->solid_angle, n * sizeof(*t->solid_angle));
        memcpy(t->direction_probe, previous->direction_probe, 3 * n * sizeof(*t->direction_probe));
    } else {
        gn_pool_run(pool, t->projection.height, address_row, t);
    }
    fill_matrix(t);
    gn_pool_run(pool, t->projection.height, rotate_row, t);
    if (gn_map_table_bound_blocks(t, pool) < 0 || find_spans(t) < 0 || make_gain(t) < 0 ||
        list_rim(t) < 0)
        return -ENOMEM;
    sum_solid_angles(t);
    int rc = make_weights(t);
    return rc < 0 ? rc : gn_change_windows_create(t, &t->windows);
}

int gn_map_table_create(const struct gn_projection *projection, const double rotation[static 4],
                        struct gn_map_table *previous, struct gn_pool *pool,
                        struct gn_map_table **out_table)
{
    *out_table = NULL;
    if (previous && is_same_projection(&previous->projection, projection) &&
        memcmp(previous->rotation, rotation, sizeof(previous->rotation)) == 0) {
        *out_table = gn_map_table_ref(previous);
        return 0;
    }
    struct gn_map_table *t = calloc(1, sizeof(*t));
    if (!t)
        return -ENOMEM;
    atomic_init(&t->references, 1);
    t->projection = *projection;
    t->patch_side = choose_patch_side(projection);
    if (previous) // a stream that turns: its working memory goes along
        atomic_init(&t->scratch, atomic_exchange(&previous->scratch, NULL));
    memcpy(t->rotation, rotation, sizeof(t->rotation));
    int rc = fill_table(t, previous, pool);
    if (rc < 0) {
        gn_map_table_unref(&t);
        return rc;
    }
    *out_table = t;
    return 0;
}

struct gn_map_table *gn_map_table_ref(struct gn_map_table *table)
{
    atomic_fetch_add_explicit(&table->references, 1, memory_order_relaxed);
    return table;
}

void gn_map_table_unref(struct gn_map_table **table)
{
    struct gn_map_table *t = *table;
    *table = NULL;
    if (!t || atomic_fetch_sub_explicit(&t->references, 1, memory_order_acq_rel) != 1)
        return;
    for (int i = 0; i < GN_MAP_SPARES; i++) {
        struct gn_radiance_map *spare = atomic_load_explicit(&t->spare[i], memory_order_relaxed);
        if (spare)
            gn_radiance_map_free(spare);
    }
    gn_scratch_finish(&t->scratch);
    gn_change_windows_destroy(&t->windows);
    free(t->up_weight);
    free(t->own_weight);
    free(t->rim);
    free(t->gain);
    free(t->span);
    free(t->block);
    free(t->direction_world);
    free(t->direction_probe);
    free(t->solid_angle);
    free(t);
}
