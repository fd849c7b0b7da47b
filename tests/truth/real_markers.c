/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Markers in real photographs (GNOMON_DATA, its README.md): those that others found are found;
 * OpenCV's corners are where they found them, to its own doubt; ours, laid along the edges in
 * linear light, make squares of the size that was printed.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "client/track/edges.h"
#include "client/track/pose_fit.h"
#include "client/track/search.h"
#include "client/vision/markers.h"
#include "common/file.h"
#include "common/image_file.h"
#include "common/jpeg.h"
#include "common/png.h"
#include "tests/real_data.h"

enum { MAX_FOUND = 128 };

/** A photograph in grey, and what was found in it. */
struct photo {
    struct gn_image8 grey;
    struct gn_camera camera;
    int n_found;
    struct gn_marker_sighting found[MAX_FOUND];
    int n_refined;
};

static char *read_text(const char *name)
{
    char path[PATH_MAX];
    char *text = NULL;
    size_t size = 0;
    assert_int_equal(gn_file_read_text(real_data_path(name, path), 64 << 20, &text, &size, NULL),
                     0);
    return text;
}

/** A binary PGM of 8 bits, without comments but those ViSP's have. */
static void read_pgm(const char *path, struct gn_image8 *out)
{
    FILE *f = fopen(path, "rb");
    int width = 0, height = 0, most = 0, c;
    assert_non_null(f);
    assert_int_equal(fgetc(f), 'P');
    assert_int_equal(fgetc(f), '5');
    while ((c = fgetc(f)) == '\n' || c == '#')
        while (c == '#' && (c = fgetc(f)) != '\n')
            c = '#';
    ungetc(c, f);
    assert_int_equal(fscanf(f, "%d %d %d", &width, &height, &most), 3);
    assert_int_equal(fgetc(f), '\n');
    assert_int_equal(gn_image8_init(out, width, height, 1), 0);
    assert_int_equal(fread(out->data, 1, (size_t)(width * height), f), width * height);
    fclose(f);
}

