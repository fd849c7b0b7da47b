/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Materials of glTF files as Assimp gives them. Numbers and strings are the file's: not trusted.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/scene.h>

#include "server/scene/mesh_import.h"
#include "server/scene/mesh_pictures.h"

/** What files ask for that is not done. */
enum ignored {
    IGNORED_BLEND,
    IGNORED_OCCLUSION,
    IGNORED_CLEARCOAT,
    IGNORED_SHEEN,
    IGNORED_TRANSMISSION,
    IGNORED_SPECULAR,
    IGNORED_UNLIT,
    IGNORED_IOR,
    IGNORED_VOLUME,
    IGNORED_TRANSFORM,
    IGNORED_UV_SET,
    IGNORED_NO_UV,
    IGNORED_NO_NORMALS,
    IGNORED_COLORS,
    IGNORED_SKIN,
    IGNORED_MORPH,
    IGNORED_ANIMATION,
    IGNORED_LIGHTS,
    N_IGNORED
};

static const char *const ignored_names[N_IGNORED] = {
    [IGNORED_BLEND] = "alpha blending (taken as opaque)",
    [IGNORED_OCCLUSION] = "occlusion maps",
    [IGNORED_CLEARCOAT] = "clearcoat",
    [IGNORED_SHEEN] = "sheen",
    [IGNORED_TRANSMISSION] = "transmission",
    [IGNORED_SPECULAR] = "specular-glossiness (its specular colour)",
    [IGNORED_UNLIT] = "unlit materials (lit like others)",
    [IGNORED_IOR] = "an index of refraction outside [1, 4]",
    [IGNORED_VOLUME] = "volumes",
    [IGNORED_TRANSFORM] = "texture transforms",
    [IGNORED_UV_SET] = "second texture coordinates",
    [IGNORED_NO_UV] = "pictures on a mesh without texture coordinates",
    [IGNORED_NO_NORMALS] = "normal maps on a mesh without normals",
    [IGNORED_COLORS] = "vertex colours",
    [IGNORED_SKIN] = "skins",
    [IGNORED_MORPH] = "morph targets",
    [IGNORED_ANIMATION] = "animations",
    [IGNORED_LIGHTS] = "lights",
};

struct reader {
    const char *path;
    const struct aiScene *scene;
    struct gn_mesh *mesh;
    struct gn_error *error;
    bool is_ignored[N_IGNORED];
    struct gn_mesh_pictures pictures;
};

static float get_float(const struct aiMaterial *material, const char *key, unsigned type,
                       unsigned index, float absent)
{
    ai_real value = absent;
    unsigned n = 1;
    if (aiGetMaterialFloatArray(material, key, type, index, &value, &n) != AI_SUCCESS || n != 1)
        return absent;
    return (float)value;
}

static bool has_property(const struct aiMaterial *material, const char *key)
{
    const struct aiMaterialProperty *property = NULL;
    for (unsigned i = 0; i < material->mNumProperties; i++) {
        property = material->mProperties[i];
        if (property && strcmp(property->mKey.data, key) == 0)
            return true;
    }
    return false;
}

static enum gn_texture_wrap get_wrap(enum aiTextureMapMode mode)
{
    return mode == aiTextureMapMode_Mirror  ? GN_WRAP_MIRROR
           : mode == aiTextureMapMode_Clamp ? GN_WRAP_CLAMP
                                            : GN_WRAP_REPEAT;
}

/** *found: the material names a picture there. */
static int read_slot(struct reader *r, const struct aiMaterial *material, enum aiTextureType type,
                     bool is_srgb, struct gn_texture_slot *slot, bool *found)
{
    struct aiString name = {0};
    enum aiTextureMapMode modes[2] = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
    unsigned uv_set = 0;
    *found = false;
    if (aiGetMaterialTextureCount(material, type) == 0 ||
        aiGetMaterialTexture(material, type, 0, &name, NULL, &uv_set, NULL, NULL, modes, NULL) !=
            AI_SUCCESS)
        return 0;
    name.data[sizeof(name.data) - 1] = '\0';
    *found = true;
    if (uv_set != 0) {
        r->is_ignored[IGNORED_UV_SET] = true;
        return 0;
    }
    slot->wrap_u = get_wrap(modes[0]);
    slot->wrap_v = get_wrap(modes[1]);
    return gn_mesh_pictures_get(&r->pictures, name.data, is_srgb, &slot->texture);
}

