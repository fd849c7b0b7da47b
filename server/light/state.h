/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The lighting state: everything rendering knows of the light, one immutable published object.
 */
#ifndef GN_SERVER_LIGHT_STATE_H
#define GN_SERVER_LIGHT_STATE_H

#include <stdint.h>

#include "server/light/emitters.h"
#include "server/light/irradiance.h"
#include "server/light/pyramid.h"
#include "server/light/radiance_map.h"

struct gn_light_memory;   // server/light/lights.h
struct gn_partition_plan; // server/light/partition_plan.h
struct gn_temporal;       // server/light/temporal.h

/** Most probes that light a room together. */
#define GN_PROBES_MAX 8
/** Most lights a state may hold. */
#define GN_LIGHTS_MAX 4096

/**
 * A light as the probe sees it: distant, or (global model) a piece of a real surface at
 * map->world_from_probe.translation + distance dir_world that shines by Lambert's law.
 */
struct gn_light {
    float dir_world[3];   // unit, from the probe towards the light
    float angular_radius; // rad, of the disc as spread out as the light's region; 0: unknown
    float irradiance[3];  // RGB at normal incidence, at the probe, W/m^2
    float distance;       // m, of the piece's middle from the probe; INFINITY: distant; 0: the
                          // method left it to gn_lighting_state_create(), local model: distant
    float normal[3];      // of the piece, to the probe's side, unit; 0: not known, or distant
    bool is_disc;         // a small sun kept whole: even light from all of the disc; else what
                          // lies within angular_radius is not known to be even
    uint64_t id;          // its own in the state; the same light in the stream's next; 0: none
};

/** How lights are made from the map. */
enum gn_light_method {
    GN_LIGHT_PARTITION_ENERGY = 0, // the default; regions keep their energy
    GN_LIGHT_PARTITION_SEED = 1,   // the paper's literal partition
    GN_LIGHT_PENROSE = 2,          // the hierarchical importance samples themselves, equal power
    GN_LIGHT_MEDIAN_CUT = 3,       // regions of equal energy
    GN_LIGHT_VARIANCE = 4,         // regions of little spread
    GN_LIGHT_INVERSION = 5,        // well spread points, put where the energy is
    GN_LIGHT_QUADTREE = 6,         // leaves of a tree that changes where the light does
    GN_LIGHT_METHOD_COUNT
};

enum gn_partition_metric {
    GN_METRIC_DEFAULT = 0,
    GN_METRIC_POW2 = 1,
    GN_METRIC_TWICE = 2,
    GN_METRIC_LOG2 = 3
};

/** Readings of the paper's partition that can be taken to the letter, one by one. */
enum gn_partition_reading {
    GN_READ_UNCLAMPED = 1 << 0,      // the number of sub-regions may pass max_ls
    GN_READ_SAMPLE_MEAN = 1 << 1,    // means over the samples, not over the map
    GN_READ_SAMPLE_MAX = 1 << 2,     // largest luminance: of the samples, not of the smoothed map
    GN_READ_STRICT = 1 << 3,         // a region as bright as the mean gets no light
    GN_READ_RADIUS_RINGS = 1 << 4,   // rings of equal polar angle, not of equal solid angle
    GN_READ_MIDPOINT = 1 << 5,       // cut in the middle, not at the energy median
    GN_READ_BRIGHTEST = 1 << 6,      // the brightest sample is the light, not energy and centroid
    GN_READ_DISCARD_DARK = 1 << 7,   // dark regions (and the fill) give no light
    GN_READ_PLAIN_SAMPLING = 1 << 8, // importance Y, not Y dOmega/dA
    GN_READ_SEED = (1 << 9) - 1,     // the paper's own
    GN_READ_BRIGHTEST_DIR = 1 << 9,  // between: the energy, from the brightest texel's direction
    GN_READ_ALL = (1 << 10) - 1,
    GN_READ_SAMPLED = GN_READ_SAMPLE_MEAN | GN_READ_SAMPLE_MAX | GN_READ_BRIGHTEST, // need samples
};
/** Their names, by rising bit, as a list of choices. */
#define GN_READ_NAMES                                                                              \
    "unclamped|sample-mean|sample-max|strict|radius-rings|midpoint|brightest|discard-dark|"        \
    "plain-sampling|brightest-direction"
/** Names of enum gn_partition_metric and of enum gn_light_weights, as lists of choices. */
#define GN_METRIC_NAMES "default|pow2|twice|log2"
#define GN_WEIGHTS_NAMES "partition|equal|density"

