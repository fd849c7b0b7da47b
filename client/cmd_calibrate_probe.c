/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate probe: where a fisheye looks and where its circle is; where a mirror ball is.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "client/calibrate/device_file.h"
#include "client/calibrate/draw.h"
#include "client/calibrate/fisheye.h"
#include "client/calibrate/spots.h"
#include "client/calibrate_input.h"
#include "client/calibrate_lamps.h"
#include "client/calibrate_live.h"
#include "client/cmd.h"
#include "common/device_json.h"
#include "common/image.h"
#include "common/png.h"
#include "proto/attr.h"

#define MAX_PICTURES 64
#define MAX_CANDIDATES 2048
/* A ball mirrors the camera in its middle, as large as the camera seems from the ball. */
#define DEFAULT_CAMERA_SHARE 0.12
/* theta = 2 asin r at 95 % of the radius, behind which directions crowd. */
#define BALL_THETA_MAX 2.5

static const struct gn_option option_table[] = {
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "The probe's pictures: a folder, a file or a pattern; the probe at rest."},
    GN_CALIBRATE_LIVE_OPTIONS,
    {.key = "frames",
     .flag = "frames",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 10000,
     .value_name = "N",
     .help = "Camera or video: take the mean of so many pictures; default 1. In the lamps' file "
             "it is called camera."},
    {.key = "out",
     .flag = "out",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .is_required = true,
     .help = "probe.json. What it says already (projection, response) is used, and stays."},
    {.key = "projection",
     .flag = "projection",
     .type = GN_OPTION_ENUM,
     .choices = GN_PROJECTION_NAMES,
     .value_name = "NAME",
     .help = "What the pictures are, where FILE does not say."},
    {.key = "theta-max",
     .flag = "theta-max",
     .type = GN_OPTION_DOUBLE,
     .min = 5,
     .max = 180,
     .value_name = "DEGREES",
     .help = "Angle from the axis at the circle's rim; 90 for a fisheye of 180 degrees."},
    {.key = "find-circle",
     .flag = "find-circle",
     .type = GN_OPTION_BOOL,
     .help = "Find the fisheye's image circle: the outline of the picture in its dark surround."},
    {.key = "ball",
     .flag = "ball",
     .type = GN_OPTION_STRING,
     .value_name = "X,Y,R",
     .help = "Find the mirror ball near this circle, in px. Its rim (beyond 95 % of the radius) is "
             "left out, and the camera's own reflection masked."},
    {.key = "camera-share",
     .flag = "camera-share",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 0.9,
     .value_name = "SHARE",
     .help = "Radius of the camera's reflection in radii of the ball. Default 0.12."},
    {.key = "lamps",
     .flag = "lamps",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Lamps of known direction, a line for each: NAME X Y Z, NAME the picture's file (or * "
             "for all), X Y Z the way from the probe to the lamp in the marker's frame, of any "
             "length. Two directions at least; which spot is which lamp is found."},
    {.key = "fit",
     .flag = "fit",
     .type = GN_OPTION_SET,
     .choices = "center|radius|lens",
     .default_value = "none",
     .help = "What of the lens to fit with the orientation; needs more lamps, near the middle and "
             "near the rim. lens: a Kannala-Brandt polynomial."},
    {.key = "share",
     .flag = "share",
     .type = GN_OPTION_DOUBLE,
     .min = 0.01,
     .max = 0.99,
     .default_value = "0.2",
     .value_name = "SHARE",
     .help = "A lamp's pixels are above this share of the picture's largest light."},
    {.key = "tolerance",
     .flag = "tolerance",
     .type = GN_OPTION_DOUBLE,
     .min = 0.1,
     .max = 30,
     .default_value = "4",
     .value_name = "DEGREES",
     .help = "How far spots may lie from their lamps when they are matched."},
    {.key = "full-scale",
     .flag = "full-scale",
     .type = GN_OPTION_INT,
     .min = 255,
     .max = 65535,
     .value_name = "CODE",
     .help = "Largest code of 16-bit files. Default 4095 where FILE says log12, else 65535."},
    {.key = "picture",
     .flag = "picture",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "A PNG of the first picture with what was found: circle, mask, spots (green) and "
             "where their lamps fall (red)."},
};

