/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The teapot: closed, outward, of the right size; and the demo room's 814 triangles. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/room.h"
#include "tests/rig/teapot.h"
#include "tests/rig/vec.h"

struct edge {
    float from[3], to[3];
};

static int compare_edges(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(struct edge));
}

static void get_corners(const struct gn_mesh *mesh, int triangle, double out[3][3])
{
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            out[c][k] = mesh->positions[3 * (size_t)mesh->triangles[3 * triangle + c] + (size_t)k];
}

/* Each directed edge occurs once, and once the other way: watertight, one winding. */
static void check_closed(const struct gn_mesh *mesh)
{
    size_t n = 3 * (size_t)mesh->n_triangles;
    struct edge *edges = calloc(n, sizeof(*edges));
    assert_non_null(edges);
    for (size_t i = 0; i < n; i++) {
        size_t next = i % 3 == 2 ? i - 2 : i + 1;
        memcpy(edges[i].from, mesh->positions + 3 * (size_t)mesh->triangles[i], 12);
        memcpy(edges[i].to, mesh->positions + 3 * (size_t)mesh->triangles[next], 12);
    }
    qsort(edges, n, sizeof(*edges), compare_edges);
    for (size_t i = 0; i < n; i++) {
        struct edge back;
        memcpy(back.from, edges[i].to, 12);
        memcpy(back.to, edges[i].from, 12);
        assert_true(i == 0 || compare_edges(&edges[i - 1], &edges[i]));
        assert_non_null(bsearch(&back, edges, n, sizeof(*edges), compare_edges));
    }
    free(edges);
}

static double get_volume(const struct gn_mesh *mesh, int first, int end)
{
    double sum = 0;
    for (int t = first; t < end; t++) {
        double p[3][3], cross[3];
        get_corners(mesh, t, p);
        vec_cross(p[1], p[2], cross);
        sum += vec_dot(p[0], cross) / 6;
    }
    return sum;
}

static double get_cubic(const double p[4][3], int k, double t)
{
    double s = 1 - t;
    return s * s * s * p[0][k] + 3 * s * s * t * p[1][k] + 3 * s * t * t * p[2][k] +
           t * t * t * p[3][k];
}

/* Area inside the four quarter turns (r, 0) (r, k) (k, r) (0, r), by the shoelace rule. */
static double get_section(double r, double k)
{
    const double turn[4][3] = {{r, 0, 0}, {r, k, 0}, {k, r, 0}, {0, r, 0}};
    double area = 0;
    for (int i = 0; i < 64; i++) {
        double a = i / 64.0, b = (i + 1) / 64.0;
        area += get_cubic(turn, 0, a) * get_cubic(turn, 1, b) -
                get_cubic(turn, 0, b) * get_cubic(turn, 1, a);
    }
    return 2 * area;
}

static int count_body(const struct gn_rig_teapot_options *o)
{
    int sum = -2;
    for (int b = 0; b < GN_RIG_TEAPOT_BANDS; b++)
        sum += 2 * o->along[b];
    return sum * o->around;
}

static void test_shape(void **state)
{
    const struct gn_rig_teapot_options *options[2] = {&gn_rig_teapot_coarse, &gn_rig_teapot_fine};
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct gn_mesh mesh;
        int dropped = -1;
        assert_int_equal(gn_rig_teapot_create(options[i], &mesh), 0);
        check_closed(&mesh);
        assert_int_equal(gn_mesh_check(&mesh, &dropped, NULL), 0);
        assert_int_equal(dropped, 0);
        int body = count_body(options[i]);
        int handle = body + options[i]->handle_along * 4 * options[i]->tube_around +
                     2 * (options[i]->tube_around - 2);
        print_message("# volumes: pot %.3f, handle %.3f, spout %.3f\n", get_volume(&mesh, 0, body),
                      get_volume(&mesh, body, handle), get_volume(&mesh, handle, mesh.n_triangles));
        assert_true(get_volume(&mesh, 0, body) > 20);
        assert_true(get_volume(&mesh, body, handle) > 0.2);
        assert_true(get_volume(&mesh, handle, mesh.n_triangles) > 0.2);
        gn_mesh_finish(&mesh);
    }
}

