/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where what is hidden from a point can change. Seen from any point, the set of directions in which
 * triangles stand is bounded by outlines: edges whose two triangles are on the same side of the
 * plane through the point and the edge, and edges that have no second triangle. So in a connected
 * set of directions that no outline crosses either every ray is stopped or none is.
 */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/*
 * The tracer's test of an edge with ends a, b from the point is the sign of (b - a) x (a + b) . d,
 * in floats: 2 a x b . d but for less than 30 2^-24 (|a| + |b|)^2 (a and b themselves, their
 * difference and sum, the products, the sums of three). Over 2 |a| |b| that is ROUNDING times
 * (|a| + |b|)^2 / (|a| |b|): for an edge of a huge triangle whose one end is near, a wide angle.
 */
#define ROUNDING 1e-6

/** One side of a triangle; ends are in order, so that the other triangle's side compares equal. */
struct side {
    float ends[6];
    int end[2], apex; // vertices
    int cluster;
    int mover;    // only what moves together stays together
    bool is_flat; // a silhouette may leave out what is
};

static int compare_sides(const void *a, const void *b)
{
    const struct side *x = a;
    const struct side *y = b;
    for (int i = 0; i < 6; i++) {
        if (x->ends[i] != y->ends[i])
            return x->ends[i] < y->ends[i] ? -1 : 1;
    }
    if (x->is_flat != y->is_flat)
        return x->is_flat ? 1 : -1;
    return (x->mover > y->mover) - (x->mover < y->mover);
}

static int compare_edges(const void *a, const void *b)
{
    const struct edge *x = a;
    const struct edge *y = b;
    return (x->cluster > y->cluster) - (x->cluster < y->cluster);
}

static bool comes_first(const float a[static 3], const float b[static 3])
{
    for (int k = 0; k < 3; k++) {
        if (a[k] != b[k])
            return a[k] < b[k];
    }
    return true;
}

static void add_sides(const struct clusters *clusters, int c, struct side **next)
{
    const struct cluster *cluster = &clusters->cluster[c];
    for (int i = 0; i < cluster->n_vertices; i++) {
        float p[3][3];
        int vertex[3];
        for (int j = 0; j < 3; j++) {
            vertex[j] = cluster->first_vertex + i / 3 * 3 + (i + j) % 3;
            for (int k = 0; k < 3; k++)
                p[j][k] = clusters->vertices[k][vertex[j]];
        }
        int first = comes_first(p[0], p[1]) ? 0 : 1;
        struct side *side = (*next)++;
        memcpy(side->ends, p[first], sizeof(p[0]));
        memcpy(side->ends + 3, p[1 - first], sizeof(p[0]));
        side->end[0] = vertex[first];
        side->end[1] = vertex[1 - first];
        side->apex = vertex[2];
        side->cluster = c;
        side->mover = cluster->mover;
        side->is_flat = cluster->is_flat;
    }
}

/** Edges from sides in order: two equal ones make one with two triangles. */
static int pair_sides(const struct side *sides, int n, struct edge *out)
{
    int n_edges = 0;
    for (int i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && compare_sides(&sides[i], &sides[end]) == 0; end++)
            continue;
        struct edge *edge = &out[n_edges++];
        memcpy(edge->ends, sides[i].end, sizeof(edge->ends));
        edge->apex[0] = sides[i].apex;
        edge->apex[1] = sides[end - 1].apex;
        edge->has_two = end - i == 2;
        edge->cluster = sides[i].cluster;
    }
    return n_edges;
}

