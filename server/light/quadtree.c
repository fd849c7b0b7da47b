/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A quadtree on the energy grid, for streams: a node is split where it holds more than a threshold
 * of energy, and each leaf is a light. A node's decision depends on its own energy and on the last
 * frame's decision, so that light that changes in one place moves no light in another; the
 * threshold itself follows the wanted number slowly. After the Q2-tree of Wan, Wong and Leung,
 * "Spherical Q2-tree for Sampling Dynamic Environment Sequences", 2005.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "server/light/grid.h"

/* Split above 1.2 thresholds, merge below 0.8. */
static const double split_at = 1.2, merge_at = 0.8;
enum { DEPTH_MAX = 8 }; // of GN_GRID_SIDE_MAX

/* Of the memory's figures; its marks are the nodes that are split. */
enum { THRESHOLD };

struct tree {
    const struct gn_grid *grid;
    struct gn_scratch *scratch;
    int depth;                     // side = 2^depth
    uint32_t start[DEPTH_MAX + 2]; // of each level's nodes, the root first; then their number
    double *energy;                // by node, of the scratch
    const uint64_t *was_split;     // a bit by node; NULL: not known
    uint64_t *is_split;
    double threshold;
    struct gn_light_list *list;
};

static bool get_bit(const uint64_t *bits, uint32_t i)
{
    return bits[i / 64] >> (i % 64) & 1;
}

static int fill_energies(struct tree *t)
{
    int side = t->grid->side;
    while (1 << t->depth < side)
        t->depth++;
    for (int l = 0; l <= t->depth; l++)
        t->start[l + 1] = t->start[l] + (1u << 2 * l);
    t->energy = gn_scratch_take(t->scratch, t->start[t->depth + 1], sizeof(*t->energy));
    if (!t->energy)
        return -ENOMEM;
    double *leaves = t->energy + t->start[t->depth];
    for (int i = 0; i < side * side; i++)
        leaves[i] = t->grid->cell[i].energy;
    for (int l = t->depth - 1; l >= 0; l--) {
        const double *below = t->energy + t->start[l + 1];
        for (int i = 0; i < 1 << 2 * l; i++) {
            int x = i % (1 << l), y = i >> l;
            const double *a = below + ((size_t)(2 * y) << (l + 1)) + 2 * x;
            const double *b = a + ((size_t)1 << (l + 1));
            t->energy[t->start[l] + (uint32_t)i] = (a[0] + a[1]) + (b[0] + b[1]);
        }
    }
    return 0;
}

/* A node's own share of the threshold, 0.9 to 1.1: nodes of equal energy are not all split at
 * once, so that any number can be met. The fractional part of multiples of the golden ratio. */
static double get_bias(uint32_t node)
{
    return 0.9 + 0.2 * (double)(node * 2654435769u) / 4294967296.0;
}

static bool has_to_split(const struct tree *t, int level, uint32_t node)
{
    if (level == t->depth)
        return false;
    double share = t->energy[node] / (t->threshold * get_bias(node));
    return share > (!t->was_split ? 1 : get_bit(t->was_split, node) ? merge_at : split_at);
}

/* The number of lit leaves below a node, counted no further than beyond the limit. */
static int count_leaves(const struct tree *t, int level, int x, int y, int limit)
{
    uint32_t node = t->start[level] + ((uint32_t)y << level) + (uint32_t)x;
    if (!(t->energy[node] > 0))
        return 0;
    if (!has_to_split(t, level, node))
        return 1;
    int n = 0;
    for (int k = 0; k < 4 && n <= limit; k++)
        n += count_leaves(t, level + 1, 2 * x + k % 2, 2 * y + k / 2, limit - n);
    return n;
}

static int add_leaves(const struct tree *t, int level, int x, int y)
{
    uint32_t node = t->start[level] + ((uint32_t)y << level) + (uint32_t)x;
    if (has_to_split(t, level, node)) {
        t->is_split[node / 64] |= UINT64_C(1) << (node % 64);
        for (int k = 0; k < 4; k++) {
            int rc = add_leaves(t, level + 1, 2 * x + k % 2, 2 * y + k / 2);
            if (rc < 0)
                return rc;
        }
        return 0;
    }
    int size = t->grid->side >> level;
    struct gn_light light;
    struct gn_grid_cell sum =
        gn_grid_sum(t->grid, x * size, y * size, (x + 1) * size, (y + 1) * size);
    if (!gn_grid_cell_get_light(&sum, &light))
        return 0;
    light.id = (uint64_t)node + 1;
    return gn_light_list_add(t->list, &light);
}

/* The smallest threshold that gives no more than n lights. */
static double find_threshold(struct tree t, int n)
{
    double low = 0, high = 2 * t.energy[0];
    for (int i = 0; i < 40; i++) {
        t.threshold = 0.5 * (low + high);
        if (t.threshold > 0 && count_leaves(&t, 0, 0, 0, n) <= n)
            high = t.threshold;
        else
            low = t.threshold;
    }
    return high;
}

/* The threshold of this frame, from the last one's; its own where the number would more than
 * double. */
static double follow_threshold(struct tree *t, const struct gn_light_input *input, double kept)
{
    int n_aim = input->settings->n_aim;
    t->threshold = kept;
    int n = count_leaves(t, 0, 0, 0, 2 * n_aim);
    double ratio = (double)n / n_aim;
    if (gn_light_is_count_kept(ratio))
        return kept;
    double fresh = find_threshold(*t, n_aim);
    return ratio > 2 ? fresh : gn_light_follow(input, kept, fresh, ratio);
}

static int make_leaves(struct tree *t, const struct gn_light_input *input)
{
    const struct gn_light_memory *last = input->remembered;
    struct gn_light_memory *memory = input->memory;
    int rc = fill_energies(t);
    if (rc < 0 || !(t->energy[0] > 0))
        return rc;
    memory->n_marks = (int)(t->start[t->depth + 1] + 63) / 64;
    memory->marks = calloc((size_t)memory->n_marks, sizeof(*memory->marks));
    if (!memory->marks)
        return -ENOMEM;
    if (last && last->n_marks != memory->n_marks) // of a grid of another side, or of a black map
        last = NULL;
    t->is_split = memory->marks;
    t->was_split = last ? last->marks : NULL;
    t->threshold = last ? follow_threshold(t, input, last->figure[THRESHOLD])
                        : find_threshold(*t, input->settings->n_aim);
    memory->figure[THRESHOLD] = t->threshold;
    return add_leaves(t, 0, 0, 0);
}

int gn_quadtree_make_lights(const struct gn_light_input *input, struct gn_light_list *list,
                            struct gn_light_figures *figures)
{
    (void)figures;
    struct gn_grid grid;
    int rc = gn_grid_init(&grid, input);
    struct tree tree = {.grid = &grid, .scratch = input->scratch, .list = list};
    return rc < 0 ? rc : make_leaves(&tree, input);
}
