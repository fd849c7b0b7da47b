/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Writes the pictures of marker_shots.h, and camera.json for them, into a folder.
 * usage: make_shots FOLDER one|board|none plain|cluttered
 */
#include <stdio.h>
#include <string.h>

#include "common/png.h"
#include "tests/bench/marker_shots.h"
#include "tests/bench/timing.h"

/** A round of the camera's swing. */
enum { N_SHOTS = 21 };

static int write_camera(const char *folder)
{
    const struct gn_rig_view *v = &gn_bench_lens;
    char path[4096];
    snprintf(path, sizeof(path), "%s/camera.json", folder);
    FILE *f = fopen(path, "w");
    if (!f)
        return -1;
    fprintf(f, "{\"width\": %d, \"height\": %d, \"fx\": %g, \"fy\": %g, \"cx\": %g, \"cy\": %g, ",
            v->width, v->height, v->fx, v->fy, v->cx, v->cy);
    fprintf(f, "\"distortion\": [%g, %g, %g, %g, %g], \"response\": {\"type\": \"srgb\"}}\n",
            v->distortion[0], v->distortion[1], v->distortion[2], v->distortion[3],
            v->distortion[4]);
    return fclose(f);
}

int main(int argc, char *argv[])
{
    static struct gn_bodies bodies;
    static struct gn_rig_sheet sheet;
    struct gn_rig_marker_camera rig;
    struct gn_error error = {0};
    if (argc != 4) {
        fprintf(stderr, "usage: make_shots FOLDER one|board|none plain|cluttered\n");
        return 2;
    }
    bool is_board = strcmp(argv[2], "board") == 0, is_none = strcmp(argv[2], "none") == 0;
    gn_bench_check(gn_rig_marker_camera_init(&rig, &gn_bench_lens), "lens");
    gn_bench_make_world(is_none    ? 0
                        : is_board ? 4
                                   : 1,
                        is_none    ? 0
                        : is_board ? 3
                                   : 1,
                        &bodies, &sheet);
    for (int i = 0; i < N_SHOTS; i++) {
        struct gn_image8 shot = {0};
        char path[4096];
        snprintf(path, sizeof(path), "%s/%02d.png", argv[1], i);
        gn_bench_shoot(&rig, &sheet, strcmp(argv[3], "cluttered") == 0, i, &shot);
        if (gn_png_write_file(path, &shot, &error) < 0) {
            fprintf(stderr, "make_shots: %s\n", error.text);
            return 1;
        }
        gn_image8_finish(&shot);
    }
    gn_rig_marker_camera_finish(&rig);
    gn_bodies_finish(&bodies);
    return write_camera(argv[1]) ? 1 : 0;
}
