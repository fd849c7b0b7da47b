/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/error_time/scenes.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "tests/meshes.h"
#include "tests/rig/teapot.h"

const char *const gn_bench_scene_names[GN_BENCH_SCENES] = {"ball", "teapot"};

/** Part of every key: a change of what a picture means makes the kept ones useless. */
#define CACHE_VERSION 1

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const float warm[3] = {0.6f, 0.45f, 0.3f};
static const float white[3] = {0.8f, 0.8f, 0.8f};

static void add_ball(struct gn_test_stage *stage, enum gn_rt_set role)
{
    gn_test_stage_add(stage, role, gn_test_make_plane(20, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    if (role == GN_RT_REAL)
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.1f, 16), 0, 0, 0.13,
                          GN_MATERIAL_DIFFUSE, white);
}

static void add_teapot(struct gn_test_stage *stage, enum gn_rt_set role)
{
    gn_test_stage_add(stage, role, gn_test_make_plane(20, 2), 0, 0, 0, GN_MATERIAL_DIFFUSE, warm);
    gn_test_stage_add(stage, role, gn_test_make_box(0.5f, 0.02f, 0.3f), 0.02, 0.2, 0.15,
                      GN_MATERIAL_DIFFUSE, white);
    gn_test_stage_add(stage, role, gn_test_make_box(0.07f, 0.07f, 0.12f), -0.18, 0.03, 0.06,
                      GN_MATERIAL_DIFFUSE, grey);
    if (role != GN_RT_REAL)
        return;
    struct gn_mesh mesh;
    const float scale = 0.035f; // m for each of the teapot's units
    if (gn_rig_teapot_create(&gn_rig_teapot_coarse, &mesh) < 0)
        return; // the stage's commit says that nothing is there
    for (int i = 0; i < 3 * mesh.n_vertices; i++)
        mesh.positions[i] *= scale;
    gn_test_stage_add(stage, GN_RT_VIRTUAL, mesh, 0, 0, 0.001, GN_MATERIAL_DIFFUSE, white);
}

void gn_bench_scene_init(struct gn_bench_scene *scene, int index, int width, int height)
{
    static const double eyes[GN_BENCH_SCENES][3] = {{0.12, -0.75, 0.5}, {0.1, -0.72, 0.42}};
    static const double targets[GN_BENCH_SCENES][3] = {{0, 0.03, 0.02}, {0, 0.05, 0.05}};
    *scene = (struct gn_bench_scene){.name = gn_bench_scene_names[index]};
    (index == 0 ? add_ball : add_teapot)(&scene->stage, GN_RT_REAL);
    (index == 0 ? add_ball : add_teapot)(&scene->backdrop, GN_RT_VIRTUAL);
    gn_test_stage_commit(&scene->stage, 0);
    gn_test_stage_commit(&scene->backdrop, 0);
    gn_test_stage_aim(&scene->stage, width, height, 1.05 * width, eyes[index], targets[index]);
    gn_test_stage_aim(&scene->backdrop, width, height, 1.05 * width, eyes[index], targets[index]);
}

void gn_bench_scene_finish(struct gn_bench_scene *scene)
{
    gn_test_stage_finish(&scene->stage);
    gn_test_stage_finish(&scene->backdrop);
}

/** FNV-1a. */
static void hash(uint64_t *key, const void *data, size_t n_bytes)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < n_bytes; i++)
        *key = (*key ^ bytes[i]) * UINT64_C(0x100000001b3);
}

static uint64_t make_key(const struct gn_bench_scene *scene, const struct gn_bench_map *map,
                         int factor)
{
    const int numbers[] = {CACHE_VERSION, factor, scene->stage.camera.width,
                           scene->stage.camera.height};
    const struct gn_camera *camera = &scene->stage.camera;
    const struct gn_projection *p = &map->frame.projection;
    uint64_t key = UINT64_C(0xcbf29ce484222325);
    hash(&key, numbers, sizeof(numbers));
    hash(&key, &camera->fx, sizeof(camera->fx));
    hash(&key, &camera->world_from_camera, sizeof(camera->world_from_camera));
    hash(&key, &p->type, sizeof(p->type));
    hash(&key, &p->theta_max, sizeof(p->theta_max));
    hash(&key, map->frame.world_from_probe, sizeof(map->frame.world_from_probe));
    hash(&key, map->pixels.data,
         sizeof(float) * 3 * (size_t)map->pixels.width * (size_t)map->pixels.height);
    for (int i = 0; i < scene->stage.scene->n_objects; i++) {
        const struct gn_scene_object *o = &scene->stage.scene->objects[i];
        hash(&key, &o->role, sizeof(o->role));
        hash(&key, o->material.albedo, sizeof(o->material.albedo));
        hash(&key, o->world_from_object, sizeof(o->world_from_object));
        hash(&key, o->mesh.positions, 3 * sizeof(float) * (size_t)o->mesh.n_vertices);
    }
    return key;
}

