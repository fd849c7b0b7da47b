/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Poses from photographs of markers against where the rig put them: lens, blur and noise included.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/rotation.h"
#include "client/track/tracker.h"
#include "client/vision/markers.h"
#include "common/png.h"
#include "tests/rig/marker_picture.h"
#include "tests/rig/random.h"
#include "tests/unit/cmocka_setup.h"

enum { WIDTH = 640, HEIGHT = 480 };

static const double degree = 3.14159265358979323846 / 180;
/** Photons and a sensor: 1.2 codes of noise in the middle greys. */
static const struct gn_rig_noise noise = {.slope = 1e-4, .offset = 2e-6};

/** A lens whose distortion moves the corners of the picture by some 13 px. */
static const struct gn_rig_view lens = {.width = WIDTH,
                                        .height = HEIGHT,
                                        .fx = 720,
                                        .fy = 716,
                                        .cx = 331.3,
                                        .cy = 234.8,
                                        .distortion = {-0.21, 0.11, 0.0012, -0.0007, -0.03},
                                        .blur_px = 0.6};

/** That lens; made by the first picture. */
static struct gn_rig_marker_camera rig_camera;

static struct gn_camera get_camera(void)
{
    struct gn_camera camera = {.width = WIDTH,
                               .height = HEIGHT,
                               .fx = lens.fx,
                               .fy = lens.fy,
                               .cx = lens.cx,
                               .cy = lens.cy,
                               .response = {.type = GN_RESPONSE_SRGB},
                               .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    memcpy(camera.distortion, lens.distortion, sizeof(camera.distortion));
    return camera;
}

static double draw(uint32_t seed, uint32_t index)
{
    uint32_t words[4];
    gn_rig_philox((const uint32_t[4]){index, seed, 0, 0}, (const uint32_t[2]){7, 11}, words);
    return words[0] * 0x1p-32;
}

/** A sheet with what the body has on it; all in one plane. */
static void print_sheet(const struct gn_bodies *bodies, int body, struct gn_rig_sheet *out)
{
    const struct gn_body *b = &bodies->bodies[body];
    double reach[2] = {0};
    memset(out, 0, sizeof(*out));
    gn_mat4_identity(out->world_from_sheet);
    for (int i = 0; i < b->n_markers; i++) {
        const double(*c)[3] = (const double(*)[3])b->markers[i].corners_body;
        struct gn_rig_printed *p = &out->printed[out->n_printed++];
        p->x = (c[0][0] + c[2][0]) / 2;
        p->y = (c[0][1] + c[2][1]) / 2;
        p->size = c[1][0] - c[0][0];
        p->cells = gn_marker_get_cells(bodies->dictionary, b->markers[i].id, p->white);
        assert_true(p->cells > 0);
        reach[0] = fmax(reach[0], fabs(p->x) + p->size * (0.5 + 1.5 / p->cells));
        reach[1] = fmax(reach[1], fabs(p->y) + p->size * (0.5 + 1.5 / p->cells));
    }
    out->half_width = reach[0];
    out->half_height = reach[1];
}

/** A camera 500 mm from the marker, `tilt` off its normal, the marker a little off the middle. */
static void place_camera(double tilt, double around, double roll, struct gn_pose *out)
{
    double eye[3] = {0.5 * sin(tilt) * cos(around), 0.5 * sin(tilt) * sin(around), 0.5 * cos(tilt)};
    const double target[3] = {0.012 * cos(roll), 0.01 * sin(roll), 0};
    double m[16];
    gn_rig_look_at(eye, target, m);
    assert_int_equal(gn_pose_from_matrix(m, out, NULL), 0);
    gn_rotation_turn(out->rotation, (const double[3]){0, 0, roll});
}

static void take(const struct gn_pose *world_from_camera, const struct gn_rig_sheet *sheets,
                 int n_sheets, struct gn_image *out_linear)
{
    if (!rig_camera.rays)
        assert_int_equal(gn_rig_marker_camera_init(&rig_camera, &lens), 0);
    gn_pose_to_matrix(world_from_camera, rig_camera.view.world_from_camera);
    assert_int_equal(gn_rig_take_markers(&rig_camera, sheets, n_sheets, out_linear), 0);
}

/** Photographs with that frame's noise and has the tracker look at it. */
static int look(struct gn_tracker *tracker, const struct gn_image *linear, int frame,
                int64_t time_ns)
{
    static uint8_t codes[WIDTH * HEIGHT * 3];
    struct gn_error error = {0};
    gn_rig_photograph(linear->data, WIDTH * HEIGHT, &noise, 5, frame, codes);
    const struct gn_capture capture = {.name = "rig",
                                       .width = WIDTH,
                                       .height = HEIGHT,
                                       .format = GN_CAPTURE_RGB8,
                                       .data = codes,
                                       .data_bytes = sizeof(codes)};
    int n = gn_tracker_update(tracker, &capture, time_ns, &error);
    if (n < 0)
        fail_msg("%s", error.text);
    return n;
}

static struct gn_tracker *create(const struct gn_bodies *bodies, bool is_raw)
{
    struct gn_tracker *tracker = NULL;
    struct gn_camera camera = get_camera();
    const struct gn_tracker_options options = {
        .camera = &camera, .bodies = bodies, .is_raw = is_raw};
    assert_int_equal(gn_tracker_create(&options, &tracker, NULL), 0);
    return tracker;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double get_median(double *values, int n)
{
    qsort(values, (size_t)n, sizeof(*values), compare);
    return values[n / 2];
}

static double get_distance(const struct gn_pose *a, const struct gn_pose *b)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += pow(a->translation[k] - b->translation[k], 2);
    return sqrt(sum);
}

struct errors {
    double m[64], rad[64], camera_m[64], expected_m[64];
    int n;
};

/** Still pictures from 500 mm, each on its own; what is drawn of the first goes to `name`. */
static void judge_stills(const char *text, const struct gn_bodies *bodies, int n, struct errors *e)
{
    struct gn_rig_sheet sheet;
    struct gn_tracker *tracker = create(bodies, true);
    print_sheet(bodies, 0, &sheet);
    e->n = 0;
    for (int i = 0; i < n; i++) {
        struct gn_pose world_from_camera, truth;
        struct gn_image linear = {0};
        place_camera((8 + 44 * draw(1, (uint32_t)i)) * degree, 360 * draw(2, (uint32_t)i) * degree,
                     360 * draw(3, (uint32_t)i) * degree, &world_from_camera);
        take(&world_from_camera, &sheet, 1, &linear);
        gn_pose_invert(&world_from_camera, &truth);
        if (look(tracker, &linear, i, i * INT64_C(2000000000)) == 1) {
            const struct gn_tracked_body *b = gn_tracker_get_body(tracker, 0);
            struct gn_pose camera;
            e->m[e->n] = get_distance(&b->camera_from_body, &truth);
            e->rad[e->n] = gn_rotation_get_angle(b->camera_from_body.rotation, truth.rotation);
            assert_true(gn_tracker_get_camera(tracker, 0, &camera));
            e->camera_m[e->n] = get_distance(&camera, &world_from_camera);
            e->expected_m[e->n++] = b->fit.error_m;
        }
        struct gn_image8 drawn = {0};
        if (i == 0 && getenv("GN_TEST_KEEP") && gn_tracker_draw(tracker, &drawn) == 0) {
            char path[512];
            snprintf(path, sizeof(path), "%s/%s.png", getenv("GN_TEST_KEEP"), text);
            assert_int_equal(gn_png_write_file(path, &drawn, NULL), 0);
        }
        gn_image8_finish(&drawn);
        gn_image_finish(&linear);
    }
    struct gn_tracker_counts counts;
    gn_tracker_get_counts(tracker, &counts);
    print_message("# %s at 500 mm: %d of %d seen, medians: marker %.3f mm (expected %.3f) and %.4f "
                  "degrees off, camera %.3f mm; largest %.3f mm; %d coarse corners\n",
                  text, e->n, n, 1e3 * get_median(e->m, e->n),
                  1e3 * get_median(e->expected_m, e->n), get_median(e->rad, e->n) / degree,
                  1e3 * get_median(e->camera_m, e->n), 1e3 * e->m[e->n - 1],
                  (int)counts.n_coarse_corners);
    gn_tracker_destroy(&tracker);
}

static void read_text(const char *text, struct gn_bodies *out)
{
    assert_int_equal(gn_bodies_read_text(text, out, NULL), 0);
}

static void a_marker_at_500_mm_is_where_it_is(void **state)
{
    (void)state;
    struct gn_bodies bodies;
    struct errors e;
    read_text("4x4_50:7:0.08", &bodies);
    judge_stills("4x4 marker of 80 mm", &bodies, 21, &e);
    assert_int_equal(e.n, 21);
    assert_true(get_median(e.m, e.n) < 0.5e-3);
    assert_true(get_median(e.rad, e.n) < 0.2 * degree);
    gn_bodies_finish(&bodies);
    read_text("apriltag_36h11:12:0.08", &bodies);
    judge_stills("36h11 marker of 80 mm", &bodies, 9, &e);
    assert_int_equal(e.n, 9);
    assert_true(get_median(e.m, e.n) < 0.5e-3);
    assert_true(get_median(e.rad, e.n) < 0.2 * degree);
    gn_bodies_finish(&bodies);
}

static int finish(void **state)
{
    (void)state;
    gn_rig_marker_camera_finish(&rig_camera);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_marker_at_500_mm_is_where_it_is),
    };
    return cmocka_run_group_tests(tests, NULL, finish);
}
