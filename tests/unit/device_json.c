/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A probe's setup from JSON: what it may leave out, what it says, and what is refused in words.
 * Cameras from JSON: tests/unit/camera.c.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/device_json.h"
#include "tests/unit/cmocka_setup.h"

static int read_setup(const char *text, struct gn_probe_setup *out_setup, struct gn_error *error)
{
    struct gn_json root;
    assert_int_equal(gn_json_load_text(text, strlen(text), "p.json", &root, NULL), 0);
    int ret = gn_probe_setup_read_json(&root, out_setup, error);
    gn_json_finish(&root);
    return ret;
}

static void test_what_may_be_left_out(void **unused)
{
    (void)unused;
    struct gn_probe_setup s;
    assert_int_equal(read_setup("{\"projection\":\"latlong\"}", &s, NULL), 0);
    assert_int_equal(s.projection.type, GN_PROJECTION_LATLONG);
    assert_int_equal(s.response.type, GN_RESPONSE_LINEAR);
    assert_true(s.world_from_probe.rotation[0] == 1.0 && !s.is_12_bit);
    assert_true(s.projection.width == 0 && s.projection.radius == 0 && s.response.scale == 0);
}

static void test_all_of_it(void **unused)
{
    (void)unused;
    struct gn_probe_setup s;
    assert_int_equal(
        read_setup(
            "{\"projection\":\"fisheye-kannala-brandt\",\"width\":300,\"height\":200,"
            "\"center\":[151,99],\"radius\":90.5,\"theta_max\":1.5,\"k\":[0.1,0.2,0.3,0.4],"
            "\"vignetting\":[-0.3,0.05,-0.01],"
            "\"pixel_format\":\"log12\",\"response\":{\"type\":\"log\",\"a\":0.5,\"b\":0.1,"
            "\"c\":0.01},\"to_rec709\":[1,2,0,0,1,0,0,0,1],\"scale\":2.5,"
            "\"orientation\":[0,1.05,0,0],\"position\":[1,2,3],"
            "\"mask\":[{\"center\":[151,99],\"radius\":9.5},{\"center\":[3,4],\"radius\":1}]}",
            &s, NULL),
        0);
    const struct gn_projection *p = &s.projection;
    assert_int_equal(p->type, GN_PROJECTION_FISHEYE_KANNALA_BRANDT);
    assert_true(p->width == 300 && p->height == 200 && p->center[0] == 151 && p->center[1] == 99);
    assert_true(p->radius == 90.5 && p->theta_max == 1.5 && p->k[0] == 0.1 && p->k[3] == 0.4);
    assert_true(p->vignetting[0] == -0.3 && p->vignetting[1] == 0.05 && p->vignetting[2] == -0.01);
    assert_true(s.is_12_bit);
    assert_int_equal(s.response.type, GN_RESPONSE_LOG);
    assert_true(s.response.log_a == 0.5 && s.response.to_rec709[1] == 2 && s.response.scale == 2.5);
    assert_true(s.world_from_probe.rotation[1] == 1.0); // made a unit one
    assert_true(s.world_from_probe.translation[2] == 3);
    assert_int_equal(s.n_masks, 2);
    assert_true(s.masks[0].center[1] == 99 && s.masks[0].radius == 9.5 && s.masks[1].radius == 1);
}

/* A table outlives the JSON that it came in, and the same numbers are kept once. */
static void test_table(void **unused)
{
    (void)unused;
    static const char text[] = "{\"projection\":\"angular\",\"response\":{\"type\":\"table\","
                               "\"table\":[0,0.25,0.25,2]}}";
    struct gn_probe_setup s, again;
    assert_int_equal(read_setup(text, &s, NULL), 0);
    assert_int_equal(read_setup(text, &again, NULL), 0);
    assert_int_equal(s.response.type, GN_RESPONSE_TABLE);
    assert_int_equal(s.response.table_size, 4);
    assert_true(s.response.table[1] == 0.25f && s.response.table[3] == 2);
    assert_ptr_equal(s.response.table, again.response.table);
    assert_true(s.has_response);
    int n = 0, ret = 0;
    for (; n < 2 * GN_RESPONSE_JSON_TABLES && ret == 0; n++) {
        char other[160];
        struct gn_error e = {0};
        snprintf(other, sizeof(other),
                 "{\"projection\":\"angular\",\"response\":{\"type\":\"table\",\"table\":[0,%d]}}",
                 n + 1);
        ret = read_setup(other, &again, &e);
        if (ret)
            assert_string_equal(e.text, "p.json: more than 64 different response tables");
    }
    assert_int_equal(ret, -E2BIG);
    assert_int_equal(n, GN_RESPONSE_JSON_TABLES);
    assert_true(s.response.table[3] == 2);
}

