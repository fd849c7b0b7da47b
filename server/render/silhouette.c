/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The cells are made so: outlines are drawn with a width that covers all rounding, the clusters
 * that keep no edges as the rectangle of their boxes. Then regions of touching cells that nothing
 * was drawn into are filled; the one that reaches the border is free, each other one is dark where
 * its first cell's centre lies in a triangle. Two cells are kept between the drawing and the
 * border.
 */
#include "server/render/silhouette.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/render/kernels/kernels.h"

#define SIDE SILHOUETTE_SIDE
#define BORDER 2
// Smaller regions are left to rays.
#define MIN_CELLS 3
// Of regions; the rest is left to rays.
#define MAX_REGIONS 64

/** A set's vertices in cells. */
struct projected {
    float at[2][MAX_CLUSTERS * 3 * CLUSTER_TRIANGLES];
};

/** Lines of cells. */
struct cells {
    uint64_t row[SIDE];
};

struct job {
    struct silhouettes *silhouettes;
    const struct clusters *clusters;
    bool without_flat;
    const struct light_list *lights;
    float margin;
};

static bool is_left_out(const struct job *job, const struct cluster *cluster)
{
    return job->without_flat && cluster->is_flat;
}

/** Two unit axes across d. Source: Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
 */
static void make_axes(const float dir[static 3], double out[2][3])
{
    double length =
        sqrt((double)dir[0] * dir[0] + (double)dir[1] * dir[1] + (double)dir[2] * dir[2]);
    double d[3] = {dir[0] / length, dir[1] / length, dir[2] / length};
    double sign = d[2] < 0 ? -1 : 1;
    double a = -1 / (sign + d[2]);
    double b = d[0] * d[1] * a;
    out[0][0] = 1 + sign * d[0] * d[0] * a;
    out[0][1] = sign * b;
    out[0][2] = -sign * d[0];
    out[1][0] = b;
    out[1][1] = sign + d[1] * d[1] * a;
    out[1][2] = -d[1];
}

/** Axes and offsets so that all clusters' boxes lie within the border. False: there is none. */
static bool place_cells(const struct job *job, struct silhouette *s)
{
    double axes[2][3];
    bool is_any = false;
    make_axes(s->dir, axes);
    for (int i = 0; i < 2; i++) {
        double low = INFINITY;
        double high = -INFINITY;
        for (int c = 0; c < job->clusters->n; c++) {
            const struct cluster *cluster = &job->clusters->cluster[c];
            if (is_left_out(job, cluster))
                continue;
            double ends[2] = {0};
            for (int k = 0; k < 3; k++) {
                double a = axes[i][k] * (double)cluster->box.min[k];
                double b = axes[i][k] * (double)cluster->box.max[k];
                ends[0] += fmin(a, b);
                ends[1] += fmax(a, b);
            }
            low = fmin(low, ends[0]);
            high = fmax(high, ends[1]);
            is_any = true;
        }
        double extent = high - low + 4.0 * (double)job->margin;
        double cell = extent > 0 && is_any ? extent / (SIDE - 2 * BORDER) : 1;
        for (int k = 0; k < 3; k++)
            s->axis[i][k] = (float)(axes[i][k] / cell);
        s->offset[i] = (float)(BORDER - (low - 2.0 * (double)job->margin) / cell);
    }
    return is_any;
}

static void project(const struct job *job, const struct silhouette *s, struct projected *out)
{
    const struct clusters *clusters = job->clusters;
    for (int i = 0; i < 2; i++) {
        for (int v = 0; v < clusters->n_vertices; v++)
            out->at[i][v] = s->axis[i][0] * clusters->vertices[0][v] +
                            s->axis[i][1] * clusters->vertices[1][v] +
                            s->axis[i][2] * clusters->vertices[2][v] + s->offset[i];
    }
}

static int clamp_cell(float x)
{
    return x <= 0 ? 0 : x >= SIDE - 1 ? SIDE - 1 : (int)x;
}

/** Cells x0 .. x1 of a row, of numbers in cells. */
static uint64_t get_span(float x0, float x1)
{
    int first = clamp_cell(x0);
    int last = clamp_cell(x1);
    return (~UINT64_C(0) >> (SIDE - 1 - (last - first))) << first;
}

