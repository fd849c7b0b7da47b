/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Materials and pictures of glTF files, good and hostile. */
#include "tests/unit/cmocka_setup.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/png.h"
#include "common/pose.h"
#include "common/response.h"
#include "server/scene/scene.h"
#include "tests/folder.h"
#include "tests/real_data.h"

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

/** The glTF files of Debian's package assimp-testmodels: where it puts them, or in the folder that
 * GNOMON_DATA names. */
#define PACKAGE_MODELS "/usr/share/assimp/models/glTF2"
#define DATA_MODELS "assimp/glTF2"

static const char *const files[] = {"q.gltf",    "q.bin",      "color.png",
                                    "rough.png", "normal.png", "bad.png"};

static int set_up(void **state)
{
    (void)state;
    return gn_test_folder_create();
}

static int tear_down(void **state)
{
    (void)state;
    return gn_test_folder_remove(files, LENGTH(files));
}

/** 2 x 1 texels. */
static void write_picture(const char *name, const uint8_t left[static 3],
                          const uint8_t right[static 3])
{
    struct gn_image8 image;
    uint8_t *data;
    size_t size;
    assert_int_equal(gn_image8_init(&image, 2, 1, 3), 0);
    memcpy(gn_image8_at(&image, 0, 0), left, 3);
    memcpy(gn_image8_at(&image, 1, 0), right, 3);
    assert_int_equal(gn_png_write_memory(&image, 1, &data, &size, NULL), 0);
    gn_test_folder_write(name, data, size);
    free(data);
    gn_image8_finish(&image);
}

/** The square [0, 1]^2 in z = 0, normal +z, u along x, the picture's top along +y; `members`: of
 * the root, materials among them. */
static int read_quad(const char *members, struct gn_mesh *out_mesh, struct gn_error *error)
{
    static const float positions[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    static const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const float uvs[8] = {0, 1, 1, 1, 1, 0, 0, 0}; // glTF's v runs down
    static const uint16_t triangles[6] = {0, 1, 2, 0, 2, 3};
    uint8_t bin[48 + 48 + 32 + 12];
    char text[4096];
    memcpy(bin, positions, 48);
    memcpy(bin + 48, normals, 48);
    memcpy(bin + 96, uvs, 32);
    memcpy(bin + 128, triangles, 12);
    gn_test_folder_write("q.bin", bin, sizeof(bin));
    int n = snprintf(
        text, sizeof(text),
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,"
        "\"NORMAL\":1,\"TEXCOORD_0\":2},\"indices\":3,\"material\":0}]}],"
        "\"buffers\":[{\"uri\":\"q.bin\",\"byteLength\":140}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},"
        "{\"buffer\":0,\"byteOffset\":48,\"byteLength\":48},"
        "{\"buffer\":0,\"byteOffset\":96,\"byteLength\":32},"
        "{\"buffer\":0,\"byteOffset\":128,\"byteLength\":12}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","
        "\"min\":[0,0,0],\"max\":[1,1,0]},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
        "{\"bufferView\":2,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"},"
        "{\"bufferView\":3,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}],%s}",
        members);
    assert_in_range(n, 1, sizeof(text) - 1);
    gn_test_folder_write_text("q.gltf", text);
    memset(error, 0, sizeof(*error));
    return gn_mesh_read_file(gn_test_folder_get_path("q.gltf"), out_mesh, error);
}

/** The surface at (x, y) of the square times scale_x, by a footprint of that many metres, seen from
 * +z or -z. */
static void look_at(struct gn_mesh *mesh, double scale_x, float footprint, float x, float y,
                    float from, struct gn_surface *out)
{
    struct gn_scene_object object = {.role = GN_RT_VIRTUAL, .mesh = *mesh};
    struct gn_scene *scene = NULL;
    struct gn_rt_hit hit;
    const float org[3] = {x, y, from}, dir[3] = {0, 0, from > 0 ? -1.0f : 1.0f};
    gn_mat4_identity(object.world_from_object);
    object.world_from_object[0] = scale_x;
    assert_int_equal(gn_scene_create(&object, 1, NULL, &scene, NULL), 0);
    assert_true(gn_rt_intersect(scene->rt, GN_RT_ALL, org, dir, 0, INFINITY, &hit));
    gn_scene_get_surface_filtered(scene, dir, &hit, footprint, out);
    *mesh = scene->objects[0].mesh; // back, for the next look
    memset(&scene->objects[0].mesh, 0, sizeof(*mesh));
    gn_scene_destroy(&scene);
}