static const struct gn_program program = {
    .name = "gnomon calibrate probe",
    .usage = "--files PATTERN | --video FILE | --gige ID | --v4l2 DEVICE "
             "--out probe.json [OPTION]...",
    .summary = "Measures a light probe: a fisheye's circle, lens and orientation against the "
               "marker, or a mirror ball's place in its picture.",
    .notes = "Examples:\n"
             "  gnomon calibrate probe --files 'lamp*.png' --find-circle \\\n"
             "      --projection fisheye-equidistant --lamps lamps.txt --out probe.json\n"
             "  gnomon calibrate probe --files ball.png --projection mirrorball \\\n"
             "      --ball 320,240,150 --out probe.json --picture ball-found.png\n"
             "  gnomon calibrate probe --gige any --frames 16 --find-circle \\\n"
             "      --projection fisheye-equidistant --out probe.json\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

struct run {
    const struct gn_options *options;
    struct gn_probe_setup setup;
    struct gn_file_list list;
    struct gn_lamp lamps[GN_LAMPS_MAX];
    int n_lamps;
    struct gn_fisheye_puzzle candidates[MAX_CANDIDATES];
    struct gn_fisheye_sighting sightings[MAX_CANDIDATES];
    int n_candidates, n_sightings;
    struct gn_fisheye_fit fit;
    struct gn_image first; // codes, 1 channel: for circle, ball and picture
    double step;
    double mask[3]; // x, y, radius; radius 0: none
};

static const char *get(const struct run *run, const char *key)
{
    return gn_options_get_string(run->options, NULL, NULL, key);
}

static bool has(const struct run *run, const char *key)
{
    return gn_options_is_set(run->options, NULL, NULL, key);
}

static int read_setup(struct run *run, struct gn_error *out_error)
{
    const char *path = get(run, "out");
    gn_probe_setup_init(&run->setup);
    bool has_file = access(path, F_OK) == 0;
    struct gn_json root = {0};
    int err = has_file ? gn_json_load_file(path, &root, out_error) : 0;
    bool has_projection = !err && has_file && gn_json_has(&root, "projection");
    if (!err && has_projection)
        err = gn_probe_setup_read_json(&root, &run->setup, out_error);
    else if (!err && has_file)
        err = gn_response_read_json(&root, &run->setup.response, out_error);
    gn_json_finish(&root);
    if (err)
        return err;
    if (has(run, "projection"))
        run->setup.projection.type =
            (enum gn_projection_type)gn_options_get_enum(run->options, NULL, NULL, "projection");
    else if (!has_projection)
        return gn_error_set(out_error, -EINVAL,
                            "%s says no projection: give --projection, for example "
                            "fisheye-equidistant or mirrorball",
                            path);
    run->setup.projection.focal = 0; // follows from radius, theta_max and model, which may change
    if (has(run, "theta-max"))
        run->setup.projection.theta_max =
            fmin(gn_options_get_double(run->options, NULL, NULL, "theta-max") *
                     (3.14159265358979323846 / 180),
                 GN_PROJECTION_MAX_THETA);
    if (!gn_projection_is_radial(run->setup.projection.type))
        return gn_error_set(out_error, -EINVAL,
                            "a %s picture has no circle and nothing to calibrate",
                            gn_projection_get_name(run->setup.projection.type));
    return 0;
}

/* The mean of a camera's or video's pictures. */
static int take_picture(struct run *run, struct gn_image *out, struct gn_error *out_error)
{
    const struct gn_projection *p = &run->setup.projection;
    const struct gn_live_options wanted = {.width = p->width, .height = p->height};
    struct gn_source *source = NULL;
    int n = has(run, "frames") ? (int)gn_options_get_int(run->options, NULL, NULL, "frames") : 1;
    int full_scale = has(run, "full-scale")
                         ? (int)gn_options_get_int(run->options, NULL, NULL, "full-scale")
                         : 0;
    gn_cmd_catch_signals();
    int err = gn_calibrate_open(run->options, &wanted, &source, out_error);
    if (!err)
        err = gn_calibrate_take_mean(&program, source, n, full_scale, out, &run->step, out_error);
    gn_source_close(&source);
    return err;
}

static int read_picture(struct run *run, int i, struct gn_image *out, struct gn_error *out_error)
{
    const char *path = run->list.entries[i].path;
    struct gn_calibrate_format format = {.full_scale16 = run->setup.is_12_bit ? 4095 : 65535};
    if (has(run, "full-scale"))
        format.full_scale16 = gn_options_get_int(run->options, NULL, NULL, "full-scale");
    int err = gn_calibrate_is_live(run->options)
                  ? take_picture(run, out, out_error)
                  : gn_calibrate_read(path, &format, out, &run->step, out_error);
    struct gn_projection *p = &run->setup.projection;
    if (!err && p->width == 0 && p->height == 0) {
        p->width = out->width;
        p->height = out->height;
    }
    if (!err && (p->width != out->width || p->height != out->height)) {
        err = gn_error_set(out_error, -EINVAL,
                           "%s: %d x %d, but the probe's pictures are %d x %d: calibrate with "
                           "pictures of the mode that the probe runs in",
                           path, out->width, out->height, p->width, p->height);
        gn_image_finish(out);
    }
    return err;
}

/* One channel: codes' mean, or light's luminance. */
static int make_gray(const struct run *run, const struct gn_image *image, bool is_light,
                     struct gn_image *out)
{
    long n = (long)image->width * image->height;
    int err = gn_image_init(out, image->width, image->height, 1);
    for (long i = 0; !err && i < n; i++) {
        const float *p = image->data + i * image->channels;
        float rgb[3] = {p[0], p[image->channels == 3 ? 1 : 0], p[image->channels == 3 ? 2 : 0]};
        if (is_light && run->step > 0)
            gn_response_to_radiance(&run->setup.response, rgb, 1);
        out->data[i] = is_light ? 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2]
                                : (rgb[0] + rgb[1] + rgb[2]) / 3;
    }
    return err;
}

