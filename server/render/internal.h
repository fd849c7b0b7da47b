/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the passes of one frame share. A frame goes through in tiles (tiles.c); a tile's samples go
 * through in batches: primary.c finds what each sees, shade.c and shadow.c (or reference.c for
 * both) find its light, refine.c says which pixels need more samples, layers.c makes pixels of
 * samples. A frame is const while the workers run; each worker owns one scratch. Sums are in double
 * and in the order of the lights, so the bits do not depend on the number of workers.
 */
#ifndef GN_SERVER_RENDER_INTERNAL_H
#define GN_SERVER_RENDER_INTERNAL_H

#include <stdatomic.h>

#include "server/render/kernels/kernels.h"
#include "server/render/light_merge.h"
#include "server/render/lights.h"
#include "server/render/near.h"
#include "server/render/render.h"

/** Side of a tile, px. */
#define TILE 16
/** Most samples of a batch. */
#define BATCH (TILE * TILE)
/** Side of a block of pixels, px. */
#define BLOCK 4
/** Mirrors a ray may meet one after another; after that it takes the map's radiance. */
#define MIRROR_DEPTH 8
/** Blocks of a tile's side. */
#define BLOCKS (TILE / BLOCK)
/** Bits of 1 << material: what is seen through or in them, not on them. */
#define CLEAR_MATERIALS (1u << GN_MATERIAL_MIRROR | 1u << GN_MATERIAL_GLASS)

struct optics;
struct pass;
struct silhouettes;

enum sample_kind { SAMPLE_NOTHING = 0, SAMPLE_REAL = 1, SAMPLE_VIRTUAL = 2 };

/** One camera ray and what becomes of it. */
struct sample {
    int group;     // the pixel of the batch it belongs to
    uint64_t seed; // of its random paths
    float dir[3];  // unit, world
    float dir_z;   // its component along the camera's z; 0: the camera has no ray here

    enum sample_kind kind;
    uint32_t object; // where kind is not NOTHING
    float depth;     // m along the camera's z
    struct gn_surface surface;
    float org[3]; // of rays that leave the surface: its point, moved off it

    // Virtual: what is seen after mirrors: another surface, or the environment's radiance. Once
    // glossy reflection is added, the albedo is that of the surface's diffuse base.
    bool is_lit;                  // surface, org are of a surface that shading has to light
    float through[3];             // share of its radiance that reaches the camera
    float seen_dir[3];            // unit, of the ray that met surface
    float weights[GN_PROBES_MAX]; // of the probes at the surface; with one probe not used
    double radiance[3];           // virtual: what the camera sees, W/(sr m^2)
    double indirect[3];           // the part of it that came by bounces

    // Real: radiance without the virtual objects (B of render.h), what they cut off it (B - C),
    // what they add (T - C). open and cut: the sums U and S, W/m^2.
    bool is_receiver; // a diffuse real surface
    bool is_cut;      // some light is cut off by a virtual object
    bool is_summed;   // base and lost are known
    bool has_photons; // caustics come here by photons, not by walks
    double open[3], cut[3];
    double base[3], lost[3], gain[3];
    uint32_t shown; // 1 + the virtual object that a real mirror or glass shows here; 0: none
};

/** The rays of 16 pixels. */
struct sight_rays {
    float dir[3][LANES]; // unit, world
    float dir_z[LANES];  // their components along the camera's z
    bool has_ray[LANES]; // false: outside the picture, or the camera has no ray there
};

/** What the centres of a block's pixels see. */
struct sight {
    struct gn_rt_packet_hits hits;
    float depth[LANES]; // m, along the camera's z; infinite where nothing is met
    bool is_bounded;    // the box is known
    struct box box;     // about the origins of rays from all that is seen, widened
};

/** How a quality chooses the pixels that get a grid of rays. */
struct refine_rule {
    int grid;       // rays per side; 1: none
    float radiance; // second difference between virtual neighbours, relative to their larger one
    float shadow;   // second difference of the shadow factor
};

/** A pixel's centre, as the choice of pixels to refine sees it. */
struct feature {
    uint32_t owner; // virtual object's id + 1, 0: none
    float color[3]; // its radiance, or the shadow factor
};

/** What coarse.c has to know of a pixel's centre. */
enum spot_kind { SPOT_OTHER = 0, SPOT_KNOWN = 1, SPOT_WAITS = 2 };
struct spot {
    enum spot_kind kind; // a receiver whose shadow is known, one that waits for it, or neither
    uint32_t object;
    float point[3], normal[3]; // m, world; unit
};

