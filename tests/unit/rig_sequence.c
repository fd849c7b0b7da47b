/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A small sequence on disk: made twice the same, kept where it is complete, judged, drawn; and its
 * scene reads back as the server sees it. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/camera.h"
#include "common/file.h"
#include "server/scene/scene.h"
#include "tests/rig/room.h"
#include "tests/rig/sequence.h"
#include "tests/rig/vec.h"

static const char *const directories[2] = {"rig-sequence-a", "rig-sequence-b"};

static void get_path(int which, const char *name, char out[static 256])
{
    snprintf(out, 256, "%s/%s", directories[which], name);
}

static void make(int which, int threads, uint64_t seed)
{
    const struct gn_rig_sequence_options options = {.directory = directories[which],
                                                    .light = "lamps",
                                                    .width = 32,
                                                    .height = 24,
                                                    .frames_per_light = 1,
                                                    .probe_size = 32,
                                                    .bounces = 2,
                                                    .paths = 8,
                                                    .seed = seed,
                                                    .noise = 1.5,
                                                    .jitter_mm = 1,
                                                    .jitter_deg = 0.2,
                                                    .is_distorted = true};
    struct gn_error error = {0};
    struct gn_pool *pool;
    assert_int_equal(gn_pool_create(threads, &pool), 0);
    if (gn_rig_make_sequence(&options, pool, NULL, &error))
        fail_msg("%s", error.text);
    gn_pool_destroy(&pool);
}

static bool is_same_file(const char *name)
{
    uint8_t *data[2];
    size_t size[2];
    char path[256];
    for (int i = 0; i < 2; i++) {
        get_path(i, name, path);
        assert_int_equal(gn_file_read(path, 1 << 24, &data[i], &size[i], NULL), 0);
    }
    bool same = size[0] == size[1] && !memcmp(data[0], data[1], size[0]);
    free(data[0]);
    free(data[1]);
    return same;
}

static struct stat get_stat(int which, const char *name)
{
    struct stat s;
    char path[256];
    get_path(which, name, path);
    assert_int_equal(stat(path, &s), 0);
    return s;
}

static void test_same_bytes(void **state)
{
    static const char *const names[] = {"sequence.json", "camera/0003.png",   "truth/0002.png",
                                        "exr/0001.exr",  "env/fisheye-2.png", "env/angular-1.exr"};
    (void)state;
    make(0, 1, 7);
    make(1, 3, 7);
    for (size_t i = 0; i < GN_ARRAY_LEN(names); i++)
        assert_true(is_same_file(names[i]));
}

/* A complete sequence is left alone; one frame that is missing is made again, the rest kept; other
 * parameters make everything anew. */
static void test_cache(void **state)
{
    char path[256];
    (void)state;
    ino_t whole = get_stat(1, "sequence.json").st_ino, kept = get_stat(1, "exr/0001.exr").st_ino;
    make(1, 2, 7);
    assert_true(get_stat(1, "sequence.json").st_ino == whole);
    get_path(1, "sequence.json", path);
    assert_int_equal(unlink(path), 0);
    get_path(1, "done/0002", path);
    assert_int_equal(unlink(path), 0);
    ino_t redone = get_stat(1, "exr/0002.exr").st_ino;
    make(1, 2, 7);
    assert_true(get_stat(1, "exr/0001.exr").st_ino == kept);
    assert_true(get_stat(1, "exr/0002.exr").st_ino != redone);
    assert_true(is_same_file("sequence.json") && is_same_file("exr/0002.exr"));
    make(1, 2, 8);
    assert_false(is_same_file("exr/0001.exr"));
    assert_false(is_same_file("sequence.json"));
}

static double get_figure(const json_t *report, const char *part, const char *key)
{
    const json_t *all = json_object_get(report, "all");
    return json_number_value(json_object_get(json_object_get(all, part), key));
}

/* The truth has no error; the camera frame has that of an untouched one. */
static void test_judge(void **state)
{
    struct gn_rig_sequence sequence;
    json_t *report;
    (void)state;
    assert_int_equal(gn_rig_sequence_read(directories[0], &sequence, NULL), 0);
    assert_int_equal(gn_rig_judge(&sequence, "rig-sequence-a/truth", NULL, &report, NULL), 0);
    assert_true(get_figure(report, "object", "pixels") > 100);
    assert_true(get_figure(report, "shadow", "pixels") > 100);
    assert_true(get_figure(report, "object", "composite") == 0);
    assert_true(get_figure(report, "shadow", "composite") == 0);
    assert_true(get_figure(report, "object", "untouched") > 5);
    json_decref(report);
    assert_int_equal(gn_rig_judge(&sequence, "rig-sequence-a/camera", NULL, &report, NULL), 0);
    assert_true(get_figure(report, "object", "composite") ==
                get_figure(report, "object", "untouched"));
    json_decref(report);
    struct gn_error error = {0};
    // The same frames with bounces: their truth is another one.
    struct gn_rig_sequence bounced;
    assert_int_equal(gn_rig_sequence_read("rig-sequence-a/bounces", &bounced, NULL), 0);
    assert_int_equal(gn_rig_judge(&bounced, "rig-sequence-a/truth_bounces", NULL, &report, NULL),
                     0);
    assert_true(get_figure(report, "object", "composite") == 0);
    json_decref(report);
    assert_int_equal(gn_rig_judge(&bounced, "rig-sequence-a/truth", NULL, &report, NULL), 0);
    assert_true(get_figure(report, "object", "composite") > 0);
    json_decref(report);
    gn_rig_sequence_finish(&bounced);
    assert_int_equal(gn_rig_judge(&sequence, "rig-sequence-a/env", NULL, &report, &error), -ENOENT);
    assert_non_null(strstr(error.text, "rig-sequence-a/env/0000.png"));
    gn_rig_sequence_finish(&sequence);
}

