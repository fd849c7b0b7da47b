/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Listening sockets: on loopback, on the port that was picked, and in words where that cannot be.
 */
#include "common/listen.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "tests/unit/cmocka_setup.h"

static int try_listen(const char *text, char out_text[static GN_LISTEN_TEXT_BYTES],
                      struct gn_error *out_error)
{
    struct gn_address address;
    assert_int_equal(gn_address_parse(text, &address), 0);
    return gn_listen_loopback("--listen", &address, 4, out_text, out_error);
}

/* Port 0 picks one, says which, and somebody who knows it gets in. */
static void test_picked_port(void **unused)
{
    (void)unused;
    char text[GN_LISTEN_TEXT_BYTES];
    struct gn_address address;
    int fd = try_listen("localhost:0", text, NULL);
    assert_true(fd >= 0);
    assert_int_equal(gn_address_parse(text, &address), 0);
    assert_int_not_equal(address.port, 0);
    assert_true(fcntl(fd, F_GETFL) & O_NONBLOCK);
    assert_true(fcntl(fd, F_GETFD) & FD_CLOEXEC);
    assert_int_equal(accept(fd, NULL, NULL), -1); // at once

    struct sockaddr_storage bound;
    socklen_t len = sizeof(bound);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&bound, &len), 0);
    int client = socket(bound.ss_family, SOCK_STREAM, 0);
    assert_int_equal(connect(client, (struct sockaddr *)&bound, len), 0);
    close(client);

    char again[GN_LISTEN_TEXT_BYTES] = "untouched";
    struct gn_error error = {0};
    assert_int_equal(try_listen(text, again, &error), -EADDRINUSE);
    assert_string_equal(again, "untouched");
    char words[64 + GN_LISTEN_TEXT_BYTES];
    snprintf(words, sizeof(words), "--listen %s: in use: another program listens there", text);
    assert_int_equal(strncmp(error.text, words, strlen(words)), 0);
    assert_non_null(strstr(error.text, "end it, or give another --listen ADDRESS:PORT"));
    close(fd);
}

static void test_refusals(void **unused)
{
    (void)unused;
    static const char *const others[] = {"0.0.0.0:0", "[::]:0", "192.0.2.1:0",
                                         "[::ffff:127.0.0.1]:0"};
    char text[GN_LISTEN_TEXT_BYTES];
    struct gn_error error = {0};
    for (size_t i = 0; i < GN_ARRAY_LEN(others); i++) {
        assert_int_equal(try_listen(others[i], text, &error), -EACCES);
        assert_non_null(strstr(error.text, "not a loopback address"));
    }
    assert_int_equal(try_listen("a-name-of-nobody.invalid:0", text, &error), -EADDRNOTAVAIL);
    assert_non_null(strstr(error.text, "--listen a-name-of-nobody.invalid"));
}

static void test_format(void **unused)
{
    (void)unused;
    char text[GN_LISTEN_TEXT_BYTES];
    struct sockaddr_in6 in6 = {
        .sin6_family = AF_INET6, .sin6_port = htons(65535), .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    gn_listen_format((struct sockaddr *)&in6, sizeof(in6), text);
    assert_string_equal(text, "[::1]:65535");
    gn_listen_format((struct sockaddr *)&in6, sizeof(in6) - 1, text); // cut
    assert_string_equal(text, "?");
    struct sockaddr_in in = {.sin_family = AF_INET, .sin_port = htons(80)};
    in.sin_addr.s_addr = htonl(0x7f000001);
    gn_listen_format((struct sockaddr *)&in, sizeof(in), text);
    assert_string_equal(text, "127.0.0.1:80");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_picked_port),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_format),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
