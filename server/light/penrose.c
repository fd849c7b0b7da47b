/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/penrose.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const double golden = 1.6180339887498949;

/* North turned counter-clockwise by 18 degrees times the index. */
static const double unit_vector[20][2] = {
    {0, 1},
    {-0.30901699437494745, 0.9510565162951535},
    {-0.5877852522924731, 0.8090169943749475},
    {-0.8090169943749475, 0.5877852522924731},
    {-0.9510565162951535, 0.30901699437494745},
    {-1, 0},
    {-0.9510565162951535, -0.30901699437494745},
    {-0.8090169943749475, -0.5877852522924731},
    {-0.5877852522924731, -0.8090169943749475},
    {-0.30901699437494745, -0.9510565162951535},
    {0, -1},
    {0.30901699437494745, -0.9510565162951535},
    {0.5877852522924731, -0.8090169943749475},
    {0.8090169943749475, -0.5877852522924731},
    {0.9510565162951535, -0.30901699437494745},
    {1, 0},
    {0.9510565162951535, 0.30901699437494745},
    {0.8090169943749475, 0.5877852522924731},
    {0.5877852522924731, 0.8090169943749475},
    {0.30901699437494745, 0.9510565162951535},
};

static const uint64_t fibonacci[91] = {
    0,
    1,
    1,
    2,
    3,
    5,
    8,
    13,
    21,
    34,
    55,
    89,
    144,
    233,
    377,
    610,
    987,
    1597,
    2584,
    4181,
    6765,
    10946,
    17711,
    28657,
    46368,
    75025,
    121393,
    196418,
    317811,
    514229,
    832040,
    1346269,
    2178309,
    3524578,
    5702887,
    9227465,
    14930352,
    24157817,
    39088169,
    63245986,
    102334155,
    165580141,
    267914296,
    433494437,
    701408733,
    1134903170,
    1836311903,
    UINT64_C(2971215073),
    UINT64_C(4807526976),
    UINT64_C(7778742049),
    UINT64_C(12586269025),
    UINT64_C(20365011074),
    UINT64_C(32951280099),
    UINT64_C(53316291173),
    UINT64_C(86267571272),
    UINT64_C(139583862445),
    UINT64_C(225851433717),
    UINT64_C(365435296162),
    UINT64_C(591286729879),
    UINT64_C(956722026041),
    UINT64_C(1548008755920),
    UINT64_C(2504730781961),
    UINT64_C(4052739537881),
    UINT64_C(6557470319842),
    UINT64_C(10610209857723),
    UINT64_C(17167680177565),
    UINT64_C(27777890035288),
    UINT64_C(44945570212853),
    UINT64_C(72723460248141),
    UINT64_C(117669030460994),
    UINT64_C(190392490709135),
    UINT64_C(308061521170129),
    UINT64_C(498454011879264),
    UINT64_C(806515533049393),
    UINT64_C(1304969544928657),
    UINT64_C(2111485077978050),
    UINT64_C(3416454622906707),
    UINT64_C(5527939700884757),
    UINT64_C(8944394323791464),
    UINT64_C(14472334024676221),
    UINT64_C(23416728348467685),
    UINT64_C(37889062373143906),
    UINT64_C(61305790721611591),
    UINT64_C(99194853094755497),
    UINT64_C(160500643816367088),
    UINT64_C(259695496911122585),
    UINT64_C(420196140727489673),
    UINT64_C(679891637638612258),
    UINT64_C(1100087778366101931),
    UINT64_C(1779979416004714189),
    UINT64_C(2880067194370816120),
};

uint64_t gn_penrose_fibonacci(int n)
{
    return fibonacci[n];
}

int gn_penrose_get_level(double importance)
{
    int level = 0;
    while (level < GN_PENROSE_LEVEL_MAX && !((double)fibonacci[2 * level + 2] > importance))
        level++;
    return level;
}

