/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/grid_cut.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/octahedral.h"

/* A rectangle of no more cells and items is cut between texels, whose halves are more even. */
enum { FEW_CELLS = 64, FEW_ITEMS = 256 };

/* Halves of a median cut that differ by more of the whole are cut across the shorter side, where
 * that is evener. */
static const double uneven = 0.1;

/* A rectangle of cells [low, high), or, where n_items > 0, some of a cell's texels. */
struct region {
    int low[2], high[2]; // x, y
    int first_item, n_items;
    bool is_whole; // cannot be cut
    uint64_t id;
    double urgency;
};

/* An item and where it lies along the axis of a cut. */
struct placed_item {
    double place;
    int index;
};

/* Memory for sorting texels. */
struct item_sort {
    int capacity;
    struct placed_item *places;
    struct gn_grid_cell *copy;
    double (*far)[4]; // sums of a texel and all behind it
};

/* Memory is of the scratch. */
struct cutting {
    const struct gn_grid *grid;
    const struct gn_grid_cutter *cutter;
    struct gn_scratch *scratch;
    double (*table)[4]; // [side + 1][side + 1]: sums over the cells above and to the left
    double floor;       // what the table's rounding leaves of darkness is no more: no energy
    int n;
    struct region *regions; // [n_aim]
    int n_items, items_capacity;
    struct gn_grid_cell *items;
    struct item_sort sort;
};

static int make_table(struct cutting *c)
{
    int side = c->grid->side, pitch = side + 1;
    c->table = gn_scratch_take(c->scratch, (size_t)pitch * (size_t)pitch, sizeof(*c->table));
    if (!c->table)
        return -ENOMEM;
    memset(c->table, 0, (size_t)pitch * sizeof(*c->table));
    for (int y = 0; y < side; y++) {
        double row[4] = {0};
        const double(*above)[4] = (const double(*)[4])c->table + y * pitch;
        double(*out)[4] = c->table + (y + 1) * pitch;
        memset(out[0], 0, sizeof(out[0]));
        for (int x = 0; x < side; x++) {
            const struct gn_grid_cell *cell = &c->grid->cell[y * side + x];
            row[0] += cell->energy;
            row[1] += cell->toward[0];
            row[2] += cell->toward[1];
            row[3] += cell->toward[2];
            for (int k = 0; k < 4; k++)
                out[x + 1][k] = above[x + 1][k] + row[k];
        }
    }
    c->floor = 1e-12 * c->table[side * pitch + side][0];
    return 0;
}

/* Sum of the four over a rectangle. */
static void look_up(const struct cutting *c, const int low[static 2], const int high[static 2],
                    double out[static 4])
{
    int pitch = c->grid->side + 1;
    const double *a = c->table[low[1] * pitch + low[0]], *b = c->table[low[1] * pitch + high[0]];
    const double *d = c->table[high[1] * pitch + low[0]], *e = c->table[high[1] * pitch + high[0]];
    for (int k = 0; k < 4; k++)
        out[k] = (e[k] - d[k]) - (b[k] - a[k]);
}

/* Both parts of a rectangle cut at x (axis 0) or y. */
static double get_cost(const struct cutting *c, const struct region *r, int axis, int at)
{
    int high[2] = {r->high[0], r->high[1]}, low[2] = {r->low[0], r->low[1]};
    double near[4], far[4];
    high[axis] = low[axis] = at;
    look_up(c, r->low, high, near);
    look_up(c, low, r->high, far);
    return near[0] > c->floor && far[0] > c->floor ? c->cutter->get_cost(near, far) : INFINITY;
}

static double get_angle(const struct gn_grid *grid, const double from[static 2],
                        const double to[static 2])
{
    double a[3], b[3];
    gn_octahedral_to_direction(from[0] / grid->side, from[1] / grid->side, a);
    gn_octahedral_to_direction(to[0] / grid->side, to[1] / grid->side, b);
    double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2],
           z = a[0] * b[1] - a[1] * b[0];
    return atan2(sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

/* The angle along the middle line, by its halves: it may go half around the sphere. */
static double get_length(const struct gn_grid *grid, const struct region *r, int axis)
{
    double middle[2], from[2], to[2];
    for (int k = 0; k < 2; k++)
        middle[k] = from[k] = to[k] = 0.5 * (r->low[k] + r->high[k]);
    from[axis] = r->low[axis];
    to[axis] = r->high[axis];
    return get_angle(grid, from, middle) + get_angle(grid, middle, to);
}

/* The best place along the axis; its cost, infinite where all is on one side. */
static double find_place(const struct cutting *c, const struct region *r, int axis, int *out_at)
{
    int low = r->low[axis] + 1, high = r->high[axis] - 1; // of the places
    double best = INFINITY;
    while (c->cutter->is_median && high - low > 2) {
        int middle = low + (high - low) / 2;
        int ends[2][2] = {{r->low[0], r->low[1]}, {r->high[0], r->high[1]}};
        double near[4], all[4];
        ends[1][axis] = middle;
        look_up(c, ends[0], ends[1], near);
        look_up(c, r->low, r->high, all);
        if (2 * near[0] < all[0])
            low = middle;
        else
            high = middle;
    }
    for (int at = low; at <= high; at++) {
        double cost = get_cost(c, r, axis, at);
        if (cost < best) {
            best = cost;
            *out_at = at;
        }
    }
    return best;
}

static int compare_items(const void *a, const void *b)
{
    const struct placed_item *x = a, *y = b;
    if (x->place != y->place)
        return x->place < y->place ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

static void add_item(double four[static 4], const struct gn_grid_cell *item)
{
    four[0] += item->energy;
    for (int k = 0; k < 3; k++)
        four[1 + k] += item->toward[k];
}

/* The axis along which a set of texels is longest. */
static int get_longest_axis(const struct gn_grid_cell *items, int n)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], items[i].toward[k] / items[i].energy);
            high[k] = fmax(high[k], items[i].toward[k] / items[i].energy);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis])
            axis = k;
    return axis;
}

