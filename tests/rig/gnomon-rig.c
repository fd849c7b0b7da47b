/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon-rig: makes sequences with known truth, judges composites, draws contact sheets.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/options.h"
#include "common/png.h"
#include "tests/rig/sequence.h"

static const struct gn_option make_table[] = {
    {.key = "light",
     .type = GN_OPTION_STRING,
     .default_value = "lamps",
     .value_name = "LIGHT",
     .help = "Where the light comes from: \"lamps\", a room whose four lamps are switched on one "
             "after another, or a lat-long EXR or Radiance file."},
    {.key = "turn",
     .type = GN_OPTION_DOUBLE,
     .min = -360,
     .max = 360,
     .default_value = "0",
     .value_name = "DEG",
     .help = "Turns a light map about the marker's axis."},
    {.key = "light-distance",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 1e6,
     .default_value = "0",
     .value_name = "M",
     .help = "Paints the light on a sphere of this radius round the marker; 0: "
             "infinitely far."},
    {.key = "width",
     .type = GN_OPTION_INT,
     .min = 16,
     .max = 4096,
     .default_value = "320",
     .value_name = "PX",
     .help = "Width of the camera's frames."},
    {.key = "height",
     .type = GN_OPTION_INT,
     .min = 16,
     .max = 4096,
     .default_value = "240",
     .value_name = "PX",
     .help = "Height of the camera's frames."},
    {.key = "zoom",
     .type = GN_OPTION_DOUBLE,
     .min = 0.25,
     .max = 16,
     .default_value = "1",
     .value_name = "N",
     .help = "Makes the camera's focal length that many times as long: 2 shows the middle half, "
             "the teapot and what is about it."},
    {.key = "frames-per-light",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 250,
     .default_value = "4",
     .help = "Frames for each state of the light: the lamp room has four, a map one."},
    {.key = "probe-size",
     .type = GN_OPTION_INT,
     .min = 16,
     .max = 2048,
     .default_value = "300",
     .value_name = "PX",
     .help = "Side of the environment frames."},
    {.key = "probe",
     .type = GN_OPTION_ENUM,
     .choices = "fisheye|angular",
     .default_value = "fisheye",
     .help = "The environment frames that sequence.json names: fisheye, "
             "180 degrees, looking up; or angular, a light probe of 360 degrees. Both are made."},
    {.key = "pixel-format",
     .type = GN_OPTION_ENUM,
     .choices = "log12|float32",
     .default_value = "log12",
     .help = "And their pixels: codes of a logarithmic sensor in 16-bit "
             "PNG, or linear floats in EXR. Both are made."},
    {.key = "bounces",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 8,
     .default_value = "4",
     .help = "Bounces in the second set of pictures; the first has direct light alone."},
    {.key = "paths",
     .type = GN_OPTION_INT,
     .min = 8,
     .max = 16384,
     .default_value = "128",
     .help = "Paths for each pixel, a power of two."},
    {.key = "direct-paths",
     .type = GN_OPTION_INT,
     .min = 8,
     .max = 16384,
     .value_name = "N",
     .help = "The same for the pictures in direct light, where they shall be less noisy; they are "
             "then made apart. Default: those of --paths."},
    {.key = "seed",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 2147483647,
     .default_value = "1",
     .help = "Of everything random: the same seed gives the same bytes."},
    {.key = "noise",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 64,
     .default_value = "0",
     .value_name = "CODES",
     .help = "Standard deviation of the camera sensor's noise, 8-bit codes."},
    {.key = "jitter-mm",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 100,
     .default_value = "0",
     .value_name = "MM",
     .help = "Standard deviation of the tracked camera position."},
    {.key = "jitter-deg",
     .type = GN_OPTION_DOUBLE,
     .min = 0,
     .max = 10,
     .default_value = "0",
     .value_name = "DEG",
     .help = "Standard deviation of the tracked camera direction."},
    {.key = "distortion",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "Gives the camera a lens with distortion."},
    {.key = "smooth",
     .type = GN_OPTION_BOOL,
     .default_value = "false",
     .help = "A teapot of many triangles in place of the one that makes 814 with the rest."},
    {.key = "threads",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 256,
     .default_value = "0",
     .help = "Threads; 0: one per processor. The pictures do not depend on it."},
};

