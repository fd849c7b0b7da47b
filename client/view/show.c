/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/show.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/view/show_internal.h"
#include "common/clock.h"
#include "common/text.h"

/** How long news stays. */
#define NOTE_NS (3 * GN_NS_PER_S)
/** How long the window says which key to begin with, once it has a picture. */
#define HINT_NS (5 * GN_NS_PER_S)
/** Pictures that come faster than this are shown by turns. */
#define PRESENT_NS (8 * GN_NS_PER_MS)

int gn_show_open(const struct gn_show_options *options, struct gn_show **out_show,
                 struct gn_error *out_error)
{
    *out_show = NULL;
    struct gn_show *s = calloc(1, sizeof(*s));
    if (!s)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    s->no_virtual = options->no_virtual;
    s->no_shadow = options->no_shadow;
    s->world_from_camera.rotation[0] = 1;
    s->is_stale = s->is_hint_wanted = true;
    int err = gn_window_open(options->width, options->height, &s->window, out_error);
    if (!err)
        err = gn_keep_create(options->dir, &s->keep, out_error);
    if (!err && gn_jpeg_create(&s->jpeg) < 0)
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
    if (err)
        gn_show_close(&s);
    *out_show = s;
    return err;
}

static void say(struct gn_show *s, const char *text)
{
    snprintf(s->note, sizeof(s->note), "%s", text);
    s->note_until_ns = gn_clock_get_monotonic_ns() + NOTE_NS;
    s->is_stale = true;
}

void gn_show_close(struct gn_show **show)
{
    struct gn_show *s = *show;
    *show = NULL;
    if (!s)
        return;
    gn_keep_destroy(&s->keep);
    gn_window_close(&s->window);
    gn_jpeg_destroy(&s->jpeg);
    gn_canvas_finish(&s->canvas);
    gn_image8_finish(&s->picture);
    free(s);
}

void gn_show_set_room(struct gn_show *show, const char *room)
{
    snprintf(show->room, sizeof(show->room), "%s", room);
    gn_text_clean(show->room);
}

/** The room, and what is the matter or being done. */
static void set_title(struct gn_show *s)
{
    char title[sizeof(s->title)];
    const char *what = s->sentence[0]                  ? s->sentence
                       : gn_keep_is_recording(s->keep) ? "recording"
                                                       : "h: keys";
    snprintf(title, sizeof(title), "gnomon%s%s - %s", s->room[0] ? ": room " : "", s->room, what);
    if (strcmp(title, s->title) == 0)
        return;
    memcpy(s->title, title, sizeof(title));
    gn_window_set_title(s->window, title);
}

void gn_show_set_wishes(const struct gn_show *show, struct gn_msg_frame *frame)
{
    frame->no_virtual = show->no_virtual;
    frame->no_shadow = show->no_shadow;
}

void gn_show_put_pose(struct gn_show *show, const struct gn_pose *world_from_camera)
{
    show->world_from_camera = *world_from_camera;
}

void gn_show_put_counts(struct gn_show *show, const struct gn_show_counts *counts)
{
    show->counts = *counts;
    if (counts->source) {
        show->source_counts = *counts->source;
        show->counts.source = &show->source_counts;
    }
}

void gn_show_set_state(struct gn_show *show, enum gn_show_state state, const char *sentence)
{
    char text[sizeof(show->sentence)];
    snprintf(text, sizeof(text), "%s", sentence);
    gn_text_clean(text);
    if (show->state == state && strcmp(show->sentence, text) == 0)
        return;
    show->state = state;
    memcpy(show->sentence, text, sizeof(text));
    show->is_stale = true;
}

/** The view's pixels to s->picture. Returns 0 or a negative errno and a sentence. */
static int decode(struct gn_show *s, const struct gn_msg_result_view *view, const uint8_t *data,
                  struct gn_error *error)
{
    struct gn_image8 *picture = &s->picture;
    int width = (int)view->width, height = (int)view->height;
    if (picture->width != width || picture->height != height) {
        gn_image8_finish(picture);
        int err = gn_image8_init(picture, width, height, 3);
        if (err)
            return gn_error_set(error, err, "a picture of %d x %d: %s", width, height,
                                strerror(-err));
    }
    if (view->format == GN_MSG_PICTURE_FORMAT_JPEG)
        return gn_jpeg_decode(s->jpeg, data, view->payload_length, picture, error);
    size_t size = (size_t)width * (size_t)height * 3;
    if (view->format != GN_MSG_PICTURE_FORMAT_RGB8 || view->payload_length != size)
        return gn_error_set(error, -EPROTO, "the result has %u bytes, not %zu",
                            view->payload_length, size);
    memcpy(picture->data, data, size);
    return 0;
}

