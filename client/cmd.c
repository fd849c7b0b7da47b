/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#include "client/recording/session.h"
#include "common/clock.h"

int gn_cmd_load(const struct gn_program *program, int argc, char *const argv[],
                struct gn_options **out_options)
{
    struct gn_error error = {0};
    int err = gn_options_load(program, argc, argv, out_options, &error);
    if (err) {
        gn_cmd_fail(program, error.text);
        return err;
    }
    bool wants_help = gn_options_wants_help(*out_options);
    if (!wants_help && !gn_options_wants_version(*out_options))
        return 1;
    if (wants_help)
        gn_options_print_help(program, stdout);
    else
        printf("%s %s\n", program->name, GN_VERSION);
    gn_options_destroy(out_options);
    return 0;
}

const char *gn_cmd_find_misuse(const struct gn_options *options)
{
    if (!gn_options_is_set(options, NULL, NULL, "record") &&
        !gn_options_is_default(options, NULL, NULL, "record-max"))
        return "--record-max is for --record FILE";
    return NULL;
}

int gn_cmd_fail(const struct gn_program *program, const char *sentence)
{
    fprintf(stderr, "%s: %s\n", program->name, sentence);
    return 1;
}

/** What to look at, where connecting failed in one of the ways that newcomers meet. */
static const char *get_hint(int err)
{
    switch (err) {
    case -ECONNREFUSED:
        return "; is gnomond running, and is this the address that it listens at?";
    case -ETIMEDOUT:
    case -EPROTO:
        return "; is this gnomond's address for clients (listen), not that of its page (http)?";
    default:
        return "";
    }
}

/** Begins the recording that --record asks for. */
static int record(const struct gn_cmd_link *link, const struct gn_client_options *client_options,
                  struct gn_client *client, struct gn_error *out_error)
{
    bool has_option = false;
    for (int i = 0; i < link->program->n_options; i++)
        has_option = has_option || strcmp(link->program->options[i].key, "record") == 0;
    if (!has_option || !gn_options_is_set(link->options, NULL, NULL, "record"))
        return 0;
    return gn_recording_record_client(gn_options_get_string(link->options, NULL, NULL, "record"),
                                      gn_options_get_bytes(link->options, NULL, NULL, "record-max"),
                                      client_options, client, out_error);
}

static bool is_given_up(void *ctx)
{
    const struct gn_cmd_link *link = ctx;
    return gn_cmd_is_interrupted() || (link->is_given_up && atomic_load(link->is_given_up));
}

int gn_cmd_connect_as(const struct gn_cmd_link *link, struct gn_client **out_client,
                      struct gn_error *out_error)
{
    const struct gn_options *options = link->options;
    struct gn_address server = gn_options_get_address(options, NULL, NULL, "server");
    const char *text = gn_options_get_string(options, NULL, NULL, "server");
    const char *room = gn_options_get_string(options, NULL, NULL, "room");
    *out_client = NULL;
    if (server.port == 0)
        return gn_error_set(out_error, -EINVAL, "--server %s: a server's port is in [1, 65535]",
                            text);
    struct gn_client_options client_options = {
        .host = server.host,
        .port = server.port,
        .role = link->role,
        .room = room ? room : link->room,
        .token = gn_options_get_string(options, NULL, NULL, "token"),
        .client_name = link->client_name ? link->client_name : link->program->name,
        .client_version = GN_VERSION,
        .want_lighting_states = link->wants_light,
        .want_lighting_maps = link->wants_maps,
        .want_statistics = link->wants_statistics,
        .timeout_ms = link->timeout_ms,
        .is_given_up = is_given_up,
        .ctx = (void *)(uintptr_t)link,
    };
    struct gn_wire_fault why = {{0}};
    int err = gn_client_connect(&client_options, out_client, &why);
    if (err == -EINTR)
        return gn_error_set(out_error, err, "%s: interrupted before it answered", text);
    if (err && strstr(why.text, server.host))
        return gn_error_set(out_error, err, "%s%s", why.text, get_hint(err));
    if (err)
        return gn_error_set(out_error, err, "%s: %s%s", text, why.text, get_hint(err));
    err = gn_client_sync_clock(*out_client, 8, link->timeout_ms > 0 ? link->timeout_ms : 5000);
    if (err)
        gn_cmd_set_fault(*out_client, err, out_error);
    else
        err = record(link, &client_options, *out_client, out_error);
    if (err)
        gn_client_destroy(out_client);
    return err;
}

