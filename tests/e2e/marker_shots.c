/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Photographs of markers for tests: marker_shots MARKERS.json DIR N writes DIR/shot-00.png and so
 * on, and to standard output a line of JSON for each: where the camera and the second body are in
 * the first body's frame. Every fourth picture has no marker in it. Of the bodies the first two are
 * printed, each on one sheet.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/bodies.h"
#include "client/track/rotation.h"
#include "common/pose.h"
#include "common/png.h"
#include "tests/e2e/sheets.h"
#include "tests/rig/marker_picture.h"

enum { WIDTH = 320, HEIGHT = 240 };

static int shoot(struct gn_rig_marker_camera *camera, struct gn_rig_sheet *sheets, int n_sheets,
                 int frame, const char *dir)
{
    double t = frame, place[16], m[16];
    const double eye[3] = {0.35 * sin(t), -0.3 + 0.1 * cos(2 * t), 0.45 + 0.04 * sin(3 * t)};
    const double target[3] = {0.06, 0, 0};
    struct gn_pose world_from_camera, object = {.translation = {0.15, 0.02 * t - 0.05, 0}};
    gn_rig_look_at(eye, target, camera->view.world_from_camera);
    gn_rotation_exp((const double[3]){0, 0, 0.2 * t}, object.rotation);
    gn_pose_to_matrix(&object, place);
    memcpy(sheets[1].world_from_sheet, place, sizeof(place));
    gn_mat4_identity(sheets[0].world_from_sheet);
    struct gn_image linear = {0};
    struct gn_image8 codes = {0};
    const struct gn_rig_noise noise = {.slope = 1e-4, .offset = 2e-6};
    char path[4096];
    bool is_empty = frame % 4 == 3;
    snprintf(path, sizeof(path), "%s/shot-%02d.png", dir, frame);
    if (gn_pose_from_matrix(camera->view.world_from_camera, &world_from_camera, NULL) < 0 ||
        gn_rig_take_markers(camera, sheets, is_empty ? 0 : n_sheets, &linear) < 0 ||
        gn_image8_init(&codes, WIDTH, HEIGHT, 3) < 0)
        return 1;
    gn_rig_photograph(linear.data, WIDTH * HEIGHT, &noise, 3, frame, codes.data);
    int err = gn_png_write_file(path, &codes, NULL);
    printf("{\"empty\": %s, ", is_empty ? "true" : "false");
    gn_pose_to_matrix(&world_from_camera, m);
    gn_test_print_matrix("world_from_camera", m, ", ");
    gn_test_print_matrix("world_from_object", place, "}\n");
    gn_image_finish(&linear);
    gn_image8_finish(&codes);
    return err < 0;
}

int main(int argc, char *argv[])
{
    static struct gn_rig_sheet sheets[2];
    static struct gn_bodies bodies;
    const struct gn_rig_view view = {.width = WIDTH,
                                     .height = HEIGHT,
                                     .fx = 330,
                                     .fy = 330,
                                     .cx = 160,
                                     .cy = 120,
                                     .distortion = {-0.15, 0.05, 0.001, -0.001, 0},
                                     .blur_px = 0.5};
    struct gn_rig_marker_camera camera;
    struct gn_error error = {0};
    if (argc != 4 || gn_bodies_read_file(argv[1], &bodies, &error) < 0 || bodies.n_bodies < 2 ||
        gn_test_print_sheet(&bodies, 0, &sheets[0]) < 1 ||
        gn_test_print_sheet(&bodies, 1, &sheets[1]) < 1 ||
        gn_rig_marker_camera_init(&camera, &view) < 0) {
        fprintf(stderr, "marker_shots: %s\n", error.text);
        return 1;
    }
    int err = 0;
    for (int i = 0; !err && i < atoi(argv[3]); i++)
        err = shoot(&camera, sheets, 2, i, argv[2]);
    gn_rig_marker_camera_finish(&camera);
    gn_bodies_finish(&bodies);
    return err;
}