static const struct gn_program make_program = {
    .name = "gnomon-rig make",
    .usage = "[OPTION]... DIR",
    .summary = "Writes a sequence into DIR: what a camera, a tracker and a light probe deliver of "
               "the demo room, and the same pictures with the teapot physically there. What is in "
               "DIR already, made with the same parameters, is kept.",
    .notes =
        "DIR/sequence.json lists the frames in direct light (docs/frames.md), DIR/bounces the\n"
        "same with bounces; scene.json and camera.json are what gnomond and gnomon-render\n"
        "read; exr/ has the pictures in floats with their\n"
        "standard errors.\n",
    .options = make_table,
    .n_options = GN_ARRAY_LEN(make_table),
    .min_arguments = 1,
    .max_arguments = 1,
};

static const struct gn_option judge_table[] = {
    {.key = "report",
     .type = GN_OPTION_STRING,
     .value_name = "FILE",
     .help = "Writes the figures as JSON."},
};

static const struct gn_program judge_program = {
    .name = "gnomon-rig judge",
    .usage = "[OPTION]... DIR COMPOSITES",
    .summary = "Compares COMPOSITES/0000.png and so on with the truth of the sequence in DIR, over "
               "the pixels that the object changes by more than 1/255, object and shadow apart. In "
               "brackets: the error of the camera frame if nobody had touched it.",
    .options = judge_table,
    .n_options = GN_ARRAY_LEN(judge_table),
    .min_arguments = 2,
    .max_arguments = 2,
};

static const struct gn_option sheet_table[] = {
    {.key = "out",
     .type = GN_OPTION_STRING,
     .default_value = "sheet.png",
     .value_name = "FILE",
     .help = "The sheet, a PNG."},
    {.key = "title",
     .type = GN_OPTION_STRING,
     .default_value = "Gnomon",
     .value_name = "TEXT",
     .help = "Its headline."},
    {.key = "composites",
     .type = GN_OPTION_STRING,
     .value_name = "DIR",
     .help = "Composites by the names of the camera frames; adds the difference to the truth."},
    {.key = "light",
     .type = GN_OPTION_STRING,
     .value_name = "DIR",
     .help = "Pictures of the light maps with their lights, by the same names."},
    {.key = "shadow",
     .type = GN_OPTION_STRING,
     .value_name = "DIR",
     .help = "Shadow factors by the same names: PNG, or EXR with the layer \"shadow\"."},
    {.key = "rows",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 64,
     .default_value = "0",
     .help = "Frames shown, spread evenly; 0: all."},
};

static const struct gn_program sheet_program = {
    .name = "gnomon-rig sheet",
    .usage = "[OPTION]... DIR...",
    .summary = "Draws a contact sheet of the sequence in DIR, a row for each frame. With several "
               "DIRs, one below the other, --composites, --light and --shadow name folders that "
               "hold a folder for each, by its name.",
    .options = sheet_table,
    .n_options = GN_ARRAY_LEN(sheet_table),
    .min_arguments = 1,
    .max_arguments = 16,
};