/** Draws the segment from a to b with half its width on each side, rows and columns apart. */
static void draw_segment(const float a[static 2], const float b[static 2],
                         const float half[static 2], struct silhouette *s)
{
    bool rises = a[1] <= b[1];
    const float *low = rises ? a : b;
    const float *high = rises ? b : a;
    float slope = high[1] > low[1] ? (high[0] - low[0]) / (high[1] - low[1]) : 0;
    int last = clamp_cell(high[1] + half[1]);
    for (int y = clamp_cell(low[1] - half[1]); y <= last; y++) {
        float y0 = fmaxf((float)y - half[1], low[1]);
        float y1 = fminf((float)(y + 1) + half[1], high[1]);
        float x0 = low[0] + (y0 - low[1]) * slope;
        float x1 = low[0] + (y1 - low[1]) * slope;
        if (slope == 0) {
            x0 = low[0];
            x1 = high[0];
        }
        s->edge[y] |= get_span(fminf(x0, x1) - half[0], fmaxf(x0, x1) + half[0]);
    }
}

/** Side of the line through a and b that the apex lies on; 0: so near to it that rounding may say
 * either. */
static int get_side(const float a[static 2], const float b[static 2], const float apex[static 2],
                    const float half[static 2])
{
    float e[2] = {b[0] - a[0], b[1] - a[1]};
    float w[2] = {apex[0] - a[0], apex[1] - a[1]};
    float x = e[0] * w[1] - e[1] * w[0];
    float limit = half[0] * (fabsf(e[1]) + fabsf(w[1])) + half[1] * (fabsf(e[0]) + fabsf(w[0]));
    return (x > limit) - (x < -limit);
}

static void draw_edges(const struct clusters *clusters, const struct cluster *cluster,
                       const struct projected *projected, const float half[static 2],
                       struct silhouette *s)
{
    for (int i = 0; i < cluster->n_edges; i++) {
        const struct edge *edge = &clusters->edges[cluster->first_edge + i];
        float ends[2][2];
        float apex[2][2];
        for (int j = 0; j < 4; j++) {
            ends[j / 2][j % 2] = projected->at[j % 2][edge->ends[j / 2]];
            apex[j / 2][j % 2] = projected->at[j % 2][edge->apex[j / 2]];
        }
        if (!edge->has_two ||
            get_side(ends[0], ends[1], apex[0], half) * get_side(ends[0], ends[1], apex[1], half) >=
                0)
            draw_segment(ends[0], ends[1], half, s);
    }
}

/** Range of axis i over the box, in cells. */
static inline void get_range(const struct silhouette *s, const struct box *box, int i,
                             float out[static 2])
{
    out[0] = out[1] = s->offset[i];
    for (int k = 0; k < 3; k++) {
        float a = s->axis[i][k] * box->min[k];
        float b = s->axis[i][k] * box->max[k];
        out[0] += a < b ? a : b;
        out[1] += a < b ? b : a;
    }
}

static void draw_box(const struct box *box, const float half[static 2], struct silhouette *s)
{
    float x[2];
    float y[2];
    get_range(s, box, 0, x);
    get_range(s, box, 1, y);
    int last = clamp_cell(y[1] + half[1]);
    for (int row = clamp_cell(y[0] - half[1]); row <= last; row++)
        s->edge[row] |= get_span(x[0] - half[0], x[1] + half[0]);
}

/** All cells of `open` that touch those of `from` by way of such cells, in one row. */
static uint64_t spread(uint64_t from, uint64_t open)
{
    uint64_t left = open;
    uint64_t right = open;
    from &= open;
    for (int shift = 1; shift < SIDE; shift *= 2) {
        from |= (left & (from << shift)) | (right & (from >> shift));
        left &= left << shift;
        right &= right >> shift;
    }
    return from;
}

/** Grows `fill` to all cells of `open` that can be reached by way of such cells. */
static void flood(const struct cells *open, struct cells *fill)
{
    bool is_changed = true;
    for (int y = 0; y < SIDE; y++)
        fill->row[y] = spread(fill->row[y], open->row[y]);
    while (is_changed) {
        is_changed = false;
        for (int i = 1; i < 2 * SIDE - 1; i++) { // down, then up
            int y = i < SIDE ? i : 2 * SIDE - 2 - i;
            int before = i < SIDE ? y - 1 : y + 1;
            uint64_t more = fill->row[before] & open->row[y] & ~fill->row[y];
            if (more == 0)
                continue;
            fill->row[y] = spread(fill->row[y] | more, open->row[y]);
            is_changed = true;
        }
    }
}