static int find_circle(struct run *run, struct gn_error *out_error)
{
    struct gn_circle circle;
    struct gn_projection *p = &run->setup.projection;
    int err = 0;
    if (has(run, "ball")) {
        double xyr[3];
        int n = gn_calibrate_read_numbers("ball", get(run, "ball"), 0, 3, xyr, out_error);
        if (n >= 0 &&
            (n != 3 || !(xyr[2] > 5 && xyr[2] <= GN_IMAGE_MAX_SIDE &&
                         fabs(xyr[0]) <= GN_IMAGE_MAX_SIDE && fabs(xyr[1]) <= GN_IMAGE_MAX_SIDE)))
            n = gn_error_set(out_error, -EINVAL,
                             "--ball: right would be X,Y,RADIUS in px, the radius above 5, none "
                             "above %d",
                             GN_IMAGE_MAX_SIDE);
        if (n < 0)
            return n;
        struct gn_circle guess = {{xyr[0], xyr[1]}, xyr[2], 0, 0};
        err = gn_circle_find_ball(&run->first, &guess, &circle, out_error);
    } else {
        err = gn_circle_find_disc(&run->first, &circle, out_error);
    }
    if (err)
        return err;
    printf("circle: centre %.2f, %.2f, radius %.2f px; %d points of its outline, %.2f px RMS off\n",
           circle.center[0], circle.center[1], circle.radius, circle.n_points, circle.rms);
    memcpy(p->center, circle.center, sizeof(p->center));
    p->radius = circle.radius;
    if (!has(run, "ball"))
        return 0;
    if (p->type != GN_PROJECTION_MIRRORBALL)
        return gn_error_set(out_error, -EINVAL, "--ball is for --projection mirrorball");
    double share = has(run, "camera-share")
                       ? gn_options_get_double(run->options, NULL, NULL, "camera-share")
                       : DEFAULT_CAMERA_SHARE;
    memcpy(run->mask, circle.center, sizeof(circle.center));
    run->mask[2] = share * circle.radius;
    if (!has(run, "theta-max"))
        p->theta_max = BALL_THETA_MAX;
    p->radius = circle.radius * sin(p->theta_max / 2); // of the ball's own: r = R sin(theta / 2)
    return 0;
}