/** Samples of a batch that distant light is summed for, in structure-of-arrays form and blocks of
 * LANES. */
struct receivers {
    int n, n_blocks;
    int sample[BATCH]; // index of the sample
    _Alignas(64) float org[3][BATCH];
    _Alignas(64) float shading[3][BATCH]; // normals
    _Alignas(64) float geometric[3][BATCH];
    uint16_t wanted[BATCH / LANES];                   // bit i: the sums of lane i are needed
    _Alignas(64) float weights[GN_PROBES_MAX][BATCH]; // of the probes; with one not used
    struct box boxes[BATCH / LANES];                  // of each block's org
    struct box box;                                   // of all
};

/** Boxes that rays from a block's lanes may meet. */
struct box_list {
    int block; // -1: not made
    int n;
    uint16_t lanes[MAX_CLUSTERS];            // from which
    _Alignas(64) float min[3][MAX_CLUSTERS]; // widened
    _Alignas(64) float max[3][MAX_CLUSTERS];
};

/** All light of a pair of normals. */
struct whole {
    float shading[3], geometric[3];
    double irradiance[3];
};

/** Pairs of normals that are kept: a room's walls. */
#define WHOLES 8

/** What one worker needs for a batch, and its counts. */
struct scratch {
    struct sight sights[BLOCKS * BLOCKS];
    struct whole wholes[WHOLES]; // of the frame's lights, the last ones that were needed
    int n_wholes;                // so many were made
    uint64_t wholes_of;          // the frame
    struct sample samples[BATCH];
    int grid;       // samples per side of each group's square; they are neighbours
    int lit[BATCH]; // indices of samples that shading works on
    struct receivers receivers;
    int16_t shadow_lights[GN_LIGHTS_MAX]; // that virtual objects may hide from a receiver, a tile
    int n_shadow_lights;
    struct box_list low[2]; // by role, real first: those that rays downwards may meet
    struct box_list high;   // those of one role that rays upwards may meet
    uint16_t cut[BATCH / LANES][GN_LIGHTS_MAX];    // per block and light, bit i: virtual objects
    uint16_t hidden[BATCH / LANES][GN_LIGHTS_MAX]; // (real objects) hide it from lane i
    uint16_t mask[GN_LIGHTS_MAX];
    uint16_t near_cut[BATCH / LANES][GN_NEAR_LIGHTS_MAX]; // the same of near lights
    uint16_t near_hidden[BATCH / LANES][GN_NEAR_LIGHTS_MAX];
    struct gn_rt_packet packet;
    int lane_sample[GN_RT_PACKET];
    int lane_light[GN_RT_PACKET];
    float lane_weight[GN_RT_PACKET];
    int n_lanes;
    // Reference: per block of lights, bit i: virtual (real; where a virtual object is lit: all)
    // objects hide light i from the sample at hand.
    uint16_t *cut_texels, *hidden_texels; // [n_texel_blocks]
    int n_texel_blocks;
    uint8_t *cut_places, *hidden_places; // [n_places] the same for the places; 0 or 1
    int n_places;
    struct seen_cluster near[2 * MAX_CLUSTERS]; // those above the sample's horizon
    struct optics *optics; // NULL: no real mirror or glass shows virtual objects
    struct outline outlines[MAX_OUTLINES];
    struct change changes[MAX_OUTLINES + 2 * MAX_CLUSTERS]; // in 16 groups of directions
};

/** What one tile adds to the report; summed in the order of tiles. */
struct tile_figures {
    double s_primary, s_shade, s_shadow;
    uint64_t rays_primary, rays_mirror, rays_shade, rays_shadow;
    uint64_t n_mirrors, n_glossy, n_lit, n_receivers, n_rays_real;
    uint64_t n_optics; // samples that see a real mirror or glass
    uint64_t n_near;   // near lights that reach a sample
    int64_t n_virtual_pixels, n_shadow_pixels, n_refined_pixels;
};

