/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/penrose_weights.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"
#include "server/light/map_table.h"

/* The sums over the texels about one, as the sphere goes on: a single texel's colour is noise. */
static void sum_neighbours(const struct gn_radiance_map *map, uint32_t texel,
                           struct gn_patch *out_sum)
{
    uint32_t width = (uint32_t)map->radiance.width;
    for (int i = 0; i < 9; i++) {
        int xy[2] = {(int)(texel % width), (int)(texel / width)};
        if (gn_projection_step(&map->table->projection, i % 3 - 1, i / 3 - 1, xy))
            gn_patch_add_texel(out_sum, map, (uint32_t)xy[1] * width + (uint32_t)xy[0]);
    }
}

/* Makes the lights add up to the map, channel by channel. A channel that no light has, though the
 * map does, is shared out evenly. */
static void balance(struct gn_light_list *list, int first, const double total[static 3])
{
    for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int i = first; i < list->n; i++)
            sum += (double)list->lights[i].irradiance[c];
        for (int i = first; i < list->n; i++) {
            float *v = &list->lights[i].irradiance[c];
            *v = sum > 0 ? (float)((double)*v * (total[c] / sum))
                         : (float)(total[c] / (list->n - first));
        }
    }
}

/* Equal power, or by density: both are L / Y times a power, of the surroundings or of the texel. */
static int add_plain_lights(const struct gn_radiance_map *map, const struct gn_map_samples *samples,
                            const struct gn_light_settings *settings, struct gn_light_list *list)
{
    bool is_equal = settings->weights == GN_WEIGHTS_EQUAL;
    bool is_plain = (settings->literal & GN_READ_PLAIN_SAMPLING) != 0;
    double mean_solid_angle = map->figures.shown_solid_angle /
                              ((double)map->radiance.width * (double)map->radiance.height);
    int first = list->n;
    for (int i = 0; i < samples->n; i++) {
        struct gn_patch patch = {0}, colour = {0};
        struct gn_light light;
        uint32_t texel = samples->texel[i];
        gn_patch_add_texel(&patch, map, texel);
        if (is_equal)
            sum_neighbours(map, texel, &colour);
        if (!gn_patch_get_light(&patch, &light))
            continue;
        const struct gn_patch *from = is_equal ? &colour : &patch;
        double power = is_equal ? 1 : samples->power; // equal ones are balanced below
        if (!is_equal && is_plain)                    // density without dOmega/dA
            power *= patch.solid_angle / mean_solid_angle;
        memcpy(light.dir_world, map->direction_world + 3 * (size_t)texel, sizeof(light.dir_world));
        light.angular_radius = 0;
        light.id = GN_PENROSE_LIGHT_ID | samples->id[i];
        for (int c = 0; c < 3; c++)
            light.irradiance[c] = (float)(from->irradiance[c] / from->energy * power);
        int rc = gn_light_list_add(list, &light);
        if (rc < 0)
            return rc;
    }
    if (is_equal && list->n > first)
        balance(list, first, map->figures.shown_irradiance);
    return 0;
}

/*
 * The partition goes by square blocks of texels: of all sites only those can be nearest to a texel
 * of the block that are no farther from its centre than the nearest one and twice its radius.
 * Distances are chords. Groups of blocks choose for their blocks. Texels are then summed row by
 * row, as memory is read fastest. Bands of groups have sums of their own, added in order.
 */
enum { BLOCK = GN_MAP_BLOCK, GROUP = 4, N_BANDS = 8, NO_SITE = -1 };

/* Where samples are; those of one texel are one site. */
struct site {
    uint32_t texel;
    int first, n; // of the samples in order of their texels
};

/* A site that may be nearest to a texel of a block. */
struct near_site {
    float dir[3];
    int site;
};

struct cells {
    const struct gn_radiance_map *map;
    int n_sites;
    struct site *sites;           // by rising texel
    int *order;                   // samples by rising texel
    struct near_site *all;        // [n_sites]
    struct gn_patch *patches;     // [N_BANDS][n_sites]
    struct near_site *near_sites; // [N_BANDS][2][n_sites]: of the group, of the block
    int *site;                    // [N_BANDS][GROUP * BLOCK][width] of each texel
};

