/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What the rig's cameras make of light, written apart from common/response.h. Thread-safety: safe.
 */
#ifndef GN_TESTS_RIG_SENSOR_H
#define GN_TESTS_RIG_SENSOR_H

#include <stdbool.h>

#include "proto/attr.h"

/** An HDRC-like sensor: code = a + b ln(c + radiance), as a share of full scale. */
struct gn_rig_log_sensor {
    double a, b, c;
};

/** The sensor whose codes 0 and 4095 are radiance 0 and `highest`, and whose dark current c is a
 * millionth of `highest` or a thousandth of `mean`, whichever is less. */
struct gn_rig_log_sensor gn_rig_make_log_sensor(double mean, double highest);
/** The 12-bit code, rounded and clamped; and back. */
int gn_rig_encode_log12(const struct gn_rig_log_sensor *sensor, double radiance);
double gn_rig_decode_log12(const struct gn_rig_log_sensor *sensor, double code);

/** IEC 61966-2-1: linear to an 8-bit code, clamped, before rounding. */
double gn_rig_encode_srgb8(double linear);

/** A camera's curve. */
struct gn_rig_curve {
    enum { GN_RIG_CURVE_NONE, GN_RIG_CURVE_LINEAR, GN_RIG_CURVE_SRGB, GN_RIG_CURVE_LOG } type;
    struct gn_rig_log_sensor log;
};

/** "linear", "srgb" or "log:A,B,C". False where the text is none of them. */
GN_MUST_USE bool gn_rig_read_curve(const char *text, struct gn_rig_curve *out_curve);
/** The code as a share of full scale, not clamped by a logarithm. */
double gn_rig_encode_curve(const struct gn_rig_curve *curve, double light);

#endif