/** Does a triangle cover the point, by its projected corners? */
static bool is_covered(const struct job *job, const struct projected *projected, float x, float y)
{
    for (int c = 0; c < job->clusters->n; c++) {
        const struct cluster *cluster = &job->clusters->cluster[c];
        if (!cluster->has_edges || is_left_out(job, cluster))
            continue;
        const float *px = projected->at[0] + cluster->first_vertex;
        const float *py = projected->at[1] + cluster->first_vertex;
        for (int i = 0; i < cluster->n_vertices; i += 3) {
            int n_left = 0;
            int n_right = 0;
            for (int j = 0; j < 3; j++) {
                int a = i + j;
                int b = i + (j + 1) % 3;
                float side = (px[b] - px[a]) * (y - py[a]) - (py[b] - py[a]) * (x - px[a]);
                n_left += side >= 0;
                n_right += side <= 0;
            }
            if (n_left == 3 || n_right == 3)
                return true;
        }
    }
    return false;
}

/** Settles one region of `left`, and takes it away. */
static void settle_region(const struct job *job, const struct projected *projected,
                          const struct cells *open, int y, struct cells *left, struct silhouette *s)
{
    struct cells region = {{0}};
    int x = __builtin_ctzll(left->row[y]);
    int n = 0;
    region.row[y] = UINT64_C(1) << x;
    flood(open, &region);
    for (int i = y; i < SIDE; i++)
        n += __builtin_popcountll(region.row[i]);
    bool is_known = n >= MIN_CELLS;
    bool is_dark = is_known && is_covered(job, projected, (float)x + 0.5f, (float)y + 0.5f);
    for (int i = y; i < SIDE; i++) {
        left->row[i] &= ~region.row[i];
        if (!is_known)
            s->edge[i] |= region.row[i];
        else if (is_dark)
            s->dark[i] |= region.row[i];
    }
}

static void settle_regions(const struct job *job, const struct projected *projected,
                           struct silhouette *s)
{
    struct cells open;
    struct cells left = {{0}};
    int n_regions = 0;
    for (int y = 0; y < SIDE; y++)
        open.row[y] = ~s->edge[y];
    left.row[0] = ~UINT64_C(0);
    flood(&open, &left);
    for (int y = 0; y < SIDE; y++)
        left.row[y] = open.row[y] & ~left.row[y];
    for (int y = 0; y < SIDE; y++) {
        for (; left.row[y] != 0 && n_regions < MAX_REGIONS; n_regions++)
            settle_region(job, projected, &open, y, &left, s);
        s->edge[y] |= left.row[y];
    }
}

/** Copies the axes side by side with the other lights'. */
static void keep_plane(struct silhouettes *silhouettes, int item)
{
    const struct silhouette *s = &silhouettes->of[item];
    float *to = silhouettes->planes + item;
    size_t stride = (size_t)silhouettes->capacity;
    for (int i = 0; i < 6; i++)
        to[(size_t)i * stride] = s->axis[i / 3][i % 3];
    for (int i = 0; i < 2; i++)
        to[(size_t)(6 + i) * stride] = s->offset[i];
}

static void make_one(void *context, int item, int worker)
{
    const struct job *job = context;
    struct silhouette *s = &job->silhouettes->of[item];
    struct projected *projected = &job->silhouettes->projected[worker];
    const float dir[3] = {job->lights->dir[0][item], job->lights->dir[1][item],
                          job->lights->dir[2][item]};
    if (memcmp(s->dir, dir, sizeof(dir)) == 0)
        return;
    memset(s, 0, sizeof(*s));
    memcpy(s->dir, dir, sizeof(dir));
    bool is_any = place_cells(job, s);
    keep_plane(job->silhouettes, item);
    if (!is_any)
        return;
    // In cells; and the rounding of cells' numbers themselves, of up to SIDE.
    float half[2];
    for (int i = 0; i < 2; i++)
        half[i] = job->margin * sqrtf(dot3(s->axis[i], s->axis[i])) + 1e-4f;
    project(job, s, projected);
    for (int c = 0; c < job->clusters->n; c++) {
        const struct cluster *cluster = &job->clusters->cluster[c];
        if (is_left_out(job, cluster))
            continue;
        if (cluster->has_edges)
            draw_edges(job->clusters, cluster, projected, half, s);
        else
            draw_box(&cluster->box, half, s);
    }
    settle_regions(job, projected, s);
}

static int reserve(struct silhouettes *silhouettes, int n, int n_workers)
{
    if (n > silhouettes->capacity) {
        // Room for more: lights come and go.
        int wide = 256;
        while (wide < n)
            wide *= 2;
        n = wide;
        free(silhouettes->of);
        free(silhouettes->planes);
        silhouettes->n = silhouettes->capacity = 0;
        silhouettes->of = malloc((size_t)n * sizeof(*silhouettes->of));
        silhouettes->planes = aligned_alloc(64, 8 * (size_t)n * sizeof(float));
        if (!silhouettes->of || !silhouettes->planes)
            return -ENOMEM;
        memset(silhouettes->planes, 0, 8 * (size_t)n * sizeof(float)); // lanes that no light has
        silhouettes->capacity = n;
    }
    if (silhouettes->projected)
        return 0;
    silhouettes->projected = malloc((size_t)n_workers * sizeof(*silhouettes->projected));
    return silhouettes->projected ? 0 : -ENOMEM;
}

