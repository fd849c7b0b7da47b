/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * gnomon: the clients of gnomond as one program with commands.
 */
#include <malloc.h>
#include <stdio.h>
#include <string.h>

#include "client/cmd.h"
#include "common/text.h"
#include "proto/attr.h"

static const struct {
    const char *name;
    int (*run)(int argc, char *const argv[]);
    const char *summary;
} commands[] = {
    {"probe", gn_cmd_probe, "stream environment frames: the light of the room"},
    {"screen", gn_cmd_screen, "stream pictures onto a screen of the scene: near light"},
    {"track", gn_cmd_track, "stream poses of an object of the scene: it moves"},
    {"view", gn_cmd_view, "stream camera frames and poses, write the composited frames"},
    {"calibrate", gn_cmd_calibrate, "measure a camera or a probe from pictures"},
    {"replay", gn_cmd_replay, "send a recording's messages again, to the bit"},
    {"doctor", gn_cmd_doctor, "say what on this machine works"},
};

static void print_help(FILE *out)
{
    fprintf(out, "usage: gnomon COMMAND [OPTION]...\n\nThe clients of gnomond:\n");
    for (size_t i = 0; i < GN_ARRAY_LEN(commands); i++)
        fprintf(out, "  %-9s %s\n", commands[i].name, commands[i].summary);
    fprintf(out, "\n`gnomon COMMAND --help` tells more. A first try: deploy/quickstart.\n");
}

/** What could not be printed makes a failure of success. */
static int finish_output(int status)
{
    if (fflush(stdout) == 0 && !ferror(stdout))
        return status;
    fprintf(stderr, "gnomon: cannot write to the standard output\n");
    return status ? status : 1;
}

/**
 * Keeps freed memory for the next picture. By itself glibc gives pieces of a picture's size back to
 * the kernel at once, and each picture then costs a page fault per 4 KiB of whatever OpenCV makes
 * of it: a quarter of the time that searching it for markers takes.
 */
static void keep_memory(void)
{
    (void)mallopt(M_MMAP_THRESHOLD, 32 << 20); // the most that glibc takes
    (void)mallopt(M_TRIM_THRESHOLD, 128 << 20);
}

int main(int argc, char *argv[])
{
    const char *name = argc > 1 ? argv[1] : "";
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0) {
        print_help(stdout);
        return finish_output(0);
    }
    if (strcmp(name, "--version") == 0) {
        printf("gnomon %s\n", GN_VERSION);
        return finish_output(0);
    }
    const char *meant = NULL;
    for (size_t i = 0; i < GN_ARRAY_LEN(commands); i++) {
        if (strcmp(name, commands[i].name) == 0) {
            keep_memory();
            int status = commands[i].run(argc - 1, argv + 1);
            return finish_output(status);
        }
        gn_text_suggest(name, commands[i].name, &meant);
    }
    if (!*name)
        print_help(stderr);
    else if (meant)
        fprintf(stderr, "gnomon: no command '%s'; did you mean '%s'?\n", name, meant);
    else
        fprintf(stderr, "gnomon: no command '%s'; gnomon --help lists them\n", name);
    return 2;
}
