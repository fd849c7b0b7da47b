/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Where triangles are, coarsely, for tests that leave rays out: boxes, clusters of a set's
 * triangles with the edges that bound them, and the objects of it that move.
 */
#ifndef GN_SERVER_RENDER_CLUSTERS_H
#define GN_SERVER_RENDER_CLUSTERS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "server/scene/scene.h"

struct frame;
struct receivers;

/** Boxes that real geometry is put in for conservative tests. */
#define MAX_BLOCKERS 64
/** Clusters of a set's triangles. */
#define MAX_CLUSTERS 64
/** Most triangles of a cluster that keeps its vertices and edges. */
#define CLUSTER_TRIANGLES 64
/** Most outlines of both sets. */
#define MAX_OUTLINES (2 * MAX_CLUSTERS * CLUSTER_TRIANGLES * 3)

/** A box for conservative tests, m; or of directions. */
struct box {
    float min[3], max[3];
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

/** True unless the ray surely misses the box. */
bool gn_box_may_meet(const struct box *box, const float org[static 3], const float dir[static 3]);
/** True unless all rays of direction dir from points of `from` surely miss `box`. */
bool gn_box_may_meet_from_box(const struct box *box, const struct box *from,
                              const float dir[static 3]);

/** As fminf and fmaxf, which are calls. */
static inline void grow_box(struct box *box, const float p[static 3])
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = p[k] < box->min[k] ? p[k] : box->min[k];
        box->max[k] = p[k] > box->max[k] ? p[k] : box->max[k];
    }
}

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

#endif
