/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a viewer leaves on disk: pictures to the bit, view.json whole or absent. */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "client/view/keep.h"
#include "client/view/record.h"
#include "common/file.h"
#include "common/image_file.h"
#include "tests/unit/cmocka_setup.h"

static const char dir[] = "unit_record.tmp";
static const char report[] = "unit_record.tmp/view.json";
static const uint8_t pixels[18] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 255};

static int clean(void **state)
{
    (void)state;
    return system("rm -rf unit_record.tmp");
}

static struct gn_msg_result make_result(uint64_t id)
{
    struct gn_msg_result result = {.id = id, .views_count = 1, .has_receipt = true};
    result.views[0] = (struct gn_msg_result_view){.format = GN_MSG_PICTURE_FORMAT_RGB8,
                                                  .width = 3,
                                                  .height = 2,
                                                  .payload_length = sizeof(pixels)};
    result.receipt.primary_ms = 1.5f;
    result.receipt.lighting_sequence = 42;
    result.receipt.lights_used = 64;
    result.receipt.rays_shadow = 1000;
    result.receipt.estimated_error = -1;
    result.receipt.has_virtual_pixels = true;
    result.receipt.left_out_count = 1;
    strcpy(result.receipt.left_out[0].pass, "bounce");
    strcpy(result.receipt.left_out[0].why, "not \xff UTF-8");
    return result;
}

static struct gn_record *open_record(void)
{
    struct gn_record *record = NULL;
    struct gn_error error = {0};
    if (gn_record_open(dir, &record, &error) != 0)
        fail_msg("%s", error.text);
    return record;
}

static json_t *load(void)
{
    json_error_t fault;
    json_t *root = json_load_file(report, 0, &fault);
    if (!root)
        fail_msg("%s:%d: %s", report, fault.line, fault.text);
    assert_string_equal(json_string_value(json_object_get(root, "format")), "gnomon-view 1");
    return root;
}

static json_int_t get_int(const json_t *object, const char *key)
{
    assert_true(json_is_integer(json_object_get(object, key)));
    return json_integer_value(json_object_get(object, key));
}

