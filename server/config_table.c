/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/config.h"

#define SERVER .section = "server"
#define ROOM .section = "room *"

static const struct gn_option table[] = {
    {.key = "config",
     .value_name = "FILE",
     .help = "The configuration file, in the form that --print-config prints. It says which rooms "
             "there are."},
    {.key = "ready-file",
     .value_name = "FILE",
     .help = "Written, whole or not at all, once the server answers: the lines listen=ADDRESS:PORT "
             "and http=ADDRESS:PORT with the ports that were picked."},
    {.key = "print-config",
     .type = GN_OPTION_BOOL,
     .help = "Prints a commented configuration file with every key and its default, and ends."},

    {SERVER, .key = "name", .default_value = "gnomond",
     .help = "The server's name, as clients and the status page show it."},
    {SERVER, .key = "listen", .flag = "listen", .type = GN_OPTION_ADDRESS,
     .default_value = "127.0.0.1:7340",
     .help = "Where clients connect; port 0 picks one. Loopback only: there is no encryption yet."},
    {SERVER, .key = "http", .flag = "http", .type = GN_OPTION_ADDRESS,
     .default_value = "127.0.0.1:7341",
     .help = "Where the status page, /api/v1/status, /metrics, /healthz and /readyz are; port 0 "
             "picks one. Loopback only."},
    {SERVER, .key = "threads", .flag = "threads", .type = GN_OPTION_INT, .min = 0, .max = 256,
     .default_value = "0",
     .help = "Threads that work on pixels, shared by all rooms; 0: one per processor."},
    {SERVER, .key = "log", .flag = "log", .default_value = "I",
     .help = "What is logged: a level E, W, I, D or T, and TOPIC:LEVEL for single topics, as in "
             "W,net:D."},
    {SERVER, .key = "max-connections", .type = GN_OPTION_INT, .min = 1,
     .max = GN_NET_MAX_CONNECTIONS, .default_value = "64",
     .help = "Clients at once; one more is told so and closed."},
    {SERVER, .key = "hello-timeout-ms", .type = GN_OPTION_INT, .min = 10, .max = 600000,
     .default_value = "5000",
     .help = "From connecting to a whole HELLO; then the client is closed."},
    {SERVER, .key = "idle-timeout-ms", .type = GN_OPTION_INT, .min = 0, .max = 86400000,
     .default_value = "30000",
     .help = "Longest time between two whole messages of a client. After half of it the server "
             "sends a PING, whose answer counts. 0: for ever."},
    {SERVER, .key = "stall-timeout-ms", .type = GN_OPTION_INT, .min = 10, .max = 600000,
     .default_value = "10000",
     .help = "A client that has not taken a byte of what waits for it this long is closed."},
    {SERVER, .key = "http-connections", .type = GN_OPTION_INT, .min = 4, .max = 256,
     .default_value = "32", .help = "Browsers' connections at once."},
    {SERVER, .key = "http-timeout-s", .type = GN_OPTION_INT, .min = 1, .max = 600,
     .default_value = "10",
     .help = "An HTTP request that is not whole after this time, and a connection that rests this "
             "long, are closed."},

    {ROOM, .key = "scene", .value_name = "FILE", .is_required = true,
     .help = "The scene: real and virtual objects. A relative path counts from the configuration "
             "file's folder."},
    {ROOM, .key = "budget-ms", .type = GN_OPTION_DOUBLE, .min = 0, .max = GN_LIMIT_BUDGET_MS,
     .default_value = "0",
     .help =
         "Time for each interactive frame, from decoding to the encoded result: lights, rays at "
         "edges and the shadow's resolution are chosen to fit with the least error. 0: none; a "
         "frame may bring its own, and the shorter counts. docs/architecture.md."},
    {ROOM, .key = "light-method", .type = GN_OPTION_ENUM, .choices = GN_LIGHT_METHOD_NAMES,
     .default_value = "partition",
     .help = "How lights are made from the radiance map. partition: the 2007 paper's regions, each "
             "with its energy; seed: those to the letter; penrose: importance samples; median-cut: "
             "regions of equal energy; variance: regions of least spread; inversion: spread points "
             "moved to where the energy is; quadtree: leaves of a tree that holds still in video."},
    {ROOM, .key = "lights", .type = GN_OPTION_INT, .min = 1, .max = GN_LIGHTS_MAX,
     .default_value = "64",
     .help =
         "Lights to aim at, with every method but seed; with budget-ms the most there are, then "
         "256 where nothing is said. A sun's disc is spread over 8 to 32 "
         "directions besides, so a frame's receipt may count more."},
    {ROOM, .key = "light-rings", .type = GN_OPTION_INT, .min = 0, .max = 64, .default_value = "0",
     .help = "Rings of the base division of a hemisphere; 0: the method's own."},
    {ROOM, .key = "light-sectors", .type = GN_OPTION_INT, .min = 0, .max = 256,
     .default_value = "0", .help = "Sectors of the base division; 0: the method's own."},
    {ROOM, .key = "light-max-ls", .type = GN_OPTION_INT, .min = 0, .max = 4096,
     .default_value = "0",
     .help =
         "Most lights that one region is divided into, the paper's maxLS; 0: the method's own."},
    {ROOM, .key = "light-samples", .type = GN_OPTION_INT, .min = 0, .max = 1048576,
     .default_value = "0",
     .help = "Importance samples under the regions; 0: 16 for each region of the base division."},
    {ROOM, .key = "light-metric", .type = GN_OPTION_ENUM, .choices = GN_METRIC_NAMES,
     .default_value = "default",
     .help = "How a region's deviation becomes its number of lights; default: the method's own."},
    {ROOM, .key = "light-literal", .type = GN_OPTION_SET, .choices = GN_READ_NAMES,
     .default_value = "none",
     .help = "Readings of the paper's partition taken to the letter besides the method's own "
             "(seed: all but the last). docs/lighting.md explains each."},
    {ROOM, .key = "light-mended", .type = GN_OPTION_SET, .choices = GN_READ_NAMES,
     .default_value = "none",
     .help = "Readings not taken to the letter after all; wins over light-literal."},
    {ROOM, .key = "light-weights", .type = GN_OPTION_ENUM, .choices = GN_WEIGHTS_NAMES,
     .default_value = "partition",
     .help = "What each importance sample stands for (penrose): the light of all texels nearest "
             "to it; the same power; or its radiance over the samples' density."},
    {ROOM, .key = "light-relaxed", .type = GN_OPTION_BOOL, .default_value = "false",
     .help = "Moves importance samples by the correction table: laid out more evenly, but they "
             "move when the light changes. For light that stands still; gnomon-render, which sees "
             "one moment, has it on."},
    {ROOM, .key = "light-discs", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "Keeps small suns out of the method and whole, as discs (seed: never); false: they go "
             "through the method."},
    {ROOM, .key = "light-smoothing-ms", .type = GN_OPTION_DOUBLE, .min = 0, .max = 10000,
     .default_value = "400",
     .help = "Time constant by which light at rest follows the environment frames, so that the "
             "sensor's noise does not move it; what changes by more than noise is followed within "
             "100 ms whatever is given here. 0: each frame stands alone."},
    {ROOM, .key = "emitter-pieces", .type = GN_OPTION_INT, .min = 1, .max = GN_NEAR_LIGHTS_MAX,
     .default_value = "32",
     .help = "Into how many lights the scene's emissive meshes are cut together; one that faces "
             "several ways has one for each of up to 6 in any case."},
    {ROOM, .key = "environment-noise", .type = GN_OPTION_DOUBLE, .min = 0, .max = 0.1,
     .default_value = "0",
     .help = "An environment frame that differs from the last one worked on by at most this share "
             "of each texel's light counts as the same, and is not worked on. 0: only frames that "
             "are the same to the byte, so that no result depends on it. More spares work under a "
             "sensor's noise; results may then be off by some codes where a method would have "
             "divided its lights anew."},
    {ROOM, .key = "ground-albedo", .type = GN_OPTION_DOUBLE, .min = 0, .max = 1,
     .default_value = "0.2",
     .help = "Reflectance of the ground that fills the half of the sphere that a fisheye does not "
             "show; 0: black."},
    {ROOM, .key = "shading", .type = GN_OPTION_ENUM, .choices = GN_SHADING_NAMES,
     .default_value = "lights",
     .help = "How diffuse virtual objects are lit: by the lights, with shadow rays, or by the "
             "irradiance of their normals, without shadows on them: the paper's two variants."},
    {ROOM, .key = "sh-order", .type = GN_OPTION_ENUM, .choices = "2|4", .default_value = "4",
     .help = "Order of the irradiance's spherical harmonics: 9 or 25 coefficients."},
    {ROOM, .key = "sh-dering", .type = GN_OPTION_BOOL, .default_value = "false",
     .help = "Smooths the harmonics until they are nowhere negative; false: what is negative "
             "counts as 0, which is nearer to the truth on photographs."},
    {ROOM, .key = "sh-keep-lights", .type = GN_OPTION_BOOL, .default_value = "false",
     .help = "Leaves small bright lights in the harmonics, as the paper does; false: they are "
             "added exactly."},
    {ROOM, .key = "shadows", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "Virtual objects cast shadows on real surfaces."},
    {ROOM, .key = "shadow-cosine", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "Lights count in the shadow by the cosine of their angle; false: all the same, as in "
             "the paper."},
    {ROOM, .key = "shadow-real-blockers", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "What real objects already shade is not shaded again; false: as in the paper."},
    {ROOM, .key = "refine", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "Interactive views whose pose, light and scene hold still are refined from frame to "
             "frame, within their budget, until they are as the reference without bounces and "
             "caustics; false: they are rendered like any."},
    {ROOM, .key = "composite", .type = GN_OPTION_ENUM, .choices = "linear|codes",
     .default_value = "linear",
     .help = "Where the shadow is multiplied in: in linear light, or on the picture's codes, as in "
             "the paper. Frames of quality seed always use the codes."},
    {ROOM, .key = "match", .type = GN_OPTION_SET, .choices = GN_MATCH_NAMES, .default_value = "all",
     .help = "What of their cameras virtual pixels are given; the rest counts as if nobody had "
             "said it. docs/frames.md explains each."},
    {ROOM, .key = "allow-reference", .type = GN_OPTION_BOOL, .default_value = "true",
     .help = "Renders frames that ask for reference quality. One can take minutes, and the room's "
             "other viewers wait for it."},
    {ROOM, .key = "max-picture-width", .type = GN_OPTION_INT, .min = 1, .max = GN_LIMIT_SIDE_PX,
     .default_value = "1920", .help = "px: widest camera picture that is let in."},
    {ROOM, .key = "max-picture-height", .type = GN_OPTION_INT, .min = 1, .max = GN_LIMIT_SIDE_PX,
     .default_value = "1200", .help = "px: highest camera picture that is let in."},
    {ROOM, .key = "max-environment-width", .type = GN_OPTION_INT, .min = 1, .max = GN_LIMIT_SIDE_PX,
     .default_value = "4096", .help = "px: widest environment frame that is let in."},
    {ROOM, .key = "max-environment-height", .type = GN_OPTION_INT, .min = 1,
     .max = GN_LIMIT_SIDE_PX, .default_value = "2048",
     .help = "px: highest environment frame that is let in."},
    {ROOM, .key = "rate-margin", .type = GN_OPTION_DOUBLE, .min = 0.1, .max = 1,
     .default_value = "0.8",
     .help = "Share of the measured rate that the room promises to its viewers: 1000 ms over the "
             "median time of the last 100 frames, each scaled by its pixels to 640x480."},
};

static const char notes[] =
    "Start a room and look at it:\n"
    "  gnomond --print-config > gnomond.conf   # then set scene= in [room demo]\n"
    "  gnomond --config gnomond.conf           # the page: http://127.0.0.1:7341/\n"
    "  gnomon probe ... and gnomon view ...    # light in, pictures in and out\n"
    "\n"
    "Stop it with SIGTERM or SIGINT: every client is told. A value is taken from the\n"
    "command line before the environment (GNOMON_SERVER_THREADS), that before the\n"
    "file; the keys of a [room NAME] are --room.NAME.KEY on the command line.\n";

const struct gn_program gn_gnomond_program = {
    .name = "gnomond",
    .usage = "--config FILE [OPTION]...",
    .summary = "Puts virtual objects into live camera pictures, lit by the light that is really "
               "there: takes light from probes and pictures from viewers, and sends the pictures "
               "back with the objects in them.",
    .notes = notes,
    .options = table,
    .n_options = (int)GN_ARRAY_LEN(table),
};
