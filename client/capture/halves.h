/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Linear pictures as half floats, for the wire. */
#ifndef GN_CLIENT_CAPTURE_HALVES_H
#define GN_CLIENT_CAPTURE_HALVES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/attr.h"

/** True where every value is a half float to the bit (NaN and infinity as they are). */
bool gn_halves_are_exact(const float *values, size_t n);

/**
 * Little-endian halves of values / 2^k, k the least >= 0 that keeps the largest finite one within
 * 65504: none becomes infinite that was not. Normal ones keep 11 bits; what falls below 2^-14
 * there is exact to 2^-25. Returns 2^k, by which a reader multiplies.
 */
double gn_halves_pack(const float *values, size_t n, uint8_t *out);

/** Room for halves that grows with the pictures. All-zero: none. */
struct gn_halves {
    uint8_t *data; // [n][2], owned
    size_t n;
};
/** gn_halves_pack() into *halves. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_halves_fill(struct gn_halves *halves, const float *values, size_t n,
                               double *out_scale);
void gn_halves_finish(struct gn_halves *halves);

#endif
