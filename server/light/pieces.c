/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/pieces.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/vec3.h"
#include "server/light/emitters.h"
#include "server/light/luminance.h"
#include "server/light/piece_triangle.h"
#include "server/scene/emission.h"

/** Ways that triangles are sorted by. */
#define WAYS 6
/** Halvings of the interval in which the median lies: 2^-32 of the extent. */
#define MEDIAN_STEPS 32

/** A piece in the making. */
struct part {
    uint32_t object;
    int n, capacity;
    struct gn_piece_triangle *triangles; // owned
    double area;
    double worth;        // which one is cut next
    const double *frame; // [3][3], of its object
    double radiance;     // luminance
};

struct build {
    const struct gn_scene *scene;
    int n, capacity;
    struct part *parts;  // owned
    double (*frames)[9]; // [n_objects] rows: directions to cut across
};

static bool add_triangle(struct part *part, const struct gn_piece_triangle *triangle)
{
    if (!(triangle->area > 0) || !isfinite(triangle->area))
        return true;
    if (part->n == part->capacity) {
        int capacity = part->capacity ? 2 * part->capacity : 4;
        void *more = realloc(part->triangles, (size_t)capacity * sizeof(*part->triangles));
        if (!more)
            return false;
        part->triangles = more;
        part->capacity = capacity;
    }
    part->triangles[part->n++] = *triangle;
    part->area += triangle->area;
    return true;
}

/** Directions to cut across: the middle side of the largest triangle (a rectangle's longer side),
 * the one across it, the normal. */
static void make_frame(const struct gn_piece_triangle *t, double out[static 9])
{
    double sides[3][3];
    double length[3];
    double normal[3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            sides[i][k] = t->corners[(i + 1) % 3][k] - t->corners[i][k];
        length[i] = sqrt(gn_vec3_dot(sides[i], sides[i]));
    }
    int middle = 0;
    for (int i = 0; i < 3; i++) {
        double a = length[(i + 1) % 3];
        double b = length[(i + 2) % 3];
        if (length[i] >= fmin(a, b) && length[i] <= fmax(a, b)) {
            middle = i;
            break;
        }
    }
    gn_piece_triangle_get_area_vector(t, normal);
    double scale = sqrt(gn_vec3_dot(normal, normal));
    for (int k = 0; k < 3; k++) {
        out[k] = sides[middle][k] / length[middle];
        out[6 + k] = normal[k] / scale;
    }
    gn_vec3_cross(out + 6, out, out + 3);
}

/** Which of the frame's six directions it faces. */
static int get_way(const struct gn_piece_triangle *t, const double frame[static 9])
{
    double normal[3];
    int way = 0;
    double best = -1;
    gn_piece_triangle_get_area_vector(t, normal);
    for (int i = 2; i >= 0; i--) { // the largest triangle's own direction first
        double c = gn_vec3_dot(normal, frame + 3 * i);
        if (fabs(c) > best) {
            best = fabs(c);
            way = 2 * i + (c < 0);
        }
    }
    return way;
}

static struct part *add_part(struct build *build, const struct part *like)
{
    struct part *part = &build->parts[build->n++];
    *part = (struct part){.object = like->object, .frame = like->frame, .radiance = like->radiance};
    return part;
}

static void weigh(struct part *part)
{
    part->worth = part->radiance * part->area * part->area;
}

/** Luminance for the choice of cuts; a stream's picture is taken for a middle grey. */
static double guess_radiance(const struct gn_scene_object *object)
{
    double own = gn_luminance(object->emission);
    return object->emission_stream ? fmax(own, 0.2 * (double)object->emission_scale) : own;
}

/** One part for each way that the object's triangles face. */
static int add_object(struct build *build, uint32_t index, struct gn_error *out_error)
{
    const struct gn_scene_object *object = &build->scene->objects[index];
    struct part ways[WAYS];
    struct gn_piece_triangle triangle;
    struct gn_piece_triangle largest = {.area = 0};
    const struct part like = {
        .object = index, .frame = build->frames[index], .radiance = guess_radiance(object)};
    int ret = 0;
    memset(ways, 0, sizeof(ways));
    for (int i = 0; i < object->mesh.n_triangles; i++) {
        gn_piece_triangle_read(object, i, &triangle);
        if (triangle.area > largest.area && isfinite(triangle.area))
            largest = triangle;
    }
    if (!(largest.area > 0))
        return 0; // its world size rounds to nothing
    make_frame(&largest, build->frames[index]);
    for (int i = 0; i < object->mesh.n_triangles && ret == 0; i++) {
        gn_piece_triangle_read(object, i, &triangle);
        if (!add_triangle(&ways[get_way(&triangle, build->frames[index])], &triangle))
            ret = gn_error_set(out_error, -ENOMEM, "near light: out of memory");
    }
    for (int i = 0; i < WAYS; i++) {
        if (ret < 0 || ways[i].n == 0) {
            free(ways[i].triangles);
            continue;
        }
        struct part *part = add_part(build, &like);
        part->n = ways[i].n;
        part->capacity = ways[i].capacity;
        part->triangles = ways[i].triangles;
        part->area = ways[i].area;
        weigh(part);
    }
    return ret;
}

