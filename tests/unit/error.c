/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Errors and their text: one safe line whatever comes in, and the name that was meant.
 */
#include <errno.h>
#include <string.h>

#include "common/error.h"
#include "common/text.h"
#include "tests/unit/cmocka_setup.h"

static void test_set(void **unused)
{
    (void)unused;
    struct gn_error error = {0};
    assert_int_equal(gn_error_set(&error, -EDOM, "%s: %d", "a.json", 7), -EDOM);
    assert_string_equal(error.text, "a.json: 7");
    assert_int_equal(gn_error_set(NULL, -EDOM, "%s", "nobody listens"), -EDOM);
}

static void test_set_cuts_and_cleans(void **unused)
{
    (void)unused;
    struct gn_error error = {0};
    char text[1024];
    memset(text, 'x', sizeof(text) - 1);
    text[sizeof(text) - 1] = '\0';
    memcpy(text + 510, "\xc3\xa4", 2); // the cut falls into this letter
    (void)gn_error_set(&error, -EDOM, "%s", text);
    assert_int_equal(strlen(error.text), sizeof(error.text) - 1);
    assert_int_equal(error.text[510], '?');
}

static void test_clean(void **unused)
{
    (void)unused;
    static const char *const cases[][2] = {
        {"plain", "plain"},
        {"a\x1b[31mb\n\tc\x7f", "a?[31mb??c?"},
        {"\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80", "\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80"},
        {"\xc2\x9b", "??"},           // CSI, a control character of two bytes
        {"\xc0\xaf", "??"},           // overlong
        {"\xed\xa0\x80", "???"},      // surrogate
        {"\xf4\x90\x80\x80", "????"}, // above U+10FFFF
        {"\xe2\x82", "??"},           // cut
        {"\xff\x80x", "??x"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char text[32];
        strcpy(text, cases[i][0]);
        gn_text_clean(text);
        assert_string_equal(text, cases[i][1]);
    }
}

static const char *suggest(const char *name)
{
    static const char *const candidates[] = {"listen",       "lights", "http",
                                             "max-sessions", "fx",     "fy"};
    const char *best = NULL;
    for (size_t i = 0; i < sizeof(candidates) / sizeof(candidates[0]); i++)
        gn_text_suggest(name, candidates[i], &best);
    return best;
}

static void test_suggest(void **unused)
{
    (void)unused;
    assert_int_equal(gn_text_get_distance("kitten", "sitting"), 3);
    assert_int_equal(gn_text_get_distance("sitting", "kitten"), 3);
    assert_int_equal(gn_text_get_distance("", "abc"), 3);
    assert_int_equal(gn_text_get_distance("abcd", "ad"), 2);
    assert_int_equal(gn_text_get_distance("ABC", "abc"), 0);
    assert_string_equal(suggest("lisen"), "listen");
    assert_string_equal(suggest("max-session"), "max-sessions");
    assert_string_equal(suggest("htpp"), "http");
    assert_null(suggest("zebra"));
    assert_null(suggest("qq"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_set),
        cmocka_unit_test(test_set_cuts_and_cleans),
        cmocka_unit_test(test_clean),
        cmocka_unit_test(test_suggest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