/** How the power is shared out among importance samples. */
enum gn_light_weights {
    GN_WEIGHTS_PARTITION = 0, // the default: each texel's light to its nearest sample (W3)
    GN_WEIGHTS_EQUAL = 1,     // all the same power, in the colour about the sample (W1)
    GN_WEIGHTS_DENSITY = 2,   // radiance over samples per steradian (W2)
    GN_WEIGHTS_COUNT
};

/** n_lights of a caller who wants the metric's own count. */
#define GN_LIGHTS_NO_AIM (-1)

/** Options; all-zero is the default of the method. */
struct gn_light_options {
    enum gn_light_method method;
    int n_lights; // wanted number (not by the paper's own metrics, nor seed), [1, GN_LIGHTS_MAX]
                  // or GN_LIGHTS_NO_AIM; default 64
    int rings; // base division of a hemisphere, [1, 64]; default 8 (seed), else by n_lights: 4 for
               // 64 lights of a fisheye
    int sectors;   // [1, 256], rings * sectors <= 1024; default 3 rings
    int max_ls;    // the paper's maxLS, [1, 4096]; default 8; n_lights / 8 where more
    int n_samples; // Penrose samples under the partition, [1, 2^20]; default 16 per base region
    enum gn_partition_metric metric; // default log2 (energy) or 2^k (seed)
    unsigned literal; // GN_READ_* taken to the letter besides the method's own (seed: GN_READ_SEED)
    unsigned mended;  // GN_READ_* not taken to the letter after all
    enum gn_light_weights weights; // of importance samples as lights; default partition
    bool relaxed;  // importance samples moved by the correction table: evener, but they move
                   // with the light: for still pictures, not for streams
    bool no_discs; // small suns go through the method too (it is so in `seed`)
    bool no_sh;    // leave the SH irradiance out
    struct gn_irradiance_options irradiance;
    bool no_lights;    // leave the lights out
    bool want_pyramid; // make the map's pyramid, for glossy materials; default: leave it out
    double smoothing; // s, time constant by which light at rest follows the frames, [0, 10]; 0: off
    uint64_t stream;  // whose frame it is; only light of the same stream is followed
    const struct gn_lighting_state *previous; // borrowed during the call, may be NULL: the last
                                              // state of the stream, whose tables are used again
};

/** What a frame's light became in time (server/light/temporal.h). */
enum gn_temporal_verdict {
    GN_TEMPORAL_OFF = 0,    // not smoothed
    GN_TEMPORAL_START = 1,  // taken as it is: the first of a stream, or after a gap
    GN_TEMPORAL_FOLLOW = 2, // filtered
    GN_TEMPORAL_HOLD = 3,   // the capture time did not rise: lights and harmonics stay as they were
};

/** Figures of the light in time. */
struct gn_temporal_figures {
    enum gn_temporal_verdict verdict;
    double dt_ms;  // since the frame followed last; 0 where the verdict is OFF or START
    double tau_ms; // time constant: shorter while light changes by more than noise does
    double alpha;  // share of the way to the new frame
    int n_births;  // lights that the frame has and the last one had not
    int n_deaths;  // lights that the last one had and this one has not
    int n_snaps;   // lights that took their new value at once
    int n_fading;  // lights published that the map has no more
};

/** What the method found. */
struct gn_light_figures {
    int rings, sectors; // base division of the part shown; 0 where the method has none
    int n_samples;      // Penrose samples drawn
    int n_bright;       // base regions with lights of their own
    int n_dark_lights;  // lights of merged dark regions
    int n_fill_lights;  // lights of the directions not shown
    int n_discs;        // small suns kept whole
    int n_dropped;      // lights left out, the weakest, beyond GN_LIGHTS_MAX
    double split_gain;  // factor on MLR/MLEM by which the wanted number was met; 1: none
};

/** Published by the light thread, read by all. Thread-safety: immutable after create; shared (ref).
 */
