/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What sends light in scene.json: emission, streams and their uvs, lamps. */
#include "server/scene/scene.h"

#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static char folder[64];
static char manifest[128]; // folder/scene.json

static const char *get_path(const char *name)
{
    static char path[128];
    (void)snprintf(path, sizeof(path), "%s/%s", folder, name);
    return path;
}

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

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
    (void)snprintf(folder, sizeof(folder), "/tmp/gnomon-scene-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    (void)snprintf(manifest, sizeof(manifest), "%s/scene.json", folder);
    for (size_t i = 0; i < LENGTH(meshes); i++)
        write_text(get_path(meshes[i][0]), meshes[i][1]);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (size_t i = 0; i < LENGTH(meshes); i++)
        (void)unlink(get_path(meshes[i][0]));
    (void)unlink(manifest);
    return rmdir(folder);
}

static int read_scene(const char *json, struct gn_scene **out_scene, struct gn_error *error)
{
    write_text(manifest, json);
    *error = (struct gn_error){0};
    return gn_scene_read_file(manifest, NULL, out_scene, error);
}

/** The surface straight below (x, y, 10), or above (x, y, -10). */
static struct gn_surface look(const struct gn_scene *scene, float x, float y, bool upwards)
{
    const float org[3] = {x, y, upwards ? -10.0f : 10.0f};
    const float dir[3] = {0.0f, 0.0f, upwards ? 1.0f : -1.0f};
    struct gn_rt_hit hit;
    struct gn_surface surface;
    assert_true(gn_rt_intersect(scene->rt, GN_RT_ALL, org, dir, 0.0f, INFINITY, &hit));
    gn_scene_get_surface(scene, dir, &hit, &surface);
    return surface;
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
    for (size_t i = 0; i < LENGTH(cases); i++) {
        struct gn_scene *scene = NULL;
        struct gn_error error;
        int ret = read_scene(cases[i].json, &scene, &error);
        bool says = strstr(error.text, cases[i].says[0]) && strstr(error.text, cases[i].says[1]) &&
                    strstr(error.text, manifest) && !strchr(error.text, '\n');
        if (ret == 0 || !says)
            print_message("# %s: %d %s\n", cases[i].json, ret, error.text);
        assert_true(ret < 0);
        assert_true(says);
        assert_null(scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_emission_and_lamps_are_read),
        cmocka_unit_test(test_errors_say_where),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
