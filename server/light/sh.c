/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/sh.h"

#include <math.h>
#include <string.h>

#include "server/light/sh_internal.h"

static const double pi = 3.14159265358979323846;

/* sqrt of (1, 3, 15, 5, 35, 105, 21, 7, ...) / pi and powers of two: what makes the polynomials
 * orthonormal. */
const double gn_sh_factor[GN_SH_MAX] = {
    0.28209479177387814,                                           // 1/2 sqrt(1/pi)
    0.48860251190291992, 0.48860251190291992, 0.48860251190291992, // 1/2 sqrt(3/pi)
    1.0925484305920792,  1.0925484305920792,                       // 1/2 sqrt(15/pi)
    0.31539156525252005,                                           // 1/4 sqrt(5/pi)
    1.0925484305920792,  0.54627421529603959,                      // 1/4 sqrt(15/pi)
    0.59004358992664351,                                           // 1/4 sqrt(35/2pi)
    2.8906114426405543,                                            // 1/2 sqrt(105/pi)
    0.45704579946446572,                                           // 1/4 sqrt(21/2pi)
    0.37317633259011546,                                           // 1/4 sqrt(7/pi)
    0.45704579946446572, 1.4453057213202769,  0.59004358992664351, //
    2.5033429417967046,                                            // 3/4 sqrt(35/pi)
    1.7701307697799307,                                            // 3/4 sqrt(35/2pi)
    0.94617469575756008,                                           // 3/4 sqrt(5/pi)
    0.66904654355728921,                                           // 3/4 sqrt(5/2pi)
    0.10578554691520431,                                           // 3/16 sqrt(1/pi)
    0.66904654355728921, 0.47308734787878004, 1.7701307697799307,  //
    0.62583573544917614,                                           // 3/16 sqrt(35/pi)
};

void gn_sh_get_basis(int order, const double dir[static 3], double out_basis[static GN_SH_MAX])
{
    double x = dir[0], y = dir[1], z = dir[2], xx = x * x, yy = y * y, zz = z * z;
    GN_SH_POLYNOMIALS_2(out_basis, 1, x, y, z, xx, yy, zz);
    if (order > 2)
        GN_SH_POLYNOMIALS_4(out_basis, x, y, z, xx, yy, zz);
    for (int k = 0; k < gn_sh_get_count(order); k++)
        out_basis[k] *= gn_sh_factor[k];
}

void gn_sh_add_light(int order, const double dir[static 3], const double irradiance[static 3],
                     double sh[static GN_SH_MAX][3])
{
    double basis[GN_SH_MAX];
    gn_sh_get_basis(order, dir, basis);
    for (int k = 0; k < gn_sh_get_count(order); k++)
        for (int c = 0; c < 3; c++)
            sh[k][c] += irradiance[c] * basis[k];
}

/* A product of two functions of order 4 is integrated exactly by 5 Gauss-Legendre nodes in z and 10
 * even steps around: the turned function is taken there and projected again. */
void gn_sh_rotate(int order, const double b_from_a[static 9], double sh[static GN_SH_MAX][3])
{
    static const double node[5] = {-0.90617984593866399, -0.53846931010568309, 0,
                                   0.53846931010568309, 0.90617984593866399};
    static const double weight[5] = {0.23692688505618909, 0.47862867049936647, 0.56888888888888889,
                                     0.47862867049936647, 0.23692688505618909};
    double out[GN_SH_MAX][3] = {{0}};
    const double *m = b_from_a;
    for (int i = 0; i < 50; i++) {
        double z = node[i / 10], s = sqrt(1 - z * z), phi = pi / 5 * (i % 10);
        double b[3] = {s * cos(phi), s * sin(phi), z}, a[3], basis[GN_SH_MAX], value[3] = {0};
        for (int k = 0; k < 3; k++)
            a[k] = m[k] * b[0] + m[3 + k] * b[1] + m[6 + k] * b[2];
        gn_sh_get_basis(order, a, basis);
        for (int k = 0; k < gn_sh_get_count(order); k++)
            for (int c = 0; c < 3; c++)
                value[c] += basis[k] * sh[k][c];
        for (int c = 0; c < 3; c++)
            value[c] *= weight[i / 10] * pi / 5;
        gn_sh_add_light(order, b, value, out);
    }
    memcpy(sh, out, sizeof(out));
}

double gn_sh_get_cosine_factor(int l)
{
    static const double factor[5] = {3.14159265358979323846, 2.0943951023931953,
                                     0.78539816339744831, 0, -0.13089969389957472};
    return factor[l];
}

void gn_sh_get_irradiance(int order, const double sh[][3], const double normal[static 3],
                          double out_irradiance[static 3])
{
    double basis[GN_SH_MAX], e[3] = {0};
    gn_sh_get_basis(order, normal, basis);
    for (int l = 0; l <= order; l++) {
        double a = gn_sh_get_cosine_factor(l);
        for (int k = l * l; k < (l + 1) * (l + 1); k++)
            for (int c = 0; c < 3; c++)
                e[c] += a * basis[k] * sh[k][c];
    }
    memcpy(out_irradiance, e, sizeof(e));
}
