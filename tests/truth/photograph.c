/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Composites with the camera matched look photographed, without it they do not. The rig's camera
 * has a lens that blurs (a random place for each path) and noise that grows with light; it
 * photographs a plate over a table, once with the plate physically there, the truth, and once
 * without, which is what the server puts the plate into. noise  the variance of the codes over
 * frames, on the plate and in its shadow's reach: within 10 % of the truth's with matching, under a
 * tenth of it on the plate without; edges  the deviation of the line spread across a slanted edge
 * of the plate, within 10 % of the truth's with matching, at most 0.6 of it without; seen through a
 * lens with distortion.
 */
#include "tests/unit/cmocka_setup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/composite.h"
#include "tests/rig/tracer.h"
#include "tests/rig/vec.h"
#include "tests/meshes.h"
#include "tests/stage.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, FRAMES = 48 };

static const double blur_px = 0.9, distortion[5] = {-0.25, 0.05, 0.001, -0.002, 0};
static const struct gn_rig_noise noise = {1.5e-3, 4e-5};

/* The plate's edge towards -x, in the world: at this x, from -y to y. */
static const double plate_side = 0.4, plate_height = 0.8;

/* Both worlds of the scene, made once. */
struct fixture {
    struct gn_rig_view view;
    struct gn_rig_pictures rig;
    struct gn_test_stage stage;
    struct gn_compositor *compositor;
    struct gn_composite_options options;
};

static void paint_sky(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    out_rgb[0] = out_rgb[1] = out_rgb[2] = dir[2] > 0 ? 0.9f : 0.1f;
}

/* From above, turned about the axis of sight so that no edge is parallel to the rows. */
static void aim(struct gn_rig_view *view)
{
    double c = cos(0.15), s = sin(0.15);
    *view = (struct gn_rig_view){
        .width = WIDTH,
        .height = HEIGHT,
        .fx = 110,
        .fy = 110,
        .cx = WIDTH / 2.0,
        .cy = HEIGHT / 2.0,
        .world_from_camera = {c, s, 0, -0.2, s, -c, 0, 0, 0, 0, -1, 2.4, 0, 0, 0, 1},
        .blur_px = blur_px};
    memcpy(view->distortion, distortion, sizeof(distortion));
}

static void take_rig(struct fixture *f)
{
    struct gn_rig_room room = {0};
    struct gn_rig_environment env;
    struct gn_image map;
    const struct gn_rig_render_options options = {.batches = 4, .batch_size = 64};
    for (int i = 0; i < 2; i++) {
        struct gn_rig_object o = {.name = i ? "plate" : "table",
                                  .role = i ? GN_RT_VIRTUAL : GN_RT_REAL,
                                  .mesh = i ? gn_test_make_box(0.8f, 0.8f, 0.02f)
                                            : gn_test_make_plane(20, 1),
                                  .albedo = {i ? 0.7 : 0.3, i ? 0.6 : 0.3, i ? 0.5 : 0.3},
                                  .world_from_object = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1,
                                                        i ? plate_height - 0.01 : 0, 0, 0, 0, 1}};
        assert_int_equal(gn_rig_room_add(&room, &o), 0);
    }
    assert_int_equal(gn_rig_room_commit(&room, NULL, NULL), 0);
    assert_int_equal(gn_image_init(&map, 64, 32, 3), 0);
    for (int i = 0; i < 3 * 64 * 32; i++)
        map.data[i] = i < 3 * 64 * 16 ? 0.9f : 0.1f;
    assert_int_equal(gn_rig_environment_init(&map, 0, &env, NULL), 0);
    assert_int_equal(gn_rig_render(&room, &env, &f->view, &options, NULL, &f->rig, NULL), 0);
    gn_image_finish(&map);
    gn_rig_environment_finish(&env);
    gn_rig_room_finish(&room);
}

