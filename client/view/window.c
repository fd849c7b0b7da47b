/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/window.h"

#include <SDL.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "client/view/fit.h"

struct gn_window {
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *picture; // NULL: none yet
    SDL_Texture *canvas;  // NULL: none yet
    int picture_width, picture_height;
    int canvas_width, canvas_height;
    bool is_shown;   // asked to be
    bool is_hidden;  // nobody can see it
    SDL_Rect before; // full screen that nobody else manages: where it was; w 0: managed
};

static int fail(int err, const char *what, struct gn_error *out_error)
{
    return gn_error_set(out_error, err, "the window: %s: %s", what, SDL_GetError());
}

/** As large as a desktop has room for. Other systems than X enlarge windows by themselves. */
static struct gn_fit choose_size(int width, int height)
{
    SDL_Rect room = {0, 0, 1280, 960};
    float dpi = 0;
    bool is_x11 = strcmp(SDL_GetCurrentVideoDriver(), "x11") == 0;
    if (SDL_GetDisplayUsableBounds(0, &room) != 0 || room.w < 1 || room.h < 1)
        room = (SDL_Rect){0, 0, 1280, 960};
    if (!is_x11 || SDL_GetDisplayDPI(0, &dpi, NULL, NULL) != 0)
        dpi = 0;
    return gn_fit_window(width, height, room.w, room.h, dpi);
}

/** The driver's own renderer; where it has none, the one that always works. */
static SDL_Renderer *create_renderer(SDL_Window *window)
{
    SDL_Renderer *renderer = SDL_CreateRenderer(window, -1, 0);
    return renderer ? renderer : SDL_CreateRenderer(window, -1, SDL_RENDERER_SOFTWARE);
}

static bool has_value(const char *name)
{
    const char *value = getenv(name);
    return value && *value;
}

/** Which of SDL's drivers to try. Left to itself it takes one that shows nothing where there is no
 * display, or a server's console. NULL: none; "": whatever the environment says. */
static const char *choose_driver(void)
{
    if (has_value("SDL_VIDEODRIVER"))
        return "";
    if (has_value("WAYLAND_DISPLAY"))
        return has_value("DISPLAY") ? "x11,wayland" : "wayland";
    return has_value("DISPLAY") ? "x11" : NULL;
}

static int start_video(struct gn_error *out_error)
{
    const char *driver = choose_driver();
    if (!driver)
        return gn_error_set(out_error, -ENODEV,
                            "no display: neither DISPLAY nor WAYLAND_DISPLAY is set");
    if (*driver)
        SDL_SetHint(SDL_HINT_VIDEODRIVER, driver);
    SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1"); // Ctrl-C is the command's
    SDL_SetHint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "1");
    SDL_SetHint(SDL_HINT_VIDEO_X11_NET_WM_BYPASS_COMPOSITOR, "0");
    SDL_SetHint(SDL_HINT_RENDER_VSYNC, "0"); // a connection waits for us
    if (SDL_Init(SDL_INIT_VIDEO) != 0)
        return gn_error_set(out_error, -ENODEV, "no display: %s", SDL_GetError());
    return 0;
}

int gn_window_find_display(struct gn_error *out_error)
{
    int err = start_video(out_error);
    if (!err)
        SDL_Quit();
    return err;
}

int gn_window_open(int width, int height, struct gn_window **out_window, struct gn_error *out_error)
{
    *out_window = NULL;
    int err = start_video(out_error);
    if (err)
        return err;
    struct gn_window *w = calloc(1, sizeof(*w));
    if (!w) {
        err = gn_error_set(out_error, -ENOMEM, "out of memory");
        SDL_Quit();
        return err;
    }
    struct gn_fit size = choose_size(width, height);
    w->window = SDL_CreateWindow(
        "gnomon view", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED, size.width, size.height,
        SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI | SDL_WINDOW_HIDDEN);
    if (w->window)
        w->renderer = create_renderer(w->window);
    if (!w->renderer) {
        err = gn_error_set(out_error, -ENODEV, "no window: %s", SDL_GetError());
        gn_window_close(&w);
    }
    *out_window = w;
    return err;
}

void gn_window_close(struct gn_window **window)
{
    struct gn_window *w = *window;
    *window = NULL;
    if (!w)
        return;
    if (w->picture)
        SDL_DestroyTexture(w->picture);
    if (w->canvas)
        SDL_DestroyTexture(w->canvas);
    if (w->renderer)
        SDL_DestroyRenderer(w->renderer);
    if (w->window)
        SDL_DestroyWindow(w->window);
    SDL_Quit();
    free(w);
}

void gn_window_set_title(struct gn_window *window, const char *title)
{
    SDL_SetWindowTitle(window->window, title);
}

/** Whether a window manager has put a frame round it. */
static bool has_frame(const struct gn_window *w)
{
    int top = 0, left = 0, bottom = 0, right = 0;
    return SDL_GetWindowBordersSize(w->window, &top, &left, &bottom, &right) == 0 &&
           (top > 0 || left > 0 || bottom > 0 || right > 0);
}

/**
 * The window manager makes it fill the screen. Where there is none (a kiosk, a bare X server)
 * nobody does, though SDL 2.26 takes it for done and draws a picture larger than its window: so it
 * is given the screen's size first, which needs no manager.
 */
