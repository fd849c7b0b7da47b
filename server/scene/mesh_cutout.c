/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Where a mesh has holes by its material's alpha. */
#include "server/scene/mesh.h"

bool gn_mesh_has_cutouts(const struct gn_mesh *mesh)
{
    for (int i = 0; mesh->material && i < mesh->n_materials; i++) {
        if (mesh->materials[i].alpha_cutoff > 0)
            return true;
    }
    return false;
}

bool gn_mesh_is_cut_out(const struct gn_mesh *mesh, uint32_t triangle, float u, float v)
{
    const struct gn_mesh_material *material = &mesh->materials[mesh->material[triangle]];
    const uint32_t *index = mesh->triangles + 3 * (size_t)triangle;
    float alpha = material->alpha;
    if (!(material->alpha_cutoff > 0))
        return false;
    if (material->base_color.texture && mesh->uvs) {
        float uv[2];
        float rgba[4];
        for (int k = 0; k < 2; k++)
            uv[k] = (1.0f - u - v) * mesh->uvs[2 * (size_t)index[0] + (size_t)k] +
                    u * mesh->uvs[2 * (size_t)index[1] + (size_t)k] +
                    v * mesh->uvs[2 * (size_t)index[2] + (size_t)k];
        gn_texture_sample(&material->base_color, uv, 0, rgba);
        alpha *= rgba[3];
    }
    return alpha < material->alpha_cutoff;
}
