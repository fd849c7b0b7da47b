/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Random numbers of tests: the same in each run, and the same everywhere.
 */
#ifndef GN_TESTS_RANDOM_H
#define GN_TESTS_RANDOM_H

#include <math.h>
#include <stdint.h>

/** SplitMix64; *state is the seed at first.
 * Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014. */
static inline uint64_t gn_test_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/** Uniform in [0, 1). */
static inline double gn_test_random_unit(uint64_t *state)
{
    return (double)(gn_test_random(state) >> 11) * 0x1p-53;
}

/** Normal, mean 0 and deviation 1.
 * Source: Box, Muller, "A note on the generation of random normal deviates", 1958. */
static inline double gn_test_random_normal(uint64_t *state)
{
    double radius = sqrt(-2 * log(1 - gn_test_random_unit(state)));
    return radius * cos(2 * M_PI * gn_test_random_unit(state));
}

#endif
