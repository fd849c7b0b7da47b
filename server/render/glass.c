/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/glass.h"

#include <math.h>
#include <string.h>

#include "server/render/ggx.h"

double gn_glass_get_fresnel(double cos_i, double ratio, double *out_cos_t)
{
    double sin2 = (1 - cos_i * cos_i) / (ratio * ratio);
    *out_cos_t = 0;
    if (sin2 >= 1)
        return 1;
    double cos_t = sqrt(1 - sin2);
    double s = (cos_i - ratio * cos_t) / (cos_i + ratio * cos_t);
    double p = (cos_t - ratio * cos_i) / (cos_t + ratio * cos_i);
    *out_cos_t = cos_t;
    return cos_i > 0 ? 0.5 * (s * s + p * p) : 1;
}

/** Into world; false where it lies on the wrong side of the real surface. */
static bool leave(const struct ggx *frame, const struct gn_surface *surface,
                  const double w[static 3], bool is_through, struct glass_ray *out_ray)
{
    double side = 0;
    for (int k = 0; k < 3; k++) {
        double d =
            w[0] * frame->frame[0][k] + w[1] * frame->frame[1][k] + w[2] * frame->frame[2][k];
        out_ray->dir[k] = (float)d;
        side += d * surface->normal_horizon[k];
    }
    return is_through ? side < 0 : side > 0;
}

void gn_glass_split(const struct gn_surface *surface, const float dir[static 3],
                    const double u[static 2], struct glass_ray *out_reflected,
                    struct glass_ray *out_refracted)
{
    struct ggx ggx;
    double m[3] = {0, 0, 1};
    double wr[3];
    double wt[3];
    double cos_t;
    gn_ggx_init(surface, dir, &ggx);
    if (ggx.alpha > 0)
        gn_ggx_sample_facet(ggx.wo, ggx.alpha, u, m);
    double ratio = surface->is_front ? (double)surface->ior : 1 / (double)surface->ior;
    double cos_i = fmin(ggx.wo[0] * m[0] + ggx.wo[1] * m[1] + ggx.wo[2] * m[2], 1);
    double fresnel = gn_glass_get_fresnel(fmax(cos_i, 0), ratio, &cos_t);
    for (int k = 0; k < 3; k++) {
        wr[k] = 2 * cos_i * m[k] - ggx.wo[k];
        wt[k] = (cos_i / ratio - cos_t) * m[k] - ggx.wo[k] / ratio;
    }
    *out_reflected = *out_refracted = (struct glass_ray){0};
    bool is_reflected = leave(&ggx, surface, wr, false, out_reflected) && wr[2] > 0;
    bool is_refracted = cos_t > 0 && leave(&ggx, surface, wt, true, out_refracted) && wt[2] < 0;
    double kept = is_reflected && ggx.alpha > 0 ? gn_ggx_get_unmasked(ggx.wo, wr, ggx.alpha) : 1;
    double passed = is_refracted && ggx.alpha > 0 ? gn_ggx_get_visible(wt, ggx.alpha) : 1;
    for (int k = 0; k < 3; k++) {
        out_reflected->weight[k] = is_reflected ? fresnel * kept : 0;
        out_refracted->weight[k] =
            is_refracted ? (1 - fresnel) * passed * (double)surface->albedo[k] : 0;
    }
}
