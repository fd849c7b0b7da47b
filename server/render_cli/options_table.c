/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
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
    {.key = "refine",
     .type = GN_OPTION_DOUBLE,
     .min = 1e-6,
     .max = 1,
     .value_name = "ERROR",
     .help = "Adds passes to the interactive picture, which then tends to the reference's without "
             "bounces and caustics, until it is off by no more: the shadow factor, and virtual "
             "radiance as a share of its mean. Progress goes to stderr."},
    {.key = "passes",
     .type = GN_OPTION_INT,
     .min = GN_PROGRESSIVE_ROUND,
     .max = GN_PROGRESSIVE_PASSES_MAX,
     .value_name = "N",
     .help = "Most passes of --refine; without it 1024."},
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
    {.key = "light-discs",
     .type = GN_OPTION_BOOL,
     .default_value = "true",
     .help = "Keeps small suns out of the method and whole, as discs; --quality and --light-method "
             "seed: never."},
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
     .help = "Time that rendering the picture may take on this machine, busy as it is: it is "
             "rendered until a number of lights and of rays at edges that fits holds, up to 64 "
             "times. --lights is the most there are, 256 without it. The output depends on times."},
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
