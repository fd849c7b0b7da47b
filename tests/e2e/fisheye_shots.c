/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Photographs of markers through a fisheye for tests: fisheye_shots MARKERS.json DIR writes into
 * DIR near-N.png (a probe that looks past the markers of the first two bodies), up-N.png (one on
 * the table that looks up and sees the second body alone), both in 12-bit log codes with noise, and
 * cam-N.png (a camera that sees both bodies), slid-0.png and turned-0.png (the second one moved, or
 * turned in its place); a lamp
 * shines from far; probe.json (response alone) and camera.json. To standard output the true poses,
 * as matrices. The first body lies on the table, the second stands.
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
#include "tests/rig/random.h"
#include "tests/rig/sensor.h"

enum { SIZE = 480, SHOTS = 2, WIDTH = 640, HEIGHT = 480 };

static const double degree = 3.14159265358979323846 / 180;
static const struct gn_rig_fisheye lens = {.width = SIZE,
                                           .height = SIZE,
                                           .center = {244.1, 238.4},
                                           .focal = 145,
                                           .theta_max = 90 * degree,
                                           .blur_px = 0.5};
static const struct gn_rig_view pinhole = {.width = WIDTH,
                                           .height = HEIGHT,
                                           .fx = 600,
                                           .fy = 600,
                                           .cx = 320,
                                           .cy = 240,
                                           .distortion = {-0.15, 0.05, 0.001, -0.001, 0},
                                           .blur_px = 0.5};

/** The way to the lamp, its radius and radiance: below the sensor's largest. */
static const double lamp[3] = {-0.291386, 0.388514, 0.874157}, lamp_rad = 3 * degree,
                    lamp_light = 25;

static struct gn_rig_sheet sheets[2];

static void light_lamp(const struct gn_rig_marker_camera *fisheye, struct gn_image *linear)
{
    const double *m = fisheye->view.world_from_camera;
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            const double *ray = fisheye->rays + 3 * ((2 * y + 1) * (2 * SIZE + 1) + 2 * x + 1);
            double cosine = 0;
            for (int k = 0; k < 9; k++)
                cosine += lamp[k / 3] * m[4 * (k / 3) + k % 3] * ray[k % 3];
            if (cosine > cos(lamp_rad))
                *gn_image_at(linear, x, y) = (float)lamp_light;
        }
}

/** 12-bit log codes with noise of two of them. */
static int write_codes(const char *path, const struct gn_image *linear, uint32_t seed,
                       const struct gn_rig_log_sensor *sensor)
{
    struct gn_image16 codes = {0};
    if (gn_image16_init(&codes, SIZE, SIZE, 1) < 0)
        return -1;
    for (int i = 0; i < SIZE * SIZE; i++) {
        uint32_t w[4];
        gn_rig_philox((const uint32_t[4]){(uint32_t)i, seed, 0, 0}, (const uint32_t[2]){17, 3}, w);
        double noise = 4 * (w[0] * 0x1p-32 + w[1] * 0x1p-32 + w[2] * 0x1p-32 - 1.5); // deviation 2
        double code = gn_rig_encode_log12(sensor, (double)linear->data[3 * i]) + round(noise);
        codes.data[i] = (uint16_t)fmin(fmax(code, 0), 4095);
    }
    int err = gn_png_write_file16(path, &codes, NULL);
    gn_image16_finish(&codes);
    return err;
}

static int shoot_probe(struct gn_rig_marker_camera *fisheye, const char *dir, const char *name,
                       const struct gn_pose *world_from_probe)
{
    const struct gn_rig_log_sensor sensor = gn_rig_make_log_sensor(0.3, 30);
    double m[16];
    int err = 0;
    struct gn_image linear;
    gn_pose_to_matrix(world_from_probe, m);
    memcpy(fisheye->view.world_from_camera, m, sizeof(m));
    if (gn_rig_take_markers(fisheye, sheets, 2, &linear) < 0)
        return -1;
    light_lamp(fisheye, &linear);
    for (int i = 0; i < SHOTS && !err; i++) {
        char path[4096];
        snprintf(path, sizeof(path), "%s/%s-%d.png", dir, name, i);
        err = write_codes(path, &linear, (uint32_t)(100 * strlen(name) + (size_t)i), &sensor);
    }
    gn_image_finish(&linear);
    gn_test_print_matrix(name, m, ",\n");
    char path[4096];
    snprintf(path, sizeof(path), "%s/probe.json", dir);
    FILE *out = fopen(path, "w");
    if (!out)
        return -1;
    fprintf(out,
            "{\"pixel_format\": \"log12\", \"response\": {\"type\": \"log\", \"a\": %.17g, "
            "\"b\": %.17g, \"c\": %.17g}}\n",
            sensor.a, sensor.b, sensor.c);
    return fclose(out) | err;
}

