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
#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "client/cmd_calibrate/calibrate_live.h"
#include "client/cmd_calibrate/calibrate_probe.h"
#include "common/device_json.h"
#include "proto/attr.h"

static const struct gn_option option_table[] = {
    {.key = "files",
     .flag = "files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "The probe's pictures: a folder, a file or a pattern; the probe at rest."},
    GN_CALIBRATE_LIVE_OPTIONS,
    GN_CALIBRATE_FRAMES_OPTION(
        "Camera or video: take the mean of so many pictures; default 1. In the lamps' file it is "
        "called camera."),
    GN_CALIBRATE_OUT_OPTION(
        "probe.json. What it says already (projection, response) is used, and stays."),
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
             "length. Two at least, three where they share a picture; which spot is which lamp is "
             "found."},
    {.key = "markers",
     .flag = "markers",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Instead of lamps: markers.json (docs/frames.md). The pictures show markers of its "
             "body \"world\"; orientation and position of the probe follow from them."},
    {.key = "marker",
     .flag = "marker",
     .type = GN_OPTION_STRING,
     .value_name = "DICT:ID:SIZE",
     .help = "Instead of --markers: one marker, whose middle is the world's origin, such as "
             "4x4_50:7:0.05 (its side in metres)."},
    {.key = "camera",
     .flag = "camera",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "camera.json of the camera that took --camera-files."},
    {.key = "camera-files",
     .flag = "camera-files",
     .type = GN_OPTION_STRING,
     .value_name = "PATTERN",
     .help = "Where the probe sees no marker of \"world\": pictures of a camera that sees them "
             "together with those of another body, which the probe sees. That body rests."},
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
    GN_CALIBRATE_FULL_SCALE_OPTION(
        "Largest code of 16-bit files. Default 4095 where FILE says log12, else 65535."),
    GN_CALIBRATE_PICTURE_OPTION(
        "A PNG of the pictures with what was found: circle, mask, spots and markers (green; "
        "yellow: seen but not used), where they should be (red dots), the world's axes. Written "
        "when nothing can be measured, too."),
};

static const struct gn_program program = {
    .name = "gnomon calibrate probe",
    .usage = "--files PATTERN | --video FILE | --gige ID | --v4l2 DEVICE "
             "--out probe.json [OPTION]...",
    .summary = "Measures a light probe: a fisheye's circle, lens and orientation against the "
               "world's marker, or a mirror ball's place in its picture.",
    .notes = "Examples:\n"
             "  gnomon calibrate probe --files 'lamp*.png' --find-circle \\\n"
             "      --projection fisheye-equidistant --lamps lamps.txt --out probe.json\n"
             "  gnomon calibrate probe --files 'probe*.png' --markers markers.json \\\n"
             "      --out probe.json --picture found.png\n"
             "  gnomon calibrate probe --files ball.png --projection mirrorball \\\n"
             "      --ball 320,240,150 --out probe.json --picture ball-found.png\n"
             "  gnomon calibrate probe --gige any --frames 16 --find-circle \\\n"
             "      --projection fisheye-equidistant --out probe.json\n",
    .options = option_table,
    .n_options = GN_ARRAY_LEN(option_table),
};

const char *gn_probe_run_get(const struct gn_probe_run *run, const char *key)
{
    return gn_options_get_string(run->options, NULL, NULL, key);
}

bool gn_probe_run_has(const struct gn_probe_run *run, const char *key)
{
    return gn_options_is_set(run->options, NULL, NULL, key);
}

