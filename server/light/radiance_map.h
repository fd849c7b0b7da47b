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

/** How the pixels of a frame lie in memory. */
enum gn_pixel_layout {
    GN_PIXELS_IMAGE = 0, // in `codes`
    // in `raw`: rows from the top, no padding, little-endian
    GN_PIXELS_RGB_F32 = 1,
    GN_PIXELS_RGB_F16 = 2,
    GN_PIXELS_MONO_U16 = 3, // R = G = B
    GN_PIXELS_RGB_U16 = 4,
    GN_PIXELS_RGB_U8 = 5,
    GN_PIXELS_COUNT
};

/** One raw capture, as it came in. Borrowed by gn_radiance_map_create. */
struct gn_environment_frame {
    const struct gn_image *codes; // 1, 3 or 4 channels (the 4th ignored): codes in [0, 1], or
                                  // linear values (float frames); NULL with a raw layout
    enum gn_pixel_layout layout;
    const uint8_t *raw; // [projection.height][projection.width] pixels; NULL with an image
    int code_max; // 255, 4095, ... of an integer sensor format, whose largest code is the upper
                  // rail; 0: float frame
    struct gn_projection projection;
    struct gn_response response;
    double world_from_probe[4]; // quaternion w, x, y, z
    double position[3];         // m, of the probe in world
    int64_t capture_time_ns;    // monotonic
    uint64_t sequence;
};

/** Largest radiance a map holds, W/(sr m^2): sums over any map stay far inside float. */
#define GN_RADIANCE_MAX 1e30f

/** What a frame had to have mended where it shows light, and sums over that part. */
struct gn_radiance_map_figures {
    int n_nan, n_inf, n_negative; // texels with such a channel: set to 0, the neighbours' median, 0
    int n_capped;                 // texels with a channel above GN_RADIANCE_MAX: set to it
    int n_clipped;                // texels at the sensor's upper rail (code_max > 0)
    int n_out_of_gamut;    // texels with a channel below 0 after the matrix: set to 0, the others
                           // lowered to the same luminance
    double mean_luminance; // solid-angle weighted over the shown part, W/(sr m^2)
    double max_luminance;
    double shown_solid_angle;   // sr
    double shown_irradiance[3]; // sum over the shown part of L dOmega, W/m^2
};

struct gn_code_table;   // server/light/code_table.h
struct gn_map_geometry; // server/light/map_geometry.h
struct gn_map_row;      // server/light/map_rows.h
struct gn_map_table;    // server/light/map_table.h
struct gn_scene;        // server/scene/scene.h

/** Thread-safety: immutable after create; shared (ref). */
struct gn_radiance_map {
    _Atomic int references;
    struct gn_map_table *table;       // shared (ref) by the maps of one stream
    struct gn_map_geometry *geometry; // shared (ref) too; NULL: local model, all light is distant
    struct gn_code_table *codes;      // shared (ref) too; NULL: float frame
    struct gn_map_row
        *rows; // [height], owned: sums of its making; in a copy those of what was copied
    struct gn_projection projection;
    struct gn_image radiance;     // [height][width][3] linear Rec.709, finite, >= 0; 0 outside
    const float *solid_angle;     // [height][width] sr, 0 outside the valid circle; the table's
    const float *direction_world; // [height][width][3] unit, of the texels' centres (of texels cut
                                  // by the circle: inside it); the table's
    struct gn_pose world_from_probe;
    bool is_full_sphere;
    float fill[3];           // radiance of directions the map does not show (fisheye's lower half)
    double fill_solid_angle; // sr, of those directions
    int64_t capture_time_ns;
    uint64_t sequence;
    struct gn_radiance_map_figures figures;
};

/** Options; all-zero is the default. */
struct gn_radiance_map_options {
    float ground_albedo; // of the fill below a fisheye's horizon, [0, 1], default 0.2 where 0
    bool no_fill;        // directions not shown are black
    const struct gn_scene *model; // borrowed until the map is freed: the global model, light starts
                                  // at its real objects; NULL (default): all light is distant
    const struct gn_radiance_map *previous; // borrowed during the call, may be NULL: the last map
                                            // of the stream. Where projection and orientation
                                            // agree its table, and freed pixels, are used again;
                                            // where the position does too, its geometry
};

/**
 * Linearises, sanitises and addresses the frame. Fill: every direction not shown has the radiance
 * of a diffuse ground, albedo / pi times the irradiance that the shown part gives on a plane across
 * the optical axis. Returns 0, -EINVAL and a sentence, -ENOMEM. Same bits whatever the pool's size.
 */
GN_MUST_USE int gn_radiance_map_create(const struct gn_environment_frame *frame,
                                       const struct gn_radiance_map_options *options,
                                       struct gn_pool *pool, struct gn_radiance_map **out_map,
                                       struct gn_error *out_error);
/** A map with pixels of its own, which the caller may change; its rows' sums stay those of the
 * pixels copied. Shares the rest. 0 or -ENOMEM. */
GN_MUST_USE int gn_radiance_map_copy(const struct gn_radiance_map *map,
                                     struct gn_radiance_map **out_map);
struct gn_radiance_map *gn_radiance_map_ref(struct gn_radiance_map *map);
/** NULL-safe; nulls *map. */
void gn_radiance_map_unref(struct gn_radiance_map **map);
/** Of a map that its table keeps as a spare; for server/light/map_table.c. */
void gn_radiance_map_free(struct gn_radiance_map *map);

/** Radiance[3] from unit world direction, bilinear; the fill where the map does not show it. */
void gn_radiance_map_get_radiance(const struct gn_radiance_map *map,
                                  const float dir_world[static 3], float out_radiance[static 3]);
/**
 * Radiance[3] that the probe measured of a point, m, on a surface of the global model: from the
 * direction of the point. False, and nothing is written, where the map has no geometry, the probe
 * does not see the point past other real surfaces, or the map does not show that direction.
 */
bool gn_radiance_map_get_radiance_at(const struct gn_radiance_map *map, const float point[static 3],
                                     float out_radiance[static 3]);

#endif
