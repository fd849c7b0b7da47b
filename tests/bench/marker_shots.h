/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures for the benchmarks of tracking: markers seen by a camera that moves.
 */
#ifndef GN_TESTS_BENCH_MARKER_SHOTS_H
#define GN_TESTS_BENCH_MARKER_SHOTS_H

#include "client/track/bodies.h"
#include "tests/rig/marker_picture.h"

enum { GN_BENCH_SHOT_WIDTH = 640, GN_BENCH_SHOT_HEIGHT = 480 };

/** The lens that takes them. */
extern const struct gn_rig_view gn_bench_lens;

/** A world of that many markers of 36 or, alone, of 80 mm, printed on a sheet. */
void gn_bench_make_world(int columns, int n_rows, struct gn_bodies *bodies,
                         struct gn_rig_sheet *sheet);

/** Picture i of a camera that swings by 20 mm, with noise; 21 of them are a round. is_cluttered:
 * before blotches instead of a plain backdrop. rig: made of gn_bench_lens. Initialises *out. */
void gn_bench_shoot(const struct gn_rig_marker_camera *rig, const struct gn_rig_sheet *sheet,
                    bool is_cluttered, int i, struct gn_image8 *out);

#endif