static void note_ignored(struct reader *r, const struct aiMaterial *material)
{
    struct aiString mode = {0};
    bool *is_ignored = r->is_ignored;
    if (aiGetMaterialString(material, AI_MATKEY_GLTF_ALPHAMODE, &mode) == AI_SUCCESS)
        is_ignored[IGNORED_BLEND] |= strcmp(mode.data, "BLEND") == 0;
    is_ignored[IGNORED_OCCLUSION] |=
        aiGetMaterialTextureCount(material, aiTextureType_LIGHTMAP) > 0;
    is_ignored[IGNORED_CLEARCOAT] |= get_float(material, AI_MATKEY_CLEARCOAT_FACTOR, 0) > 0;
    is_ignored[IGNORED_SHEEN] |= has_property(material, "$clr.sheen.factor");
    is_ignored[IGNORED_TRANSMISSION] |= get_float(material, AI_MATKEY_TRANSMISSION_FACTOR, 0) > 0;
    is_ignored[IGNORED_UNLIT] |= has_property(material, "$mat.gltf.unlit");
    is_ignored[IGNORED_VOLUME] |= has_property(material, "$mat.volume.thicknessFactor");
    is_ignored[IGNORED_TRANSFORM] |= has_property(material, "$tex.uvtrafo");
}

/** Base colour, and with it alpha; of older files their diffuse colour. */
static int read_base(struct reader *r, const struct aiMaterial *material,
                     struct gn_mesh_material *out)
{
    struct aiColor4D color = {1, 1, 1, 1};
    struct aiString mode = {0};
    bool found;
    if (aiGetMaterialColor(material, AI_MATKEY_BASE_COLOR, &color) != AI_SUCCESS)
        (void)aiGetMaterialColor(material, AI_MATKEY_COLOR_DIFFUSE, &color);
    const float rgb[3] = {color.r, color.g, color.b};
    memcpy(out->factors.albedo, rgb, sizeof(rgb));
    out->alpha = color.a;
    if (aiGetMaterialString(material, AI_MATKEY_GLTF_ALPHAMODE, &mode) == AI_SUCCESS &&
        strcmp(mode.data, "MASK") == 0)
        out->alpha_cutoff = get_float(material, AI_MATKEY_GLTF_ALPHACUTOFF, 0.5f);
    int ret = read_slot(r, material, aiTextureType_BASE_COLOR, true, &out->base_color, &found);
    return ret < 0 || found
               ? ret
               : read_slot(r, material, aiTextureType_DIFFUSE, true, &out->base_color, &found);
}

static int read_surface(struct reader *r, const struct aiMaterial *material,
                        struct gn_mesh_material *out)
{
    bool found;
    float glossiness = get_float(material, AI_MATKEY_GLOSSINESS_FACTOR, -1);
    if (glossiness >= 0) { // KHR_materials_pbrSpecularGlossiness
        r->is_ignored[IGNORED_SPECULAR] = true;
        out->factors.type = GN_MATERIAL_GGX;
        out->factors.roughness = 1 - glossiness;
        return 0;
    }
    if (!has_property(material, "$mat.metallicFactor") &&
        !has_property(material, "$mat.roughnessFactor"))
        return 0; // glTF 1: diffuse
    out->factors.type = GN_MATERIAL_GGX;
    out->factors.metallic = get_float(material, AI_MATKEY_METALLIC_FACTOR, 1);
    out->factors.roughness = get_float(material, AI_MATKEY_ROUGHNESS_FACTOR, 1);
    float ior = get_float(material, AI_MATKEY_REFRACTI, GN_MATERIAL_DEFAULT_IOR);
    if (ior >= 1 && ior <= GN_MATERIAL_MAX_IOR)
        out->factors.ior = ior;
    else
        r->is_ignored[IGNORED_IOR] = true;
    return read_slot(r, material, aiTextureType_UNKNOWN, false, &out->metallic_roughness, &found);
}

static int read_details(struct reader *r, const struct aiMaterial *material,
                        struct gn_mesh_material *out)
{
    struct aiColor4D color = {0};
    bool found;
    float strength = 1;
    if (aiGetMaterialColor(material, AI_MATKEY_COLOR_EMISSIVE, &color) == AI_SUCCESS) {
#ifdef AI_MATKEY_EMISSIVE_INTENSITY
        strength = get_float(material, AI_MATKEY_EMISSIVE_INTENSITY, 1);
#endif
        const float rgb[3] = {color.r * strength, color.g * strength, color.b * strength};
        memcpy(out->emission, rgb, sizeof(rgb));
    }
    int ret = read_slot(r, material, aiTextureType_EMISSIVE, true, &out->emissive, &found);
    if (ret < 0)
        return ret;
    out->normal_scale =
        get_float(material, AI_MATKEY_GLTF_TEXTURE_SCALE(aiTextureType_NORMALS, 0), 1);
    return read_slot(r, material, aiTextureType_NORMALS, false, &out->normal, &found);
}

