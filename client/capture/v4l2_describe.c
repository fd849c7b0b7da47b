/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What the cameras of V4L2 offer, as lines for people. */
#include <stdio.h>
#include <string.h>

#include "client/capture/v4l2_device.h"

/** Words into lines. */
struct lines {
    gn_v4l2_say_fn say;
    void *context;
    const char *head; // of each line
    char text[100];
    size_t n;
};

static void flush(struct lines *l)
{
    if (l->n)
        l->say(l->context, 1, l->text);
    l->n = 0;
}

static void add(void *lines, const char *word)
{
    struct lines *l = lines;
    if (l->n && l->n + 2 + strlen(word) >= sizeof(l->text))
        flush(l);
    size_t room = sizeof(l->text) - l->n;
    int n = l->n ? snprintf(l->text + l->n, room, ", %s", word)
                 : snprintf(l->text, room, "%s %s", l->head, word);
    l->n += (size_t)n < room ? (size_t)n : room - 1;
}

/** Only formats that we do not read. */
static void add_unread(void *lines, const char *word)
{
    for (int i = 0; gn_v4l2_pixels_get(i); i++) {
        if (strcmp(gn_v4l2_pixels_get(i)->name, word) == 0)
            return;
    }
    add(lines, word);
}

/** Keeps whether a name came by. */
struct search {
    const char *name;
    bool is_found;
};

static void find(void *search, const char *word)
{
    struct search *s = search;
    s->is_found = s->is_found || strcmp(s->name, word) == 0;
}

int gn_v4l2_describe(const struct gn_v4l2_io *io, const char *path, gn_v4l2_say_fn say,
                     void *context, struct gn_error *out_error)
{
    struct gn_v4l2_device d;
    int err = gn_v4l2_device_open(io, path, &d, out_error);
    if (err)
        return err;
    char text[128];
    snprintf(text, sizeof(text), "%s: %s", d.path, d.card);
    say(context, 0, text);
    struct lines lines = {.say = say, .context = context};
    for (int i = 0; gn_v4l2_pixels_get(i); i++) {
        const struct gn_v4l2_pixels *p = gn_v4l2_pixels_get(i);
        struct search search = {p->name, false};
        gn_v4l2_device_list_formats(&d, find, &search);
        if (!search.is_found)
            continue;
        lines.head = p->name;
        gn_v4l2_device_list_sizes(&d, p->fourcc, add, &lines);
        if (!lines.n)
            add(&lines, "sizes of its own choice");
        flush(&lines);
    }
    lines.head = "controls:";
    gn_v4l2_device_list_controls(&d, add, &lines);
    flush(&lines);
    lines.head = "not read:";
    gn_v4l2_device_list_formats(&d, add_unread, &lines);
    flush(&lines);
    gn_v4l2_device_close(&d);
    return 0;
}

int gn_v4l2_describe_all(gn_v4l2_say_fn say, void *context)
{
    int n = 0;
    for (int i = 0; i < GN_V4L2_MAX_NODES; i++) {
        char path[32];
        snprintf(path, sizeof(path), "/dev/video%d", i);
        n += gn_v4l2_describe(&gn_v4l2_kernel, path, say, context, NULL) == 0;
    }
    return n;
}
