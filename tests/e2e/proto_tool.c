/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Our side of the comparison with an independent protobuf (proto_python.py, proto_docs.py).
 *   proto_tool echo   messages on stdin -> decoded and encoded again on stdout
 *   proto_tool dump   messages on stdin -> each field by its name in our structs, as text
 *   proto_tool table  the table of types and all sentences, as text
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/wire.h"

static void dump_bool(const char *path, const void *p)
{
    printf("%s=%d\n", path, *(const bool *)p);
}

static void dump_u32(const char *path, const void *p)
{
    printf("%s=%" PRIu32 "\n", path, *(const uint32_t *)p);
}

static void dump_u64(const char *path, const void *p)
{
    printf("%s=%" PRIu64 "\n", path, *(const uint64_t *)p);
}

static void dump_i64(const char *path, const void *p)
{
    printf("%s=%" PRId64 "\n", path, *(const int64_t *)p);
}

static void dump_float(const char *path, const void *p)
{
    printf("%s=%a\n", path, (double)*(const float *)p);
}

static void dump_double(const char *path, const void *p)
{
    printf("%s=%a\n", path, *(const double *)p);
}

static void dump_string(const char *path, const void *p)
{
    printf("%s=", path);
    for (const unsigned char *c = p; *c; c++)
        printf("%02x", *c);
    printf("\n");
}

static void dump_bytes(const char *path, const void *p)
{
    const pb_bytes_array_t *b = p;
    printf("%s=", path);
    for (unsigned i = 0; i < b->size; i++)
        printf("%02x", b->bytes[i]);
    printf("\n");
}

// The lists of fields that nanopb generates, with each member taken from its struct by name.
#define DUMP_VALUE(path, v)                                                                        \
    _Generic((v),                                                                                  \
        bool: dump_bool,                                                                           \
        uint32_t: dump_u32,                                                                        \
        uint64_t: dump_u64,                                                                        \
        int64_t: dump_i64,                                                                         \
        float: dump_float,                                                                         \
        double: dump_double,                                                                       \
        char *: dump_string,                                                                       \
        const char *: dump_string,                                                                 \
        struct gn_msg_transform: dump_transform,                                                   \
        struct gn_msg_response: dump_response,                                                     \
        struct gn_msg_projection: dump_projection,                                                 \
        struct gn_msg_frame_view: dump_frame_view,                                                 \
        struct gn_msg_result_view: dump_result_view,                                               \
        struct gn_msg_left_out: dump_left_out,                                                     \
        struct gn_msg_budget_use: dump_budget_use,                                                 \
        struct gn_msg_receipt: dump_receipt,                                                       \
        default: dump_bytes)(path, &(v))
#define PATH(...)                                                                                  \
    char path[256];                                                                                \
    if (snprintf(path, sizeof(path), __VA_ARGS__) >= (int)sizeof(path))                            \
        abort();
