/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the pixels' centres see, kept from frame to frame: it holds as long as camera and scene
 * rest, whatever the light does. A frame whose camera or scene is new keeps nothing: a camera in a
 * hand would only write. The next one that is like it fills the memory, those after it trace no
 * centres.
 */
#ifndef GN_SERVER_RENDER_KEPT_H
#define GN_SERVER_RENDER_KEPT_H

#include "server/render/internal.h"

/** All-zero is none. */
struct kept {
    struct sight *sights;    // [n_blocks] in the order of tiles, owned
    struct gn_camera camera; // whose centres they are of, or would be; width 0: none
    uint64_t version;        // of the scene
    bool no_virtual;         // of its objects
    bool is_full;
};

/** Room for a picture's blocks; what was kept is forgotten. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_kept_reserve(struct kept *kept, size_t n_blocks);
void gn_kept_finish(struct kept *kept);

/** Says in the frame whether it fills the blocks or uses them. */
void gn_kept_begin(struct kept *kept, struct frame *frame);
/** After the whole frame: what it filled may be used. */
void gn_kept_end(struct kept *kept, const struct frame *frame);

#endif
