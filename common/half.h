/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * 16-bit floats (IEEE 754 binary16) to 32 bits and back, exact, denormals, infinities and NaN
 * included. Plain integer arithmetic: the same bits everywhere. Thread-safety: safe.
 */
#ifndef GN_COMMON_HALF_H
#define GN_COMMON_HALF_H

#include <stdint.h>
#include <string.h>

/** Largest finite half: 65504. */
#define GN_HALF_MAX 65504.0f

/** The float of the same value; every half has one. NaN stays NaN and keeps its payload. */
static inline float gn_half_to_float(uint16_t half)
{
    /* No branch, so that loops of it vectorise: all three cases are worked out, masks choose. */
    const uint32_t rebias = (uint32_t)(127 - 15) << 23, smallest = rebias + (1u << 23); // 2^-14
    uint32_t sign = (uint32_t)(half & 0x8000u) << 16, exponent = half & 0x7c00u;
    uint32_t bits = (uint32_t)(half & 0x7fffu) << 13, denormal_bits = bits + smallest;
    uint32_t is_denormal = 0u - (exponent == 0), is_special = 0u - (exponent == 0x7c00u);
    float denormal, base, value;
    memcpy(&denormal, &denormal_bits, sizeof(denormal));
    memcpy(&base, &smallest, sizeof(base));
    denormal -= base; // exact
    memcpy(&denormal_bits, &denormal, sizeof(denormal_bits));
    bits += rebias + (rebias & is_special);
    bits = (denormal_bits & is_denormal) | (bits & ~is_denormal) | sign;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

/**
 * The nearest half, ties to even; from 65520 on infinity, up to 2^-25 zero. NaN gives a quiet NaN.
 */
static inline uint16_t gn_half_from_float(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    uint32_t sign = (bits >> 16) & 0x8000u, magnitude = bits & 0x7fffffffu;
    if (magnitude > 0x7f800000u)
        return (uint16_t)(sign | 0x7e00u | ((magnitude >> 13) & 0x1ffu));
    if (magnitude >= 0x477ff000u) // 65520
        return (uint16_t)(sign | 0x7c00u);
    if (magnitude <= 0x33000000u) // 2^-25
        return (uint16_t)sign;
    uint32_t shift = 13, base = magnitude - (112u << 23);
    if (magnitude < 0x38800000u) { // below 2^-14: a denormal, in steps of 2^-24
        shift = 126 - (magnitude >> 23);
        base = (magnitude & 0x7fffffu) | 0x800000u;
    }
    uint32_t kept = base >> shift, rest = base & ((1u << shift) - 1), tie = 1u << (shift - 1);
    kept += rest > tie || (rest == tie && (kept & 1u));
    return (uint16_t)(sign | kept);
}

#endif
