/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Scenes read from a scene.json in the test's folder (tests/folder.h).
 */
#ifndef GN_TESTS_UNIT_SCENE_CASES_H
#define GN_TESTS_UNIT_SCENE_CASES_H

#include <math.h>
#include <string.h>

#include "server/scene/scene.h"
#include "tests/folder.h"
#include "tests/unit/cmocka_setup.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static inline int read_scene(const char *json, struct gn_scene **out_scene, struct gn_error *error)
{
    gn_test_folder_write_text("scene.json", json);
    *error = (struct gn_error){0};
    return gn_scene_read_file(gn_test_folder_get_path("scene.json"), NULL, out_scene, error);
}

/** Fails unless the scene is refused with one line that names the file and says both. */
static inline void assert_refused(const char *json, const char *const says[static 2])
{
    struct gn_scene *scene = NULL;
    struct gn_error error;
    int ret = read_scene(json, &scene, &error);
    bool is_said = strstr(error.text, says[0]) && strstr(error.text, says[1]) &&
                   strstr(error.text, gn_test_folder_get_path("scene.json")) &&
                   !strchr(error.text, '\n');
    if (ret == 0 || !is_said)
        fail_msg("%s: %d %s", json, ret, error.text);
    assert_null(scene);
}

/** The surface straight below (x, y, 10), or above (x, y, -10). */
static inline struct gn_surface look(const struct gn_scene *scene, float x, float y, bool upwards)
{
    const float org[3] = {x, y, upwards ? -10.0f : 10.0f};
    const float dir[3] = {0.0f, 0.0f, upwards ? 1.0f : -1.0f};
    struct gn_rt_hit hit;
    struct gn_surface surface;
    assert_true(gn_rt_intersect(scene->rt, GN_RT_ALL, org, dir, 0.0f, INFINITY, &hit));
    gn_scene_get_surface(scene, dir, &hit, &surface);
    return surface;
}

#endif
