/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Clusters of triangles: what may stand in a ray's way, coarse enough to ask for every receiver.
 * Each set begins with one cluster for each object; the one with the most triangles is cut in two
 * at the middle of its centroids until there are enough. Those of movable objects are made in mesh
 * coordinates and taken to where the objects stand.
 */
#include "server/render/clusters.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Clusters of fewer triangles are not cut.
#define MIN_TRIANGLES 8

/** A triangle on its way into a cluster. */
struct member {
    int object, triangle;
};

/** Clusters in the making: ranges of members. */
struct build {
    const struct gn_scene *scene;
    const struct movers *movers;
    struct member *members; // of one set, owned
    int n;
    int first[MAX_CLUSTERS], size[MAX_CLUSTERS];
    int mover[MAX_CLUSTERS];     // as cluster.mover
    bool is_whole[MAX_CLUSTERS]; // cannot be cut
    int part[MAX_CLUSTERS];      // the cluster that it was cut from at first
};

/** Corners of a triangle: world, rounded as rt rounds them; of a movable object: mesh coordinates.
 */
static void get_corners(const struct gn_scene *scene, struct member member, float out[3][3])
{
    const struct gn_scene_object *object = &scene->objects[member.object];
    for (int i = 0; i < 3; i++) {
        size_t index = object->mesh.triangles[3 * (size_t)member.triangle + (size_t)i];
        const float *p = object->mesh.positions + 3 * index;
        if (object->is_movable)
            memcpy(out[i], p, sizeof(out[i]));
        else
            gn_movers_get_vertex(object, p, out[i]);
    }
}

static float get_centre(const struct gn_scene *scene, struct member member, int axis)
{
    float p[3][3];
    get_corners(scene, member, p);
    return (p[0][axis] + p[1][axis] + p[2][axis]) / 3;
}

/** Cuts cluster c; the part beyond the middle becomes cluster `other`. False: all centroids are at
 * one place. */
static bool cut(struct build *build, int c, int other)
{
    struct member *members = build->members + build->first[c];
    int n = build->size[c];
    struct box box = EMPTY_BOX;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            float x = get_centre(build->scene, members[i], k);
            box.min[k] = fminf(box.min[k], x);
            box.max[k] = fmaxf(box.max[k], x);
        }
    }
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        if (box.max[k] - box.min[k] > box.max[axis] - box.min[axis])
            axis = k;
    }
    float middle = 0.5f * box.min[axis] + 0.5f * box.max[axis];
    int n_near = 0;
    for (int i = 0; i < n; i++) {
        struct member member = members[i];
        if (!(get_centre(build->scene, member, axis) < middle))
            continue;
        members[i] = members[n_near];
        members[n_near++] = member;
    }
    if (n_near == 0 || n_near == n)
        return false;
    build->size[c] = n_near;
    build->mover[other] = build->mover[c];
    build->first[other] = build->first[c] + n_near;
    build->size[other] = n - n_near;
    build->part[other] = build->part[c];
    return true;
}

/** Members of a set, and one cluster for each object. Returns the number of clusters, or -ENOMEM.
 */
static int gather(struct build *build, enum gn_rt_set role)
{
    const struct gn_scene *scene = build->scene;
    int n_objects = 0;
    int64_t n = 0;
    for (int i = 0; i < scene->n_objects; i++) {
        if (scene->objects[i].role != role)
            continue;
        n_objects++;
        n += scene->objects[i].mesh.n_triangles;
    }
    build->members = malloc((size_t)(n > 0 ? n : 1) * sizeof(*build->members));
    if (!build->members)
        return -ENOMEM;
    // More objects than clusters: neighbours in the list share one.
    int n_clusters = n_objects < MAX_CLUSTERS ? n_objects : MAX_CLUSTERS;
    memset(build->size, 0, sizeof(build->size));
    memset(build->is_whole, 0, sizeof(build->is_whole));
    build->n = 0;
    for (int i = 0, rank = 0; i < scene->n_objects; i++) {
        if (scene->objects[i].role != role)
            continue;
        int c = (int)((int64_t)rank++ * n_clusters / n_objects);
        int mover = gn_movers_find(build->movers, i);
        if (build->size[c] == 0) {
            build->first[c] = build->n;
            build->mover[c] = mover < 0 ? CLUSTER_RESTS : mover;
        } else if (mover >= 0 || build->mover[c] != CLUSTER_RESTS) {
            build->mover[c] = CLUSTER_MIXED;
            build->is_whole[c] = true;
        }
        build->size[c] += scene->objects[i].mesh.n_triangles;
        for (int t = 0; t < scene->objects[i].mesh.n_triangles; t++)
            build->members[build->n++] = (struct member){i, t};
    }
    return n_clusters;
}

