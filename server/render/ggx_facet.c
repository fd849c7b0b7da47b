/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The facets of ggx.h: which are seen, and from where. */
#include <math.h>

#include "server/render/ggx.h"

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** Lambda of Smith's function: invisible per visible facets. */
static double get_lambda(const double w[static 3], double alpha)
{
    double tan2 = (w[0] * w[0] + w[1] * w[1]) / (w[2] * w[2]);
    return 0.5 * (sqrt(1 + alpha * alpha * tan2) - 1);
}

double gn_ggx_get_visible(const double w[static 3], double alpha)
{
    return 1 / (1 + get_lambda(w, alpha));
}

double gn_ggx_get_unmasked(const double wo[static 3], const double wi[static 3], double alpha)
{
    double lambda = get_lambda(wo, alpha);
    return (1 + lambda) / (1 + lambda + get_lambda(wi, alpha));
}

void gn_ggx_sample_facet(const double wo[static 3], double alpha, const double u[static 2],
                         double out_facet[static 3])
{
    // The eye in the space where the facets are a hemisphere; the disc that it sees of that.
    double v[3] = {alpha * wo[0], alpha * wo[1], wo[2]};
    double length = sqrt(dot(v, v));
    for (int k = 0; k < 3; k++)
        v[k] /= length;
    double across2 = v[0] * v[0] + v[1] * v[1];
    double across = sqrt(across2);
    const double s[3] = {across2 > 0 ? -v[1] / across : 1, across2 > 0 ? v[0] / across : 0, 0};
    const double t[3] = {v[1] * s[2] - v[2] * s[1], v[2] * s[0] - v[0] * s[2],
                         v[0] * s[1] - v[1] * s[0]};
    double r = sqrt(u[0]);
    double phi = 2 * M_PI * u[1];
    double x = r * cos(phi);
    double y = r * sin(phi);
    double share = 0.5 * (1 + v[2]);
    y = (1 - share) * sqrt(fmax(0, 1 - x * x)) + share * y;
    double z = sqrt(fmax(0, 1 - x * x - y * y));
    double m[3];
    for (int k = 0; k < 3; k++)
        m[k] = x * s[k] + y * t[k] + z * v[k];
    m[0] *= alpha;
    m[1] *= alpha;
    m[2] = fmax(m[2], 1e-12);
    length = sqrt(dot(m, m));
    for (int k = 0; k < 3; k++)
        out_facet[k] = m[k] / length;
}