/* All pairs of this picture's spots and lamps. */
static int look_for_lamps(struct run *run, int i, const struct gn_image *light,
                          struct gn_error *out_error)
{
    struct gn_spot spots[GN_SPOTS_MAX];
    char name[GN_FILE_NAME_BYTES];
    int n_here = 0;
    gn_file_get_name(run->list.entries[i].path, name);
    for (int k = 0; k < run->n_lamps; k++)
        n_here +=
            strcmp(run->lamps[k].picture, "*") == 0 || strcmp(run->lamps[k].picture, name) == 0;
    if (n_here == 0) {
        printf("%s: no lamp is said to be in it\n", run->list.entries[i].path);
        return 0;
    }
    int max = n_here + 2 < GN_SPOTS_MAX ? n_here + 2 : GN_SPOTS_MAX;
    int n =
        gn_spots_find(light, gn_options_get_double(run->options, NULL, NULL, "share"), max, spots);
    if (n < 0)
        return gn_error_set(out_error, n, "out of memory");
    printf("%s: %d bright spots, %d lamps\n", run->list.entries[i].path, n, n_here);
    for (int s = 0; s < n; s++)
        for (int k = 0; k < run->n_lamps && run->n_candidates < MAX_CANDIDATES; k++) {
            const struct gn_lamp *lamp = &run->lamps[k];
            if (strcmp(lamp->picture, "*") != 0 && strcmp(lamp->picture, name) != 0)
                continue;
            struct gn_fisheye_puzzle *c = &run->candidates[run->n_candidates++];
            memcpy(c->xy, spots[s].xy, sizeof(c->xy));
            memcpy(c->dir_world, lamp->dir_world, sizeof(c->dir_world));
            c->picture = i;
        }
    return 0;
}

static int read_all(struct run *run, struct gn_error *out_error)
{
    struct gn_file_entry *live;
    int err = 0;
    if (!gn_calibrate_is_live(run->options))
        err = gn_file_list_find(get(run, "files"), 1, &run->list, out_error);
    else if (gn_file_list_add(&run->list, "camera", &live) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && run->list.n_entries > MAX_PICTURES)
        err = gn_error_set(out_error, -E2BIG, "%s: %d pictures, at most %d are taken",
                           get(run, "files"), run->list.n_entries, MAX_PICTURES);
    for (int i = 0; !err && i < run->list.n_entries; i++) {
        struct gn_image image = {0}, gray = {0}, light = {0};
        err = read_picture(run, i, &image, out_error);
        if (!err &&
            (make_gray(run, &image, false, &gray) < 0 || make_gray(run, &image, true, &light) < 0))
            err = gn_error_set(out_error, -ENOMEM, "out of memory");
        if (!err && run->n_lamps > 0)
            err = look_for_lamps(run, i, &light, out_error);
        for (long k = 0; !err && i > 0 && k < (long)gray.width * gray.height; k++)
            run->first.data[k] = fmaxf(run->first.data[k], gray.data[k]);
        if (!err && i == 0) {
            run->first = gray;
            gray = (struct gn_image){0};
        }
        gn_image_finish(&image);
        gn_image_finish(&gray);
        gn_image_finish(&light);
    }
    return err;
}

static int find_orientation(struct run *run, struct gn_error *out_error)
{
    struct gn_projection projection = run->setup.projection;
    int moves = (int)gn_options_get_set(run->options, NULL, NULL, "fit");
    int n = gn_fisheye_match(&projection, run->candidates, run->n_candidates,
                             gn_options_get_double(run->options, NULL, NULL, "tolerance"),
                             run->sightings, out_error);
    if (n < 0)
        return n;
    run->n_sightings = n;
    int err = gn_fisheye_fit(&projection, moves, run->sightings, n, &run->fit, out_error);
    if (err)
        return err;
    for (int i = 0; i < n; i++)
        printf("lamp at %.2f, %.2f px, direction %.3f %.3f %.3f: %.3f degrees off\n",
               run->sightings[i].xy[0], run->sightings[i].xy[1], run->sightings[i].dir_world[0],
               run->sightings[i].dir_world[1], run->sightings[i].dir_world[2],
               run->sightings[i].error_deg);
    const double *q = run->fit.world_from_probe.rotation;
    printf("orientation %.6f %.6f %.6f %.6f; %d lamps off by %.3f degrees RMS, uncertainty %.3f "
           "degrees, condition number %.1f (at most %.0f)\n",
           q[0], q[1], q[2], q[3], n, run->fit.rms_deg, run->fit.uncertainty_deg,
           run->fit.condition, GN_FISHEYE_MAX_CONDITION);
    run->setup.projection = run->fit.projection;
    return 0;
}

