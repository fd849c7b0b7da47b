/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/emission.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// A uv may lie outside the picture by this much, and is taken to its edge.
#define UV_MARGIN 1e-4f

bool gn_scene_is_emitter(const struct gn_scene_object *object)
{
    return object->emission_stream || object->emission[0] > 0 || object->emission[1] > 0 ||
           object->emission[2] > 0;
}

/** The corners of a parallelogram counter-clockwise from the first one. False: it is none. */
static bool get_corners(const struct gn_mesh *mesh, uint32_t out[static 4])
{
    const uint32_t *a = mesh->triangles;
    const uint32_t *b = mesh->triangles + 3;
    if (mesh->n_triangles != 2)
        return false;
    for (int i = 0; i < 9; i++) {
        // The second triangle goes along the shared edge the other way.
        int p = i / 3;
        int q = i % 3;
        if (a[p] != b[(q + 1) % 3] || a[(p + 1) % 3] != b[q])
            continue;
        // Shared: a[p] to a[p + 1]; between them comes the fourth corner.
        int n = 0;
        for (int k = 0; k < 3; k++) {
            out[n++] = a[k];
            if (k == p)
                out[n++] = b[(q + 2) % 3];
        }
        float size = 0;
        float gap = 0;
        for (int k = 0; k < 3; k++) {
            float c[4];
            for (int j = 0; j < 4; j++)
                c[j] = mesh->positions[3 * (size_t)out[j] + (size_t)k];
            size = fmaxf(size, fmaxf(fabsf(c[1] - c[0]), fabsf(c[3] - c[0])));
            gap = fmaxf(gap, fabsf((c[1] - c[0]) - (c[2] - c[3])));
        }
        return gap <= 1e-3f * size;
    }
    return false;
}

static int derive_uvs(struct gn_mesh *mesh, int index, struct gn_error *out_error)
{
    static const float corner_uvs[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    uint32_t corners[4];
    if (!get_corners(mesh, corners))
        return gn_error_set(out_error, -EINVAL,
                            "object %d: a picture is streamed onto it, but its mesh has no uv; "
                            "only a rectangle of two triangles may do without",
                            index);
    mesh->uvs = calloc((size_t)mesh->n_vertices, 2 * sizeof(*mesh->uvs));
    if (!mesh->uvs)
        return gn_error_set(out_error, -ENOMEM, "object %d: out of memory", index);
    for (int i = 0; i < 4; i++)
        memcpy(mesh->uvs + 2 * (size_t)corners[i], corner_uvs[i], sizeof(corner_uvs[i]));
    return 0;
}

static int check_uvs(struct gn_mesh *mesh, int index, struct gn_error *out_error)
{
    if (!mesh->uvs)
        return derive_uvs(mesh, index, out_error);
    for (int i = 0; i < 3 * mesh->n_triangles; i++) {
        float *uv = mesh->uvs + 2 * (size_t)mesh->triangles[i];
        for (int k = 0; k < 2; k++) {
            if (!(uv[k] >= -UV_MARGIN && uv[k] <= 1 + UV_MARGIN))
                return gn_error_set(out_error, -EINVAL,
                                    "object %d: a picture is streamed onto it, but triangle %d has "
                                    "uv (%g, %g); the picture lies in [0, 1]",
                                    index, i / 3, (double)uv[0], (double)uv[1]);
            uv[k] = fminf(fmaxf(uv[k], 0), 1);
        }
    }
    return 0;
}

int gn_scene_check_emission(struct gn_scene_object *object, int index, struct gn_error *out_error)
{
    for (int k = 0; k < 3; k++) {
        if (!(object->emission[k] >= 0 && object->emission[k] <= (float)GN_SCENE_MAX_EMISSION))
            return gn_error_set(out_error, -EINVAL,
                                "object %d: emission must lie in [0, 1e12] W/(sr m^2)", index);
    }
    if (!gn_scene_is_emitter(object))
        return 0;
    if (object->has_material && object->material.type != GN_MATERIAL_DIFFUSE)
        return gn_error_set(out_error, -EINVAL,
                            "object %d: only a diffuse material may have emission", index);
    if (!object->emission_stream)
        return 0;
    size_t length = strlen(object->emission_stream);
    if (length < 1 || length > GN_SCENE_MAX_STREAM)
        return gn_error_set(out_error, -EINVAL, "object %d: a stream's name has 1 to %d bytes",
                            index, GN_SCENE_MAX_STREAM);
    if (!(object->emission_scale > 0 && object->emission_scale <= (float)GN_SCENE_MAX_EMISSION))
        return gn_error_set(out_error, -EINVAL,
                            "object %d: emission_scale must lie in (0, 1e12] W/(sr m^2)", index);
    return check_uvs(&object->mesh, index, out_error);
}
