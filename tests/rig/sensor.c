/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/sensor.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

struct gn_rig_log_sensor gn_rig_make_log_sensor(double mean, double highest)
{
    double c = fmin(1e-6 * highest, 1e-3 * mean);
    double b = 1 / log((c + highest) / c);
    return (struct gn_rig_log_sensor){.a = -b * log(c), .b = b, .c = c};
}

static double encode_log(const struct gn_rig_log_sensor *sensor, double radiance)
{
    return sensor->a + sensor->b * log(sensor->c + radiance);
}

int gn_rig_encode_log12(const struct gn_rig_log_sensor *sensor, double radiance)
{
    double code = 4095 * encode_log(sensor, radiance);
    return code > 0 ? (int)fmin(4095, floor(code + 0.5)) : 0;
}

double gn_rig_decode_log12(const struct gn_rig_log_sensor *sensor, double code)
{
    return fmax(0, exp((code / 4095 - sensor->a) / sensor->b) - sensor->c);
}

double gn_rig_encode_srgb8(double linear)
{
    double v = linear > 0 ? fmin(1, linear) : 0;
    return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055);
}

bool gn_rig_read_curve(const char *text, struct gn_rig_curve *out_curve)
{
    struct gn_rig_log_sensor *s = &out_curve->log;
    char rest;
    *out_curve = (struct gn_rig_curve){0};
    if (strcmp(text, "linear") == 0)
        out_curve->type = GN_RIG_CURVE_LINEAR;
    else if (strcmp(text, "srgb") == 0)
        out_curve->type = GN_RIG_CURVE_SRGB;
    else if (sscanf(text, "log:%lf,%lf,%lf%c", &s->a, &s->b, &s->c, &rest) == 3 && isfinite(s->a) &&
             isfinite(s->b) && s->b > 0 && isfinite(s->c) && s->c >= 0)
        out_curve->type = GN_RIG_CURVE_LOG;
    return out_curve->type != GN_RIG_CURVE_NONE;
}

double gn_rig_encode_curve(const struct gn_rig_curve *curve, double light)
{
    switch (curve->type) {
    case GN_RIG_CURVE_LOG:
        return encode_log(&curve->log, light);
    case GN_RIG_CURVE_SRGB:
        return gn_rig_encode_srgb8(light) / 255;
    default:
        return light;
    }
}