static void take_layers(struct fixture *f)
{
    static const float table[3] = {0.3f, 0.3f, 0.3f}, plate[3] = {0.7f, 0.6f, 0.5f};
    static const double origin[3] = {0, 0, 2.4}, down[3] = {0};
    const struct gn_render_options options = {0};
    struct gn_test_stage *stage = &f->stage;
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(20, 1), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      table);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_box(0.8f, 0.8f, 0.02f), 0, 0,
                      plate_height - 0.01, GN_MATERIAL_DIFFUSE, plate);
    gn_test_stage_commit(stage, 0);
    gn_test_stage_set_map(stage, 64, 32, paint_sky, NULL);
    gn_test_stage_set_lights_from_map(stage, 4);
    gn_test_stage_aim(stage, WIDTH, HEIGHT, f->view.fx, origin, down);
    memcpy(stage->camera.distortion, distortion, sizeof(distortion));
    assert_int_equal(
        gn_pose_from_matrix(f->view.world_from_camera, &stage->camera.world_from_camera, NULL), 0);
    gn_test_stage_render(stage, &options);
}

static int set_up(void **state)
{
    static struct fixture f;
    aim(&f.view);
    take_rig(&f);
    take_layers(&f);
    assert_int_equal(gn_compositor_create(NULL, &f.compositor), 0);
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    gn_compositor_destroy(&f->compositor);
    gn_test_stage_finish(&f->stage);
    gn_rig_pictures_finish(&f->rig);
    return 0;
}

static struct gn_composite_layers get_layers(const struct fixture *f)
{
    return (struct gn_composite_layers){&f->stage.layers.virtual_rgba, &f->stage.layers.shadow,
                                        &f->stage.layers.added};
}

static void set_match(struct fixture *f, bool is_matched)
{
    f->options.match = (struct gn_match){0};
    if (!is_matched)
        return;
    f->options.match.blur_px = blur_px;
    for (int c = 0; c < 3; c++) {
        f->options.match.noise_slope[c] = noise.slope;
        f->options.match.noise_offset[c] = noise.offset;
    }
}

/* Mean over pixels of a kind and channels of the variance over FRAMES photographs of the truth
 * [0] and composites of photographs [1]. */
static void measure_noise(struct fixture *f, bool on_plate, double out[static 2])
{
    static double sum[2][3 * PIXELS], square[2][3 * PIXELS];
    struct gn_image8 pictures[2];
    const struct gn_response response = {.type = GN_RESPONSE_SRGB};
    const struct gn_composite_layers layers = get_layers(f);
    long n = 0;
    memset(sum, 0, sizeof(sum));
    memset(square, 0, sizeof(square));
    for (int i = 0; i < 2; i++)
        assert_int_equal(gn_image8_init(&pictures[i], WIDTH, HEIGHT, 3), 0);
    for (int frame = 0; frame < FRAMES; frame++) {
        gn_rig_photograph(f->rig.mean[GN_RIG_TRUTH].data, PIXELS, &noise, 1, frame,
                          pictures[0].data);
        gn_rig_photograph(f->rig.mean[GN_RIG_BACKGROUND].data, PIXELS, &noise, 2, frame,
                          pictures[1].data);
        f->options.frame = (uint64_t)frame;
        assert_int_equal(gn_compositor_put_image8(f->compositor, &layers, &pictures[1], &response,
                                                  &f->options, &pictures[1]),
                         0);
        for (int k = 0; k < 2; k++)
            for (int i = 0; i < 3 * PIXELS; i++) {
                sum[k][i] += pictures[k].data[i];
                square[k][i] += (double)pictures[k].data[i] * pictures[k].data[i];
            }
    }
    out[0] = out[1] = 0;
    for (int i = 0; i < 3 * PIXELS; i++) {
        float covered = f->rig.object.data[i / 3];
        if (on_plate ? covered < 1 : covered > 0)
            continue;
        n++;
        for (int k = 0; k < 2; k++)
            out[k] += (square[k][i] - sum[k][i] * sum[k][i] / FRAMES) / (FRAMES - 1);
    }
    assert_true(n > 1000);
    for (int k = 0; k < 2; k++) {
        out[k] /= (double)n;
        gn_image8_finish(&pictures[k]);
    }
}

