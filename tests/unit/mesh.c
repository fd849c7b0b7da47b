/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/mesh.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/folder.h"
#include "tests/meshes.h"
#include "tests/real_data.h"
#include "tests/unit/cmocka_setup.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static int set_up(void **state)
{
    (void)state;
    return gn_test_folder_create();
}

static int tear_down(void **state)
{
    (void)state;
    return gn_test_folder_remove(NULL, 0); // fails where a test left a file behind
}

static void remove_file(const char *name)
{
    assert_int_equal(unlink(gn_test_folder_get_path(name)), 0);
}

/** Reads a mesh file of that text; the file is gone afterwards. */
static int read_text(const char *name, const char *text, struct gn_mesh *out_mesh,
                     struct gn_error *error)
{
    gn_test_folder_write_text(name, text);
    *error = (struct gn_error){0};
    int ret = gn_mesh_read_file(gn_test_folder_get_path(name), out_mesh, error);
    remove_file(name);
    return ret;
}

static double get_area(const struct gn_mesh *mesh)
{
    double area = 0.0;
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *t = mesh->triangles + 3 * (size_t)i;
        const float *a = mesh->positions + 3 * (size_t)t[0];
        const float *b = mesh->positions + 3 * (size_t)t[1];
        const float *c = mesh->positions + 3 * (size_t)t[2];
        double u[3];
        double v[3];
        for (int k = 0; k < 3; k++) {
            u[k] = b[k] - a[k];
            v[k] = c[k] - a[k];
        }
        area += 0.5 * sqrt(pow(u[1] * v[2] - u[2] * v[1], 2) + pow(u[2] * v[0] - u[0] * v[2], 2) +
                           pow(u[0] * v[1] - u[1] * v[0], 2));
    }
    return area;
}