static int run_make(const struct gn_options *o, struct gn_error *error)
{
    const struct gn_rig_sequence_options options = {
        .directory = gn_options_get_argument(o, 0),
        .light = gn_options_get_string(o, NULL, NULL, "light"),
        .turn_deg = gn_options_get_double(o, NULL, NULL, "turn"),
        .light_distance = gn_options_get_double(o, NULL, NULL, "light-distance"),
        .width = gn_options_get_int(o, NULL, NULL, "width"),
        .height = gn_options_get_int(o, NULL, NULL, "height"),
        .zoom = gn_options_get_double(o, NULL, NULL, "zoom"),
        .frames_per_light = gn_options_get_int(o, NULL, NULL, "frames-per-light"),
        .probe_size = gn_options_get_int(o, NULL, NULL, "probe-size"),
        .probe = (enum gn_rig_probe)gn_options_get_enum(o, NULL, NULL, "probe"),
        .is_float = gn_options_get_enum(o, NULL, NULL, "pixel-format") == 1,
        .bounces = gn_options_get_int(o, NULL, NULL, "bounces"),
        .paths = gn_options_get_int(o, NULL, NULL, "paths"),
        .direct_paths = gn_options_get_int(o, NULL, NULL, "direct-paths"),
        .seed = (uint64_t)gn_options_get_int(o, NULL, NULL, "seed"),
        .noise = gn_options_get_double(o, NULL, NULL, "noise"),
        .jitter_mm = gn_options_get_double(o, NULL, NULL, "jitter-mm"),
        .jitter_deg = gn_options_get_double(o, NULL, NULL, "jitter-deg"),
        .is_distorted = gn_options_get_bool(o, NULL, NULL, "distortion"),
        .is_smooth = gn_options_get_bool(o, NULL, NULL, "smooth"),
    };
    struct gn_pool *pool = NULL;
    if (gn_pool_create(gn_options_get_int(o, NULL, NULL, "threads"), &pool))
        return gn_error_set(error, -EAGAIN, "cannot start the threads");
    int result = gn_rig_make_sequence(&options, pool, stderr, error);
    gn_pool_destroy(&pool);
    return result;
}

static int run_judge(const struct gn_options *o, struct gn_error *error)
{
    struct gn_rig_sequence sequence;
    json_t *report = NULL;
    const char *path = gn_options_get_string(o, NULL, NULL, "report");
    int result = gn_rig_sequence_read(gn_options_get_argument(o, 0), &sequence, error);
    if (result)
        return result;
    result = gn_rig_judge(&sequence, gn_options_get_argument(o, 1), stdout, &report, error);
    if (result == 0 && path) {
        char *text = json_dumps(report, JSON_INDENT(1) | JSON_REAL_PRECISION(6));
        result = text ? gn_file_write(path, text, strlen(text), error)
                      : gn_error_set(error, -ENOMEM, "%s: no memory to write it", path);
        free(text);
    }
    json_decref(report);
    gn_rig_sequence_finish(&sequence);
    return result;
}

/* ROOT/NAME where several sequences share the options, else ROOT; NULL stays NULL. */
static const char *get_part(const char *root, const char *name, char *out, size_t size)
{
    if (!root || !name)
        return root;
    snprintf(out, size, "%s/%s", root, name);
    return out;
}

static int draw_one(const struct gn_options *o, int index, struct gn_image8 *out,
                    struct gn_error *error)
{
    const char *directory = gn_options_get_argument(o, index);
    const char *slash = strrchr(directory, '/');
    const char *name = slash ? slash + 1 : directory;
    const char *part = gn_options_get_argument_count(o) > 1 ? name : NULL;
    const char *title = gn_options_get_string(o, NULL, NULL, "title");
    char heading[256], composites[4096], light[4096], shadow[4096];
    snprintf(heading, sizeof(heading), "%s%s%s", title, part ? "  " : "", part ? name : "");
    const struct gn_rig_sheet_options options = {
        .title = heading,
        .composites = get_part(gn_options_get_string(o, NULL, NULL, "composites"), part, composites,
                               sizeof(composites)),
        .light =
            get_part(gn_options_get_string(o, NULL, NULL, "light"), part, light, sizeof(light)),
        .shadow =
            get_part(gn_options_get_string(o, NULL, NULL, "shadow"), part, shadow, sizeof(shadow)),
        .n_rows = gn_options_get_int(o, NULL, NULL, "rows"),
    };
    struct gn_rig_sequence sequence;
    int result = gn_rig_sequence_read(directory, &sequence, error);
    if (result)
        return result;
    result = gn_rig_draw_sheet(&sequence, &options, out, error);
    gn_rig_sequence_finish(&sequence);
    return result;
}