static void test_noise(void **state)
{
    struct fixture *f = *state;
    for (int on_plate = 0; on_plate < 2; on_plate++) {
        double with[2], without[2];
        set_match(f, true);
        measure_noise(f, on_plate, with);
        set_match(f, false);
        measure_noise(f, on_plate, without);
        printf("# %s: variance of codes %.2f photographed, %.2f matched, %.2f not\n",
               on_plate ? "plate" : "table", with[0], with[1], without[1]);
        assert_true(fabs(with[1] / with[0] - 1) < 0.1);
        assert_true(!on_plate || without[1] < 0.1 * without[0]);
    }
}

/* Signed distance px of a pixel's centre to the plate's edge, along the picture, negative outside;
 * false where it is near no part of the edge's middle. Undistorted: the rays are compared, and a
 * metre on the plate is fx / depth pixels near the axis. */
static bool get_distance(const struct gn_rig_view *view, int x, int y, double *out)
{
    double dir[3];
    const double *m = view->world_from_camera;
    gn_rig_view_get_ray(view, x + 0.5, y + 0.5, dir);
    double t = (plate_height - m[11]) / dir[2];
    double at[2] = {m[3] + t * dir[0], m[7] + t * dir[1]};
    *out = (at[0] + plate_side) * view->fx / (m[11] - plate_height);
    return fabs(at[1]) < 0.6 * plate_side;
}

/* px from a tenth to nine tenths of the step across the edge, outside's level to the plate's. */
static double measure_edge(const struct gn_rig_view *view, const struct gn_image *picture)
{
    enum { BINS = 32, REACH = 4, FLAT = 6 };
    double sum[BINS] = {0}, count[BINS] = {0}, d, low = 0, high = 0, at[2] = {0};
    for (int i = 0; i < PIXELS; i++) {
        if (!get_distance(view, i % WIDTH, i / WIDTH, &d) || fabs(d) >= REACH)
            continue;
        int bin = (int)((d + REACH) * BINS / (2 * REACH));
        sum[bin] += (double)picture->data[3 * i];
        count[bin]++;
    }
    for (int i = 0; i < BINS; i++) {
        assert_true(count[i] > 0);
        sum[i] /= count[i];
    }
    for (int i = 0; i < FLAT; i++) {
        low += sum[i] / FLAT;
        high += sum[BINS - 1 - i] / FLAT;
    }
    assert_true(high > 1.5 * low);
    for (int k = 0; k < 2; k++) {
        double level = low + (k ? 0.9 : 0.1) * (high - low);
        int i = FLAT;
        while (i < BINS - FLAT && sum[i] < level)
            i++;
        at[k] = i - (sum[i] - level) / (sum[i] - sum[i - 1]);
    }
    return (at[1] - at[0]) * 2 * REACH / BINS;
}

static void test_edges(void **state)
{
    struct fixture *f = *state;
    const struct gn_response response = {.type = GN_RESPONSE_SRGB};
    const struct gn_composite_layers layers = get_layers(f);
    struct gn_image out;
    double truth = measure_edge(&f->view, &f->rig.mean[GN_RIG_TRUTH]), width[2];
    assert_int_equal(gn_image_init(&out, WIDTH, HEIGHT, 3), 0);
    for (int is_matched = 0; is_matched < 2; is_matched++) {
        set_match(f, is_matched);
        memset(f->options.match.noise_slope, 0, sizeof(f->options.match.noise_slope));
        memset(f->options.match.noise_offset, 0, sizeof(f->options.match.noise_offset));
        assert_int_equal(gn_compositor_put_linear(f->compositor, &layers,
                                                  &f->rig.mean[GN_RIG_BACKGROUND], &response,
                                                  &f->options, &out),
                         0);
        width[is_matched] = measure_edge(&f->view, &out);
    }
    printf("# edge from 10 to 90 %%: %.2f px photographed, %.2f matched, %.2f not\n", truth,
           width[1], width[0]);
    assert_true(fabs(width[1] / truth - 1) < 0.1);
    assert_true(width[0] < 0.6 * truth);
    gn_image_finish(&out);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_edges),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
