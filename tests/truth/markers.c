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

/** Picture i of those that are judged one by one. */
static void place_still(int i, struct gn_pose *out)
{
    place_camera((8 + 44 * draw(1, (uint32_t)i)) * degree, 360 * draw(2, (uint32_t)i) * degree,
                 360 * draw(3, (uint32_t)i) * degree, out);
}

static void take(const struct gn_pose *world_from_camera, const struct gn_rig_sheet *sheets,
                 int n_sheets, struct gn_image *out_linear)
{
    if (!rig_camera.rays)
        assert_int_equal(gn_rig_marker_camera_init(&rig_camera, &lens), 0);
    gn_pose_to_matrix(world_from_camera, rig_camera.view.world_from_camera);
    assert_int_equal(gn_rig_take_markers(&rig_camera, sheets, n_sheets, out_linear), 0);
}

/** One grey sensor's codes, three times each. */
static void photograph(const struct gn_image *linear, int frame, uint8_t *codes)
{
    static float grey[WIDTH * HEIGHT];
    static uint8_t once[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        grey[i] = linear->data[3 * i];
    gn_rig_photograph(grey, WIDTH * HEIGHT / 3, &noise, 5, frame, once);
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
        codes[i] = once[i / 3];
}

/** Photographs with that frame's noise and has the tracker look at it. */
static int look(struct gn_tracker *tracker, const struct gn_image *linear, int frame,
                int64_t time_ns)
{
    static uint8_t codes[WIDTH * HEIGHT * 3];
    struct gn_error error = {0};
    photograph(linear, frame, codes);
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
        place_still(i, &world_from_camera);
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
                  (int)counts.markers.n_coarse_corners);
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
    judge_stills("4x4 marker of 80 mm", &bodies, 15, &e);
    assert_int_equal(e.n, 15);
    assert_true(get_median(e.m, e.n) < 0.05e-3);
    assert_true(get_median(e.rad, e.n) < 0.05 * degree);
    gn_bodies_finish(&bodies);
    read_text("apriltag_36h11:12:0.08", &bodies);
    judge_stills("36h11 marker of 80 mm", &bodies, 5, &e);
    assert_int_equal(e.n, 5);
    assert_true(get_median(e.m, e.n) < 0.05e-3);
    assert_true(get_median(e.rad, e.n) < 0.05 * degree);
    gn_bodies_finish(&bodies);
}

/** Median distance of the marker's pose by OpenCV's own corners. */
static double judge_opencv(const struct gn_bodies *bodies, enum gn_marker_refinement refinement,
                           int n)
{
    struct gn_marker_finder *finder = NULL;
    const struct gn_marker_finder_options options = {.dictionary = bodies->dictionary,
                                                     .refinement = refinement};
    const struct gn_camera camera = get_camera();
    struct gn_rig_sheet sheet;
    double off[64];
    int n_seen = 0;
    static uint8_t codes[WIDTH * HEIGHT * 3], grey[WIDTH * HEIGHT];
    print_sheet(bodies, 0, &sheet);
    assert_int_equal(gn_marker_finder_create(&options, &finder, NULL), 0);
    for (int i = 0; i < n; i++) {
        struct gn_pose world_from_camera, truth;
        struct gn_image linear = {0};
        struct gn_marker_sighting seen[4];
        struct gn_pose_fit fits[2];
        int found = 0;
        place_still(i, &world_from_camera);
        take(&world_from_camera, &sheet, 1, &linear);
        gn_pose_invert(&world_from_camera, &truth);
        photograph(&linear, i, codes);
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            grey[k] = codes[3 * k + 1];
        assert_int_equal(
            gn_marker_finder_find(finder, grey, WIDTH, HEIGHT, NULL, 4, seen, &found, NULL), 0);
        if (found == 1 &&
            gn_pose_fit_points(&camera,
                               (const double(*)[3])bodies->bodies[0].markers[0].corners_body,
                               (const double(*)[2])seen[0].corners, 4, 0.1, fits, NULL) > 0)
            off[n_seen++] = get_distance(&fits[0].camera_from_body, &truth);
        gn_image_finish(&linear);
    }
    gn_marker_finder_destroy(&finder);
    assert_true(n_seen > n / 2);
    return get_median(off, n_seen);
}

static void our_corners_beat_opencvs(void **state)
{
    (void)state;
    static const char *const names[] = {"none", "subpix", "contour", "apriltag"};
    struct gn_bodies bodies;
    struct errors e;
    double best = INFINITY;
    read_text("4x4_50:7:0.08", &bodies);
    for (int r = GN_MARKER_REFINE_NONE; r <= GN_MARKER_REFINE_APRILTAG; r++) {
        double off = judge_opencv(&bodies, (enum gn_marker_refinement)r, 5);
        print_message("# with OpenCV's refinement \"%s\" the marker is %.3f mm off (median)\n",
                      names[r], 1e3 * off);
        best = fmin(best, off);
    }
    judge_stills("ours", &bodies, 5, &e);
    assert_true(get_median(e.m, e.n) < best / 50);
    gn_bodies_finish(&bodies);
}

/** A board of 4 x 3 markers, 174 mm wide. */
static void read_board(struct gn_bodies *out)
{
    FILE *f = fopen("markers-board.json", "w");
    assert_non_null(f);
    fputs("{\"dictionary\": \"6x6_250\", \"bodies\": [{\"name\": \"world\", \"grids\": "
          "[{\"columns\": "
          "4, \"rows\": 3, \"size\": 0.036, \"gap\": 0.01}]}]}",
          f);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(gn_bodies_read_file("markers-board.json", out, NULL), 0);
    remove("markers-board.json");
}

