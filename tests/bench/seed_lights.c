/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Searches the paper's partition settings (rings, sectors, maxLS, metric, which mean) that give the
 * numbers of lights of its tables on one map. Usage: seed_lights [MAP [PROJECTION]]; without a map,
 * a room with four lamps as a 300 x 300 fisheye.
 */
#include <stdio.h>
#include <stdlib.h>

#include "common/image_file.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"

/* One setting and what it gives. */
struct found {
    int rings, sectors, max_ls;
    enum gn_partition_metric metric;
    bool is_texel_mean; // MLEM and MLR over the texels; else over the samples
    int n_lights;
};

enum { N_WANTED = 5 };

/* Lights, and maxLS where the paper tells it. */
static const int wanted[N_WANTED][2] = {{59, 0}, {76, 1}, {86, 0}, {122, 0}, {178, 64}};

/* Keeps the setting where it is nearer to a wanted number; true where all are met. */
static bool keep(struct found best[N_WANTED], const struct found *tried)
{
    bool is_done = true;
    for (int i = 0; i < N_WANTED; i++) {
        bool is_allowed = wanted[i][1] == 0 || wanted[i][1] == tried->max_ls;
        int miss = abs(tried->n_lights - wanted[i][0]),
            best_miss = abs(best[i].n_lights - wanted[i][0]);
        if (is_allowed && miss < best_miss) {
            best[i] = *tried;
            best_miss = miss;
        }
        is_done = is_done && best_miss == 0;
    }
    return is_done;
}

/* Tries settings until each wanted number is met, the paper's likely ones first. */
static void search(const struct gn_environment_frame *frame, struct found best[N_WANTED])
{
    static const int rings[] = {8, 6, 7, 9, 10, 5, 12, 18};
    static const int max_ls[] = {8, 1, 64, 4, 16, 2};
    struct gn_lighting_state *state = NULL;
    bool is_done = false;
    for (int i = 0; i < 8 * 5 * 6 * 4 && !is_done; i++) {
        int r = rings[i / 24 % 8];
        struct gn_light_options options = {.method = GN_LIGHT_PARTITION_SEED,
                                           .rings = r,
                                           .sectors = 3 * r + 2 * (i / 192) - 6,
                                           .max_ls = max_ls[i / 4 % 6],
                                           .metric = i % 2 ? GN_METRIC_TWICE : GN_METRIC_POW2,
                                           .mended = i / 2 % 2 ? GN_READ_SAMPLE_MEAN : 0,
                                           .no_sh = true,
                                           .previous = state};
        struct gn_lighting_state *next;
        struct gn_error error = {0};
        if (gn_lighting_state_create(frame, NULL, &options, NULL, &next, &error) < 0) {
            fprintf(stderr, "seed_lights: %s\n", error.text);
            exit(1);
        }
        gn_lighting_state_unref(&state);
        state = next;
        struct found tried = {
            r, options.sectors, options.max_ls, options.metric, i / 2 % 2 == 1, state->n_lights};
        is_done = keep(best, &tried);
    }
    gn_lighting_state_unref(&state);
}

static int load(struct light_fixture *f, int argc, char **argv)
{
    enum gn_projection_type type = GN_PROJECTION_FISHEYE_EQUIDISTANT;
    if (argc > 2 && gn_projection_from_name(argv[2], &type) < 0) {
        fprintf(stderr, "seed_lights: %s: no such projection; latlong is one\n", argv[2]);
        return 1;
    }
    if (argc < 2) {
        int rc = light_fixture_init(f, type, 300, 300);
        light_fixture_fill(f, light_fixture_room);
        return rc;
    }
    struct gn_error error = {0};
    struct gn_image_file file;
    *f = (struct light_fixture){0};
    int rc = gn_image_read_file(argv[1], &file, &error);
    if (rc == 0) {
        rc = gn_image_file_to_float(&file, 65535, &f->image);
        gn_image_file_finish(&file);
    }
    if (rc < 0) {
        fprintf(stderr, "seed_lights: %s\n", error.text);
        return 1;
    }
    f->frame = (struct gn_environment_frame){
        .codes = &f->image,
        .projection = {.type = type, .width = f->image.width, .height = f->image.height},
        .world_from_probe = {1, 0, 0, 0}};
    return 0;
}

int main(int argc, char **argv)
{
    struct light_fixture f;
    if (load(&f, argc, argv) != 0)
        return 1;
    printf("%6s %6s %6s %8s %6s %6s %8s\n", "wanted", "lights", "rings", "sectors", "maxLS",
           "metric", "mean of");
    struct found best[N_WANTED] = {{0}};
    search(&f.frame, best);
    for (int i = 0; i < N_WANTED; i++)
        printf("%6d %6d %6d %8d %6d %6s %8s\n", wanted[i][0], best[i].n_lights, best[i].rings,
               best[i].sectors, best[i].max_ls, best[i].metric == GN_METRIC_POW2 ? "2^k" : "2k",
               best[i].is_texel_mean ? "texels" : "samples");
    light_fixture_finish(&f);
    return 0;
}