/** Of the meshes, as far as their materials want it. */
static void note_meshes(struct reader *r)
{
    const struct aiScene *scene = r->scene;
    for (unsigned i = 0; scene->mMeshes && i < scene->mNumMeshes; i++) {
        const struct aiMesh *part = scene->mMeshes[i];
        if (!part)
            continue;
        r->is_ignored[IGNORED_SKIN] |= part->mNumBones > 0;
        r->is_ignored[IGNORED_MORPH] |= part->mNumAnimMeshes > 0;
        r->is_ignored[IGNORED_COLORS] |= part->mColors[0] != NULL;
        if (part->mMaterialIndex >= (unsigned)r->mesh->n_materials)
            continue;
        const struct gn_mesh_material *m = &r->mesh->materials[part->mMaterialIndex];
        bool has_picture = m->base_color.texture || m->metallic_roughness.texture ||
                           m->normal.texture || m->emissive.texture;
        r->is_ignored[IGNORED_NO_UV] |= has_picture && !part->mTextureCoords[0];
        r->is_ignored[IGNORED_NO_NORMALS] |= m->normal.texture && !part->mNormals;
    }
    r->is_ignored[IGNORED_ANIMATION] |= scene->mNumAnimations > 0;
    r->is_ignored[IGNORED_LIGHTS] |= scene->mNumLights > 0;
}

static int write_ignored(struct reader *r)
{
    char text[1024] = ""; // all names, and the lost one's
    size_t n = 0;
    for (int i = 0; i <= N_IGNORED; i++) {
        const char *item = i == N_IGNORED     ? r->pictures.lost
                           : r->is_ignored[i] ? ignored_names[i]
                                              : "";
        if (item[0])
            n += (size_t)snprintf(text + n, sizeof(text) - n, "%s%s", n > 0 ? ", " : "", item);
    }
    if (n == 0)
        return 0;
    r->mesh->ignored = strdup(text);
    return r->mesh->ignored ? 0 : -ENOMEM;
}

static int read_all(struct reader *r)
{
    struct gn_mesh *mesh = r->mesh;
    for (int i = 0; i < mesh->n_materials; i++) {
        const struct aiMaterial *in = r->scene->mMaterials[i];
        struct gn_mesh_material *out = &mesh->materials[i];
        struct gn_error reason = {0};
        *out = (struct gn_mesh_material){
            .factors = {.albedo = {1, 1, 1}, .roughness = 1}, .alpha = 1, .normal_scale = 1};
        int ret = in ? read_base(r, in, out) : 0;
        if (ret == 0 && in)
            ret = read_surface(r, in, out);
        if (ret == 0 && in)
            ret = read_details(r, in, out);
        if (ret < 0)
            return ret;
        if (in)
            note_ignored(r, in);
        if (gn_mesh_material_check(out, &reason) < 0)
            return gn_error_set(r->error, -EINVAL, "%s: material %d: %s", r->path, i, reason.text);
    }
    note_meshes(r);
    return write_ignored(r);
}

int gn_mesh_read_materials(const char *path, const struct aiScene *scene, struct gn_mesh *mesh,
                           struct gn_error *out_error)
{
    struct reader r = {
        .path = path,
        .scene = scene,
        .mesh = mesh,
        .error = out_error,
        .pictures = {.path = path, .scene = scene, .mesh = mesh, .error = out_error}};
    if (!scene->mMaterials || scene->mNumMaterials < 1 ||
        scene->mNumMaterials > GN_MESH_MAX_MATERIALS)
        return gn_error_set(out_error, -EFBIG, "%s: %u materials; 1 to %d are read", path,
                            scene->mNumMaterials, GN_MESH_MAX_MATERIALS);
    mesh->materials = calloc(scene->mNumMaterials, sizeof(*mesh->materials));
    int ret = mesh->materials ? gn_mesh_pictures_init(&r.pictures) : -ENOMEM;
    if (ret == 0) {
        mesh->n_materials = (int)scene->mNumMaterials;
        ret = read_all(&r);
    }
    gn_mesh_pictures_finish(&r.pictures);
    return ret == -ENOMEM ? gn_error_set(out_error, ret, "%s: no memory for its materials", path)
                          : ret;
}
