/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/show.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/view/keep.h"
#include "client/view/light_ball.h"
#include "client/view/overlay.h"
#include "client/view/window.h"
#include "common/clock.h"
#include "common/jpeg.h"

/** How long news stays. */
#define NOTE_NS (3 * GN_NS_PER_S)
/** Results that the rate and the largest latency are of. */
#define N_OF_LATE 32
/** Pictures that come faster than this are shown by turns. */
#define PRESENT_NS (8 * GN_NS_PER_MS)

/** What o goes through. */
enum page { PAGE_NONE = 0, PAGE_FIGURES, PAGE_PLAN, N_PAGES };

static const struct gn_overlay_line keys[] = {
    {"q, Esc", "quit"},
    {"f", "full screen"},
    {"o", "figures of the picture; the plan; none"},
    {"l", "the light, as a mirror ball sees it"},
    {"s", "shadows on, off"},
    {"v", "virtual objects on, off"},
    {"p", "keep this picture (PNG)"},
    {"r", "record all (PNG, receipts); end it"},
    {"h", "these keys"},
};

struct gn_show {
    struct gn_window *window;
    struct gn_keep *keep;
    struct gn_jpeg *jpeg;
    struct gn_canvas canvas;
    struct gn_image8 picture; // what is shown; width 0: nothing yet
    uint64_t picture_id;
    struct gn_msg_receipt receipt; // of it
    struct gn_light_ball light;
    struct gn_pose world_from_camera;
    struct gn_show_counts counts; // source: NULL or &source_counts
    struct gn_source_counts source_counts;
    enum page page;
    bool shows_help, shows_light, no_virtual, no_shadow;
    bool is_stale; // to be drawn again
    int64_t presented_ns;
    char note[512];
    int64_t note_until_ns;
    char trouble[512]; // "": none
    char last_drop[256];
    struct {
        int64_t at_ns;
        double latency_ms;
    } of_late[N_OF_LATE]; // a ring
    uint64_t n_of_late;
};

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
    s->is_stale = true;
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

void gn_show_set_title(struct gn_show *show, const char *title)
{
    gn_window_set_title(show->window, title);
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

void gn_show_set_trouble(struct gn_show *show, const char *sentence)
{
    sentence = sentence ? sentence : "";
    if (strncmp(show->trouble, sentence, sizeof(show->trouble) - 1) == 0)
        return;
    snprintf(show->trouble, sizeof(show->trouble), "%s", sentence);
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
    uint64_t slot = s->n_of_late++ % N_OF_LATE;
    s->of_late[slot].at_ns = gn_clock_get_monotonic_ns();
    s->of_late[slot].latency_ms = latency_ms;
    s->receipt = result->receipt;
    s->picture_id = result->id;
    s->is_stale = true;
    const struct gn_msg_result_view *view = &result->views[0];
    int err = decode(s, view, payload + view->payload_offset, &error);
    if (!err)
        err = gn_window_put_picture(s->window, &s->picture, &error);
    if (err)
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
        s->page = (enum page)((s->page + 1) % N_PAGES);
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

static void draw_page(struct gn_show *s, struct gn_overlay_box taken)
{
    struct gn_overlay_figures figures = {
        .receipt = s->picture.width > 0 ? &s->receipt : NULL,
        .n_sent = s->counts.n_sent,
        .n_results = s->counts.n_results,
        .n_dropped = s->counts.n_dropped,
        .n_lost = s->counts.n_lost,
        .last_drop = s->last_drop,
        .counts = s->counts.source,
    };
    if (s->page == PAGE_PLAN) {
        gn_overlay_draw_plan(&s->canvas, &s->receipt, taken);
        return;
    }
    uint64_t n = s->n_of_late < N_OF_LATE ? s->n_of_late : N_OF_LATE;
    for (uint64_t i = 0; i < n; i++)
        figures.latency_max_ms = fmax(figures.latency_max_ms, s->of_late[i].latency_ms);
    if (n > 0)
        figures.latency_ms = s->of_late[(s->n_of_late - 1) % N_OF_LATE].latency_ms;
    if (n > 1) {
        int64_t last_ns = s->of_late[(s->n_of_late - 1) % N_OF_LATE].at_ns;
        int64_t first_ns = s->of_late[(s->n_of_late - n) % N_OF_LATE].at_ns;
        if (last_ns > first_ns)
            figures.rate_hz = (double)(n - 1) * 1e9 / (double)(last_ns - first_ns);
    }
    gn_overlay_draw_figures(&s->canvas, &figures, taken);
}

/** The sentence at the lower left, if any: what is wrong, what is new, what is being done. */
static const char *get_note(const struct gn_show *s, bool *out_is_warning)
{
    *out_is_warning = s->trouble[0];
    if (s->trouble[0])
        return s->trouble;
    if (s->note[0])
        return s->note;
    if (s->picture.width == 0)
        return s->last_drop[0] ? s->last_drop : "waiting for the first picture";
    return gn_keep_is_recording(s->keep) ? "recording" : NULL;
}

/** What lies over the picture; NULL: nothing. */
static const struct gn_canvas *draw_canvas(struct gn_show *s)
{
    bool is_warning;
    const char *note = get_note(s, &is_warning);
    if (!note && s->page == PAGE_NONE && !s->shows_light && !s->shows_help)
        return NULL;
    int width, height;
    gn_window_get_size(s->window, &width, &height);
    if (gn_canvas_begin(&s->canvas, width, height) < 0)
        return NULL;
    if (s->shows_help) {
        gn_overlay_draw_help(&s->canvas, "keys", keys, GN_ARRAY_LEN(keys));
        return &s->canvas;
    }
    struct gn_overlay_box taken = {0};
    if (s->shows_light) {
        taken = gn_light_ball_get_box(&s->canvas);
        gn_light_ball_draw(&s->light, &s->world_from_camera, &s->canvas);
    }
    if (s->page != PAGE_NONE)
        draw_page(s, taken);
    if (note)
        gn_overlay_draw_note(&s->canvas, note, is_warning, taken);
    return &s->canvas;
}

bool gn_show_pump(struct gn_show *show)
{
    struct gn_show *s = show;
    struct gn_error error = {0};
    int key;
    while ((key = gn_window_poll(s->window, &s->is_stale)) != GN_WINDOW_KEY_NONE) {
        if (!take_key(s, key))
            return false;
    }
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (s->note[0] && now_ns >= s->note_until_ns) {
        s->note[0] = '\0';
        s->is_stale = true;
    }
    if (!s->is_stale || now_ns - s->presented_ns < PRESENT_NS)
        return true;
    s->is_stale = false;
    s->presented_ns = now_ns;
    if (gn_window_present(s->window, draw_canvas(s), &error) < 0)
        fprintf(stderr, "gnomon view: %s\n", error.text);
    return true;
}
