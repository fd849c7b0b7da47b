/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/bodies.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/vision/markers.h"
#include "common/json.h"
#include "common/pose.h"

/** Sides of markers, m. */
#define MIN_SIZE 1e-4
#define MAX_SIZE 100.0
/** How far from the body's origin a marker may be, m. */
#define MAX_PLACE 1000.0
#define MAX_ID 100000

/** What a file of bodies is read into, and for which dictionary. */
struct reader {
    struct gn_bodies *bodies;
    int n_ids; // of the dictionary; 0: not known
};

/** The square of that side whose middle is at `middle` in the frame that body_from_frame maps. */
static void place_marker(const struct gn_pose *body_from_frame, const double middle[static 2],
                         double size, int id, struct gn_body_marker *out)
{
    static const double signs[4][2] = {{-1, 1}, {1, 1}, {1, -1}, {-1, -1}};
    out->id = id;
    for (int k = 0; k < 4; k++) {
        const double corner[3] = {middle[0] + signs[k][0] * size / 2,
                                  middle[1] + signs[k][1] * size / 2, 0};
        gn_pose_transform(body_from_frame, corner, out->corners_body[k]);
    }
}

static int add_marker(struct reader *r, const struct gn_json *at,
                      const struct gn_body_marker *marker, struct gn_error *out_error)
{
    int body, other;
    struct gn_body *b = &r->bodies->bodies[r->bodies->n_bodies - 1];
    if (r->n_ids > 0 && marker->id >= r->n_ids)
        return gn_json_refuse(at, NULL, out_error, "the dictionary has ids 0 to %d, not %d",
                              r->n_ids - 1, marker->id);
    if (gn_bodies_find_marker(r->bodies, marker->id, &body, &other))
        return gn_json_refuse(at, NULL, out_error, "marker %d is there twice", marker->id);
    if (b->n_markers == GN_BODY_MAX_MARKERS)
        return gn_json_refuse(at, NULL, out_error, "a body has at most %d markers",
                              GN_BODY_MAX_MARKERS);
    b->markers[b->n_markers++] = *marker;
    return 0;
}

/** Optional position and orientation. */
static int read_place(const struct gn_json *at, struct gn_pose *out, struct gn_error *out_error)
{
    *out = (struct gn_pose){.rotation = {1, 0, 0, 0}};
    int err = 0;
    if (gn_json_has(at, "position"))
        err = gn_json_get_numbers(at, "position", 3, out->translation, out_error);
    if (!err && gn_json_has(at, "orientation"))
        err = gn_json_get_numbers(at, "orientation", 4, out->rotation, out_error);
    if (err)
        return err;
    for (int i = 0; i < 3; i++) {
        if (!(fabs(out->translation[i]) <= MAX_PLACE))
            return gn_json_refuse(at, "position", out_error, "must lie within %g m", MAX_PLACE);
    }
    if (gn_pose_normalize(out) < 0)
        return gn_json_refuse(at, "orientation", out_error,
                              "must be a unit quaternion [w, x, y, z]");
    return 0;
}

static int read_marker(struct reader *r, const struct gn_json *at, struct gn_error *out_error)
{
    static const char *const keys[] = {"id", "size", "position", "orientation"};
    const double origin[2] = {0, 0};
    struct gn_body_marker marker;
    struct gn_pose place;
    double size = 0;
    int id = 0;
    int err = gn_json_check_keys(at, keys, GN_ARRAY_LEN(keys), out_error);
    if (!err)
        err = gn_json_get_int(at, "id", 0, MAX_ID, &id, out_error);
    if (!err)
        err = gn_json_get_double(at, "size", MIN_SIZE, MAX_SIZE, &size, out_error);
    if (!err)
        err = read_place(at, &place, out_error);
    if (err)
        return err;
    place_marker(&place, origin, size, id, &marker);
    return add_marker(r, at, &marker, out_error);
}

