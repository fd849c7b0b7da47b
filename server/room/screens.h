/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The streams of a room's emitters: of each the newest picture that is not shown yet. A picture
 * neither waits behind environment frames nor replaces one.
 */
#ifndef GN_SERVER_ROOM_SCREENS_H
#define GN_SERVER_ROOM_SCREENS_H

#include "common/buf.h"
#include "common/error.h"
#include "common/image.h"
#include "common/jpeg.h"
#include "proto/attr.h"
#include "proto/wire.h"
#include "server/light/emitters.h"

/** A picture as it waits. */
struct gn_emitter_job {
    uint64_t session_id;
    int stream; // index
    struct gn_msg_emitter_frame frame;
    struct gn_buf *payload; // owned reference
};

/** One stream. */
struct gn_screen {
    const char *name; // borrowed from the emitters
    bool has_picture;
    struct gn_emitter_job job; // where has_picture
    uint64_t turn;             // when its last picture was taken; 0: none was
};

/** All-zero: no streams. Thread-safety: unsafe, but for the names: immutable after create. */
struct gn_screens {
    int n;
    struct gn_screen *slots; // [n], owned
    uint64_t turn;
};

/** One slot for each stream; the emitters must outlive the screens. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_screens_init(struct gn_screens *screens, const struct gn_emitters *emitters);
/** Drops all pictures. */
void gn_screens_finish(struct gn_screens *screens);

/** Index of the stream, or -ENOENT and a sentence that lists those there are. */
GN_MUST_USE int gn_screens_find(const struct gn_screens *screens, const char *name,
                                struct gn_error *out_error);
/** Puts the picture into its stream's slot. *out_superseded: the reference of the one that waited
 * there, or NULL. */
void gn_screens_put(struct gn_screens *screens, const struct gn_emitter_job *job,
                    struct gn_buf **out_superseded);
/** A picture of the stream whose last turn is longest ago; where !all only the first of a stream,
 * so that its sender learns what is wrong with it. False: none. */
bool gn_screens_take(struct gn_screens *screens, bool all, struct gn_emitter_job *out_job);

/** What decoding keeps from picture to picture; zero it before first use. Thread-safety: unsafe. */
struct gn_screen_decoder {
    struct gn_image linear; // [height][width][3], Rec.709, scaled
    struct gn_image8 codes;
    struct gn_jpeg *jpeg; // made by the first JPEG picture
};
void gn_screen_decoder_finish(struct gn_screen_decoder *decoder);
/** Fills decoder->linear. Memory is taken only where the size changes. Returns 0, -EINVAL and a
 * sentence, -ENOMEM. */
GN_MUST_USE int gn_screen_decode(struct gn_screen_decoder *decoder,
                                 const struct gn_msg_emitter_frame *frame,
                                 const struct gn_buf *payload, struct gn_error *out_error);

#endif
