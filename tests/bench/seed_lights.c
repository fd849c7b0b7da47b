/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Searches the paper's partition settings (rings, sectors, maxLS, samples, metric, which mean) that
 * give the numbers of lights of its tables on one map, the likely ones first, and prints the first
 * that hits, or else the nearest. The paper tells maxLS for two: 64 for 178 lights is kept; 1 for
 * 76 is looked for apart, since it takes 76 base regions above the map's mean, which a map of a few
 * small lamps does not have. Usage: seed_lights [MAP [PROJECTION]]; without a map, the rig's
 * lamp room with all lamps on (what it finds there is kept in seed_settings.h).
 */
#include <stdio.h>
#include <stdlib.h>

#include "common/image_file.h"
#include "tests/bench/seed_settings.h"

enum { N_WANTED = GN_SEED_SETTINGS };

/* Lights, and maxLS where it is not free. */
static const int wanted[N_WANTED][2] = {{59, 0}, {76, 0}, {86, 0}, {122, 0}, {178, 64}};
/* The paper's maxLS for the second. */
#define PLAIN_LIGHTS 76
#define MAX_REGIONS 1024 // of a base division

/* Keeps the setting where it is nearer to a wanted number; true where all are met. */
static bool keep(struct gn_seed_setting best[N_WANTED], const struct gn_seed_setting *tried)
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

/* The number of lights of the setting; *state is the last one, whose tables are used again. */
static int count_lights(const struct gn_environment_frame *frame,
                        const struct gn_seed_setting *setting, struct gn_lighting_state **state)
{
    struct gn_light_options options = gn_seed_make_options(setting);
    struct gn_lighting_state *next;
    struct gn_error error = {0};
    options.no_sh = true;
    options.previous = *state;
    if (gn_lighting_state_create(frame, NULL, &options, NULL, &next, &error) < 0) {
        fprintf(stderr, "seed_lights: %s\n", error.text);
        exit(1);
    }
    gn_lighting_state_unref(state);
    *state = next;
    return next->n_lights;
}

/* Every metric, mean and maxLS on one division; true where all wanted numbers are met. */
static bool try_division(const struct gn_environment_frame *frame, struct gn_seed_setting division,
                         struct gn_lighting_state **state, struct gn_seed_setting best[N_WANTED])
{
    static const int max_ls[] = {8, 64};
    bool is_done = false;
    for (int i = 0; i < 2 * 4 && !is_done; i++) {
        struct gn_seed_setting tried = division;
        tried.max_ls = max_ls[i / 4];
        tried.metric = i % 2 ? GN_METRIC_TWICE : GN_METRIC_POW2;
        tried.is_texel_mean = i / 2 % 2 == 1;
        tried.n_lights = count_lights(frame, &tried, state);
        is_done = keep(best, &tried);
    }
    return is_done;
}

/* Tries settings until each wanted number is met, the paper's likely ones first. */
static void search(const struct gn_environment_frame *frame, struct gn_seed_setting best[N_WANTED])
{
    static const int rings[] = {8, 9, 7, 10, 6, 11, 12};
    static const int samples[] = {16, 24}; // for each region
    struct gn_lighting_state *state = NULL;
    bool is_done = false;
    for (int i = 0; i < 2 * 7 * 7 && !is_done; i++) {
        int r = rings[i % 7], wider = i / 7 % 7;
        // Three sectors for each ring, then one more, one fewer, two more, ...
        int sectors = 3 * r + (wider % 2 ? (wider + 1) / 2 : -(wider / 2));
        struct gn_seed_setting division = {
            .rings = r, .sectors = sectors, .n_samples = samples[i / 49] * r * sectors};
        is_done = try_division(frame, division, &state, best);
    }
    gn_lighting_state_unref(&state);
}

/* With maxLS 1 each bright base region has one light: the division nearest to the paper's number,
 * of those with few regions and, in every shape, those with as many as there may be. */
static struct gn_seed_setting search_plain(const struct gn_environment_frame *frame)
{
    struct gn_lighting_state *state = NULL;
    struct gn_seed_setting best = {0};
    for (int i = 0; i < 2 * 64 && best.n_lights != PLAIN_LIGHTS; i++) {
        int rings = i / 2 + 1, most = MAX_REGIONS / rings < 256 ? MAX_REGIONS / rings : 256;
        int sectors = i % 2 == 0 && 3 * rings < most ? 3 * rings : most;
        struct gn_seed_setting tried = {.rings = rings,
                                        .sectors = sectors,
                                        .max_ls = 1,
                                        .n_samples = 16 * rings * sectors,
                                        .metric = GN_METRIC_POW2,
                                        .is_texel_mean = true};
        tried.n_lights = count_lights(frame, &tried, &state);
        if (abs(tried.n_lights - PLAIN_LIGHTS) < abs(best.n_lights - PLAIN_LIGHTS))
            best = tried;
    }
    gn_lighting_state_unref(&state);
    return best;
}

static void print_setting(int n_wanted, const struct gn_seed_setting *s)
{
    printf("%6d %6d %6d %8d %6d %8d %6s %8s\n", n_wanted, s->n_lights, s->rings, s->sectors,
           s->max_ls, s->n_samples, s->metric == GN_METRIC_POW2 ? "2^k" : "2k",
           s->is_texel_mean ? "texels" : "samples");
}

static int load(int argc, char **argv, struct gn_image *image, struct gn_environment_frame *frame)
{
    enum gn_projection_type type = GN_PROJECTION_FISHEYE_EQUIDISTANT;
    if (argc > 2 && gn_projection_from_name(argv[2], &type) < 0) {
        fprintf(stderr, "seed_lights: %s: no such projection; latlong is one\n", argv[2]);
        return 1;
    }
    if (argc < 2) {
        if (gn_seed_take_frame(image, frame) == 0)
            return 0;
        fprintf(stderr, "seed_lights: the rig cannot take its lamp room\n");
        return 1;
    }
    struct gn_error error = {0};
    struct gn_image_file file;
    int rc = gn_image_read_file(argv[1], &file, &error);
    if (rc == 0) {
        rc = gn_image_file_to_float(&file, 65535, image);
        gn_image_file_finish(&file);
    }
    if (rc < 0) {
        fprintf(stderr, "seed_lights: %s\n", error.text);
        return 1;
    }
    *frame = (struct gn_environment_frame){
        .codes = image,
        .projection = {.type = type, .width = image->width, .height = image->height},
        .world_from_probe = {1, 0, 0, 0}};
    return 0;
}

int main(int argc, char **argv)
{
    struct gn_image image = {0};
    struct gn_environment_frame frame;
    if (load(argc, argv, &image, &frame) != 0)
        return 1;
    printf("%6s %6s %6s %8s %6s %8s %6s %8s\n", "wanted", "lights", "rings", "sectors", "maxLS",
           "samples", "metric", "mean of");
    struct gn_seed_setting best[N_WANTED] = {{0}};
    search(&frame, best);
    for (int i = 0; i < N_WANTED; i++)
        print_setting(wanted[i][0], &best[i]);
    struct gn_seed_setting plain = search_plain(&frame);
    print_setting(PLAIN_LIGHTS, &plain);
    gn_image_finish(&image);
    return 0;
}