static int draw(const struct run *run, const char *path, struct gn_error *out_error)
{
    static const struct gn_ink green = {0, 220, 0}, red = {255, 40, 0}, blue = {60, 140, 255};
    struct gn_image8 shades = {0};
    const struct gn_projection *p = &run->setup.projection;
    struct gn_pose probe_from_world;
    int err = gn_calibrate_stretch(&run->first, &shades);
    if (err)
        return gn_error_set(out_error, err, "%s: out of memory", path);
    gn_draw_circle(&shades, p->center[0], p->center[1], p->radius, blue);
    if (run->mask[2] > 0)
        gn_draw_circle(&shades, run->mask[0], run->mask[1], run->mask[2], red);
    gn_pose_invert(&run->fit.world_from_probe, &probe_from_world);
    for (int i = 0; i < run->n_sightings; i++) {
        double dir[3], xy[2];
        const struct gn_fisheye_sighting *s = &run->sightings[i];
        gn_draw_circle(&shades, s->xy[0], s->xy[1], 6, green);
        gn_pose_rotate(&probe_from_world, s->dir_world, dir);
        if (gn_projection_get_position(p, dir, xy))
            gn_draw_dot(&shades, xy[0], xy[1], 1.5, red);
    }
    err = gn_png_write_file(path, &shades, out_error);
    gn_image8_finish(&shades);
    return err;
}

static int write_results(const struct run *run, struct gn_error *out_error)
{
    const struct gn_projection *p = &run->setup.projection;
    bool is_kb = p->type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT;
    json_t *found = json_pack("{s:s, s:i, s:i, s:o, s:o, s:o}", "projection",
                              gn_projection_get_name(p->type), "width", p->width, "height",
                              p->height, "center", gn_device_file_make_numbers(p->center, 2),
                              "radius", json_real(p->radius), "theta_max", json_real(p->theta_max));
    if (found && is_kb)
        json_object_set_new(found, "k", gn_device_file_make_numbers(p->k, 4));
    if (found && run->n_sightings > 0)
        json_object_set_new(found, "orientation",
                            gn_device_file_make_numbers(run->fit.world_from_probe.rotation, 4));
    if (found && has(run, "ball")) // an older one goes
        json_object_set_new(found, "mask", json_null());
    if (found && run->mask[2] > 0)
        json_object_set_new(found, "mask",
                            json_pack("[{s:o, s:f}]", "center",
                                      gn_device_file_make_numbers(run->mask, 2), "radius",
                                      run->mask[2]));
    if (get(run, "picture")) {
        int err = draw(run, get(run, "picture"), out_error);
        if (err) {
            json_decref(found);
            return err;
        }
    }
    return gn_device_file_update(get(run, "out"), found, out_error);
}

static int calibrate(struct run *run, struct gn_error *out_error)
{
    bool has_circle = gn_options_get_bool(run->options, NULL, NULL, "find-circle");
    bool has_ball = has(run, "ball"), has_lamps = has(run, "lamps");
    if (!has_circle && !has_ball && !has_lamps)
        return gn_error_set(out_error, -EINVAL,
                            "nothing to find: give --find-circle, --ball or --lamps");
    if (has_circle && has_ball)
        return gn_error_set(out_error, -EINVAL, "--find-circle is for fisheyes, --ball for balls");
    const char *misuse = gn_calibrate_find_misuse(run->options);
    if (!misuse && has(run, "frames") && !gn_calibrate_is_live(run->options))
        misuse = "--frames is for cameras and videos; of files all are taken";
    int err = misuse ? gn_error_set(out_error, -EINVAL, "%s", misuse) : read_setup(run, out_error);
    if (!err && has_lamps) {
        run->n_lamps = gn_lamps_read_file(get(run, "lamps"), run->lamps, out_error);
        err = run->n_lamps < 0 ? run->n_lamps : 0;
    }
    if (!err)
        err = read_all(run, out_error);
    if (!err && (has_circle || has_ball))
        err = find_circle(run, out_error);
    const char *reason = NULL;
    if (!err && gn_projection_init(&run->setup.projection, &reason) < 0)
        err = gn_error_set(out_error, -EINVAL, "%s: %s", get(run, "out"), reason);
    if (!err && has_lamps)
        err = find_orientation(run, out_error);
    return err ? err : write_results(run, out_error);
}

int gn_cmd_calibrate_probe(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    struct run *run = calloc(1, sizeof(*run));
    if (run) {
        run->options = options;
        ret = calibrate(run, &error);
        gn_image_finish(&run->first);
        gn_file_list_finish(&run->list);
    } else {
        ret = gn_error_set(&error, -ENOMEM, "out of memory");
    }
    free(run);
    gn_options_destroy(&options);
    return ret ? gn_cmd_fail(&program, error.text) : 0;
}