/** Six times the signed volume, > 0 where the windings look outside. */
static double get_volume6(const struct gn_mesh *mesh)
{
    double volume = 0.0;
    for (int i = 0; i < mesh->n_triangles; i++) {
        const uint32_t *t = mesh->triangles + 3 * (size_t)i;
        const float *a = mesh->positions + 3 * (size_t)t[0];
        const float *b = mesh->positions + 3 * (size_t)t[1];
        const float *c = mesh->positions + 3 * (size_t)t[2];
        volume += (double)a[0] * (b[1] * c[2] - b[2] * c[1]) -
                  (double)a[1] * (b[0] * c[2] - b[2] * c[0]) +
                  (double)a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return volume;
}

static void test_check_drops_triangles_without_area(void **state)
{
    (void)state;
    struct gn_mesh cube = gn_test_make_cube(1.0f);
    cube.albedos = calloc(12, 3 * sizeof(float));
    assert_non_null(cube.albedos);
    for (int i = 0; i < 12; i++)
        cube.albedos[3 * i] = (float)i / 12.0f;
    cube.triangles[4] = cube.triangles[3]; // the second triangle becomes a line
    int dropped = -1;
    assert_int_equal(gn_mesh_check(&cube, &dropped, NULL), 0);
    assert_int_equal(dropped, 1);
    assert_int_equal(cube.n_triangles, 11);
    assert_float_equal(cube.albedos[0], 0.0f, 0.0);
    assert_float_equal(cube.albedos[3], 2.0f / 12.0f, 0.0); // colours move with their triangles
    gn_mesh_finish(&cube);
    assert_null(cube.positions);
}

static void test_check_refuses(void **state)
{
    (void)state;
    enum { POSITION, NORMAL, INDEX, ALBEDO, EMPTY, FLAT, HUGE_COUNT };
    const struct {
        int what;
        const char *says;
    } cases[] = {
        {POSITION, "vertex 5 is not finite"},
        {NORMAL, "normal 5 has length"},
        {INDEX, "names vertex 8"},
        {ALBEDO, "albedo 1.5"},
        {EMPTY, "empty"},
        {FLAT, "all 12 triangles have no area"},
        {HUGE_COUNT, "at most"},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        struct gn_mesh cube = gn_test_make_cube(1.0f);
        cube.albedos = calloc(12, 3 * sizeof(float));
        cube.normals = calloc(8, 3 * sizeof(float));
        assert_true(cube.albedos && cube.normals);
        for (int k = 0; k < 8; k++)
            cube.normals[3 * k] = 1.0f;
        if (cases[i].what == POSITION)
            cube.positions[16] = NAN;
        else if (cases[i].what == NORMAL)
            cube.normals[15] = 0.5f;
        else if (cases[i].what == INDEX)
            cube.triangles[35] = 8;
        else if (cases[i].what == ALBEDO)
            cube.albedos[35] = 1.5f;
        else if (cases[i].what == EMPTY)
            cube.n_triangles = 0;
        else if (cases[i].what == FLAT)
            memset(cube.positions, 0, 8 * 3 * sizeof(float));
        else
            cube.n_triangles = GN_MESH_MAX_TRIANGLES + 1;
        struct gn_error error = {0};
        assert_int_equal(gn_mesh_check(&cube, NULL, &error), -EINVAL);
        assert_non_null(strstr(error.text, cases[i].says));
        gn_mesh_finish(&cube);
    }
}

static void test_obj_comes_back_as_written(void **state)
{
    (void)state;
    struct gn_mesh sphere = gn_test_make_sphere(0.1f, 8);
    struct gn_error error = {0};
    assert_int_equal(gn_mesh_write_obj(&sphere, gn_test_folder_get_path("s.obj"), &error), 0);
    struct gn_mesh read = {0};
    assert_int_equal(gn_mesh_read_file(gn_test_folder_get_path("s.obj"), &read, &error), 0);
    remove_file("s.obj");
    assert_int_equal(read.n_triangles, sphere.n_triangles);
    assert_float_equal((float)get_area(&read), (float)get_area(&sphere), 1e-6);
    assert_float_equal((float)get_volume6(&read), (float)get_volume6(&sphere), 1e-6);
    assert_non_null(read.normals);
    assert_null(read.albedos); // no material: the object's counts
    for (int i = 0; i < read.n_vertices; i++) {
        for (int k = 0; k < 3; k++)
            assert_float_equal(read.normals[3 * i + k], 10.0f * read.positions[3 * i + k], 1e-5);
    }
    gn_mesh_finish(&read);
    gn_mesh_finish(&sphere);
    assert_true(gn_mesh_write_obj(&read, "/nowhere/at/all.obj", &error) == -ENOENT);
}

static void test_obj_polygons_points_and_lines(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    // A square of one polygon, a line, a point: two triangles, flat.
    assert_int_equal(read_text("a.obj",
                               "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\nl 1 3\np 2\n", &mesh,
                               &error),
                     0);
    assert_int_equal(mesh.n_triangles, 2);
    assert_float_equal((float)get_area(&mesh), 4.0f, 1e-6);
    assert_null(mesh.normals);
    gn_mesh_finish(&mesh);
    assert_int_equal(read_text("b.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nl 1 2 3\n", &mesh, &error),
                     -EINVAL);
    assert_null(mesh.positions);
}

static void test_obj_colours_are_albedos(void **state)
{
    (void)state;
    const char *obj = "mtllib c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                      "usemtl red\nf 1 2 3\nusemtl grey\nf 1 2 4\n";
    const char *mtl = "newmtl red\nKd 0.75 0.125 0.0625\n\nnewmtl grey\nKd 0.25 0.25 0.25\n";
    struct gn_mesh mesh = {0};
    struct gn_error error;
    gn_test_folder_write_text("c.mtl", mtl);
    assert_int_equal(read_text("c.obj", obj, &mesh, &error), 0);
    assert_int_equal(mesh.n_triangles, 2);
    assert_non_null(mesh.albedos);
    int red = mesh.albedos[0] > 0.5f ? 0 : 1;              // the file's order of meshes is Assimp's
    assert_float_equal(mesh.albedos[3 * red], 0.75f, 0.0); // as written: no sRGB curve
    assert_float_equal(mesh.albedos[3 * red + 1], 0.125f, 0.0);
    assert_float_equal(mesh.albedos[3 * (1 - red)], 0.25f, 0.0);
    gn_mesh_finish(&mesh);

    mtl = "newmtl red\nKd 1.5 0 0\n\nnewmtl grey\nKd 0.25 0.25 0.25\n";
    gn_test_folder_write_text("c.mtl", mtl);
    assert_int_equal(read_text("c.obj", obj, &mesh, &error), -EINVAL);
    assert_non_null(strstr(error.text, "albedo 1.5"));
    assert_non_null(strstr(error.text, "c.obj"));
    remove_file("c.mtl");
}

static void test_ply_is_read(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    assert_int_equal(read_text("a.ply",
                               "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                               "property float y\nproperty float z\nelement face 1\n"
                               "property list uchar int vertex_indices\nend_header\n"
                               "0 0 5\n3 0 5\n0 3 5\n3 0 1 2\n",
                               &mesh, &error),
                     0);
    assert_int_equal(mesh.n_triangles, 1);
    assert_float_equal((float)get_area(&mesh), 4.5f, 1e-6);
    assert_float_equal(mesh.positions[2], 5.0f, 0.0); // axes as in the file
    gn_mesh_finish(&mesh);
}

/** A glTF of one cube under a node with that matrix (column-major, as glTF has it). */
static int read_gltf(const char *matrix, const char *base_color, bool has_normals,
                     struct gn_mesh *out_mesh, struct gn_error *error)
{
    struct gn_mesh cube = gn_test_make_cube(1.0f);
    uint8_t buffer[8 * 12 + 36 * 4 + 8 * 12];
    float normals[24];
    for (int i = 0; i < 24; i++) // first two: none at all; the others towards the corners
        normals[i] = i < 3 ? NAN : i < 6 ? 0.0f : cube.positions[i] * 1.1547005f;
    memcpy(buffer, cube.positions, 96);
    memcpy(buffer + 96, cube.triangles, 144);
    memcpy(buffer + 240, normals, 96);
    gn_mesh_finish(&cube);
    gn_test_folder_write("g.bin", buffer, sizeof(buffer));
    char text[2048];
    (void)snprintf(
        text, sizeof(text),
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"children\":[1],\"matrix\":%s},{\"mesh\":0,\"scale\":[2,2,2]}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0%s},\"indices\":1,"
        "\"material\":0}]}],"
        "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":%s}}],"
        "\"buffers\":[{\"uri\":\"g.bin\",\"byteLength\":336}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":96},"
        "{\"buffer\":0,\"byteOffset\":96,\"byteLength\":144},"
        "{\"buffer\":0,\"byteOffset\":240,\"byteLength\":96}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":8,\"type\":\"VEC3\","
        "\"min\":[-0.5,-0.5,-0.5],\"max\":[0.5,0.5,0.5]},"
        "{\"bufferView\":1,\"componentType\":5125,\"count\":36,\"type\":\"SCALAR\"},"
        "{\"bufferView\":2,\"componentType\":5126,\"count\":8,\"type\":\"VEC3\"}]}",
        matrix, has_normals ? ",\"NORMAL\":2" : "", base_color);
    int ret = read_text("g.gltf", text, out_mesh, error);
    remove_file("g.bin");
    return ret;
}

