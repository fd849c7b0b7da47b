/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "common/pose.h"
#include "server/render_cli/cli.h"

// In the order of their enums.
#define QUALITIES "interactive|seed|reference"
#define SHADINGS GN_SHADING_NAMES

static const struct gn_option table[] = {
    {.key = "scene",
     .value_name = "FILE",
     .is_required = true,
     .help = "scene.json: the real and virtual objects."},
    {.key = "env",
     .value_name = "FILE",
     .help =
         "The light: an environment picture; only a scene with light of its own may do without. "
         "EXR and Radiance files are linear; the codes of "
         "PNG and JPEG need a response in --env-params."},
    {.key = "env-projection",
     .type = GN_OPTION_ENUM,
     .choices = GN_PROJECTION_NAMES,
     .value_name = "NAME",
     .help = "How the picture shows the directions; without it and --env-params: latlong."},
    {.key = "env-params",
     .value_name = "FILE",
     .help = "JSON of the environment picture: projection, center [x, y] and radius in pixels, "
             "theta_max in radians, k [k1, k2, k3, k4], vignetting [a, b, c], pixel_format, "
             "response, to_rec709, scale, "
             "orientation [w, x, y, z] (world_from_probe), position [x, y, z] in metres."},
    {.key = "more-envs",
     .value_name = "ENV=PARAMS,...",
     .help = "Up to 7 pictures of other probes, each with its own parameters, which hold its "
             "position: light is interpolated between all of them."},
    {.key = "world-from-env",
     .value_name = "R00,...,R22",
     .help = "Rotation from the picture's axes to the world's: 9 numbers, row-major; without it: "
             "none."},
    {.key = "camera",
     .value_name = "FILE",
     .is_required = true,
     .help = "camera.json: size, intrinsics, distortion, pose, response, noise, blur."},
    {.key = "match",
     .type = GN_OPTION_SET,
     .choices = GN_MATCH_NAMES,
     .default_value = "all",
     .help = "What of the camera virtual pixels are given; the rest counts as not said in "
             "camera.json. Noise and blur are in the composites, not in the layers."},
    {.key = "background",
     .value_name = "FILE",
     .help = "The camera's picture: codes of the camera's response (PNG, JPEG), or linear (EXR). "
             "Adds composite.R,G,B to the layers."},
    {.key = "quality",
     .type = GN_OPTION_ENUM,
     .choices = QUALITIES,
     .default_value = "interactive",
     .help = "interactive: lights found in the map. seed: the 2007 paper to the letter. reference: "
             "every texel with exact visibility; slow, the judge of the others."},
    {.key = "shading",
     .type = GN_OPTION_ENUM,
     .choices = SHADINGS,
     .default_value = "lights",
     .help = "Diffuse virtual objects lit by the lights with shadow rays, or by the irradiance of "
             "their normals, without shadows on them: the paper's two variants."},
    {.key = "sh-order",
     .type = GN_OPTION_ENUM,
     .choices = "2|4",
     .default_value = "4",
     .help = "Order of the irradiance's spherical harmonics: 9 or 25 coefficients."},
    {.key = "sh-dering",
     .type = GN_OPTION_BOOL,
     .help = "Smooths the harmonics until they are nowhere negative; without it what is negative "
             "counts as 0, which is nearer to the truth on photographs."},
    {.key = "sh-keep-lights",
     .type = GN_OPTION_BOOL,
     .help = "Leaves small bright lights in the harmonics, as the paper does; without it they are "
             "added exactly."},
    {.key = "lights",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = GN_LIGHTS_MAX,
     .value_name = "N",
     .help = "Wanted number of lights, with every method but seed; without it: the method's own. "
             "A sun's disc is spread over 8 to 32 directions besides, so the report may count "
             "more."},
    {.key = "light-method",
     .type = GN_OPTION_ENUM,
     .choices = GN_LIGHT_METHOD_NAMES,
     .help = "How the map becomes lights. partition: the 2007 paper's regions, each with its "
             "energy; seed: those to the letter; penrose: importance samples; median-cut: regions "
             "of equal energy; variance: regions of least spread; inversion: spread points moved "
             "to where the energy is; quadtree: leaves of a tree that holds still in video. "
             "Without it: partition, or seed with --quality seed."},
    {.key = "light-rings",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 64,
     .help = "Rings of the partition's base division of a hemisphere; without it: the method's "
             "own."},
    {.key = "light-sectors",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 256,
     .help = "Sectors of the base division; without it: the method's own."},
    {.key = "light-max-ls",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 4096,
     .help = "Most lights that one region is divided into, the paper's maxLS; without it: the "
             "method's own."},
    {.key = "light-samples",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 1048576,
     .help = "Importance samples under the regions; without it: 16 for each region of the base "
             "division."},
    {.key = "light-metric",
     .type = GN_OPTION_ENUM,
     .choices = GN_METRIC_NAMES,
     .default_value = "default",
     .help = "How a region's deviation becomes its number of lights; default: the method's own."},
    {.key = "light-literal",
     .type = GN_OPTION_SET,
     .choices = GN_READ_NAMES,
     .default_value = "none",
     .help = "Readings of the paper's partition taken to the letter besides the method's own "
             "(seed: all but the last). docs/lighting.md explains each."},
    {.key = "light-mended",
     .type = GN_OPTION_SET,
     .choices = GN_READ_NAMES,
     .default_value = "none",
     .help = "Readings not taken to the letter after all; wins over --light-literal."},
    {.key = "light-weights",
     .type = GN_OPTION_ENUM,
     .choices = GN_WEIGHTS_NAMES,
     .default_value = "partition",
     .help = "What each importance sample stands for (penrose): the light of all texels nearest "
             "to it; the same power; or its radiance over the samples' density."},
    {.key = "light-relaxed",
     .type = GN_OPTION_BOOL,
     .default_value = "true",
     .help = "Moves importance samples by the correction table, which lays them out more evenly. "
             "Off in gnomond, whose light changes: they would move with it."},
    {.key = "shadow-cosine",
     .type = GN_OPTION_BOOL,
     .default_value = "true",
     .help = "Lights count in the shadow by the cosine of their angle; --quality seed: never."},
    {.key = "shadow-real-blockers",
     .type = GN_OPTION_BOOL,
     .default_value = "true",
     .help = "What real objects already shade is not shaded again; --quality seed: it is."},
    {.key = "emitter-pieces",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = GN_NEAR_LIGHTS_MAX,
     .value_name = "N",
     .help = "Into how many lights the scene's emissive meshes are cut together; without it 32."},
    {.key = "emission",
     .value_name = "NAME=FILE",
     .help = "A still picture for the meshes with that emission_stream: PNG and JPEG as sRGB, EXR "
             "and Radiance files linear."},
    {.key = "bounces",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 16,
     .default_value = "0",
     .value_name = "N",
     .help = "Indirect bounces; only with --quality reference."},
    {.key = "paths",
     .type = GN_OPTION_INT,
     .min = 1,
     .max = 65536,
     .value_name = "N",
     .help = "Random paths per pixel for --bounces; without it 256."},
    {.key = "seed",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 2147483647,
     .default_value = "0",
     .value_name = "N",
     .help = "Seed of these paths, and of the composites' noise."},
    {.key = "budget-ms",
     .type = GN_OPTION_DOUBLE,
     .min = 0.001,
     .max = 1e9,
     .value_name = "N",
     .help = "Not built yet, and refused: a time for quality to fit in."},
    {.key = "threads",
     .type = GN_OPTION_INT,
     .min = 0,
     .max = 256,
     .default_value = "0",
     .value_name = "N",
     .help = "0: one per processor. The output is the same to the bit with any number."},
    {.key = "out",
     .value_name = "FILE",
     .is_required = true,
     .help = "layers.exr: virtual.R,G,B,A, shadow.R,G,B, added.R,G,B, depth.Z in 32-bit floats."},
    {.key = "report",
     .value_name = "FILE",
     .help = "report.json: plan, times, rays, lights, error."},
    {.key = "light-map",
     .value_name = "FILE",
     .help = "A PNG of the light to look at: the map, lat-long in world axes, and the lights made "
             "of it."},
    {.key = "irradiance-map",
     .value_name = "FILE",
     .help = "An EXR of the irradiance in W/m^2 (not divided by pi), 64 x 32, lat-long in world "
             "axes."},
    {.key = "shadow-png", .value_name = "FILE", .help = "The shadow factor to look at."},
    {.key = "composite-png",
     .value_name = "FILE",
     .help = "The composite to look at, in the camera's response; needs --background."},
};

