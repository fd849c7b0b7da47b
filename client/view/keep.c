/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/keep.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "client/view/record.h"
#include "common/clock.h"
#include "common/png.h"

#define MAX_DIR_BYTES 2048
#define MAX_PATH_BYTES (MAX_DIR_BYTES + 128)

struct gn_keep {
    char dir[MAX_DIR_BYTES];     // with the slash; "" the working folder
    struct gn_record *recording; // NULL: none
    char path[MAX_PATH_BYTES];   // its folder
    long n_recorded;
};

int gn_keep_create(const char *dir, struct gn_keep **out_keep, struct gn_error *out_error)
{
    *out_keep = NULL;
    struct gn_keep *k = calloc(1, sizeof(*k));
    if (!k)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int n = dir ? snprintf(k->dir, sizeof(k->dir), "%s/", dir) : 0;
    if (n < 0 || (size_t)n >= sizeof(k->dir)) {
        free(k);
        return gn_error_set(out_error, -ENAMETOOLONG, "%.60s...: too long a name for a folder",
                            dir);
    }
    *out_keep = k;
    return 0;
}

static int end_recording(struct gn_keep *k, struct gn_error *out_error)
{
    return gn_record_close(&k->recording, k->n_recorded, true, NULL, out_error);
}

void gn_keep_destroy(struct gn_keep **keep)
{
    struct gn_error error = {0};
    struct gn_keep *k = *keep;
    *keep = NULL;
    if (k && end_recording(k, &error) < 0)
        fprintf(stderr, "gnomon view: %s\n", error.text);
    free(k);
}

/** "DIR/gnomon-20261122-183500.123": local time, which names sort by. */
static void make_name(const struct gn_keep *k, char path[static MAX_PATH_BYTES])
{
    int64_t now_ns = gn_clock_get_realtime_ns();
    time_t now_s = (time_t)(now_ns / GN_NS_PER_S);
    struct tm tm = {0};
    char text[32] = "";
    localtime_r(&now_s, &tm);
    strftime(text, sizeof(text), "%Y%m%d-%H%M%S", &tm);
    snprintf(path, MAX_PATH_BYTES, "%sgnomon-%s.%03d", k->dir, text,
             (int)(now_ns / GN_NS_PER_MS % 1000));
}

int gn_keep_picture(struct gn_keep *keep, uint64_t id, const struct gn_image8 *picture, char *text,
                    size_t size, struct gn_error *out_error)
{
    char name[MAX_PATH_BYTES], path[MAX_PATH_BYTES + 64];
    if (picture->width == 0)
        return gn_error_set(out_error, -ENODATA, "there is no picture yet");
    make_name(keep, name);
    snprintf(path, sizeof(path), "%s-frame%llu.png", name, (unsigned long long)id);
    int err = gn_png_write_file(path, picture, out_error);
    if (!err)
        snprintf(text, size, "kept %s", path);
    return err;
}

int gn_keep_toggle(struct gn_keep *keep, char *text, size_t size, struct gn_error *out_error)
{
    int err;
    if (keep->recording) {
        err = end_recording(keep, out_error);
        snprintf(text, size, "recorded %ld pictures: %s", keep->n_recorded, keep->path);
    } else {
        make_name(keep, keep->path);
        keep->n_recorded = 0;
        err = gn_record_open(keep->path, &keep->recording, out_error);
        snprintf(text, size, "recording: %s", keep->path);
    }
    return err;
}

bool gn_keep_is_recording(const struct gn_keep *keep)
{
    return keep->recording != NULL;
}

int gn_keep_add(struct gn_keep *keep, const struct gn_msg_result *result, const uint8_t *payload,
                double latency_ms, struct gn_error *out_error)
{
    char name[32];
    if (!keep->recording)
        return 0;
    snprintf(name, sizeof(name), "frame%06llu", (unsigned long long)result->id);
    int err = gn_record_add_result(keep->recording, name, result, payload, latency_ms, out_error);
    if (!err) {
        keep->n_recorded++;
        return 0;
    }
    struct gn_error again = {0};
    (void)!end_recording(keep, &again); // of the two reasons the first is the one to tell
    return err;
}