static void test_gltf_nodes_move_turn_and_mirror(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    int ret = read_gltf("[-1,0,0,0, 0,1,0,0, 0,0,1,0, 10,20,30,1]", "[0.5,0.25,0.125,1]", true,
                        &mesh, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_int_equal(mesh.n_triangles, 12);
    assert_float_equal((float)get_area(&mesh), 24.0f, 1e-4); // both nodes' transforms: side 2
    // Mirrored, yet the windings look outside still: moved back, the volume is positive.
    for (int i = 0; i < mesh.n_vertices; i++) {
        for (int k = 0; k < 3; k++) {
            mesh.positions[3 * i + k] -= 10.0f * (float)(k + 1);
            assert_float_equal(fabsf(mesh.positions[3 * i + k]), 1.0f, 1e-5);
        }
        // The two unusable normals are mended; all look towards their corner.
        float out = 0.0f;
        for (int k = 0; k < 3; k++)
            out += mesh.normals[3 * i + k] * mesh.positions[3 * i + k] / sqrtf(3.0f);
        assert_true(out > 0.8f);
    }
    assert_float_equal((float)get_volume6(&mesh), 48.0f, 1e-4);
    assert_null(mesh.albedos);
    assert_float_equal(mesh.materials[mesh.material[11]].factors.albedo[1], 0.25f, 0.0);
    gn_mesh_finish(&mesh);
}

static void test_gltf_refuses(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    const char *colour = "[0.5,0.25,0.125,1]";
    assert_int_equal(
        read_gltf("[1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]", colour, false, &mesh, &error), -EINVAL);
    assert_non_null(strstr(error.text, "transform is singular"));
    assert_int_equal(
        read_gltf("[1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]", colour, false, &mesh, &error), -EINVAL);
    assert_non_null(strstr(error.text, "projective"));
    assert_int_equal(
        read_gltf("[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]", "[2,0,0,1]", false, &mesh, &error),
        -EINVAL);
    assert_non_null(strstr(error.text, "albedo must lie in [0, 1]"));
}

static void test_bad_files_are_refused(void **state)
{
    (void)state;
    const struct {
        const char *name;
        const char *text;
        const char *says;
    } cases[] = {
        {"empty.obj", "", "empty.obj"},
        {"text.obj", "these are no triangles, whatever is said about them\n", "text.obj"},
        {"nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"},
        {"inf.obj", "v 1e999 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "inf.obj"},
        {"index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "index.obj"},
        {"flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"},
        {"a.stl", "solid a\nendsolid a\n", ".obj, .gltf, .glb and .ply are read"},
        {"none", "v 0 0 0\n", ".obj, .gltf, .glb and .ply are read"},
        {"bad.gltf", "{\"asset\":{\"version\":\"2.0\"}", "bad.gltf"},
        {"bad.glb", "glTF\x02", "bad.glb"},
        {"bad.ply", "ply\nformat ascii 1.0\nelement vertex 2000000000\n", "no end_header"},
        {"huge.ply",
         "ply\nformat ascii 1.0\nelement vertex 2000000000\nproperty float x\nend_header\n1\n",
         "promises 2000000000 elements"},
        {"list.ply",
         "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
         "property float z\nelement face 1\nproperty list uint int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n4294967295 0 1 2\n",
         "counted as uint"},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        struct gn_mesh mesh = {0};
        struct gn_error error;
        int ret = read_text(cases[i].name, cases[i].text, &mesh, &error);
        if (ret == 0 || !strstr(error.text, cases[i].says))
            print_message("# %s: %d %s\n", cases[i].name, ret, error.text);
        assert_true(ret < 0);
        assert_non_null(strstr(error.text, cases[i].says));
        assert_null(strchr(error.text, '\n'));
        assert_null(mesh.positions);
    }
}

static void test_absent_directory_and_huge(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error = {0};
    assert_int_equal(gn_mesh_read_file(gn_test_folder_get_path("absent.obj"), &mesh, &error),
                     -ENOENT);
    assert_non_null(strstr(error.text, "absent.obj"));
    assert_int_equal(gn_mesh_read_file("/tmp", &mesh, &error), -EINVAL);
    assert_non_null(strstr(error.text, "not a regular file"));
    gn_test_folder_write("huge.obj", "", 0);
    assert_int_equal(truncate(gn_test_folder_get_path("huge.obj"), (off_t)1 << 32), 0);
    assert_int_equal(gn_mesh_read_file(gn_test_folder_get_path("huge.obj"), &mesh, &error), -EFBIG);
    remove_file("huge.obj");
}

static void test_real_and_nasty_files(void **state)
{
    (void)state;
    const struct {
        const char *name;
        int n_triangles; // 0: refused
        bool has_normals;
    } cases[] = {
        {"glmark2_bunny.obj", 69666, false},
        {"materialx_teapot.obj", 25200, true},
        {"spot.obj", 5856, true},
        {"nasty/assimp_box_UTF16BE.obj", 0, false},
        {"nasty/assimp_empty.obj", 0, false},
        {"nasty/assimp_empty.ply", 0, false},
        {"nasty/assimp_issue623.ply", 0, false},
        {"nasty/assimp_malformed.obj", 0, false},
        {"nasty/assimp_OutOfMemory.off", 0, false},
        {"nasty/assimp_point_cloud.obj", 0, false},
        {"nasty/tinyobj_invalid-face-definition.obj", 0, false},
        {"nasty/tinyobj_invalid-relative-vertex-index.obj", 0, false},
        {"nasty/tinyobj_issue-140-zero-face-idx.obj", 0, false},
        {"nasty/tinyobj_cornell_box.obj", 36, false},
        {"nasty/gltf/BoxBadNormals.glb", 12, true},
        {"nasty/gltf/BoxWithInfinites.glb", 0, false},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        char file[128], path[PATH_MAX];
        (void)snprintf(file, sizeof(file), "mesh/%s", cases[i].name);
        real_data_path(file, path);
        struct gn_mesh mesh = {0};
        struct gn_error error = {0};
        int ret = gn_mesh_read_file(path, &mesh, &error);
        if (mesh.n_triangles != cases[i].n_triangles)
            print_message("# %s: %d triangles %s\n", path, mesh.n_triangles, error.text);
        assert_int_equal(mesh.n_triangles, cases[i].n_triangles);
        assert_int_equal(ret == 0, cases[i].n_triangles > 0);
        assert_int_equal(mesh.normals != NULL, cases[i].has_normals);
        gn_mesh_finish(&mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_check_drops_triangles_without_area),
        cmocka_unit_test(test_check_refuses),
        cmocka_unit_test(test_obj_comes_back_as_written),
        cmocka_unit_test(test_obj_polygons_points_and_lines),
        cmocka_unit_test(test_obj_colours_are_albedos),
        cmocka_unit_test(test_ply_is_read),
        cmocka_unit_test(test_gltf_nodes_move_turn_and_mirror),
        cmocka_unit_test(test_gltf_refuses),
        cmocka_unit_test(test_bad_files_are_refused),
        cmocka_unit_test(test_absent_directory_and_huge),
        unit_test_with_real_data(test_real_and_nasty_files, "mesh"),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
