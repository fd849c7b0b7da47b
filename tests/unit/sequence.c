/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* sequence.json: what is read, and the words of every refusal. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/capture/sequence.h"
#include "common/file.h"
#include "tests/unit/cmocka_setup.h"

static const char dir[] = "unit_sequence.tmp";

#define FORMAT "\"format\": \"gnomon-sequence 1\""
#define CAMERA                                                                                     \
    "\"camera\": {\"width\": 8, \"height\": 6, \"fx\": 8, \"fy\": 8, \"cx\": 4, \"cy\": 3, "       \
    "\"distortion\": [0,0,0,0,0]}"
#define PROBE "\"environment\": {\"projection\": \"angular\"}"
#define HEAD FORMAT ", " CAMERA ", " PROBE
#define POSE(z) "\"world_from_camera\": [1,0,0,0, 0,1,0,0, 0,0,1," #z ", 0,0,0,1]"
#define FRAME(t, z)                                                                                \
    "{\"time_s\": " #t ", \"picture\": \"c/" #z ".png\", \"environment\": \"/e/" #z                \
    ".exr\", " POSE(z) "}"

static int set_up(void **state)
{
    (void)state;
    return system("rm -rf unit_sequence.tmp && mkdir unit_sequence.tmp");
}

static int tear_down(void **state)
{
    (void)state;
    return system("rm -rf unit_sequence.tmp");
}

static int read_text(const char *members, struct gn_sequence *out, struct gn_error *error)
{
    size_t size = strlen(members) + 3;
    char *text = malloc(size);
    assert_non_null(text);
    snprintf(text, size, "{%s}", members);
    assert_int_equal(gn_file_write("unit_sequence.tmp/sequence.json", text, strlen(text), NULL), 0);
    free(text);
    return gn_sequence_read(dir, out, error);
}

static void test_read(void **state)
{
    (void)state;
    struct gn_sequence s;
    struct gn_error error = {0};
    if (read_text(HEAD ", \"frames\": [" FRAME(1.5, 2) ", " FRAME(1.5, 3) ", " FRAME(2, 4) "]", &s,
                  &error) != 0)
        fail_msg("%s", error.text);
    assert_true(s.camera.width == 8 && s.camera.response.type == GN_RESPONSE_SRGB);
    assert_true(s.probe.projection.type == GN_PROJECTION_ANGULAR);
    assert_true(s.pictures.n_entries == 3 && s.environments.n_entries == 3);
    const struct gn_file_entry *p = s.pictures.entries, *e = s.environments.entries;
    assert_string_equal(p[0].path, "unit_sequence.tmp/c/2.png");
    assert_string_equal(e[2].path, "/e/4.exr");
    assert_true(p[1].time_s == 1.5 && e[2].time_s == 2);
    assert_true(p[2].has_pose && p[2].world_from_camera.translation[2] == 4 && !e[2].has_pose);
    gn_sequence_finish(&s);
    gn_sequence_finish(&s);
    assert_int_equal(s.pictures.n_entries, 0);
}

static void test_refusals(void **state)
{
    (void)state;
    static const struct {
        const char *members, *word;
    } cases[] = {
        {CAMERA, "format: missing"},
        {"\"format\": \"gnomon-sequence 2\"", "'gnomon-sequence 2' is none we read"},
        {FORMAT, "camera: missing"},
        {FORMAT ", \"camera\": {}", "camera.width: missing"},
        {FORMAT ", " CAMERA, "environment: missing"},
        {FORMAT ", " CAMERA ", \"environment\": {\"projection\": \"x\"}", "environment.projection"},
        {FORMAT ", \"camera\": {\"width\": 8, " POSE(1) "}", "camera.world_from_camera: not here"},
        {HEAD, "frames: missing"},
        {HEAD ", \"frames\": []", "frames"},
        {HEAD ", \"frames\": [3]", "frames[0]"},
        {HEAD ", \"frames\": [{}]", "frames[0].time_s: missing"},
        {HEAD ", \"frames\": [{\"time_s\": -1}]", "frames[0].time_s"},
        {HEAD ", \"frames\": [" FRAME(2, 1) ", " FRAME(1, 2) "]",
         "frames[1].time_s: earlier than the frame before"},
        {HEAD ", \"frames\": [{\"time_s\": 1}]", "frames[0].world_from_camera: missing"},
        {HEAD ", \"frames\": [{\"time_s\": 1, \"world_from_camera\": [0,0,0,0, 0,0,0,0, 0,0,0,0, "
              "0,0,0,1]}]",
         "frames[0].world_from_camera: not a pose"},
        {HEAD ", \"frames\": [{\"time_s\": 1, " POSE(1) "}]", "frames[0].picture: missing"},
        {HEAD ", \"frames\": [{\"time_s\": 1, \"picture\": \"p\", " POSE(1) "}]",
         "frames[0].environment: missing"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
        struct gn_sequence s;
        struct gn_error error = {0};
        assert_int_equal(read_text(cases[i].members, &s, &error), -EINVAL);
        if (!strstr(error.text, cases[i].word) ||
            strncmp(error.text, "unit_sequence.tmp/sequence.json: ", 33) != 0)
            fail_msg("{%s}: '%s' lacks '%s'", cases[i].members, error.text, cases[i].word);
        assert_true(s.pictures.n_entries == 0 && !s.pictures.entries && !s.environments.entries);
    }
}

static void test_paths(void **state)
{
    (void)state;
    struct gn_sequence s;
    struct gn_error error = {0};
    char members[8192], name[4100];
    memset(name, 'n', sizeof(name) - 1);
    name[sizeof(name) - 1] = '\0';
    snprintf(members, sizeof(members), "%s, \"frames\": [{\"time_s\": 1, \"picture\": \"%s\", %s}]",
             HEAD, name, POSE(1));
    assert_int_equal(read_text(members, &s, &error), -EINVAL);
    assert_non_null(strstr(error.text, "frames[0].picture: the path is too long"));
    assert_int_equal(gn_sequence_read(name, &s, &error), -ENAMETOOLONG);
    assert_int_equal(gn_sequence_read("unit_sequence.none", &s, &error), -ENOENT);
    assert_non_null(strstr(error.text, "unit_sequence.none/sequence.json"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_read, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_refusals, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_paths, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