/** True where the cluster is of one object and lies in one plane, but for rounding. */
static bool is_flat(const struct build *build, int c)
{
    const struct member *members = build->members + build->first[c];
    double origin[3] = {0};
    double n[3] = {0};
    double size = 0; // squared, of the largest triangle so far
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < build->size[c]; i++) {
            float p[3][3];
            double e[2][3];
            if (members[i].object != members[0].object)
                return false;
            get_corners(build->scene, members[i], p);
            for (int j = 0; j < 6; j++)
                e[j / 3][j % 3] = (double)p[1 + j / 3][j % 3] - p[0][j % 3];
            const double cross[3] = {e[0][1] * e[1][2] - e[0][2] * e[1][1],
                                     e[0][2] * e[1][0] - e[0][0] * e[1][2],
                                     e[0][0] * e[1][1] - e[0][1] * e[1][0]};
            double area2 = cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2];
            for (int k = 0; k < 3 && round == 0 && area2 > size; k++) {
                n[k] = cross[k] / sqrt(area2);
                origin[k] = p[0][k];
            }
            size = round == 0 ? fmax(size, area2) : size;
            for (int j = 0; j < 3 && round == 1; j++) {
                double height = 0;
                for (int k = 0; k < 3; k++)
                    height += n[k] * (p[j][k] - origin[k]);
                if (fabs(height) > 1e-6 * sqrt(sqrt(size)))
                    return false;
            }
        }
    }
    return true;
}

static int cut_all(struct build *build, int n_clusters)
{
    while (n_clusters < MAX_CLUSTERS) {
        int largest = -1;
        for (int c = 0; c < n_clusters; c++) {
            if (!build->is_whole[c] && build->size[c] > MIN_TRIANGLES &&
                (largest < 0 || build->size[c] > build->size[largest]))
                largest = c;
        }
        if (largest < 0)
            break;
        if (cut(build, largest, n_clusters))
            n_clusters++;
        else
            build->is_whole[largest] = true;
    }
    return n_clusters;
}

/** Corners of a box in place of the vertices. */
static void set_corners(const struct box *box, float *const vertices[static 3], int first)
{
    for (int corner = 0; corner < 8; corner++) {
        for (int k = 0; k < 3; k++)
            vertices[k][first + corner] = corner >> k & 1 ? box->max[k] : box->min[k];
    }
}

/** Of triangles with holes in them the edges say little. */
static bool has_cutouts(const struct build *build, int c)
{
    for (int i = 0; i < build->size[c]; i++) {
        const struct member *member = &build->members[build->first[c] + i];
        if (gn_mesh_has_cutouts(&build->scene->objects[member->object].mesh))
            return true;
    }
    return false;
}

static void fill_cluster(const struct build *build, int c, struct clusters *out)
{
    struct cluster *cluster = &out->cluster[out->n++];
    bool keeps = build->size[c] <= CLUSTER_TRIANGLES && build->mover[c] != CLUSTER_MIXED &&
                 !has_cutouts(build, c);
    cluster->box = EMPTY_BOX;
    cluster->mover = build->mover[c];
    cluster->first_vertex = out->n_vertices;
    for (int i = 0; i < build->size[c]; i++) {
        struct member member = build->members[build->first[c] + i];
        float p[3][3];
        if (cluster->mover == CLUSTER_MIXED && build->scene->objects[member.object].is_movable)
            continue; // its box is there
        get_corners(build->scene, member, p);
        for (int j = 0; j < 3; j++) {
            gn_box_grow(&cluster->box, p[j]);
            for (int k = 0; k < 3 && keeps; k++)
                out->vertices[k][out->n_vertices + j] = p[j][k];
        }
        out->n_vertices += keeps ? 3 : 0;
    }
    if (!keeps) {
        set_corners(&cluster->box, out->vertices, out->n_vertices);
        out->n_vertices += 8;
    }
    cluster->has_edges = keeps;
    cluster->is_flat = out->is_flat[build->part[c]];
    cluster->n_vertices = out->n_vertices - cluster->first_vertex;
}

