/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* A room lit by what stands in it, for the rig and as a scene. What fails ends the test. */
#ifndef GN_TESTS_TRUTH_NEAR_ROOM_H
#define GN_TESTS_TRUTH_NEAR_ROOM_H

#include "server/scene/scene.h"
#include "tests/rig/room.h"

/** A virtual box on the table beside a wall; of each role a lamp and a screen. Not committed. */
void gn_near_room_init(struct gn_rig_room *out_room);
/** Gives the scene the room's lamps. */
void gn_near_room_set_lamps(const struct gn_rig_room *room, struct gn_scene *scene);

#endif
