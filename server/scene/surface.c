/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A hit as shading sees it: normals, the smooth surface that the mesh stands for, and the material
 * by its pictures.
 */
#include <math.h>
#include <string.h>

#include "server/scene/scene.h"

// Reflectance of a diffuse object whose file and manifest say nothing.
#define DEFAULT_ALBEDO 0.5f

static float dot(const float a[static 3], const float b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** False, and nothing is done, where v has no direction. */
static bool normalize(double v[static 3])
{
    double sum = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    if (!(sum > 0.0))
        return false;
    double scale = 1.0 / sqrt(sum);
    for (int k = 0; k < 3; k++)
        v[k] *= scale;
    return true;
}

/** A hit with what of its triangle is needed more than once. */
struct spot {
    const struct gn_scene_object *object;
    const struct gn_mesh *mesh;
    const uint32_t *index;                   // the triangle's vertices
    float weights[3];                        // barycentric
    const struct gn_mesh_material *material; // NULL: the object's
    float side; // -1: seen from where the vertex normals point away from
};

static struct spot get_spot(const struct gn_scene *scene, const struct gn_rt_hit *hit)
{
    const struct gn_scene_object *object = &scene->objects[hit->object];
    const struct gn_mesh *mesh = &object->mesh;
    return (struct spot){
        .object = object,
        .side = 1,
        .mesh = mesh,
        .index = mesh->triangles + 3 * (size_t)hit->triangle,
        .weights = {1.0f - hit->u - hit->v, hit->u, hit->v},
        .material = !object->has_material && mesh->material
                        ? &mesh->materials[mesh->material[hit->triangle]]
                        : NULL,
    };
}

/** A vertex's normal in world, not of unit length. */
static void turn_normal(const struct gn_scene_object *object, const double n[static 3],
                        double out_world[static 3])
{
    const double *m = object->normal_matrix;
    for (int k = 0; k < 3; k++)
        out_world[k] = m[3 * k] * n[0] + m[3 * k + 1] * n[1] + m[3 * k + 2] * n[2];
}

/** The interpolated normal in world, unit; false where it has no direction. */
static bool get_interpolated(const struct spot *spot, float out_normal[static 3])
{
    double n[3] = {0};
    double world[3];
    if (!spot->mesh->normals)
        return false;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            n[k] += (double)spot->weights[i] *
                    spot->mesh->normals[3 * (size_t)spot->index[i] + (size_t)k];
    }
    turn_normal(spot->object, n, world);
    if (!normalize(world))
        return false;
    for (int k = 0; k < 3; k++)
        out_normal[k] = (float)world[k];
    return true;
}

/**
 * From the point to the smooth surface that the vertex normals tell of, on their side: the
 * point's distances under the three tangent planes, each along its normal, interpolated. Source:
 * Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, chapter 4.
 */
static void get_lift(const struct spot *spot, float out_lift[static 3])
{
    const double *m = spot->object->world_from_object;
    double lift[3] = {0};
    for (int i = 0; i < 3; i++) {
        double from_vertex[3] = {0}; // object, then world
        double world[3];
        double normal[3];
        double depth = 0;
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++)
                from_vertex[k] +=
                    (double)spot->weights[j] *
                    ((double)spot->mesh->positions[3 * (size_t)spot->index[j] + (size_t)k] -
                     spot->mesh->positions[3 * (size_t)spot->index[i] + (size_t)k]);
        }
        const float *n = spot->mesh->normals + 3 * (size_t)spot->index[i];
        const double wide[3] = {n[0], n[1], n[2]};
        turn_normal(spot->object, wide, normal);
        if (!normalize(normal))
            continue;
        for (int k = 0; k < 3; k++) {
            world[k] = m[4 * k] * from_vertex[0] + m[4 * k + 1] * from_vertex[1] +
                       m[4 * k + 2] * from_vertex[2];
            depth += world[k] * normal[k] * (double)spot->side;
        }
        for (int k = 0; k < 3 && depth < 0; k++)
            lift[k] -= (double)spot->weights[i] * depth * normal[k] * (double)spot->side;
    }
    for (int k = 0; k < 3; k++)
        out_lift[k] = (float)lift[k];
}

