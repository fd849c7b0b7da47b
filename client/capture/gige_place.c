/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/gige_place.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

#include <arv.h>

/** GigE Vision 2.0: the control channel's port and commands (16), the registers of the first and
 * the second place of the description (28). */
#define GVCP_PORT 3956
#define GVCP_DISCOVERY 0x0002
#define GVCP_READMEM 0x0084
#define URL_BYTES 512
static const uint32_t url_registers[2] = {0x0200, 0x0400};
/** How long an answer is waited for, and how often the camera is asked for what must be known. */
#define ANSWER_MS 100
#define N_TRIES 5
/** Longest description. */
#define MAX_DESCRIPTION_BYTES (16 << 20)

static bool is_same(const char *a, const char *b)
{
    return a && strcmp(a, b) == 0;
}

/** An address that is given needs no search, and may lie behind a router. Whether it is one. */
static bool make_place(const char *address, struct gn_gige_place *out_place)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(GVCP_PORT)}, from = {0};
    socklen_t length = sizeof(from);
    if (inet_pton(AF_INET, address, &to.sin_addr) != 1)
        return false;
    memset(out_place, 0, sizeof(*out_place));
    snprintf(out_place->id, sizeof(out_place->id), "%s", address);
    snprintf(out_place->address, sizeof(out_place->address), "%s", address);
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&to, sizeof(to)) == 0 &&
        getsockname(fd, (struct sockaddr *)&from, &length) == 0)
        (void)!inet_ntop(AF_INET, &from.sin_addr, out_place->interface,
                         sizeof(out_place->interface));
    if (fd >= 0)
        close(fd);
    return true;
}

/** A search is heard by cameras of other networks too, which nothing else reaches. */
static int check_reachable(const struct gn_gige_place *place, struct gn_error *out_error)
{
    for (int i = 0; i < N_TRIES; i++) {
        if (gn_gige_place_answers(place))
            return 0;
    }
    return gn_error_set(
        out_error, -ENODEV,
        "camera %s: found by search, but its address %s cannot be reached from here; "
        "give it, or this machine, an address in the other's network",
        place->id, place->address);
}

int gn_gige_place_find(const char *id, struct gn_gige_place *out_place, struct gn_error *out_error)
{
    if (make_place(id, out_place)) {
        if (out_place->interface[0] && gn_gige_place_answers(out_place))
            return 0;
        return gn_error_set(out_error, -ENODEV,
                            "--gige %s: no GigE Vision camera answers at this address", id);
    }
    ArvInterface *gv = arv_gv_interface_get_instance();
    arv_interface_update_device_list(gv);
    unsigned n = arv_interface_get_n_devices(gv);
    char found[256] = "";
    for (unsigned i = 0; i < n; i++) {
        const char *device_id = arv_interface_get_device_id(gv, i);
        const char *address = arv_interface_get_device_address(gv, i);
        if (strcmp(id, "any") == 0 || is_same(device_id, id) ||
            is_same(arv_interface_get_device_physical_id(gv, i), id) ||
            is_same(arv_interface_get_device_serial_nbr(gv, i), id)) {
            memset(out_place, 0, sizeof(*out_place));
            snprintf(out_place->id, sizeof(out_place->id), "%s", device_id ? device_id : id);
            snprintf(out_place->address, sizeof(out_place->address), "%s", address ? address : "");
            return check_reachable(out_place, out_error);
        }
        size_t length = strlen(found);
        snprintf(found + length, sizeof(found) - length, "%s%s", i ? ", " : "",
                 device_id ? device_id : "?");
    }
    if (n == 0)
        return gn_error_set(out_error, -ENODEV,
                            "--gige %s: no GigE Vision camera answers in the networks of this "
                            "machine",
                            id);
    return gn_error_set(out_error, -ENODEV, "--gige %s: no such camera; there are: %s", id, found);
}

/**
 * Sends one command and waits for its answer. Returns the answer's length behind its head of 8
 * bytes, or -ETIMEDOUT, or -EACCES: it is refused.
 */