/* Puts `below` under *sheet, which is taken as it is where it is still empty. */
static int stack(struct gn_image8 *sheet, struct gn_image8 *below, struct gn_error *error)
{
    if (!sheet->data) {
        *sheet = *below;
        memset(below, 0, sizeof(*below));
        return 0;
    }
    struct gn_image8 both;
    int width = sheet->width > below->width ? sheet->width : below->width;
    int result = gn_image8_init(&both, width, sheet->height + below->height, 3);
    if (result)
        return gn_error_set(error, result, "no sheet of that height: show fewer rows");
    const struct gn_image8 *parts[2] = {sheet, below};
    for (int p = 0, y0 = 0; p < 2; y0 += parts[p++]->height)
        for (int y = 0; y < parts[p]->height; y++)
            memcpy(gn_image8_at(&both, 0, y0 + y), gn_image8_at(parts[p], 0, y),
                   (size_t)parts[p]->width * 3);
    gn_image8_finish(sheet);
    *sheet = both;
    return 0;
}

static int run_sheet(const struct gn_options *o, struct gn_error *error)
{
    struct gn_image8 sheet = {0};
    int result = 0;
    for (int i = 0; result == 0 && i < gn_options_get_argument_count(o); i++) {
        struct gn_image8 one = {0};
        result = draw_one(o, i, &one, error);
        if (result == 0)
            result = stack(&sheet, &one, error);
        gn_image8_finish(&one);
    }
    if (result == 0)
        result = gn_png_write_file(gn_options_get_string(o, NULL, NULL, "out"), &sheet, error);
    gn_image8_finish(&sheet);
    return result;
}

static const struct {
    const char *name;
    const struct gn_program *program;
    int (*run)(const struct gn_options *, struct gn_error *);
} commands[] = {
    {"make", &make_program, run_make},
    {"judge", &judge_program, run_judge},
    {"sheet", &sheet_program, run_sheet},
};

static const char usage[] =
    "gnomon-rig: a virtual capture stand with known truth.\n"
    "\n"
    "  gnomon-rig make  [OPTION]... DIR             write a sequence and its truth\n"
    "  gnomon-rig judge [OPTION]... DIR COMPOSITES  error of composites against the truth\n"
    "  gnomon-rig sheet [OPTION]... DIR...          contact sheet\n"
    "\n"
    "Each takes --help. To begin with:\n"
    "  gnomon-rig make --frames-per-light 3 lamps\n"
    "  gnomon-rig make --light city.exr city\n"
    "  gnomon-rig sheet --out lamps.png lamps\n";

int main(int argc, char *argv[])
{
    for (size_t i = 0; argc > 1 && i < GN_ARRAY_LEN(commands); i++) {
        struct gn_error error = {0};
        struct gn_options *options = NULL;
        if (strcmp(argv[1], commands[i].name))
            continue;
        int result = gn_options_load(commands[i].program, argc - 1, argv + 1, &options, &error);
        if (result == 0 && gn_options_wants_help(options))
            gn_options_print_help(commands[i].program, stdout);
        else if (result == 0 && gn_options_wants_version(options))
            puts("gnomon-rig " GN_VERSION);
        else if (result == 0)
            result = commands[i].run(options, &error);
        gn_options_destroy(&options);
        if (result)
            fprintf(stderr, "%s: %s\n", commands[i].program->name, error.text);
        return result ? EXIT_FAILURE : EXIT_SUCCESS;
    }
    bool asked = argc > 1 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h"));
    fputs(usage, asked ? stdout : stderr);
    return asked ? EXIT_SUCCESS : EXIT_FAILURE;
}
