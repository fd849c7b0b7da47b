/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Which Host and Origin may ask, and which addresses are listened to. */
#include "server/http/guard.h"

#include <errno.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <unistd.h>

#include <cmocka.h>

#include "common/listen.h"

static void test_hosts(void **state)
{
    (void)state;
    static const char *const good[] = {"127.0.0.1",   "127.0.0.1:7341", "localhost",
                                       "LocalHost:1", "[::1]",          "[::1]:65535"};
    static const char *const bad[] = {"",
                                      "evil.example",
                                      "127.0.0.1.evil.example",
                                      "localhost.evil.example",
                                      "localhostx",
                                      "127.0.0.1:",
                                      "127.0.0.1:80@evil.example",
                                      "127.0.0.1:80x",
                                      "127.0.0.1:123456",
                                      "127.0.0.10",
                                      "::1"};
    for (size_t i = 0; i < GN_ARRAY_LEN(good); i++)
        assert_true(gn_guard_is_host(good[i]));
    for (size_t i = 0; i < GN_ARRAY_LEN(bad); i++)
        assert_false(gn_guard_is_host(bad[i]));
    assert_false(gn_guard_is_host(NULL));
}

static void test_origins(void **state)
{
    (void)state;
    assert_true(gn_guard_is_origin(NULL));
    assert_true(gn_guard_is_origin("http://127.0.0.1:7341"));
    assert_true(gn_guard_is_origin("http://localhost"));
    assert_false(gn_guard_is_origin("null"));
    assert_false(gn_guard_is_origin("https://localhost"));
    assert_false(gn_guard_is_origin("http://evil.example"));
    assert_false(gn_guard_is_origin("http://localhost/"));
}

static void test_listen(void **state)
{
    (void)state;
    static const char *const bad[] = {"0.0.0.0", "::", "192.0.2.1", "128.0.0.1", "::2"};
    char text[GN_LISTEN_TEXT_BYTES];
    for (size_t i = 0; i < GN_ARRAY_LEN(bad); i++) {
        struct gn_address address = {.port = 0};
        struct gn_error error = {0};
        strcpy(address.host, bad[i]);
        assert_int_equal(gn_listen_loopback("--listen", &address, 1, text, &error), -EACCES);
        assert_non_null(strstr(error.text, "loopback"));
    }
    const struct gn_address good = {.host = "127.0.0.1"};
    struct gn_error error = {0};
    int fd = gn_listen_loopback("--listen", &good, 1, text, &error);
    assert_true(fd >= 0);
    assert_int_equal(strncmp(text, "127.0.0.1:", 10), 0);
    struct gn_address taken;
    assert_int_equal(gn_address_parse(text, &taken), 0);
    assert_true(taken.port > 0);
    assert_int_equal(gn_listen_loopback("--listen", &taken, 1, text, &error), -EADDRINUSE);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hosts),
        cmocka_unit_test(test_origins),
        cmocka_unit_test(test_listen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
