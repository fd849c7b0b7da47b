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

#include "server/light/blend.h"
#include "server/render/kernels/kernels.h"
#include "server/render/light_merge.h"
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
/** Receivers of a block, neighbours in the picture: as many as a packet's rays. */
#define LANES GN_RT_PACKET
/** Blocks of a tile's side. */
#define BLOCKS (TILE / BLOCK)
/** Boxes that real geometry is put in for conservative tests. */
#define MAX_BLOCKERS 64
/** Clusters of a set's triangles. */
#define MAX_CLUSTERS 64
/** Most triangles of a cluster that keeps its vertices and edges. */
#define CLUSTER_TRIANGLES 64
/** Most outlines of both sets. */
#define MAX_OUTLINES (2 * MAX_CLUSTERS * CLUSTER_TRIANGLES * 3)
/** Bits of 1 << material: what is seen through or in them, not on them. */
#define CLEAR_MATERIALS (1u << GN_MATERIAL_MIRROR | 1u << GN_MATERIAL_GLASS)
/** Directions of a group: 16 blocks of 16. */
#define GROUP (LANES * LANES)

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

/** What the rays of 16 pixels meet. */
struct sight {
    float dir[3][LANES]; // unit, world
    float dir_z[LANES];  // their components along the camera's z
    bool has_ray[LANES]; // false: outside the picture, or the camera has no ray there
    struct gn_rt_packet_hits hits;
};

/** A box for conservative tests, m; or of directions. */
struct box {
    float min[3], max[3];
};

/** 16 blocks of 16 lights each, all near each other. */
struct light_group {
    struct direction_boxes blocks;
    uint16_t lit[LANES];              // per block, bit i: lane i has light
    double block_moment[LANES][3][3]; // per block and channel: sum of irradiance times direction
    double moment[3][3];              // of the group
};

/** Directions that carry light, in structure-of-arrays form; the reference's in groups, filled up
 * with dark ones. */
struct light_list {
    int n, capacity;
    int n_lit;               // without the dark ones
    int ends[GN_PROBES_MAX]; // of each probe's lights, which begin where the one's before end
    float *dir[3];           // unit, world
    float *irradiance[3];    // at normal incidence, W/m^2
    double total[3];         // sum of irradiance
    double *cdf;             // [n] of luminance, rising to 1; the reference's choice of lights
    int n_groups;            // reference only: n / GROUP
    struct light_group *groups;
    struct direction_boxes *group_boxes; // of the groups, 16 together
};

/** A piece of a modelled real surface that the probe sees (places.c). */
struct place {
    float position[3];  // m, world
    float normal[3];    // unit, to the probe's side
    float intensity[3]; // W/sr along the normal
    float radius2;      // m^2, of the disc of equal area
};

/** What the reference's covered texels are in the global model. */
struct places {
    int n;
    int64_t capacity;
    int ends[GN_PROBES_MAX]; // of each probe's
    struct place *lights;    // [n], owned
    double *cdf;             // [n] of luminance, rising to 1; for walks
};

/** Some triangles that are near each other. */
struct cluster {
    struct box box;               // exact but for slack
    int first_vertex, n_vertices; // three for each triangle; of many triangles: the box's corners
    bool has_edges;               // false: of too many triangles, or of several that move
    bool is_flat;                 // of one object, which lies in one plane
    int first_edge, n_edges;
    int first_corner, n_corners; // in the clusters' corners: each vertex's place once
    int mover;                   // of whose triangles it is; CLUSTER_RESTS, CLUSTER_MIXED
    float slack; // m, by which rounding may put what is traced elsewhere; 0 where all rests
};

/** All of it rests. */
#define CLUSTER_RESTS (-1)
/** Several objects, of which some move: a box about them. */
#define CLUSTER_MIXED (-2)

/** A movable object. */
struct mover {
    int object;
    int group;      // the box it shares with others; -1: none
    struct box own; // of its vertices, mesh coordinates
};

/** Movable objects of a role and the boxes that they share with others. */
struct movers {
    int n;
    struct mover *mover;              // [n], owned
    struct box resting[MAX_CLUSTERS]; // by group: of what rests in it; min > max: nothing
};

/** An edge and what its triangles have beside it: indices of the clusters' vertices. */
struct edge {
    int ends[2];
    int apex[2];
    bool has_two; // triangles; else one, or more than two, and apex says nothing
    int cluster;
};

/** An edge that bounds what is seen from a point. */
struct outline {
    struct box box; // relative to the point, widened
    float plane[3]; // normal to both ends' directions, at most of unit length
    float width;    // unit directions d that may meet it have |plane . d| up to this
};

/** Where in 16 groups of directions it may change whether a ray is stopped. */
struct change {
    const struct outline *outline; // NULL: anywhere in the box
    const struct box *box;
    unsigned groups;
};

/** A cluster as a point sees it. */
struct seen_cluster {
    struct box box; // relative to the point, widened
    bool has_outlines;
    int first_outline, n_outlines;
};

