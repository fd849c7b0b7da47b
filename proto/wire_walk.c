/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One walk over any message by nanopb's own descriptors, so that a new field is checked without new
 * code. It leans on two rules of gnomon.proto: float and double are its only fixed-size types, and
 * every enum field has a row below.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <pb_common.h>

#include "proto/utf8.h"
#include "proto/wire_internal.h"

struct field {
    pb_size_t tag;
    const char *name;
    bool is_enum;
};

struct message {
    const pb_msgdesc_t *descriptor;
    const struct field *fields;
    size_t count;
};

// IS_ENUM_<type> is 1 for UENUM, the one spelling that nanopb gives the enums of gnomon.proto.
#define IS_ENUM_BOOL false
#define IS_ENUM_BYTES false
#define IS_ENUM_DOUBLE false
#define IS_ENUM_FLOAT false
#define IS_ENUM_INT64 false
#define IS_ENUM_MESSAGE false
#define IS_ENUM_STRING false
#define IS_ENUM_UENUM true
#define IS_ENUM_UINT32 false
#define IS_ENUM_UINT64 false
#define FIELD(a, allocation, label, type, name, tag) {tag, #name, IS_ENUM_##type},
#define MESSAGE(NAME, fields)                                                                      \
    {                                                                                              \
        GN_MSG_##NAME##_FIELDS, fields, GN_ARRAY_LEN(fields)                                       \
    }

static const struct field hello[] = {GN_MSG_HELLO_FIELDLIST(FIELD, 0)};
static const struct field welcome[] = {GN_MSG_WELCOME_FIELDLIST(FIELD, 0)};
static const struct field redirect[] = {GN_MSG_REDIRECT_FIELDLIST(FIELD, 0)};
static const struct field error[] = {GN_MSG_ERROR_FIELDLIST(FIELD, 0)};
static const struct field bye[] = {GN_MSG_BYE_FIELDLIST(FIELD, 0)};
static const struct field ping[] = {GN_MSG_PING_FIELDLIST(FIELD, 0)};
static const struct field pong[] = {GN_MSG_PONG_FIELDLIST(FIELD, 0)};
static const struct field transform[] = {GN_MSG_TRANSFORM_FIELDLIST(FIELD, 0)};
static const struct field response[] = {GN_MSG_RESPONSE_FIELDLIST(FIELD, 0)};
static const struct field projection[] = {GN_MSG_PROJECTION_FIELDLIST(FIELD, 0)};
static const struct field environment_frame[] = {GN_MSG_ENVIRONMENT_FRAME_FIELDLIST(FIELD, 0)};
static const struct field emitter_frame[] = {GN_MSG_EMITTER_FRAME_FIELDLIST(FIELD, 0)};
static const struct field pose[] = {GN_MSG_POSE_FIELDLIST(FIELD, 0)};
static const struct field camera[] = {GN_MSG_CAMERA_FIELDLIST(FIELD, 0)};
static const struct field frame_view[] = {GN_MSG_FRAME_VIEW_FIELDLIST(FIELD, 0)};
static const struct field frame[] = {GN_MSG_FRAME_FIELDLIST(FIELD, 0)};
static const struct field result_view[] = {GN_MSG_RESULT_VIEW_FIELDLIST(FIELD, 0)};
static const struct field left_out[] = {GN_MSG_LEFT_OUT_FIELDLIST(FIELD, 0)};
static const struct field budget_use[] = {GN_MSG_BUDGET_USE_FIELDLIST(FIELD, 0)};
static const struct field receipt[] = {GN_MSG_RECEIPT_FIELDLIST(FIELD, 0)};
static const struct field result[] = {GN_MSG_RESULT_FIELDLIST(FIELD, 0)};
static const struct field dropped[] = {GN_MSG_DROPPED_FIELDLIST(FIELD, 0)};
static const struct field lighting_state[] = {GN_MSG_LIGHTING_STATE_FIELDLIST(FIELD, 0)};
static const struct field statistics[] = {GN_MSG_STATISTICS_FIELDLIST(FIELD, 0)};