static void get_uv(const struct spot *spot, float out_uv[static 2])
{
    for (int k = 0; k < 2 && spot->mesh->uvs; k++)
        out_uv[k] = spot->weights[0] * spot->mesh->uvs[2 * (size_t)spot->index[0] + (size_t)k] +
                    spot->weights[1] * spot->mesh->uvs[2 * (size_t)spot->index[1] + (size_t)k] +
                    spot->weights[2] * spot->mesh->uvs[2 * (size_t)spot->index[2] + (size_t)k];
}

/** Geometric and interpolated normals and the lift. */
static void fill_normals(struct spot *spot, const float dir[static 3], const struct gn_rt_hit *hit,
                         struct gn_surface *s)
{
    float side = dot(hit->normal, dir) > 0.0f ? -1.0f : 1.0f;
    float interpolated[3];
    s->is_front = side > 0.0f; // rt's normal is the outside's, also where the matrix mirrors
    for (int k = 0; k < 3; k++)
        s->normal_geometric[k] = side * hit->normal[k];
    memcpy(s->normal_horizon, s->normal_geometric, sizeof(s->normal_horizon));
    if (get_interpolated(spot, interpolated)) {
        // To the side of the geometric normal: files have normals and windings that disagree.
        spot->side = dot(interpolated, s->normal_geometric) < 0.0f ? -1.0f : 1.0f;
        for (int k = 0; k < 3; k++)
            s->normal_horizon[k] = spot->side * interpolated[k];
        get_lift(spot, s->lift);
    }
    memcpy(s->normal_shading, s->normal_horizon, sizeof(s->normal_shading));
}

/** Side of a footprint, m, in texels of a picture: by the triangle's areas in world and in uv. */
static float get_texels(const struct spot *spot, const struct gn_texture *texture, float footprint)
{
    const double *m = spot->object->world_from_object;
    const float *uvs = spot->mesh->uvs;
    double edge[2][3] = {{0}};
    double uv[2][2];
    if (!(footprint > 0))
        return 0;
    for (int i = 0; i < 2; i++) {
        const float *a = spot->mesh->positions + 3 * (size_t)spot->index[0];
        const float *b = spot->mesh->positions + 3 * (size_t)spot->index[i + 1];
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < 3; j++)
                edge[i][k] += m[4 * k + j] * ((double)b[j] - a[j]);
        }
        for (int k = 0; k < 2; k++)
            uv[i][k] = (double)uvs[2 * (size_t)spot->index[i + 1] + (size_t)k] -
                       uvs[2 * (size_t)spot->index[0] + (size_t)k];
    }
    double x = edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1];
    double y = edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2];
    double z = edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0];
    double area = sqrt(x * x + y * y + z * z);
    double area_uv = fabs(uv[0][0] * uv[1][1] - uv[0][1] * uv[1][0]);
    double texels = area_uv * texture->width * texture->height;
    return area > 0 ? (float)fmin(footprint * sqrt(texels / area), 1e6) : 0;
}

/** Multiplies the first n of values[4] by the picture, where there is one. */
static void apply_picture(const struct spot *spot, const struct gn_texture_slot *slot,
                          const float uv[static 2], float footprint, int n, float *values)
{
    float rgba[4];
    if (!slot->texture || !spot->mesh->uvs)
        return;
    gn_texture_sample(slot, uv, get_texels(spot, slot->texture, footprint), rgba);
    for (int k = 0; k < n; k++)
        values[k] *= rgba[k];
}

/** -1 where the matrix mirrors. */
static double get_handedness(const double m[static 16])
{
    return copysign(1, m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                           m[2] * (m[4] * m[9] - m[5] * m[8]));
}