static int init_picture(struct gn_bench_picture *picture, int width, int height)
{
    *picture = (struct gn_bench_picture){{0}, {0}, {0}};
    int ret = gn_image_init(&picture->shadow, width, height, 3);
    if (ret == 0)
        ret = gn_image_init(&picture->virtual_rgba, width, height, 4);
    if (ret == 0)
        ret = gn_image_init(&picture->background, width, height, 3);
    if (ret < 0)
        gn_bench_picture_finish(picture);
    return ret;
}

/** Reads or writes all its pixels. */
static bool transfer(struct gn_bench_picture *p, FILE *file, bool is_write)
{
    struct gn_image *images[3] = {&p->shadow, &p->virtual_rgba, &p->background};
    bool is_good = true;
    for (int i = 0; i < 3 && is_good; i++) {
        size_t n =
            (size_t)images[i]->width * (size_t)images[i]->height * (size_t)images[i]->channels;
        size_t done = is_write ? fwrite(images[i]->data, sizeof(float), n, file)
                               : fread(images[i]->data, sizeof(float), n, file);
        is_good = done == n;
    }
    return is_good;
}

/** Renders both stages by the map's texels. */
static int render(struct gn_bench_scene *scene, const struct gn_bench_map *map, int factor,
                  struct gn_bench_picture *out)
{
    const struct gn_light_options light_options = {.n_lights = 1, .no_sh = true};
    const struct gn_render_options options = {.quality = GN_QUALITY_REFERENCE, .single_ray = true};
    struct gn_bench_map split = {0};
    struct gn_lighting_state *state = NULL;
    int ret = gn_bench_map_split(map, factor, &split);
    if (ret == 0)
        ret = gn_lighting_state_create(&split.frame, NULL, &light_options, NULL, &state, NULL);
    struct gn_test_stage *stages[2] = {&scene->stage, &scene->backdrop};
    for (int i = 0; i < 2 && ret == 0; i++)
        ret = gn_renderer_render(stages[i]->renderer, &stages[i]->camera, state, &options,
                                 &stages[i]->layers, &stages[i]->report, NULL);
    if (ret == 0) {
        size_t n = (size_t)out->shadow.width * (size_t)out->shadow.height;
        memcpy(out->shadow.data, scene->stage.layers.shadow.data, 3 * n * sizeof(float));
        memcpy(out->virtual_rgba.data, scene->stage.layers.virtual_rgba.data,
               4 * n * sizeof(float));
        for (size_t i = 0; i < 3 * n; i++)
            out->background.data[i] = scene->backdrop.layers.virtual_rgba.data[i / 3 * 4 + i % 3];
    }
    gn_lighting_state_unref(&state);
    gn_bench_map_finish(&split);
    return ret;
}

int gn_bench_make_reference(struct gn_bench_cache *cache, struct gn_bench_scene *scene,
                            const struct gn_bench_map *map, int factor,
                            struct gn_bench_picture *out_picture)
{
    char path[4096] = "";
    char part[sizeof(path) + 8];
    FILE *file = NULL;
    int ret = init_picture(out_picture, scene->stage.camera.width, scene->stage.camera.height);
    if (ret < 0)
        return ret;
    if (cache->folder) {
        unsigned long long key = make_key(scene, map, factor);
        if (snprintf(path, sizeof(path), "%s/%016llx.reference", cache->folder, key) >=
            (int)sizeof(path))
            return -ENAMETOOLONG;
        file = fopen(path, "rb");
    }
    if (file) {
        bool is_good = transfer(out_picture, file, false);
        fclose(file);
        cache->n_read += is_good;
        if (is_good)
            return 0;
    }
    int64_t start_ns = gn_clock_get_monotonic_ns();
    ret = render(scene, map, factor, out_picture);
    cache->seconds += 1e-9 * (double)(gn_clock_get_monotonic_ns() - start_ns);
    cache->n_made++;
    if (ret < 0 || !cache->folder)
        return ret;
    // Under another name until it is whole.
    snprintf(part, sizeof(part), "%s.part", path);
    file = fopen(part, "wb");
    bool is_good = file && transfer(out_picture, file, true);
    if (file && fclose(file) != 0)
        is_good = false;
    return is_good && rename(part, path) == 0 ? 0 : -EIO;
}

void gn_bench_picture_finish(struct gn_bench_picture *picture)
{
    gn_image_finish(&picture->shadow);
    gn_image_finish(&picture->virtual_rgba);
    gn_image_finish(&picture->background);
}