/* The pot's volume against the integral of its sections along the published profile. */
static void test_volume(void **state)
{
    struct gn_mesh mesh;
    double volume = 0;
    (void)state;
    for (int b = 0; b < GN_RIG_TEAPOT_BANDS; b++)
        for (int i = 0; i < 200; i++) {
            const double(*p)[3] = gn_rig_teapot_bands[b];
            double fall = get_cubic(p, 2, i / 200.0) - get_cubic(p, 2, (i + 1) / 200.0);
            double u = (i + 0.5) / 200;
            volume += get_section(get_cubic(p, 0, u), get_cubic(p, 1, u)) * fall;
        }
    assert_int_equal(gn_rig_teapot_create(&gn_rig_teapot_fine, &mesh), 0);
    double found = get_volume(&mesh, 0, count_body(&gn_rig_teapot_fine));
    assert_true(fabs(found / volume - 1) < 0.002);
    gn_mesh_finish(&mesh);
}

static void test_bounds_and_normals(void **state)
{
    struct gn_mesh mesh;
    double low[3] = {9, 9, 9}, high[3] = {-9, -9, -9};
    (void)state;
    assert_int_equal(gn_rig_teapot_create(&gn_rig_teapot_fine, &mesh), 0);
    for (int i = 0; i < 3 * mesh.n_vertices; i++) {
        low[i % 3] = fmin(low[i % 3], mesh.positions[i]);
        high[i % 3] = fmax(high[i % 3], mesh.positions[i]);
    }
    assert_true(low[2] == 0 && fabs(high[2] - 3.15) < 1e-6);
    assert_true(fabs(low[1] + 2) < 1e-6 && fabs(high[1] - 2) < 1e-6);
    assert_true(low[0] >= -3 && low[0] < -2.98);
    assert_true(high[0] > 3.42 && high[0] < 3.44); // the spout's lip: 3.434 is published
    for (int t = 0; t < mesh.n_triangles; t++) {
        double p[3][3], a[3], b[3], face[3];
        get_corners(&mesh, t, p);
        vec_subtract(p[1], p[0], a);
        vec_subtract(p[2], p[0], b);
        vec_cross(a, b, face);
        vec_normalize(face);
        for (int c = 0; c < 3; c++) {
            double n[3];
            for (int k = 0; k < 3; k++)
                n[k] = mesh.normals[3 * (size_t)mesh.triangles[3 * t + c] + (size_t)k];
            assert_true(fabs(vec_length(n) - 1) < 1e-5);
            assert_true(vec_dot(n, face) > 0.5);
        }
    }
    gn_mesh_finish(&mesh);
}

static void test_refusals(void **state)
{
    struct gn_rig_teapot_options o = gn_rig_teapot_coarse;
    struct gn_mesh mesh;
    (void)state;
    o.around = 21;
    assert_int_equal(gn_rig_teapot_create(&o, &mesh), -EINVAL);
    o = gn_rig_teapot_coarse;
    o.along[3] = 0;
    assert_int_equal(gn_rig_teapot_create(&o, &mesh), -EINVAL);
    o = gn_rig_teapot_coarse;
    o.spout_along = 1 << 30;
    assert_int_equal(gn_rig_teapot_create(&o, &mesh), -EINVAL);
}

static void test_room(void **state)
{
    struct gn_rig_room room;
    (void)state;
    assert_int_equal(gn_rig_room_init_demo(false, &room, NULL), 0);
    print_message("# demo room: %d triangles\n", gn_rig_room_count_triangles(&room));
    assert_int_equal(gn_rig_room_count_triangles(&room), GN_RIG_DEMO_TRIANGLES);
    for (int i = 0; i < room.n_objects; i++) {
        int dropped = -1;
        assert_int_equal(gn_mesh_check(&room.objects[i].mesh, &dropped, NULL), 0);
        assert_int_equal(dropped, 0);
        if (!strncmp(room.objects[i].name, "box", 3) || !strcmp(room.objects[i].name, "pencil")) {
            check_closed(&room.objects[i].mesh);
            assert_true(get_volume(&room.objects[i].mesh, 0, room.objects[i].mesh.n_triangles) > 0);
        }
    }
    gn_rig_room_finish(&room);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shape),
        cmocka_unit_test(test_volume),
        cmocka_unit_test(test_bounds_and_normals),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