const struct gn_program gn_cli_program = {
    .name = "gnomon-render",
    .usage = "--scene FILE [--env FILE] --camera FILE --out FILE [OPTION]...",
    .summary = "Renders virtual objects into one camera picture, lit by an environment picture, "
               "with the shadows they cast on real objects.",
    .notes = "Examples:\n"
             "  A lat-long map, and the composite to look at:\n"
             "    gnomon-render --scene scene.json --env sunset.exr --camera camera.json \\\n"
             "        --background photo.png --out layers.exr --composite-png composite.png\n"
             "  A fisheye that looks straight up, in linear radiance:\n"
             "    gnomon-render --scene scene.json --env sky.exr \\\n"
             "        --env-projection fisheye-equisolid --world-from-env 1,0,0,0,-1,0,0,0,1 \\\n"
             "        --camera camera.json --out layers.exr\n"
             "  The truth at two bounces, slowly:\n"
             "    gnomon-render --scene scene.json --env sunset.exr --camera camera.json \\\n"
             "        --quality reference --bounces 2 --out truth.exr --report report.json\n"
             "\n"
             "Formats and axes: docs/frames.md. Exit status 0 only when all outputs are\n"
             "complete; otherwise one line on stderr, and none of them is left.\n",
    .options = table,
    .n_options = sizeof(table) / sizeof(table[0]),
};

