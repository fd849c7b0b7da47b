/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/render.h"

/* Virtual triangles of a mirror, or not of one. */
static bool has_virtual(const struct gn_scene *scene, bool is_mirror)
{
    for (int i = 0; i < scene->n_objects; i++) {
        const struct gn_scene_object *object = &scene->objects[i];
        bool mirrors = object->has_material && object->material.type == GN_MATERIAL_MIRROR;
        if (object->role == GN_RT_VIRTUAL && object->mesh.n_triangles > 0 && mirrors == is_mirror)
            return true;
    }
    return false;
}

void gn_render_get_needs(const struct gn_scene *scene, const struct gn_render_options *options,
                         struct gn_render_needs *out_needs)
{
    bool has_real = scene->n_real_triangles > 0;
    // What is lit: a surface that is drawn, or a real one that a drawn mirror shows.
    bool lights_surfaces = has_virtual(scene, false) || (has_virtual(scene, true) && has_real);
    bool throws_shadows = !options->no_shadow && scene->n_virtual_triangles > 0 && has_real;
    bool by_map = options->shading == GN_SHADING_IRRADIANCE;
    *out_needs = (struct gn_render_needs){0};
    if (options->quality == GN_QUALITY_REFERENCE) {
        out_needs->why_no_lights = out_needs->why_no_sh =
            "the reference takes each texel as a light";
        return;
    }
    if (!(lights_surfaces && !by_map) && !throws_shadows)
        out_needs->why_no_lights =
            scene->n_virtual_triangles == 0 ? "the scene has no virtual object"
            : lights_surfaces               ? "irradiance shading, and no shadow asked for"
                                            : "nothing is lit by lights or throws a shadow";
    if (!(lights_surfaces && by_map))
        out_needs->why_no_sh = scene->n_virtual_triangles == 0 ? "the scene has no virtual object"
                               : by_map                        ? "no surface is lit"
                                        : "surfaces are shaded by the lights";
}