static float get_squared_chord(const float a[static 3], const float b[static 3])
{
    float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* Those of n sites that can be nearest within the bound, in their order. Returns their number. */
static int choose_sites(const struct near_site *sites, int n, const float bound[static 4],
                        struct near_site *out_near)
{
    float nearest = INFINITY;
    int n_near = 0;
    for (int s = 0; s < n; s++) {
        float squared = get_squared_chord(bound, sites[s].dir);
        nearest = squared < nearest ? squared : nearest;
    }
    float reach = sqrtf(nearest) + 2 * bound[3] + 1e-5f; // and what rounding may do
    for (int s = 0; s < n; s++)
        if (get_squared_chord(bound, sites[s].dir) <= reach * reach)
            out_near[n_near++] = sites[s];
    return n_near;
}

/* A ball about those of the group's blocks. False: they show nothing. */
static bool bound_group(const float (*block)[4], size_t n_columns, const int size[static 2],
                        float out_bound[static 4])
{
    float centre[3] = {0}, radius = 0;
    int n = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < size[0] * size[1]; i++) {
            const float *b = block[(size_t)(i / size[0]) * n_columns + (size_t)(i % size[0])];
            if (b[3] < 0)
                continue;
            float reach = sqrtf(get_squared_chord(centre, b)) + b[3];
            radius = pass == 1 && reach > radius ? reach : radius;
            for (int c = 0; c < 3 && pass == 0; c++)
                centre[c] += b[c];
            n += pass == 0;
        }
        for (int c = 0; c < 3 && pass == 0 && n > 0; c++)
            centre[c] /= (float)n;
    }
    memcpy(out_bound, centre, sizeof(centre));
    out_bound[3] = radius;
    return n > 0;
}

/* The nearest of the sites to each of n texels of a row of a block; of equals the first. */
static void find_nearest(const float *direction, int n, const struct near_site *sites, int n_near,
                         int out_nearest[static BLOCK])
{
    float x[BLOCK] = {0}, y[BLOCK] = {0}, z[BLOCK] = {0}, best[BLOCK];
    for (int i = 0; i < n; i++) {
        x[i] = direction[3 * i];
        y[i] = direction[3 * i + 1];
        z[i] = direction[3 * i + 2];
    }
    for (int i = 0; i < BLOCK; i++) {
        best[i] = INFINITY;
        out_nearest[i] = 0;
    }
    for (int s = 0; s < n_near; s++) {
        const float *d = sites[s].dir;
        for (int i = 0; i < BLOCK; i++) {
            float dx = x[i] - d[0], dy = y[i] - d[1], dz = z[i] - d[2];
            float squared = dx * dx + dy * dy + dz * dz;
            out_nearest[i] = squared < best[i] ? s : out_nearest[i];
            best[i] = squared < best[i] ? squared : best[i];
        }
    }
}

/* Which site each texel of a block belongs to, into rows of the band. */
static void assign_block(const struct gn_radiance_map *map, size_t first, int n, int n_rows,
                         const struct near_site *sites, int n_near, int *out_site)
{
    size_t width = (size_t)map->radiance.width;
    for (int row = 0; row < n_rows; row++, first += width, out_site += width) {
        int nearest[BLOCK] = {0};
        if (n_near > 1)
            find_nearest(map->direction_world + 3 * first, n, sites, n_near, nearest);
        for (int i = 0; i < n; i++)
            out_site[i] = n_near > 0 ? sites[nearest[i]].site : NO_SITE;
    }
}

static int get_smaller(int a, int b)
{
    return a < b ? a : b;
}

/* The group whose first block is that one. */
static void assign_group(const struct cells *cells, int column, int row,
                         struct near_site *near_sites, int *site)
{
    const struct gn_radiance_map *map = cells->map;
    int width = map->radiance.width, height = map->radiance.height;
    int n_columns = gn_map_table_get_blocks(width);
    const int size[2] = {get_smaller(GROUP, n_columns - column),
                         get_smaller(GROUP, gn_map_table_get_blocks(height) - row)};
    const float(*block)[4] =
        (const float(*)[4])map->table->block + (size_t)row * (size_t)n_columns + column;
    float bound[4];
    int n_group = 0;
    if (bound_group(block, (size_t)n_columns, size, bound))
        n_group = choose_sites(cells->all, cells->n_sites, bound, near_sites);
    for (int i = 0; i < size[0] * size[1]; i++) {
        int dx = i % size[0], dy = i / size[0];
        int x = (column + dx) * BLOCK, y = (row + dy) * BLOCK;
        const float *b = block[(size_t)dy * (size_t)n_columns + (size_t)dx];
        struct near_site *chosen = near_sites + cells->n_sites;
        int n_near = b[3] < 0 ? 0 : choose_sites(near_sites, n_group, b, chosen);
        assign_block(map, (size_t)y * (size_t)width + (size_t)x, get_smaller(BLOCK, width - x),
                     get_smaller(BLOCK, height - y), chosen, n_near,
                     site + (size_t)(dy * BLOCK) * (size_t)width + x);
    }
}

/* Adds each stretch of a row's texels to its site. */
static void sum_row(const struct gn_radiance_map *map, int y, const int *site,
                    struct gn_patch *patches)
{
    int width = map->radiance.width;
    size_t start = (size_t)y * (size_t)width;
    for (int x = 0, end = 0; x < width; x = end) {
        while (end < width && site[end] == site[x])
            end++;
        if (site[x] != NO_SITE)
            gn_patch_add_run(&patches[site[x]], map, (uint32_t)start + (uint32_t)x,
                             (uint32_t)(end - x));
    }
}