#define DUMP_SINGULAR(member)                                                                      \
    {                                                                                              \
        PATH("%s.%s", parent, #member)                                                             \
        DUMP_VALUE(path, m->member);                                                               \
    }
#define DUMP_OPTIONAL(member)                                                                      \
    if (m->has_##member) {                                                                         \
        PATH("%s.%s", parent, #member)                                                             \
        DUMP_VALUE(path, m->member);                                                               \
    }
#define DUMP_REPEATED(member)                                                                      \
    for (unsigned i = 0; i < m->member##_count; i++) {                                             \
        PATH("%s.%s[%u]", parent, #member, i)                                                      \
        DUMP_VALUE(path, m->member[i]);                                                            \
    }
#define DUMP_FIXARRAY(member)                                                                      \
    for (unsigned i = 0; i < GN_ARRAY_LEN(m->member); i++) {                                       \
        PATH("%s.%s[%u]", parent, #member, i)                                                      \
        DUMP_VALUE(path, m->member[i]);                                                            \
    }
#define DUMP_FIELD(a, allocation, label, type, member, tag) DUMP_##label(member)
#define DEFINE_DUMP(NAME, name)                                                                    \
    static void dump_##name(const char *parent, const void *p)                                     \
    {                                                                                              \
        const struct gn_msg_##name *m = p;                                                         \
        GN_MSG_##NAME##_FIELDLIST(DUMP_FIELD, 0)                                                   \
    }

// _Generic names every function at each use, so all are declared first.
static void dump_transform(const char *parent, const void *p);
static void dump_response(const char *parent, const void *p);
static void dump_projection(const char *parent, const void *p);
static void dump_frame_view(const char *parent, const void *p);
static void dump_result_view(const char *parent, const void *p);
static void dump_left_out(const char *parent, const void *p);
static void dump_budget_use(const char *parent, const void *p);
static void dump_receipt(const char *parent, const void *p);

DEFINE_DUMP(TRANSFORM, transform)
DEFINE_DUMP(RESPONSE, response)
DEFINE_DUMP(PROJECTION, projection)
DEFINE_DUMP(FRAME_VIEW, frame_view)
DEFINE_DUMP(RESULT_VIEW, result_view)
DEFINE_DUMP(LEFT_OUT, left_out)
DEFINE_DUMP(BUDGET_USE, budget_use)
DEFINE_DUMP(RECEIPT, receipt)
DEFINE_DUMP(HELLO, hello)
DEFINE_DUMP(WELCOME, welcome)
DEFINE_DUMP(REDIRECT, redirect)
DEFINE_DUMP(ERROR, error)
DEFINE_DUMP(BYE, bye)
DEFINE_DUMP(PING, ping)
DEFINE_DUMP(PONG, pong)
DEFINE_DUMP(ENVIRONMENT_FRAME, environment_frame)
DEFINE_DUMP(EMITTER_FRAME, emitter_frame)
DEFINE_DUMP(POSE, pose)
DEFINE_DUMP(CAMERA, camera)
DEFINE_DUMP(FRAME, frame)
DEFINE_DUMP(RESULT, result)
DEFINE_DUMP(DROPPED, dropped)
DEFINE_DUMP(LIGHTING_STATE, lighting_state)
DEFINE_DUMP(STATISTICS, statistics)

typedef void (*dump_fn)(const char *parent, const void *p);

#define DUMPER(NAME, name) [GN_WIRE_##NAME] = dump_##name
static const dump_fn dumpers[] = {
    DUMPER(HELLO, hello),
    DUMPER(WELCOME, welcome),
    DUMPER(REDIRECT, redirect),
    DUMPER(ERROR, error),
    DUMPER(BYE, bye),
    DUMPER(PING, ping),
    DUMPER(PONG, pong),
    DUMPER(ENVIRONMENT_FRAME, environment_frame),
    DUMPER(EMITTER_FRAME, emitter_frame),
    DUMPER(POSE, pose),
    DUMPER(CAMERA, camera),
    DUMPER(FRAME, frame),
    DUMPER(RESULT, result),
    DUMPER(DROPPED, dropped),
    DUMPER(LIGHTING_STATE, lighting_state),
    DUMPER(STATISTICS, statistics),
};

static int fail(const char *what, int err)
{
    fprintf(stderr, "proto_tool: %s: %s\n", what, strerror(-err));
    return 1;
}

/** One message from stdin. Returns 0, or 1 after a line on stderr. */
static int handle(const struct gn_envelope *in, const uint8_t *rest, bool is_echo)
{
    union gn_wire_message m;
    struct gn_wire_fault fault;
    int err = gn_wire_decode(in->type, rest, in->header_bytes, in->payload_bytes, &m, &fault);
    if (err)
        return fail(fault.text, err);
    if (!is_echo) {
        dumpers[in->type](gn_wire_get_info(in->type)->name, &m);
        return 0;
    }
    uint8_t head[GN_WIRE_HEAD_BYTES];
    size_t len;
    err = gn_wire_encode(in->type, &m, in->payload_bytes, head, sizeof(head), &len, &fault);
    if (err)
        return fail(fault.text, err);
    fwrite(head, 1, len, stdout);
    fwrite(rest + in->header_bytes, 1, in->payload_bytes, stdout);
    return 0;
}

static int run_messages(bool is_echo)
{
    uint8_t bytes[GN_ENVELOPE_BYTES];
    size_t n;
    while ((n = fread(bytes, 1, sizeof(bytes), stdin)) == sizeof(bytes)) {
        struct gn_envelope envelope;
        int err = gn_envelope_decode(bytes, &envelope);
        if (err)
            return fail("envelope", err);
        size_t rest_len = (size_t)envelope.header_bytes + envelope.payload_bytes;
        uint8_t *rest = malloc(rest_len ? rest_len : 1);
        if (!rest)
            return fail("message", -ENOMEM);
        err = fread(rest, 1, rest_len, stdin) == rest_len ? handle(&envelope, rest, is_echo)
                                                          : fail("cut short", -EPROTO);
        free(rest);
        if (err)
            return err;
    }
    return n == 0 && fflush(stdout) == 0 ? 0 : fail("cut short", -EPROTO);
}

static int run_table(void)
{
    for (size_t i = 0; gn_wire_get_row(i); i++) {
        const struct gn_wire_info *r = gn_wire_get_row(i);
        printf("type\t%d\t%s\t%d\t%u\t%u\n", r->type, r->name, r->direction, r->max_header_bytes,
               r->max_payload_bytes);
    }
    for (unsigned i = 1; i <= _GN_MSG_ERROR_CODE_MAX; i++)
        printf("error\t%u\t%s\n", i, gn_wire_get_error_text(i));
    for (unsigned i = 1; i <= _GN_MSG_DROP_REASON_MAX; i++)
        printf("drop\t%u\t%s\n", i, gn_wire_get_drop_text(i));
    for (unsigned i = 1; i <= _GN_MSG_BYE_REASON_MAX; i++)
        printf("bye\t%u\t%s\n", i, gn_wire_get_bye_text(i));
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 2 && strcmp(argv[1], "echo") == 0)
        return run_messages(true);
    if (argc == 2 && strcmp(argv[1], "dump") == 0)
        return run_messages(false);
    if (argc == 2 && strcmp(argv[1], "table") == 0)
        return run_table();
    fprintf(stderr, "usage: proto_tool echo|dump|table\n");
    return 2;
}
