/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * For benchmarks: the tracer's own loop over rays in its own layout, with nothing of ours around
 * it, to measure gn_rt_is_occluded and gn_rt_get_occluded16 against. Same trees, same flags.
 */
#ifndef GN_SERVER_SCENE_RT_LOOP_H
#define GN_SERVER_SCENE_RT_LOOP_H

#include "server/scene/rt.h"

/** Rays of one set. Thread-safety: unsafe. */
struct gn_rt_loop;
/** The valid lanes of packets[n] in that order, `width` in each call: 1 or GN_RT_PACKET, which are
 * filled up. rt is borrowed until destroy. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_rt_loop_create(const struct gn_rt *rt, enum gn_rt_set set,
                                  const struct gn_rt_packet *packets, int n, int width,
                                  struct gn_rt_loop **out_loop);
/** NULL-safe; nulls *loop. */
void gn_rt_loop_destroy(struct gn_rt_loop **loop);
/** Makes the rays new: before each run, outside of its time. */
void gn_rt_loop_reset(struct gn_rt_loop *loop);
/** Traces them all once. */
void gn_rt_loop_run(struct gn_rt_loop *loop);
/** How many of the last run's rays are occluded. */
uint64_t gn_rt_loop_count_occluded(const struct gn_rt_loop *loop);

/** The tracer's own tree of what rests of a set, NULL where nothing does: for rt_embree_loop.c. */
void *gn_rt_get_tree(const struct gn_rt *rt, enum gn_rt_set set);

#endif
