/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The rig's random numbers: counted, not drawn, so that a pixel gets the same ones on any thread.
 */
#ifndef GN_TESTS_RIG_RANDOM_H
#define GN_TESTS_RIG_RANDOM_H

#include <stdint.h>

/**
 * Philox4x32-10: four random words of a counter and a key.
 * Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011; its
 * known answers are in tests/unit/rig_random.c. Thread-safety: safe.
 */
void gn_rig_philox(const uint32_t counter[static 4], const uint32_t key[static 2],
                   uint32_t out[static 4]);

/**
 * Point `index` of a two-dimensional Sobol sequence, shuffled by seeds[0] and Owen-scrambled by
 * seeds[1] and seeds[2]; each power of two of points from 0 is a (0, m, 2)-net.
 * Source: Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020.
 * out_point in [0, 1). Thread-safety: safe.
 */
void gn_rig_get_sobol2(uint32_t index, const uint32_t seeds[static 3], double out_point[static 2]);

/** One normal deviate with mean 0 and deviation 1 from two words (Box and Muller 1958). */
double gn_rig_get_normal(uint32_t a, uint32_t b);

#endif
