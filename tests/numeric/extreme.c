/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/numeric/extreme.h"

#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <string.h>

#include "common/pool.h"
#include "common/pose.h"

#define N_THREADS 3
#define MAX_LIGHTS 64

static const char *const quality_names[] = {"interactive", "seed", "reference"};

struct gn_extreme_place gn_extreme_at_scale(double scale)
{
    return (struct gn_extreme_place){scale, {{1, 0, 0, 0}, {0, 0, 0}}};
}

struct gn_extreme_place gn_extreme_away(double scale, double sizes)
{
    double far = sizes * scale;
    struct gn_extreme_place place = {
        scale, {{0.7384, 0.2615, -0.4523, 0.4268}, {0.7 * far, -0.5 * far, 0.51 * far}}};
    assert_int_equal(gn_pose_normalize(&place.pose), 0);
    return place;
}

double gn_extreme_get_step(double sizes)
{
    // gn_extreme_away puts it 0.7 of the way along an axis; a float has 24 bits.
    return ldexp(1, (int)floor(log2(0.7 * sizes + 4)) - 23);
}

void gn_extreme_move_objects(struct gn_test_stage *stage, const struct gn_extreme_place *place)
{
    double m[16];
    gn_pose_to_matrix(&place->pose, m);
    for (int i = 0; i < 12; i++)
        m[i] *= i % 4 < 3 ? place->scale : 1;
    for (int i = 0; i < stage->n_objects; i++)
        gn_mat4_multiply(m, stage->objects[i].world_from_object,
                         stage->objects[i].world_from_object);
}

void gn_extreme_aim(struct gn_test_stage *stage, const struct gn_extreme_place *place, int side,
                    double focal, const double eye[static 3], const double target[static 3])
{
    gn_test_stage_aim(stage, side, side, focal, eye, target);
    struct gn_pose *camera = &stage->camera.world_from_camera;
    for (int k = 0; k < 3; k++)
        camera->translation[k] *= place->scale;
    gn_pose_multiply(&place->pose, camera, camera);
}

static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    static const double sun[3] = {0.66, 0.48, 0.578}; // unit, 35.3 degrees up
    struct gn_pose back;
    double d[3];
    gn_pose_invert(context, &back);
    gn_pose_rotate(&back, dir, d);
    bool is_sun = d[0] * sun[0] + d[1] * sun[1] + d[2] * sun[2] > 0.985;
    for (int k = 0; k < 3; k++)
        out_rgb[k] = (float)(1 + 0.4 * d[0] + 0.1 * k * d[1] + (is_sun ? 60 : 0));
}

void gn_extreme_set_sky(struct gn_test_stage *stage, const struct gn_extreme_place *place,
                        int height)
{
    struct gn_pose turn = {.translation = {0, 0, 0}};
    memcpy(turn.rotation, place->pose.rotation, sizeof(turn.rotation));
    memcpy(stage->world_from_probe, turn.rotation, sizeof(turn.rotation));
    gn_test_stage_set_map(stage, 2 * height, height, paint_sky, &turn);
    gn_test_stage_set_lights_from_map(stage, height / 4);
}

void gn_extreme_set_lights(struct gn_test_stage *stage, const struct gn_extreme_place *place,
                           const struct gn_light *lights, int n)
{
    struct gn_light turned[MAX_LIGHTS];
    assert_in_range(n, 0, MAX_LIGHTS);
    for (int i = 0; i < n; i++) {
        double dir[3] = {lights[i].dir_world[0], lights[i].dir_world[1], lights[i].dir_world[2]};
        gn_pose_rotate(&place->pose, dir, dir);
        turned[i] = lights[i];
        for (int k = 0; k < 3; k++)
            turned[i].dir_world[k] = (float)dir[k];
    }
    gn_test_stage_set_lights(stage, turned, n);
}

