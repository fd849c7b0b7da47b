/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/piece_triangle.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "common/pose.h"
#include "common/vec3.h"

void gn_piece_triangle_get_area_vector(const struct gn_piece_triangle *t, double out[static 3])
{
    double u[3];
    double v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = t->corners[1][k] - t->corners[0][k];
        v[k] = t->corners[2][k] - t->corners[0][k];
    }
    gn_vec3_cross(u, v, out);
}

static double get_area(const struct gn_piece_triangle *t)
{
    double n[3];
    gn_piece_triangle_get_area_vector(t, n);
    return 0.5 * sqrt(gn_vec3_dot(n, n));
}

void gn_piece_triangle_read(const struct gn_scene_object *object, int index,
                            struct gn_piece_triangle *out)
{
    // rt keeps the outside where the matrix mirrors, and so do we.
    const double *m = object->world_from_object;
    double det = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                 m[2] * (m[4] * m[9] - m[5] * m[8]);
    double largest = 0;
    double extent = 0;
    memset(out, 0, sizeof(*out));
    for (int i = 0; i < 3; i++) {
        int corner = det < 0 ? 2 - i : i;
        size_t vertex = object->mesh.triangles[3 * (size_t)index + (size_t)corner];
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = object->mesh.positions[3 * vertex + (size_t)k];
        gn_mat4_transform_point(m, p, out->corners[i]);
        for (size_t k = 0; k < 2 && object->mesh.uvs; k++)
            out->uvs[i][k] = object->mesh.uvs[2 * vertex + k];
    }
    for (int i = 0; i < 9; i++) {
        largest = fmax(largest, fabs(out->corners[i / 3][i % 3]));
        extent = fmax(extent, fabs(out->corners[i / 3][i % 3] - out->corners[0][i % 3]));
    }
    out->area = get_area(out);
    out->clearance = 0x1p-23 * (4 * largest + 16 * extent); // gn_rt_offset_origin
}

double gn_piece_triangle_get_share(const double s[static 3], double t)
{
    double a = fmin(s[0], fmin(s[1], s[2]));
    double c = fmax(s[0], fmax(s[1], s[2]));
    double b = fmax(fmin(s[0], s[1]), fmin(fmax(s[0], s[1]), s[2]));
    if (t <= a)
        return 0;
    if (t >= c)
        return 1;
    return t < b ? (t - a) * (t - a) / ((b - a) * (c - a))
                 : 1 - (c - t) * (c - t) / ((c - b) * (c - a));
}

int gn_piece_triangle_clip(const struct gn_piece_triangle *triangle, const double height[static 3],
                           double sign, struct gn_piece_triangle out_triangles[static 2])
{
    struct corner {
        double p[3], uv[2];
    } out[4];
    int n = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        double a = sign * height[i];
        double b = sign * height[j];
        if (a <= 0) {
            memcpy(out[n].p, triangle->corners[i], sizeof(out[n].p));
            memcpy(out[n++].uv, triangle->uvs[i], sizeof(out[n].uv));
        }
        if ((a < 0 && b > 0) || (a > 0 && b < 0)) {
            double share = a / (a - b);
            for (int k = 0; k < 3; k++)
                out[n].p[k] = triangle->corners[i][k] +
                              share * (triangle->corners[j][k] - triangle->corners[i][k]);
            for (int k = 0; k < 2; k++)
                out[n].uv[k] =
                    triangle->uvs[i][k] + share * (triangle->uvs[j][k] - triangle->uvs[i][k]);
            n++;
        }
    }
    for (int i = 1; i + 1 < n; i++) {
        struct gn_piece_triangle t = {.clearance = triangle->clearance};
        const int of[3] = {0, i, i + 1};
        for (int c = 0; c < 3; c++) {
            memcpy(t.corners[c], out[of[c]].p, sizeof(t.corners[c]));
            memcpy(t.uvs[c], out[of[c]].uv, sizeof(t.uvs[c]));
        }
        t.area = get_area(&t);
        out_triangles[i - 1] = t;
    }
    return n > 2 ? n - 2 : 0;
}

/** Nearest point of a segment to p, squared distance. */
static double get_nearest_on_side(const double a[static 3], const double b[static 3],
                                  const double p[static 3], double out[static 3])
{
    double along[3];
    double to[3];
    for (int k = 0; k < 3; k++) {
        along[k] = b[k] - a[k];
        to[k] = p[k] - a[k];
    }
    double length2 = gn_vec3_dot(along, along);
    double t = length2 > 0 ? fmin(fmax(gn_vec3_dot(along, to) / length2, 0), 1) : 0;
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
        out[k] = a[k] + t * along[k];
        distance2 += (out[k] - p[k]) * (out[k] - p[k]);
    }
    return distance2;
}

double gn_piece_triangle_get_nearest(const struct gn_piece_triangle *t, const double p[static 3],
                                     double out[static 3])
{
    const double(*c)[3] = t->corners;
    double n[3];
    double to[3];
    bool is_inside = true;
    gn_piece_triangle_get_area_vector(t, n);
    double scale = gn_vec3_dot(n, n);
    for (int k = 0; k < 3; k++)
        to[k] = p[k] - c[0][k];
    double height = gn_vec3_dot(n, to) / scale;
    for (int k = 0; k < 3; k++)
        out[k] = p[k] - height * n[k];
    for (int i = 0; i < 3; i++) {
        double side[3];
        double from[3];
        double outwards[3];
        for (int k = 0; k < 3; k++) {
            side[k] = c[(i + 1) % 3][k] - c[i][k];
            from[k] = out[k] - c[i][k];
        }
        gn_vec3_cross(side, n, outwards);
        is_inside &= gn_vec3_dot(outwards, from) <= 0;
    }
    double best = is_inside ? height * height * scale : INFINITY;
    for (int i = 0; i < 3 && !is_inside; i++) {
        double q[3];
        double distance2 = get_nearest_on_side(c[i], c[(i + 1) % 3], p, q);
        if (distance2 < best) {
            best = distance2;
            memcpy(out, q, sizeof(q));
        }
    }
    return best;
}
