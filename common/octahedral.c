/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/octahedral.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

void gn_octahedral_to_direction(double u, double v, double out_dir[static 3])
{
    double x = 2 * u - 1, y = 2 * v - 1, ax = fabs(x), ay = fabs(y);
    double height = 1 - (ax + ay), r = 1 - fabs(height); // height < 0: beyond the equator
    double phi = r > 0 ? 0.25 * pi * ((ay - ax) / r + 1) : 0;
    double sin_theta = r * sqrt(2 - r * r);
    out_dir[0] = copysign(sin_theta * cos(phi), x);
    out_dir[1] = copysign(sin_theta * sin(phi), y);
    out_dir[2] = copysign(1 - r * r, height);
}

void gn_octahedral_from_direction(const double dir[static 3], double out_uv[static 2])
{
    double sin_theta = hypot(dir[0], dir[1]), length = hypot(sin_theta, dir[2]);
    double r = sin_theta / sqrt(length * (length + fabs(dir[2]))); // sqrt(1 - |z|), uncancelled
    double y = r * 2 / pi * atan2(fabs(dir[1]), fabs(dir[0])), x = r - y;
    if (dir[2] < 0) { // mirrored at the equator's side of the quadrant
        double folded = 1 - y;
        y = 1 - x;
        x = folded;
    }
    out_uv[0] = 0.5 * (1 + copysign(x, dir[0]));
    out_uv[1] = 0.5 * (1 + copysign(y, dir[1]));
}