static void render(const struct gn_test_stage *stage, struct gn_renderer *renderer,
                   const struct gn_scene *posed, const struct gn_render_options *options,
                   struct gn_layers *out_layers)
{
    struct gn_error error = {0};
    struct gn_render_report report;
    if (posed)
        gn_renderer_set_scene(renderer, posed);
    int ret = gn_renderer_render(renderer, &stage->camera, &stage->state, options, out_layers,
                                 &report, &error);
    if (ret < 0)
        print_message("# %s\n", error.text);
    assert_int_equal(ret, 0);
}

/** Number of values that differ by a bit; says which is the first. */
static int count_different(const struct gn_image *a, const struct gn_image *b, const char *layer,
                           const char *what, const char *quality)
{
    int n_values = a->width * a->height * a->channels;
    int n = 0;
    for (int i = 0; i < n_values; i++) {
        if (memcmp(&a->data[i], &b->data[i], sizeof(float)) == 0)
            continue;
        int pixel = i / a->channels;
        if (n++ == 0)
            print_message("# %s, %s: %s differs at (%d, %d): %.9g, else %.9g\n", quality, layer,
                          what, pixel % a->width, pixel / a->width, (double)a->data[i],
                          (double)b->data[i]);
    }
    if (n > 0)
        print_message("# %s, %s: %d of %d values differ\n", quality, layer, n, n_values);
    return n;
}

static void assert_same(const struct gn_layers *a, const struct gn_layers *b, const char *what,
                        const char *quality)
{
    int n = count_different(&a->virtual_rgba, &b->virtual_rgba, "virtual", what, quality);
    n += count_different(&a->shadow, &b->shadow, "shadow", what, quality);
    n += count_different(&a->added, &b->added, "added", what, quality);
    n += count_different(&a->depth, &b->depth, "depth", what, quality);
    assert_int_equal(n, 0);
}

static void assert_in_bounds(const struct gn_layers *layers)
{
    for (int i = 0; i < layers->width * layers->height; i++) {
        const float *v = layers->virtual_rgba.data + 4 * i;
        assert_true(v[3] >= 0 && v[3] <= 1);
        assert_true(layers->depth.data[i] >= 0);
        for (int k = 0; k < 3; k++) {
            float factor = layers->shadow.data[3 * i + k];
            float added = layers->added.data[3 * i + k];
            assert_true(isfinite(v[k]) && v[k] >= 0);
            assert_true(factor >= 0 && factor <= 1);
            assert_true(isfinite(added) && added >= 0);
        }
    }
}

void gn_extreme_check(struct gn_test_stage *stage, const struct gn_scene *posed,
                      const struct gn_render_options *options,
                      void (*judge)(void *context, const struct gn_extreme_view *view),
                      void *context)
{
    struct gn_layers one = {0}, many = {0}, all = {0};
    struct gn_pool *pool = NULL;
    struct gn_renderer *threaded = NULL;
    assert_int_equal(gn_pool_create(N_THREADS, &pool), 0);
    assert_int_equal(gn_renderer_create(stage->scene, pool, &threaded, NULL), 0);
    for (int q = GN_QUALITY_INTERACTIVE; q <= GN_QUALITY_REFERENCE; q++) {
        struct gn_render_options o = options ? *options : (struct gn_render_options){0};
        o.quality = (enum gn_quality)q;
        o.all_passes = false;
        render(stage, stage->renderer, posed, &o, &one);
        assert_in_bounds(&one);
        render(stage, threaded, posed, &o, &many);
        assert_same(&one, &many, "on three threads", quality_names[q]);
        o.all_passes = true;
        render(stage, stage->renderer, posed, &o, &all);
        assert_same(&one, &all, "without the plan's rules", quality_names[q]);
        const struct gn_extreme_view view = {stage, posed, &one, o.quality, quality_names[q]};
        if (judge)
            judge(context, &view);
    }
    gn_renderer_destroy(&threaded);
    gn_pool_destroy(&pool);
    gn_layers_finish(&one);
    gn_layers_finish(&many);
    gn_layers_finish(&all);
}