static int find_item_place(const struct cutting *c, struct gn_grid_cell *items, int n,
                           const struct item_sort *sort)
{
    int axis = get_longest_axis(items, n), best_at = 0;
    for (int i = 0; i < n; i++)
        sort->places[i] = (struct placed_item){items[i].toward[axis] / items[i].energy, i};
    memcpy(sort->copy, items, (size_t)n * sizeof(*items));
    qsort(sort->places, (size_t)n, sizeof(*sort->places), compare_items);
    double near[4] = {0}, sum[4] = {0}, best = INFINITY;
    for (int i = n - 1; i >= 0; i--) {
        items[i] = sort->copy[sort->places[i].index];
        add_item(sum, &items[i]);
        memcpy(sort->far[i], sum, sizeof(sum));
    }
    for (int i = 0; i + 1 < n; i++) {
        add_item(near, &items[i]);
        double cost = c->cutter->get_cost(near, sort->far[i + 1]);
        if (cost < best) {
            best = cost;
            best_at = i + 1;
        }
    }
    return best_at;
}

/* Sorts a set of texels along its longest axis and finds the best place to cut it: the number of
 * texels before it; 0: none; -ENOMEM. */
static int cut_items(struct cutting *c, const struct region *r)
{
    struct item_sort *sort = &c->sort;
    if (r->n_items > sort->capacity) {
        int capacity = r->n_items > 2 * sort->capacity ? r->n_items : 2 * sort->capacity;
        size_t n = (size_t)capacity;
        *sort = (struct item_sort){.places = gn_scratch_take(c->scratch, n, sizeof(*sort->places)),
                                   .copy = gn_scratch_take(c->scratch, n, sizeof(*sort->copy)),
                                   .far = gn_scratch_take(c->scratch, n, sizeof(*sort->far))};
        if (!sort->places || !sort->copy || !sort->far)
            return -ENOMEM;
        sort->capacity = capacity;
    }
    return find_item_place(c, c->items + r->first_item, r->n_items, sort);
}

static int get_area(const struct region *r)
{
    return (r->high[0] - r->low[0]) * (r->high[1] - r->low[1]);
}

static int get_cell(const struct cutting *c, const struct region *r, int i)
{
    int width = r->high[0] - r->low[0];
    return (r->low[1] + i / width) * c->grid->side + r->low[0] + i % width;
}

static bool has_few_items(const struct cutting *c, const struct region *r)
{
    int n = 0, area = get_area(r);
    for (int i = 0; i < area && area <= FEW_CELLS; i++)
        n += gn_grid_count_items(c->grid, get_cell(c, r, i));
    return area == 1 || (area <= FEW_CELLS && n <= FEW_ITEMS);
}

/* Makes a rectangle of few cells a set of their texels. */
static int open_cells(struct cutting *c, struct region *r)
{
    int n = c->n_items;
    for (int i = 0; i < get_area(r); i++)
        n += gn_grid_count_items(c->grid, get_cell(c, r, i));
    if (n > c->items_capacity) {
        int capacity = n > 2 * c->items_capacity ? n : 2 * c->items_capacity;
        struct gn_grid_cell *items = gn_scratch_grow(c->scratch, c->items, (size_t)c->n_items,
                                                     (size_t)capacity, sizeof(*items));
        if (!items)
            return -ENOMEM;
        c->items = items;
        c->items_capacity = capacity;
    }
    r->first_item = c->n_items;
    for (int i = 0; i < get_area(r); i++)
        c->n_items += gn_grid_list_items(c->grid, get_cell(c, r, i), c->items + c->n_items);
    r->n_items = c->n_items - r->first_item;
    return 0;
}

