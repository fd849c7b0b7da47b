/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The demo room: table, marker, boxes, a pencil, a ColorChecker and the teapot. Triangles: table 2,
 * marker 2, ColorChecker 12 + 48, four boxes 48, pencil 22, teapot 680; 814 in all.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/room.h"
#include "tests/rig/teapot.h"
#include "tests/rig/vec.h"

/* The marker's paper lies on the table: its upper side is z = 0. */
#define TABLE_Z (-0.0004)
/* m; so large that no light from below the horizon reaches what stands on it. A fisheye that looks
 * up cannot see that light. */
#define TABLE_SIDE 20.0
#define PAPER_SIDE 0.104

#define PENCIL_SIDES 6

const double gn_rig_colorchecker[24][3] = {
    {115, 82, 68},   {194, 150, 130}, {98, 122, 157}, {87, 108, 67},   {133, 128, 177},
    {103, 189, 170}, {214, 126, 44},  {80, 91, 166},  {193, 90, 99},   {94, 60, 108},
    {157, 188, 64},  {224, 163, 46},  {56, 61, 150},  {70, 148, 73},   {175, 54, 60},
    {231, 199, 31},  {187, 86, 149},  {8, 133, 161},  {243, 243, 242}, {200, 200, 200},
    {160, 160, 160}, {122, 122, 121}, {85, 85, 85},   {52, 52, 52},
};

