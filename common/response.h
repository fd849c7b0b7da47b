/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Camera response: from the codes a sensor delivers to linear radiance, and back.
 * code in [0, 1] is the sensor's full scale (255, 4095, 65535 -> 1); float formats pass through.
 */
#ifndef GN_COMMON_RESPONSE_H
#define GN_COMMON_RESPONSE_H

#include <stdbool.h>

#include "proto/attr.h"

enum gn_response_type {
    GN_RESPONSE_LINEAR = 0,
    GN_RESPONSE_SRGB = 1,  // IEC 61966-2-1
    GN_RESPONSE_GAMMA = 2, // code = linear^(1/gamma)
    GN_RESPONSE_LOG = 3,   // code = a + b ln(c + linear); HDRC-like sensors
    GN_RESPONSE_TABLE = 4, // linear value at equally spaced codes, interpolated, never falling
    GN_RESPONSE_COUNT
};

/** How one device turns light into codes. A value; the table is borrowed while it is used. */
struct gn_response {
    enum gn_response_type type;
    double gamma;        // [0.1, 10], for GAMMA
    double log_a;        // for LOG, in codes as a share of full scale
    double log_b;        // for LOG, > 0
    double log_c;        // for LOG, >= 0, in linear units
    const float *table;  // [table_size], for TABLE; borrowed, may be NULL otherwise
    int table_size;      // [2, 4096]
    double to_rec709[9]; // row-major 3x3, linear device RGB to linear Rec.709; all zero: identity
    double scale;        // radiance per linear unit, [0, 1e30]; 0: 1; times to_rec709 as well
};

/** Checks ranges. Returns 0, or -EINVAL and a sentence (static string) in *out_reason (may be
 * NULL).
 */
GN_MUST_USE int gn_response_check(const struct gn_response *response, const char **out_reason);

/** "linear", "srgb", "gamma", "log", "table"; NULL for a bad type. */
const char *gn_response_get_name(enum gn_response_type type);
/** The type of that name, or -EINVAL. */
GN_MUST_USE int gn_response_from_name(const char *name, enum gn_response_type *out_type);

/**
 * Linear value in device units of one code (no matrix, no scale); >= 0; NaN and below range give 0.
 * Codes above 1 go on by the same formula (a table stays at its last value).
 */
float gn_response_decode(const struct gn_response *response, float code);
/**
 * The code in [0, 1] of one linear device value; the inverse of decode, clamped. NaN gives the code
 * of 0. Where a table is flat it is the lowest code.
 */
float gn_response_encode(const struct gn_response *response, float linear);

/**
 * Device codes to Rec.709 radiance: decode, matrix, scale; negatives that the matrix makes are
 * clamped to 0. rgb[n][3], in place. The response has passed gn_response_check. Thread-safety:
 * safe.
 */
void gn_response_to_radiance(const struct gn_response *response, float *rgb, long n);
/** The inverse: Rec.709 radiance to codes in [0, 1]. rgb[n][3], in place. */
void gn_response_from_radiance(const struct gn_response *response, float *rgb, long n);

/**
 * The linear half of a response: row-major matrix times scale, device RGB to Rec.709 radiance, and
 * its inverse. Returns whether the two are anything but 1. Thread-safety: safe.
 */
bool gn_response_get_matrices(const struct gn_response *response,
                              double out_radiance_from_device[static 9],
                              double out_device_from_radiance[static 9]);

/** rgb = m rgb, negatives and NaN clamped to 0. */
void gn_response_multiply(const double m[static 9], float rgb[static 3]);

#endif
