/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "proto/wire.h"

#include <errno.h>
#include <string.h>

#include "proto/utf8.h"

const char *gn_wire_get_error_text(enum gn_msg_error_code code)
{
    switch (code) {
    case GN_MSG_ERROR_CODE_UNSPECIFIED:
        break;
    case GN_MSG_ERROR_CODE_VERSION:
        return "the two sides have no protocol version in common";
    case GN_MSG_ERROR_CODE_MALFORMED:
        return "the bytes are not a message of this protocol";
    case GN_MSG_ERROR_CODE_TOO_LARGE:
        return "a header, payload or picture is larger than allowed";
    case GN_MSG_ERROR_CODE_UNEXPECTED:
        return "this message is not allowed in this state or for this role";
    case GN_MSG_ERROR_CODE_BAD_VALUE:
        return "a value is missing, out of range or not a finite number";
    case GN_MSG_ERROR_CODE_UNSUPPORTED:
        return "the message is right, but this server cannot do what it asks for";
    case GN_MSG_ERROR_CODE_NO_SUCH_ROOM:
        return "the server has no room of this name";
    case GN_MSG_ERROR_CODE_NOT_ALLOWED:
        return "the token or ticket does not allow this";
    case GN_MSG_ERROR_CODE_FULL:
        return "the server or the room takes no more sessions, or probes, now";
    case GN_MSG_ERROR_CODE_BAD_RESUME:
        return "there is no session to resume with this token";
    case GN_MSG_ERROR_CODE_TIMEOUT:
        return "the peer was silent for too long";
    case GN_MSG_ERROR_CODE_INTERNAL:
        return "the server failed; its log says how";
    }
    return "an error of a kind that this version does not know";
}

const char *gn_wire_get_drop_text(enum gn_msg_drop_reason reason)
{
    switch (reason) {
    case GN_MSG_DROP_REASON_UNSPECIFIED:
        break;
    case GN_MSG_DROP_REASON_SUPERSEDED:
        return "a newer frame of the session came before this one was started";
    case GN_MSG_DROP_REASON_OVERLOAD:
        return "the connection takes results more slowly than they are made";
    case GN_MSG_DROP_REASON_LATE:
        return "its deadline had passed before it could be rendered or sent";
    case GN_MSG_DROP_REASON_NO_CAMERA:
        return "no CAMERA was sent for one of its views";
    case GN_MSG_DROP_REASON_NO_POSE:
        return "a view has no pose, and no POSE of the viewer is known";
    case GN_MSG_DROP_REASON_NO_LIGHTING:
        return "the room has no light yet";
    case GN_MSG_DROP_REASON_BAD_PICTURE:
        return "a picture could not be decoded, or is not of its camera's size";
    case GN_MSG_DROP_REASON_BAD_FRAME:
        return "the frame's values contradict each other or the scene";
    case GN_MSG_DROP_REASON_UNSUPPORTED:
        return "this server cannot render what the frame asks for";
    case GN_MSG_DROP_REASON_SESSION_ENDED:
        return "the session or the server ended";
    case GN_MSG_DROP_REASON_INTERNAL:
        return "the server failed on this frame; its log says how";
    }
    return "a reason that this version does not know";
}

const char *gn_wire_get_bye_text(enum gn_msg_bye_reason reason)
{
    switch (reason) {
    case GN_MSG_BYE_REASON_UNSPECIFIED:
        break;
    case GN_MSG_BYE_REASON_DONE:
        return "the sender has finished";
    case GN_MSG_BYE_REASON_LEAVING:
        return "this connection ends, the session may be resumed";
    case GN_MSG_BYE_REASON_SHUTDOWN:
        return "the server stops";
    }
    return "a reason that this version does not know";
}

enum gn_msg_error_code gn_wire_get_error_code(int err)
{
    switch (err) {
    case -EPROTONOSUPPORT:
        return GN_MSG_ERROR_CODE_VERSION;
    case -EBADMSG:
    case -ENOMSG:
    case -EPROTO:
        return GN_MSG_ERROR_CODE_MALFORMED;
    case -EMSGSIZE:
        return GN_MSG_ERROR_CODE_TOO_LARGE;
    case -EDOM:
        return GN_MSG_ERROR_CODE_BAD_VALUE;
    case -EOPNOTSUPP:
        return GN_MSG_ERROR_CODE_UNEXPECTED;
    default:
        return GN_MSG_ERROR_CODE_INTERNAL;
    }
}

void gn_wire_set_string(char *out, size_t cap, const char *text)
{
    size_t used = 0;
    while (*text) {
        size_t n = gn_utf8_get_character_bytes(text);
        if (used + (n ? n : 1) >= cap)
            break;
        if (n == 0) {
            out[used++] = '?';
            text++;
        } else {
            memcpy(out + used, text, n);
            used += n;
            text += n;
        }
    }
    out[used] = 0;
}

size_t gn_wire_get_pixel_bytes(enum gn_msg_pixel_format format)
{
    switch (format) {
    case GN_MSG_PIXEL_FORMAT_RGB_F32:
        return 12;
    case GN_MSG_PIXEL_FORMAT_RGB_F16:
    case GN_MSG_PIXEL_FORMAT_RGB12:
    case GN_MSG_PIXEL_FORMAT_RGB16:
        return 6;
    case GN_MSG_PIXEL_FORMAT_MONO12:
    case GN_MSG_PIXEL_FORMAT_MONO16:
        return 2;
    case GN_MSG_PIXEL_FORMAT_RGB8:
        return 3;
    case GN_MSG_PIXEL_FORMAT_JPEG:
    case GN_MSG_PIXEL_FORMAT_EXR:
    case GN_MSG_PIXEL_FORMAT_UNSPECIFIED:
        break;
    }
    return 0;
}

size_t gn_wire_get_picture_bytes(enum gn_msg_picture_format format)
{
    return format == GN_MSG_PICTURE_FORMAT_RGB8 ? 3 : 0;
}
