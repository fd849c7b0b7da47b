/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/net/hello.h"

#include <errno.h>
#include <string.h>

/** Frames of one viewer that may be out: one is rendered while the next waits. */
#define MAX_OUTSTANDING 2

static int refuse(struct gn_hello_answer *answer, enum gn_msg_error_code code, int rc)
{
    answer->code = code;
    return rc;
}

/** What HELLO may ask for and this server does not do is refused, never passed over. */
static int check_hello(const struct gn_msg_hello *hello, struct gn_hello_answer *answer)
{
    struct gn_error *error = &answer->error;
    if (hello->version_min > GN_PROTO_VERSION_MAX || hello->version_max < GN_PROTO_VERSION_MIN)
        return refuse(answer, GN_MSG_ERROR_CODE_VERSION,
                      gn_error_set(error, -EPROTONOSUPPORT,
                                   "the client speaks versions %u to %u of the protocol, this "
                                   "server %d to %d",
                                   hello->version_min, hello->version_max, GN_PROTO_VERSION_MIN,
                                   GN_PROTO_VERSION_MAX));
    if (hello->resume_token.size > 0)
        return refuse(answer, GN_MSG_ERROR_CODE_UNSUPPORTED,
                      gn_error_set(error, -EOPNOTSUPP,
                                   "resume_token: this server cannot take a session up again; "
                                   "open a new one, without it"));
    if (hello->ticket.size > 0)
        return refuse(answer, GN_MSG_ERROR_CODE_UNSUPPORTED,
                      gn_error_set(error, -EOPNOTSUPP,
                                   "ticket: this server sends nobody elsewhere and knows none"));
    if (hello->token[0])
        return refuse(answer, GN_MSG_ERROR_CODE_NOT_ALLOWED,
                      gn_error_set(error, -EACCES,
                                   "token: this server listens on loopback only and checks none; "
                                   "leave it empty"));
    if (hello->role != GN_MSG_ROLE_PROBE && hello->role != GN_MSG_ROLE_VIEWER &&
        hello->role != GN_MSG_ROLE_SCREEN && hello->role != GN_MSG_ROLE_TRACKER)
        return refuse(
            answer, GN_MSG_ERROR_CODE_BAD_VALUE,
            gn_error_set(error, -EINVAL, "role: probe, viewer, tracker and screen are right"));
    return 0;
}

static struct gn_room *find_room(const struct gn_session_host *host, const char *name)
{
    for (int i = 0; i < host->n_rooms; i++) {
        if (!name[0] || strcmp(gn_room_get_options(host->rooms[i])->name, name) == 0)
            return host->rooms[i];
    }
    return NULL;
}

/** Longest payload that the room's limits allow a role. */
static uint32_t get_max_payload(const struct gn_room_options *o, enum gn_msg_role role)
{
    uint64_t bytes, limit;
    if (role == GN_MSG_ROLE_PROBE) {
        bytes = (uint64_t)o->max_environment_width * (uint64_t)o->max_environment_height * 12 +
                4 * GN_LIMIT_TABLE_ENTRIES;
        limit = GN_LIMIT_ENVIRONMENT_BYTES;
    } else if (role == GN_MSG_ROLE_SCREEN) {
        bytes = limit = GN_LIMIT_EMITTER_BYTES;
    } else if (role == GN_MSG_ROLE_TRACKER) {
        bytes = limit = 0;
    } else {
        bytes =
            (uint64_t)o->max_picture_width * (uint64_t)o->max_picture_height * 3 * GN_LIMIT_VIEWS;
        limit = GN_LIMIT_FRAME_BYTES;
    }
    return (uint32_t)(bytes < limit ? bytes : limit);
}

int gn_hello_answer(struct gn_session_host *host, const struct gn_msg_hello *hello,
                    const char *peer, struct gn_hello_answer *out_answer,
                    struct gn_msg_welcome *out_welcome)
{
    memset(out_answer, 0, sizeof(*out_answer));
    int rc = check_hello(hello, out_answer);
    if (rc < 0)
        return rc;
    struct gn_room *room = find_room(host, hello->room);
    if (!room)
        return refuse(out_answer, GN_MSG_ERROR_CODE_NO_SUCH_ROOM,
                      gn_error_set(&out_answer->error, -ENOENT,
                                   "room: this server has no room of that name; its first is %s",
                                   gn_room_get_options(host->rooms[0])->name));
    const struct gn_room_member member = {
        .id = host->last_session_id + 1,
        .role = hello->role,
        .name = hello->client_name,
        .peer = peer,
        .want_lighting_states = hello->want_lighting_states,
        .want_lighting_maps = hello->want_lighting_maps,
    };
    rc = gn_room_join(room, &member, &out_answer->member, &out_answer->error);
    if (rc < 0)
        return refuse(out_answer,
                      rc == -EUSERS ? GN_MSG_ERROR_CODE_FULL : GN_MSG_ERROR_CODE_INTERNAL, rc);
    host->last_session_id++;
    const struct gn_room_options *o = gn_room_get_options(room);
    out_answer->session_id = member.id;
    out_answer->room = room;
    out_answer->max_payload_bytes = get_max_payload(o, hello->role);

    struct gn_msg_welcome w = {
        .version = GN_PROTO_VERSION_MAX,
        .session_id = member.id,
        .capabilities =
            GN_MSG_CAPABILITY_JPEG | GN_MSG_CAPABILITY_EXR | GN_MSG_CAPABILITY_MULTIVIEW,
        .max_frames_outstanding = MAX_OUTSTANDING,
        .max_picture_width = (uint32_t)o->max_picture_width,
        .max_picture_height = (uint32_t)o->max_picture_height,
        .max_environment_width = (uint32_t)o->max_environment_width,
        .max_environment_height = (uint32_t)o->max_environment_height,
        .holdable_fps =
            (float)gn_room_get_holdable_fps_with(room, hello->role == GN_MSG_ROLE_VIEWER ? 0 : 1),
        .idle_timeout_ms = (uint32_t)(host->idle_timeout_ns / GN_NS_PER_MS),
    };
    gn_wire_set_string(w.server_name, sizeof(w.server_name), host->server_name);
    gn_wire_set_string(w.server_version, sizeof(w.server_version), GN_VERSION);
    gn_wire_set_string(w.room, sizeof(w.room), o->name);
    *out_welcome = w;
    return 0;
}