/** One frame, const while the workers run. */
struct frame {
    uint64_t serial;                 // of the renderer's frames, the first is 1
    const atomic_bool *is_cancelled; // the renderer's
    const struct gn_scene *scene;
    const struct gn_rt *rt;
    const struct gn_kernels *kernels;
    const struct gn_camera *camera;
    struct gn_blend blend; // the lighting state and its others
    struct gn_render_options options;
    struct refine_rule rule;
    double world_from_camera[9]; // rotation, row-major
    float origin[3];             // the camera, world
    const float *rays;           // [h][w][3] of pixel centres, camera frame; z 0: none
    bool has_real, has_virtual;
    enum gn_rt_set seen;              // by the camera
    struct box real_box, virtual_box; // the virtual one widened against rounding
    struct box solid_box;             // the same of real clusters that are not flat
    const struct box *blockers;       // [n_blockers] real objects, exact
    const struct box *wide_blockers;  // the same, widened against rounding
    int n_blockers;
    const struct clusters *clusters; // [2]: real, virtual
    float margin;                    // m, by which boxes are widened
    // Of all lights; NULL: not made. The real ones are without what is flat.
    const struct silhouettes *real_silhouettes, *virtual_silhouettes;
    float pixel_angle; // rad, between neighbouring pixels' rays; for pictures on meshes
    const struct light_list *lights; // seed, interactive: the state's; reference: the map's
    struct near_lights near;         // of the state; reference: finer
    const struct places *places;     // reference in the global model; else none
    double floor_irradiance[3];      // sums up to this are no light (1e-6 of all)
    float floor_radiance;            // radiances below this do not make contrast

    // The plan: what runs.
    bool run_light_loop; // virtual surfaces are lit light by light
    bool run_shadow;     // shadow on real surfaces
    bool run_blockers;   // real geometry may hide lights from real surfaces
    bool run_bounces;
    bool run_optics;   // real mirrors and glass show virtual objects and their shadows
    bool run_caustics; // light of virtual mirrors and glass comes by photons
    bool cull;         // leave out rays that cannot meet the virtual objects
    bool skips;        // leave out blocks of pixels that show nothing of the virtual objects

    uint64_t n_photons, rays_caustics; // after the pass: photons that the camera sees

    struct sight *kept; // [n_tiles * BLOCKS * BLOCKS] of the tiles' blocks; NULL: not kept (kept.h)
    bool is_seen;       // it is known from a frame before

    const struct pass *pass; // NULL: a frame by itself; else its samples go into the pass' sums
    struct gn_layers *layers;
    struct feature *features;     // [h][w], but of plain blocks
    int shadow_step;              // 1: every pixel has its own shadow
    struct spot *spots;           // [h][w], but of plain blocks; with a step of 1 not used
    bool *plain;                  // [tiles_y * BLOCKS][tiles_x * BLOCKS] such as nothing is lost in
    struct tile_figures *figures; // [n_tiles]
    struct scratch *scratches;    // [n_workers]
    int tiles_x, tiles_y;
};

/* tiles.c */

/** Fills the frame's layers, features and figures. */
void gn_tiles_render(struct frame *frame, struct gn_pool *pool);
/** The light of scratch's n samples, which know what they see. */
void gn_tiles_light_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                            struct tile_figures *figures);

/* report.c */

/** What the workers counted, into the report; withdraws passes that found nothing to do. */
void gn_report_fill(const struct frame *frame, int n_workers, struct gn_render_report *report);

/* plan.c */

/** Decides what runs, and writes the plan's lines into the report. slopes: bounds of the camera's
 * rays, x/z and y/z: min x, max x, min y, max y. */
void gn_plan_make(struct frame *frame, const double slopes[static 4],
                  struct gn_render_report *report);
/** After the frame: passes that found nothing to do did not run. */
void gn_plan_finish(const struct frame *frame, const struct tile_figures *sum,
                    struct gn_render_report *report);

/* primary.c */

/** Do two cameras of one pose see along the same rays? */
bool gn_primary_has_same_rays(const struct gn_camera *a, const struct gn_camera *b);
/** Fills table[h][w][3] and slopes[4] (may be NULL); see struct frame. pass: NULL, or whose points
 * of the pixels. */
void gn_primary_make_rays(const struct gn_camera *camera, const struct pass *pass,
                          struct gn_pool *pool, float *table, double *out_slopes);
/** Aims rays through the centres of a block's pixels, the first of which is (x, y). */
void gn_primary_aim_block(const struct frame *frame, int x, int y, struct sight_rays *out);
/** What a block sees along its rays. */
void gn_primary_see_block(const struct frame *frame, const struct sight_rays *rays,
                          struct sight *out, struct tile_figures *figures);
/** What a lane sees, as a sample; all but its group and its seed. */
void gn_primary_take(const struct frame *frame, const struct sight_rays *rays,
                     const struct gn_rt_packet_hits *hits, int lane, struct sample *out_sample,
                     struct tile_figures *figures);
/** The unit world direction of a camera direction. */
void gn_primary_aim(const struct frame *frame, const float dir_camera[static 3],
                    struct sample *sample);
/** Finds what each sample sees. */
void gn_primary_trace(const struct frame *frame, struct sample *samples, int n,
                      struct tile_figures *figures);

