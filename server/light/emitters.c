/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/emitters.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/emitters_internal.h"
#include "server/light/luminance.h"
#include "server/light/picture_mean.h"
#include "server/light/pieces.h"
#include "server/scene/emission.h"

/** Largest value of a picture, and of an intensity: neither overflows what follows. */
#define MAX_VALUE 1e12f
#define MAX_INTENSITY 1e30

struct gn_emitters {
    const struct gn_scene *scene; // borrowed
    struct gn_pieces pieces;
    int n_streams;
    const char **streams;         // [n_streams], each an object's name
    int *stream_of;               // [n_objects], -1: none
    struct gn_emission *emission; // what they send now; NULL where there is no near light
};

/** One triangle's radiance, and where it comes from. */
struct sent {
    double rgb[3];
    double point[3];
};

static float to_intensity(double value)
{
    return (float)fmin(value, MAX_INTENSITY);
}

static void fill_lamp(const struct gn_scene_light *lamp, int index, struct gn_near_light *out)
{
    *out = (struct gn_near_light){.radius = lamp->radius,
                                  .role = lamp->role,
                                  .object = GN_NEAR_NO_OBJECT,
                                  .id = (uint64_t)index + 1};
    for (int k = 0; k < 3; k++) {
        out->position_world[k] = (float)lamp->position[k];
        out->intensity[k] = lamp->intensity[k];
    }
}

/** The light of a piece whose triangles send so. */
static void fill_piece(const struct gn_emitters *e, const struct gn_piece *piece,
                       const struct sent *sent, struct gn_near_light *out)
{
    double power[3] = {0};
    double centroid[3] = {0};
    double weights = 0;
    double middle[3] = {0};
    for (int i = 0; i < piece->n; i++) {
        const struct gn_piece_triangle *t = &e->pieces.triangles[piece->first + i];
        const float rgb[3] = {(float)sent[i].rgb[0], (float)sent[i].rgb[1], (float)sent[i].rgb[2]};
        double weight = gn_luminance(rgb) * t->area;
        for (int k = 0; k < 3; k++) {
            power[k] += sent[i].rgb[k] * t->area;
            centroid[k] += weight * sent[i].point[k];
            middle[k] += t->area / piece->area * sent[i].point[k];
        }
        weights += weight;
    }
    for (int k = 0; k < 3 && weights > 0; k++)
        middle[k] = centroid[k] / weights;
    double position[3];
    gn_piece_get_nearest(&e->pieces, piece, middle, position);
    *out = (struct gn_near_light){.radius = (float)sqrt(piece->area / M_PI),
                                  .role = e->scene->objects[piece->object].role,
                                  .object = piece->object,
                                  .id = ((uint64_t)piece->object + 1) << 32 |
                                        ((uint64_t)piece->rank + 1)};
    for (int k = 0; k < 3; k++) {
        out->position_world[k] = (float)position[k];
        out->normal_world[k] = (float)piece->normal[k];
        out->intensity[k] = to_intensity(power[k]);
    }
}

