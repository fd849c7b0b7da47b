/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Every size limit of the wire, in one place. PROTOCOL.md prints the same numbers; a test compares.
 * The limits per message type stand in wire.c's table; those that several places need stand here.
 */
#ifndef GN_PROTO_LIMITS_H
#define GN_PROTO_LIMITS_H

/** Protocol versions that this code speaks, and the port where nobody says another. */
#define GN_PROTO_VERSION_MIN 1
#define GN_PROTO_VERSION_MAX 1
#define GN_PROTO_PORT 7340

/** Bytes: longest header of any type. */
#define GN_LIMIT_HEADER_BYTES 16384
/** Bytes: longest payloads. */
#define GN_LIMIT_ENVIRONMENT_BYTES (64u << 20)
#define GN_LIMIT_FRAME_BYTES (32u << 20)
#define GN_LIMIT_RESULT_BYTES (32u << 20)
#define GN_LIMIT_EMITTER_BYTES (24u << 20)
#define GN_LIMIT_LIGHTING_BYTES (16u << 20)

/** Pixels: longest side of any picture or environment frame. A server may grant less in WELCOME. */
#define GN_LIMIT_SIDE_PX 8192
/** Pixels: longest side of an emitter's picture. */
#define GN_LIMIT_EMITTER_SIDE_PX 2048
/** Lighting states: lights, bytes of a light's record in the payload, longest sides of the map. */
#define GN_LIMIT_LIGHTS 16384
#define GN_LIGHT_RECORD_BYTES 32
#define GN_LIMIT_MAP_WIDTH_PX 2048
#define GN_LIMIT_MAP_HEIGHT_PX 1024
/** Views of a frame, and cameras of a session. */
#define GN_LIMIT_VIEWS 4
/** Pixels: largest standard deviation of a camera's point spread. */
#define GN_LIMIT_BLUR_PX 8
/** Entries of a response table. */
#define GN_LIMIT_TABLE_ENTRIES 4096
/** Milliseconds: longest time a frame may ask to be held for light. */
#define GN_LIMIT_LIGHTING_WAIT_MS 60000
/** Longest budget of a frame, ms. */
#define GN_LIMIT_BUDGET_MS 60000
/** Metres: largest coordinate of a position. */
#define GN_LIMIT_POSITION_M 1e6
/** JPEG quality of results where the frame names none. */
#define GN_JPEG_QUALITY_DEFAULT 90

#endif