static int shoot_camera(const char *dir, const char *name, int n)
{
    static const struct gn_rig_noise noise = {.slope = 1e-4, .offset = 2e-6};
    struct gn_rig_marker_camera camera;
    struct gn_image linear;
    struct gn_image8 codes;
    char path[4096];
    int err =
        gn_rig_marker_camera_init(&camera, &pinhole) | gn_image8_init(&codes, WIDTH, HEIGHT, 3);
    for (int i = 0; i < n && !err; i++) {
        const double eye[3] = {0.25 * i - 0.2, -0.4, 0.4 + 0.05 * i}, target[3] = {0, 0.1, 0.05};
        gn_rig_look_at(eye, target, camera.view.world_from_camera);
        err = gn_rig_take_markers(&camera, sheets, 2, &linear);
        if (err)
            break;
        gn_rig_photograph(linear.data, WIDTH * HEIGHT, &noise, 3, i, codes.data);
        snprintf(path, sizeof(path), "%s/%s-%d.png", dir, name, i);
        err = gn_png_write_file(path, &codes, NULL);
        gn_image_finish(&linear);
    }
    gn_rig_marker_camera_finish(&camera);
    gn_image8_finish(&codes);
    snprintf(path, sizeof(path), "%s/camera.json", dir);
    FILE *out = err ? NULL : fopen(path, "w");
    if (!out)
        return -1;
    fprintf(out,
            "{\"width\": %d, \"height\": %d, \"fx\": 600, \"fy\": 600, \"cx\": 320, \"cy\": 240, "
            "\"distortion\": [-0.15, 0.05, 0.001, -0.001, 0]}\n",
            WIDTH, HEIGHT);
    return fclose(out);
}

int main(int argc, char *argv[])
{
    static struct gn_bodies bodies;
    struct gn_rig_marker_camera fisheye;
    struct gn_error error = {0};
    if (argc != 3 || gn_bodies_read_file(argv[1], &bodies, &error) < 0 || bodies.n_bodies < 2 ||
        gn_test_print_sheet(&bodies, 0, &sheets[0]) < 1 ||
        gn_test_print_sheet(&bodies, 1, &sheets[1]) < 1 ||
        gn_rig_marker_fisheye_init(&fisheye, &lens) < 0) {
        fprintf(stderr, "fisheye_shots: %s\n", error.text);
        return 1;
    }
    struct gn_pose standing = {.translation = {0.01, 0.25, 0.12}}, near, up, turn = {0};
    double m[16];
    gn_rotation_exp((const double[3]){75 * degree, 0.05, -0.1}, standing.rotation);
    gn_mat4_identity(sheets[0].world_from_sheet);
    gn_pose_to_matrix(&standing, sheets[1].world_from_sheet);
    // 35 to 60 degrees off the axis, and turned about it.
    gn_rig_look_at((const double[3]){0.1, -0.2, 0.3}, (const double[3]){-0.2, 0.2, 0.35}, m);
    int err = gn_pose_from_matrix(m, &near, NULL);
    gn_rotation_exp((const double[3]){0, 0, 0.7}, turn.rotation);
    gn_pose_multiply(&near, &turn, &near);
    up = (struct gn_pose){.translation = {0.03, -0.02, 0.03}};
    gn_rotation_exp((const double[3]){0.06, -0.04, 1.1}, up.rotation);
    printf("{");
    err = err || shoot_probe(&fisheye, argv[2], "near", &near) ||
          shoot_probe(&fisheye, argv[2], "up", &up) || shoot_camera(argv[2], "cam", SHOTS);
    gn_pose_to_matrix(&standing, m);
    gn_test_print_matrix("standing", m, "}\n");
    struct gn_pose elsewhere = standing;
    elsewhere.translation[0] += 0.05;
    gn_pose_to_matrix(&elsewhere, sheets[1].world_from_sheet);
    err = err || shoot_camera(argv[2], "slid", 1);
    gn_rotation_exp((const double[3]){70 * degree, 0.1, 0.1}, standing.rotation);
    gn_pose_to_matrix(&standing, sheets[1].world_from_sheet);
    err = err || shoot_camera(argv[2], "turned", 1);
    gn_rig_marker_camera_finish(&fisheye);
    gn_bodies_finish(&bodies);
    return err != 0;
}