/** A grid: row by row from the top left, its middle at its position. */
static int read_grid(struct reader *r, const struct gn_json *at, struct gn_error *out_error)
{
    static const char *const keys[] = {"columns",  "rows",     "size",       "gap",
                                       "first_id", "position", "orientation"};
    struct gn_pose place;
    double size = 0, gap = 0;
    int columns = 0, rows = 0, first = 0;
    int err = gn_json_check_keys(at, keys, GN_ARRAY_LEN(keys), out_error);
    if (!err)
        err = gn_json_get_int(at, "columns", 1, GN_BODY_MAX_MARKERS, &columns, out_error);
    if (!err)
        err = gn_json_get_int(at, "rows", 1, GN_BODY_MAX_MARKERS, &rows, out_error);
    if (!err)
        err = gn_json_get_double(at, "size", MIN_SIZE, MAX_SIZE, &size, out_error);
    if (!err)
        err = gn_json_get_double(at, "gap", 0, MAX_SIZE, &gap, out_error);
    if (!err && gn_json_has(at, "first_id"))
        err = gn_json_get_int(at, "first_id", 0, MAX_ID, &first, out_error);
    if (!err)
        err = read_place(at, &place, out_error);
    for (int i = 0; !err && i < rows * columns; i++) {
        const double middle[2] = {(i % columns - (columns - 1) / 2.0) * (size + gap),
                                  ((rows - 1) / 2.0 - i / columns) * (size + gap)};
        struct gn_body_marker marker;
        place_marker(&place, middle, size, first + i, &marker);
        err = add_marker(r, at, &marker, out_error);
    }
    return err;
}

static int read_list(struct reader *r, const struct gn_json *body, const char *key,
                     int (*read)(struct reader *, const struct gn_json *, struct gn_error *),
                     struct gn_error *out_error)
{
    struct gn_json list, item;
    if (!gn_json_has(body, key))
        return 0;
    int err = gn_json_get_array(body, key, 1, GN_BODY_MAX_MARKERS, &list, out_error);
    for (size_t i = 0; !err && i < json_array_size(list.value); i++) {
        err = gn_json_get_item(&list, i, &item, out_error);
        if (!err)
            err = read(r, &item, out_error);
    }
    return err;
}

static int add_body(struct reader *r, const char *name, struct gn_error *out_error)
{
    struct gn_body *b = &r->bodies->bodies[r->bodies->n_bodies];
    b->markers = calloc(GN_BODY_MAX_MARKERS, sizeof(*b->markers));
    if (!b->markers)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    snprintf(b->name, sizeof(b->name), "%s", name);
    r->bodies->n_bodies++;
    return 0;
}

static int read_body(struct reader *r, const struct gn_json *at, struct gn_error *out_error)
{
    static const char *const keys[] = {"name", "markers", "grids"};
    const char *name = NULL;
    int err = gn_json_check_keys(at, keys, GN_ARRAY_LEN(keys), out_error);
    if (!err)
        err = gn_json_get_string(at, "name", &name, out_error);
    if (err)
        return err;
    if (!name[0] || strlen(name) >= GN_BODY_NAME_BYTES)
        return gn_json_refuse(at, "name", out_error, "names have 1 to %d bytes",
                              GN_BODY_NAME_BYTES - 1);
    if (gn_bodies_find(r->bodies, name) >= 0)
        return gn_json_refuse(at, "name", out_error, "there are two bodies of this name");
    err = add_body(r, name, out_error);
    if (!err)
        err = read_list(r, at, "markers", read_marker, out_error);
    if (!err)
        err = read_list(r, at, "grids", read_grid, out_error);
    if (!err && r->bodies->bodies[r->bodies->n_bodies - 1].n_markers == 0)
        err = gn_json_refuse(at, NULL, out_error, "the body has no marker: give markers or grids");
    return err;
}

static int refuse_dictionary(struct gn_error *out_error, const char *where)
{
    return gn_error_set(out_error, -EINVAL, "%s: no such dictionary; there are %s", where,
                        GN_MARKER_DICTIONARIES);
}

