/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Settings of the paper's partition that give the numbers of lights of its tables (section 6), on
 * the rig's lamp room with all lamps on, as its 300 x 300 fisheye sees it; searched and printed by
 * tests/bench/seed_lights.c, checked by tests/unit/seed_settings.c. Of the two maxLS that the paper
 * tells, 64 for 178 lights is kept. Its 1 for 76 cannot be: it gives one light for each base region
 * above the map's mean, and no tried division of up to 1024 regions has more than 32 of these here.
 */
#ifndef GN_TESTS_BENCH_SEED_SETTINGS_H
#define GN_TESTS_BENCH_SEED_SETTINGS_H

#include <string.h>

#include "server/light/state.h"
#include "tests/rig/view.h"

#define GN_SEED_SETTINGS 5

/** What may be chosen in the seed method, and what it gives. */
struct gn_seed_setting {
    int n_lights;
    int rings, sectors, max_ls, n_samples;
    enum gn_partition_metric metric;
    bool
        is_texel_mean; // MLEM and MLR over the texels (GN_READ_SAMPLE_MEAN mended), not the samples
};

static const struct gn_seed_setting gn_seed_settings[GN_SEED_SETTINGS] = {
    {59, 10, 32, 8, 5120, GN_METRIC_POW2, false},  {76, 9, 25, 64, 5400, GN_METRIC_TWICE, false},
    {86, 9, 28, 64, 4032, GN_METRIC_TWICE, false}, {122, 8, 24, 64, 3072, GN_METRIC_POW2, true},
    {178, 7, 20, 64, 3360, GN_METRIC_POW2, false},
};

/** The options that a setting stands for. */
static inline struct gn_light_options gn_seed_make_options(const struct gn_seed_setting *setting)
{
    return (struct gn_light_options){.method = GN_LIGHT_PARTITION_SEED,
                                     .rings = setting->rings,
                                     .sectors = setting->sectors,
                                     .max_ls = setting->max_ls,
                                     .n_samples = setting->n_samples,
                                     .metric = setting->metric,
                                     .mended = setting->is_texel_mean ? GN_READ_SAMPLE_MEAN : 0};
}

/** The lamp room as the rig's fisheye takes it. Takes memory for *out_image, which *out_frame
 * borrows. 0 or a negative errno. */
static inline int gn_seed_take_frame(struct gn_image *out_image,
                                     struct gn_environment_frame *out_frame)
{
    struct gn_rig_environment env;
    struct gn_image map;
    int result = gn_rig_paint_lamp_room(1024, 512, GN_RIG_LAMPS, NULL, &map);
    if (result == 0)
        result = gn_rig_environment_init(&map, 0, &env, NULL);
    gn_image_finish(&map);
    if (result)
        return result;
    result = gn_rig_take_probe(&env, GN_RIG_FISHEYE, 300, gn_rig_world_from_probe[GN_RIG_FISHEYE],
                               gn_rig_probe_position, NULL, out_image);
    gn_rig_environment_finish(&env);
    if (result)
        return result;
    *out_frame = (struct gn_environment_frame){
        .codes = out_image,
        .projection = {.type = GN_PROJECTION_FISHEYE_EQUIDISTANT, .width = 300, .height = 300}};
    gn_rig_get_quaternion(gn_rig_world_from_probe[GN_RIG_FISHEYE], out_frame->world_from_probe);
    memcpy(out_frame->position, gn_rig_probe_position, sizeof(out_frame->position));
    return gn_projection_init(&out_frame->projection, NULL);
}

#endif
