/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The nasty mesh files of the folder GNOMON_DATA names: each is refused with its name and a reason,
 * or stands on a floor, is seen and throws a shadow, by every way that must not matter.
 */
#include "tests/unit/cmocka_setup.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/meshes.h"
#include "tests/numeric/extreme.h"
#include "tests/real_data.h"

#define SIDE 32

static const float grey[3] = {0.5f, 0.5f, 0.5f};

static void count(void *context, const struct gn_extreme_view *view)
{
    int *n = context;
    for (int i = 0; i < SIDE * SIDE; i++) {
        n[0] += view->layers->virtual_rgba.data[4 * i + 3] > 0;
        n[1] += view->layers->shadow.data[3 * i] < 1;
    }
}

/** The mesh as large as the cube of 1 m, on the floor's middle. */
static void set_matrix(struct gn_scene_object *object)
{
    const struct gn_mesh *mesh = &object->mesh;
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    double size = 0;
    for (int i = 0; i < 3 * mesh->n_vertices; i++) {
        low[i % 3] = fmin(low[i % 3], (double)mesh->positions[i]);
        high[i % 3] = fmax(high[i % 3], (double)mesh->positions[i]);
    }
    for (int k = 0; k < 3; k++)
        size = fmax(size, high[k] - low[k]);
    for (int k = 0; k < 3; k++) {
        object->world_from_object[5 * k] = 1 / size;
        object->world_from_object[4 * k + 3] =
            -0.5 * (low[k] + high[k]) / size + (k == 2 ? 0.6 : 0);
    }
}

/** True where it can be read. */
static bool check_file(const char *path)
{
    static const double eye[3] = {1.7, -2.3, 1.9}, target[3] = {0, 0, 0.4};
    static const struct gn_render_options one_ray = {.single_ray = true};
    const struct gn_extreme_place place = gn_extreme_at_scale(1);
    struct gn_test_stage stage = {0};
    struct gn_mesh mesh = {0};
    struct gn_error error = {0};
    int n[2] = {0};
    if (gn_mesh_read_file(path, &mesh, &error) < 0) {
        print_message("# %s\n", strrchr(error.text, '/') ? strrchr(error.text, '/') : error.text);
        assert_non_null(strstr(error.text, path));
        assert_true(strlen(error.text) > strlen(path) + 10 && !strchr(error.text, '\n'));
        return false;
    }
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(6, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, mesh, 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    stage.objects[1].has_material = false; // the file's own
    set_matrix(&stage.objects[1]);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, &place, 8);
    gn_extreme_aim(&stage, &place, SIDE, 32, eye, target);
    gn_extreme_check(&stage, NULL, &one_ray, count, n);
    print_message("# %s: %d pixels, %d in its shadow\n", strrchr(path, '/'), n[0], n[1]);
    assert_true(n[0] > 0 && n[1] > 0);
    gn_test_stage_finish(&stage);
    return true;
}

static void test_nasty_meshes(void **state)
{
    static const char *const folders[] = {"mesh/nasty", "mesh/nasty/gltf"};
    int n[2] = {0};
    (void)state;
    for (int i = 0; i < 2; i++) {
        char path[PATH_MAX];
        DIR *folder = opendir(real_data_path(folders[i], path));
        assert_non_null(folder);
        for (struct dirent *entry; (entry = readdir(folder)) != NULL;) {
            char file[PATH_MAX];
            if (!strchr(entry->d_name, '.') || entry->d_name[0] == '.')
                continue;
            int length = snprintf(file, sizeof(file), "%s/%s", path, entry->d_name);
            assert_in_range(length, 1, PATH_MAX - 1);
            n[check_file(file)]++;
        }
        closedir(folder);
    }
    print_message("# %d refused, %d rendered\n", n[0], n[1]);
    assert_true(n[0] >= 10 && n[1] >= 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_with_real_data(test_nasty_meshes, "mesh/nasty/tinyobj_cornell_box.obj"),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
