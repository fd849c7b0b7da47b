/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/light_ball.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/** Units, as in overlay.c. */
enum { MARGIN = 6, PAD = 6 };
/** Bytes of a light in the payload. */
enum { LIGHT_BYTES = 32 };
/** What the mean radiance is shown as, linear. */
static const double mean_shown = 0.2;

static const struct gn_color panel_color = {{12, 14, 18, 216}};
static const struct gn_color text_color = {{245, 245, 245, 255}};

static float get_f32(const uint8_t *p)
{
    uint32_t bits =
        (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

/** False where it is no light that could be drawn. */
static bool read_light(const uint8_t *p, struct gn_light_ball_light *out)
{
    for (int k = 0; k < 3; k++) {
        out->dir_world[k] = get_f32(p + 4 * k);
        out->irradiance[k] = get_f32(p + 16 + 4 * k);
        if (!isfinite(out->dir_world[k]) || !isfinite(out->irradiance[k]))
            return false;
    }
    // Rec. 709
    out->luminance =
        0.2126f * out->irradiance[0] + 0.7152f * out->irradiance[1] + 0.0722f * out->irradiance[2];
    return out->luminance > 0 && isfinite(out->luminance);
}

/** Keeps the strongest, in order. */
static void keep_light(struct gn_light_ball *ball, const struct gn_light_ball_light *light)
{
    int at = ball->n_drawn;
    while (at > 0 && ball->lights[at - 1].luminance < light->luminance)
        at--;
    if (at == GN_LIGHT_BALL_LIGHTS)
        return;
    if (ball->n_drawn < GN_LIGHT_BALL_LIGHTS)
        ball->n_drawn++;
    memmove(&ball->lights[at + 1], &ball->lights[at],
            (size_t)(ball->n_drawn - 1 - at) * sizeof(*light));
    ball->lights[at] = *light;
}

void gn_light_ball_take(struct gn_light_ball *ball, const struct gn_msg_lighting_state *state,
                        const uint8_t *payload, size_t payload_bytes)
{
    if (state->gone) {
        if (state->probe == ball->probe)
            ball->is_known = false;
        return;
    }
    ball->is_known = true;
    ball->probe = state->probe;
    ball->n_lights = state->light_count;
    memcpy(ball->sh, state->sh, sizeof(ball->sh));
    ball->n_drawn = 0;
    for (size_t i = 0; i < state->light_count && (i + 1) * LIGHT_BYTES <= payload_bytes; i++) {
        struct gn_light_ball_light light;
        if (read_light(payload + i * LIGHT_BYTES, &light))
            keep_light(ball, &light);
    }
}

static int get_diameter(const struct gn_canvas *canvas)
{
    int side = canvas->width < canvas->height ? canvas->width : canvas->height;
    return side / 4 < 96 ? side / 4 : 96;
}

struct gn_overlay_box gn_light_ball_get_box(const struct gn_canvas *canvas)
{
    int diameter = get_diameter(canvas);
    int letters = 12 * GN_FONT_ADVANCE; // of the line below
    struct gn_overlay_box box = {.width = (diameter > letters ? diameter : letters) + 2 * PAD,
                                 .height = diameter + GN_CANVAS_LINE + 3 * PAD};
    box.x = canvas->width - MARGIN - box.width;
    box.y = canvas->height - MARGIN - box.height;
    return box;
}

/**
 * Radiance of the harmonics from dir, per channel; may be below 0.
 * Source: Ramamoorthi and Hanrahan, SIGGRAPH 2001, equation 3, in the order of LIGHTING_STATE.
 */
static void get_radiance(const float sh[static 27], const double d[static 3], double out[static 3])
{
    const double basis[9] = {0.282095,
                             0.488603 * d[1],
                             0.488603 * d[2],
                             0.488603 * d[0],
                             1.092548 * d[0] * d[1],
                             1.092548 * d[1] * d[2],
                             0.315392 * (3 * d[2] * d[2] - 1),
                             1.092548 * d[0] * d[2],
                             0.546274 * (d[0] * d[0] - d[1] * d[1])};
    for (int k = 0; k < 3; k++) {
        out[k] = 0;
        for (int i = 0; i < 9; i++)
            out[k] += basis[i] * (double)sh[3 * i + k];
    }
}

/** IEC 61966-2-1. */
static uint8_t encode(double linear)
{
    double v = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055;
    return (uint8_t)lround(255 * fmin(fmax(v, 0), 1));
}

static void draw_harmonics(const struct gn_light_ball *ball,
                           const struct gn_pose *world_from_camera, struct gn_canvas *canvas,
                           double x0, double y0, double radius)
{
    double mean = 0;
    for (int k = 0; k < 3; k++)
        mean += 0.282095 * (double)ball->sh[k] / 3;
    double gain = mean > 0 ? mean_shown / mean : 0;
    for (int y = (int)(y0 - radius); y <= (int)(y0 + radius); y++) {
        for (int x = (int)(x0 - radius); x <= (int)(x0 + radius); x++) {
            double n[3] = {(x + 0.5 - x0) / radius, (y + 0.5 - y0) / radius, 0};
            double r2 = n[0] * n[0] + n[1] * n[1], dir[3], rgb[3];
            if (r2 > 1 || x < 0 || y < 0 || x >= canvas->image.width || y >= canvas->image.height)
                continue;
            n[2] = -sqrt(1 - r2); // towards the camera, which looks along +z
            const double seen[3] = {-2 * n[2] * n[0], -2 * n[2] * n[1], 1 - 2 * n[2] * n[2]};
            gn_pose_rotate(world_from_camera, seen, dir);
            get_radiance(ball->sh, dir, rgb);
            uint8_t *pixel = gn_image8_at(&canvas->image, x, y);
            for (int k = 0; k < 3; k++)
                pixel[k] = encode(gain * rgb[k]);
            pixel[3] = 255;
        }
    }
}

/** A dot with a dark rim, which is seen on any ground. */
static void draw_dot(struct gn_canvas *canvas, double x0, double y0, double radius,
                     const uint8_t rgb[static 3])
{
    for (int y = (int)(y0 - radius - 1); y <= (int)(y0 + radius + 1); y++) {
        for (int x = (int)(x0 - radius - 1); x <= (int)(x0 + radius + 1); x++) {
            double distance = hypot(x + 0.5 - x0, y + 0.5 - y0);
            if (distance > radius + 1 || x < 0 || y < 0 || x >= canvas->image.width ||
                y >= canvas->image.height)
                continue;
            uint8_t *pixel = gn_image8_at(&canvas->image, x, y);
            for (int k = 0; k < 3; k++)
                pixel[k] = distance > radius ? pixel[k] / 2 : rgb[k];
            pixel[3] = 255;
        }
    }
}

/** Weakest first, so that the strong ones are seen. The ball's normal where it shows a light is
 * halfway between that and the camera. */
static void draw_lights(const struct gn_light_ball *ball, const struct gn_pose *world_from_camera,
                        struct gn_canvas *canvas, double x0, double y0, double radius)
{
    struct gn_pose camera_from_world;
    double sum = 0;
    gn_pose_invert(world_from_camera, &camera_from_world);
    for (int i = 0; i < ball->n_drawn; i++)
        sum += (double)ball->lights[i].luminance;
    for (int i = ball->n_drawn - 1; i >= 0; i--) {
        const struct gn_light_ball_light *light = &ball->lights[i];
        const double world[3] = {light->dir_world[0], light->dir_world[1], light->dir_world[2]};
        double d[3];
        gn_pose_rotate(&camera_from_world, world, d);
        double n[3] = {d[0], d[1], d[2] - 1};
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (!(length > 1e-6)) // straight behind the ball
            continue;
        float largest =
            fmaxf(fmaxf(light->irradiance[0], light->irradiance[1]), light->irradiance[2]);
        uint8_t rgb[3];
        for (int k = 0; k < 3; k++)
            rgb[k] = encode((double)(light->irradiance[k] / largest));
        double area = (double)light->luminance / sum;
        draw_dot(canvas, x0 + radius * n[0] / length, y0 + radius * n[1] / length,
                 radius * fmin(0.02 + 0.3 * sqrt(area), 0.16), rgb);
    }
}

void gn_light_ball_draw(const struct gn_light_ball *ball, const struct gn_pose *world_from_camera,
                        struct gn_canvas *canvas)
{
    struct gn_overlay_box box = gn_light_ball_get_box(canvas);
    char text[32] = "no light yet";
    gn_canvas_fill(canvas, box.x, box.y, box.width, box.height, panel_color);
    if (ball->is_known) {
        int diameter = get_diameter(canvas);
        double radius = 0.5 * diameter * canvas->scale;
        double x0 = (box.x + 0.5 * box.width) * canvas->scale;
        double y0 = (box.y + PAD) * canvas->scale + radius;
        draw_harmonics(ball, world_from_camera, canvas, x0, y0, radius);
        draw_lights(ball, world_from_camera, canvas, x0, y0, radius);
        snprintf(text, sizeof(text), "%u lights", ball->n_lights);
    }
    int width = (int)strlen(text) * GN_FONT_ADVANCE - 1;
    gn_canvas_write(canvas, box.x + (box.width - width) / 2,
                    box.y + box.height - PAD - GN_FONT_CAPITAL_ROWS, text_color, text);
}
