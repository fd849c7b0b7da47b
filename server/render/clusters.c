/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Clusters of triangles: what may stand in a ray's way, coarse enough to ask for every receiver.
 * Each set begins with one cluster for each object; the one with the most triangles is cut in two
 * at the middle of its centroids until there are enough.
 */
#include "server/render/internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Clusters of fewer triangles are not cut.
#define MIN_TRIANGLES 8

static const struct box empty_box = {{INFINITY, INFINITY, INFINITY},
                                     {-INFINITY, -INFINITY, -INFINITY}};

/** A triangle on its way into a cluster. */
struct member {
    int object, triangle;
};

/** Clusters in the making: ranges of members. */
struct build {
    const struct gn_scene *scene;
    struct member *members; // of one set, owned
    int n;
    int first[MAX_CLUSTERS], size[MAX_CLUSTERS];
    bool is_whole[MAX_CLUSTERS]; // cannot be cut
    int part[MAX_CLUSTERS];      // the cluster that it was cut from at first
};

/** World corners of a triangle, rounded as rt rounds them. */
static void get_corners(const struct gn_scene *scene, struct member member, float out[3][3])
{
    const struct gn_scene_object *object = &scene->objects[member.object];
    const double *m = object->world_from_object;
    for (int i = 0; i < 3; i++) {
        size_t index = object->mesh.triangles[3 * (size_t)member.triangle + (size_t)i];
        const float *p = object->mesh.positions + 3 * index;
        for (int k = 0; k < 3; k++) {
            const double *row = m + 4 * k;
            out[i][k] = (float)(row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]);
        }
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
    struct box box = empty_box;
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
        if (build->size[c] == 0)
            build->first[c] = build->n;
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
static void keep_box(const struct box *box, struct clusters *out)
{
    for (int corner = 0; corner < 8; corner++) {
        for (int k = 0; k < 3; k++)
            out->vertices[k][out->n_vertices] = corner >> k & 1 ? box->max[k] : box->min[k];
        out->n_vertices++;
    }
}

static void fill_cluster(const struct build *build, int c, struct clusters *out)
{
    struct cluster *cluster = &out->cluster[out->n++];
    cluster->box = empty_box;
    cluster->first_vertex = out->n_vertices;
    bool keeps = build->size[c] <= CLUSTER_TRIANGLES;
    for (int i = 0; i < build->size[c]; i++) {
        float p[3][3];
        get_corners(build->scene, build->members[build->first[c] + i], p);
        for (int j = 0; j < 9; j++) {
            float x = p[j / 3][j % 3];
            cluster->box.min[j % 3] = fminf(cluster->box.min[j % 3], x);
            cluster->box.max[j % 3] = fmaxf(cluster->box.max[j % 3], x);
            if (keeps)
                out->vertices[j % 3][out->n_vertices + j / 3] = x;
        }
        out->n_vertices += keeps ? 3 : 0;
    }
    if (!keeps)
        keep_box(&cluster->box, out);
    cluster->has_edges = keeps;
    cluster->is_flat = out->is_flat[build->part[c]];
    cluster->n_vertices = out->n_vertices - cluster->first_vertex;
}

int gn_clusters_make(const struct gn_scene *scene, enum gn_rt_set role, struct clusters *out)
{
    struct build *build = calloc(1, sizeof(*build));
    int ret = -ENOMEM;
    memset(out, 0, sizeof(*out));
    if (!build)
        goto out;
    out->role = role;
    build->scene = scene;
    ret = gather(build, role);
    if (ret < 0)
        goto out;
    for (int c = 0; c < ret; c++) {
        build->part[c] = c;
        out->is_flat[c] = is_flat(build, c);
    }
    int n_clusters = cut_all(build, ret);
    for (int k = 0; k < 3; k++) {
        out->vertices[k] = malloc(MAX_CLUSTERS * 3 * CLUSTER_TRIANGLES * sizeof(float));
        if (!out->vertices[k]) {
            gn_clusters_finish(out);
            ret = -ENOMEM;
            goto out;
        }
    }
    for (int c = 0; c < n_clusters; c++)
        fill_cluster(build, c, out);
    ret = gn_edges_make(out);
    if (ret < 0)
        gn_clusters_finish(out);
out:
    if (build)
        free(build->members);
    free(build);
    return ret;
}

void gn_clusters_finish(struct clusters *clusters)
{
    for (int k = 0; k < 3; k++)
        free(clusters->vertices[k]);
    free(clusters->edges);
    memset(clusters, 0, sizeof(*clusters));
}

/** True where the whole cluster lies in or under the plane through org across n. */
static bool is_under(const struct clusters *clusters, const struct cluster *cluster,
                     const float org[static 3], const float n[static 3])
{
    const float *x = clusters->vertices[0] + cluster->first_vertex;
    const float *y = clusters->vertices[1] + cluster->first_vertex;
    const float *z = clusters->vertices[2] + cluster->first_vertex;
    for (int i = 0; i < cluster->n_vertices; i++) {
        double height = (double)n[0] * ((double)x[i] - org[0]) +
                        (double)n[1] * ((double)y[i] - org[1]) +
                        (double)n[2] * ((double)z[i] - org[2]);
        if (height > 0)
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
