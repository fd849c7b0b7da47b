/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/rig_frame.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/bench/seed_settings.h"
#include "tests/bench/timing.h"
#include "tests/rig/room.h"

static struct gn_scene *make_scene(struct gn_pool *pool)
{
    struct gn_rig_room room;
    struct gn_scene *scene = NULL;
    struct gn_scene_object *objects = calloc(GN_RIG_MAX_OBJECTS, sizeof(*objects));
    gn_bench_check(objects ? gn_rig_room_init_demo(false, &room, NULL) : -ENOMEM, "the room");
    for (int i = 0; i < room.n_objects; i++) {
        struct gn_rig_object *o = &room.objects[i];
        objects[i] = (struct gn_scene_object){.name = strdup(o->name),
                                              .role = o->role,
                                              .has_material = !o->mesh.albedos,
                                              .mesh = o->mesh};
        for (int k = 0; k < 3; k++)
            objects[i].material.albedo[k] = (float)o->albedo[k];
        memcpy(objects[i].world_from_object, o->world_from_object, sizeof(o->world_from_object));
        memset(&o->mesh, 0, sizeof(o->mesh));
    }
    gn_bench_check(gn_scene_create(objects, room.n_objects, pool, &scene, NULL), "the scene");
    free(objects);
    gn_rig_room_finish(&room);
    return scene;
}

void gn_bench_rig_init(struct gn_bench_rig *rig, int n_threads)
{
    *rig = (struct gn_bench_rig){0};
    gn_bench_check(gn_pool_create(n_threads, &rig->pool), "the threads");
    rig->scene = make_scene(rig->pool);
    gn_bench_check(gn_seed_take_frame(&rig->pixels, &rig->frame), "the environment frame");
    gn_bench_check(gn_renderer_create(rig->scene, rig->pool, &rig->renderer, NULL), "the renderer");
    gn_bench_check(gn_layers_init(&rig->layers, 320, 240), "the layers");
}

void gn_bench_rig_finish(struct gn_bench_rig *rig)
{
    gn_renderer_destroy(&rig->renderer);
    gn_layers_finish(&rig->layers);
    gn_scene_destroy(&rig->scene);
    gn_image_finish(&rig->pixels);
    gn_pool_destroy(&rig->pool);
}

void gn_bench_rig_aim(struct gn_bench_rig *rig, int width)
{
    const double position[3] = {-0.064, -0.404, 0.287};
    const double target[3] = {0.006, 0.050, 0.012};
    double m[16];
    gn_rig_look_at(position, target, m);
    rig->camera = (struct gn_camera){.width = width,
                                     .height = width * 3 / 4,
                                     .fx = 1.32 * width,
                                     .fy = 1.32 * width,
                                     .cx = width / 2.0,
                                     .cy = width * 3 / 8.0,
                                     .response = {.type = GN_RESPONSE_SRGB}};
    gn_bench_check(gn_pose_from_matrix(m, &rig->camera.world_from_camera, NULL), "the camera");
}

struct gn_lighting_state *gn_bench_rig_make_light(struct gn_bench_rig *rig,
                                                  const struct gn_light_options *options)
{
    struct gn_lighting_state *light = NULL;
    gn_bench_check(gn_lighting_state_create(&rig->frame, NULL, options, rig->pool, &light, NULL),
                   "the light");
    return light;
}

struct gn_lighting_state *gn_bench_rig_make_seed_light(struct gn_bench_rig *rig, int n_lights)
{
    for (int i = 0; i < GN_SEED_SETTINGS; i++) {
        if (gn_seed_settings[i].n_lights != n_lights)
            continue;
        struct gn_light_options options = gn_seed_make_options(&gn_seed_settings[i]);
        return gn_bench_rig_make_light(rig, &options);
    }
    gn_bench_check(-EINVAL, "a number of lights without a setting");
    return NULL;
}

void gn_bench_rig_render(struct gn_bench_rig *rig, const struct gn_lighting_state *light,
                         const struct gn_render_options *options)
{
    gn_bench_check(gn_renderer_render(rig->renderer, &rig->camera, light, options, &rig->layers,
                                      &rig->report, NULL),
                   "a frame");
}