/** The plane that halves the part's area. */
static double find_median(const struct part *part, const double axis[static 3], double lo,
                          double hi)
{
    for (int step = 0; step < MEDIAN_STEPS; step++) {
        double t = 0.5 * (lo + hi);
        double below = 0;
        for (int i = 0; i < part->n; i++) {
            double s[3];
            for (int c = 0; c < 3; c++)
                s[c] = gn_vec3_dot(part->triangles[i].corners[c], axis);
            below += part->triangles[i].area * gn_piece_triangle_get_share(s, t);
        }
        if (below < 0.5 * part->area)
            lo = t;
        else
            hi = t;
    }
    return 0.5 * (lo + hi);
}

/** Appends the triangle's part on one side of the plane. */
static bool add_clipped(struct part *part, const struct gn_piece_triangle *triangle,
                        const double height[static 3], double sign)
{
    struct gn_piece_triangle clipped[2];
    int n = gn_piece_triangle_clip(triangle, height, sign, clipped);
    for (int i = 0; i < n; i++)
        if (!add_triangle(part, &clipped[i]))
            return false;
    return true;
}

static void find_longest(const struct part *part, const double **out_axis, double *out_lo,
                         double *out_hi)
{
    double longest = -1;
    for (int a = 0; a < 3; a++) {
        const double *axis = part->frame + 3 * (size_t)a;
        double lo = INFINITY;
        double hi = -INFINITY;
        for (int i = 0; i < 3 * part->n; i++) {
            double s = gn_vec3_dot(part->triangles[i / 3].corners[i % 3], axis);
            lo = fmin(lo, s);
            hi = fmax(hi, s);
        }
        if (hi - lo <= longest * (1 + 1e-9)) // a square is cut across its first side
            continue;
        longest = hi - lo;
        *out_axis = axis;
        *out_lo = lo;
        *out_hi = hi;
    }
}

/** Cuts a part; the upper half becomes a new one. 0 or -ENOMEM. */
static int cut(struct build *build, int index)
{
    struct part old = build->parts[index];
    const double *axis = NULL;
    double lo = 0;
    double hi = 0;
    struct part halves[2] = {{0}};
    bool ok = true;
    find_longest(&old, &axis, &lo, &hi);
    double t = find_median(&old, axis, lo, hi);
    for (int i = 0; i < old.n && ok; i++) {
        double height[3];
        for (int c = 0; c < 3; c++)
            height[c] = gn_vec3_dot(old.triangles[i].corners[c], axis) - t;
        ok = add_clipped(&halves[0], &old.triangles[i], height, 1) &&
             add_clipped(&halves[1], &old.triangles[i], height, -1);
    }
    if (!ok || halves[0].n == 0 || halves[1].n == 0) {
        free(halves[0].triangles);
        free(halves[1].triangles);
        build->parts[index].worth = 0; // as small as numbers can say
        return ok ? 0 : -ENOMEM;
    }
    free(old.triangles);
    for (int i = 0; i < 2; i++) {
        struct part *part = i == 0 ? &build->parts[index] : add_part(build, &old);
        part->n = halves[i].n;
        part->capacity = halves[i].capacity;
        part->triangles = halves[i].triangles;
        part->area = halves[i].area;
        weigh(part);
    }
    return 0;
}

static int cut_all(struct build *build, int n_wanted)
{
    while (build->n < n_wanted) {
        int best = -1;
        for (int i = 0; i < build->n; i++) {
            if (build->parts[i].worth > 0 &&
                (best < 0 || build->parts[i].worth > build->parts[best].worth))
                best = i;
        }
        if (best < 0)
            return 0;
        int ret = cut(build, best);
        if (ret < 0)
            return ret;
    }
    return 0;
}