/** A point of the triangle by its uv; its centroid where the uvs span nothing. */
static void get_point(const struct gn_piece_triangle *t, const double uv[static 2],
                      double out[static 3])
{
    double w[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    double a[2];
    double b[2];
    double c[2];
    for (int k = 0; k < 2; k++) {
        a[k] = t->uvs[1][k] - t->uvs[0][k];
        b[k] = t->uvs[2][k] - t->uvs[0][k];
        c[k] = uv[k] - t->uvs[0][k];
    }
    double det = a[0] * b[1] - a[1] * b[0];
    if (fabs(det) > 1e-24) {
        w[1] = fmin(fmax((c[0] * b[1] - c[1] * b[0]) / det, 0), 1);
        w[2] = fmin(fmax((a[0] * c[1] - a[1] * c[0]) / det, 0), 1 - w[1]);
        w[0] = 1 - w[1] - w[2];
    }
    for (int k = 0; k < 3; k++)
        out[k] = w[0] * t->corners[0][k] + w[1] * t->corners[1][k] + w[2] * t->corners[2][k];
}

/** What triangles [first, first + n) of an object send, with a picture (may be NULL). */
static int get_sent(const struct gn_emitters *e, uint32_t object_index, int first, int n,
                    const struct gn_image *picture, struct sent *out)
{
    const struct gn_scene_object *object = &e->scene->objects[object_index];
    const struct gn_piece_triangle *triangles = e->pieces.triangles + first;
    if (!picture) {
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < 3; k++) {
                out[i].rgb[k] = object->emission[k];
                out[i].point[k] = (triangles[i].corners[0][k] + triangles[i].corners[1][k] +
                                   triangles[i].corners[2][k]) /
                                  3;
            }
        }
        return 0;
    }
    struct gn_picture_triangle *laid = calloc((size_t)n + 1, sizeof(*laid));
    struct gn_picture_mean *means = malloc(((size_t)n + 1) * sizeof(*means));
    int ret = laid && means ? 0 : -ENOMEM;
    for (int i = 0; i < n && ret == 0; i++)
        memcpy(laid[i].uvs, triangles[i].uvs, sizeof(laid[i].uvs));
    if (ret == 0)
        ret = gn_picture_get_means(picture, laid, n, means);
    for (int i = 0; i < n && ret == 0; i++) {
        for (int k = 0; k < 3; k++)
            out[i].rgb[k] = (double)object->emission_scale * means[i].rgb[k];
        get_point(&triangles[i], means[i].centroid_uv, out[i].point);
    }
    free(laid);
    free(means);
    return ret;
}

/** Fills the lights of all pieces of an object. 0 or -ENOMEM. */
static int fill_object(const struct gn_emitters *e, uint32_t object, const struct gn_image *picture,
                       struct gn_near_light *lights)
{
    int first = 0;
    while (first < e->pieces.n && e->pieces.pieces[first].object != object)
        first++;
    int n = 0;
    int n_triangles = 0;
    for (; first + n < e->pieces.n && e->pieces.pieces[first + n].object == object; n++)
        n_triangles += e->pieces.pieces[first + n].n;
    if (n == 0)
        return 0;
    struct sent *sent = malloc((size_t)n_triangles * sizeof(*sent));
    int start = e->pieces.pieces[first].first;
    int ret = sent ? get_sent(e, object, start, n_triangles, picture, sent) : -ENOMEM;
    for (int i = first; i < first + n && ret == 0; i++)
        fill_piece(e, &e->pieces.pieces[i], sent + (e->pieces.pieces[i].first - start),
                   &lights[e->scene->n_lights + i]);
    free(sent);
    return ret;
}

/** A copy of what is sent now, or an emission of nothing yet; one reference. */
static struct gn_emission *create_emission(const struct gn_emitters *e)
{
    struct gn_emission *out = calloc(1, sizeof(*out));
    if (!out)
        return NULL;
    atomic_init(&out->references, 1);
    out->n_lights = e->scene->n_lights + e->pieces.n;
    out->n_objects = e->scene->n_objects;
    out->lights = calloc((size_t)out->n_lights, sizeof(*out->lights));
    out->pictures = calloc((size_t)out->n_objects, sizeof(struct gn_emission_picture *));
    if (!out->lights || !out->pictures) {
        gn_emission_unref(&out);
        return NULL;
    }
    if (!e->emission)
        return out;
    memcpy(out->lights, e->emission->lights, (size_t)out->n_lights * sizeof(*out->lights));
    for (int i = 0; i < out->n_objects; i++) {
        out->pictures[i] = e->emission->pictures[i];
        if (out->pictures[i])
            atomic_fetch_add_explicit(&out->pictures[i]->references, 1, memory_order_relaxed);
    }
    return out;
}