/** Lists the vertices, those at one place once; of a box, which may move, all. */
static void list_corners(struct clusters *clusters)
{
    int n = 0;
    for (int c = 0; c < clusters->n; c++) {
        struct cluster *cluster = &clusters->cluster[c];
        cluster->first_corner = n;
        for (int v = cluster->first_vertex; v < cluster->first_vertex + cluster->n_vertices; v++) {
            bool is_new = true;
            for (int i = cluster->first_corner; i < n && is_new && cluster->has_edges; i++) {
                int other = clusters->corners[i];
                is_new = false;
                for (int k = 0; k < 3; k++)
                    is_new |= clusters->vertices[k][v] != clusters->vertices[k][other];
            }
            if (is_new)
                clusters->corners[n++] = (uint16_t)v;
        }
        cluster->n_corners = n - cluster->first_corner;
    }
}

static int reserve_vertices(float *vertices[static 3])
{
    for (int k = 0; k < 3; k++) {
        vertices[k] = malloc(MAX_CLUSTERS * 3 * CLUSTER_TRIANGLES * sizeof(float));
        if (!vertices[k])
            return -ENOMEM;
    }
    return 0;
}

/** Keeps what movers' clusters are made of, and takes them to where they stand. */
static int set_in_motion(const struct build *build, struct clusters *clusters)
{
    if (clusters->movers.n == 0)
        return 0;
    if (reserve_vertices(clusters->own_vertices) < 0)
        return -ENOMEM;
    for (int k = 0; k < 3; k++)
        memcpy(clusters->own_vertices[k], clusters->vertices[k],
               (size_t)clusters->n_vertices * sizeof(float));
    for (int c = 0; c < clusters->n; c++) {
        if (clusters->cluster[c].mover != CLUSTER_MIXED)
            continue;
        clusters->movers.resting[c] = clusters->cluster[c].box;
        const struct member *members = build->members + build->first[c];
        for (int i = 0; i < build->size[c]; i++) {
            if (i > 0 && members[i].object == members[i - 1].object)
                continue;
            int mover = gn_movers_find(&clusters->movers, members[i].object);
            if (mover >= 0)
                clusters->movers.mover[mover].group = c;
        }
    }
    gn_clusters_pose(clusters, build->scene);
    return 0;
}

int gn_clusters_make(const struct gn_scene *scene, enum gn_rt_set role, struct clusters *out)
{
    struct build *build = calloc(1, sizeof(*build));
    memset(out, 0, sizeof(*out));
    int ret = build ? gn_movers_make(scene, role, &out->movers) : -ENOMEM;
    if (ret < 0)
        goto out;
    out->role = role;
    build->scene = scene;
    build->movers = &out->movers;
    ret = gather(build, role);
    if (ret < 0)
        goto out;
    for (int c = 0; c < ret; c++) {
        build->part[c] = c;
        out->is_flat[c] = is_flat(build, c);
    }
    int n_clusters = cut_all(build, ret);
    ret = reserve_vertices(out->vertices);
    for (int c = 0; c < n_clusters && ret == 0; c++)
        fill_cluster(build, c, out);
    out->corners = malloc(MAX_CLUSTERS * 3 * CLUSTER_TRIANGLES * sizeof(*out->corners));
    if (!out->corners)
        ret = -ENOMEM;
    if (ret == 0)
        list_corners(out);
    if (ret == 0)
        ret = gn_edges_make(out);
    if (ret == 0)
        ret = set_in_motion(build, out);
out:
    if (ret < 0)
        gn_clusters_finish(out);
    if (build)
        free(build->members);
    free(build);
    return ret;
}