static void test_run(void **state)
{
    (void)state;
    struct gn_record *record = open_record();
    struct gn_msg_result result = make_result(1);
    // Two eyes in one payload: the second in front.
    uint8_t payload[36] = {0};
    memcpy(payload + 18, pixels, 18);
    result.views_count = 2;
    result.views[1] = result.views[0];
    result.views[0].payload_offset = 18;
    assert_int_equal(gn_record_add_result(record, "a", &result, payload, 12.5, NULL), 0);
    struct gn_msg_dropped dropped = {.id = 2, .reason = GN_MSG_DROP_REASON_SUPERSEDED};
    strcpy(dropped.sentence, "a later frame came");
    assert_int_equal(gn_record_add_dropped(record, "b\xff", &dropped, NULL), 0);
    // A server of before the count of virtual pixels.
    struct gn_msg_result older = make_result(3);
    older.receipt.has_virtual_pixels = false;
    assert_int_equal(gn_record_add_result(record, "c", &older, pixels, 1, NULL), 0);
    assert_int_not_equal(access(report, F_OK), 0); // whole or absent
    const struct gn_source_counts counts = {.n_complete = 1,
                                            .n_incomplete = 2,
                                            .n_skipped = 3,
                                            .n_lost_packets = 4,
                                            .n_resent_packets = 5,
                                            .n_reopened = 6,
                                            .n_read = 7,
                                            .read_bytes = UINT64_C(8) << 40,
                                            .copied_bytes = 9,
                                            .n_lost = 10};
    assert_int_equal(gn_record_close(&record, 3, false, &counts, NULL), 0);
    assert_null(record);
    assert_int_equal(gn_record_close(&record, 0, true, NULL, NULL), 0);

    struct gn_image_file file;
    assert_int_equal(gn_image_read_file("unit_record.tmp/a.png", &file, NULL), 0);
    assert_true(file.codes8.width == 3 && file.codes8.height == 2 && file.codes8.channels == 3);
    assert_memory_equal(file.codes8.data, pixels, 18);
    gn_image_file_finish(&file);
    assert_int_equal(gn_image_read_file("unit_record.tmp/a-1.png", &file, NULL), 0);
    assert_memory_equal(file.codes8.data, payload, 18);
    gn_image_file_finish(&file);

    json_t *root = load();
    assert_true(get_int(root, "sent") == 3 && get_int(root, "results") == 2 &&
                get_int(root, "dropped") == 1);
    assert_true(json_is_false(json_object_get(root, "complete")));
    const json_t *frames = json_object_get(root, "frames");
    assert_int_equal(json_array_size(frames), 3);
    const json_t *a = json_array_get(frames, 0), *b = json_array_get(frames, 1);
    const json_t *c = json_object_get(json_array_get(frames, 2), "receipt");
    assert_true(json_is_null(json_object_get(c, "virtual_pixels")));
    assert_true(json_real_value(json_object_get(a, "latency_ms")) == 12.5);
    const json_t *receipt = json_object_get(a, "receipt");
    assert_true(get_int(receipt, "lighting_sequence") == 42 && get_int(receipt, "lights") == 64);
    assert_int_equal(get_int(receipt, "virtual_pixels"), 0);
    assert_true(json_is_null(json_object_get(receipt, "estimated_error")));
    assert_int_equal(get_int(json_object_get(receipt, "rays"), "shadow"), 1000);
    const json_t *left_out = json_array_get(json_object_get(receipt, "left_out"), 0);
    assert_string_equal(json_string_value(json_object_get(left_out, "why")), "not ? UTF-8");
    assert_string_equal(json_string_value(json_object_get(b, "name")), "b?");
    assert_string_equal(json_string_value(json_object_get(b, "sentence")), "a later frame came");
    const json_t *capture = json_object_get(root, "capture");
    static const char *const keys[] = {"complete",       "incomplete", "skipped", "lost_packets",
                                       "resent_packets", "reopened",   "read"};
    for (int i = 0; i < 7; i++)
        assert_int_equal(get_int(capture, keys[i]), i + 1);
    assert_true(get_int(capture, "read_bytes") == INT64_C(8) << 40);
    assert_int_equal(get_int(capture, "copied_bytes"), 9);
    assert_int_equal(get_int(capture, "lost"), 10);
    json_decref(root);
}

static void test_empty_and_again(void **state)
{
    (void)state;
    struct gn_record *record = open_record();
    assert_int_equal(gn_record_close(&record, 0, true, NULL, NULL), 0);
    json_t *root = load();
    assert_int_equal(json_array_size(json_object_get(root, "frames")), 0);
    assert_true(json_is_true(json_object_get(root, "complete")));
    json_decref(root);
    record = open_record(); // the old report is gone while the new run lasts
    assert_int_not_equal(access(report, F_OK), 0);
    assert_int_equal(gn_record_close(&record, 0, true, NULL, NULL), 0);
    assert_int_equal(access(report, F_OK), 0);
}

static void test_jpeg(void **state)
{
    (void)state;
    static const uint8_t bytes[] = {0xff, 0xd8, 0xff, 0xe0, 9, 9};
    struct gn_record *record = open_record();
    struct gn_msg_result result = make_result(1);
    result.views[0].format = GN_MSG_PICTURE_FORMAT_JPEG;
    result.views[0].payload_length = sizeof(bytes);
    assert_int_equal(gn_record_add_result(record, "a", &result, bytes, 1, NULL), 0);
    uint8_t *data = NULL;
    size_t n = 0;
    assert_int_equal(gn_file_read("unit_record.tmp/a.jpg", 100, &data, &n, NULL), 0);
    assert_int_equal(n, sizeof(bytes));
    assert_memory_equal(data, bytes, n);
    free(data);
    assert_int_equal(gn_record_close(&record, 1, true, NULL, NULL), 0);
}