static void a_board_at_500_mm_is_where_it_is(void **state)
{
    (void)state;
    struct gn_bodies bodies;
    struct errors e;
    read_board(&bodies);
    judge_stills("board of 4 x 3", &bodies, 5, &e);
    assert_int_equal(e.n, 5);
    assert_true(get_median(e.m, e.n) < 0.03e-3);
    assert_true(get_median(e.rad, e.n) < 0.015 * degree);
    assert_true(get_median(e.camera_m, e.n) < 0.1e-3);
    gn_bodies_finish(&bodies);
}

/** The deviation from their mean of n translations, m, all axes together. */
static double get_jitter(double (*p)[3], int n)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double mean = 0;
        for (int i = 0; i < n; i++)
            mean += p[i][k] / n;
        for (int i = 0; i < n; i++)
            sum += pow(p[i][k] - mean, 2) / n;
    }
    return sqrt(sum);
}

/** Camera and marker at rest, 60 pictures a second, another noise in each. */
static void judge_rest(const char *text, const struct gn_bodies *bodies)
{
    enum { N = 90, BEGIN = 30 };
    static double marker[N][3], camera[N][3], measured[N][3];
    struct gn_tracker *tracker = create(bodies, false);
    struct gn_rig_sheet sheet;
    struct gn_pose world_from_camera, pose;
    struct gn_image linear = {0};
    print_sheet(bodies, 0, &sheet);
    place_camera(35 * degree, 1, 0.3, &world_from_camera);
    take(&world_from_camera, &sheet, 1, &linear);
    for (int i = 0; i < N; i++) {
        assert_int_equal(look(tracker, &linear, i, i * INT64_C(16666667)), 1);
        const struct gn_tracked_body *b = gn_tracker_get_body(tracker, 0);
        assert_true(gn_tracker_get_camera(tracker, 0, &pose));
        memcpy(marker[i], b->camera_from_body.translation, sizeof(marker[i]));
        memcpy(camera[i], pose.translation, sizeof(camera[i]));
        gn_pose_invert(&b->fit.camera_from_body, &pose);
        memcpy(measured[i], pose.translation, sizeof(measured[i]));
    }
    double still = get_jitter(camera + BEGIN, N - BEGIN);
    print_message("# %s at rest at 500 mm, 60 Hz: camera %.4f mm RMS (%.4f as measured), marker "
                  "%.4f mm\n",
                  text, 1e3 * still, 1e3 * get_jitter(measured + BEGIN, N - BEGIN),
                  1e3 * get_jitter(marker + BEGIN, N - BEGIN));
    assert_true(still < 0.05e-3);
    assert_true(get_jitter(marker + BEGIN, N - BEGIN) < 0.02e-3);
    gn_image_finish(&linear);
    gn_tracker_destroy(&tracker);
}

static void rest_is_still(void **state)
{
    (void)state;
    struct gn_bodies bodies;
    read_text("4x4_50:7:0.08", &bodies);
    judge_rest("marker of 80 mm", &bodies);
    gn_bodies_finish(&bodies);
}

/** The camera's place on a hand's way around the marker, half a metre from it. */
static void move_camera(double time_s, struct gn_pose *out)
{
    double s = 0.5 - 0.5 * cos(2.5 * time_s);
    place_camera((30 + 12 * s) * degree, 1 + 0.3 * s, 0.1 * s, out);
}

static void motion_lags_little(void **state)
{
    (void)state;
    enum { N = 46, RATE = 30 };
    static double answers[N][3];
    struct gn_bodies bodies;
    struct gn_rig_sheet sheet;
    struct gn_pose pose;
    read_text("4x4_50:7:0.08", &bodies);
    print_sheet(&bodies, 0, &sheet);
    struct gn_tracker *tracker = create(&bodies, false);
    for (int i = 0; i < N; i++) {
        struct gn_image linear = {0};
        move_camera((double)i / RATE, &pose);
        take(&pose, &sheet, 1, &linear);
        assert_int_equal(look(tracker, &linear, i, i * INT64_C(1000000000) / RATE), 1);
        assert_true(gn_tracker_get_camera(tracker, 0, &pose));
        memcpy(answers[i], pose.translation, sizeof(answers[i]));
        gn_image_finish(&linear);
    }
    // The delay of the truth that fits the answers best.
    double best = INFINITY, lag_s = 0;
    for (double shift_s = -0.02; shift_s < 0.15; shift_s += 0.0005) {
        double sum = 0;
        for (int i = 10; i < N; i++) {
            move_camera((double)i / RATE - shift_s, &pose);
            for (int k = 0; k < 3; k++)
                sum += pow(answers[i][k] - pose.translation[k], 2);
        }
        if (sum < best) {
            best = sum;
            lag_s = shift_s;
        }
    }
    struct gn_tracker_counts counts;
    gn_tracker_get_counts(tracker, &counts);
    print_message(
        "# a hand-held camera, 30 Hz: %.1f ms late (its own count %.1f), then %.3f mm RMS "
        "off\n",
        1e3 * lag_s, 1e3 * counts.moving_lag_s / (double)counts.n_moving,
        1e3 * sqrt(best / (N - 10)));
    assert_true(lag_s < 0.03 && lag_s >= 0);
    gn_tracker_destroy(&tracker);
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
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_marker_at_500_mm_is_where_it_is),
        cmocka_unit_test(our_corners_beat_opencvs),
        cmocka_unit_test(a_board_at_500_mm_is_where_it_is),
        cmocka_unit_test(rest_is_still),
        cmocka_unit_test(motion_lags_little),
    };
    return cmocka_run_group_tests(tests, NULL, finish);
}
