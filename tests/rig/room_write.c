/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "common/file.h"
#include "tests/rig/room.h"

static bool is_emitter(const struct gn_rig_object *o)
{
    return o->emission[0] > 0 || o->emission[1] > 0 || o->emission[2] > 0;
}

static bool is_same_colour(const float *a, const float *b)
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Nine digits carry a float to the bit. Materials are named by the triangle where they begin. */
static void print_obj(FILE *out, const char *name, const struct gn_mesh *mesh)
{
    if (mesh->albedos)
        fprintf(out, "mtllib %s.mtl\n", name);
    for (int i = 0; i < mesh->n_vertices; i++) {
        const float *p = mesh->positions + 3 * (size_t)i;
        fprintf(out, "v %.9g %.9g %.9g\n", (double)p[0], (double)p[1], (double)p[2]);
    }
    for (int i = 0; mesh->normals && i < mesh->n_vertices; i++) {
        const float *n = mesh->normals + 3 * (size_t)i;
        fprintf(out, "vn %.9g %.9g %.9g\n", (double)n[0], (double)n[1], (double)n[2]);
    }
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *t = mesh->triangles + 3 * (size_t)i;
        const float *colour = mesh->albedos ? mesh->albedos + 3 * (size_t)i : NULL;
        if (colour && (i == 0 || !is_same_colour(colour, colour - 3)))
            fprintf(out, "usemtl m%d\n", i);
        if (mesh->normals)
            fprintf(out, "f %u//%u %u//%u %u//%u\n", t[0] + 1, t[0] + 1, t[1] + 1, t[1] + 1,
                    t[2] + 1, t[2] + 1);
        else
            fprintf(out, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
}

static void print_mtl(FILE *out, const char *name, const struct gn_mesh *mesh)
{
    (void)name;
    for (int i = 0; i < mesh->n_triangles; i++) {
        const float *c = mesh->albedos + 3 * (size_t)i;
        if (i == 0 || !is_same_colour(c, c - 3))
            fprintf(out, "newmtl m%d\nKd %.9g %.9g %.9g\n", i, (double)c[0], (double)c[1],
                    (double)c[2]);
    }
}

static int write_text(const char *directory, const char *name, const char *suffix,
                      void (*print)(FILE *, const char *, const struct gn_mesh *),
                      const struct gn_mesh *mesh, struct gn_error *error)
{
    char path[4096], *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return gn_error_set(error, -ENOMEM, "%s: no memory to write it", name);
    print(out, name, mesh);
    snprintf(path, sizeof(path), "%s/%s.%s", directory, name, suffix);
    int result = fclose(out) ? gn_error_set(error, -ENOMEM, "%s: no memory to write it", name)
                             : gn_file_write(path, text, size, error);
    free(text);
    return result;
}

static json_t *describe_material(const struct gn_rig_object *o)
{
    json_t *material = json_object();
    json_object_set_new(material, "type",
                        json_string(o->finish == GN_RIG_MIRROR ? "mirror" : "diffuse"));
    if (!o->mesh.albedos)
        json_object_set_new(material, "albedo",
                            json_pack("[fff]", o->albedo[0], o->albedo[1], o->albedo[2]));
    if (is_emitter(o))
        json_object_set_new(material, "emission",
                            json_pack("[fff]", o->emission[0], o->emission[1], o->emission[2]));
    return material;
}

static json_t *describe_lamp(const struct gn_rig_lamp *lamp)
{
    const double *p = lamp->position, *i = lamp->intensity;
    return json_pack("{s:s,s:[fff],s:[fff],s:f,s:s}", "type", "point", "position", p[0], p[1], p[2],
                     "intensity", i[0], i[1], i[2], "radius", lamp->radius, "role",
                     lamp->is_virtual ? "virtual" : "real");
}

static json_t *describe_object(const struct gn_rig_object *object)
{
    json_t *matrix = json_array(), *o = json_object();
    for (int i = 0; i < 16; i++)
        json_array_append_new(matrix, json_real(object->world_from_object[i]));
    json_object_set_new(o, "name", json_string(object->name));
    json_object_set_new(o, "mesh", json_sprintf("%s.obj", object->name));
    json_object_set_new(o, "role", json_string(object->role == GN_RT_REAL ? "real" : "virtual"));
    if (!object->mesh.albedos || is_emitter(object))
        json_object_set_new(o, "material", describe_material(object));
    json_object_set_new(o, "world_from_object", matrix);
    return o;
}

int gn_rig_room_write(const struct gn_rig_room *room, const char *directory,
                      struct gn_error *out_error)
{
    json_t *list = json_array(), *lamps = json_array(), *scene = json_object();
    char path[4096];
    int result = 0;
    json_object_set_new(scene, "objects", list);
    for (int i = 0; result == 0 && i < room->n_objects; i++) {
        const struct gn_rig_object *o = &room->objects[i];
        json_array_append_new(list, describe_object(o));
        result = write_text(directory, o->name, "obj", print_obj, &o->mesh, out_error);
        if (result == 0 && o->mesh.albedos)
            result = write_text(directory, o->name, "mtl", print_mtl, &o->mesh, out_error);
    }
    for (int i = 0; i < room->n_lamps; i++)
        json_array_append_new(lamps, describe_lamp(&room->lamps[i]));
    if (room->n_lamps > 0)
        json_object_set(scene, "lights", lamps);
    json_decref(lamps);
    char *text = json_dumps(scene, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
    snprintf(path, sizeof(path), "%s/scene.json", directory);
    if (result == 0)
        result = text ? gn_file_write(path, text, strlen(text), out_error)
                      : gn_error_set(out_error, -ENOMEM, "%s: no memory to write it", path);
    free(text);
    json_decref(scene);
    return result;
}