/* shade.c */

/** Follows mirrors from virtual samples to a diffuse surface or the environment. */
void gn_shade_follow_mirrors(const struct frame *frame, struct sample *samples, int n,
                             struct tile_figures *figures);
/** The unit direction after a mirror; in place. */
void gn_shade_reflect(const struct gn_surface *surface, float dir[static 3]);
/** Lights the virtual samples of scratch by the frame's lights or the SH irradiance. */
void gn_shade_samples(const struct frame *frame, struct scratch *scratch, int n,
                      struct tile_figures *figures);

/** Irradiance of the surface of a sample that is none of scratch's, by the frame's lights or the SH
 * irradiance and by the set's near lights, with what of the set hides them. Of `stride` lights only
 * each one is tried that comes as `first`th, for all of them: the mean over all first is exact. */
void gn_shade_get_irradiance(const struct frame *frame, struct scratch *scratch,
                             const struct sample *sample, enum gn_rt_set set, int first, int stride,
                             double out_irradiance[static 3], struct tile_figures *figures);

/* specular.c */

/** Adds what ggx and glass surfaces of the virtual samples reflect and let through, and what file
 * materials send themselves; leaves the diffuse base to shading. */
void gn_specular_shade(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                       struct tile_figures *figures);

/* optics.c: what real mirrors and glass show */

/** Has the scene what the pass is for: a real mirror or glass and a virtual object? */
bool gn_optics_is_needed(const struct gn_scene *scene);
/** Is some of the object a mirror, glass, or so polished that it mirrors? */
bool gn_optics_may_show(const struct gn_scene_object *object);
/** Does the surface? */
bool gn_optics_is_shown_by(const struct gn_surface *surface);
/** Memory for the workers' scratches, where the scene needs it. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_optics_reserve(const struct gn_scene *scene, struct scratch *scratches,
                                  int n_workers);
void gn_optics_finish(struct scratch *scratch);
/** base, lost and gain of those of scratch's n samples, lit already, that see a real mirror or
 * glass. */
void gn_optics_samples(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                       struct tile_figures *figures);

/* shadow.c */

/** base, lost and gain of the real samples and of those that see nothing. */
void gn_shadow_samples(const struct frame *frame, struct scratch *scratch, int n,
                       struct tile_figures *figures);
/** Lists in scratch the lights that virtual objects may hide from somewhere in the box. */
void gn_shadow_list_lights(const struct frame *frame, struct scratch *scratch,
                           const struct box *box);
/** True where surely no shadow of a virtual object by these lights, or by near ones, reaches the
 * box. */
bool gn_shadow_is_free(const struct frame *frame, const struct scratch *scratch,
                       const struct box *box);
/** Which pixels of the batch have a sample that is cut (with bounces: all): their sums are needed.
 */
void gn_shadow_find_groups(const struct frame *frame, const struct sample *samples, int n,
                           bool *out_groups);
/** base and lost from open and cut. */
void gn_shadow_weigh(const struct frame *frame, struct sample *sample);
/** base of a sample that sees nothing: the map's radiance (a real mirror is taken for that too). */
void gn_shadow_see_nothing(const struct frame *frame, struct sample *sample);
/** Zeroes the sums. */
void gn_shadow_clear(struct sample *sample);

/* receivers.c: distant light at samples in blocks of LANES */

void gn_receivers_begin(struct receivers *receivers);
/** Adds samples[i], which sees a surface. */
void gn_receivers_add(struct receivers *receivers, const struct sample *samples, int i,
                      int n_probes);
/** Fills the last block up with receivers that no light reaches. */
void gn_receivers_end(struct receivers *receivers, int n_probes);
/** Bit i: the block's lane i has the light above its horizon. */
unsigned gn_receivers_get_lit(const struct frame *frame, const struct receivers *receivers,
                              int block, const float dir[static 3]);
/** Rays of a block's lanes to a light, in packets; marks hidden lanes in masks[block][light]. */
void gn_receivers_trace(const struct frame *frame, struct scratch *scratch, int block, int light,
                        unsigned lanes, enum gn_rt_set set, uint16_t (*masks)[GN_LIGHTS_MAX],
                        uint64_t *rays);
/** After the last of those. */
void gn_receivers_flush(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                        uint16_t (*masks)[GN_LIGHTS_MAX], uint64_t *rays);
/** Irradiance by the lights that mask[n lights] marks, bit i: in lane i; NULL: by all. */
void gn_receivers_sum(const struct frame *frame, const struct receivers *receivers, int block,
                      const uint16_t *mask, bool unweighted, double out[static 3][LANES]);