int gn_penrose_get_phase(double importance)
{
    double log_importance = log1p(sqrt(5) * importance) / (2 * log(golden));
    int phase =
        (int)floor(GN_PENROSE_INDICES * (log_importance - gn_penrose_get_level(importance)));
    return phase < 0 ? 0 : phase >= GN_PENROSE_INDICES ? GN_PENROSE_INDICES - 1 : phase;
}

int gn_penrose_get_structure(const struct gn_penrose_tile *tile)
{
    static const int weight[3][3] = {{0, 1, 2}, {0, 3, 5}, {0, 8, 13}};
    int structure = 0;
    for (int i = 0; i < 3; i++)
        structure += weight[i][tile->pair[i]];
    return structure;
}

void gn_penrose_get_corrected(const struct gn_penrose_sample *sample, const float (*row)[2],
                              double out_position[static 2])
{
    const struct gn_penrose_tile *tile = &sample->tile;
    const double *north = unit_vector[tile->direction];
    const double *west = unit_vector[(tile->direction + 5) % 20];
    const float *v = row[gn_penrose_get_structure(tile)];
    const double at[2] = {sample->x, sample->y};
    for (int c = 0; c < 2; c++)
        out_position[c] = at[c] + tile->scale * ((double)v[0] * north[c] + (double)v[1] * west[c]);
}

struct gn_penrose_tile gn_penrose_get_root(double size)
{
    double s = 2 * size;
    return (struct gn_penrose_tile){.type = GN_PENROSE_F,
                                    .direction = 15,
                                    .path = 1,
                                    .scale = s,
                                    .p1 = {-s * (0.5 * golden * golden - 0.25), -s * 0.125}};
}

static void step(const double from[static 2], double length, int direction, double out[static 2])
{
    const double *u = unit_vector[direction % 20];
    out[0] = from[0] + length * u[0];
    out[1] = from[1] + length * u[1];
}

void gn_penrose_get_corners(const struct gn_penrose_tile *tile, double out_corners[static 3][2])
{
    bool is_acute = tile->type == GN_PENROSE_C || tile->type == GN_PENROSE_D;
    double s = tile->scale;
    memcpy(out_corners[0], tile->p1, sizeof(tile->p1));
    step(tile->p1, is_acute ? s : golden * golden * s, tile->direction, out_corners[1]);
    step(tile->p1, golden * s, tile->direction + (is_acute ? 4 : 2), out_corners[2]);
}

/* A child one level down; its digit pair is 0, 1 (01) or 2 (10). */
static struct gn_penrose_tile make_child(const struct gn_penrose_tile *parent,
                                         enum gn_penrose_type type, const double p1[static 2],
                                         int turn, int pair)
{
    struct gn_penrose_tile child = *parent;
    child.type = type;
    child.direction = (parent->direction + turn) % 20;
    child.level = parent->level + 1;
    child.scale = parent->scale / golden;
    memcpy(child.p1, p1, sizeof(child.p1));
    if (pair > 0)
        child.code += fibonacci[2 * child.level + pair - 1];
    child.pair[0] = parent->pair[1];
    child.pair[1] = parent->pair[2];
    child.pair[2] = (uint8_t)pair;
    return child;
}

static int split_triangle(const struct gn_penrose_tile *tile, struct gn_penrose_tile *t)
{
    double p[3][2], q[3][2];
    gn_penrose_get_corners(tile, p);
    switch (tile->type) {
    case GN_PENROSE_C:
        t[0] = make_child(tile, GN_PENROSE_F, p[2], 14, 0);
        t[1] = make_child(tile, GN_PENROSE_C, p[1], 6, 2);
        gn_penrose_get_corners(&t[0], q);
        t[2] = make_child(tile, GN_PENROSE_A, q[2], 1, 2);
        return 3;
    case GN_PENROSE_D:
        t[0] = make_child(tile, GN_PENROSE_E, p[1], 6, 0);
        gn_penrose_get_corners(&t[0], q);
        t[1] = make_child(tile, GN_PENROSE_D, q[2], 14, 2);
        return 2;
    case GN_PENROSE_E:
        t[0] = make_child(tile, GN_PENROSE_C, p[2], 12, 2);
        t[1] = make_child(tile, GN_PENROSE_E, p[1], 8, 1);
        t[2] = make_child(tile, GN_PENROSE_F, p[0], 0, 0);
        gn_penrose_get_corners(&t[0], q);
        t[3] = make_child(tile, GN_PENROSE_A, q[1], 7, 2);
        return 4;
    default: // F
        t[0] = make_child(tile, GN_PENROSE_F, p[2], 12, 1);
        gn_penrose_get_corners(&t[0], q);
        t[1] = make_child(tile, GN_PENROSE_E, q[2], 0, 0);
        t[3] = make_child(tile, GN_PENROSE_A, q[2], 15, 1);
        gn_penrose_get_corners(&t[1], q);
        t[2] = make_child(tile, GN_PENROSE_D, q[2], 8, 2);
        return 4;
    }
}