/* IEC 61966-2-1. */
static double decode_srgb8(double code)
{
    double v = code / 255;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static int allocate(struct gn_mesh *mesh, int vertices, int triangles)
{
    mesh->positions = calloc((size_t)vertices, 3 * sizeof(*mesh->positions));
    mesh->triangles = calloc((size_t)triangles, 3 * sizeof(*mesh->triangles));
    return mesh->positions && mesh->triangles ? 0 : -ENOMEM;
}

static uint32_t put_vertex(struct gn_mesh *mesh, double x, double y, double z)
{
    float *p = mesh->positions + 3 * (size_t)mesh->n_vertices;
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    return (uint32_t)mesh->n_vertices++;
}

static void put_triangle(struct gn_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *t = mesh->triangles + 3 * (size_t)mesh->n_triangles++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

/* A level rectangle that looks up. */
static void put_rectangle(struct gn_mesh *mesh, double x0, double y0, double x1, double y1,
                          double z)
{
    uint32_t a = put_vertex(mesh, x0, y0, z);
    put_vertex(mesh, x1, y0, z);
    put_vertex(mesh, x1, y1, z);
    put_vertex(mesh, x0, y1, z);
    put_triangle(mesh, a, a + 1, a + 2);
    put_triangle(mesh, a, a + 2, a + 3);
}

/* A box of half sizes hx, hy that stands on z = 0. */
static void put_box(struct gn_mesh *mesh, double hx, double hy, double height)
{
    static const unsigned char quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                              {3, 2, 6, 7}, {2, 0, 4, 6}, {1, 3, 7, 5}};
    uint32_t first = (uint32_t)mesh->n_vertices;
    for (int i = 0; i < 8; i++)
        put_vertex(mesh, i & 1 ? hx : -hx, i & 2 ? hy : -hy, i & 4 ? height : 0);
    for (int q = 0; q < 6; q++) {
        const unsigned char *c = quads[q];
        put_triangle(mesh, first + c[0], first + c[1], first + c[2]);
        put_triangle(mesh, first + c[0], first + c[2], first + c[3]);
    }
}

/* A hexagonal pencil along +x, lying on a side, point at the far end. */
static void put_pencil(struct gn_mesh *mesh, double radius, double length, double tip)
{
    const uint32_t n = PENCIL_SIDES;
    double lift = radius * cos(GN_RIG_PI / n);
    uint32_t first = (uint32_t)mesh->n_vertices;
    for (uint32_t i = 0; i < 2 * n; i++) {
        double a = 2 * GN_RIG_PI * ((i % n) + 0.5) / n;
        put_vertex(mesh, i < n ? 0 : length, radius * sin(a), lift - radius * cos(a));
    }
    uint32_t point = put_vertex(mesh, length + tip, 0, lift);
    for (uint32_t i = 0; i < n; i++) {
        uint32_t a = first + i, b = first + (i + 1) % n;
        put_triangle(mesh, a, b + n, a + n);
        put_triangle(mesh, a, b, b + n);
        put_triangle(mesh, a + n, b + n, point);
        if (i >= 1 && i + 1 < n)
            put_triangle(mesh, first, b, a);
    }
}

/* Turns the object by `turn` about z, then moves it. */
static void place(struct gn_rig_object *object, double x, double y, double z, double turn_deg,
                  double scale)
{
    double c = scale * cos(turn_deg * GN_RIG_PI / 180), s = scale * sin(turn_deg * GN_RIG_PI / 180);
    const double m[16] = {c, -s, 0, x, s, c, 0, y, 0, 0, scale, z, 0, 0, 0, 1};
    memcpy(object->world_from_object, m, sizeof(m));
}

/* 24 patches on a black frame; colours per triangle. */
static int make_colorchecker(struct gn_mesh *mesh)
{
    const double pitch = 0.0190, patch = 0.0155, thick = 0.003;
    const double frame[3] = {0.025, 0.025, 0.026};
    int result = allocate(mesh, 8 + 24 * 4, 12 + 48);
    mesh->albedos = result ? NULL : calloc(12 + 48, 3 * sizeof(*mesh->albedos));
    if (!mesh->albedos)
        return -ENOMEM;
    put_box(mesh, 3 * pitch + 0.004, 2 * pitch + 0.004, thick);
    for (int i = 0; i < 24; i++) {
        double x = (i % 6 - 3) * pitch + (pitch - patch) / 2;
        double y = (1 - i / 6) * pitch + (pitch - patch) / 2;
        put_rectangle(mesh, x, y, x + patch, y + patch, thick + 0.0003);
    }
    for (int t = 0; t < mesh->n_triangles; t++)
        for (int k = 0; k < 3; k++)
            mesh->albedos[3 * t + k] =
                (float)(t < 12 ? frame[k] : decode_srgb8(gn_rig_colorchecker[(t - 12) / 2][k]));
    return 0;
}

static int add_box(struct gn_rig_room *room, const char *name, const double size[static 3],
                   const double at[static 4], const double albedo[static 3])
{
    struct gn_rig_object o = {.name = name, .role = GN_RT_REAL};
    int result = allocate(&o.mesh, 8, 12);
    if (result == 0) {
        put_box(&o.mesh, size[0] / 2, size[1] / 2, size[2]);
        place(&o, at[0], at[1], TABLE_Z + at[2], at[3], 1);
        memcpy(o.albedo, albedo, sizeof(o.albedo));
        result = gn_rig_room_add(room, &o);
    }
    gn_mesh_finish(&o.mesh);
    return result;
}

static int add_table(struct gn_rig_room *room)
{
    struct gn_rig_object table = {
        .name = "table", .role = GN_RT_REAL, .finish = GN_RIG_WOOD, .albedo = {0.43, 0.28, 0.165}};
    struct gn_rig_object marker = {.name = "marker",
                                   .role = GN_RT_REAL,
                                   .finish = GN_RIG_MARKER,
                                   .albedo = {0.46, 0.46, 0.46}};
    int result = allocate(&table.mesh, 4, 2);
    if (result == 0)
        result = allocate(&marker.mesh, 4, 2);
    if (result == 0) {
        double t = TABLE_SIDE / 2, p = PAPER_SIDE / 2;
        put_rectangle(&table.mesh, -t, -t, t, t, TABLE_Z);
        put_rectangle(&marker.mesh, -p, -p, p, p, 0);
        place(&table, 0, 0, 0, 0, 1);
        place(&marker, 0, 0, 0, 0, 1);
        result = gn_rig_room_add(room, &table);
    }
    if (result == 0)
        result = gn_rig_room_add(room, &marker);
    gn_mesh_finish(&table.mesh);
    gn_mesh_finish(&marker.mesh);
    return result;
}

static int add_small_things(struct gn_rig_room *room)
{
    struct gn_rig_object chart = {.name = "colorchecker", .role = GN_RT_REAL};
    struct gn_rig_object pencil = {
        .name = "pencil", .role = GN_RT_REAL, .albedo = {0.72, 0.46, 0.06}};
    int result = make_colorchecker(&chart.mesh);
    if (result == 0)
        result = allocate(&pencil.mesh, 2 * PENCIL_SIDES + 1, 22);
    if (result == 0) {
        place(&chart, 0.121, 0.010, TABLE_Z, -13, 1);
        put_pencil(&pencil.mesh, 0.0042, 0.105, 0.016);
        place(&pencil, -0.155, -0.035, TABLE_Z, -21, 1);
        result = gn_rig_room_add(room, &chart);
    }
    if (result == 0)
        result = gn_rig_room_add(room, &pencil);
    gn_mesh_finish(&chart.mesh);
    gn_mesh_finish(&pencil.mesh);
    return result;
}

static int add_teapot(struct gn_rig_room *room, bool fine)
{
    struct gn_rig_object o = {
        .name = "teapot", .role = GN_RT_VIRTUAL, .albedo = {0.70, 0.68, 0.63}};
    int result = gn_rig_teapot_create(fine ? &gn_rig_teapot_fine : &gn_rig_teapot_coarse, &o.mesh);
    if (result)
        return result;
    place(&o, 0.003, 0.092, TABLE_Z, -24, 0.0195);
    result = gn_rig_room_add(room, &o);
    gn_mesh_finish(&o.mesh);
    return result;
}

int gn_rig_room_init_demo(bool fine, struct gn_rig_room *out_room, struct gn_error *out_error)
{
    static const struct {
        const char *name;
        double size[3], place[4], albedo[3]; // m; x, y, z m and turn deg
    } boxes[] = {
        {"box-terracotta", {0.058, 0.050, 0.098}, {-0.125, 0.150, 0, 24}, {0.56, 0.18, 0.10}},
        {"box-book", {0.130, 0.090, 0.022}, {0.150, 0.165, 0, 12}, {0.07, 0.15, 0.30}},
        {"box-card", {0.052, 0.052, 0.040}, {0.168, 0.160, 0.022, -20}, {0.62, 0.55, 0.40}},
        {"box-cube", {0.026, 0.026, 0.026}, {-0.072, 0.045, 0, 38}, {0.20, 0.38, 0.17}},
    };
    struct gn_rig_room room = {0};
    int result = add_table(&room);
    for (size_t i = 0; result == 0 && i < GN_ARRAY_LEN(boxes); i++)
        result = add_box(&room, boxes[i].name, boxes[i].size, boxes[i].place, boxes[i].albedo);
    if (result == 0)
        result = add_small_things(&room);
    if (result == 0)
        result = add_teapot(&room, fine);
    if (result) {
        gn_rig_room_finish(&room);
        return gn_error_set(out_error, result, "demo room: no memory for its meshes");
    }
    *out_room = room;
    return 0;
}