static int ask(const char *address, unsigned command, const uint8_t *arguments, size_t n_arguments,
               uint8_t *answer, size_t room)
{
    // Key, flag "acknowledge", command, length of what follows, request id.
    uint8_t packet[64] = {
        0x42, 0x01, (uint8_t)(command >> 8), (uint8_t)command, 0, (uint8_t)n_arguments, 0, 1};
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(GVCP_PORT)};
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), got = -ETIMEDOUT;
    if (n_arguments)
        memcpy(packet + 8, arguments, n_arguments);
    if (fd >= 0 && inet_pton(AF_INET, address, &to.sin_addr) == 1 &&
        connect(fd, (const struct sockaddr *)&to, sizeof(to)) == 0 &&
        send(fd, packet, 8 + n_arguments, MSG_NOSIGNAL) == (ssize_t)(8 + n_arguments)) {
        struct pollfd wait = {.fd = fd, .events = POLLIN};
        ssize_t n = poll(&wait, 1, ANSWER_MS) == 1 ? recv(fd, answer, room, 0) : -1;
        if (n >= 8 && answer[2] == command >> 8 && answer[3] == (command & 0xff) + 1)
            got = answer[0] || answer[1] ? -EACCES : (int)n - 8;
    }
    if (fd >= 0)
        close(fd);
    return got;
}

bool gn_gige_place_answers(const struct gn_gige_place *place)
{
    uint8_t answer[512];
    return ask(place->address, GVCP_DISCOVERY, NULL, 0, answer, sizeof(answer)) >= 0;
}

/** Reads where the camera says its description is; "": it does not. */
static int read_url(const struct gn_gige_place *place, uint32_t from, char out[URL_BYTES + 1])
{
    const uint8_t arguments[8] = {0, 0, (uint8_t)(from >> 8),      (uint8_t)from,
                                  0, 0, (uint8_t)(URL_BYTES >> 8), (uint8_t)(URL_BYTES & 0xff)};
    uint8_t answer[8 + 4 + URL_BYTES];
    int got = -ETIMEDOUT;
    for (int i = 0; i < N_TRIES && got == -ETIMEDOUT; i++)
        got =
            ask(place->address, GVCP_READMEM, arguments, sizeof(arguments), answer, sizeof(answer));
    out[0] = '\0';
    if (got < 4 + URL_BYTES)
        return got < 0 ? got : -EPROTO;
    memcpy(out, answer + 12, URL_BYTES);
    out[URL_BYTES] = '\0';
    return 0;
}

/**
 * Whether Aravis may go there: "local:NAME;ADDRESS;LENGTH", both in hexadecimal, perhaps with
 * "?SchemaVersion=..." behind (GigE Vision 2.0, 28.2). Just so many semicolons: so that there is
 * one reading of it only.
 */
static bool is_harmless(const char *url)
{
    char *end = NULL;
    size_t n = strcspn(url, "?#");
    const char *address = memchr(url, ';', n);
    const char *length = address ? memchr(address + 1, ';', n - (size_t)(address + 1 - url)) : NULL;
    if (strncasecmp(url, "local:", 6) != 0 || !length ||
        memchr(length + 1, ';', n - (size_t)(length + 1 - url)))
        return false;
    unsigned long n_bytes = strtoul(length + 1, &end, 16);
    return end == url + n && end > length + 1 && n_bytes <= MAX_DESCRIPTION_BYTES;
}

int gn_gige_place_check_description(const struct gn_gige_place *place, struct gn_error *out_error)
{
    char url[URL_BYTES + 1];
    for (int i = 0; i < 2; i++) {
        int err = read_url(place, url_registers[i], url);
        if (err && i == 1) // few have a second place
            break;
        if (err)
            return gn_error_set(
                out_error, -EIO, "camera %s: it does not say where its description is: %s",
                place->id,
                err == -EACCES ? "it refuses; does another program control it?" : strerror(-err));
        if (url[0] && !is_harmless(url))
            return gn_error_set(
                out_error, -EPERM,
                "camera %s: its description is said to be at '%.128s'; only one that "
                "is kept in the camera (local:NAME;ADDRESS;LENGTH), of at most %d "
                "MiB, is read",
                place->id, url, MAX_DESCRIPTION_BYTES >> 20);
    }
    return 0;
}