static void look(struct gn_mesh *mesh, float x, float y, float from, struct gn_surface *out)
{
    look_at(mesh, 1, 0, x, y, from, out);
}

static float get_srgb(int code)
{
    const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    return gn_response_decode(&srgb, (float)code / 255);
}

static void test_factors_times_pictures(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    struct gn_surface s;
    const uint8_t left[3] = {188, 100, 10}, right[3] = {255, 255, 255};
    const uint8_t rough_left[3] = {7, 102, 204}, rough_right[3] = {9, 255, 51};
    write_picture("color.png", left, right);
    write_picture("rough.png", rough_left, rough_right);
    int ret = read_quad(
        "\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,1,1,1],"
        "\"baseColorTexture\":{\"index\":0},\"metallicFactor\":0.5,\"roughnessFactor\":0.9,"
        "\"metallicRoughnessTexture\":{\"index\":1}},\"emissiveFactor\":[0,2e-1,1],"
        "\"emissiveTexture\":{\"index\":0}}],"
        "\"textures\":[{\"source\":0,\"sampler\":0},{\"source\":1,\"sampler\":0}],"
        "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33648}],"
        "\"images\":[{\"uri\":\"color%2Epng\"},{\"uri\":\"rough.png\"}]",
        &mesh, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_null(mesh.ignored);
    assert_int_equal(mesh.n_textures, 2); // colour and emissive share one
    assert_int_equal(mesh.materials[0].base_color.wrap_u, GN_WRAP_CLAMP);
    assert_int_equal(mesh.materials[0].base_color.wrap_v, GN_WRAP_MIRROR);
    look(&mesh, 0.1f, 0.3f, 1, &s);
    assert_int_equal(s.material, GN_MATERIAL_GGX);
    assert_float_equal(s.albedo[0], 0.5f * get_srgb(188), 1e-5);
    assert_float_equal(s.albedo[1], get_srgb(100), 1e-5);
    assert_float_equal(s.roughness, 0.9f * 0.4f, 1e-5); // G, linear
    assert_float_equal(s.metallic, 0.5f * 0.8f, 1e-5);  // B
    assert_float_equal(s.emission[0], 0, 0);
    assert_float_equal(s.emission[1], 0.2f * get_srgb(100), 1e-5);
    assert_float_equal(s.emission[2], get_srgb(10), 1e-5);
    look(&mesh, 0.9f, 0.3f, 1, &s);
    assert_float_equal(s.albedo[0], 0.5f, 1e-5);
    assert_float_equal(s.roughness, 0.9f, 1e-5);
    assert_float_equal(s.metallic, 0.1f, 1e-5);
    gn_mesh_finish(&mesh);
}

static void test_normal_maps_lean_as_painted(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    struct gn_surface s;
    // 0.6 to the right, and 0.6 up on the picture.
    const uint8_t right[3] = {204, 128, 230}, up[3] = {128, 204, 230};
    write_picture("normal.png", right, up);
    int ret = read_quad("\"materials\":[{\"normalTexture\":{\"index\":0}}],"
                        "\"textures\":[{\"source\":0,\"sampler\":0}],"
                        "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33071}],"
                        "\"images\":[{\"uri\":\"normal.png\"}]",
                        &mesh, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_non_null(mesh.tangents);
    look(&mesh, 0.1f, 0.5f, 1, &s);
    assert_float_equal(s.normal_shading[0], 0.6f, 0.01);
    assert_float_equal(s.normal_shading[1], 0, 0.01);
    assert_float_equal(s.normal_horizon[2], 1, 1e-6);
    look(&mesh, 0.9f, 0.5f, 1, &s);
    assert_float_equal(s.normal_shading[0], 0, 0.01);
    assert_float_equal(s.normal_shading[1], 0.6f, 0.01);
    assert_float_equal(s.normal_shading[2], 0.8f, 0.01);
    look(&mesh, 0.9f, 0.5f, -1, &s); // the same surface from behind
    assert_float_equal(s.normal_shading[1], -0.6f, 0.01);
    assert_float_equal(s.normal_shading[2], -0.8f, 0.01);
    look(&mesh, 0.1f, 0.5f, -1, &s);
    assert_float_equal(s.normal_shading[0], -0.6f, 0.01);
    look_at(&mesh, -1, 0, -0.1f, 0.5f, 1, &s); // mirrored: only right and left change
    assert_float_equal(s.normal_shading[0], -0.6f, 0.01);
    look_at(&mesh, -1, 0, -0.9f, 0.5f, 1, &s);
    assert_float_equal(s.normal_shading[1], 0.6f, 0.01);
    assert_float_equal(s.normal_shading[2], 0.8f, 0.01);
    gn_mesh_finish(&mesh);
}

/** Replaces bytes of the square's file. */
static void patch(long at, const void *bytes, size_t n)
{
    FILE *bin = fopen(gn_test_folder_get_path("q.bin"), "r+b");
    assert_non_null(bin);
    assert_int_equal(fseek(bin, at, SEEK_SET), 0);
    assert_int_equal(fwrite(bytes, 1, n, bin), n);
    assert_int_equal(fclose(bin), 0);
}

/** A picture laid on the wrong way round: its right is left, its up stays up. */
static void test_normal_maps_on_a_mirrored_picture(void **state)
{
    (void)state;
    static const float uvs[8] = {1, 1, 0, 1, 0, 0, 1, 0};
    struct gn_mesh mesh = {0};
    struct gn_error error;
    struct gn_surface s;
    const uint8_t right[3] = {204, 128, 230}, up[3] = {128, 204, 230};
    write_picture("normal.png", right, up);
    assert_int_equal(read_quad("\"materials\":[{\"normalTexture\":{\"index\":0}}],"
                               "\"textures\":[{\"source\":0,\"sampler\":0}],"
                               "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33071}],"
                               "\"images\":[{\"uri\":\"normal.png\"}]",
                               &mesh, &error),
                     0);
    gn_mesh_finish(&mesh);
    patch(96, uvs, sizeof(uvs));
    assert_int_equal(gn_mesh_read_file(gn_test_folder_get_path("q.gltf"), &mesh, &error), 0);
    look(&mesh, 0.9f, 0.5f, 1, &s);
    assert_float_equal(s.normal_shading[0], -0.6f, 0.01);
    look(&mesh, 0.1f, 0.5f, 1, &s);
    assert_float_equal(s.normal_shading[1], 0.6f, 0.01);
    gn_mesh_finish(&mesh);
}

/** What is as large as the picture sees its mean, what is between texel and picture a mixture. */
static void test_footprints_choose_the_level(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    struct gn_surface s;
    const uint8_t black[3] = {0, 0, 0}, white[3] = {255, 255, 255};
    write_picture("color.png", black, white);
    assert_int_equal(read_quad("\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{"
                               "\"index\":0}}}],\"textures\":[{\"source\":0,\"sampler\":0}],"
                               "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33071}],"
                               "\"images\":[{\"uri\":\"color.png\"}]",
                               &mesh, &error),
                     0);
    // 2 x 1 texels on 1 m^2 (4 m^2 below): a side of 1 m is that of sqrt(2) texels, level 1/2.
    static const struct {
        double scale_x;
        float footprint, albedo;
    } known[] = {{1, 0, 0},    {1, 0.5f, 0},    {1, 1, 0.25f},
                 {1, 2, 0.5f}, {1, 1e9f, 0.5f}, {4, 2, 0.25f}};
    for (size_t i = 0; i < LENGTH(known); i++) {
        look_at(&mesh, known[i].scale_x, known[i].footprint, 0.1f * (float)known[i].scale_x, 0.5f,
                1, &s);
        assert_float_equal(s.albedo[0], known[i].albedo, 0.003); // codes of 8 bits
    }
    gn_mesh_finish(&mesh);
}

/** A picture with alpha: the left texel is there, the right one is not. */
static void write_mask(void)
{
    struct gn_image8 image;
    uint8_t *data;
    size_t size;
    assert_int_equal(gn_image8_init(&image, 2, 1, 4), 0);
    memset(image.data, 255, 8);
    gn_image8_at(&image, 1, 0)[3] = 100;
    assert_int_equal(gn_png_write_memory(&image, 1, &data, &size, NULL), 0);
    gn_test_folder_write("color.png", data, size);
    free(data);
    gn_image8_finish(&image);
}

static void test_rays_pass_where_alpha_is_low(void **state)
{
    (void)state;
    struct gn_scene_object object = {.role = GN_RT_VIRTUAL};
    struct gn_scene *scene = NULL;
    struct gn_error error;
    struct gn_rt_packet packet;
    write_mask();
    int ret = read_quad("\"materials\":[{\"alphaMode\":\"MASK\",\"alphaCutoff\":0.6,"
                        "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],"
                        "\"textures\":[{\"source\":0,\"sampler\":0}],"
                        "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33071}],"
                        "\"images\":[{\"uri\":\"color.png\"}]",
                        &object.mesh, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_null(object.mesh.ignored);
    assert_true(gn_mesh_has_cutouts(&object.mesh));
    gn_mat4_identity(object.world_from_object);
    assert_int_equal(gn_scene_create(&object, 1, NULL, &scene, NULL), 0);
    memset(&packet, 0, sizeof(packet));
    const float dir[3] = {0, 0, -1};
    for (int i = 0; i < GN_RT_PACKET; i++) {
        // Alpha falls from 1 at u = 0.25 to 0.39 at 0.75: it is 0.6 at 0.579.
        const float org[3] = {0.03f + 0.0625f * (float)i, 0.4f, 1};
        struct gn_rt_hit hit;
        bool is_there = org[0] < 0.579f;
        assert_int_equal(gn_rt_is_occluded(scene->rt, GN_RT_ALL, org, dir, 0, INFINITY), is_there);
        assert_int_equal(gn_rt_intersect(scene->rt, GN_RT_VIRTUAL, org, dir, 0, INFINITY, &hit),
                         is_there);
        packet.org_x[i] = org[0];
        packet.org_y[i] = org[1];
        packet.org_z[i] = org[2];
        packet.dir_z[i] = -1;
        packet.t_far[i] = INFINITY;
        packet.valid[i] = -1;
    }
    assert_int_equal(gn_rt_get_occluded16(scene->rt, GN_RT_ALL, &packet), 0x1ff);
    // A material of the object's own changes what the surface is made of, not where it is.
    object = scene->objects[0];
    object.has_material = true;
    memset(&scene->objects[0], 0, sizeof(scene->objects[0]));
    gn_scene_destroy(&scene);
    assert_int_equal(gn_scene_create(&object, 1, NULL, &scene, NULL), 0);
    assert_int_equal(gn_rt_get_occluded16(scene->rt, GN_RT_ALL, &packet), 0x1ff);
    gn_scene_destroy(&scene);
}

static void test_numbers_beside_the_pictures(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    int ret = read_quad("\"extensionsUsed\":[\"KHR_materials_ior\"],\"materials\":[{"
                        "\"pbrMetallicRoughness\":{\"metallicFactor\":0},\"alphaMode\":\"MASK\","
                        "\"alphaCutoff\":1.5,\"extensions\":{\"KHR_materials_ior\":{\"ior\":"
                        "1.75}}}]",
                        &mesh, &error);
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_null(mesh.ignored);
    assert_float_equal(mesh.materials[0].factors.ior, 1.75f, 0);
    assert_true(gn_mesh_is_cut_out(&mesh, 0, 0.2f, 0.2f)); // as glTF has it above 1
    gn_mesh_finish(&mesh);
}

/** A picture's bytes that may not be read; even root asks, as somebody else. */
static void test_a_picture_without_permission(void **state)
{
    (void)state;
    struct gn_mesh mesh = {0};
    struct gn_error error;
    const uint8_t grey[3] = {128, 128, 128};
    const char *members = "\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{"
                          "\"source\":0}],\"images\":[{\"uri\":\"color.png\"}]";
    write_picture("color.png", grey, grey);
    assert_int_equal(chmod(gn_test_folder_get_path("color.png"), 0), 0);
    assert_int_equal(chmod(gn_test_folder_get_path("."), 0777), 0);
    assert_int_equal(read_quad(members, &mesh, &error), 0);
    gn_mesh_finish(&mesh);
    bool is_root = geteuid() == 0;
    assert_int_equal(is_root ? seteuid(65534) : 0, 0);
    const char *path = gn_test_folder_get_path("q.gltf");
    bool is_seen = faccessat(AT_FDCWD, path, R_OK, AT_EACCESS) == 0;
    int ret = gn_mesh_read_file(path, &mesh, &error);
    assert_int_equal(is_root ? seteuid(0) : 0, 0);
    if (!is_seen) { // not even the folder; skip() would print "not ok"
        print_message("# the folder of the tests is closed to other users: not tried\n");
        return;
    }
    assert_string_equal(error.text, "");
    assert_int_equal(ret, 0);
    assert_non_null(strstr(mesh.ignored, "color.png"));
    gn_mesh_finish(&mesh);
    assert_int_equal(chmod(gn_test_folder_get_path("color.png"), 0600), 0);
}

static void test_what_is_not_done_is_named(void **state)
{
    (void)state;
    static const struct {
        const char *members, *says;
    } cases[] = {
        {"\"materials\":[{\"alphaMode\":\"BLEND\"}]", "alpha blending"},
        {"\"materials\":[{\"occlusionTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"color.png\"}]",
         "occlusion maps"},
        {"\"extensionsUsed\":[\"KHR_materials_clearcoat\"],\"materials\":[{\"extensions\":{"
         "\"KHR_materials_clearcoat\":{\"clearcoatFactor\":1}}}]",
         "clearcoat"},
        {"\"extensionsUsed\":[\"KHR_materials_unlit\"],\"materials\":[{\"extensions\":{"
         "\"KHR_materials_unlit\":{}}}]",
         "unlit"},
        {"\"extensionsUsed\":[\"KHR_materials_volume\"],\"materials\":[{\"extensions\":{"
         "\"KHR_materials_volume\":{\"thicknessFactor\":1}}}]",
         "volumes"},
        {"\"extensionsUsed\":[\"KHR_materials_ior\"],\"materials\":[{\"extensions\":{"
         "\"KHR_materials_ior\":{\"ior\":40}}}]",
         "index of refraction"},
        {"\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,"
         "\"texCoord\":1}}}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"color.png\"}]",
         "second texture coordinates"},
        {"\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"nothere.png\"}]",
         "picture nothere.png (there is no such file)"},
        {"\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"bad.png\"}]",
         "picture bad.png"},
    };
    const uint8_t grey[3] = {128, 128, 128};
    write_picture("color.png", grey, grey);
    gn_test_folder_write("bad.png", "\x89PNG\r\n\x1a\nno picture", 18);
    for (size_t i = 0; i < LENGTH(cases); i++) {
        struct gn_mesh mesh = {0};
        struct gn_error error;
        assert_int_equal(read_quad(cases[i].members, &mesh, &error), 0);
        assert_non_null(mesh.ignored);
        if (!strstr(mesh.ignored, cases[i].says))
            fail_msg("'%s' does not say '%s'", mesh.ignored, cases[i].says);
        gn_mesh_finish(&mesh);
    }
}

static void test_hostile_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *members, *says;
    } cases[] = {
        {"\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"../../../../../../../../etc/passwd\"}]",
         "outside the file's folder"},
        {"\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"/etc/passwd\"}]",
         "outside the file's folder"},
        {"\"materials\":[{\"normalTexture\":{\"index\":0}}],\"textures\":[{\"source\":0}],"
         "\"images\":[{\"uri\":\"%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd\"}]",
         "outside the file's folder"},
        {"\"materials\":[{\"pbrMetallicRoughness\":{\"roughnessFactor\":-1}}]", "roughness"},
        {"\"materials\":[{\"pbrMetallicRoughness\":{\"metallicFactor\":3}}]", "metallic"},
        {"\"materials\":[{\"emissiveFactor\":[-1,0,0]}]", "emission"},
    };
    for (size_t i = 0; i < LENGTH(cases); i++) {
        struct gn_mesh mesh = {0};
        struct gn_error error;
        assert_int_equal(read_quad(cases[i].members, &mesh, &error), -EINVAL);
        assert_null(mesh.positions);
        if (!strstr(error.text, cases[i].says) || !strstr(error.text, "q.gltf"))
            fail_msg("'%s' does not say '%s'", error.text, cases[i].says);
    }
}

static void test_texture_coordinates_are_finite(void **state)
{
    (void)state;
    static const float bad[] = {NAN, INFINITY, -3e38f};
    const uint8_t color[3] = {255, 255, 255};
    write_picture("color.png", color, color);
    for (size_t i = 0; i < LENGTH(bad); i++) {
        struct gn_mesh mesh = {0};
        struct gn_error error;
        assert_int_equal(
            read_quad("\"materials\":[{\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":"
                      "0}}}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"color.png\"}]",
                      &mesh, &error),
            0);
        gn_mesh_finish(&mesh);
        patch(96, &bad[i], sizeof(bad[i]));
        assert_int_equal(gn_mesh_read_file(gn_test_folder_get_path("q.gltf"), &mesh, &error),
                         -EINVAL);
        assert_null(mesh.positions);
        assert_non_null(strstr(error.text, "texture coordinates"));
    }
}

/** Reads all glTF files under the folder; counts those that are read. */
static void read_folder(const char *folder, int *n_read, int *n_refused)
{
    DIR *dir = opendir(folder);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir));) {
        char path[PATH_MAX];
        struct stat info;
        const char *dot = strrchr(entry->d_name, '.');
        (void)snprintf(path, sizeof(path), "%.2048s/%s", folder, entry->d_name);
        if (entry->d_name[0] == '.' || stat(path, &info) != 0)
            continue;
        if (S_ISDIR(info.st_mode))
            read_folder(path, n_read, n_refused);
        if (!dot || (strcmp(dot, ".gltf") != 0 && strcmp(dot, ".glb") != 0))
            continue;
        struct gn_mesh mesh = {0};
        struct gn_error error = {0};
        int ret = gn_mesh_read_file(path, &mesh, &error);
        print_message("# %s: %s\n", path,
                      ret < 0        ? error.text + strlen(path)
                      : mesh.ignored ? mesh.ignored
                                     : "read");
        *n_read += ret == 0;
        *n_refused += ret < 0;
        assert_true(ret == 0 || (error.text[0] && !mesh.positions));
        gn_mesh_finish(&mesh);
    }
    closedir(dir);
}

