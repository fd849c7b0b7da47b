/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/material.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>

#include "server/scene/scene.h"

static bool is_share(float x)
{
    return x >= 0 && x <= 1;
}

int gn_material_check(struct gn_material *material, struct gn_error *out_error)
{
    if ((int)material->type < 0 || material->type >= GN_MATERIAL_TYPES)
        return gn_error_set(out_error, -EINVAL, "unknown material type %d", (int)material->type);
    for (int k = 0; k < 3; k++) {
        if (!is_share(material->albedo[k]))
            return gn_error_set(out_error, -EINVAL, "albedo must lie in [0, 1]");
    }
    if (!is_share(material->roughness))
        return gn_error_set(out_error, -EINVAL, "roughness must lie in [0, 1]");
    if (!is_share(material->metallic))
        return gn_error_set(out_error, -EINVAL, "metallic must lie in [0, 1]");
    if (material->ior == 0)
        material->ior = GN_MATERIAL_DEFAULT_IOR;
    if (!(material->ior >= 1 && material->ior <= GN_MATERIAL_MAX_IOR))
        return gn_error_set(out_error, -EINVAL, "ior must lie in [1, 4]");
    return 0;
}

int gn_mesh_material_check(struct gn_mesh_material *material, struct gn_error *out_error)
{
    int ret = gn_material_check(&material->factors, out_error);
    if (ret < 0)
        return ret;
    if (!is_share(material->alpha) ||
        !(material->alpha_cutoff >= 0 && isfinite(material->alpha_cutoff)))
        return gn_error_set(out_error, -EINVAL,
                            "alpha must lie in [0, 1], and its cut-off may not be negative");
    if (!(material->normal_scale >= -1e3f && material->normal_scale <= 1e3f))
        return gn_error_set(out_error, -EINVAL, "a normal map's scale must lie in [-1000, 1000]");
    for (int k = 0; k < 3; k++) {
        if (!(material->emission[k] >= 0 && material->emission[k] <= (float)GN_SCENE_MAX_EMISSION))
            return gn_error_set(out_error, -EINVAL, "emission must lie in [0, 1e12] W/(sr m^2)");
    }
    return 0;
}