const char *gn_cli_get_quality_name(enum gn_quality quality)
{
    static const char *const names[] = {"interactive", "seed", "reference"};
    return names[quality];
}

static bool is_set(const struct gn_cli_request *request, const char *key)
{
    return gn_options_is_set(request->options, NULL, NULL, key);
}

/** NULL where it is not set. */
static const char *get_path(const struct gn_cli_request *request, const char *key)
{
    return is_set(request, key) ? gn_options_get_string(request->options, NULL, NULL, key) : NULL;
}

static int get_int(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_int(request->options, NULL, NULL, key);
}

static int get_enum(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_enum(request->options, NULL, NULL, key);
}

/** Nine numbers with commas between them, a rotation. */
static int read_rotation(const char *text, double out_quaternion[static 4],
                         struct gn_error *out_error)
{
    double m[16];
    gn_mat4_identity(m);
    const char *rest = text;
    for (int i = 0; i < 9; i++) {
        char *end = NULL;
        double value = strtod(rest, &end);
        if (end == rest || *end != (i < 8 ? ',' : '\0') || !isfinite(value))
            return gn_error_set(out_error, -EINVAL,
                                "--world-from-env: '%s' is not nine numbers with commas between "
                                "them, such as 1,0,0,0,1,0,0,0,1",
                                text);
        m[4 * (i / 3) + i % 3] = value;
        rest = end + 1;
    }
    struct gn_pose pose;
    const char *reason = NULL;
    if (gn_pose_from_matrix(m, &pose, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "--world-from-env: no rotation: %s", reason);
    for (int k = 0; k < 4; k++)
        out_quaternion[k] = pose.rotation[k];
    return 0;
}

static void read_paths(struct gn_cli_request *request)
{
    request->scene = get_path(request, "scene");
    request->env = get_path(request, "env");
    request->emission = get_path(request, "emission");
    if (is_set(request, "emitter-pieces"))
        request->n_emitter_pieces = get_int(request, "emitter-pieces");
    request->env_params = get_path(request, "env-params");
    request->more_envs = get_path(request, "more-envs");
    request->camera = get_path(request, "camera");
    request->background = get_path(request, "background");
    request->out = get_path(request, "out");
    request->report = get_path(request, "report");
    request->light_map = get_path(request, "light-map");
    request->irradiance_map = get_path(request, "irradiance-map");
    request->shadow_png = get_path(request, "shadow-png");
    request->composite_png = get_path(request, "composite-png");
}

static bool get_bool(const struct gn_cli_request *request, const char *key)
{
    return gn_options_get_bool(request->options, NULL, NULL, key);
}

/** Numbers that are not set are 0: the method's own. */
static void read_light_readings(struct gn_cli_request *request)
{
    struct gn_light_options *light = &request->light;
    light->rings = get_int(request, "light-rings");
    light->sectors = get_int(request, "light-sectors");
    light->max_ls = get_int(request, "light-max-ls");
    light->n_samples = get_int(request, "light-samples");
    light->metric = (enum gn_partition_metric)get_enum(request, "light-metric");
    light->literal = gn_options_get_set(request->options, NULL, NULL, "light-literal");
    light->mended = gn_options_get_set(request->options, NULL, NULL, "light-mended");
    light->weights = (enum gn_light_weights)get_enum(request, "light-weights");
    light->relaxed = get_bool(request, "light-relaxed");
}

static void read_numbers(struct gn_cli_request *request)
{
    struct gn_render_options *render = &request->render;
    render->quality = (enum gn_quality)get_enum(request, "quality");
    render->shading = (enum gn_shading)get_enum(request, "shading");
    render->bounces = get_int(request, "bounces");
    render->seed = (uint64_t)get_int(request, "seed");
    if (is_set(request, "paths"))
        render->paths_per_pixel = get_int(request, "paths");
    if (render->quality == GN_QUALITY_SEED)
        request->light.method = GN_LIGHT_PARTITION_SEED;
    if (is_set(request, "light-method"))
        request->light.method = (enum gn_light_method)get_enum(request, "light-method");
    if (is_set(request, "lights"))
        request->light.n_lights = get_int(request, "lights");
    read_light_readings(request);
    render->shadow_unweighted = !get_bool(request, "shadow-cosine");
    render->shadow_ignore_real = !get_bool(request, "shadow-real-blockers");
    request->light.irradiance = (struct gn_irradiance_options){
        .order = get_enum(request, "sh-order") == 0 ? 2 : 4,
        .dering = get_bool(request, "sh-dering"),
        .keep_lights = get_bool(request, "sh-keep-lights"),
    };
    request->has_projection = is_set(request, "env-projection");
    if (request->has_projection)
        request->projection = (enum gn_projection_type)get_enum(request, "env-projection");
    request->n_threads = get_int(request, "threads");
    request->match = gn_options_get_set(request->options, NULL, NULL, "match");
}

static int check_together(const struct gn_cli_request *request, struct gn_error *out_error)
{
    if (is_set(request, "budget-ms"))
        return gn_error_set(out_error, -ENOTSUP,
                            "--budget-ms: fitting the quality into a time is not built yet; leave "
                            "it out and choose --quality and --lights");
    if (request->render.quality != GN_QUALITY_REFERENCE &&
        (request->render.bounces > 0 || is_set(request, "paths")))
        return gn_error_set(out_error, -EINVAL, "--%s is for --quality reference, not for %s",
                            request->render.bounces > 0 ? "bounces" : "paths",
                            gn_cli_get_quality_name(request->render.quality));
    if (request->composite_png && !request->background)
        return gn_error_set(out_error, -EINVAL,
                            "--composite-png: there is no composite without --background");
    return 0;
}

int gn_cli_request_init(struct gn_cli_request *request, int argc, char *const argv[],
                        struct gn_error *out_error)
{
    *request = (struct gn_cli_request){0};
    if (gn_options_create(&gn_cli_program, &request->options) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int ret = gn_options_read_arguments(request->options, argc, argv, out_error);
    if (ret < 0 || gn_options_wants_help(request->options) ||
        gn_options_wants_version(request->options))
        return ret;
    ret = gn_options_check(request->options, out_error);
    if (ret < 0)
        return ret;
    read_paths(request);
    read_numbers(request);
    ret = check_together(request, out_error);
    request->has_world_from_env = is_set(request, "world-from-env");
    if (ret == 0 && request->has_world_from_env)
        ret =
            read_rotation(get_path(request, "world-from-env"), request->world_from_env, out_error);
    return ret;
}

void gn_cli_request_finish(struct gn_cli_request *request)
{
    gn_options_destroy(&request->options);
    *request = (struct gn_cli_request){0};
}