static int read_setup(struct gn_probe_run *run, struct gn_error *out_error)
{
    const char *path = gn_probe_run_get(run, "out");
    gn_probe_setup_init(&run->setup);
    bool has_file = access(path, F_OK) == 0;
    struct gn_json root = {0};
    int err = has_file ? gn_json_load_file(path, &root, out_error) : 0;
    bool has_projection = !err && has_file && gn_json_has(&root, "projection");
    // Without a projection the rest is there all the same: response, pixel format.
    if (!err && has_file && !has_projection &&
        json_object_set_new(root.value, "projection", json_string("angular")) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err && has_file)
        err = gn_probe_setup_read_json(&root, &run->setup, out_error);
    gn_json_finish(&root);
    if (err)
        return err;
    if (gn_probe_run_has(run, "projection"))
        run->setup.projection.type =
            (enum gn_projection_type)gn_options_get_enum(run->options, NULL, NULL, "projection");
    else if (!has_projection)
        return gn_error_set(out_error, -EINVAL,
                            "%s says no projection: give --projection, for example "
                            "fisheye-equidistant or mirrorball",
                            path);
    run->setup.projection.focal = 0; // follows from radius, theta_max and model, which may change
    if (gn_probe_run_has(run, "theta-max"))
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

static int write_results(const struct gn_probe_run *run, struct gn_error *out_error)
{
    const struct gn_projection *p = &run->setup.projection;
    bool is_kb = p->type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT;
    json_t *found = json_pack("{s:s, s:i, s:i, s:o, s:o, s:o}", "projection",
                              gn_projection_get_name(p->type), "width", p->width, "height",
                              p->height, "center", gn_device_file_make_numbers(p->center, 2),
                              "radius", json_real(p->radius), "theta_max", json_real(p->theta_max));
    if (found && is_kb)
        json_object_set_new(found, "k", gn_device_file_make_numbers(p->k, 4));
    if (found && run->has_pose)
        json_object_set_new(found, "orientation",
                            gn_device_file_make_numbers(run->world_from_probe.rotation, 4));
    if (found && run->n_sightings > 0) // lamps do not say where the probe is
        json_object_set_new(found, "position",
                            gn_device_file_make_numbers(run->world_from_probe.translation, 3));
    if (found && gn_probe_run_has(run, "ball")) // an older one goes
        json_object_set_new(found, "mask", json_null());
    if (found && run->mask[2] > 0)
        json_object_set_new(found, "mask",
                            json_pack("[{s:o, s:f}]", "center",
                                      gn_device_file_make_numbers(run->mask, 2), "radius",
                                      run->mask[2]));
    return gn_device_file_update(gn_probe_run_get(run, "out"), found, out_error);
}

/* What is wrong with the options together; NULL: nothing. */
static const char *find_misuse(const struct gn_probe_run *run)
{
    bool has_circle = gn_options_get_bool(run->options, NULL, NULL, "find-circle");
    bool has_ball = gn_probe_run_has(run, "ball"), has_lamps = gn_probe_run_has(run, "lamps");
    if (!has_circle && !has_ball && !has_lamps && !gn_probe_run_has(run, "markers") &&
        !gn_probe_run_has(run, "marker"))
        return "nothing to find: give --find-circle, --ball, --lamps or --markers";
    if (has_circle && has_ball)
        return "--find-circle is for fisheyes, --ball for balls";
    if (!has_ball && gn_probe_run_has(run, "camera-share"))
        return "--camera-share is for --ball";
    const char *misuse = gn_calibrate_find_misuse(run->options);
    if (!misuse && gn_probe_run_has(run, "frames") && !gn_calibrate_is_live(run->options))
        misuse = "--frames is for cameras and videos; of files all are taken";
    if (!misuse)
        misuse = gn_probe_run_find_marker_misuse(run);
    if (!misuse && !has_lamps &&
        (gn_options_get_set(run->options, NULL, NULL, "fit") != 0 ||
         !gn_options_is_default(run->options, NULL, NULL, "share") ||
         !gn_options_is_default(run->options, NULL, NULL, "tolerance")))
        misuse = "--fit, --share and --tolerance are for --lamps";
    return misuse;
}

static int measure(struct gn_probe_run *run, struct gn_error *out_error)
{
    bool has_lamps = gn_probe_run_has(run, "lamps");
    bool has_markers = gn_probe_run_has(run, "markers") || gn_probe_run_has(run, "marker");
    const char *reason = NULL;
    int err = read_setup(run, out_error);
    if (!err && has_lamps)
        err = gn_probe_run_read_lamps(run, out_error);
    if (!err && has_markers)
        err = gn_probe_run_read_markers(run, out_error);
    if (!err)
        err = gn_probe_run_read_all(run, out_error);
    if (!err && (gn_probe_run_has(run, "ball") ||
                 gn_options_get_bool(run->options, NULL, NULL, "find-circle")))
        err = gn_probe_run_find_circle(run, out_error);
    if (!err && gn_projection_init(&run->setup.projection, &reason) < 0)
        err = gn_error_set(out_error, -EINVAL, "%s: %s", gn_probe_run_get(run, "out"), reason);
    if (!err && has_lamps)
        err = gn_probe_run_fit_lamps(run, out_error);
    if (!err && has_markers)
        err = gn_probe_run_fit_markers(run, out_error);
    return err;
}

/* Draws whether or not it could be measured: what was seen says why not. */
static int draw(const struct gn_probe_run *run, bool is_measured, struct gn_error *out_error)
{
    const char *path = gn_probe_run_get(run, "picture");
    struct gn_error error = {0};
    int err = path && run->first.data ? gn_probe_run_draw(run, path, &error) : 0;
    if (path && run->first.data && !is_measured)
        printf("%s\n", err ? error.text : "--picture shows what was seen");
    return err && is_measured ? gn_error_set(out_error, err, "%s", error.text) : 0;
}

static int calibrate(struct gn_probe_run *run, struct gn_error *out_error)
{
    int err = measure(run, out_error);
    int not_drawn = draw(run, err == 0, out_error);
    if (!err)
        err = not_drawn;
    return err ? err : write_results(run, out_error);
}

int gn_cmd_calibrate_probe(int argc, char *const argv[])
{
    struct gn_options *options = NULL;
    struct gn_error error = {0};
    int ret = gn_cmd_load(&program, argc, argv, &options);
    if (ret <= 0)
        return ret == 0 ? 0 : 2;
    struct gn_probe_run *run = calloc(1, sizeof(*run));
    const char *misuse = NULL;
    if (run) {
        run->program = &program;
        run->options = options;
        misuse = find_misuse(run);
        ret = misuse ? gn_error_set(&error, -EINVAL, "%s", misuse) : calibrate(run, &error);
        gn_image_finish(&run->first);
        gn_image_finish(&run->first_light);
        gn_image_finish(&run->live);
        gn_bodies_finish(&run->bodies);
        gn_file_list_finish(&run->list);
    } else {
        ret = gn_error_set(&error, -ENOMEM, "out of memory");
    }
    free(run);
    gn_options_destroy(&options);
    if (ret)
        gn_cmd_fail(&program, error.text);
    return misuse ? 2 : ret ? 1 : 0;
}