static int list_streams(struct gn_emitters *e)
{
    const struct gn_scene *scene = e->scene;
    e->streams = calloc((size_t)scene->n_objects + 1, sizeof(*e->streams));
    e->stream_of = malloc(((size_t)scene->n_objects + 1) * sizeof(*e->stream_of));
    if (!e->streams || !e->stream_of)
        return -ENOMEM;
    for (int i = 0; i < scene->n_objects; i++) {
        const char *name = scene->objects[i].emission_stream;
        e->stream_of[i] = name ? gn_emitters_find_stream(e, name) : -1;
        if (!name || e->stream_of[i] >= 0)
            continue;
        e->stream_of[i] = e->n_streams;
        e->streams[e->n_streams++] = name;
    }
    return 0;
}

static int make_first_emission(struct gn_emitters *e)
{
    if (e->scene->n_lights + e->pieces.n == 0)
        return 0;
    struct gn_emission *emission = create_emission(e);
    if (!emission)
        return -ENOMEM;
    for (int i = 0; i < e->scene->n_lights; i++)
        fill_lamp(&e->scene->lights[i], i, &emission->lights[i]);
    int ret = 0;
    for (int i = 0; i < e->scene->n_objects && ret == 0; i++) {
        if (gn_scene_is_emitter(&e->scene->objects[i]))
            ret = fill_object(e, (uint32_t)i, NULL, emission->lights);
    }
    if (ret < 0)
        gn_emission_unref(&emission);
    e->emission = emission;
    return ret;
}

int gn_emitters_create(const struct gn_scene *scene, const struct gn_emitter_options *options,
                       struct gn_emitters **out_emitters, struct gn_error *out_error)
{
    int n_pieces = options && options->n_pieces ? options->n_pieces : GN_EMITTER_PIECES_DEFAULT;
    *out_emitters = NULL;
    if (n_pieces < 1 || n_pieces > GN_NEAR_LIGHTS_MAX)
        return gn_error_set(out_error, -EINVAL, "%d pieces of emissive meshes; 1 to %d are right",
                            n_pieces, GN_NEAR_LIGHTS_MAX);
    if (n_pieces > GN_NEAR_LIGHTS_MAX - scene->n_lights)
        n_pieces = GN_NEAR_LIGHTS_MAX - scene->n_lights;
    struct gn_emitters *e = calloc(1, sizeof(*e));
    if (!e)
        return gn_error_set(out_error, -ENOMEM, "near light: out of memory");
    e->scene = scene;
    int ret = gn_pieces_make(scene, n_pieces, &e->pieces, out_error);
    if (ret == 0 && ((ret = list_streams(e)) < 0 || (ret = make_first_emission(e)) < 0))
        (void)gn_error_set(out_error, ret, "near light: out of memory");
    if (ret < 0)
        gn_emitters_destroy(&e);
    *out_emitters = e;
    return ret;
}

void gn_emitters_destroy(struct gn_emitters **emitters)
{
    struct gn_emitters *e = *emitters;
    *emitters = NULL;
    if (!e)
        return;
    gn_emission_unref(&e->emission);
    gn_pieces_finish(&e->pieces);
    free(e->streams);
    free(e->stream_of);
    free(e);
}

int gn_emitters_get_stream_count(const struct gn_emitters *emitters)
{
    return emitters->n_streams;
}

const char *gn_emitters_get_stream_name(const struct gn_emitters *emitters, int stream)
{
    return stream >= 0 && stream < emitters->n_streams ? emitters->streams[stream] : NULL;
}

int gn_emitters_find_stream(const struct gn_emitters *emitters, const char *name)
{
    for (int i = 0; i < emitters->n_streams; i++) {
        if (strcmp(emitters->streams[i], name) == 0)
            return i;
    }
    return -ENOENT;
}

