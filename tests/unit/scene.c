/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/pose.h"
#include "tests/meshes.h"
#include "tests/unit/scene_cases.h"

/** A folder with two meshes: a.obj without colours and red.obj with them. */
static int set_up(void **state)
{
    (void)state;
    if (gn_test_folder_create() < 0)
        return -1;
    gn_test_folder_write_text("a.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n");
    gn_test_folder_write_text("red.obj", "mtllib red.mtl\nusemtl red\n"
                                         "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n");
    gn_test_folder_write_text("red.mtl", "newmtl red\nKd 0.75 0.25 0.125\n");
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    static const char *const names[] = {"a.obj", "red.obj", "red.mtl", "scene.json"};
    return gn_test_folder_remove(names, LENGTH(names));
}

static void test_manifest_is_read(void **state)
{
    (void)state;
    struct gn_scene *scene = NULL;
    struct gn_error error;
    int ret =
        read_scene("{\"objects\":["
                   "{\"mesh\":\"a.obj\",\"role\":\"real\"},"
                   "{\"mesh\":\"red.obj\",\"role\":\"virtual\",\"name\":\"a red square\","
                   " \"world_from_object\":[1,0,0,5, 0,1,0,0, 0,0,1,2, 0,0,0,1]},"
                   "{\"mesh\":\"red.obj\",\"role\":\"virtual\",\"material\":{\"type\":\"diffuse\"},"
                   " \"world_from_object\":[1,0,0,10, 0,1,0,0, 0,0,1,0, 0,0,0,1]},"
                   "{\"mesh\":\"red.obj\",\"role\":\"virtual\","
                   " \"material\":{\"type\":\"diffuse\",\"albedo\":[0.1,0.2,0.3]},"
                   " \"world_from_object\":[1,0,0,15, 0,1,0,0, 0,0,1,0, 0,0,0,1]},"
                   "{\"mesh\":\"a.obj\",\"role\":\"virtual\",\"material\":{\"type\":\"mirror\"},"
                   " \"world_from_object\":[1,0,0,20, 0,1,0,0, 0,0,1,0, 0,0,0,1]},"
                   "{\"mesh\":\"a.obj\",\"role\":\"virtual\","
                   " \"material\":{\"type\":\"glass\",\"roughness\":0.25,\"ior\":1.75},"
                   " \"world_from_object\":[1,0,0,25, 0,1,0,0, 0,0,1,0, 0,0,0,1]}"
                   "],\"lights\":[]}",
                   &scene, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_int_equal(scene->n_objects, 6);
    assert_int_equal(scene->n_real_triangles, 2);
    assert_int_equal(scene->n_virtual_triangles, 10);
    assert_string_equal(scene->objects[0].name, "a.obj");
    assert_string_equal(scene->objects[1].name, "a red square");

    struct gn_surface s = look(scene, 0.1f, 0.2f, false);
    assert_int_equal(s.role, GN_RT_REAL);
    assert_float_equal(s.albedo[0], 0.5f, 0.0); // neither the mesh nor the manifest says more
    s = look(scene, 5.1f, 0.2f, false);
    assert_int_equal(s.role, GN_RT_VIRTUAL);
    assert_float_equal(s.point[2], 2.0f, 1e-6);
    assert_float_equal(s.albedo[0], 0.75f, 0.0); // the mesh's own
    assert_float_equal(look(scene, 10.1f, 0.2f, false).albedo[2], 0.125f, 0.0);
    s = look(scene, 15.1f, 0.2f, false);
    assert_int_equal(s.material, GN_MATERIAL_DIFFUSE);
    assert_float_equal(s.albedo[1], 0.2f, 1e-7); // the manifest's
    s = look(scene, 20.1f, 0.2f, false);
    assert_int_equal(s.material, GN_MATERIAL_MIRROR);
    assert_float_equal(s.albedo[0], 1.0f, 0.0);
    s = look(scene, 25.1f, 0.2f, false);
    assert_int_equal(s.material, GN_MATERIAL_GLASS);
    assert_float_equal(s.roughness, 0.25f, 0.0);
    assert_float_equal(s.ior, 1.75f, 0.0);
    gn_scene_destroy(&scene);
    assert_null(scene);
}

static void test_manifest_errors_say_where(void **state)
{
    (void)state;
#define OBJECT "{\"mesh\":\"a.obj\",\"role\":\"real\""
    const struct {
        const char *json;
        const char *says[2];
    } cases[] = {
        {"", {"scene.json", ""}},
        {"[]", {"scene.json", ""}},
        {"{}", {"objects", ""}},
        {"{\"objects\":[]}", {"objects", "1"}},
        {"{\"objects\":[7]}", {"objects[0]", "object"}},
        {"{\"objects\":[{\"role\":\"real\"}]}", {"objects[0]", "mesh"}},
        {"{\"objects\":[{\"mesh\":\"a.obj\"}]}", {"objects[0]", "role"}},
        {"{\"objects\":[{\"mesh\":\"a.obj\",\"role\":\"ghost\"}]}", {"role", "virtual"}},
        {"{\"objects\":[{\"mesh\":\"no.obj\",\"role\":\"real\"}]}", {"objects[0].mesh", "/no.obj"}},
        {"{\"objects\":[{\"mesh\":\"\",\"role\":\"real\"}]}", {"objects[0].mesh", ""}},
        {"{\"objects\":[" OBJECT ",\"colour\":1}]}", {"objects[0]", "colour"}},
        {"{\"objects\":[" OBJECT ",\"name\":\"\"}]}", {"objects[0].name", "1 to 255"}},
        {"{\"objects\":[" OBJECT "}],\"light\":[]}", {"light", ""}},
        {"{\"objects\":[" OBJECT "}],\"lights\":[{}]}", {"lights[0]", "type"}},
        {"{\"objects\":[" OBJECT "}],\"lights\":3}", {"lights", "array"}},
        {"{\"objects\":[" OBJECT ",\"material\":{}}]}", {"objects[0].material", "type"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"glass\",\"metallic\":1}}]}",
         {"objects[0].material.metallic", "a glass material has none"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"glass\",\"ior\":0.9}}]}",
         {"objects[0].material.ior", "0.9"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"ggx\",\"roughness\":1.1}}]}",
         {"objects[0].material.roughness", "1.1"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"ggx\",\"metallic\":\"yes\"}}]}",
         {"objects[0].material.metallic", "number"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"wood\"}}]}",
         {"type", "expected one of 'diffuse', 'mirror', 'glass', 'ggx', found 'wood'"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"diffuse\",\"ior\":1.5}}]}",
         {"objects[0].material.ior", "a diffuse material has none"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"diffuse\",\"albedo\":[0,0,1.5]}}]}",
         {"objects[0].material.albedo", "[0, 1]"}},
        {"{\"objects\":[" OBJECT ",\"material\":{\"type\":\"diffuse\",\"albedo\":[0,0]}}]}",
         {"objects[0].material.albedo", "3"}},
        {"{\"objects\":[" OBJECT ",\"world_from_object\":[1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]}]}",
         {"objects[0].world_from_object", "singular"}},
        {"{\"objects\":[" OBJECT ",\"world_from_object\":[1,0,0,0, 0,1,0,0, 0,0,1,0, 1,0,0,1]}]}",
         {"objects[0].world_from_object", "row-major"}},
        {"{\"objects\":[" OBJECT ",\"world_from_object\":[1,2,3]}]}",
         {"objects[0].world_from_object", "16"}},
        {"{\"objects\":[" OBJECT ",\"world_from_object\":[1,0,0,9e20, 0,1,0,0, 0,0,1,0, "
         "0,0,0,1]}]}",
         {"scene.json", "at most"}},
        {"{\"objects\":[" OBJECT
         ",\"name\":\"a\",\"movable\":true,\"world_from_object\":[-1,0,0,0, "
         "0,1,0,0, 0,0,1,0, 0,0,0,1]}]}",
         {"object 0 (a)", "mirrors"}},
        {"{\"objects\":[" OBJECT ",\"name\":\"a\",\"movable\":true,\"world_from_object\":[2,0,0,0, "
         "0,1,0,0, 0,0,1,0, 0,0,0,1]}]}",
         {"object 0 (a)", "stretches"}},
        {"{\"objects\":[" OBJECT ",\"name\":\"a\",\"movable\":true}," OBJECT ",\"name\":\"a\"}]}",
         {"objects 0 and 1", "both named \"a\""}},
        {"{\"objects\":[" OBJECT ",\"name\":\"a\",\"movable\":true,\"material\":{\"type\":"
         "\"diffuse\",\"emission\":[1,1,1]}}]}",
         {"object 0 (a)", "cannot send light"}},
        {"{\"objects\":[" OBJECT
         ",\"movable\":true,\"name\":\"0123456789012345678901234567890123456789"
         "012345678901234567890123\"}]}",
         {"object 0", "1 to 63 bytes"}},
    };
    for (size_t i = 0; i < LENGTH(cases); i++)
        assert_refused(cases[i].json, cases[i].says);
#undef OBJECT
}

static void test_create_takes_all_or_nothing(void **state)
{
    (void)state;
    struct gn_scene_object objects[2] = {
        {.name = strdup("ball"), .role = GN_RT_VIRTUAL, .mesh = gn_test_make_sphere(1.0f, 8)},
        {.name = strdup("bad"), .role = GN_RT_REAL, .mesh = gn_test_make_cube(1.0f)},
    };
    gn_mat4_identity(objects[0].world_from_object);
    gn_mat4_identity(objects[1].world_from_object);
    objects[1].world_from_object[0] = 0.0; // singular
    struct gn_scene *scene = NULL;
    struct gn_error error = {0};
    assert_int_equal(gn_scene_create(objects, 2, NULL, &scene, &error), -EINVAL);
    assert_non_null(strstr(error.text, "object 1 (bad)"));
    assert_null(scene);
    assert_string_equal(objects[0].name, "ball"); // still ours
    objects[1].world_from_object[0] = 1.0;
    assert_int_equal(gn_scene_create(objects, 2, NULL, &scene, &error), 0);
    assert_null(objects[0].name);
    assert_null(objects[1].mesh.positions);
    gn_scene_destroy(&scene);
    assert_int_equal(gn_scene_create(objects, 0, NULL, &scene, &error), -EINVAL);
}

static void test_normals_face_the_ray_and_turn_with_the_object(void **state)
{
    (void)state;
    // An ellipsoid by an uneven, mirroring scale: normals go by the inverse transpose.
    struct gn_scene_object object = {.role = GN_RT_VIRTUAL, .mesh = gn_test_make_sphere(1.0f, 64)};
    const double m[16] = {-2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1};
    memcpy(object.world_from_object, m, sizeof(m));
    struct gn_scene *scene = NULL;
    assert_int_equal(gn_scene_create(&object, 1, NULL, &scene, NULL), 0);
    uint64_t seed = 9;
    for (int i = 0; i < 1000; i++) {
        float dir[3];
        gn_test_random_direction(&seed, dir);
        const float inside[3] = {0};
        float outside[3];
        float back[3];
        for (int k = 0; k < 3; k++) {
            outside[k] = 5.0f * dir[k];
            back[k] = -dir[k];
        }
        struct gn_rt_hit hit;
        struct gn_surface s;
        assert_true(gn_rt_intersect(scene->rt, GN_RT_ALL, outside, back, 0.0f, INFINITY, &hit));
        gn_scene_get_surface(scene, back, &hit, &s);
        const double gradient[3] = {s.point[0] / 4.0, s.point[1], s.point[2] * 4.0};
        double length =
            sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]);
        for (int k = 0; k < 3; k++) // the ellipsoid's own normal, within a facet's error
            assert_float_equal(s.normal_shading[k], gradient[k] / length, 6e-3);
        double facing = 0.0;
        for (int k = 0; k < 3; k++)
            facing += (double)s.normal_geometric[k] * back[k];
        assert_true(facing <= 0.0);
        assert_true(s.is_front); // the matrix mirrors, and outside stays outside
        // From inside both turn round.
        assert_true(gn_rt_intersect(scene->rt, GN_RT_ALL, inside, dir, 0.0f, INFINITY, &hit));
        gn_scene_get_surface(scene, dir, &hit, &s);
        facing = 0.0;
        double same = 0.0;
        for (int k = 0; k < 3; k++) {
            facing += (double)s.normal_geometric[k] * dir[k];
            same += (double)s.normal_geometric[k] * s.normal_shading[k];
        }
        assert_true(facing < 0.0);
        assert_false(s.is_front);
        assert_true(same > 0.99);
    }
    gn_scene_destroy(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_manifest_is_read),
        cmocka_unit_test(test_manifest_errors_say_where),
        cmocka_unit_test(test_create_takes_all_or_nothing),
        cmocka_unit_test(test_normals_face_the_ray_and_turn_with_the_object),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