/** A set's triangles, each in one cluster. */
struct clusters {
    enum gn_rt_set role;
    int n;
    struct cluster cluster[MAX_CLUSTERS];
    int n_vertices;
    float *vertices[3];         // world, owned
    float *own_vertices[3];     // of movers': mesh coordinates, owned; NULL where nothing moves
    bool is_flat[MAX_CLUSTERS]; // of the objects' first clusters, which are also the blockers
    uint16_t *corners;          // indices of vertices, owned
    struct edge *edges;         // owned; an edge of triangles of two clusters is in one of them
    struct movers movers;
};

/** Boxes of the real objects, each in one. */
struct blockers {
    int n;
    struct box boxes[MAX_BLOCKERS]; // exact; of what moves, widened by its slack
    struct movers movers;           // group: index of the box
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
    uint64_t serial; // of the renderer's frames, the first is 1
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

/** Fills table[h][w][3] and slopes[4] (may be NULL); see struct frame. pass: NULL, or whose points
 * of the pixels. */
void gn_primary_make_rays(const struct gn_camera *camera, const struct pass *pass,
                          struct gn_pool *pool, float *table, double *out_slopes);
/** Aims rays through the centres of a block's pixels, the first of which is (x, y). */
void gn_primary_aim_block(const struct frame *frame, int x, int y, struct sight *out);
/** Fills the hits. */
void gn_primary_trace_block(const struct frame *frame, struct sight *sight,
                            struct tile_figures *figures);
/** A box about the origins of rays from all that the lanes see, widened. False: something is seen
 * that takes more to tell. */
bool gn_primary_bound(const struct frame *frame, const struct sight *sight, struct box *out_box);
/** What a lane sees, as a sample; all but its group and its seed. */
void gn_primary_take(const struct frame *frame, const struct sight *sight, int lane,
                     struct sample *out_sample, struct tile_figures *figures);
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

/* blockers.c */

/** Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_blockers_make(const struct gn_scene *scene, struct blockers *out);
void gn_blockers_finish(struct blockers *blockers);
/** Follows the movable objects to where they stand in a snapshot of the scene. */
void gn_blockers_pose(struct blockers *blockers, const struct gn_scene *scene);
/** Those of the frame's (widened) that do not lie wholly under the planes through all wanted
 * receivers' ray origins: no ray that leaves upwards meets the others. Returns their number. */
int gn_blockers_list_above(const struct frame *frame, const struct receivers *receivers,
                           const struct box *out_boxes[static MAX_BLOCKERS]);

/* movers.c */

#define EMPTY_BOX ((struct box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}})

/** Lists the movable objects of a role; all groups are -1 and empty. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_movers_make(const struct gn_scene *scene, enum gn_rt_set role,
                               struct movers *out);
void gn_movers_finish(struct movers *movers);
/** Index of the object's mover; -1: it rests. */
int gn_movers_find(const struct movers *movers, int object);
/** World vertex of a mesh, rounded as rt rounds it. */
void gn_movers_get_vertex(const struct gn_scene_object *object, const float p[static 3],
                          float out[static 3]);
/** Grows box by the world box of a mover where it stands in the scene, and returns its slack. */
float gn_movers_grow_box(const struct mover *mover, const struct gn_scene *scene, struct box *box);
void gn_box_grow(struct box *box, const float p[static 3]);

/* clusters.c */

/** Makes the clusters of the scene's objects of a role. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_clusters_make(const struct gn_scene *scene, enum gn_rt_set role,
                                 struct clusters *out);
void gn_clusters_finish(struct clusters *clusters);
/** Follows the movable objects to where they stand in a snapshot of the scene; O(clusters). */
void gn_clusters_pose(struct clusters *clusters, const struct gn_scene *scene);
/** Adds to out[n] and their outlines the clusters that are not wholly in or under the plane through
 * org: no ray that leaves upwards meets the others. Returns the new n. */
int gn_clusters_list_above(const struct clusters *clusters, const float org[static 3],
                           const float normal[static 3], float margin, int n,
                           struct seen_cluster *out, struct outline *outlines);

/* edges.c */

/** Fills the edges of the clusters that have them. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_edges_make(struct clusters *clusters);
/** Those of a cluster's edges that bound what is seen from org. Returns their number. */
int gn_edges_list_outlines(const struct clusters *clusters, const struct cluster *cluster,
                           const float org[static 3], float margin, struct outline *out);

/* directions.c */

/** Makes the groups of a list whose lights are in their order. */
void gn_directions_fill_groups(struct light_list *list);
/** Sets one of 16; box may be empty (min > max). */
void gn_directions_set_box(struct direction_boxes *boxes, int lane, const struct box *box);
/** Bit i: unless all rays from the origin with a direction of box i surely miss `box`. */
unsigned gn_directions_meet(const struct direction_boxes *boxes, const struct box *box);
/** Bit i: unless the outline surely crosses no direction of box i. */
unsigned gn_directions_cross(const struct direction_boxes *boxes, const struct outline *outline);
/** Bit i: box i may hold a direction above the plane across n; surely holds no other. */
void gn_directions_split(const struct direction_boxes *boxes, const float n[static 3],
                         unsigned *out_some, unsigned *out_all);

/* reference_lights.c */

/** Fills list from the whole map of each probe: every texel, bright ones in parts, and what it does
 * not show. No 16 groups are of two probes. */
GN_MUST_USE int gn_reference_make_lights(const struct gn_blend *blend, struct light_list *list,
                                         struct places *places);

/* places.c */

/** Empties the list. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_places_reserve(struct places *places, int64_t capacity);
void gn_places_finish(struct places *places);
/** Adds what the map's probe sees in a unit direction, of irradiance across it. False: it sees no
 * modelled surface there; nothing is added. */
bool gn_places_add(struct places *places, const struct gn_radiance_map *map,
                   const double dir[static 3], double solid_angle,
                   const double irradiance[static 3]);
/** After the last: fills cdf. */
void gn_places_fill_cdf(struct places *places);
/** Irradiance of a surface by one place, chosen by `random` [0, 1), over its probability. */
void gn_places_try(const struct frame *frame, const struct gn_surface *surface,
                   const float org[static 3], enum gn_rt_set set, double random,
                   double out_irradiance[static 3], uint64_t *rays);
/** Marks those that the set hides from the sample. True where there is one. */
bool gn_places_find_hidden(const struct frame *frame, struct scratch *scratch,
                           const struct sample *s, enum gn_rt_set set, uint8_t *hidden,
                           uint64_t *rays);
/** Adds what those send that hidden does not mark to sums[0], and of that what cut marks to
 * sums[1]; even: without the surface's cosine. */
void gn_places_sum(const struct frame *frame, const struct sample *s, const uint8_t *hidden,
                   const uint8_t *cut, bool even, double sums[static 2][3]);

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
/** The shadow of a pixel that waits, by those about it. False: it has to be worked out. */
bool gn_coarse_interpolate(const struct frame *frame, int x, int y, float out_factor[static 3]);

/* layers.c */

/** Fills a block's pixels, the first of which is (x, y), with nothing but their depths. */
void gn_layers_write_plain(const struct frame *frame, int x, int y,
                           const float depths[static LANES]);
/** Makes pixel (x, y) of its samples. */
void gn_layers_resolve(const struct frame *frame, int x, int y, const struct sample *samples,
                       int n);

/* light_list.c */

GN_MUST_USE int gn_render_lights_reserve(struct light_list *list, int64_t capacity);
void gn_render_lights_finish(struct light_list *list);
void gn_render_lights_add(struct light_list *list, const double dir[static 3],
                          const double irradiance[static 3]);
/** Adds dark lights up to the next multiple. */
void gn_render_lights_pad(struct light_list *list, int multiple);
/** Fills list from the states' lights; dark ones are left out. Of more than `limit` together (0:
 * GN_LIGHTS_MAX) each probe has its share, merged from all its lights. */
GN_MUST_USE int gn_render_lights_from_blend(const struct gn_blend *blend, int limit,
                                            struct light_merge *merge, struct light_list *list,
                                            struct placed_lights *placed);
/** The light that u in [0, 1) chooses by luminance, where cdf is filled and some light is lit. */
int gn_render_lights_choose(const struct light_list *list, double u);
/** Sets the weights of samples that see a surface. */
void gn_render_weigh_probes(const struct frame *frame, struct sample *samples, int n);

/* packet.c: rays into packets of 16 */

/** Adds a ray of that length (INFINITY: to a distant light); true where the packet is now full and
 * must be flushed by the caller. */
bool gn_packet_add(struct scratch *scratch, const float org[static 3], const float dir[static 3],
                   int sample, int light, float weight, float length);
/** Traces what the packet holds and empties it; bit i: lane i is hidden. *out_n: lanes. */
uint32_t gn_packet_trace(const struct frame *frame, struct scratch *scratch, enum gn_rt_set set,
                         int *out_n, uint64_t *rays);

/** True unless the ray surely misses the box. */
bool gn_box_may_meet(const struct box *box, const float org[static 3], const float dir[static 3]);
/** True unless all rays of direction dir from points of `from` surely miss `box`. */
bool gn_box_may_meet_from_box(const struct box *box, const struct box *from,
                              const float dir[static 3]);

static inline float dot3(const float a[static 3], const float b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void gn_render_lights_get_dir(const struct light_list *lights, int l,
                                            float out_dir[static 3])
{
    for (int k = 0; k < 3; k++)
        out_dir[k] = lights->dir[k][l];
}

/** As fminf and fmaxf, which are calls. */
static inline void grow_box(struct box *box, const float p[static 3])
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = p[k] < box->min[k] ? p[k] : box->min[k];
        box->max[k] = p[k] > box->max[k] ? p[k] : box->max[k];
    }
}

/** Which probe's light l is. */
static inline int get_probe(const struct light_list *lights, int l)
{
    int probe = 0;
    while (l >= lights->ends[probe])
        probe++;
    return probe;
}

/** Cosine by which light from dir reaches the surface; 0 where it comes from under the horizon. */
static inline float surface_cosine(const struct gn_surface *surface, const float dir[static 3])
{
    float c = dot3(surface->normal_shading, dir);
    return c > 0 && dot3(surface->normal_horizon, dir) > 0 ? c : 0;
}

#endif