/** Copies and mends; one reference. */
static struct gn_emission_picture *create_picture(const struct gn_image *from)
{
    struct gn_emission_picture *picture = calloc(1, sizeof(*picture));
    if (!picture)
        return NULL;
    if (gn_image_init(&picture->image, from->width, from->height, 3) < 0) {
        free(picture);
        return NULL;
    }
    atomic_init(&picture->references, 1);
    size_t n = 3 * (size_t)from->width * (size_t)from->height;
    for (size_t i = 0; i < n; i++) {
        float value = from->data[i];
        picture->image.data[i] = !(value > 0) ? 0 : value > MAX_VALUE ? MAX_VALUE : value;
    }
    return picture;
}

int gn_emitters_set_picture(struct gn_emitters *emitters, int stream,
                            const struct gn_image *linear_rgb, struct gn_error *out_error)
{
    struct gn_emission_picture *picture = NULL;
    if (stream < 0 || stream >= emitters->n_streams)
        return gn_error_set(out_error, -EINVAL, "stream %d: the scene has %d", stream,
                            emitters->n_streams);
    if (linear_rgb && (linear_rgb->channels != 3 || linear_rgb->width < 1 ||
                       linear_rgb->height < 1 || !linear_rgb->data))
        return gn_error_set(
            out_error, -EINVAL, "stream %s: a picture of %d x %d with %d channels; 3 are right",
            emitters->streams[stream], linear_rgb->width, linear_rgb->height, linear_rgb->channels);
    if (!emitters->emission) // every mesh is too small to send anything
        return 0;
    struct gn_emission *next = create_emission(emitters);
    int ret = next ? 0 : -ENOMEM;
    if (ret == 0 && linear_rgb && !(picture = create_picture(linear_rgb)))
        ret = -ENOMEM;
    for (int i = 0; i < emitters->scene->n_objects && ret == 0; i++) {
        if (emitters->stream_of[i] != stream)
            continue;
        gn_emission_picture_unref(&next->pictures[i]);
        if (picture) {
            atomic_fetch_add_explicit(&picture->references, 1, memory_order_relaxed);
            next->pictures[i] = picture;
        }
        ret = fill_object(emitters, (uint32_t)i, picture ? &picture->image : NULL, next->lights);
    }
    gn_emission_picture_unref(&picture);
    if (ret < 0) {
        gn_emission_unref(&next);
        return gn_error_set(out_error, ret, "stream %s: out of memory", emitters->streams[stream]);
    }
    gn_emission_unref(&emitters->emission);
    emitters->emission = next;
    return 0;
}

int gn_emitters_take_pictures(struct gn_emitters *emitters, const struct gn_emission *from)
{
    bool is_same = true;
    if (!emitters->emission)
        return 0;
    for (int i = 0; i < from->n_objects; i++)
        is_same &= from->pictures[i] == emitters->emission->pictures[i];
    if (is_same)
        return 0;
    struct gn_emission *next = create_emission(emitters);
    int ret = next ? 0 : -ENOMEM;
    for (int i = 0; i < from->n_objects && ret == 0; i++) {
        struct gn_emission_picture *picture = from->pictures[i];
        if (picture == next->pictures[i])
            continue;
        gn_emission_picture_unref(&next->pictures[i]);
        next->pictures[i] = picture;
        if (picture)
            atomic_fetch_add_explicit(&picture->references, 1, memory_order_relaxed);
        ret = fill_object(emitters, (uint32_t)i, picture ? &picture->image : NULL, next->lights);
    }
    if (ret < 0) {
        gn_emission_unref(&next);
        return ret;
    }
    gn_emission_unref(&emitters->emission);
    emitters->emission = next;
    return 0;
}

const struct gn_pieces *gn_emitters_get_pieces(const struct gn_emitters *emitters)
{
    return &emitters->pieces;
}

struct gn_emission *gn_emitters_get_emission(const struct gn_emitters *emitters)
{
    return emitters->emission ? gn_emission_ref(emitters->emission) : NULL;
}