static void fill_normal(const struct gn_pieces *pieces, struct gn_piece *piece)
{
    double sum[3] = {0};
    for (int i = 0; i < piece->n; i++) {
        double n[3];
        gn_piece_triangle_get_area_vector(&pieces->triangles[piece->first + i], n);
        for (int k = 0; k < 3; k++)
            sum[k] += n[k];
    }
    double length = sqrt(gn_vec3_dot(sum, sum));
    for (int k = 0; k < 3; k++)
        piece->normal[k] = sum[k] / length;
}

/** Parts to pieces, sorted by object. */
static int keep_parts(const struct build *build, struct gn_pieces *out)
{
    int n_triangles = 0;
    for (int i = 0; i < build->n; i++)
        n_triangles += build->parts[i].n;
    out->pieces = calloc((size_t)build->n + 1, sizeof(*out->pieces));
    out->triangles = malloc(((size_t)n_triangles + 1) * sizeof(*out->triangles));
    if (!out->pieces || !out->triangles)
        return -ENOMEM;
    for (uint32_t object = 0; object < (uint32_t)build->scene->n_objects; object++) {
        int rank = 0;
        for (int i = 0; i < build->n; i++) {
            const struct part *part = &build->parts[i];
            if (part->object != object)
                continue;
            struct gn_piece *piece = &out->pieces[out->n++];
            *piece = (struct gn_piece){.object = object,
                                       .first = out->n_triangles,
                                       .n = part->n,
                                       .rank = rank++,
                                       .area = part->area};
            memcpy(out->triangles + out->n_triangles, part->triangles,
                   (size_t)part->n * sizeof(*part->triangles));
            out->n_triangles += part->n;
            fill_normal(out, piece);
        }
    }
    return 0;
}

int gn_pieces_make(const struct gn_scene *scene, int n_wanted, struct gn_pieces *out_pieces,
                   struct gn_error *out_error)
{
    struct build build = {.scene = scene};
    int n_emitters = 0;
    int ret = 0;
    memset(out_pieces, 0, sizeof(*out_pieces));
    for (int i = 0; i < scene->n_objects; i++)
        n_emitters += gn_scene_is_emitter(&scene->objects[i]);
    if (n_emitters == 0)
        return 0;
    build.capacity = n_wanted > WAYS * n_emitters ? n_wanted : WAYS * n_emitters;
    build.parts = calloc((size_t)build.capacity, sizeof(*build.parts));
    build.frames = calloc((size_t)scene->n_objects, sizeof(*build.frames));
    if (!build.parts || !build.frames)
        ret = gn_error_set(out_error, -ENOMEM, "near light: out of memory");
    for (int i = 0; i < scene->n_objects && ret == 0; i++) {
        if (gn_scene_is_emitter(&scene->objects[i]))
            ret = add_object(&build, (uint32_t)i, out_error);
    }
    if (ret == 0 && (cut_all(&build, n_wanted) < 0 || keep_parts(&build, out_pieces) < 0))
        ret = gn_error_set(out_error, -ENOMEM, "near light: out of memory");
    if (ret < 0)
        gn_pieces_finish(out_pieces);
    for (int i = 0; i < build.n; i++)
        free(build.parts[i].triangles);
    free(build.parts);
    free(build.frames);
    return ret;
}

void gn_pieces_finish(struct gn_pieces *pieces)
{
    free(pieces->pieces);
    free(pieces->triangles);
    memset(pieces, 0, sizeof(*pieces));
}

void gn_piece_get_nearest(const struct gn_pieces *pieces, const struct gn_piece *piece,
                          const double p[static 3], double out_point[static 3])
{
    double best = INFINITY;
    const struct gn_piece_triangle *nearest = &pieces->triangles[piece->first];
    memcpy(out_point, nearest->corners[0], 3 * sizeof(*out_point));
    for (int i = 0; i < piece->n; i++) {
        const struct gn_piece_triangle *t = &pieces->triangles[piece->first + i];
        double q[3];
        double distance2 = gn_piece_triangle_get_nearest(t, p, q);
        if (distance2 < best) {
            best = distance2;
            nearest = t;
            memcpy(out_point, q, sizeof(q));
        }
    }
    double n[3];
    gn_piece_triangle_get_area_vector(nearest, n);
    for (int k = 0; k < 3; k++)
        out_point[k] += nearest->clearance * n[k] / (2 * nearest->area);
}
