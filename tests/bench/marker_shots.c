/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/marker_shots.h"

#include <math.h>
#include <string.h>

#include "client/vision/markers.h"
#include "common/pose.h"
#include "tests/bench/timing.h"
#include "tests/rig/random.h"

const struct gn_rig_view gn_bench_lens = {.width = GN_BENCH_SHOT_WIDTH,
                                          .height = GN_BENCH_SHOT_HEIGHT,
                                          .fx = 720,
                                          .fy = 716,
                                          .cx = 331.3,
                                          .cy = 234.8,
                                          .distortion = {-0.21, 0.11, 0.0012, -0.0007, -0.03},
                                          .blur_px = 0.6};

/** Blotches from 4 to 64 px, as dark and as light as the markers. */
static void clutter(struct gn_image *linear)
{
    for (int y = 0; y < GN_BENCH_SHOT_HEIGHT; y++) {
        for (int x = 0; x < GN_BENCH_SHOT_WIDTH; x++) {
            float *p = gn_image_at(linear, x, y);
            if (fabsf(p[0] - (float)gn_rig_backdrop) > 1e-3F)
                continue;
            double sum = 0;
            for (uint32_t size = 4; size <= 64; size *= 2) {
                uint32_t out[4];
                gn_rig_philox((const uint32_t[4]){(uint32_t)x / size, (uint32_t)y / size, size, 0},
                              (const uint32_t[2]){3, 1}, out);
                sum += out[0] * 0x1p-32;
            }
            p[0] = p[1] = p[2] = (float)(0.8 * pow(sum / 5, 3));
        }
    }
}

void gn_bench_shoot(const struct gn_rig_marker_camera *still, const struct gn_rig_sheet *sheet,
                    bool is_cluttered, int i, struct gn_image8 *out)
{
    struct gn_rig_marker_camera camera = *still;
    struct gn_image linear = {0};
    double s = 0.02 * sin(0.3 * i);
    const double eye[3] = {0.25 + s, -0.2, 0.38 + s}, target[3] = {0.01 + s, 0, 0};
    const struct gn_rig_noise noise = {.slope = 1e-4, .offset = 2e-6};
    gn_rig_look_at(eye, target, camera.view.world_from_camera);
    gn_bench_check(gn_rig_take_markers(&camera, sheet, sheet->n_printed > 0, &linear), "picture");
    if (is_cluttered)
        clutter(&linear);
    gn_bench_check(gn_image8_init(out, GN_BENCH_SHOT_WIDTH, GN_BENCH_SHOT_HEIGHT, 3), "picture");
    gn_rig_photograph(linear.data, GN_BENCH_SHOT_WIDTH * GN_BENCH_SHOT_HEIGHT, &noise, 3, i,
                      out->data);
    gn_image_finish(&linear);
}

void gn_bench_make_world(int columns, int n_rows, struct gn_bodies *bodies,
                         struct gn_rig_sheet *sheet)
{
    gn_bench_check(gn_bodies_read_text("6x6_250:0:0.08", bodies, NULL), "bodies");
    struct gn_body *b = &bodies->bodies[0];
    memset(sheet, 0, sizeof(*sheet));
    gn_mat4_identity(sheet->world_from_sheet);
    sheet->half_width = columns > 1 ? 0.1 : 0.06;
    sheet->half_height = columns > 1 ? 0.08 : 0.06;
    for (int i = 0; i < columns * n_rows; i++) {
        struct gn_rig_printed *p = &sheet->printed[sheet->n_printed++];
        *p = (struct gn_rig_printed){.x = (i % columns - (columns - 1) / 2.0) * 0.046,
                                     .y = ((n_rows - 1) / 2.0 - i / columns) * 0.046,
                                     .size = columns > 1 ? 0.036 : 0.08};
        p->cells = gn_marker_get_cells(bodies->dictionary, i, p->white);
        b->markers[i].id = i;
        for (int k = 0; k < 4; k++) {
            b->markers[i].corners_body[k][0] = p->x + (k == 1 || k == 2 ? 0.5 : -0.5) * p->size;
            b->markers[i].corners_body[k][1] = p->y + (k < 2 ? 0.5 : -0.5) * p->size;
        }
    }
    b->n_markers = columns * n_rows > 0 ? columns * n_rows : 1;
}
