/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * JSON readers: every refusal names file, place and what would be right.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "common/json.h"
#include "tests/unit/cmocka_setup.h"

static struct gn_json load(const char *text)
{
    struct gn_json root;
    assert_int_equal(gn_json_load_text(text, strlen(text), "a.json", &root, NULL), 0);
    return root;
}

static void test_values(void **unused)
{
    (void)unused;
    struct gn_json root =
        load("{\"d\":1.5,\"i\":7,\"w\":3.0,\"b\":true,\"s\":\"text\",\"n\":[1,2.5],"
             "\"o\":{\"a\":[{\"d\":2}]},\"null\":null}");
    struct gn_json o, a, item;
    static const char *const names[] = {"word", "text"};
    double d = 0, numbers[2] = {0};
    int i = 0;
    bool b = false;
    const char *s = NULL;
    assert_int_equal(gn_json_get_double(&root, "d", 0, 2, &d, NULL), 0);
    assert_true(d == 1.5);
    assert_int_equal(gn_json_get_int(&root, "i", 0, 9, &i, NULL), 0);
    assert_int_equal(i, 7);
    assert_int_equal(gn_json_get_int(&root, "w", 0, 9, &i, NULL), 0);
    assert_int_equal(i, 3);
    assert_int_equal(gn_json_get_bool(&root, "b", &b, NULL), 0);
    assert_true(b);
    assert_int_equal(gn_json_get_string(&root, "s", &s, NULL), 0);
    assert_string_equal(s, "text");
    assert_int_equal(gn_json_get_enum(&root, "s", names, 2, &i, NULL), 0);
    assert_int_equal(i, 1);
    assert_int_equal(gn_json_get_numbers(&root, "n", 2, numbers, NULL), 0);
    assert_true(numbers[0] == 1.0 && numbers[1] == 2.5);
    assert_int_equal(gn_json_get_object(&root, "o", &o, NULL), 0);
    assert_int_equal(gn_json_get_array(&o, "a", 1, 5, &a, NULL), 0);
    assert_int_equal(gn_json_get_item(&a, 0, &item, NULL), 0);
    assert_string_equal(item.path, "o.a[0]");
    assert_int_equal(gn_json_get_double(&item, "d", 0, 2, &d, NULL), 0);
    assert_true(d == 2.0);
    assert_true(gn_json_has(&root, "null"));
    assert_false(gn_json_has(&root, "nil"));
    gn_json_finish(&root);
    gn_json_finish(&root);
}

static void expect(int ret, const struct gn_error *error, const char *sentence)
{
    assert_string_equal(error->text, sentence);
    assert_int_equal(ret, -EINVAL);
}

static void test_refusals(void **unused)
{
    (void)unused;
    struct gn_json root =
        load("{\"d\":\"x\",\"big\":11,\"half\":2.5,\"huge\":1e300,\"n\":[1,\"x\"],"
             "\"s\":7,\"word\":\"wrod\",\"o\":{\"a\":[{\"z\":1},3]}}");
    static const char *const names[] = {"word", "text"};
    static const char *const keys[] = {"a", "color"};
    struct gn_json o, a, item;
    struct gn_error e = {0};
    double d = 9, numbers[3];
    int i = 9;
    bool b;
    const char *s;
    expect(gn_json_get_double(&root, "e", 0, 2, &d, &e), &e,
           "a.json: e: missing, expected a number");
    expect(gn_json_get_double(&root, "d", 0, 2, &d, &e), &e,
           "a.json: d: expected a number, found a string");
    expect(gn_json_get_double(&root, "big", 0, 10, &d, &e), &e,
           "a.json: big: expected a number in [0, 10], found 11");
    expect(gn_json_get_int(&root, "half", 0, 10, &i, &e), &e,
           "a.json: half: expected a whole number in [0, 10], found 2.5");
    expect(gn_json_get_int(&root, "huge", 0, 10, &i, &e), &e,
           "a.json: huge: expected a whole number in [0, 10], found 1e+300");
    expect(gn_json_get_bool(&root, "s", &b, &e), &e,
           "a.json: s: expected true or false, found a number");
    expect(gn_json_get_string(&root, "s", &s, &e), &e,
           "a.json: s: expected a string, found a number");
    expect(gn_json_get_enum(&root, "word", names, 2, &i, &e), &e,
           "a.json: word: expected one of 'word', 'text', found 'wrod'");
    expect(gn_json_get_numbers(&root, "n", 3, numbers, &e), &e,
           "a.json: n: expected 3 elements, found 2");
    expect(gn_json_get_numbers(&root, "n", 2, numbers, &e), &e,
           "a.json: n: element 1: expected a number, found a string");
    expect(gn_json_get_array(&root, "n", 3, 9, &a, &e), &e,
           "a.json: n: expected 3 to 9 elements, found 2");
    expect(gn_json_get_object(&root, "n", &o, &e), &e,
           "a.json: n: expected an object, found an array");
    assert_int_equal(gn_json_get_object(&root, "o", &o, NULL), 0);
    assert_int_equal(gn_json_get_array(&o, "a", 0, 9, &a, NULL), 0);
    expect(gn_json_get_item(&a, 1, &item, &e), &e,
           "a.json: o.a[1]: expected an object, found a number");
    expect(gn_json_get_item(&a, 2, &item, &e), &e, "a.json: o.a[2]: no such element");
    assert_int_equal(gn_json_get_item(&a, 0, &item, NULL), 0);
    expect(gn_json_check_keys(&item, keys, 2, &e), &e,
           "a.json: o.a[0]: unknown key 'z'; did you mean 'a'?");
    expect(gn_json_check_keys(&item, keys + 1, 1, &e), &e,
           "a.json: o.a[0]: unknown key 'z'; known are color");
    expect(gn_json_refuse(&item, "z", &e, "is %d", 1), &e, "a.json: o.a[0].z: is 1");
    assert_true(d == 9 && i == 9);
    gn_json_finish(&root);
}

