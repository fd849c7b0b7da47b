/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The radiance map: the linear, direction-addressed picture of the incoming light that is made from
 * one environment frame. It keeps the frame's own projection, so no energy is lost to resampling.
 */
#ifndef GN_SERVER_LIGHT_RADIANCE_MAP_H
#define GN_SERVER_LIGHT_RADIANCE_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/pool.h"
#include "common/pose.h"
#include "common/projection.h"
#include "common/response.h"
#include "proto/attr.h"

/** One raw capture, as it came in. Borrowed by gn_radiance_map_create. */
struct gn_environment_frame {
    const struct gn_image
        *codes; // 1 or 3 channels: codes in [0, 1], or linear values (float frames)
    struct gn_projection projection;
    struct gn_response response;
    double world_from_probe[4]; // quaternion w, x, y, z
    double position[3];         // m, of the probe in world
    int64_t capture_time_ns;    // monotonic
    uint64_t sequence;
};

/** What a frame had to have mended. */
struct gn_radiance_map_figures {
    int n_nan, n_inf, n_negative; // texels with such a channel: set to 0, the neighbours' median, 0
    int n_clipped;                // texels at the sensor's upper rail (integer formats)
    double mean_luminance;        // solid-angle weighted over the shown part, W/(sr m^2)
    double max_luminance;
};

/** Thread-safety: immutable after create; shared (ref). */
struct gn_radiance_map {
    int references; // atomic
    struct gn_projection projection;
    struct gn_image radiance; // [height][width][3] linear Rec.709, finite, >= 0; 0 outside
    float *solid_angle;       // [height][width] sr, 0 outside the valid circle; owned
    float *direction_world;   // [height][width][3] unit, of the texels' centres; owned
    struct gn_pose world_from_probe;
    bool is_full_sphere;
    float fill[3]; // radiance of directions the map does not show (fisheye's lower half)
    int64_t capture_time_ns;
    uint64_t sequence;
    struct gn_radiance_map_figures figures;
};

/** Options; all-zero is the default. */
struct gn_radiance_map_options {
    float ground_albedo; // of the fill below a fisheye's horizon, [0, 1], default 0.2 where 0
    bool no_fill;        // directions not shown are black
};

/** Linearises, sanitises and addresses the frame. Returns 0, -EINVAL and a sentence, -ENOMEM. */
GN_MUST_USE int gn_radiance_map_create(const struct gn_environment_frame *frame,
                                       const struct gn_radiance_map_options *options,
                                       struct gn_pool *pool, struct gn_radiance_map **out_map,
                                       struct gn_error *out_error);
struct gn_radiance_map *gn_radiance_map_ref(struct gn_radiance_map *map);
/** NULL-safe; nulls *map. */
void gn_radiance_map_unref(struct gn_radiance_map **map);

/** Radiance[3] from unit world direction, bilinear; the fill where the map does not show it. */
void gn_radiance_map_get_radiance(const struct gn_radiance_map *map,
                                  const float dir_world[static 3], float out_radiance[static 3]);

#endif
