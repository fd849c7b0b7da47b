/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/stage.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/meshes.h"

static void must(bool is_good, const char *what, const struct gn_error *error)
{
    if (is_good)
        return;
    fprintf(stderr, "stage: %s: %s\n", what, error ? error->text : "");
    abort();
}

void gn_test_stage_add(struct gn_test_stage *stage, enum gn_rt_set role, struct gn_mesh mesh,
                       double x, double y, double z, enum gn_material_type type,
                       const float albedo[static 3])
{
    if (!stage->objects)
        stage->objects = calloc(GN_TEST_STAGE_MAX, sizeof(*stage->objects));
    must(stage->objects && stage->n_objects < GN_TEST_STAGE_MAX, "too many objects", NULL);
    struct gn_scene_object *object = &stage->objects[stage->n_objects++];
    object->name = strdup("object");
    object->role = role;
    object->has_material = true;
    object->material.type = type;
    memcpy(object->material.albedo, albedo, sizeof(object->material.albedo));
    gn_mat4_identity(object->world_from_object);
    object->world_from_object[3] = x;
    object->world_from_object[7] = y;
    object->world_from_object[11] = z;
    object->mesh = mesh;
}

void gn_test_stage_commit(struct gn_test_stage *stage, int n_threads)
{
    struct gn_error error = {0};
    if (n_threads > 0)
        must(gn_pool_create(n_threads, &stage->pool) == 0, "pool", NULL);
    must(gn_scene_create(stage->objects, stage->n_objects, stage->pool, &stage->scene, &error) == 0,
         "scene", &error);
    must(gn_renderer_create(stage->scene, stage->pool, &stage->renderer, &error) == 0, "renderer",
         &error);
}

void gn_test_stage_set_map(struct gn_test_stage *stage, int width, int height,
                           void (*paint)(void *context, const double dir[static 3],
                                         float out_rgb[static 3]),
                           void *context)
{
    struct gn_error error = {0};
    struct gn_image image;
    struct gn_environment_frame frame = {
        .codes = &image,
        .projection = {.type = GN_PROJECTION_LATLONG, .width = width, .height = height},
    };
    struct gn_pose pose = {.rotation = {1, 0, 0, 0}};
    if (stage->world_from_probe[0] != 0)
        memcpy(pose.rotation, stage->world_from_probe, sizeof(pose.rotation));
    memcpy(frame.world_from_probe, pose.rotation, sizeof(pose.rotation));
    must(gn_image_init(&image, width, height, 3) == 0, "image", NULL);
    must(gn_projection_init(&frame.projection, NULL) == 0, "projection", NULL);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double dir[3];
            must(gn_projection_get_direction(&frame.projection, x + 0.5, y + 0.5, dir), "direction",
                 NULL);
            gn_pose_rotate(&pose, dir, dir);
            paint(context, dir, gn_image_at(&image, x, y));
        }
    }
    gn_radiance_map_unref(&stage->map);
    gn_pyramid_unref(&stage->state.pyramid);
    must(gn_radiance_map_create(&frame, NULL, NULL, &stage->map, &error) == 0, "map", &error);
    gn_image_finish(&image);
    stage->state.map = stage->map;
    must(gn_pyramid_create(stage->map, &stage->state.pyramid) == 0, "pyramid", NULL);
    stage->state.has_sh = true;
    must(gn_irradiance_init_from_map(&stage->state.irradiance, stage->state.sh, stage->map, NULL,
                                     NULL) == 0,
         "SH", NULL);
}

void gn_test_stage_set_lights(struct gn_test_stage *stage, const struct gn_light *lights, int n)
{
    free(stage->lights);
    stage->lights = calloc((size_t)n + 1, sizeof(*lights));
    must(stage->lights, "lights", NULL);
    memcpy(stage->lights, lights, (size_t)n * sizeof(*lights));
    stage->state.lights = stage->lights;
    stage->state.n_lights = n;
}

void gn_test_stage_set_lights_from_map(struct gn_test_stage *stage, int side)
{
    const struct gn_radiance_map *map = stage->map;
    struct gn_light *lights = calloc(GN_LIGHTS_MAX, sizeof(*lights));
    int n = 0;
    must(lights, "lights", NULL);
    for (int y = 0; y < map->radiance.height; y += side) {
        for (int x = 0; x < map->radiance.width; x += side) {
            double sum[3] = {0};
            double moment[3] = {0};
            for (int i = 0; i < side * side; i++) {
                size_t t =
                    (size_t)(y + i / side) * (size_t)map->radiance.width + (size_t)(x + i % side);
                for (size_t k = 0; k < 3; k++)
                    sum[k] += (double)map->radiance.data[3 * t + k] * map->solid_angle[t];
                double weight = (double)map->solid_angle[t] *
                                (map->radiance.data[3 * t] + map->radiance.data[3 * t + 1] +
                                 map->radiance.data[3 * t + 2]);
                for (size_t k = 0; k < 3; k++)
                    moment[k] += weight * map->direction_world[3 * t + k];
            }
            double length =
                sqrt(moment[0] * moment[0] + moment[1] * moment[1] + moment[2] * moment[2]);
            if (!(length > 0))
                continue;
            must(n < GN_LIGHTS_MAX, "too many lights", NULL);
            for (int k = 0; k < 3; k++) {
                lights[n].dir_world[k] = (float)(moment[k] / length);
                lights[n].irradiance[k] = (float)sum[k];
            }
            n++;
        }
    }
    gn_test_stage_set_lights(stage, lights, n);
    free(lights);
}

