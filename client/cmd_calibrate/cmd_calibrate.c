/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon calibrate: what a camera or a probe is like, measured from pictures.
 */
#include <stdio.h>
#include <string.h>

#include "client/cmd.h"
#include "client/cmd_calibrate/calibrate_input.h"
#include "common/text.h"
#include "proto/attr.h"

static const struct {
    const char *name;
    int (*run)(int argc, char *const argv[]);
    const char *summary;
} commands[] = {
    {"print", gn_cmd_calibrate_print,
     "the board or marker that is looked for, to be printed (SVG)"},
    {"intrinsics", gn_cmd_calibrate_intrinsics,
     "a camera's lens, from pictures of a chessboard or ChArUco board"},
    {"response", gn_cmd_calibrate_response,
     "codes to light, from a colour chart at several exposures or a stack"},
    {"probe", gn_cmd_calibrate_probe,
     "where a fisheye looks, from markers or lamps; a mirror ball's place"},
};

static void print_help(FILE *out)
{
    fprintf(out, "usage: gnomon calibrate WHAT [OPTION]...\n\n"
                 "Measures a device from pictures of it and writes what was found into its file:\n"
                 "camera.json for gnomon view --camera, probe.json for gnomon probe --setup. Each\n"
                 "changes only what it measures, so that they add up in one file, in any order.\n\n"
                 "WHAT is one of:\n");
    for (size_t i = 0; i < GN_ARRAY_LEN(commands); i++)
        fprintf(out, "  %-10s %s\n", commands[i].name, commands[i].summary);
    fprintf(out, "\nThe steps with figures: docs/calibration.md. `gnomon calibrate WHAT --help`\n"
                 "tells more.\n");
}

int gn_cmd_calibrate(int argc, char *const argv[])
{
    const char *name = argc > 1 ? argv[1] : "";
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        print_help(stdout);
        return 0;
    }
    const char *meant = NULL;
    for (size_t i = 0; i < GN_ARRAY_LEN(commands); i++) {
        if (strcmp(name, commands[i].name) == 0)
            return commands[i].run(argc - 1, argv + 1);
        gn_text_suggest(name, commands[i].name, &meant);
    }
    if (!*name)
        print_help(stderr);
    else if (meant)
        fprintf(stderr, "gnomon calibrate: no '%s'; did you mean '%s'?\n", name, meant);
    else
        fprintf(stderr, "gnomon calibrate: no '%s'; gnomon calibrate --help lists what there is\n",
                name);
    return 2;
}
