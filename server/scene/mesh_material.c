/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Materials of glTF files as Assimp gives them. Numbers and strings are the file's: not trusted.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/scene.h>

#include "common/file.h"
#include "common/image.h"
#include "server/scene/mesh_import.h"

/** Largest file of a picture, bytes. */
#define MAX_PICTURE_BYTES (1L << 28)
/** Longest list of what is ignored. */
#define MAX_IGNORED 400

/** What files ask for that is not done. */
enum ignored {
    IGNORED_BLEND,
    IGNORED_OCCLUSION,
    IGNORED_CLEARCOAT,
    IGNORED_SHEEN,
    IGNORED_TRANSMISSION,
    IGNORED_SPECULAR,
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

/** A picture that is already there, or cannot be. */
struct known {
    char name[sizeof(((struct aiString *)0)->data)];
    bool is_srgb;
    int texture; // < 0: it cannot be read
};

struct reader {
    const char *path;
    const struct aiScene *scene;
    struct gn_mesh *mesh;
    struct gn_error *error;
    bool is_ignored[N_IGNORED];
    char lost[MAX_IGNORED / 2]; // the first picture that cannot be read, and why
    struct known *known;        // [GN_MESH_MAX_TEXTURES], owned
    int n_known;
    long texels_left;
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

static int to_hex(char c)
{
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/** A URI's %XX as the bytes they stand for, in place. */
static void decode_percents(char *text)
{
    char *out = text;
    for (const char *in = text; *in; in++) {
        int high = *in == '%' ? to_hex(in[1]) : -1;
        int low = high >= 0 ? to_hex(in[2]) : -1;
        *out++ = low > 0 || (low == 0 && high > 0) ? (char)(high * 16 + low) : *in;
        in += low > 0 || (low == 0 && high > 0) ? 2 : 0;
    }
    *out = '\0';
}

/** The file's real path; refused where that is not in the mesh's folder or below. -ENOENT: there is
 * none. */
static int find_picture(const struct reader *r, const char *name, char out[static PATH_MAX])
{
    char folder[PATH_MAX];
    char joined[PATH_MAX];
    const char *slash = strrchr(r->path, '/');
    int n_folder = slash ? (int)(slash - r->path) + 1 : 0;
    int n = name[0] == '/' ? snprintf(joined, sizeof(joined), "%s", name)
                           : snprintf(joined, sizeof(joined), "%.*s%s", n_folder, r->path, name);
    if (n < 0 || n >= PATH_MAX)
        return -ENAMETOOLONG;
    n = snprintf(folder, sizeof(folder), "%.*s.", n_folder, r->path);
    char real_folder[PATH_MAX];
    if (n < 0 || n >= PATH_MAX || !realpath(folder, real_folder) || !realpath(joined, out))
        return -ENOENT;
    size_t length = strlen(real_folder);
    if (strncmp(out, real_folder, length) != 0 || (length > 1 && out[length] != '/'))
        return gn_error_set(r->error, -EINVAL,
                            "%s: its picture '%s' lies outside the file's folder", r->path, name);
    return 0;
}

/** Pixels that Assimp has unpacked: B, G, R, A. */
static int take_pixels(struct reader *r, const struct aiTexture *in, bool is_srgb,
                       struct gn_texture *texture, struct gn_error *why)
{
    size_t n = (size_t)in->mWidth * in->mHeight;
    if (in->mWidth > GN_IMAGE_MAX_SIDE || in->mHeight > GN_IMAGE_MAX_SIDE ||
        n > (size_t)r->texels_left)
        return gn_error_set(why, -EINVAL, "too large");
    uint8_t *rgba = malloc(4 * n + 1);
    if (!rgba)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++) {
        const struct aiTexel *texel = &in->pcData[i];
        const uint8_t out[4] = {texel->r, texel->g, texel->b, texel->a};
        memcpy(rgba + 4 * i, out, sizeof(out));
    }
    int ret = gn_texture_init(texture, rgba, (int)in->mWidth, (int)in->mHeight, is_srgb);
    free(rgba);
    return ret;
}

static int read_picture(struct reader *r, const char *name, bool is_srgb,
                        struct gn_texture *texture, struct gn_error *why)
{
    const struct aiTexture *embedded = NULL;
    if (name[0] == '*') {
        long index = strtol(name + 1, NULL, 10);
        if (index >= 0 && index < (long)r->scene->mNumTextures && r->scene->mTextures)
            embedded = r->scene->mTextures[index];
        if (!embedded || !embedded->pcData)
            return gn_error_set(why, -EINVAL, "the file has no such picture");
    }
    if (embedded && embedded->mHeight > 0)
        return take_pixels(r, embedded, is_srgb, texture, why);
    if (embedded)
        return gn_texture_read_memory(embedded->pcData, embedded->mWidth, is_srgb, r->texels_left,
                                      texture, why);
    char decoded[sizeof(r->known->name)];
    char path[PATH_MAX];
    (void)snprintf(decoded, sizeof(decoded), "%s", name);
    decode_percents(decoded);
    int ret = find_picture(r, decoded, path);
    if (ret == -EINVAL)
        return -EACCES; // said already
    if (ret < 0)
        return gn_error_set(why, ret, "there is no such file");
    uint8_t *data = NULL;
    size_t size = 0;
    ret = gn_file_read(path, MAX_PICTURE_BYTES, &data, &size, why);
    if (ret == 0)
        ret = gn_texture_read_memory(data, size, is_srgb, r->texels_left, texture, why);
    free(data);
    return ret;
}

/** The texture of that name, read where it is new. *out NULL: it cannot be read. */
static int get_texture(struct reader *r, const char *name, bool is_srgb,
                       const struct gn_texture **out)
{
    struct gn_error why = {0};
    struct gn_mesh *mesh = r->mesh;
    *out = NULL;
    for (int i = 0; i < r->n_known; i++) {
        if (r->known[i].is_srgb == is_srgb && strcmp(r->known[i].name, name) == 0) {
            *out = r->known[i].texture >= 0 ? &mesh->textures[r->known[i].texture] : NULL;
            return 0;
        }
    }
    if (r->n_known == GN_MESH_MAX_TEXTURES)
        return gn_error_set(r->error, -EFBIG, "%s: more than %d pictures", r->path,
                            GN_MESH_MAX_TEXTURES);
    struct known *known = &r->known[r->n_known++];
    known->texture = -1;
    known->is_srgb = is_srgb;
    (void)snprintf(known->name, sizeof(known->name), "%s", name);
    struct gn_texture *texture = &mesh->textures[mesh->n_textures];
    int ret = read_picture(r, name, is_srgb, texture, &why);
    if (ret == -EACCES)
        return -EINVAL;
    if (ret == -ENOMEM)
        return gn_error_set(r->error, ret, "%s: no memory for its pictures", r->path);
    if (ret < 0 && !r->lost[0])
        (void)snprintf(r->lost, sizeof(r->lost), "picture %.64s (%.100s)", name, why.text);
    if (ret < 0)
        return 0;
    known->texture = mesh->n_textures++;
    r->texels_left -= (long)texture->width * texture->height;
    *out = texture;
    return 0;
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
    return get_texture(r, name.data, is_srgb, &slot->texture);
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
    char text[MAX_IGNORED * 2] = "";
    size_t n = 0;
    for (int i = 0; i <= N_IGNORED; i++) {
        const char *item = i == N_IGNORED ? r->lost : r->is_ignored[i] ? ignored_names[i] : "";
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
    struct reader r = {.path = path,
                       .scene = scene,
                       .mesh = mesh,
                       .error = out_error,
                       .texels_left = GN_MESH_MAX_TEXELS};
    if (!scene->mMaterials || scene->mNumMaterials < 1 ||
        scene->mNumMaterials > GN_MESH_MAX_MATERIALS)
        return gn_error_set(out_error, -EFBIG, "%s: %u materials; 1 to %d are read", path,
                            scene->mNumMaterials, GN_MESH_MAX_MATERIALS);
    mesh->materials = calloc(scene->mNumMaterials, sizeof(*mesh->materials));
    mesh->textures = calloc(GN_MESH_MAX_TEXTURES, sizeof(*mesh->textures));
    r.known = calloc(GN_MESH_MAX_TEXTURES, sizeof(*r.known));
    int ret = -ENOMEM;
    if (mesh->materials && mesh->textures && r.known) {
        mesh->n_materials = (int)scene->mNumMaterials;
        ret = read_all(&r);
    }
    free(r.known);
    return ret == -ENOMEM ? gn_error_set(out_error, ret, "%s: no memory for its materials", path)
                          : ret;
}
