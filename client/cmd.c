/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

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

int gn_cmd_fail(const struct gn_program *program, const char *sentence)
{
    fprintf(stderr, "%s: %s\n", program->name, sentence);
    return 1;
}

int gn_cmd_connect(const struct gn_program *program, const struct gn_options *options,
                   enum gn_msg_role role, struct gn_client **out_client)
{
    struct gn_address server = gn_options_get_address(options, NULL, NULL, "server");
    struct gn_client_options client_options = {
        .host = server.host,
        .port = server.port,
        .role = role,
        .room = gn_options_get_string(options, NULL, NULL, "room"),
        .token = gn_options_get_string(options, NULL, NULL, "token"),
        .client_name = program->name,
        .client_version = GN_VERSION,
    };
    struct gn_wire_fault why = {{0}};
    int err = gn_client_connect(&client_options, out_client, &why);
    if (err) {
        gn_cmd_fail(program, why.text);
        return err;
    }
    err = gn_client_sync_clock(*out_client, 8, 5000);
    if (err) {
        gn_cmd_fail(program, gn_client_get_fault(*out_client));
        gn_client_destroy(out_client);
    }
    return err;
}

void gn_cmd_disconnect(struct gn_client **client)
{
    // The peer may be gone already; there is nothing left to lose.
    if (*client && gn_client_bye(*client, GN_MSG_BYE_REASON_DONE) != 0)
        fprintf(stderr, "the server was gone before goodbye\n");
    gn_client_destroy(client);
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

void gn_cmd_pace_init(struct gn_cmd_pace *pace, const struct gn_options *options,
                      double default_rate_hz)
{
    pace->start_ns = gn_clock_get_monotonic_ns();
    if (gn_options_is_set(options, NULL, NULL, "start-at")) {
        double start_s = gn_options_get_double(options, NULL, NULL, "start-at");
        pace->start_ns += (int64_t)(start_s * 1e9) - gn_clock_get_realtime_ns();
    }
    pace->rate_hz = gn_options_is_set(options, NULL, NULL, "rate")
                        ? gn_options_get_double(options, NULL, NULL, "rate")
                        : default_rate_hz;
    pace->is_looped = gn_options_get_bool(options, NULL, NULL, "loop");
    pace->n_wanted = gn_options_is_set(options, NULL, NULL, "count")
                         ? gn_options_get_int(options, NULL, NULL, "count")
                         : 0;
}

int64_t gn_cmd_pace_get_due_ns(const struct gn_cmd_pace *pace, long index, double time_s)
{
    double since_start_s = pace->rate_hz > 0 ? (double)index / pace->rate_hz : time_s;
    return pace->start_ns + (int64_t)llround(since_start_s * 1e9);
}

static atomic_bool is_interrupted; // atomic: set by the signal handler (lock-free), read anywhere

static void on_signal(int number)
{
    (void)number;
    atomic_store(&is_interrupted, true);
}

void gn_cmd_catch_signals(void)
{
    struct sigaction action = {.sa_handler = on_signal};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
}

bool gn_cmd_is_interrupted(void)
{
    return atomic_load(&is_interrupted);
}