struct gn_lighting_state {
    _Atomic int references;
    struct gn_radiance_map *map; // shared (ref), never NULL
    struct gn_pyramid *pyramid;  // of the map; shared (ref); NULL: it was not asked for
    bool has_sh;
    double sh[GN_SH_MAX][3];         // L_lm of all light, world axes; 0 above irradiance.order
    struct gn_irradiance irradiance; // of any normal
    struct gn_irradiance frame_irradiance; // of the frame alone, where light is smoothed
    bool has_lights;
    int n_asked; // n_lights of the options it was made with
    int n_lights;
    struct gn_light *lights; // [n_lights], owned; by falling luminance
    int n_near;
    struct gn_near_light *near;   // [n_near], owned; those of `emission` that give light, by its
                                  // order
    struct gn_emission *emission; // pictures on emitters; shared (ref), may be NULL: no near light
    double total_irradiance[3];   // sum over the sphere, fill included, of L dOmega, W/m^2: what
                                  // the lights add up to (seed: they do not); smoothed
    struct gn_light_figures figures;
    struct gn_temporal_figures in_time;
    struct gn_temporal *temporal;   // what the filter keeps; owned, NULL: nothing is smoothed
    struct gn_partition_plan *plan; // which texel lies in which base region; shared (ref), may be
                                    // NULL
    struct gn_light_memory *memory; // what the method keeps for the next frame; owned, may be NULL
    int n_others;                   // [0, GN_PROBES_MAX - 1]: lights of the room's other probes
    struct gn_lighting_state *others[GN_PROBES_MAX - 1]; // [n_others] shared (ref), themselves
                                                         // without others; see server/light/blend.h
    uint64_t stream;                                     // whose frame it was; see gn_light_options
    uint64_t sequence;                                   // of the environment frame
    int64_t capture_time_ns;
    int64_t published_time_ns;
    double ms_map, ms_sh, ms_lights, ms_temporal; // time spent, ms
};

/** Makes a state from a frame. Returns 0 or a negative errno and a sentence. */
GN_MUST_USE int gn_lighting_state_create(const struct gn_environment_frame *frame,
                                         const struct gn_radiance_map_options *map_options,
                                         const struct gn_light_options *options,
                                         struct gn_pool *pool, struct gn_lighting_state **out_state,
                                         struct gn_error *out_error);
/**
 * The same light at a later time, for a frame that equals the one it was made from: map, tables and
 * the lights before smoothing are shared; smoothing goes on. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_lighting_state_advance(const struct gn_lighting_state *state, uint64_t sequence,
                                          int64_t capture_time_ns,
                                          const struct gn_light_options *options,
                                          struct gn_lighting_state **out_state);
/**
 * The same light with what the options ask for now and it had left out, made from its map; same
 * sequence and time. What was there stays as it is, to the bit, and smoothing goes on as if nothing
 * had been asked; where light is smoothed, what is new begins with the power of the smoothed total.
 * Returns 0 or a negative errno and a sentence.
 */
GN_MUST_USE int gn_lighting_state_complete(const struct gn_lighting_state *state,
                                           const struct gn_light_options *options,
                                           struct gn_pool *pool,
                                           struct gn_lighting_state **out_state,
                                           struct gn_error *out_error);
/**
 * A state of near light only, for a room without a probe: its map is black, sequence 0. options as
 * above, with their emission. Returns 0 or a negative errno and a sentence.
 */
GN_MUST_USE int gn_lighting_state_create_dark(struct gn_emission *emission,
                                              const struct gn_light_options *options,
                                              int64_t capture_time_ns,
                                              struct gn_lighting_state **out_state,
                                              struct gn_error *out_error);
/** Gives a state that nobody else has yet its near light; emission may be NULL: none. The state
 * takes a reference of its own. 0 or -ENOMEM: then the state is as before. */
GN_MUST_USE int gn_lighting_state_set_emission(struct gn_lighting_state *state,
                                               struct gn_emission *emission);
/** A copy of a published state with other near light. It shares the map and the other probes'
 * states; it is no `previous` for the next one. 0 or -ENOMEM. */
GN_MUST_USE int gn_lighting_state_replace_emission(const struct gn_lighting_state *state,
                                                   struct gn_emission *emission,
                                                   struct gn_lighting_state **out_state);
struct gn_lighting_state *gn_lighting_state_ref(struct gn_lighting_state *state);
/** NULL-safe; nulls *state. */
void gn_lighting_state_unref(struct gn_lighting_state **state);

/** The names of all methods, as a list of choices. */
#define GN_LIGHT_METHOD_NAMES "partition|seed|penrose|median-cut|variance|inversion|quadtree"
/** One of them; NULL for a bad method. */
const char *gn_light_method_get_name(enum gn_light_method method);
/** The method of that name, or -EINVAL. */
GN_MUST_USE int gn_light_method_from_name(const char *name, enum gn_light_method *out_method);

#endif