int gn_bodies_read_file(const char *path, struct gn_bodies *out, struct gn_error *out_error)
{
    static const char *const keys[] = {"dictionary", "bodies"};
    struct gn_json root = {0}, list, item;
    struct reader r = {.bodies = out};
    const char *dictionary = NULL;
    memset(out, 0, sizeof(*out));
    int err = gn_json_load_file(path, &root, out_error);
    if (err)
        return err;
    err = gn_json_check_keys(&root, keys, GN_ARRAY_LEN(keys), out_error);
    if (!err)
        err = gn_json_get_string(&root, "dictionary", &dictionary, out_error);
    if (!err) {
        out->dictionary = gn_marker_find_dictionary(dictionary, strlen(dictionary));
        if (out->dictionary < 0)
            err = refuse_dictionary(out_error, path);
        r.n_ids = gn_marker_count_ids(out->dictionary);
    }
    if (!err)
        err = gn_json_get_array(&root, "bodies", 1, GN_BODY_MAX_BODIES, &list, out_error);
    for (size_t i = 0; !err && i < json_array_size(list.value); i++) {
        err = gn_json_get_item(&list, i, &item, out_error);
        if (!err)
            err = read_body(&r, &item, out_error);
    }
    gn_json_finish(&root);
    if (err)
        gn_bodies_finish(out);
    return err;
}

int gn_bodies_read_text(const char *text, struct gn_bodies *out, struct gn_error *out_error)
{
    struct reader r = {.bodies = out};
    struct gn_pose place = {.rotation = {1, 0, 0, 0}};
    const double origin[2] = {0, 0};
    struct gn_body_marker *marker;
    memset(out, 0, sizeof(*out));
    size_t name_bytes = strcspn(text, ":");
    out->dictionary = gn_marker_find_dictionary(text, name_bytes);
    if (out->dictionary < 0)
        return refuse_dictionary(out_error, text);
    char *end = NULL;
    const char *number = text + name_bytes + (text[name_bytes] == ':');
    errno = 0;
    long id = strtol(number, &end, 10);
    int n_ids = gn_marker_count_ids(out->dictionary);
    if (errno || end == number || *end != ':' || *number < '0' || *number > '9' ||
        id >= (n_ids ? n_ids : MAX_ID))
        return gn_error_set(
            out_error, -EINVAL,
            "%s: must be DICTIONARY:ID:SIZE, ID from 0 to %d, such as 4x4_50:7:0.05", text,
            n_ids ? n_ids - 1 : MAX_ID);
    number = end + 1;
    double size = strtod(number, &end);
    if (end == number || *end || !(size >= MIN_SIZE && size <= MAX_SIZE))
        return gn_error_set(out_error, -EINVAL, "%s: the size must be metres in [%g, %g]", text,
                            MIN_SIZE, MAX_SIZE);
    int err = add_body(&r, GN_BODY_WORLD, out_error);
    if (err)
        return err;
    marker = &out->bodies[0].markers[out->bodies[0].n_markers++];
    place_marker(&place, origin, size, (int)id, marker);
    return 0;
}

void gn_bodies_finish(struct gn_bodies *bodies)
{
    for (int i = 0; i < bodies->n_bodies; i++)
        free(bodies->bodies[i].markers);
    memset(bodies, 0, sizeof(*bodies));
}

int gn_bodies_find(const struct gn_bodies *bodies, const char *name)
{
    for (int i = 0; i < bodies->n_bodies; i++) {
        if (strcmp(bodies->bodies[i].name, name) == 0)
            return i;
    }
    return -1;
}

bool gn_bodies_find_marker(const struct gn_bodies *bodies, int id, int *out_body, int *out_marker)
{
    for (int i = 0; i < bodies->n_bodies; i++) {
        for (int k = 0; k < bodies->bodies[i].n_markers; k++) {
            if (bodies->bodies[i].markers[k].id == id) {
                *out_body = i;
                *out_marker = k;
                return true;
            }
        }
    }
    return false;
}
