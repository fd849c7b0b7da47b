/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* HELLO and its answers. */
#include <assert.h>
#include <errno.h>
#include <string.h>

#include "client/lib/client.h"
#include "client/lib/dial.h"

static int open_conn(struct gn_client *client, const char *host, uint16_t port)
{
    int fd = -1;
    int err = gn_dial(client, host, port, &fd);
    if (err)
        return err;
    struct gn_conn_options opts = {.receive = GN_WIRE_TO_CLIENT, .fd = fd};
    gn_conn_destroy(&client->conn);
    err = gn_conn_create(&opts, &client->conn);
    if (err)
        gn_dial_close(fd);
    client->lost = 0;
    return err;
}

static int set_field(char *out, size_t cap, const char *text, const char *fallback)
{
    const char *from = text ? text : fallback;
    gn_wire_set_string(out, cap, from);
    return strcmp(out, from) == 0 ? 0 : -EINVAL; // a cut token or room is another one
}

int gn_client_fill_hello(const struct gn_client_options *opts, struct gn_msg_hello *hello,
                         struct gn_wire_fault *why)
{
    *hello = (struct gn_msg_hello){
        .version_min = GN_PROTO_VERSION_MIN,
        .version_max = GN_PROTO_VERSION_MAX,
        .capabilities =
            GN_MSG_CAPABILITY_JPEG | GN_MSG_CAPABILITY_EXR | GN_MSG_CAPABILITY_MULTIVIEW,
        .role = opts->role,
        .want_lighting_states = opts->want_lighting_states,
        .want_lighting_maps = opts->want_lighting_maps,
        .want_statistics = opts->want_statistics,
    };
    if (opts->role < _GN_MSG_ROLE_MIN + 1 || opts->role > _GN_MSG_ROLE_MAX)
        return gn_client_fail(why, -EINVAL, "role %u is none of probe, viewer, tracker",
                              opts->role);
    if (opts->timeout_ms < 0)
        return gn_client_fail(why, -EINVAL, "timeout_ms %d must be above 0", opts->timeout_ms);
    if (opts->resume_token_bytes > sizeof(hello->resume_token.bytes))
        return gn_client_fail(why, -EINVAL, "resume token of %zu bytes, at most %zu",
                              opts->resume_token_bytes, sizeof(hello->resume_token.bytes));
    if (opts->resume_token_bytes > 0)
        memcpy(hello->resume_token.bytes, opts->resume_token, opts->resume_token_bytes);
    hello->resume_token.size = (pb_size_t)opts->resume_token_bytes;
    if (set_field(hello->token, sizeof(hello->token), opts->token, "") ||
        set_field(hello->room, sizeof(hello->room), opts->room, "") ||
        set_field(hello->client_name, sizeof(hello->client_name), opts->client_name, "libgnomon") ||
        set_field(hello->client_version, sizeof(hello->client_version), opts->client_version,
                  GN_VERSION))
        return gn_client_fail(why, -EINVAL,
                              "token, room, client name or version is too long or not UTF-8");
    return 0;
}

/** HELLO and its answer. Returns 0 for WELCOME, 1 for REDIRECT (in *out_redirect), or a negative
 * errno. */
static int shake_hands(struct gn_client *client, const struct gn_msg_hello *hello,
                       struct gn_msg_redirect *out_redirect)
{
    int err = gn_client_send(client, GN_WIRE_HELLO, hello, NULL, 0);
    if (err)
        return err;
    struct gn_conn_message message;
    int n = gn_client_receive(client, gn_client_get_deadline(client->timeout_ms), &message);
    if (n == 0)
        return gn_client_fail(&client->fault, -ETIMEDOUT, "no answer to HELLO within %d ms",
                              client->timeout_ms);
    if (n == -EBADMSG || n == -EPROTO || n == -ENOMSG || n == -EMSGSIZE || n == -EOPNOTSUPP)
        return -EPROTO;
    if (n < 0)
        return n;
    union gn_wire_message m;
    err = gn_client_decode(client, &message, &m);
    gn_buf_unref(&message.payload);
    if (err)
        return err;
    switch (message.envelope.type) {
    case GN_WIRE_WELCOME:
        client->welcome = m.welcome;
        return 0;
    case GN_WIRE_REDIRECT:
        *out_redirect = m.redirect;
        return 1;
    case GN_WIRE_ERROR:
        if (m.error.code == GN_MSG_ERROR_CODE_VERSION)
            return gn_client_fail(&client->fault, -EPROTONOSUPPORT,
                                  "the server speaks protocol %u to %u, this client %d to %d",
                                  m.error.version_min, m.error.version_max, GN_PROTO_VERSION_MIN,
                                  GN_PROTO_VERSION_MAX);
        return gn_client_fail(&client->fault, -EACCES, "%s",
                              m.error.sentence[0] ? m.error.sentence
                                                  : gn_wire_get_error_text(m.error.code));
    default:
        return gn_client_fail(&client->fault, -EPROTO, "HELLO was answered by a message of type %u",
                              message.envelope.type);
    }
}

int gn_client_say_hello(struct gn_client *client, const struct gn_client_options *opts)
{
    struct gn_msg_hello hello;
    int err = gn_client_fill_hello(opts, &hello, &client->fault);
    if (err)
        return err;
    struct gn_msg_redirect redirect;
    err = open_conn(client, opts->host ? opts->host : "127.0.0.1",
                    opts->port ? opts->port : GN_PROTO_PORT);
    if (err)
        return err;
    err = shake_hands(client, &hello, &redirect);
    if (err != 1)
        return err;
    static_assert(sizeof(hello.ticket) == sizeof(redirect.ticket), "a ticket goes back as it came");
    memcpy(&hello.ticket, &redirect.ticket, sizeof(hello.ticket));
    err = open_conn(client, redirect.host, (uint16_t)redirect.port);
    if (err)
        return err;
    err = shake_hands(client, &hello, &redirect);
    if (err == 1)
        return gn_client_fail(&client->fault, -ELOOP, "redirected twice, now to '%.100s' port %u",
                              redirect.host, redirect.port);
    return err;
}