static const struct message messages[] = {
    MESSAGE(HELLO, hello),
    MESSAGE(WELCOME, welcome),
    MESSAGE(REDIRECT, redirect),
    MESSAGE(ERROR, error),
    MESSAGE(BYE, bye),
    MESSAGE(PING, ping),
    MESSAGE(PONG, pong),
    MESSAGE(TRANSFORM, transform),
    MESSAGE(RESPONSE, response),
    MESSAGE(PROJECTION, projection),
    MESSAGE(ENVIRONMENT_FRAME, environment_frame),
    MESSAGE(EMITTER_FRAME, emitter_frame),
    MESSAGE(POSE, pose),
    MESSAGE(CAMERA, camera),
    MESSAGE(FRAME_VIEW, frame_view),
    MESSAGE(FRAME, frame),
    MESSAGE(RESULT_VIEW, result_view),
    MESSAGE(LEFT_OUT, left_out),
    MESSAGE(BUDGET_USE, budget_use),
    MESSAGE(RECEIPT, receipt),
    MESSAGE(RESULT, result),
    MESSAGE(DROPPED, dropped),
    MESSAGE(LIGHTING_STATE, lighting_state),
    MESSAGE(STATISTICS, statistics),
};

// A lowest value of 1 refuses UNSPECIFIED. ERROR's code may be one of a later version.
static const struct {
    const pb_msgdesc_t *descriptor;
    pb_size_t tag;
    uint32_t min, max;
} enum_ranges[] = {
    {GN_MSG_HELLO_FIELDS, GN_MSG_HELLO_ROLE_TAG, 1, _GN_MSG_ROLE_MAX},
    {GN_MSG_ERROR_FIELDS, GN_MSG_ERROR_CODE_TAG, 1, UINT32_MAX},
    {GN_MSG_BYE_FIELDS, GN_MSG_BYE_REASON_TAG, 1, _GN_MSG_BYE_REASON_MAX},
    {GN_MSG_RESPONSE_FIELDS, GN_MSG_RESPONSE_TYPE_TAG, 0, _GN_MSG_RESPONSE_TYPE_MAX},
    {GN_MSG_PROJECTION_FIELDS, GN_MSG_PROJECTION_TYPE_TAG, 1, _GN_MSG_PROJECTION_TYPE_MAX},
    {GN_MSG_ENVIRONMENT_FRAME_FIELDS, GN_MSG_ENVIRONMENT_FRAME_PIXEL_FORMAT_TAG, 1,
     _GN_MSG_PIXEL_FORMAT_MAX},
    {GN_MSG_EMITTER_FRAME_FIELDS, GN_MSG_EMITTER_FRAME_PIXEL_FORMAT_TAG, 1,
     _GN_MSG_PIXEL_FORMAT_MAX},
    {GN_MSG_FRAME_VIEW_FIELDS, GN_MSG_FRAME_VIEW_PICTURE_FORMAT_TAG, 0, _GN_MSG_PICTURE_FORMAT_MAX},
    {GN_MSG_FRAME_FIELDS, GN_MSG_FRAME_RESULT_FORMAT_TAG, 0, _GN_MSG_PICTURE_FORMAT_MAX},
    {GN_MSG_FRAME_FIELDS, GN_MSG_FRAME_QUALITY_TAG, 0, _GN_MSG_QUALITY_MAX},
    {GN_MSG_RESULT_VIEW_FIELDS, GN_MSG_RESULT_VIEW_FORMAT_TAG, 0, _GN_MSG_PICTURE_FORMAT_MAX},
    {GN_MSG_RECEIPT_FIELDS, GN_MSG_RECEIPT_QUALITY_TAG, 0, _GN_MSG_QUALITY_MAX},
    {GN_MSG_BUDGET_USE_FIELDS, GN_MSG_BUDGET_USE_VERDICT_TAG, 0, _GN_MSG_BUDGET_VERDICT_MAX},
    {GN_MSG_DROPPED_FIELDS, GN_MSG_DROPPED_REASON_TAG, 1, _GN_MSG_DROP_REASON_MAX},
};

static const struct field *find_field(const pb_msgdesc_t *descriptor, pb_size_t tag)
{
    static const struct field unknown = {0, "?", true}; // no range: refused
    for (size_t m = 0; m < GN_ARRAY_LEN(messages); m++) {
        if (messages[m].descriptor != descriptor)
            continue;
        for (size_t f = 0; f < messages[m].count; f++)
            if (messages[m].fields[f].tag == tag)
                return &messages[m].fields[f];
    }
    return &unknown;
}