void gn_test_stage_aim(struct gn_test_stage *stage, int width, int height, double focal,
                       const double eye[static 3], const double target[static 3])
{
    double z[3];
    double x[3];
    double y[3];
    double length = 0;
    for (int k = 0; k < 3; k++) {
        z[k] = target[k] - eye[k];
        length += z[k] * z[k];
    }
    for (int k = 0; k < 3; k++)
        z[k] /= sqrt(length);
    bool is_steep = fabs(z[2]) > 0.999;
    const double up[3] = {is_steep, 0, !is_steep};
    x[0] = z[1] * up[2] - z[2] * up[1];
    x[1] = z[2] * up[0] - z[0] * up[2];
    x[2] = z[0] * up[1] - z[1] * up[0];
    length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    for (int k = 0; k < 3; k++)
        x[k] /= length;
    y[0] = z[1] * x[2] - z[2] * x[1];
    y[1] = z[2] * x[0] - z[0] * x[2];
    y[2] = z[0] * x[1] - z[1] * x[0];
    const double m[16] = {x[0], y[0], z[0], eye[0], x[1], y[1], z[1], eye[1],
                          x[2], y[2], z[2], eye[2], 0,    0,    0,    1};
    stage->camera = (struct gn_camera){
        .width = width,
        .height = height,
        .fx = focal,
        .fy = focal,
        .cx = 0.5 * width,
        .cy = 0.5 * height,
        .response = {.type = GN_RESPONSE_SRGB},
    };
    const char *reason = NULL;
    must(gn_pose_from_matrix(m, &stage->camera.world_from_camera, &reason) == 0, "pose", NULL);
}

void gn_test_stage_render(struct gn_test_stage *stage, const struct gn_render_options *options)
{
    struct gn_error error = {0};
    must(gn_renderer_render(stage->renderer, &stage->camera, &stage->state, options, &stage->layers,
                            &stage->report, &error) == 0,
         "render", &error);
}

void gn_test_stage_finish(struct gn_test_stage *stage)
{
    gn_renderer_destroy(&stage->renderer);
    gn_scene_destroy(&stage->scene);
    gn_pool_destroy(&stage->pool);
    gn_radiance_map_unref(&stage->map);
    gn_pyramid_unref(&stage->state.pyramid);
    gn_layers_finish(&stage->layers);
    free(stage->lights);
    free(stage->objects);
    memset(stage, 0, sizeof(*stage));
}

void gn_test_stage_get_point(const struct gn_test_stage *stage, double x_px, double y_px,
                             double height, double out_point[static 3])
{
    const struct gn_camera *camera = &stage->camera;
    const double *eye = camera->world_from_camera.translation;
    const double dir_camera[3] = {(x_px - camera->cx) / camera->fx,
                                  (y_px - camera->cy) / camera->fy, 1};
    double dir[3];
    gn_pose_rotate(&camera->world_from_camera, dir_camera, dir);
    double t = (height - eye[2]) / dir[2];
    for (int k = 0; k < 3; k++)
        out_point[k] = eye[k] + t * dir[k];
}

static struct gn_mesh allocate(int n_vertices, int n_triangles)
{
    struct gn_mesh mesh = {.n_vertices = n_vertices, .n_triangles = n_triangles};
    mesh.positions = calloc((size_t)n_vertices, 3 * sizeof(float));
    mesh.triangles = calloc((size_t)n_triangles, 3 * sizeof(uint32_t));
    must(mesh.positions && mesh.triangles, "mesh", NULL);
    return mesh;
}

struct gn_mesh gn_test_make_disc(float radius, int n)
{
    struct gn_mesh mesh = allocate(n + 1, n); // vertex n is the middle
    for (int i = 0; i < n; i++) {
        mesh.positions[3 * i] = radius * cosf(2 * (float)M_PI * (float)i / (float)n);
        mesh.positions[3 * i + 1] = radius * sinf(2 * (float)M_PI * (float)i / (float)n);
        mesh.triangles[3 * i] = (uint32_t)n;
        mesh.triangles[3 * i + 1] = (uint32_t)i;
        mesh.triangles[3 * i + 2] = (uint32_t)((i + 1) % n);
    }
    return mesh;
}

struct gn_mesh gn_test_make_box(float x, float y, float z)
{
    struct gn_mesh mesh = gn_test_make_cube(1);
    for (int i = 0; i < mesh.n_vertices; i++) {
        mesh.positions[3 * i] *= x;
        mesh.positions[3 * i + 1] *= y;
        mesh.positions[3 * i + 2] *= z;
    }
    return mesh;
}
