/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/scene/mesh_pictures.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/scene.h>

#include "common/file.h"
#include "common/image.h"

/** Largest file of a picture, bytes. */
#define MAX_PICTURE_BYTES (1L << 28)

/** A picture that is already there, or cannot be. */
struct gn_known_picture {
    char name[sizeof(((struct aiString *)0)->data)];
    bool is_srgb;
    int texture; // < 0: it cannot be read
};

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

/** The file's real path; refused, and said, where that is not in the mesh's folder or below.
 * -ENOENT: there is none. */
static int find_picture(struct gn_mesh_pictures *p, const char *name, char out[static PATH_MAX])
{
    char folder[PATH_MAX];
    char joined[PATH_MAX];
    const char *slash = strrchr(p->path, '/');
    int n_folder = slash ? (int)(slash - p->path) + 1 : 0;
    int n = name[0] == '/' ? snprintf(joined, sizeof(joined), "%s", name)
                           : snprintf(joined, sizeof(joined), "%.*s%s", n_folder, p->path, name);
    if (n < 0 || n >= PATH_MAX)
        return -ENAMETOOLONG;
    n = snprintf(folder, sizeof(folder), "%.*s.", n_folder, p->path);
    char real_folder[PATH_MAX];
    if (n < 0 || n >= PATH_MAX || !realpath(folder, real_folder) || !realpath(joined, out))
        return -ENOENT;
    size_t length = strlen(real_folder);
    p->is_refused = strncmp(out, real_folder, length) != 0 || (length > 1 && out[length] != '/');
    if (p->is_refused)
        return gn_error_set(p->error, -EINVAL,
                            "%s: its picture '%s' lies outside the file's folder", p->path, name);
    return 0;
}

/** Pixels that Assimp has unpacked: B, G, R, A. */
static int take_pixels(struct gn_mesh_pictures *p, const struct aiTexture *in, bool is_srgb,
                       struct gn_texture *texture, struct gn_error *why)
{
    size_t n = (size_t)in->mWidth * in->mHeight;
    if (n < 1 || in->mWidth > GN_IMAGE_MAX_SIDE || in->mHeight > GN_IMAGE_MAX_SIDE ||
        n > (size_t)p->texels_left)
        return gn_error_set(why, -EINVAL, "empty or too large");
    uint8_t *rgba = malloc(4 * n);
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

static int read_picture(struct gn_mesh_pictures *p, const char *name, bool is_srgb,
                        struct gn_texture *texture, struct gn_error *why)
{
    const struct aiTexture *embedded = NULL;
    if (name[0] == '*') {
        long index = strtol(name + 1, NULL, 10);
        if (index >= 0 && index < (long)p->scene->mNumTextures && p->scene->mTextures)
            embedded = p->scene->mTextures[index];
        if (!embedded || !embedded->pcData)
            return gn_error_set(why, -EINVAL, "the file has no such picture");
    }
    if (embedded && embedded->mHeight > 0)
        return take_pixels(p, embedded, is_srgb, texture, why);
    if (embedded)
        return gn_texture_read_memory(embedded->pcData, embedded->mWidth, is_srgb, p->texels_left,
                                      texture, why);
    char decoded[sizeof(p->known->name)];
    char path[PATH_MAX];
    (void)snprintf(decoded, sizeof(decoded), "%s", name);
    decode_percents(decoded);
    int ret = find_picture(p, decoded, path);
    if (ret < 0)
        return p->is_refused ? ret : gn_error_set(why, ret, "there is no such file");
    uint8_t *data = NULL;
    size_t size = 0;
    ret = gn_file_read(path, MAX_PICTURE_BYTES, &data, &size, why);
    if (ret == 0)
        ret = gn_texture_read_memory(data, size, is_srgb, p->texels_left, texture, why);
    free(data);
    return ret;
}

int gn_mesh_pictures_get(struct gn_mesh_pictures *p, const char *name, bool is_srgb,
                         const struct gn_texture **out)
{
    struct gn_error why = {0};
    struct gn_mesh *mesh = p->mesh;
    *out = NULL;
    for (int i = 0; i < p->n_known; i++) {
        if (p->known[i].is_srgb == is_srgb && strcmp(p->known[i].name, name) == 0) {
            *out = p->known[i].texture >= 0 ? &mesh->textures[p->known[i].texture] : NULL;
            return 0;
        }
    }
    if (p->n_known == GN_MESH_MAX_TEXTURES)
        return gn_error_set(p->error, -EFBIG, "%s: more than %d pictures", p->path,
                            GN_MESH_MAX_TEXTURES);
    struct gn_known_picture *known = &p->known[p->n_known++];
    known->texture = -1;
    known->is_srgb = is_srgb;
    (void)snprintf(known->name, sizeof(known->name), "%s", name);
    struct gn_texture *texture = &mesh->textures[mesh->n_textures];
    int ret = read_picture(p, name, is_srgb, texture, &why);
    if (p->is_refused)
        return ret;
    if (ret == -ENOMEM)
        return gn_error_set(p->error, ret, "%s: no memory for its pictures", p->path);
    if (ret < 0 && !p->lost[0])
        (void)snprintf(p->lost, sizeof(p->lost), "picture %.64s (%.100s)", name, why.text);
    if (ret < 0)
        return 0;
    known->texture = mesh->n_textures++;
    p->texels_left -= (long)texture->width * texture->height;
    *out = texture;
    return 0;
}

int gn_mesh_pictures_init(struct gn_mesh_pictures *pictures)
{
    pictures->mesh->textures = calloc(GN_MESH_MAX_TEXTURES, sizeof(*pictures->mesh->textures));
    pictures->known = calloc(GN_MESH_MAX_TEXTURES, sizeof(*pictures->known));
    pictures->texels_left = GN_MESH_MAX_TEXELS;
    return pictures->mesh->textures && pictures->known ? 0 : -ENOMEM;
}

void gn_mesh_pictures_finish(struct gn_mesh_pictures *pictures)
{
    free(pictures->known);
    pictures->known = NULL;
}