int gn_silhouettes_make(struct silhouettes *silhouettes, const struct clusters *clusters,
                        bool without_flat, const struct light_list *lights, float margin,
                        struct gn_pool *pool)
{
    struct job job = {silhouettes, clusters, without_flat, lights, margin};
    int ret = reserve(silhouettes, lights->n, pool ? gn_pool_get_size(pool) : 1);
    if (ret < 0)
        return ret;
    if (silhouettes->margin != margin)
        gn_silhouettes_forget(silhouettes);
    silhouettes->margin = margin;
    for (int i = silhouettes->n; i < lights->n; i++)
        memset(silhouettes->of[i].dir, 0, sizeof(silhouettes->of[i].dir)); // no light's
    silhouettes->n = silhouettes->n > lights->n ? silhouettes->n : lights->n;
    gn_pool_run(pool, lights->n, make_one, &job);
    return 0;
}

void gn_silhouettes_forget(struct silhouettes *silhouettes)
{
    silhouettes->n = 0;
}

void gn_silhouettes_finish(struct silhouettes *silhouettes)
{
    free(silhouettes->of);
    free(silhouettes->planes);
    free(silhouettes->projected);
    memset(silhouettes, 0, sizeof(*silhouettes));
}

int gn_silhouettes_list(const struct frame *frame, const struct silhouettes *silhouettes,
                        const struct box *box, int16_t out_lights[static GN_LIGHTS_MAX])
{
    int n_lights = frame->lights->n;
    int n = 0;
    for (int first = 0; first < n_lights; first += LANES) {
        const float *at = silhouettes->planes + first;
        size_t stride = (size_t)silhouettes->capacity;
        struct gn_kernel_planes planes;
        for (int i = 0; i < 6; i++)
            planes.axis[i / 3][i % 3] = at + (size_t)i * stride;
        for (int i = 0; i < 2; i++)
            planes.offset[i] = at + (size_t)(6 + i) * stride;
        unsigned lanes = frame->kernels->get_overlaps(&planes, SIDE, box->min, box->max);
        for (; lanes != 0; lanes &= lanes - 1) {
            int l = first + __builtin_ctz(lanes);
            if (l < n_lights && gn_silhouette_get_box(&silhouettes->of[l], box) != SILHOUETTE_FREE)
                out_lights[n++] = (int16_t)l;
        }
    }
    return n;
}

enum silhouette_state gn_silhouette_get_box(const struct silhouette *s, const struct box *box)
{
    float x[2];
    float y[2];
    get_range(s, box, 0, x);
    get_range(s, box, 1, y);
    if (!(x[1] >= 0 && y[1] >= 0 && x[0] < SIDE && y[0] < SIDE))
        return SILHOUETTE_FREE;
    uint64_t span = get_span(x[0], x[1]);
    uint64_t edge = 0;
    uint64_t all_dark = span;
    uint64_t any_dark = 0;
    int last = clamp_cell(y[1]);
    for (int row = clamp_cell(y[0]); row <= last; row++) {
        edge |= s->edge[row];
        any_dark |= s->dark[row];
        all_dark &= s->dark[row];
    }
    if (((edge | any_dark) & span) == 0)
        return SILHOUETTE_FREE;
    return all_dark == span ? SILHOUETTE_DARK : SILHOUETTE_EDGE;
}

void gn_silhouette_get_block(const struct frame *frame, const struct silhouette *s,
                             const struct receivers *r, int block, unsigned *out_dark,
                             unsigned *out_edge)
{
    const float *const p[3] = {r->org[0] + block * LANES, r->org[1] + block * LANES,
                               r->org[2] + block * LANES};
    int32_t cell[2][LANES];
    unsigned dark = 0;
    unsigned edge = 0;
    // Cells below 0 round towards it, but those at the border are free all the same.
    for (int i = 0; i < 2; i++)
        frame->kernels->get_cells(s->axis[i], s->offset[i], p, cell[i]);
    for (int lane = 0; lane < LANES; lane++) {
        unsigned x = (unsigned)cell[0][lane];
        unsigned y = (unsigned)cell[1][lane];
        if (x >= SIDE || y >= SIDE)
            continue;
        dark |= (unsigned)(s->dark[y] >> x & 1) << lane;
        edge |= (unsigned)(s->edge[y] >> x & 1) << lane;
    }
    *out_dark = dark;
    *out_edge = edge;
}
