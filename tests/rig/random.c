/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/random.h"

#include <math.h>
#include <string.h>

#include "tests/rig/vec.h"

void gn_rig_philox(const uint32_t counter[static 4], const uint32_t key[static 2],
                   uint32_t out[static 4])
{
    uint32_t x[4], k0 = key[0], k1 = key[1];
    memcpy(x, counter, sizeof(x));
    for (int round = 0; round < 10; round++) {
        uint64_t a = (uint64_t)0xD2511F53u * x[0];
        uint64_t b = (uint64_t)0xCD9E8D57u * x[2];
        uint32_t y1 = x[1], y3 = x[3];
        x[0] = (uint32_t)(b >> 32) ^ y1 ^ k0;
        x[1] = (uint32_t)b;
        x[2] = (uint32_t)(a >> 32) ^ y3 ^ k1;
        x[3] = (uint32_t)a;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    memcpy(out, x, sizeof(x));
}

static uint32_t reverse_bits(uint32_t x)
{
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

/* Owen's nested uniform scrambling as a hash in which a bit only changes higher bits (the
 * constants are Laine and Karras's, as printed by Burley). */
static uint32_t scramble(uint32_t x, uint32_t seed)
{
    x = reverse_bits(x);
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverse_bits(x);
}

void gn_rig_get_sobol2(uint32_t index, const uint32_t seeds[static 3], double out_point[static 2])
{
    uint32_t i = scramble(index, seeds[0]);
    uint32_t x = reverse_bits(i), y = x;
    // The second dimension's generator matrix is Pascal's triangle modulo 2: the Kronecker power of
    // (1 1; 0 1), applied factor by factor.
    y ^= (y & 0x55555555u) << 1;
    y ^= (y & 0x33333333u) << 2;
    y ^= (y & 0x0f0f0f0fu) << 4;
    y ^= (y & 0x00ff00ffu) << 8;
    y ^= (y & 0x0000ffffu) << 16;
    out_point[0] = scramble(x, seeds[1]) * 0x1p-32;
    out_point[1] = scramble(y, seeds[2]) * 0x1p-32;
}

double gn_rig_get_normal(uint32_t a, uint32_t b)
{
    double u = (a + 0.5) * 0x1p-32, v = (b + 0.5) * 0x1p-32;
    return sqrt(-2 * log(u)) * cos(2 * GN_RIG_PI * v);
}
