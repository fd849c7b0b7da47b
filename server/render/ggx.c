/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/ggx.h"

#include <math.h>
#include <string.h>

#include "server/render/ggx_table.h"

/** Least cosine of the eye to a shading normal. */
#define MIN_COSINE 1e-4

static double dot(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double get_fifth(double cosine)
{
    double c = 1 - fmin(fmax(cosine, 0), 1);
    return c * c * c * c * c;
}

static void reflect(const double wo[static 3], const double m[static 3], double out[static 3])
{
    double twice = 2 * dot(wo, m);
    for (int k = 0; k < 3; k++)
        out[k] = twice * m[k] - wo[k];
}

/** Bilinear in x and y, both in nodes. */
static double look_up(const float (*table)[GGX_NODES], double x, double y)
{
    int i = (int)fmin(x, GGX_NODES - 2);
    int j = (int)fmin(y, GGX_NODES - 2);
    double p = x - i;
    double q = y - j;
    return (1 - q) * ((1 - p) * table[j][i] + p * table[j][i + 1]) +
           q * ((1 - p) * table[j + 1][i] + p * table[j + 1][i + 1]);
}

void gn_ggx_get_albedo(double cos_o, double alpha, double *out_whole, double *out_fresnel)
{
    double y = sqrt(alpha) * (GGX_NODES - 1);
    double x = cos_o * (1 + alpha) / (cos_o + alpha) * (GGX_NODES - 1);
    *out_whole = look_up(ggx_table_whole, x, y);
    *out_fresnel = *out_whole * look_up(ggx_table_fifth, sqrt(cos_o) * (GGX_NODES - 1), y);
}

/** Rows about the unit normal n. Duff et al., JCGT 6(1), 2017. */
static void make_frame(const double n[static 3], double out[static 3][3])
{
    double sign = copysign(1, n[2]);
    double a = -1 / (sign + n[2]);
    double b = n[0] * n[1] * a;
    const double rows[3][3] = {{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]},
                               {b, sign + n[1] * n[1] * a, -n[1]},
                               {n[0], n[1], n[2]}};
    memcpy(out, rows, sizeof(rows));
}

static void init_frame(const struct gn_surface *surface, const float dir[static 3], struct ggx *ggx)
{
    double eye[3];
    double n[3];
    for (int k = 0; k < 3; k++) {
        eye[k] = -(double)dir[k];
        n[k] = surface->normal_shading[k];
    }
    double lack = MIN_COSINE - dot(n, eye);
    for (int k = 0; k < 3 && lack > 0; k++)
        n[k] += lack * eye[k];
    double length = sqrt(dot(n, n));
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    make_frame(n, ggx->frame);
    for (int i = 0; i < 3; i++)
        ggx->wo[i] = dot(ggx->frame[i], eye);
    ggx->wo[2] = fmax(ggx->wo[2], 0.5 * MIN_COSINE);
}

void gn_ggx_init(const struct gn_surface *surface, const float dir[static 3], struct ggx *out_ggx)
{
    struct ggx ggx = {.alpha = (double)surface->roughness * surface->roughness};
    double whole = 1;
    double fresnel;
    init_frame(surface, dir, &ggx);
    if (ggx.alpha < GGX_MIN_ALPHA)
        ggx.alpha = 0;
    if (ggx.alpha > 0)
        gn_ggx_get_albedo(ggx.wo[2], ggx.alpha, &whole, &fresnel);
    else
        fresnel = get_fifth(ggx.wo[2]);
    double step = ((double)surface->ior - 1) / ((double)surface->ior + 1);
    double dielectric = step * step;
    double metallic = surface->metallic;
    double lost = (1 - whole) / whole;
    for (int k = 0; k < 3; k++) {
        double albedo = surface->albedo[k];
        ggx.f0[k] = (1 - metallic) * dielectric + metallic * albedo;
        ggx.gain[k] = 1 + ggx.f0[k] * lost;
        ggx.reflected[k] = ggx.gain[k] * (ggx.f0[k] * whole + (1 - ggx.f0[k]) * fresnel);
        double coat = (1 + dielectric * lost) * (dielectric * whole + (1 - dielectric) * fresnel);
        ggx.base[k] = (1 - metallic) * albedo * fmax(0, 1 - coat);
    }
    *out_ggx = ggx;
}

bool gn_ggx_sample(const struct ggx *ggx, const double u[static 2], float out_dir[static 3],
                   double out_weight[static 3], double *out_pdf)
{
    double m[3] = {0, 0, 1};
    double wi[3];
    double share = 1;
    if (ggx->alpha > 0)
        gn_ggx_sample_facet(ggx->wo, ggx->alpha, u, m);
    reflect(ggx->wo, m, wi);
    if (!(wi[2] > 0))
        return false;
    double cosine = dot(ggx->wo, m);
    *out_pdf = INFINITY;
    if (ggx->alpha > 0) {
        share = gn_ggx_get_unmasked(ggx->wo, wi, ggx->alpha);
        double a2 = ggx->alpha * ggx->alpha;
        double d = 1 + (a2 - 1) * m[2] * m[2];
        double density = a2 / (M_PI * d * d);
        *out_pdf = density * gn_ggx_get_visible(ggx->wo, ggx->alpha) / (4 * ggx->wo[2]);
    }
    double fifth = get_fifth(cosine);
    for (int k = 0; k < 3; k++) {
        out_weight[k] = ggx->gain[k] * (ggx->f0[k] + (1 - ggx->f0[k]) * fifth) * share;
        out_dir[k] =
            (float)(wi[0] * ggx->frame[0][k] + wi[1] * ggx->frame[1][k] + wi[2] * ggx->frame[2][k]);
    }
    return true;
}

void gn_ggx_eval(const struct ggx *ggx, const float dir[static 3], double out_value[static 3],
                 double *out_pdf)
{
    double wi[3];
    double m[3];
    for (int i = 0; i < 3; i++) {
        wi[i] = ggx->frame[i][0] * dir[0] + ggx->frame[i][1] * dir[1] + ggx->frame[i][2] * dir[2];
        m[i] = wi[i] + ggx->wo[i];
    }
    *out_pdf = out_value[0] = out_value[1] = out_value[2] = 0;
    double length = sqrt(dot(m, m));
    if (!(wi[2] > 0) || !(ggx->alpha > 0) || !(length > 0))
        return;
    for (int k = 0; k < 3; k++)
        m[k] /= length;
    // 1 - m_z^2 from the halves across the normal: exact near it, where D is narrow.
    double a2 = ggx->alpha * ggx->alpha;
    double d = (m[0] * m[0] + m[1] * m[1]) + a2 * m[2] * m[2];
    double density = a2 / (M_PI * d * d);
    *out_pdf = density * gn_ggx_get_visible(ggx->wo, ggx->alpha) / (4 * ggx->wo[2]);
    double share = gn_ggx_get_unmasked(ggx->wo, wi, ggx->alpha);
    double fifth = get_fifth(dot(ggx->wo, m));
    for (int k = 0; k < 3; k++)
        out_value[k] = *out_pdf * share * ggx->gain[k] * (ggx->f0[k] + (1 - ggx->f0[k]) * fifth);
}