void gn_window_toggle_full_screen(struct gn_window *window)
{
    struct gn_window *w = window;
    SDL_Rect screen, *before = &w->before;
    if (SDL_GetWindowFlags(w->window) & SDL_WINDOW_FULLSCREEN_DESKTOP) {
        SDL_SetWindowFullscreen(w->window, 0);
        if (before->w > 0) {
            SDL_SetWindowSize(w->window, before->w, before->h);
            SDL_SetWindowPosition(w->window, before->x, before->y);
        }
        return;
    }
    *before = (SDL_Rect){0};
    if (strcmp(SDL_GetCurrentVideoDriver(), "x11") == 0 && !has_frame(w) &&
        SDL_GetDisplayBounds(SDL_GetWindowDisplayIndex(w->window), &screen) == 0) {
        SDL_GetWindowPosition(w->window, &before->x, &before->y);
        SDL_GetWindowSize(w->window, &before->w, &before->h);
        SDL_SetWindowPosition(w->window, screen.x, screen.y);
        SDL_SetWindowSize(w->window, screen.w, screen.h);
    }
    SDL_SetWindowFullscreen(w->window, SDL_WINDOW_FULLSCREEN_DESKTOP);
}

/** Textures do not outlive the device that they are on; the next present makes them again. */
static void drop_textures(struct gn_window *w)
{
    if (w->picture)
        SDL_DestroyTexture(w->picture);
    if (w->canvas)
        SDL_DestroyTexture(w->canvas);
    w->picture = w->canvas = NULL;
}

static void take_visibility(struct gn_window *w, Uint8 event)
{
    if (event == SDL_WINDOWEVENT_HIDDEN || event == SDL_WINDOWEVENT_MINIMIZED)
        w->is_hidden = true;
    if (event == SDL_WINDOWEVENT_SHOWN || event == SDL_WINDOWEVENT_EXPOSED ||
        event == SDL_WINDOWEVENT_RESTORED)
        w->is_hidden = false;
}

bool gn_window_is_hidden(const struct gn_window *window)
{
    return window->is_hidden;
}

int gn_window_poll(struct gn_window *window, bool *out_is_stale)
{
    SDL_Event event;
    while (SDL_PollEvent(&event)) {
        if (event.type == SDL_QUIT)
            return GN_WINDOW_KEY_CLOSE;
        if (event.type == SDL_WINDOWEVENT || event.type == SDL_RENDER_DEVICE_RESET ||
            event.type == SDL_RENDER_TARGETS_RESET)
            *out_is_stale = true;
        if (event.type == SDL_WINDOWEVENT)
            take_visibility(window, event.window.event);
        if (event.type == SDL_RENDER_DEVICE_RESET)
            drop_textures(window);
        if (event.type != SDL_KEYDOWN || event.key.repeat)
            continue;
        SDL_Keycode key = event.key.keysym.sym;
        if (key == SDLK_ESCAPE)
            return GN_WINDOW_KEY_CLOSE;
        if (key >= SDLK_a && key <= SDLK_z)
            return 'a' + (int)(key - SDLK_a);
    }
    return GN_WINDOW_KEY_NONE;
}

void gn_window_get_size(const struct gn_window *window, int *out_width, int *out_height)
{
    int width = 0, height = 0;
    if (SDL_GetRendererOutputSize(window->renderer, &width, &height) != 0)
        width = height = 1;
    *out_width = width < 1 ? 1 : width;
    *out_height = height < 1 ? 1 : height;
}

/** Puts the pixels into *texture, made anew where the size is another. */
static int put(struct gn_window *w, const struct gn_image8 *image, Uint32 format,
               SDL_Texture **texture, int *width, int *height, struct gn_error *out_error)
{
    if (*texture && (*width != image->width || *height != image->height)) {
        SDL_DestroyTexture(*texture);
        *texture = NULL;
    }
    if (!*texture)
        *texture = SDL_CreateTexture(w->renderer, format, SDL_TEXTUREACCESS_STREAMING, image->width,
                                     image->height);
    if (!*texture)
        return fail(-EIO, "no room for a picture", out_error);
    *width = image->width;
    *height = image->height;
    if (SDL_UpdateTexture(*texture, NULL, image->data, image->width * image->channels) != 0)
        return fail(-EIO, "a picture", out_error);
    return 0;
}

/** Pixels stay pixels where each becomes a whole number of them. */
static void draw_picture(struct gn_window *w)
{
    int width, height;
    gn_window_get_size(w, &width, &height);
    struct gn_fit fit = gn_fit_picture(w->picture_width, w->picture_height, width, height);
    bool is_whole = fit.width % w->picture_width == 0 && fit.height % w->picture_height == 0;
    SDL_Rect at = {fit.x, fit.y, fit.width, fit.height};
    SDL_SetTextureScaleMode(w->picture, is_whole ? SDL_ScaleModeNearest : SDL_ScaleModeLinear);
    SDL_RenderCopy(w->renderer, w->picture, NULL, &at);
}

int gn_window_present(struct gn_window *window, const struct gn_image8 *picture,
                      const struct gn_canvas *canvas, struct gn_error *out_error)
{
    struct gn_window *w = window;
    if (!w->is_shown)
        SDL_ShowWindow(w->window);
    w->is_shown = true;
    int err = 0;
    if (picture)
        err = put(w, picture, SDL_PIXELFORMAT_RGB24, &w->picture, &w->picture_width,
                  &w->picture_height, out_error);
    if (!err && canvas)
        err = put(w, &canvas->image, SDL_PIXELFORMAT_RGBA32, &w->canvas, &w->canvas_width,
                  &w->canvas_height, out_error);
    if (err)
        return err;
    SDL_SetRenderDrawColor(w->renderer, 0, 0, 0, 255);
    SDL_RenderClear(w->renderer);
    if (picture)
        draw_picture(w);
    if (canvas) {
        SDL_SetTextureBlendMode(w->canvas, SDL_BLENDMODE_BLEND);
        SDL_RenderCopy(w->renderer, w->canvas, NULL, NULL);
    }
    SDL_RenderPresent(w->renderer);
    return 0;
}