/* Drops the rectangle's first or last column (axis 0) or row, where it has no energy. */
static bool drop_border(const struct cutting *c, struct region *r, int axis, bool is_far)
{
    int low[2] = {r->low[0], r->low[1]}, high[2] = {r->high[0], r->high[1]};
    if (high[axis] - low[axis] <= 1)
        return false;
    if (is_far)
        low[axis] = high[axis] - 1;
    else
        high[axis] = low[axis] + 1;
    double sum = 0;
    for (int y = low[1]; y < high[1] && sum <= c->floor; y++)
        for (int x = low[0]; x < high[0] && sum <= c->floor; x++)
            sum += c->grid->cell[y * c->grid->side + x].energy;
    if (sum > c->floor)
        return false;
    if (is_far)
        r->high[axis]--;
    else
        r->low[axis]++;
    return true;
}

/* Draws the rectangle in to its lit cells: a cut behind any border is a possible one then. */
static void shrink(const struct cutting *c, struct region *r)
{
    for (bool is_drawn = true; is_drawn;) {
        is_drawn = false;
        for (int side = 0; side < 4; side++)
            while (drop_border(c, r, side / 2, side % 2))
                is_drawn = true;
    }
}

static void weigh(const struct cutting *c, struct region *r)
{
    double sum[4] = {0};
    if (r->n_items == 0) {
        shrink(c, r);
        look_up(c, r->low, r->high, sum);
    }
    for (int i = 0; i < r->n_items; i++)
        add_item(sum, &c->items[r->first_item + i]);
    r->urgency = sum[0] > 0 ? c->cutter->get_urgency(sum) : 0;
    r->is_whole = r->n_items == 1;
}

/* The identity of one part of a cut region: two steps of a 64-bit mix, never 0. */
static uint64_t mix_id(uint64_t id, int part)
{
    uint64_t z = id + (part ? 0x9e3779b97f4a7c15u : 0xd1b54a32d192ed03u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (z ^ (z >> 31)) | 1;
}

/* Finds where to cut r and fills the far part; r becomes the near one. 1: done; 0: it cannot be
 * cut; -ENOMEM. */
static int cut_region(struct cutting *c, struct region *r, struct region *far)
{
    if (r->n_items == 0 && has_few_items(c, r)) {
        int rc = open_cells(c, r);
        if (rc < 0)
            return rc;
    }
    *far = *r;
    if (r->n_items > 0) {
        int at = cut_items(c, r);
        if (at <= 0)
            return at;
        far->first_item += at;
        far->n_items -= at;
        r->n_items = at;
    } else {
        int at[2] = {0};
        double cost[2] = {INFINITY, INFINITY};
        int longer = get_length(c->grid, r, 1) > get_length(c->grid, r, 0);
        cost[longer] = find_place(c, r, longer, &at[longer]);
        if (!c->cutter->is_median || cost[longer] > uneven * r->urgency)
            cost[!longer] = find_place(c, r, !longer, &at[!longer]);
        int axis = cost[!longer] < cost[longer] ? !longer : longer;
        if (!isfinite(cost[axis]))
            return 0;
        r->high[axis] = far->low[axis] = at[axis];
    }
    far->id = mix_id(r->id, 1);
    r->id = mix_id(r->id, 0);
    weigh(c, r);
    weigh(c, far);
    return 1;
}

static struct region *find_most_urgent(const struct cutting *c)
{
    struct region *best = NULL;
    for (int i = 0; i < c->n; i++)
        if (!c->regions[i].is_whole && (!best || c->regions[i].urgency > best->urgency))
            best = &c->regions[i];
    return best;
}

static int cut_all(struct cutting *c, int n_aim)
{
    struct region *root = &c->regions[0];
    *root = (struct region){.high = {c->grid->side, c->grid->side}, .id = 1};
    weigh(c, root);
    c->n = 1;
    while (c->n < n_aim) {
        struct region *r = find_most_urgent(c);
        if (!r)
            break;
        int rc = cut_region(c, r, &c->regions[c->n]);
        if (rc < 0)
            return rc;
        c->n += rc;
        r->is_whole = r->is_whole || rc == 0;
    }
    return 0;
}

int gn_grid_cut(const struct gn_light_input *input, const struct gn_grid_cutter *cutter,
                struct gn_light_list *list)
{
    struct gn_grid grid;
    struct cutting c = {.grid = &grid, .cutter = cutter, .scratch = input->scratch};
    int n_aim = input->settings->n_aim, rc = gn_grid_init(&grid, input);
    c.regions = gn_scratch_take(c.scratch, (size_t)n_aim, sizeof(*c.regions));
    if (rc == 0)
        rc = c.regions ? make_table(&c) : -ENOMEM;
    if (rc == 0)
        rc = cut_all(&c, n_aim);
    for (int i = 0; i < c.n && rc == 0; i++) {
        const struct region *r = &c.regions[i];
        struct gn_grid_cell sum = {0};
        struct gn_light light;
        if (r->n_items == 0)
            sum = gn_grid_sum(&grid, r->low[0], r->low[1], r->high[0], r->high[1]);
        for (int k = 0; k < r->n_items; k++)
            gn_grid_cell_add(&sum, &c.items[r->first_item + k]);
        if (!gn_grid_cell_get_light(&sum, &light)) // all is black
            continue;
        light.id = r->id;
        rc = gn_light_list_add(list, &light);
    }
    return rc;
}
