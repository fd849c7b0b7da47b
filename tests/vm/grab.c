/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Reads pictures from a V4L2 camera as the commands do, says when each was taken, what is told
 * meanwhile and what was counted, and writes the last one's bytes.
 * usage: grab DEVICE FORMAT|- WxH|- HZ N|+N OUT 8|all [CONTROLS]
 * +N: so many after the file OUT.go is there.
 */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "client/capture/v4l2.h"
#include "common/clock.h"

/** Longest time without a picture. */
#define PATIENCE_NS (10 * GN_NS_PER_S)

static int write_file(const char *path, const void *data, size_t n_bytes)
{
    FILE *f = fopen(path, "wb");
    if (!f)
        return -errno;
    bool is_whole = fwrite(data, 1, n_bytes, f) == n_bytes;
    return fclose(f) == 0 && is_whole ? 0 : -EIO;
}

/** Until n pictures have come since the file go (may be NULL) was there. */
static int grab(struct gn_source *source, long n, const char *out, const char *go)
{
    struct gn_capture c = {0};
    struct gn_error error;
    int64_t deadline_ns = gn_clock_get_monotonic_ns() + PATIENCE_NS;
    for (long i = 0; i < n;) {
        int got = gn_source_read(source, &c, &error);
        if (got == 1) {
            printf("picture %" PRId64 " %" PRId64 " %d %dx%d\n", c.time_ns,
                   gn_clock_get_monotonic_ns(), (int)c.format, c.width, c.height);
            i += !go || access(go, F_OK) == 0;
            if (i == n)
                got = write_file(out, c.data, c.data_bytes);
            deadline_ns = gn_clock_get_monotonic_ns() + PATIENCE_NS;
        } else if (got == -EAGAIN && error.text[0]) {
            printf("news %" PRId64 " %s\n", gn_clock_get_monotonic_ns(), error.text);
        }
        fflush(stdout);
        if (got < 0 && got != -EAGAIN) {
            fprintf(stderr, "grab: %s\n", error.text[0] ? error.text : strerror(-got));
            return 1;
        }
        if (gn_clock_get_monotonic_ns() > deadline_ns) {
            fprintf(stderr, "grab: no picture for 10 s\n");
            return 1;
        }
    }
    return 0;
}

int main(int argc, char *argv[])
{
    if (argc != 8 && argc != 9) {
        fprintf(stderr, "usage: grab DEVICE FORMAT|- WxH|- HZ N|+N OUT 8|all [CONTROLS]\n");
        return 2;
    }
    struct gn_live_options options = {
        .id = argv[1],
        .pixel_format = strcmp(argv[2], "-") ? argv[2] : NULL,
        .frame_rate_hz = atof(argv[4]),
        .is_8_bit = strcmp(argv[7], "8") == 0,
        .controls = argc == 9 ? argv[8] : NULL,
    };
    if (strcmp(argv[3], "-"))
        (void)!sscanf(argv[3], "%dx%d", &options.width, &options.height);
    struct gn_source *source = NULL;
    struct gn_error error = {0};
    if (gn_v4l2_open(&options, &source, &error) < 0) {
        fprintf(stderr, "grab: %s\n", error.text);
        return 3;
    }
    char go[256];
    snprintf(go, sizeof(go), "%s.go", argv[6]);
    int status = grab(source, atol(argv[5]), argv[6], argv[5][0] == '+' ? go : NULL);
    struct gn_source_counts n;
    gn_source_get_counts(source, &n);
    printf("counts complete %" PRIu64 " incomplete %" PRIu64 " lost %" PRIu64 " skipped %" PRIu64
           " reopened %" PRIu64 " read_bytes %" PRIu64 " copied_bytes %" PRIu64 "\n",
           n.n_complete, n.n_incomplete, n.n_lost, n.n_skipped, n.n_reopened, n.read_bytes,
           n.copied_bytes);
    gn_source_close(&source);
    return status;
}