int gn_cmd_connect(const struct gn_program *program, const struct gn_options *options,
                   enum gn_msg_role role, struct gn_client **out_client, struct gn_error *out_error)
{
    const struct gn_cmd_link link = {.program = program, .options = options, .role = role};
    return gn_cmd_connect_as(&link, out_client, out_error);
}

void gn_cmd_disconnect(struct gn_client **client)
{
    // Where the peer is gone already there is nothing left to lose.
    if (*client)
        (void)!gn_client_bye(*client, GN_MSG_BYE_REASON_DONE);
    gn_client_destroy(client);
}

int gn_cmd_set_fault(const struct gn_client *client, int err, struct gn_error *out_error)
{
    const char *fault = gn_client_get_fault(client);
    bool is_ours = err == -EDOM || err == -EMSGSIZE || err == -EINVAL;
    return gn_error_set(out_error, err, "%s%s",
                        is_ours ? "" : "the server is lost: ", *fault ? fault : strerror(-err));
}

int gn_cmd_take_event(const struct gn_client_event *event, struct gn_error *out_error)
{
    if (event->type == GN_WIRE_ERROR)
        return gn_error_set(out_error, -EPROTO, "the server: %s", event->message.error.sentence);
    if (event->type == GN_WIRE_BYE)
        return gn_error_set(out_error, -ECONNRESET, "the server ended the session: %s",
                            gn_wire_get_bye_text(event->message.bye.reason));
    return 0;
}

void gn_cmd_make_response(const struct gn_response *response, struct gn_msg_response *out)
{
    static const enum gn_msg_response_type types[GN_RESPONSE_COUNT] = {
        [GN_RESPONSE_LINEAR] = GN_MSG_RESPONSE_TYPE_LINEAR,
        [GN_RESPONSE_SRGB] = GN_MSG_RESPONSE_TYPE_SRGB,
        [GN_RESPONSE_GAMMA] = GN_MSG_RESPONSE_TYPE_GAMMA,
        [GN_RESPONSE_LOG] = GN_MSG_RESPONSE_TYPE_LOG,
        [GN_RESPONSE_TABLE] = GN_MSG_RESPONSE_TYPE_TABLE,
    };
    memset(out, 0, sizeof(*out));
    out->type = types[response->type];
    out->gamma = response->gamma;
    out->log_a = response->log_a;
    out->log_b = response->log_b;
    out->log_c = response->log_c;
}

void gn_cmd_make_transform(const struct gn_pose *pose, struct gn_msg_transform *out)
{
    memset(out, 0, sizeof(*out));
    memcpy(out->orientation, pose->rotation, sizeof(pose->rotation));
    memcpy(out->position_m, pose->translation, sizeof(pose->translation));
}

static atomic_bool is_interrupted; // atomic: set by the signal handler (lock-free), read anywhere

static void on_signal(int number)
{
    (void)number;
    atomic_store(&is_interrupted, true);
}

void gn_cmd_catch_signals(void)
{
    struct sigaction action = {.sa_handler = on_signal}, was = {.sa_handler = SIG_DFL};
    sigemptyset(&action.sa_mask);
    // The terminal was closed; nohup has it ignored.
    if (sigaction(SIGHUP, NULL, &was) == 0 && was.sa_handler != SIG_IGN)
        sigaction(SIGHUP, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); // a file that may grow no further ends a recording, not the program
}

bool gn_cmd_is_interrupted(void)
{
    return atomic_load(&is_interrupted);
}