static void test_refusals(void **state)
{
    (void)state;
    struct gn_record *record = open_record();
    struct gn_error error = {0};
    struct gn_msg_result result = make_result(1);
    result.views[0].payload_length = 17;
    assert_int_equal(gn_record_add_result(record, "a", &result, pixels, 1, &error), -EPROTO);
    assert_non_null(strstr(error.text, "17 bytes, not 18"));
    result.views[0].format = GN_MSG_PICTURE_FORMAT_JPEG;
    assert_int_equal(gn_record_add_result(record, "a", &result, pixels, 1, &error), -EPROTO);
    assert_non_null(strstr(error.text, "the server's JPEG is none"));
    result = make_result(1);
    assert_int_equal(gn_record_add_result(record, "no/such", &result, pixels, 1, &error), -ENOENT);
    assert_non_null(strstr(error.text, "no/such.png"));
    assert_int_equal(gn_record_close(&record, 1, true, NULL, &error), 0);
    json_t *root = load(); // what was refused is not in it
    assert_int_equal(json_array_size(json_object_get(root, "frames")), 0);
    json_decref(root);

    assert_int_equal(gn_record_open("unit_record.none/deep", &record, &error), -ENOENT);
    assert_non_null(strstr(error.text, "cannot be the folder of results"));
    assert_int_equal(gn_record_open(report, &record, &error), -ENOTDIR);
    char name[5000];
    memset(name, 'n', sizeof(name) - 1);
    name[sizeof(name) - 1] = '\0';
    assert_int_equal(gn_record_open(name, &record, &error), -ENAMETOOLONG);
    assert_null(record);
}

/** What the window's keys keep: a recording that cannot be written ends, and another may begin. */
static void test_keeping(void **state)
{
    (void)state;
    struct gn_keep *keep = NULL;
    struct gn_error error = {0};
    struct gn_msg_result result = make_result(7);
    struct gn_image8 none = {0}, picture = {0};
    char text[256] = "", name[3000];
    assert_int_equal(mkdir(dir, 0777), 0);
    assert_int_equal(gn_keep_create(dir, &keep, &error), 0);
    assert_int_equal(gn_keep_add(keep, &result, pixels, 1, &error), 0); // into none
    assert_int_equal(gn_keep_picture(keep, 7, &none, text, sizeof(text), &error), -ENODATA);
    assert_int_equal(gn_image8_init(&picture, 3, 2, 3), 0);
    assert_int_equal(gn_keep_picture(keep, 7, &picture, text, sizeof(text), &error), 0);
    assert_memory_equal(text, "kept unit_record.tmp/gnomon-", 28);
    assert_int_equal(access(text + 5, F_OK), 0);
    assert_int_equal(gn_keep_toggle(keep, text, sizeof(text), &error), 0);
    assert_memory_equal(text, "recording: unit_record.tmp/", 27);
    assert_int_equal(gn_keep_add(keep, &result, pixels, 1, &error), 0);
    assert_int_equal(clean(NULL), 0);
    assert_int_equal(gn_keep_add(keep, &result, pixels, 1, &error), -ENOENT);
    assert_non_null(strstr(error.text, "frame000007.png"));
    assert_false(gn_keep_is_recording(keep));
    assert_int_equal(gn_keep_picture(keep, 7, &picture, text, sizeof(text), &error), -ENOENT);
    assert_int_equal(gn_keep_toggle(keep, text, sizeof(text), &error), -ENOENT);
    assert_false(gn_keep_is_recording(keep));
    assert_int_equal(mkdir(dir, 0777), 0);
    assert_int_equal(gn_keep_toggle(keep, text, sizeof(text), &error), 0);
    assert_int_equal(gn_keep_add(keep, &result, pixels, 1, &error), 0);
    assert_int_equal(gn_keep_toggle(keep, text, sizeof(text), &error), 0);
    assert_memory_equal(text, "recorded 1 pictures: ", 21);
    gn_keep_destroy(&keep);
    gn_keep_destroy(&keep);
    gn_image8_finish(&picture);
    memset(name, 'n', sizeof(name) - 1);
    name[sizeof(name) - 1] = '\0';
    assert_int_equal(gn_keep_create(name, &keep, &error), -ENAMETOOLONG);
    assert_null(keep);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_run, clean, clean),
        cmocka_unit_test_setup_teardown(test_empty_and_again, clean, clean),
        cmocka_unit_test_setup_teardown(test_jpeg, clean, clean),
        cmocka_unit_test_setup_teardown(test_refusals, clean, clean),
        cmocka_unit_test_setup_teardown(test_keeping, clean, clean),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