int gn_edges_make(struct clusters *clusters)
{
    int n = 0;
    for (int c = 0; c < clusters->n; c++)
        n += clusters->cluster[c].has_edges ? clusters->cluster[c].n_vertices : 0;
    if (n == 0)
        return 0;
    struct side *sides = malloc((size_t)n * sizeof(*sides));
    clusters->edges = malloc((size_t)n * sizeof(*clusters->edges));
    if (!sides || !clusters->edges) {
        free(sides);
        return -ENOMEM; // edges go with the clusters
    }
    struct side *next = sides;
    for (int c = 0; c < clusters->n; c++) {
        if (clusters->cluster[c].has_edges)
            add_sides(clusters, c, &next);
    }
    qsort(sides, (size_t)n, sizeof(*sides), compare_sides);
    int n_edges = pair_sides(sides, n, clusters->edges);
    free(sides);
    qsort(clusters->edges, (size_t)n_edges, sizeof(*clusters->edges), compare_edges);
    for (int i = n_edges - 1; i >= 0; i--) {
        struct cluster *cluster = &clusters->cluster[clusters->edges[i].cluster];
        cluster->first_edge = i;
        cluster->n_edges++;
    }
    return 0;
}

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** A vertex relative to org. */
static void get_vertex(const struct clusters *clusters, int vertex, const float org[static 3],
                       double out[static 3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (double)clusters->vertices[k][vertex] - org[k];
}

/** -1, 0, 1: the side of the edge's plane, a x b, that the apex lies on; 0: not sure, as rounding,
 * of the tracer or (slack) of what moves, may put it on either. */
static int get_side(const struct clusters *clusters, const double plane[static 3], double ends,
                    double slack, int apex, const float org[static 3])
{
    double p[3];
    get_vertex(clusters, apex, org, p);
    double x = dot(plane, p);
    double length = sqrt(dot(p, p));
    double limit =
        ROUNDING * ends * ends * length + slack * (ends * length + sqrt(dot(plane, plane)));
    return (x > limit) - (x < -limit);
}

/** Distance of the origin from the segment a b. */
static double get_distance(const double a[static 3], const double b[static 3])
{
    double e[3];
    double p[3];
    for (int k = 0; k < 3; k++)
        e[k] = b[k] - a[k];
    double square = dot(e, e);
    double t = square > 0 ? fmin(fmax(-dot(a, e) / square, 0), 1) : 0;
    for (int k = 0; k < 3; k++)
        p[k] = a[k] + t * e[k];
    return sqrt(dot(p, p));
}

/** How far from its plane the edge may be met; see struct outline. length: |a| |b|. */
static float get_width(const double a[static 3], const double b[static 3], double ends,
                       double length, double slack)
{
    double width = ROUNDING * ends * ends / length;
    if (slack > 0) {
        double distance = get_distance(a, b);
        width += distance > 2 * slack ? 2 * slack / distance : 1;
    }
    return (float)fmin(width, 1); // of all unit directions; also where the length is 0
}

int gn_edges_list_outlines(const struct clusters *clusters, const struct cluster *cluster,
                           const float org[static 3], float margin, struct outline *out)
{
    double slack = (double)cluster->slack;
    int n = 0;
    for (int i = 0; i < cluster->n_edges; i++) {
        const struct edge *edge = &clusters->edges[cluster->first_edge + i];
        double a[3];
        double b[3];
        get_vertex(clusters, edge->ends[0], org, a);
        get_vertex(clusters, edge->ends[1], org, b);
        const double plane[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                                 a[0] * b[1] - a[1] * b[0]};
        double ends = sqrt(dot(a, a)) + sqrt(dot(b, b));
        if (edge->has_two && get_side(clusters, plane, ends, slack, edge->apex[0], org) *
                                     get_side(clusters, plane, ends, slack, edge->apex[1], org) <
                                 0)
            continue;
        // Not to unit length: where the point is nearly in line with the edge, all is near it.
        double length = sqrt(dot(a, a) * dot(b, b));
        struct outline *outline = &out[n++];
        outline->width = get_width(a, b, ends, length, slack);
        for (int k = 0; k < 3; k++) {
            outline->plane[k] = length > 0 ? (float)(plane[k] / length) : 0;
            outline->box.min[k] = (float)fmin(a[k], b[k]) - margin;
            outline->box.max[k] = (float)fmax(a[k], b[k]) + margin;
        }
    }
    return n;
}