static void test_debian_models(void **state)
{
    (void)state;
    char path[PATH_MAX];
    int n_read = 0, n_refused = 0;
    read_folder(real_data_has(DATA_MODELS) ? real_data_path(DATA_MODELS, path) : PACKAGE_MODELS,
                &n_read, &n_refused);
    // 46 files; the rest have lines and points only, or are broken on purpose.
    assert_true(n_read >= 24);
    assert_true(n_read + n_refused >= 46);
}

static void skip_models(void **state)
{
    (void)state;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_factors_times_pictures),
        cmocka_unit_test(test_normal_maps_lean_as_painted),
        cmocka_unit_test(test_normal_maps_on_a_mirrored_picture),
        cmocka_unit_test(test_footprints_choose_the_level),
        cmocka_unit_test(test_rays_pass_where_alpha_is_low),
        cmocka_unit_test(test_numbers_beside_the_pictures),
        cmocka_unit_test(test_a_picture_without_permission),
        cmocka_unit_test(test_what_is_not_done_is_named),
        cmocka_unit_test(test_hostile_files_are_refused),
        cmocka_unit_test(test_texture_coordinates_are_finite),
        real_data_has(DATA_MODELS) || access(PACKAGE_MODELS, R_OK) == 0
            ? (struct CMUnitTest)cmocka_unit_test(test_debian_models)
            : (struct CMUnitTest){"test_debian_models # SKIP no package assimp-testmodels",
                                  skip_models, NULL, NULL, NULL},
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