/* occlusion.c: which distant lights do objects hide from scratch's receivers */

/** Clears the masks cut and hidden, and what is wanted. */
void gn_occlusion_clear(const struct frame *frame, struct scratch *scratch);
/** Marks in cut what virtual objects hide, of the lights that scratch lists. */
void gn_occlusion_find_cut(const struct frame *frame, struct scratch *scratch, uint64_t *rays);
/** Marks in hidden what real objects hide from the wanted receivers. */
void gn_occlusion_find_hidden(const struct frame *frame, struct scratch *scratch, uint64_t *rays);
/** Marks in hidden what any object hides from all receivers. */
void gn_occlusion_find_all(const struct frame *frame, struct scratch *scratch, uint64_t *rays);

/* reference.c */

/** As gn_shade_samples and gn_shadow_samples, by every direction of the map, with bounces. */
void gn_reference_shade(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                        struct tile_figures *figures);
void gn_reference_shadow(const struct frame *frame, struct scratch *scratch, int n, int n_paths,
                         struct tile_figures *figures);
/** base of a receiver that no virtual object cuts. */
void gn_reference_sum_uncut(const struct frame *frame, struct scratch *scratch,
                            struct sample *sample, int n_paths, struct tile_figures *figures);

/* bounce.c */

/** Mean of n_paths random walks through `set` from the diffuse surface of start: indirect radiance
 * that real surfaces alone carry, and that which virtual ones had a part in. */
void gn_bounce_gather(const struct frame *frame, const struct sample *start, enum gn_rt_set set,
                      int n_paths, double out_common[static 3], double out_touched[static 3],
                      uint64_t *rays);

/** Mean of n_paths random walks from the ggx or glass surface of a sample into its reflection and
 * refraction: that share of its radiance. */
void gn_bounce_gather_specular(const struct frame *frame, const struct sample *start, int n_paths,
                               double out_radiance[static 3], uint64_t *rays);

/* refine.c */

extern const struct refine_rule gn_refine_rules[3]; // by enum gn_quality

/** Of the block that the pixel is in. */
bool *gn_refine_plain_at(const struct frame *frame, int x, int y);
/** True where the pixel's block and those about it are plain. */
bool gn_refine_is_all_plain(const struct frame *frame, int x, int y);
/** A pixel's centre; NULL outside the picture. */
const struct feature *gn_refine_get_feature(const struct frame *frame, int x, int y);
/** True where the pixel needs its quality's grid. */
bool gn_refine_is_needed(const struct frame *frame, int x, int y);

/* coarse.c */

/** Keeps what is needed of a pixel's sample; true: its shadow waits, it is no receiver for now. */
bool gn_coarse_put_off(const struct frame *frame, int x, int y, struct sample *sample);
/** True where the pixel's shadow waits. */
bool gn_coarse_waits(const struct frame *frame, int x, int y);
/** The layer's factor and the feature's color of a pixel that waits, by those about it. False: its
 * shadow has to be worked out. */
bool gn_coarse_interpolate(const struct frame *frame, int x, int y, float out_factor[static 3],
                           float out_color[static 3]);

/* layers.c */

/** Fills a block's pixels, the first of which is (x, y), with nothing but their depths. */
void gn_layers_write_plain(const struct frame *frame, int x, int y,
                           const float depths[static LANES]);
/** Makes pixel (x, y) of its samples. */
void gn_layers_resolve(const struct frame *frame, int x, int y, const struct sample *samples,
                       int n);

/* packet.c: rays into packets of 16 */

/** Adds a ray of that length (INFINITY: to a distant light); true where the packet is now full and
 * must be flushed by the caller. */
bool gn_packet_add(struct scratch *scratch, const float org[static 3], const float dir[static 3],
                   int sample, int light, float weight, float length);
/** Traces what the packet holds and empties it; bit i: lane i is hidden. *out_n: lanes. */
uint32_t gn_packet_trace(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                         int *out_n, uint64_t *rays);

/** True where nobody wants the frame any more: what is left of it may be left out. */
static inline bool is_cancelled(const struct frame *frame)
{
    return atomic_load_explicit(frame->is_cancelled, memory_order_relaxed);
}

static inline float dot3(const float a[static 3], const float b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Cosine by which light from dir reaches the surface; 0 where it comes from under the horizon. */
static inline float surface_cosine(const struct gn_surface *surface, const float dir[static 3])
{
    float c = dot3(surface->normal_shading, dir);
    return c > 0 && dot3(surface->normal_horizon, dir) > 0 ? c : 0;
}

#endif