/* Truths of other seeds differ as the noise of both says: two normal numbers of one deviation by
 * 2 / sqrt(pi) of it. */
static void check_noise(const struct gn_rig_sequence *sequence, const char *other)
{
    static const char *const parts[2] = {"object", "shadow"};
    json_t *report;
    assert_int_equal(gn_rig_judge(sequence, other, NULL, &report, NULL), 0);
    for (int i = 0; i < 2; i++) {
        double expected = 2 / sqrt(GN_RIG_PI) * get_figure(report, parts[i], "noise");
        double found = get_figure(report, parts[i], "composite");
        print_message("# %s: %s off by %.2f, %.2f expected\n", other, parts[i], found, expected);
        assert_true(found > 0.7 * expected && found < 1.3 * expected);
    }
    json_decref(report);
}

static void test_noise(void **state)
{
    struct gn_rig_sequence direct, bounced;
    (void)state;
    assert_int_equal(gn_rig_sequence_read("rig-sequence-a", &direct, NULL), 0);
    assert_int_equal(gn_rig_sequence_read("rig-sequence-a/bounces", &bounced, NULL), 0);
    check_noise(&direct, "rig-sequence-b/truth"); // of seed 8 since test_cache
    check_noise(&bounced, "rig-sequence-b/truth_bounces");
    gn_rig_sequence_finish(&direct);
    gn_rig_sequence_finish(&bounced);
}

static void test_sheet(void **state)
{
    const struct gn_rig_sheet_options options = {.title = "test",
                                                 .composites = "rig-sequence-a/truth",
                                                 .shadow = "rig-sequence-a/object",
                                                 .n_rows = 2};
    struct gn_rig_sequence sequence;
    struct gn_image8 sheet;
    long lit = 0;
    (void)state;
    assert_int_equal(gn_rig_sequence_read(directories[0], &sequence, NULL), 0);
    assert_int_equal(gn_rig_draw_sheet(&sequence, &options, &sheet, NULL), 0);
    for (int i = 0; i < sheet.width * sheet.height; i++)
        lit += sheet.data[3 * i] > 60;
    assert_true(lit > 2 * 3 * 32 * 24 / 2);
    gn_image8_finish(&sheet);
    gn_rig_sequence_finish(&sequence);
}

/* What the server reads is what the rig traced. */
static void test_scene(void **state)
{
    struct gn_error error = {0};
    struct gn_scene *scene;
    struct gn_camera camera;
    struct gn_rig_room room;
    (void)state;
    if (gn_scene_read_file("rig-sequence-a/scene.json", NULL, &scene, &error))
        fail_msg("%s", error.text);
    if (gn_camera_read_file("rig-sequence-a/camera.json", &camera, &error))
        fail_msg("%s", error.text);
    assert_int_equal(scene->n_real_triangles + scene->n_virtual_triangles, GN_RIG_DEMO_TRIANGLES);
    assert_int_equal(gn_rig_room_init_demo(false, &room, NULL), 0);
    assert_int_equal(scene->n_objects, room.n_objects);
    for (int i = 0; i < room.n_objects; i++) {
        const struct gn_mesh *ours = &room.objects[i].mesh, *read = &scene->objects[i].mesh;
        assert_int_equal(read->n_triangles, ours->n_triangles);
        for (int t = 0; t < ours->n_triangles; t++)
            for (int c = 0; c < 3; c++) {
                const float *a = ours->positions + 3 * (size_t)ours->triangles[3 * t + c];
                const float *b = read->positions + 3 * (size_t)read->triangles[3 * t + c];
                assert_memory_equal(a, b, 3 * sizeof(*a));
            }
        if (ours->albedos)
            assert_memory_equal(ours->albedos, read->albedos,
                                3 * sizeof(float) * (size_t)ours->n_triangles);
    }
    gn_rig_room_finish(&room);
    gn_scene_destroy(&scene);
}

static int remove_all(void **state)
{
    (void)state;
    return system("rm -rf rig-sequence-a rig-sequence-b") != 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bytes), cmocka_unit_test(test_cache),
        cmocka_unit_test(test_judge),      cmocka_unit_test(test_noise),
        cmocka_unit_test(test_sheet),      cmocka_unit_test(test_scene),
    };
    return cmocka_run_group_tests(tests, remove_all, remove_all);
}