static void expect_text(const char *text, size_t size, const char *words)
{
    struct gn_json root;
    struct gn_error e = {0};
    assert_int_equal(gn_json_load_text(text, size, "a.json", &root, &e), -EINVAL);
    assert_non_null(strstr(e.text, words));
    assert_null(strchr(e.text, '\n'));
    assert_null(root.value);
}

static void test_texts(void **unused)
{
    (void)unused;
    expect_text("[]", 2, "a.json: expected an object {...}, found an array");
    expect_text("", 0, "a.json:1:0: not JSON");
    expect_text("{\n\"a\": NaN}", 11, "a.json:2:");
    expect_text("{\"a\": 1e999}", 12, "a.json:1:");
    expect_text("{\"a\":1,\"a\":2}", 13, "duplicate");
    expect_text("{\"a\":\"\\u0000\"}", 14, "a.json:1:");
    expect_text("{\"a\":1} x", 9, "a.json:1:");
    char deep[8192];
    memset(deep, '[', sizeof(deep));
    memcpy(deep, "{\"a\":", 5);
    expect_text(deep, sizeof(deep), "a.json:1:");
}

static void test_files(void **unused)
{
    (void)unused;
    char path[] = "/tmp/gn-json-XXXXXX";
    struct gn_json root;
    struct gn_error e = {0};
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, "{\"a\":1}", 7), 7);
    assert_int_equal(gn_json_load_file(path, &root, &e), 0);
    assert_true(gn_json_has(&root, "a"));
    gn_json_finish(&root);
    assert_int_equal(ftruncate(fd, (off_t)GN_JSON_MAX_BYTES + 1), 0);
    assert_int_equal(gn_json_load_file(path, &root, &e), -EFBIG);
    assert_non_null(strstr(e.text, "larger than 16 MiB"));
    close(fd);
    unlink(path);
    assert_int_equal(gn_json_load_file(path, &root, &e), -ENOENT);
    assert_non_null(strstr(e.text, "cannot open"));
    assert_int_equal(gn_json_load_file("/tmp", &root, &e), -EISDIR);
    assert_int_equal(gn_json_load_file("/dev/zero", &root, &e), -EFBIG); // tells no size
}

/* A pipe tells no size and gives its text in pieces. */
static void test_pipe(void **unused)
{
    (void)unused;
    int fds[2];
    char path[32];
    struct gn_json root;
    assert_int_equal(pipe(fds), 0);
    assert_int_equal(write(fds[1], "{\"a\":", 5), 5);
    pid_t child = fork();
    if (child == 0) {
        nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL);
        _exit(write(fds[1], "1}", 2) != 2);
    }
    close(fds[1]);
    snprintf(path, sizeof(path), "/dev/fd/%d", fds[0]);
    assert_int_equal(gn_json_load_file(path, &root, NULL), 0);
    assert_true(gn_json_has(&root, "a"));
    gn_json_finish(&root);
    close(fds[0]);
    int status = 1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

static void test_long_path(void **unused)
{
    (void)unused;
    char key[201] = "";
    memset(key, 'k', 200);
    char text[256];
    snprintf(text, sizeof(text), "{\"%s\":{}}", key);
    struct gn_json root = load(text), o;
    assert_int_equal(gn_json_get_object(&root, key, &o, NULL), 0);
    assert_int_equal(strlen(o.path), sizeof(o.path) - 1);
    assert_string_equal(o.path + strlen(o.path) - 4, "k...");
    gn_json_finish(&root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_texts),  cmocka_unit_test(test_files),
        cmocka_unit_test(test_pipe),   cmocka_unit_test(test_long_path),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