/* pi as files and float32 give it is pi, from the file to the projection. */
static void test_theta_max_of_few_digits(void **unused)
{
    (void)unused;
    static const char *const digits[] = {"3.1415927", "3.141593", "3.14159265358979323846"};
    for (size_t i = 0; i < GN_ARRAY_LEN(digits); i++) {
        char text[96];
        struct gn_probe_setup s;
        snprintf(text, sizeof(text), "{\"projection\":\"angular\",\"theta_max\":%s}", digits[i]);
        assert_int_equal(read_setup(text, &s, NULL), 0);
        s.projection.width = s.projection.height = 64;
        assert_int_equal(gn_projection_init(&s.projection, NULL), 0);
        assert_true(s.projection.theta_max <= acos(-1.0));
        assert_true(gn_projection_is_full_sphere(&s.projection));
    }
}

static void test_refusals(void **unused)
{
    (void)unused;
    static const char *const cases[][2] = {
        {"{}", "p.json: projection: missing, expected a string"},
        {"{\"projection\":\"fisheye\"}", "p.json: projection: 'fisheye' is none; right would be"},
        {"{\"projection\":\"latlong\",\"raduis\":1}",
         "p.json: unknown key 'raduis'; did you mean 'radius'?"},
        {"{\"projection\":\"angular\",\"theta_max\":3.1416}",
         "p.json: theta_max: expected radians in [0.001, 3.141593654], found 3.1416"},
        {"{\"projection\":\"angular\",\"radius\":0}", "p.json: radius: expected a number in ["},
        {"{\"projection\":\"angular\",\"width\":16385}",
         "p.json: width: expected a whole number in [1, 16384], found 16385"},
        {"{\"projection\":\"angular\",\"k\":[1]}", "p.json: k: expected 4 elements, found 1"},
        {"{\"projection\":\"cube\",\"vignetting\":[-0.1,0,0]}",
         "p.json: vignetting: only fisheyes, angular maps and mirror balls"},
        {"{\"projection\":\"angular\",\"vignetting\":[-0.1,0]}",
         "p.json: vignetting: expected 3 elements, found 2"},
        {"{\"projection\":\"angular\",\"pixel_format\":\"log14\"}",
         "p.json: pixel_format: expected one of 'float32', 'log12', 'linear16', found 'log14'"},
        {"{\"projection\":\"angular\",\"response\":{\"type\":\"log\",\"a\":0,\"b\":0.001,\"c\":0}}",
         "p.json: response: a log response needs"},
        {"{\"projection\":\"angular\",\"response\":{\"type\":\"table\",\"table\":[0,2,1]}}",
         "p.json: response.table: a response table's values must not fall"},
        {"{\"projection\":\"angular\",\"response\":{\"type\":\"table\",\"table\":[0]}}",
         "p.json: response.table: expected 2 to 4096 elements, found 1"},
        {"{\"projection\":\"angular\",\"response\":{\"type\":\"table\",\"table\":[0,\"x\"]}}",
         "p.json: response.table: element 1: expected a number, found a string"},
        {"{\"projection\":\"angular\",\"mask\":[{\"center\":[1,2],\"radius\":0}]}",
         "p.json: mask[0].radius: expected a number in [0.001, 16384]"},
        {"{\"projection\":\"angular\",\"mask\":[{\"center\":[1e300,2],\"radius\":5}]}",
         "p.json: mask[0].center: must lie within 16384 px"},
        {"{\"projection\":\"angular\",\"mask\":[[1,2,3]]}", "p.json: mask[0]: expected an object"},
        {"{\"projection\":\"angular\",\"to_rec709\":[1,0,0,1,0,0,0,0,1]}",
         "p.json: response: a response's matrix to Rec.709 must be finite and invertible"},
        {"{\"projection\":\"angular\",\"orientation\":[0,0,0,0]}",
         "p.json: orientation: not a unit quaternion"},
        {"{\"projection\":\"angular\",\"position\":[0,0,\"x\"]}",
         "p.json: position: element 2: expected a number, found a string"},
    };
    for (size_t i = 0; i < GN_ARRAY_LEN(cases); i++) {
        struct gn_probe_setup s = {.is_12_bit = true};
        struct gn_error e = {0};
        assert_int_equal(read_setup(cases[i][0], &s, &e), -EINVAL);
        if (strstr(e.text, cases[i][1]) != e.text)
            assert_string_equal(e.text, cases[i][1]);
        assert_true(s.is_12_bit && s.projection.width == 0); // untouched
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_may_be_left_out),
        cmocka_unit_test(test_all_of_it),
        cmocka_unit_test(test_table),
        cmocka_unit_test(test_theta_max_of_few_digits),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
