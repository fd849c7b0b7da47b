/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/window.h"

#include <SDL.h>
#include <errno.h>
#include <stdlib.h>

#include "client/view/fit.h"

struct gn_window {
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *picture; // NULL: none yet
    SDL_Texture *canvas;  // NULL: none yet
    int picture_width, picture_height;
    int canvas_width, canvas_height;
    bool is_shown;
};

static int fail(int err, const char *what, struct gn_error *out_error)
{
    return gn_error_set(out_error, err, "the window: %s: %s", what, SDL_GetError());
}

/** As large as a desktop has room for. */
static struct gn_fit choose_size(int width, int height)
{
    SDL_Rect room;
    if (SDL_GetDisplayUsableBounds(0, &room) != 0 || room.w < 1 || room.h < 1)
        return gn_fit_window(width, height, 1280, 960);
    return gn_fit_window(width, height, room.w, room.h);
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

int gn_window_open(int width, int height, struct gn_window **out_window, struct gn_error *out_error)
{
    *out_window = NULL;
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
    int err = 0;
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

void gn_window_toggle_full_screen(struct gn_window *window)
{
    bool is_full = SDL_GetWindowFlags(window->window) & SDL_WINDOW_FULLSCREEN_DESKTOP;
    SDL_SetWindowFullscreen(window->window, is_full ? 0 : SDL_WINDOW_FULLSCREEN_DESKTOP);
}

/** Textures do not outlive the device that they are on. The picture comes again with its next
 * frame. */
static void drop_textures(struct gn_window *w)
{
    if (w->picture)
        SDL_DestroyTexture(w->picture);
    if (w->canvas)
        SDL_DestroyTexture(w->canvas);
    w->picture = w->canvas = NULL;
}

int gn_window_poll(struct gn_window *window, bool *out_is_stale)
{
    SDL_Event event;
    while (SDL_PollEvent(&event)) {
        if (event.type == SDL_QUIT)
            return GN_WINDOW_KEY_CLOSE;
        if (event.type == SDL_WINDOWEVENT)
            *out_is_stale = true;
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

int gn_window_put_picture(struct gn_window *window, const struct gn_image8 *picture,
                          struct gn_error *out_error)
{
    return put(window, picture, SDL_PIXELFORMAT_RGB24, &window->picture, &window->picture_width,
               &window->picture_height, out_error);
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

int gn_window_present(struct gn_window *window, const struct gn_canvas *canvas,
                      struct gn_error *out_error)
{
    struct gn_window *w = window;
    if (!w->is_shown)
        SDL_ShowWindow(w->window);
    w->is_shown = true;
    int err = canvas ? put(w, &canvas->image, SDL_PIXELFORMAT_RGBA32, &w->canvas, &w->canvas_width,
                           &w->canvas_height, out_error)
                     : 0;
    if (err)
        return err;
    SDL_SetRenderDrawColor(w->renderer, 0, 0, 0, 255);
    SDL_RenderClear(w->renderer);
    if (w->picture)
        draw_picture(w);
    if (canvas) {
        SDL_SetTextureBlendMode(w->canvas, SDL_BLENDMODE_BLEND);
        SDL_RenderCopy(w->renderer, w->canvas, NULL, NULL);
    }
    SDL_RenderPresent(w->renderer);
    return 0;
}
