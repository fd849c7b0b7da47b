/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/rotation.h"

#include <math.h>

static double length(const double v[static 3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/** out = a b; out may alias either. */
static void multiply(const double a[static 4], const double b[static 4], double out[static 4])
{
    double r[4] = {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                   a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                   a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                   a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    for (int i = 0; i < 4; i++)
        out[i] = r[i];
}

void gn_rotation_exp(const double vector[static 3], double out_q[static 4])
{
    double angle = length(vector);
    // sin(angle / 2) / angle, by its series where the quotient is not exact.
    double share = angle > 1e-6 ? sin(angle / 2) / angle : 0.5 - angle * angle / 48;
    out_q[0] = cos(angle / 2);
    for (int i = 0; i < 3; i++)
        out_q[1 + i] = share * vector[i];
}

void gn_rotation_log(const double q[static 4], double out_vector[static 3])
{
    double sine = length(q + 1), sign = q[0] < 0 ? -1 : 1;
    double angle = 2 * atan2(sine, fabs(q[0]));
    double share = sign * (sine > 1e-12 ? angle / sine : 2);
    for (int i = 0; i < 3; i++)
        out_vector[i] = share * q[1 + i];
}

void gn_rotation_between(const double a[static 4], const double b[static 4],
                         double out_vector[static 3])
{
    double back[4] = {a[0], -a[1], -a[2], -a[3]};
    multiply(back, b, back);
    gn_rotation_log(back, out_vector);
}

double gn_rotation_get_angle(const double a[static 4], const double b[static 4])
{
    double vector[3];
    gn_rotation_between(a, b, vector);
    return length(vector);
}

void gn_rotation_turn(double q[static 4], const double vector[static 3])
{
    double turn[4], norm = 0;
    gn_rotation_exp(vector, turn);
    multiply(q, turn, q);
    for (int i = 0; i < 4; i++)
        norm += q[i] * q[i];
    for (int i = 0; i < 4; i++)
        q[i] /= sqrt(norm);
}