/** Any 8-bit picture as grey. */
static void read_grey(const char *name, struct gn_image8 *out)
{
    char path[PATH_MAX];
    real_data_path(name, path);
    size_t length = strlen(path);
    if (strcmp(path + length - 4, ".pgm") == 0) {
        read_pgm(path, out);
        return;
    }
    struct gn_image_file file = {0};
    struct gn_error error = {0};
    if (gn_image_read_file(path, &file, &error) < 0)
        fail_msg("%s", error.text);
    assert_int_equal(file.kind, GN_IMAGE_CODES8);
    const struct gn_image8 image = file.codes8;
    assert_int_equal(gn_image8_init(out, image.width, image.height, 1), 0);
    for (long i = 0; i < (long)image.width * image.height; i++) {
        const uint8_t *p = image.data + i * image.channels;
        out->data[i] =
            image.channels == 1 ? p[0] : (uint8_t)((77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8);
    }
    gn_image_file_finish(&file);
}

/** The photograph's camera; intrinsics fx, fy, cx, cy with pixel centres at whole numbers, as
 * others give them; NULL: a guess. */
static void guess_camera(const double *intrinsics, const double *distortion, struct photo *out)
{
    out->camera =
        (struct gn_camera){.width = out->grey.width,
                           .height = out->grey.height,
                           .fx = intrinsics ? intrinsics[0] : out->grey.width,
                           .fy = intrinsics ? intrinsics[1] : out->grey.width,
                           .cx = intrinsics ? intrinsics[2] + 0.5 : out->grey.width / 2.0,
                           .cy = intrinsics ? intrinsics[3] + 0.5 : out->grey.height / 2.0,
                           .response = {.type = GN_RESPONSE_SRGB},
                           .world_from_camera = {.rotation = {1, 0, 0, 0}}};
    if (distortion)
        memcpy(out->camera.distortion, distortion, sizeof(out->camera.distortion));
}

static void take(const char *name, const double *intrinsics, const double *distortion,
                 struct photo *out)
{
    memset(out, 0, sizeof(*out));
    read_grey(name, &out->grey);
    guess_camera(intrinsics, distortion, out);
}

static struct gn_grey get_grey(const struct photo *photo)
{
    struct gn_grey grey = {
        .pixels = photo->grey.data, .width = photo->grey.width, .height = photo->grey.height};
    for (int i = 0; i < 256; i++)
        grey.linear[i] = gn_response_decode(&photo->camera.response, (float)i / 255.0F);
    return grey;
}

/** Reads the picture and finds what the dictionary knows by OpenCV alone, corners by that
 * refinement of its, or by none and then our own. */
static void look(const char *name, const char *dictionary, enum gn_marker_refinement refinement,
                 const double *intrinsics, const double *distortion, struct photo *out)
{
    struct gn_marker_finder *finder = NULL;
    const struct gn_marker_finder_options options = {
        .dictionary = gn_marker_find_dictionary(dictionary, strlen(dictionary)),
        .refinement = refinement};
    uint8_t cells[GN_MARKER_MAX_CELLS * GN_MARKER_MAX_CELLS];
    take(name, intrinsics, distortion, out);
    const struct gn_grey grey = get_grey(out);
    assert_int_equal(gn_marker_finder_create(&options, &finder, NULL), 0);
    assert_int_equal(gn_marker_finder_find(finder, grey.pixels, grey.width, grey.height, NULL,
                                           MAX_FOUND, out->found, &out->n_found, NULL),
                     0);
    gn_marker_finder_destroy(&finder);
    int side = gn_marker_get_cells(options.dictionary, 0, cells);
    for (int i = 0; i < out->n_found && refinement == GN_MARKER_REFINE_NONE; i++)
        out->n_refined += gn_edges_refine(&grey, &out->camera, side, out->found[i].corners);
}

/** Finds the markers with these ids as the tracker does. */
static void search_for(int dictionary, const int *ids, int n_ids, struct photo *photo)
{
    static struct gn_search_finds finds;
    struct gn_search *search = NULL;
    const struct gn_grey grey = get_grey(photo);
    const struct gn_search_options options = {
        .camera = &photo->camera, .dictionary = dictionary, .ids = ids, .n_ids = n_ids};
    assert_int_equal(gn_search_create(&options, &search, NULL), 0);
    assert_int_equal(
        gn_search_find(search, &grey, NULL, GN_SEARCH_WHOLE | GN_SEARCH_SMALL, &finds, NULL), 0);
    gn_search_destroy(&search);
    assert_true(finds.n_found <= MAX_FOUND);
    photo->n_found = finds.n_found;
    memcpy(photo->found, finds.found, (size_t)finds.n_found * sizeof(*finds.found));
}

/** Reads the picture and finds the AprilTags with these ids. */
static void search(const char *name, const double *intrinsics, const int *ids, int n_ids,
                   struct photo *out)
{
    take(name, intrinsics, NULL, out);
    search_for(gn_marker_find_dictionary("apriltag_36h11", 14), ids, n_ids, out);
}

/** How far the corners of a found marker are from expected ones (pixel centres at whole numbers),
 * whichever comes first: the largest of the four. */
static double get_distance(const struct gn_marker_sighting *found, double expected[4][2])
{
    double largest = 0;
    for (int k = 0; k < 4; k++) {
        double nearest = INFINITY;
        for (int i = 0; i < 4; i++)
            nearest = fmin(nearest, hypot(found->corners[i][0] - 0.5 - expected[k][0],
                                          found->corners[i][1] - 0.5 - expected[k][1]));
        largest = fmax(largest, nearest);
    }
    return largest;
}

/** Sums up over what is expected. */
struct tally {
    int n_expected, n_found;
    double sum, largest;
};

static void expect(const struct photo *photo, int id, double corners[4][2], struct tally *t)
{
    double nearest = INFINITY;
    for (int i = 0; i < photo->n_found; i++)
        if (photo->found[i].id == id)
            nearest = fmin(nearest, get_distance(&photo->found[i], corners));
    t->n_expected++;
    if (nearest < 5) {
        t->n_found++;
        t->sum += nearest;
        t->largest = fmax(t->largest, nearest);
    } else {
        print_message("# marker %d near %.0f, %.0f is not found\n", id, corners[0][0],
                      corners[0][1]);
    }
}

static void say(const char *name, const struct photo *photo, const struct tally *t)
{
    print_message("# %s: %d of %d found, corners at most %.2f px off, %.2f on average; %d in "
                  "the picture\n",
                  name, t->n_found, t->n_expected, t->largest, t->sum / fmax(t->n_found, 1),
                  photo->n_found);
}

static void opencvs_six_markers_are_found_in_order(void **state)
{
    (void)state;
    struct photo photo;
    struct tally tally = {0};
    char *text = read_text("reference/opencv_singlemarkers_gold.txt");
    look("markers/opencv/singlemarkersoriginal.jpg", "6x6_250", GN_MARKER_REFINE_SUBPIX, NULL, NULL,
         &photo);
    for (char *line = strchr(text, '\n'); line && line[1]; line = strchr(line + 1, '\n')) {
        double c[4][2];
        int id = 0;
        if (sscanf(line, " %d: %lf,%lf %lf,%lf %lf,%lf %lf,%lf", &id, &c[0][0], &c[0][1], &c[1][0],
                   &c[1][1], &c[2][0], &c[2][1], &c[3][0], &c[3][1]) != 9)
            continue;
        expect(&photo, id, c, &tally);
        // From the top left, clockwise: the test's own order.
        for (int i = 0; i < photo.n_found; i++)
            for (int k = 0; k < 4 && photo.found[i].id == id; k++)
                assert_true(hypot(photo.found[i].corners[k][0] - 0.5 - c[k][0],
                                  photo.found[i].corners[k][1] - 0.5 - c[k][1]) < 1.5);
    }
    say("opencv", &photo, &tally);
    assert_int_equal(tally.n_expected, 6);
    assert_int_equal(tally.n_found, 6);
    assert_true(tally.largest < 1.5); // whole pixels there, to one in each axis
    gn_image8_finish(&photo.grey);
    free(text);
}

/** Reads "id: N ... corners: [ eight numbers ]" one after another. */
static void expect_yaml(const struct photo *photo, const char *name, struct tally *tally)
{
    char *text = read_text(name);
    for (char *at = strstr(text, "id:"); at; at = strstr(at, "id:")) {
        double c[8];
        int id = (int)strtol(at + 3, NULL, 10);
        at = strstr(at, "corners:");
        assert_non_null(at);
        for (int i = 0; i < 8; i++) {
            at += strcspn(at, "0123456789-");
            c[i] = strtod(at, &at);
        }
        double corners[4][2] = {{c[0], c[1]}, {c[2], c[3]}, {c[4], c[5]}, {c[6], c[7]}};
        expect(photo, id, corners, tally);
    }
    free(text);
}

static void arucos_own_photographs(void **state)
{
    (void)state;
    static const double intrinsics[4] = {628.158, 628.156, 324.099, 260.908};
    static const double distortion[5] = {0.0995485, -0.206384, 0.00754589, 0.00336531, 0};
    struct photo photo;
    struct tally single = {0}, board = {0};
    look("markers/paroj_aruco/single/image-test.png", "aruco_original", GN_MARKER_REFINE_SUBPIX,
         intrinsics, distortion, &photo);
    expect_yaml(&photo, "markers/paroj_aruco/single/expected.yml", &single);
    say("paroj single", &photo, &single);
    gn_image8_finish(&photo.grey);
    assert_int_equal(single.n_found, single.n_expected);
    assert_int_equal(single.n_expected, 6);
    assert_true(single.largest < 1.5);
    look("markers/paroj_aruco/board/image-test.png", "aruco_original", GN_MARKER_REFINE_SUBPIX,
         intrinsics, distortion, &photo);
    expect_yaml(&photo, "markers/paroj_aruco/board/expected.yml", &board);
    say("paroj board", &photo, &board);
    gn_image8_finish(&photo.grey);
    assert_true(board.n_expected > 15);
    assert_int_equal(board.n_found, board.n_expected);
}

/** By how much the corners of a board's markers are farther from their middles than the pose of all
 * of it, which leans on the known places of the markers, has them; px, on average. */
static double measure_swelling(enum gn_marker_refinement refinement)
{
    static const double intrinsics[4] = {628.158, 628.156, 324.099, 260.908};
    static const double distortion[5] = {0.0995485, -0.206384, 0.00754589, 0.00336531, 0};
    static double points[4 * MAX_FOUND][3], seen[4 * MAX_FOUND][2];
    struct photo photo;
    struct gn_pose_fit fits[2];
    double sum = 0;
    int n = 0;
    look("markers/paroj_aruco/board/image-test.png", "aruco_original", refinement, intrinsics,
         distortion, &photo);
    char *text = read_text("markers/paroj_aruco/board/board_meters.yml");
    for (char *at = strstr(text, "{ id:"); at; at = strstr(at, "{ id:")) {
        double c[12];
        int id = (int)strtol(at + 5, &at, 10);
        at = strstr(at, "corners:");
        for (int i = 0; i < 12; i++) {
            at += strcspn(at, "0123456789-");
            c[i] = strtod(at, &at);
        }
        for (int i = 0; i < photo.n_found; i++) {
            for (int k = 0; k < 4 && photo.found[i].id == id; k++, n++) {
                memcpy(points[n], c + 3 * k, sizeof(points[n]));
                memcpy(seen[n], photo.found[i].corners[k], sizeof(seen[n]));
            }
        }
    }
    assert_in_range(gn_pose_fit_points(&photo.camera, (const double(*)[3])points,
                                       (const double(*)[2])seen, n, 0.1, fits, NULL),
                    1, 2);
    for (int i = 0; i < n; i++) {
        double known[4][2], middle[2][2] = {{0}}, p[3];
        for (int k = 0; k < 4; k++) {
            gn_pose_transform(&fits[0].camera_from_body, points[i / 4 * 4 + k], p);
            assert_true(gn_camera_project(&photo.camera, p, known[k]));
            for (int a = 0; a < 2; a++) {
                middle[0][a] += known[k][a] / 4;
                middle[1][a] += seen[i / 4 * 4 + k][a] / 4;
            }
        }
        sum += hypot(seen[i][0] - middle[1][0], seen[i][1] - middle[1][1]) -
               hypot(known[i % 4][0] - middle[0][0], known[i % 4][1] - middle[0][1]);
    }
    gn_image8_finish(&photo.grey);
    free(text);
    return sum / n;
}

static void squares_have_the_printed_size(void **state)
{
    (void)state;
    double ours = measure_swelling(GN_MARKER_REFINE_NONE);
    double subpix = measure_swelling(GN_MARKER_REFINE_SUBPIX);
    double contour = measure_swelling(GN_MARKER_REFINE_CONTOUR);
    print_message("# board of 24 markers of 50 px: corners too far out by %.2f px by our edges, "
                  "%.2f by OpenCV's subpix, %.2f by its contours\n",
                  ours, subpix, contour);
    assert_true(fabs(ours) < 0.25);
}

static void visps_twelve_tags(void **state)
{
    (void)state;
    struct photo photo;
    struct tally tally = {0};
    char *text = read_text("markers/visp_apriltag/ground_truth_detection.txt");
    look("markers/visp_apriltag/AprilTag.pgm", "apriltag_36h11", GN_MARKER_REFINE_SUBPIX, NULL,
         NULL, &photo);
    for (char *at = strstr(text, "id:_"); at; at = strstr(at, "id:_")) {
        double c[4][2];
        int id = (int)strtol(at + 4, &at, 10);
        for (int i = 0; i < 8; i++)
            c[i / 2][1 - i % 2] = strtod(at, &at); // row, column
        expect(&photo, id, c, &tally);
    }
    say("visp", &photo, &tally);
    assert_int_equal(tally.n_expected, 12);
    assert_int_equal(tally.n_found, 12);
    gn_image8_finish(&photo.grey);
    free(text);
}

static void ubiquitys_marker_to_a_tenth(void **state)
{
    (void)state;
    static const double intrinsics[4] = {1006.126285753055, 1004.015433012594, 655.8639244150409,
                                         490.6140221242933};
    static const double distortion[5] = {0.1349735087283542, -0.2335869827451621,
                                         0.0006697030315075139, 0.004846737465872353, 0};
    double expected[4][2] = {{569.89917, 201.55890},
                             {777.42560, 206.85025},
                             {767.95856, 415.37830},
                             {565.75311, 409.24496}};
    struct photo photo;
    struct tally tally = {0};
    look("markers/ubiquity/tag_01_d7_14cm.png", "5x5_1000", GN_MARKER_REFINE_SUBPIX, intrinsics,
         distortion, &photo);
    expect(&photo, 1, expected, &tally);
    say("ubiquity", &photo, &tally);
    assert_int_equal(tally.n_found, 1);
    assert_true(tally.largest < 0.1);
    gn_image8_finish(&photo.grey);
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/** The corners of a tag of that side as a stored pose, 4 rows of 4, has them in the picture, pixel
 * centres at whole numbers: the AprilTag library, whose corners the poses fit, has them half a
 * pixel further. */
static void project_stored(const json_t *rows, double size, const double k[static 4],
                           double out[4][2])
{
    static const double signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int i = 0; i < 4; i++) {
        double p[3];
        for (size_t r = 0; r < 3; r++) {
            const json_t *row = json_array_get(rows, r);
            p[r] = signs[i][0] * size / 2 * json_number_value(json_array_get(row, 0)) +
                   signs[i][1] * size / 2 * json_number_value(json_array_get(row, 1)) +
                   json_number_value(json_array_get(row, 3));
        }
        out[i][0] = k[2] - 0.5 + k[0] * p[0] / p[2];
        out[i][1] = k[3] - 0.5 + k[1] * p[1] / p[2];
    }
}

static void stored_poses_of_visp_rbt_reproject(void **state)
{
    (void)state;
    static const double k[4] = {607.178466796875, 607.2342529296875, 321.39129638671875,
                                241.91822814941406};
    static double distances[1000], own[1000];
    int n = 0, n_own = 0, n_expected = 0;
    char *text = read_text("markers/visp_rbt/apriltag_data.json");
    json_t *root = json_loads(text, 0, NULL);
    assert_non_null(root);
    double size = json_number_value(json_object_get(root, "tag_size"));
    for (int frame = 0; frame <= 64; frame += 2) {
        char name[64];
        struct photo photo;
        snprintf(name, sizeof(name), "markers/visp_rbt/color_image_%04d.png", frame);
        json_t *tags = json_array_get(json_object_get(root, "detections"), (size_t)frame), *tag;
        const char *id;
        int ids[MAX_FOUND], n_ids = 0;
        json_object_foreach(tags, id, tag) ids[n_ids++] = atoi(id);
        search(name, k, ids, n_ids, &photo);
        json_object_foreach(tags, id, tag)
        {
            double corners[4][2];
            project_stored(json_object_get(tag, "cMo"), size, k, corners);
            n_expected++;
            double nearest = INFINITY;
            for (int i = 0; i < photo.n_found; i++)
                if (photo.found[i].id == atoi(id))
                    nearest = fmin(nearest, get_distance(&photo.found[i], corners));
            if (nearest < 20 && n < 1000)
                distances[n++] = nearest;
            else
                print_message("# %s: tag %s near %.0f, %.0f is not found (%.0f px)\n", name, id,
                              corners[0][0], corners[0][1], nearest);
        }
        // And our own poses of what we found.
        for (int i = 0; i < photo.n_found && n_own < 1000; i++) {
            double h = size / 2;
            const double square[4][3] = {{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
            struct gn_pose_fit fits[2];
            int n_fits =
                gn_pose_fit_points(&photo.camera, square,
                                   (const double(*)[2])photo.found[i].corners, 4, 0.1, fits, NULL);
            if (n_fits > 0)
                own[n_own++] = fits[0].rms_px;
        }
        gn_image8_finish(&photo.grey);
    }
    json_decref(root);
    free(text);
    qsort(distances, (size_t)n, sizeof(*distances), compare);
    qsort(own, (size_t)n_own, sizeof(*own), compare);
    print_message("# visp_rbt: %d of %d tags found; their stored poses reproject within %.2f px of "
                  "our corners (median), %.2f (90 %%); our own poses within %.2f RMS\n",
                  n, n_expected, distances[n / 2], distances[n * 9 / 10], own[n_own / 2]);
    assert_int_equal(n_expected, 281);
    assert_int_equal(n, n_expected);
    assert_true(distances[n / 2] < 0.6); // half a pixel in both axes would be 0.7 more
    assert_true(own[n_own / 2] < 1);
}

static void nasas_cubes(void **state)
{
    (void)state;
    static const char *const names[] = {"33369213973_9d9bb4cc96_c", "34085369442_304b6bafd9_c"};
    int ids[587]; // all there are; but for 0 they are nowhere
    struct tally tally = {0};
    for (int i = 0; i < 587; i++)
        ids[i] = i;
    for (int i = 0; i < 2; i++) {
        char name[128];
        struct photo photo;
        snprintf(name, sizeof(name), "markers/apriltag_nasa/%s.jpg", names[i]);
        search(name, NULL, ids, 2, &photo); // 1 is not there, so that nothing is left untried
        snprintf(name, sizeof(name), "markers/apriltag_nasa/%s.txt", names[i]);
        char *text = read_text(name);
        for (char *line = text; line && *line; line = strchr(line, '\n')) {
            double c[4][2];
            int id = 0;
            line += *line == '\n';
            if (sscanf(line, " %d, (%lf %lf), (%lf %lf), (%lf %lf), (%lf %lf)", &id, &c[0][0],
                       &c[0][1], &c[1][0], &c[1][1], &c[2][0], &c[2][1], &c[3][0], &c[3][1]) != 9)
                continue;
            // The AprilTag library, which found them, has pixel centres at half-integers too.
            for (int k = 0; k < 8; k++)
                c[k / 2][k % 2] -= 0.5;
            expect(&photo, id, c, &tally);
        }
        say(names[i], &photo, &tally);
        search_for(gn_marker_find_dictionary("apriltag_36h11", 14), ids, 587, &photo);
        assert_true(photo.n_found > 20);
        for (int k = 0; k < photo.n_found; k++)
            assert_int_equal(photo.found[k].id, 0);
        gn_image8_finish(&photo.grey);
        free(text);
    }
    assert_int_equal(tally.n_expected, 37);
    assert_int_equal(tally.n_found, 37);
    assert_true(tally.largest < 1.5); // many of theirs are whole pixels
}

/** A map of light as a camera would photograph it, its mean at middle grey. */
static void develop(const char *name, struct gn_image8 *out)
{
    static const struct gn_response srgb = {.type = GN_RESPONSE_SRGB};
    char path[PATH_MAX];
    struct gn_image_file file = {0};
    double sum = 0;
    assert_true(gn_image_read_file(real_data_path(name, path), &file, NULL) >= 0);
    const struct gn_image map = file.linear;
    long n = (long)map.width * map.height;
    for (long i = 0; i < n; i++)
        sum += log(1e-6 + (double)map.data[map.channels * i + 1]);
    double gain = 0.18 / exp(sum / (double)n);
    assert_int_equal(gn_image8_init(out, map.width, map.height, 1), 0);
    for (long i = 0; i < n; i++) {
        double light = fmin(fmax(gain * (double)map.data[map.channels * i + 1], 0), 1);
        out->data[i] = (uint8_t)lround(255 * (double)gn_response_encode(&srgb, (float)light));
    }
    gn_image_file_finish(&file);
}

static void nothing_where_there_are_no_markers(void **state)
{
    (void)state;
    static const char *const names[] = {
        "noon_grass",           "narrow_moonlit_road", "circus_arena", "drachenfels_cellar",
        "brown_photostudio_02", "rooitou_park",        "lebombo",      "studio_small_03",
        "venice_sunset"};
    static const char *const dictionaries[] = {"aruco_original", "apriltag_36h11", "4x4_50"};
    static int ids[1024];
    int n_found = 0;
    for (int i = 0; i < 1024; i++)
        ids[i] = i;
    for (size_t i = 0; i < GN_ARRAY_LEN(names); i++) {
        char name[128];
        struct photo photo = {0};
        snprintf(name, sizeof(name), "hdr/equirect/%s_1k.hdr", names[i]);
        develop(name, &photo.grey);
        guess_camera(NULL, NULL, &photo);
        for (size_t k = 0; k < GN_ARRAY_LEN(dictionaries); k++) {
            int dictionary = gn_marker_find_dictionary(dictionaries[k], strlen(dictionaries[k]));
            search_for(dictionary, ids, gn_marker_count_ids(dictionary), &photo);
            n_found += photo.n_found;
        }
        gn_image8_finish(&photo.grey);
    }
    print_message("# %d photographs without markers, any of three dictionaries: %d found\n",
                  (int)GN_ARRAY_LEN(names), n_found);
    assert_int_equal(n_found, 0);
}

int main(void)
{
    if (!gn_vision_is_built()) {
        puts("1..0 # SKIP this build has no OpenCV");
        return 0;
    }
    const struct CMUnitTest tests[] = {
        unit_test_with_real_data(opencvs_six_markers_are_found_in_order,
                                 "reference/opencv_singlemarkers_gold.txt"),
        unit_test_with_real_data(arucos_own_photographs, "markers/paroj_aruco/single/expected.yml"),
        unit_test_with_real_data(squares_have_the_printed_size,
                                 "markers/paroj_aruco/board/board_meters.yml"),
        unit_test_with_real_data(visps_twelve_tags,
                                 "markers/visp_apriltag/ground_truth_detection.txt"),
        unit_test_with_real_data(ubiquitys_marker_to_a_tenth,
                                 "markers/ubiquity/tag_01_d7_14cm.png"),
        unit_test_with_real_data(stored_poses_of_visp_rbt_reproject,
                                 "markers/visp_rbt/apriltag_data.json"),
        unit_test_with_real_data(nothing_where_there_are_no_markers,
                                 "hdr/equirect/noon_grass_1k.hdr"),
        unit_test_with_real_data(nasas_cubes, "markers/apriltag_nasa/33369213973_9d9bb4cc96_c.txt"),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
