/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/penrose_weights.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/luminance.h"

/* The sums over the texels about one: a single texel's colour is noise. */
static void sum_neighbours(const struct gn_radiance_map *map, uint32_t texel,
                           struct gn_patch *out_sum)
{
    int width = map->radiance.width, height = map->radiance.height;
    int x = (int)(texel % (uint32_t)width), y = (int)(texel / (uint32_t)width);
    for (int i = 0; i < 9; i++) {
        int nx = x + i % 3 - 1, ny = y + i / 3 - 1;
        if (nx >= 0 && nx < width && ny >= 0 && ny < height)
            gn_patch_add_texel(out_sum, map, (uint32_t)ny * (uint32_t)width + (uint32_t)nx);
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
 * Distances are chords. Bands of blocks have sums of their own, added in order.
 */
enum { BLOCK = 16, N_BANDS = 8 };

/* Where samples are; those of one texel are one site. */
struct site {
    uint32_t texel;
    int first, n; // of the samples in order of their texels
};

struct cells {
    const struct gn_radiance_map *map;
    int n_sites;
    struct site *sites;           // by rising texel
    int *order;                   // samples by rising texel
    float (*dir)[3];              // [n_sites]
    struct gn_patch *patches;     // [N_BANDS][n_sites]
    struct near_site *near_sites; // [N_BANDS][n_sites]
};

/* A site that may be nearest to a texel of the block. */
struct near_site {
    float dir[3];
    int site;
};

static float get_squared_chord(const float a[static 3], const float b[static 3])
{
    float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* The block's candidates. Returns their number, 0 where it shows nothing. */
static int list_near_sites(const struct cells *cells, const int corner[static 2],
                           const int end[static 2], struct near_site *out_near)
{
    const struct gn_radiance_map *map = cells->map;
    float centre[3] = {0}, radius = 0, nearest = INFINITY;
    int n = 0, n_near = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int y = corner[1]; y < end[1]; y++)
            for (int x = corner[0]; x < end[0]; x++) {
                size_t i = (size_t)y * (size_t)map->radiance.width + (size_t)x;
                const float *d = map->direction_world + 3 * i;
                if (!(map->solid_angle[i] > 0))
                    continue;
                for (int c = 0; c < 3 && pass == 0; c++)
                    centre[c] += d[c];
                n += pass == 0;
                if (pass == 1)
                    radius = fmaxf(radius, get_squared_chord(centre, d));
            }
        for (int c = 0; c < 3 && pass == 0 && n > 0; c++)
            centre[c] /= (float)n;
    }
    if (n == 0)
        return 0;
    for (int s = 0; s < cells->n_sites; s++)
        nearest = fminf(nearest, get_squared_chord(centre, cells->dir[s]));
    float reach = sqrtf(nearest) + 2 * sqrtf(radius) + 1e-5f; // and what rounding may do
    for (int s = 0; s < cells->n_sites; s++) {
        if (!(get_squared_chord(centre, cells->dir[s]) <= reach * reach))
            continue;
        const float *d = cells->dir[s];
        out_near[n_near++] = (struct near_site){{d[0], d[1], d[2]}, s};
    }
    return n_near;
}

static void sum_block(const struct cells *cells, const int corner[static 2],
                      const int end[static 2], const struct near_site *near_sites, int n_near,
                      struct gn_patch *patches)
{
    const struct gn_radiance_map *map = cells->map;
    for (int y = corner[1]; y < end[1]; y++) {
        for (int x = corner[0]; x < end[0]; x++) {
            uint32_t texel = (uint32_t)y * (uint32_t)map->radiance.width + (uint32_t)x;
            if (!(map->solid_angle[texel] > 0))
                continue;
            const float *d = map->direction_world + 3 * (size_t)texel;
            float best = INFINITY;
            int site = 0;
            for (int i = 0; i < n_near; i++) {
                float squared = get_squared_chord(d, near_sites[i].dir);
                site = squared < best ? near_sites[i].site : site;
                best = squared < best ? squared : best;
            }
            gn_patch_add_texel(&patches[site], map, texel);
        }
    }
}

static void sum_band(void *context, int band, int worker)
{
    (void)worker;
    const struct cells *cells = context;
    int width = cells->map->radiance.width, height = cells->map->radiance.height;
    int n_rows = (height + BLOCK - 1) / BLOCK;
    struct near_site *near_sites = cells->near_sites + (size_t)band * (size_t)cells->n_sites;
    struct gn_patch *patches = cells->patches + (size_t)band * (size_t)cells->n_sites;
    for (int row = band * n_rows / N_BANDS; row < (band + 1) * n_rows / N_BANDS; row++) {
        for (int x = 0; x < width; x += BLOCK) {
            const int corner[2] = {x, row * BLOCK};
            const int end[2] = {x + BLOCK < width ? x + BLOCK : width,
                                corner[1] + BLOCK < height ? corner[1] + BLOCK : height};
            int n_near = list_near_sites(cells, corner, end, near_sites);
            if (n_near > 0)
                sum_block(cells, corner, end, near_sites, n_near, patches);
        }
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

static int find_sites(struct cells *cells, const struct gn_map_samples *samples)
{
    size_t n = (size_t)samples->n;
    struct placed *placed = malloc(n * sizeof(*placed));
    cells->order = malloc(n * sizeof(*cells->order));
    cells->sites = malloc(n * sizeof(*cells->sites));
    cells->dir = malloc(n * sizeof(*cells->dir));
    if (!placed || !cells->order || !cells->sites || !cells->dir) {
        free(placed);
        return -ENOMEM;
    }
    for (int i = 0; i < samples->n; i++)
        placed[i] = (struct placed){samples->texel[i], i};
    qsort(placed, n, sizeof(*placed), compare_placed);
    for (int i = 0; i < samples->n; i++) {
        cells->order[i] = placed[i].sample;
        if (i == 0 || placed[i].texel != placed[i - 1].texel) {
            const float *d = cells->map->direction_world + 3 * (size_t)placed[i].texel;
            for (int c = 0; c < 3; c++)
                cells->dir[cells->n_sites][c] = d[c];
            cells->sites[cells->n_sites++] = (struct site){placed[i].texel, i, 0};
        }
        cells->sites[cells->n_sites - 1].n++;
    }
    free(placed);
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

static int add_cells(const struct gn_radiance_map *map, const struct gn_map_samples *samples,
                     struct gn_pool *pool, struct gn_light_list *list)
{
    struct cells cells = {.map = map};
    if (samples->n == 0)
        return 0;
    int rc = find_sites(&cells, samples);
    if (rc == 0) {
        size_t n = (size_t)cells.n_sites * N_BANDS;
        cells.patches = calloc(n, sizeof(*cells.patches));
        cells.near_sites = malloc(n * sizeof(*cells.near_sites));
        rc = cells.patches && cells.near_sites ? 0 : -ENOMEM;
    }
    if (rc == 0) {
        gn_pool_run(pool, N_BANDS, sum_band, &cells);
        rc = add_cell_lights(&cells, samples, list);
    }
    free(cells.near_sites);
    free(cells.patches);
    free(cells.dir);
    free(cells.sites);
    free(cells.order);
    return rc;
}

int gn_penrose_weigh_samples(const struct gn_radiance_map *map,
                             const struct gn_map_samples *samples,
                             const struct gn_light_settings *settings, struct gn_pool *pool,
                             struct gn_light_list *list)
{
    return settings->weights == GN_WEIGHTS_PARTITION
               ? add_cells(map, samples, pool, list)
               : add_plain_lights(map, samples, settings, list);
}