static void sum_band(void *context, int band, int worker)
{
    (void)worker;
    const struct cells *cells = context;
    int width = cells->map->radiance.width, height = cells->map->radiance.height;
    int n_columns = gn_map_table_get_blocks(width);
    int n_groups = (gn_map_table_get_blocks(height) + GROUP - 1) / GROUP;
    size_t n = (size_t)cells->n_sites;
    struct near_site *near_sites = cells->near_sites + 2 * (size_t)band * n;
    struct gn_patch *patches = cells->patches + (size_t)band * n;
    int *site = cells->site + (size_t)band * GROUP * BLOCK * (size_t)width;
    for (int row = band * n_groups / N_BANDS; row < (band + 1) * n_groups / N_BANDS; row++) {
        int y0 = row * GROUP * BLOCK, y1 = get_smaller(y0 + GROUP * BLOCK, height);
        for (int column = 0; column < n_columns; column += GROUP)
            assign_group(cells, column, row * GROUP, near_sites, site);
        for (int y = y0; y < y1; y++)
            sum_row(cells->map, y, site + (size_t)(y - y0) * (size_t)width, patches);
    }
}

/* A sample with its texel, to sort. */
struct placed {
    uint32_t texel;
    int sample;
};

static int compare_placed(const void *a, const void *b)
{
    const struct placed *p = a, *q = b;
    if (p->texel != q->texel)
        return p->texel < q->texel ? -1 : 1;
    return (p->sample > q->sample) - (p->sample < q->sample);
}

static int find_sites(struct cells *cells, const struct gn_map_samples *samples,
                      struct gn_scratch *scratch)
{
    size_t n = (size_t)samples->n;
    struct placed *placed = gn_scratch_take(scratch, n, sizeof(*placed));
    cells->order = gn_scratch_take(scratch, n, sizeof(*cells->order));
    cells->sites = gn_scratch_take(scratch, n, sizeof(*cells->sites));
    cells->all = gn_scratch_take(scratch, n, sizeof(*cells->all));
    if (!placed || !cells->order || !cells->sites || !cells->all)
        return -ENOMEM;
    for (int i = 0; i < samples->n; i++)
        placed[i] = (struct placed){samples->texel[i], i};
    qsort(placed, n, sizeof(*placed), compare_placed);
    for (int i = 0; i < samples->n; i++) {
        cells->order[i] = placed[i].sample;
        if (i == 0 || placed[i].texel != placed[i - 1].texel) {
            const float *d = cells->map->direction_world + 3 * (size_t)placed[i].texel;
            cells->all[cells->n_sites] = (struct near_site){{d[0], d[1], d[2]}, cells->n_sites};
            cells->sites[cells->n_sites++] = (struct site){placed[i].texel, i, 0};
        }
        cells->sites[cells->n_sites - 1].n++;
    }
    return 0;
}

static int add_cell_lights(const struct cells *cells, const struct gn_map_samples *samples,
                           struct gn_light_list *list)
{
    for (int s = 0; s < cells->n_sites; s++) {
        const struct site *site = &cells->sites[s];
        struct gn_patch patch = {0};
        struct gn_light light;
        for (int band = 0; band < N_BANDS; band++)
            gn_patch_add(&patch,
                         &cells->patches[(size_t)band * (size_t)cells->n_sites + (size_t)s]);
        if (!gn_patch_get_light(&patch, &light)) // another site looks the same way and has it all
            continue;
        for (int c = 0; c < 3; c++)
            light.irradiance[c] /= (float)site->n;
        for (int i = site->first; i < site->first + site->n; i++) {
            light.id = GN_PENROSE_LIGHT_ID | samples->id[cells->order[i]];
            int rc = gn_light_list_add(list, &light);
            if (rc < 0)
                return rc;
        }
    }
    return 0;
}

static int add_cells(const struct gn_light_input *input, const struct gn_map_samples *samples,
                     struct gn_light_list *list)
{
    struct cells cells = {.map = input->map};
    struct gn_scratch *scratch = input->scratch;
    if (samples->n == 0)
        return 0;
    int rc = find_sites(&cells, samples, scratch);
    if (rc < 0)
        return rc;
    size_t n = (size_t)cells.n_sites * N_BANDS, n_rows = (size_t)N_BANDS * GROUP * BLOCK;
    cells.patches = gn_scratch_take_zeroed(scratch, n, sizeof(*cells.patches));
    cells.near_sites = gn_scratch_take(scratch, 2 * n, sizeof(*cells.near_sites));
    cells.site =
        gn_scratch_take(scratch, n_rows * (size_t)input->map->radiance.width, sizeof(*cells.site));
    if (!cells.patches || !cells.near_sites || !cells.site)
        return -ENOMEM;
    gn_pool_run(input->pool, N_BANDS, sum_band, &cells);
    return add_cell_lights(&cells, samples, list);
}

int gn_penrose_weigh_samples(const struct gn_light_input *input,
                             const struct gn_map_samples *samples, struct gn_light_list *list)
{
    return input->settings->weights == GN_WEIGHTS_PARTITION
               ? add_cells(input, samples, list)
               : add_plain_lights(input->map, samples, input->settings, list);
}