void gn_clusters_finish(struct clusters *clusters)
{
    for (int k = 0; k < 3; k++) {
        free(clusters->vertices[k]);
        free(clusters->own_vertices[k]);
    }
    free(clusters->corners);
    free(clusters->edges);
    gn_movers_finish(&clusters->movers);
    memset(clusters, 0, sizeof(*clusters));
}

/** A mover's cluster to where its object stands. */
static void pose_cluster(struct clusters *clusters, struct cluster *cluster,
                         const struct gn_scene_object *object)
{
    cluster->box = EMPTY_BOX;
    for (int i = cluster->first_vertex; i < cluster->first_vertex + cluster->n_vertices; i++) {
        const float own[3] = {clusters->own_vertices[0][i], clusters->own_vertices[1][i],
                              clusters->own_vertices[2][i]};
        float p[3];
        gn_movers_get_vertex(object, own, p);
        gn_box_grow(&cluster->box, p);
        for (int k = 0; k < 3; k++)
            clusters->vertices[k][i] = p[k];
    }
}

void gn_clusters_pose(struct clusters *clusters, const struct gn_scene *scene)
{
    const struct movers *movers = &clusters->movers;
    if (movers->n == 0)
        return;
    for (int c = 0; c < clusters->n; c++) {
        struct cluster *cluster = &clusters->cluster[c];
        if (cluster->mover == CLUSTER_MIXED) {
            cluster->box = movers->resting[c];
        } else if (cluster->mover >= 0) {
            const struct mover *mover = &movers->mover[cluster->mover];
            struct box box = EMPTY_BOX;
            cluster->slack = gn_movers_grow_box(mover, scene, &box);
            pose_cluster(clusters, cluster, &scene->objects[mover->object]);
        }
    }
    for (int i = 0; i < movers->n; i++) {
        int group = movers->mover[i].group;
        if (group >= 0) // the slack is in the box
            (void)gn_movers_grow_box(&movers->mover[i], scene, &clusters->cluster[group].box);
    }
    for (int c = 0; c < clusters->n; c++) {
        if (clusters->cluster[c].mover == CLUSTER_MIXED)
            set_corners(&clusters->cluster[c].box, clusters->vertices,
                        clusters->cluster[c].first_vertex);
    }
}

/** True where the whole cluster lies in or under the plane through org across n. */
static bool is_under(const struct clusters *clusters, const struct cluster *cluster,
                     const float org[static 3], const float n[static 3])
{
    const uint16_t *corners = clusters->corners + cluster->first_corner;
    for (int i = 0; i < cluster->n_corners; i++) {
        int v = corners[i];
        double height = (double)n[0] * ((double)clusters->vertices[0][v] - org[0]) +
                        (double)n[1] * ((double)clusters->vertices[1][v] - org[1]) +
                        (double)n[2] * ((double)clusters->vertices[2][v] - org[2]);
        if (height > -(double)cluster->slack)
            return false;
    }
    return true;
}

int gn_clusters_list_above(const struct clusters *clusters, const float org[static 3],
                           const float normal[static 3], float margin, int n,
                           struct seen_cluster *out, struct outline *outlines)
{
    int n_outlines = n > 0 ? out[n - 1].first_outline + out[n - 1].n_outlines : 0;
    for (int c = 0; c < clusters->n; c++) {
        const struct cluster *cluster = &clusters->cluster[c];
        if (is_under(clusters, cluster, org, normal))
            continue;
        struct seen_cluster *seen = &out[n++];
        for (int k = 0; k < 3; k++) {
            seen->box.min[k] = cluster->box.min[k] - org[k] - margin;
            seen->box.max[k] = cluster->box.max[k] - org[k] + margin;
        }
        seen->has_outlines = cluster->has_edges;
        seen->first_outline = n_outlines;
        seen->n_outlines =
            gn_edges_list_outlines(clusters, cluster, org, margin, outlines + n_outlines);
        n_outlines += seen->n_outlines;
    }
    return n;
}