static int check_enum(const pb_msgdesc_t *descriptor, pb_size_t tag, const void *data,
                      const char *path, struct gn_wire_fault *fault)
{
    uint32_t value;
    memcpy(&value, data, sizeof(value));
    for (size_t i = 0; i < GN_ARRAY_LEN(enum_ranges); i++) {
        if (enum_ranges[i].descriptor != descriptor || enum_ranges[i].tag != tag)
            continue;
        if (value >= enum_ranges[i].min && value <= enum_ranges[i].max)
            return 0;
        return gn_wire_refuse(fault, "%s: %u is none of its values, [%u, %u]", path, value,
                              enum_ranges[i].min, enum_ranges[i].max);
    }
    return gn_wire_refuse(fault, "%s: no range is known for it", path);
}

static int check_string(const char *text, size_t cap, const char *path, struct gn_wire_fault *fault)
{
    if (!memchr(text, 0, cap))
        return gn_wire_refuse(fault, "%s: longer than %zu bytes", path, cap - 1);
    for (size_t i = 0; text[i];) {
        size_t n = gn_utf8_get_character_bytes(text + i);
        if (n == 0)
            return gn_wire_refuse(fault, "%s: byte %zu is a control character or not UTF-8", path,
                                  i);
        i += n;
    }
    return 0;
}

static int walk(const pb_msgdesc_t *descriptor, const void *msg, const char *path,
                struct gn_wire_fault *fault);

static int check_item(const pb_field_iter_t *it, const struct field *field, const void *data,
                      const char *path, struct gn_wire_fault *fault)
{
    float f;
    double d;
    switch (PB_LTYPE(it->type)) {
    case PB_LTYPE_FIXED32:
        memcpy(&f, data, sizeof(f));
        return isfinite(f) ? 0 : gn_wire_refuse(fault, "%s: not a finite number", path);
    case PB_LTYPE_FIXED64:
        memcpy(&d, data, sizeof(d));
        return isfinite(d) ? 0 : gn_wire_refuse(fault, "%s: not a finite number", path);
    case PB_LTYPE_STRING:
        return check_string(data, it->data_size, path, fault);
    case PB_LTYPE_BYTES:
        if (((const pb_bytes_array_t *)data)->size > it->data_size - sizeof(pb_size_t))
            return gn_wire_refuse(fault, "%s: longer than its field", path);
        return 0;
    case PB_LTYPE_SUBMESSAGE:
        return walk(it->submsg_desc, data, path, fault);
    default:
        return field->is_enum ? check_enum(it->descriptor, it->tag, data, path, fault) : 0;
    }
}

static int walk(const pb_msgdesc_t *descriptor, const void *msg, const char *path,
                struct gn_wire_fault *fault)
{
    pb_field_iter_t it;
    if (!pb_field_iter_begin_const(&it, descriptor, msg))
        return 0;
    do {
        const struct field *field = find_field(descriptor, it.tag);
        bool is_array = PB_HTYPE(it.type) == PB_HTYPE_REPEATED;
        size_t count = 1;
        if (is_array) {
            // A fixed array's pSize points at its array_size.
            count = *(const pb_size_t *)it.pSize;
            if (count > it.array_size)
                return gn_wire_refuse(fault, "%s.%s: %zu elements, at most %u are allowed", path,
                                      field->name, count, (unsigned)it.array_size);
        } else if (PB_HTYPE(it.type) == PB_HTYPE_OPTIONAL && it.pSize && !*(const bool *)it.pSize) {
            count = 0;
        }
        for (size_t i = 0; i < count; i++) {
            char item[96];
            if (is_array)
                snprintf(item, sizeof(item), "%s.%s[%zu]", path, field->name, i);
            else
                snprintf(item, sizeof(item), "%s.%s", path, field->name);
            int err =
                check_item(&it, field, (const char *)it.pData + i * it.data_size, item, fault);
            if (err)
                return err;
        }
    } while (pb_field_iter_next(&it));
    return 0;
}

int gn_wire_walk(const struct gn_wire_info *info, const void *msg, struct gn_wire_fault *fault)
{
    return walk(info->fields, msg, info->name, fault);
}