/** The horizon's normal turned as the normal map says, in the frame of the vertices' tangents. */
static void bend_normal(const struct spot *spot, float footprint, struct gn_surface *s)
{
    const struct gn_mesh_material *material = spot->material;
    const double *m = spot->object->world_from_object;
    float map[4] = {1, 1, 1, 1};
    double t[3] = {0};
    double tangent[3];
    if (!material->normal.texture || !spot->mesh->tangents || !spot->mesh->uvs)
        return;
    apply_picture(spot, &material->normal, s->uv, footprint, 3, map);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            t[k] += (double)spot->weights[i] *
                    spot->mesh->tangents[4 * (size_t)spot->index[i] + (size_t)k];
    }
    const float *n = s->normal_horizon;
    double along = 0;
    for (int k = 0; k < 3; k++) {
        tangent[k] = m[4 * k] * t[0] + m[4 * k + 1] * t[1] + m[4 * k + 2] * t[2];
        along += tangent[k] * n[k];
    }
    for (int k = 0; k < 3; k++)
        tangent[k] -= along * n[k];
    if (!normalize(tangent))
        return;
    // From behind the whole bump is turned round, n with it; a mirrored object turns the cross
    // product of n and the tangent.
    double x = (2.0 * map[0] - 1) * material->normal_scale * spot->side;
    double y = (2.0 * map[1] - 1) * material->normal_scale *
               spot->mesh->tangents[4 * (size_t)spot->index[0] + 3] * get_handedness(m);
    double z = fmax(2.0 * map[2] - 1, 0);
    double bent[3];
    const double bitangent[3] = {n[1] * tangent[2] - n[2] * tangent[1],
                                 n[2] * tangent[0] - n[0] * tangent[2],
                                 n[0] * tangent[1] - n[1] * tangent[0]};
    for (int k = 0; k < 3; k++)
        bent[k] = x * tangent[k] + y * bitangent[k] + z * n[k];
    if (!normalize(bent))
        return;
    for (int k = 0; k < 3; k++)
        s->normal_shading[k] = (float)bent[k];
}

static void fill_file_material(const struct spot *spot, float footprint, struct gn_surface *s)
{
    const struct gn_mesh_material *material = spot->material;
    float color[4] = {material->factors.albedo[0], material->factors.albedo[1],
                      material->factors.albedo[2], material->alpha};
    float rough[4] = {1, material->factors.roughness, material->factors.metallic, 1};
    memcpy(s->emission, material->emission, sizeof(s->emission));
    apply_picture(spot, &material->base_color, s->uv, footprint, 4, color);
    apply_picture(spot, &material->metallic_roughness, s->uv, footprint, 3, rough);
    apply_picture(spot, &material->emissive, s->uv, footprint, 3, s->emission);
    memcpy(s->albedo, color, sizeof(s->albedo));
    s->material = material->factors.type;
    s->roughness = rough[1];
    s->metallic = rough[2];
    s->ior = material->factors.ior;
    bend_normal(spot, footprint, s);
}

static void fill_object_material(const struct spot *spot, uint32_t triangle, struct gn_surface *s)
{
    const struct gn_scene_object *object = spot->object;
    const float *albedos = spot->mesh->albedos;
    for (int k = 0; k < 3; k++) {
        s->albedo[k] = DEFAULT_ALBEDO;
        if (object->has_material)
            s->albedo[k] = object->material.albedo[k];
        else if (albedos)
            s->albedo[k] = albedos[3 * (size_t)triangle + (size_t)k];
    }
    s->material = object->has_material ? object->material.type : GN_MATERIAL_DIFFUSE;
    s->roughness = object->material.roughness;
    s->metallic = object->material.metallic;
    s->ior = object->material.ior;
}

void gn_scene_get_surface_filtered(const struct gn_scene *scene, const float dir[static 3],
                                   const struct gn_rt_hit *hit, float footprint,
                                   struct gn_surface *out_surface)
{
    struct spot spot = get_spot(scene, hit);
    struct gn_surface s = {
        .clearance = hit->clearance, .role = spot.object->role, .object = hit->object};
    memcpy(s.point, hit->point, sizeof(s.point));
    get_uv(&spot, s.uv);
    fill_normals(&spot, dir, hit, &s);
    if (spot.material)
        fill_file_material(&spot, footprint, &s);
    else
        fill_object_material(&spot, hit->triangle, &s);
    *out_surface = s;
}

void gn_scene_get_surface(const struct gn_scene *scene, const float dir[static 3],
                          const struct gn_rt_hit *hit, struct gn_surface *out_surface)
{
    gn_scene_get_surface_filtered(scene, dir, hit, 0, out_surface);
}

void gn_surface_get_origin(const struct gn_surface *surface, float out_org[static 3])
{
    gn_rt_offset_origin(surface->point, surface->normal_geometric, surface->clearance,
                        surface->normal_geometric, out_org);
    for (int k = 0; k < 3; k++)
        out_org[k] += surface->lift[k];
}

void gn_surface_get_origin_behind(const struct gn_surface *surface, float out_org[static 3])
{
    const float *n = surface->normal_geometric;
    const float behind[3] = {-n[0], -n[1], -n[2]};
    gn_rt_offset_origin(surface->point, n, surface->clearance, behind, out_org);
}
