/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A room with a viewer and a probe, without sockets. What fails fails the test.
 */
#ifndef GN_TESTS_UNIT_HOUSE_H
#define GN_TESTS_UNIT_HOUSE_H

#include <stdint.h>

#include "server/room/room.h"

enum { HOUSE_WIDTH = 64, HOUSE_HEIGHT = 48, HOUSE_PICTURE_BYTES = HOUSE_WIDTH * HOUSE_HEIGHT * 3 };
enum { HOUSE_MAP_WIDTH = 64, HOUSE_MAP_HEIGHT = 32 };
/** A real floor below a virtual roof; a roof that is a mirror, no floor; a floor that is a TV. */
enum house_scene { HOUSE_DIFFUSE, HOUSE_MIRROR, HOUSE_TV };

struct house {
    struct gn_mailbox *mailbox;
    struct gn_room *room;
    struct gn_room_session *probe, *viewer, *subscriber;
    uint64_t next_id, frame_id, sequence;
    int64_t time_ns;
    double gain;            // of all light
    struct gn_buf *picture; // grey
    enum gn_msg_picture_format result_format;
    struct gn_note *notes; // taken from the mailbox, not read
};

/** cmocka's group fixture: the scenes' files. */
int house_set_up(void **test);
int house_tear_down(void **test);

/** noise: the room's environment_noise; render: NULL: defaults. Razed by the caller. */
void house_build(struct house *h, enum house_scene scene, double noise,
                 const struct gn_render_options *render);
void house_raze(struct house *h);

struct gn_room_session *house_join(struct house *h, enum gn_msg_role role, bool subscribes);
struct gn_room_figures house_get_figures(struct house *h);

/**
 * Half floats of a sky that is brighter on one side, with a lamp; noise: each up or down by a
 * share. Owned by the caller.
 */
struct gn_buf *house_make_pixels(double gain, double noise, unsigned seed);
struct gn_msg_environment_frame house_make_header(void);
/** The probe's next environment frame. */
void house_send_light(struct house *h, struct gn_buf *pixels);
/** Waits until the light of the last environment frame is the room's. */
void house_wait_for_light(struct house *h);
/** Makes, sends and waits. */
void house_light_up(struct house *h, double noise, unsigned seed);

/** The viewer's next frame: its picture, and result_format. */
void house_send_frame(struct house *h, uint64_t min_sequence, uint32_t wait_ms);
/** The next result's sequence of light, its RGB8 in out (NULL: not kept); 0: none within the
 * time. */
uint64_t house_take_result(struct house *h, int timeout_ms, uint8_t out[HOUSE_PICTURE_BYTES]);
/** A frame in the light of the newest environment frame. */
void house_draw(struct house *h, uint8_t out[HOUSE_PICTURE_BYTES]);

#endif
