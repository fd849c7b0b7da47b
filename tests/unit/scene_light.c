/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What sends light in scene.json: emission, streams and their uvs, lamps. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/scene_cases.h"

static const char *const meshes[][2] = {
    {"plain.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"},
    // The picture stands on its head, and covers only a part of the quad's uvs' square.
    {"uv.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 1\nvt 1 1\nvt 1 0.5\nvt 0 0.5\n"
               "f 1/1 2/2 3/3 4/4\n"},
    {"far_uv.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nvt 0 1\nvt 2 1\nvt 1 0\nf 1/1 2/2 3/3\n"},
    {"kite.obj", "v -1 -1 0\nv 1 -1 0\nv 2 2 0\nv -1 1 0\nf 1 2 3 4\n"},
};

static int set_up(void **state)
{
    (void)state;
    if (gn_test_folder_create() < 0)
        return -1;
    for (size_t i = 0; i < LENGTH(meshes); i++)
        gn_test_folder_write_text(meshes[i][0], meshes[i][1]);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    const char *names[LENGTH(meshes) + 1] = {"scene.json"};
    for (size_t i = 0; i < LENGTH(meshes); i++)
        names[i + 1] = meshes[i][0];
    return gn_test_folder_remove(names, LENGTH(names));
}

static void assert_uv(const struct gn_scene *scene, float x, float y, double u, double v)
{
    struct gn_surface s = look(scene, x, y, false);
    assert_true(fabs(s.uv[0] - u) < 1e-6 && fabs(s.uv[1] - v) < 1e-6);
}

static void test_emission_and_lamps_are_read(void **state)
{
    (void)state;
    struct gn_scene *scene = NULL;
    struct gn_error error;
    int ret = read_scene(
        "{\"objects\":["
        "{\"mesh\":\"plain.obj\",\"role\":\"real\",\"material\":{\"type\":\"diffuse\","
        " \"emission\":[1,2.5,1e12]}},"
        "{\"mesh\":\"plain.obj\",\"role\":\"virtual\",\"material\":{\"type\":\"diffuse\","
        " \"albedo\":[0.1,0.1,0.1],\"emission_stream\":\"tv\",\"emission_scale\":300},"
        " \"world_from_object\":[1,0,0,5, 0,1,0,0, 0,0,1,0, 0,0,0,1]},"
        "{\"mesh\":\"uv.obj\",\"role\":\"real\",\"material\":{\"type\":\"diffuse\","
        " \"emission_stream\":\"tv\"},"
        " \"world_from_object\":[-1,0,0,10, 0,1,0,0, 0,0,1,0, 0,0,0,1]}],"
        "\"lights\":[{\"type\":\"point\",\"position\":[1,2,3],\"intensity\":[4,5,6]},"
        "{\"type\":\"point\",\"position\":[-1,0,1e11],\"intensity\":[0,0,0],\"radius\":0.25,"
        " \"role\":\"virtual\"}]}",
        &scene, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    const struct gn_scene_object *o = scene->objects;
    assert_true(o[0].emission[1] == 2.5f && o[0].emission[2] == 1e12f);
    assert_null(o[0].emission_stream);
    assert_false(o[0].has_material); // emission alone leaves the mesh its own colours
    assert_string_equal(o[1].emission_stream, "tv");
    assert_true(o[1].emission_scale == 300 && o[2].emission_scale == 1 && o[1].emission[0] == 0);
    assert_int_equal(scene->n_lights, 2);
    assert_true(scene->lights[0].position[2] == 3 && scene->lights[0].intensity[0] == 4);
    assert_true(scene->lights[0].radius == 0 && scene->lights[0].role == GN_RT_REAL);
    assert_true(scene->lights[1].position[2] == 1e11 && scene->lights[1].radius == 0.25f);
    assert_int_equal(scene->lights[1].role, GN_RT_VIRTUAL);

    // Without uvs: the first corner is the picture's bottom left.
    assert_uv(scene, 5 - 0.5f, -0.8f, 0.25, 0.1);
    assert_uv(scene, 5 + 0.8f, 0.5f, 0.9, 0.75);
    assert_uv(scene, 10 + 0.5f, -0.5f, 0.25, 0.875); // the file's, mirrored in x by the matrix
    assert_int_equal(look(scene, 5, 0, false).object, 1);
    assert_true(look(scene, 0, 0, false).is_front);
    assert_false(look(scene, 0, 0, true).is_front);
    assert_true(look(scene, 10, 0, false).is_front); // the matrix mirrors, and outside stays
    assert_false(look(scene, 10, 0, true).is_front);
    gn_scene_destroy(&scene);
}

static void test_errors_say_where(void **state)
{
    (void)state;
#define MATERIAL(mesh, material)                                                                   \
    "{\"objects\":[{\"mesh\":\"" mesh "\",\"role\":\"real\",\"material\":{" material "}}]}"
#define LIGHT(light)                                                                               \
    "{\"objects\":[{\"mesh\":\"plain.obj\",\"role\":\"real\"}],\"lights\":[{" light "}]}"
    const struct {
        const char *json;
        const char *says[2];
    } cases[] = {
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission\":[1,2]"), {"emission", "3"}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission\":[1,2,-1]"),
         {"objects[0].material.emission", "[0, 1e12]"}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission\":[1,2,1.1e12]"),
         {"objects[0].material.emission", "[0, 1e12]"}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission\":[1,2,NaN]"), {"NaN", ""}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission\":[1,2,1e999]"), {"overflow", ""}},
        {MATERIAL("plain.obj", "\"type\":\"mirror\",\"emission\":[1,2,3]"),
         {"object 0", "diffuse material"}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission_scale\":3"),
         {"objects[0].material.emission_scale", "no emission_stream"}},
        {MATERIAL("plain.obj", "\"type\":\"diffuse\",\"emission_stream\":\"\""),
         {"emission_stream", "1 to 63"}},
        {MATERIAL("plain.obj",
                  "\"type\":\"diffuse\",\"emission_stream\":\"a\",\"emission_scale\":0"),
         {"objects[0].material.emission_scale", ""}},
        {MATERIAL("kite.obj", "\"type\":\"diffuse\",\"emission_stream\":\"a\""),
         {"object 0", "no uv"}},
        {MATERIAL("far_uv.obj", "\"type\":\"diffuse\",\"emission_stream\":\"a\""),
         {"object 0", "uv (2, 1)"}},
        {LIGHT("\"type\":\"spot\""), {"lights[0].type", "point"}},
        {LIGHT("\"type\":\"point\",\"intensity\":[1,1,1]"), {"lights[0]", "position"}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,0]"), {"lights[0]", "intensity"}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,2e11],\"intensity\":[1,1,1]"),
         {"lights[0].position", "1e11"}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,0],\"intensity\":[1,-1,1]"),
         {"lights[0].intensity", "W/sr"}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,0],\"intensity\":[1,1,1],\"radius\":-1"),
         {"lights[0].radius", ""}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,0],\"intensity\":[1,1,1],\"role\":\"x\""),
         {"lights[0].role", "virtual"}},
        {LIGHT("\"type\":\"point\",\"position\":[0,0,0],\"intensity\":[1,1,1],\"power\":1"),
         {"lights[0]", "power"}},
    };
#undef MATERIAL
#undef LIGHT
    for (size_t i = 0; i < LENGTH(cases); i++)
        assert_refused(cases[i].json, cases[i].says);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_emission_and_lamps_are_read),
        cmocka_unit_test(test_errors_say_where),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