void gn_show_take_result(struct gn_show *show, const struct gn_msg_result *result,
                         const uint8_t *payload, double latency_ms)
{
    struct gn_show *s = show;
    struct gn_error error = {0};
    uint64_t slot = s->n_of_late++ % GN_SHOW_OF_LATE;
    s->of_late[slot].at_ns = gn_clock_get_monotonic_ns();
    s->of_late[slot].latency_ms = latency_ms;
    s->receipt = result->receipt;
    s->picture_id = result->id;
    s->is_stale = true;
    const struct gn_msg_result_view *view = &result->views[0];
    if (decode(s, view, payload + view->payload_offset, &error) < 0)
        say(s, error.text);
    if (gn_keep_add(s->keep, result, payload, latency_ms, &error) < 0)
        say(s, error.text);
}

void gn_show_take_dropped(struct gn_show *show, const char *why)
{
    snprintf(show->last_drop, sizeof(show->last_drop), "%s", why);
    show->is_stale = true;
}

void gn_show_take_light(struct gn_show *show, const struct gn_msg_lighting_state *state,
                        const uint8_t *payload, size_t payload_bytes)
{
    gn_light_ball_take(&show->light, state, payload, payload_bytes);
    show->is_stale |= show->shows_light;
}

/** What p and r do; said in the window and on stdout. */
static void keep(struct gn_show *s, char key)
{
    struct gn_error error = {0};
    char text[512] = "";
    int err;
    if (key == 'p')
        err = gn_keep_picture(s->keep, s->picture_id, &s->picture, text, sizeof(text), &error);
    else
        err = gn_keep_toggle(s->keep, text, sizeof(text), &error);
    say(s, err ? error.text : text);
    printf("%s\n", err ? error.text : text);
    fflush(stdout);
}

/** False: to end. */
static bool take_key(struct gn_show *s, int key)
{
    switch (key) {
    case GN_WINDOW_KEY_CLOSE:
    case 'q':
        return false;
    case 'f':
        gn_window_toggle_full_screen(s->window);
        break;
    case 'o':
        s->page = (enum gn_show_page)((s->page + 1) % GN_SHOW_N_PAGES);
        break;
    case 'l':
        s->shows_light = !s->shows_light;
        break;
    case 'h':
        s->shows_help = !s->shows_help;
        break;
    case 's':
        s->no_shadow = !s->no_shadow;
        say(s, s->no_shadow ? "shadows off" : "shadows on");
        break;
    case 'v':
        s->no_virtual = !s->no_virtual;
        say(s, s->no_virtual ? "virtual objects off" : "virtual objects on");
        break;
    case 'p':
    case 'r':
        keep(s, (char)key);
        break;
    default:
        return true;
    }
    s->is_stale = true;
    return true;
}

/** What goes by itself after a while: news, the hint. */
static void let_go(struct gn_show *s, int64_t now_ns)
{
    if (s->note[0] && now_ns >= s->note_until_ns) {
        s->note[0] = '\0';
        s->is_stale = true;
    }
    if (s->is_hint_wanted && s->picture.width > 0 && s->hint_until_ns == 0)
        s->hint_until_ns = now_ns + HINT_NS;
    if (s->is_hint_wanted && s->hint_until_ns > 0 && now_ns >= s->hint_until_ns) {
        s->is_hint_wanted = false;
        s->is_stale = true;
    }
}

bool gn_show_pump(struct gn_show *show)
{
    struct gn_show *s = show;
    struct gn_error error = {0};
    int key;
    while ((key = gn_window_poll(s->window, &s->is_stale)) != GN_WINDOW_KEY_NONE) {
        s->is_stale |= s->is_hint_wanted;
        s->is_hint_wanted = false;
        if (!take_key(s, key))
            return false;
    }
    int64_t now_ns = gn_clock_get_monotonic_ns();
    let_go(s, now_ns);
    set_title(s);
    // Who cannot be seen need not draw.
    if (!s->is_stale || now_ns - s->presented_ns < PRESENT_NS || gn_window_is_hidden(s->window))
        return true;
    s->is_stale = false;
    s->presented_ns = now_ns;
    if (gn_window_present(s->window, s->picture.width > 0 ? &s->picture : NULL, gn_show_draw(s),
                          &error) < 0)
        fprintf(stderr, "gnomon view: %s\n", error.text);
    return true;
}
