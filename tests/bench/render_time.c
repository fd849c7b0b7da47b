/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The paper's table (section 6) on the rig's room: 814 triangles with the teapot, camera 500 mm
 * from the marker, the lamp room with four lamps on as its 300 x 300 fisheye sees it, and the
 * lights that the paper's partition makes of it at the settings of seed_settings.h. Medians of
 * whole frames without codec, the paper's own seconds beside its rows; below them interactive
 * quality. cpu: processor time of all threads, which other programs on the machine disturb less.
 * usage: bench_render_time [frames [threads]]
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "server/render/render.h"
#include "tests/bench/seed_settings.h"
#include "tests/rig/room.h"

#define MAX_FRAMES 101

/** The paper's table: seconds without and with shadow on its machine (Athlon 3000+, 2007). The rows
 * of 76 lights shade by the irradiance map; of 178 lights the paper gives no times. */
static const struct paper_row {
    int width, n_lights;
    double without_s, with_s; // 0: not given
} paper[] = {
    {320, 59, 0.5, 1.2},  {640, 59, 1.3, 4.0},   {320, 86, 0.6, 3.7}, {640, 86, 1.5, 14.0},
    {320, 122, 0.7, 6.2}, {640, 122, 2.2, 24.0}, {320, 76, 0.6, 1.3}, {640, 76, 0.7, 4.6},
    {320, 178, 0, 0},     {640, 178, 0, 0},
};

/** What all rows share. */
struct bench {
    struct gn_pool *pool;
    struct gn_scene *scene;
    struct gn_renderer *renderer;
    struct gn_layers layers;
    struct gn_render_report report;
    struct gn_camera camera;
    struct gn_image pixels;
    struct gn_environment_frame frame;
    int n_frames;
};

static void check(int result, const char *what)
{
    if (result == 0)
        return;
    fprintf(stderr, "bench_render_time: %s: %s\n", what, strerror(-result));
    exit(1);
}

static struct gn_scene *make_scene(struct gn_pool *pool)
{
    struct gn_rig_room room;
    struct gn_scene *scene = NULL;
    struct gn_scene_object *objects = calloc(GN_RIG_MAX_OBJECTS, sizeof(*objects));
    check(objects ? gn_rig_room_init_demo(false, &room, NULL) : -ENOMEM, "the room");
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
    check(gn_scene_create(objects, room.n_objects, pool, &scene, NULL), "the scene");
    free(objects);
    gn_rig_room_finish(&room);
    return scene;
}

/** 500 mm from the marker, 35 degrees above the table. */
static void aim(struct bench *b, int width)
{
    const double position[3] = {-0.064, -0.404, 0.287};
    const double target[3] = {0.006, 0.050, 0.012};
    double m[16];
    gn_rig_look_at(position, target, m);
    b->camera = (struct gn_camera){.width = width,
                                   .height = width * 3 / 4,
                                   .fx = 1.32 * width,
                                   .fy = 1.32 * width,
                                   .cx = width / 2.0,
                                   .cy = width * 3 / 8.0,
                                   .response = {.type = GN_RESPONSE_SRGB}};
    check(gn_pose_from_matrix(m, &b->camera.world_from_camera, NULL), "the camera");
}

static struct gn_lighting_state *make_light(struct bench *b, const struct gn_light_options *options)
{
    struct gn_lighting_state *light = NULL;
    check(gn_lighting_state_create(&b->frame, NULL, options, b->pool, &light, NULL), "the light");
    return light;
}

static struct gn_lighting_state *make_seed_light(struct bench *b, int n_lights)
{
    for (int i = 0; i < GN_SEED_SETTINGS; i++) {
        if (gn_seed_settings[i].n_lights != n_lights)
            continue;
        struct gn_light_options options = gn_seed_make_options(&gn_seed_settings[i]);
        return make_light(b, &options);
    }
    check(-EINVAL, "a number of lights without a setting");
    return NULL;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a;
    double y = *(const double *)b;
    return (x > y) - (x < y);
}