int gn_penrose_split(const struct gn_penrose_tile *tile, struct gn_penrose_tile out_children[4])
{
    if (tile->type > GN_PENROSE_B) {
        int n = split_triangle(tile, out_children);
        for (int i = 0; i < n; i++)
            out_children[i].path = 4 * tile->path + (uint64_t)i;
        return n;
    }
    bool is_a = tile->type == GN_PENROSE_A;
    out_children[0] =
        make_child(tile, is_a ? GN_PENROSE_B : GN_PENROSE_A, tile->p1, is_a ? 0 : 10, 0);
    return 1;
}

struct walk {
    const struct gn_penrose_importance *importance;
    int (*accept)(void *context, const struct gn_penrose_sample *sample);
    void *context;
};

/* A point keeps place and code however deep it is split: one test decides. Its chain A, B, A, ...
 * is then walked to the level that its importance requires, no deeper: correction vectors are those
 * of that level. */
static int visit_point(const struct walk *walk, const struct gn_penrose_tile *point)
{
    const struct gn_penrose_importance *importance = walk->importance;
    double size = importance->size, x = point->p1[0], y = point->p1[1];
    if (!(x >= 0 && x < size && y >= 0 && y < size))
        return 0;
    double m = importance->get_at(importance->context, x, y), threshold = m;
    if (importance->get_threshold)
        threshold = importance->get_threshold(importance->context, point, m);
    if (!((double)point->code < threshold))
        return 0;
    struct gn_penrose_sample sample = {.x = x, .y = y, .importance = m, .tile = *point};
    int level = gn_penrose_get_level(m);
    while (sample.tile.level < level) {
        struct gn_penrose_tile child[4];
        gn_penrose_split(&sample.tile, child);
        sample.tile = child[0];
    }
    return walk->accept(walk->context, &sample);
}

/* Splits triangles while some importance inside requires it. The bound may be generous: points
 * deeper than their importance requires have codes that it does not exceed. */
static int visit_triangle(const struct walk *walk, const struct gn_penrose_tile *tile)
{
    double p[3][2], low[2], high[2];
    gn_penrose_get_corners(tile, p);
    for (int i = 0; i < 2; i++) {
        low[i] = fmin(fmin(p[0][i], p[1][i]), p[2][i]);
        high[i] = fmax(fmax(p[0][i], p[1][i]), p[2][i]);
        if (high[i] < 0 || low[i] >= walk->importance->size)
            return 0;
    }
    double max = walk->importance->get_max(walk->importance->context, low, high);
    if (!(max > 0) || tile->level >= gn_penrose_get_level(max))
        return 0;
    struct gn_penrose_tile child[4];
    int n = gn_penrose_split(tile, child), rc = 0;
    for (int i = 0; i < n && rc == 0; i++)
        rc = child[i].type <= GN_PENROSE_B ? visit_point(walk, &child[i])
                                           : visit_triangle(walk, &child[i]);
    return rc;
}

int gn_penrose_sample_domain(const struct gn_penrose_importance *importance,
                             int (*accept)(void *context, const struct gn_penrose_sample *sample),
                             void *context)
{
    struct walk walk = {importance, accept, context};
    struct gn_penrose_tile root = gn_penrose_get_root(importance->size);
    return visit_triangle(&walk, &root);
}