static double get_ms(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/** Renders and prints a row: medians after two frames that warm up. Returns the wall time, ms. */
static double measure(struct bench *b, const struct gn_lighting_state *light, const char *name,
                      const struct gn_render_options *options)
{
    double wall[MAX_FRAMES];
    double cpu[MAX_FRAMES];
    for (int i = -2; i < b->n_frames; i++) {
        double wall_before = get_ms(CLOCK_MONOTONIC);
        double cpu_before = get_ms(CLOCK_PROCESS_CPUTIME_ID);
        check(gn_renderer_render(b->renderer, &b->camera, light, options, &b->layers, &b->report,
                                 NULL),
              "a frame");
        if (i < 0)
            continue;
        cpu[i] = get_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_before;
        wall[i] = get_ms(CLOCK_MONOTONIC) - wall_before;
    }
    int n = b->n_frames;
    qsort(wall, (size_t)n, sizeof(wall[0]), compare);
    qsort(cpu, (size_t)n, sizeof(cpu[0]), compare);
    const struct gn_render_report *r = &b->report;
    uint64_t rays = r->rays_primary + r->rays_mirror + r->rays_shade + r->rays_shadow;
    printf("%4dx%-4d %6d %-22s %-6s %9.2f %7.2f %9.2f %10llu %7.1f", b->camera.width,
           b->camera.height, light->n_lights, name, options->no_shadow ? "no" : "yes", wall[n / 2],
           wall[3 * n / 4] - wall[n / 4], cpu[n / 2], (unsigned long long)rays,
           1e-3 * (double)rays / wall[n / 2]);
    return wall[n / 2];
}

static void print_paper_row(struct bench *b, const struct paper_row *row, bool has_shadow)
{
    bool is_map = row->n_lights == 76;
    struct gn_render_options options = {.quality = GN_QUALITY_SEED,
                                        .shading =
                                            is_map ? GN_SHADING_IRRADIANCE : GN_SHADING_LIGHTS,
                                        .no_shadow = !has_shadow};
    struct gn_lighting_state *light = make_seed_light(b, row->n_lights);
    aim(b, row->width);
    double ms = measure(b, light, is_map ? "seed, irradiance map" : "seed", &options);
    double paper_s = has_shadow ? row->with_s : row->without_s;
    if (paper_s > 0)
        printf(" %6.1f s %7.0fx", paper_s, 1e3 * paper_s / ms);
    printf("\n");
    gn_lighting_state_unref(&light);
}

int main(int argc, char **argv)
{
    struct bench b = {.n_frames = argc > 1 ? atoi(argv[1]) : 11};
    int n_threads = argc > 2 ? atoi(argv[2]) : 2;
    if (b.n_frames < 1 || b.n_frames > MAX_FRAMES || n_threads < 1 || n_threads > 256) {
        fprintf(stderr, "usage: %s [frames 1..%d [threads 1..256]]\n", argv[0], MAX_FRAMES);
        return 1;
    }
    check(gn_pool_create(n_threads, &b.pool), "the threads");
    b.scene = make_scene(b.pool);
    check(gn_seed_take_frame(&b.pixels, &b.frame), "the environment frame");
    check(gn_renderer_create(b.scene, b.pool, &b.renderer, NULL), "the renderer");
    check(gn_layers_init(&b.layers, 320, 240), "the layers");
    printf("%d triangles, %d threads, median of %d frames\n",
           b.scene->n_real_triangles + b.scene->n_virtual_triangles, n_threads, b.n_frames);
    printf("size      lights quality                shadow        ms     iqr       cpu       rays"
           "  Mray/s  paper\n");
    for (size_t i = 0; i < GN_ARRAY_LEN(paper); i++) {
        print_paper_row(&b, &paper[i], false);
        print_paper_row(&b, &paper[i], true);
    }
    for (int i = 0; i < 4; i++) {
        struct gn_light_options light_options = {.n_lights = i < 2 ? 64 : 122};
        struct gn_render_options options = {.quality = GN_QUALITY_INTERACTIVE};
        struct gn_lighting_state *light = make_light(&b, &light_options);
        aim(&b, i % 2 ? 640 : 320);
        (void)measure(&b, light, "interactive", &options);
        printf("\n");
        gn_lighting_state_unref(&light);
    }
    gn_renderer_destroy(&b.renderer);
    gn_layers_finish(&b.layers);
    gn_scene_destroy(&b.scene);
    gn_image_finish(&b.pixels);
    gn_pool_destroy(&b.pool);
    return 0;
}
