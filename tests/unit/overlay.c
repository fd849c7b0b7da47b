/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What is drawn over the composites: where a picture lies, letters, panels that stay inside any
 * window whatever a receipt says, the light as a mirror ball shows it. */
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "client/view/fit.h"
#include "client/view/light_ball.h"

static const struct gn_color white = {{255, 255, 255, 255}};

static void assert_fit(struct gn_fit fit, int x, int y, int width, int height)
{
    if (fit.x != x || fit.y != y || fit.width != width || fit.height != height)
        fail_msg("%d, %d: %d x %d", fit.x, fit.y, fit.width, fit.height);
}

static void test_fit(void **state)
{
    (void)state;
    assert_fit(gn_fit_picture(320, 240, 320, 240), 0, 0, 320, 240);
    assert_fit(gn_fit_picture(320, 240, 640, 480), 0, 0, 640, 480);
    assert_fit(gn_fit_picture(320, 240, 500, 240), 90, 0, 320, 240);
    assert_fit(gn_fit_picture(320, 240, 320, 500), 0, 130, 320, 240);
    assert_fit(gn_fit_picture(1920, 1080, 1000, 1000), 0, 218, 1000, 563); // 562.5
    assert_fit(gn_fit_picture(16384, 1, 100, 100), 0, 49, 100, 1);
    assert_fit(gn_fit_picture(65536, 65536, 65536, 65536), 0, 0, 65536, 65536);
    assert_fit(gn_fit_window(640, 480, 1920, 1080, 0), 0, 0, 640, 480);
    assert_fit(gn_fit_window(320, 240, 1920, 1080, 0), 0, 0, 640, 480);
    assert_fit(gn_fit_window(64, 48, 1920, 1080, 0), 0, 0, 640, 480);
    assert_fit(gn_fit_window(400, 100, 1920, 1080, 0), 0, 0, 400, 100);
    assert_fit(gn_fit_window(1920, 1080, 1280, 800, 0), 0, 0, 1280, 720);
    assert_fit(gn_fit_window(320, 240, 1920, 1080, 109), 0, 0, 640, 480);
    assert_fit(gn_fit_window(320, 240, 2560, 1600, 216), 0, 0, 1280, 960);
    assert_fit(gn_fit_window(320, 240, 3840, 2160, 282), 0, 0, 1920, 1440);
    assert_fit(gn_fit_window(640, 480, 1920, 1080, 282), 0, 0, 1280, 960);
    assert_fit(gn_fit_window(1920, 1080, 2560, 1600, 216), 0, 0, 1920, 1080);
}

static const uint8_t *get_pixel(const struct gn_canvas *canvas, int x, int y)
{
    return gn_image8_at(&canvas->image, x, y);
}

static void test_letters(void **state)
{
    (void)state;
    struct gn_canvas canvas = {0};
    assert_int_equal(gn_canvas_begin(&canvas, 960, 720), 0);
    assert_int_equal(canvas.scale, 2);
    assert_int_equal(canvas.width, 480);
    gn_canvas_write(&canvas, 3, 4, white, "T\xe9");
    for (int y = 0; y < 2 * GN_FONT_ROWS; y++) {
        for (int x = 0; x < 2 * GN_FONT_WIDTH; x++) {
            bool is_bar = y < 2, is_stem = x / 2 == 2 && y < 2 * GN_FONT_CAPITAL_ROWS;
            assert_int_equal(get_pixel(&canvas, 6 + x, 8 + y)[3], is_bar || is_stem ? 255 : 0);
            bool is_ink = gn_font_rows['?'][y / 2] >> (4 - x / 2) & 1;
            assert_int_equal(get_pixel(&canvas, 18 + x, 8 + y)[3], is_ink ? 255 : 0);
        }
    }
    // What is kept of an earlier picture, and what lies outside.
    assert_int_equal(gn_canvas_begin(&canvas, 960, 720), 0);
    assert_int_equal(get_pixel(&canvas, 6, 8)[3], 0);
    gn_canvas_write(&canvas, 477, 357, white, "####");
    gn_canvas_write(&canvas, -3, -4, white, "#");
    gn_canvas_fill(&canvas, -5, -5, 1000000, 6, white);
    assert_int_equal(get_pixel(&canvas, 959, 1)[3], 255);
    assert_int_equal(get_pixel(&canvas, 959, 2)[3], 0);
    for (int c = '!'; c <= '~'; c++) {
        bool is_known = strchr("$\\^`{}", c) != NULL;
        for (int row = 0; row < GN_FONT_ROWS; row++)
            is_known = is_known || gn_font_rows[c][row];
        if (!is_known)
            fail_msg("no letter %c", c);
    }
    gn_canvas_finish(&canvas);
}

/** A receipt that says all there can be, at its longest. */
static void fill_receipt(struct gn_msg_receipt *r)
{
    memset(r, 0, sizeof(*r));
    r->queue_ms = r->shadow_ms = 3.4e38f;
    r->lighting_sequence = 1;
    r->lighting_age_ms = -3.4e38f;
    r->lights_used = UINT_MAX;
    r->estimated_error = 3.4e38f;
    r->has_virtual_pixels = true;
    r->virtual_pixels = UINT_MAX;
    r->refined_passes = UINT_MAX;
    r->refined_error = 3.4e38f;
    r->has_budget = true;
    r->budget.busy_ms = 3.4e38f;
    r->budget.misses = UINT64_MAX;
    r->left_out_count = GN_ARRAY_LEN(r->left_out);
    for (int i = 0; i < (int)r->left_out_count; i++) {
        memset(r->left_out[i].pass, 'p', sizeof(r->left_out[i].pass) - 1);
        memset(r->left_out[i].why, i % 2 ? 'w' : ' ', sizeof(r->left_out[i].why) - 1);
    }
}

/** The box of what is drawn; false: nothing is. */
static bool find_ink(const struct gn_canvas *canvas, struct gn_overlay_box *out)
{
    int x0 = INT_MAX, y0 = INT_MAX, x1 = 0, y1 = 0;
    for (int y = 0; y < canvas->image.height; y++) {
        for (int x = 0; x < canvas->image.width; x++) {
            if (get_pixel(canvas, x, y)[3] == 0)
                continue;
            x0 = x < x0 ? x : x0;
            y0 = y < y0 ? y : y0;
            x1 = x >= x1 ? x + 1 : x1;
            y1 = y >= y1 ? y + 1 : y1;
        }
    }
    *out = (struct gn_overlay_box){x0, y0, x1 - x0, y1 - y0};
    return x1 > 0;
}

static void assert_inside(struct gn_canvas *canvas, int x, int y, int right, int bottom)
{
    struct gn_overlay_box ink;
    int scale = canvas->scale;
    assert_true(find_ink(canvas, &ink));
    if (ink.x < x * scale || ink.y < y * scale || ink.x + ink.width > right * scale ||
        ink.y + ink.height > bottom * scale)
        fail_msg("%d, %d: %d x %d", ink.x, ink.y, ink.width, ink.height);
    assert_int_equal(gn_canvas_begin(canvas, canvas->image.width, canvas->image.height), 0);
}

static void test_panels_stay_inside(void **state)
{
    (void)state;
    static const struct gn_overlay_line keys[] = {{"q, Esc", "quit"}, {"o", "figures"}};
    static const struct gn_source_counts counts = {UINT64_MAX, UINT64_MAX, 0, 0, 0, 0, 0, 0, 0};
    struct gn_msg_receipt receipt;
    fill_receipt(&receipt);
    char drop[256];
    memset(drop, 'd', sizeof(drop) - 1);
    drop[255] = '\0';
    const struct gn_overlay_figures figures = {.receipt = &receipt,
                                               .rate_hz = 1e300,
                                               .latency_ms = 1e300,
                                               .latency_max_ms = 1e300,
                                               .n_sent = LONG_MAX,
                                               .n_lost = LONG_MAX,
                                               .last_drop = drop,
                                               .counts = &counts};
    const struct gn_overlay_figures none = {.last_drop = ""};
    static const int sizes[][2] = {{320, 240}, {640, 480}, {1920, 1080}, {200, 1000}, {999, 100}};
    for (size_t i = 0; i < GN_ARRAY_LEN(sizes); i++) {
        struct gn_canvas canvas = {0};
        const struct gn_overlay_box nothing = {0};
        assert_int_equal(gn_canvas_begin(&canvas, sizes[i][0], sizes[i][1]), 0);
        int w = canvas.width, h = canvas.height;
        gn_overlay_draw_figures(&canvas, &none, nothing);
        assert_inside(&canvas, 6, 6, w - 6, h - 6);
        gn_overlay_draw_figures(&canvas, &figures, nothing);
        assert_inside(&canvas, 6, 6, w - 6, h - 6);
        gn_overlay_draw_plan(&canvas, &receipt, nothing);
        assert_inside(&canvas, 6, 6, w - 6, h - 6);
        // A panel goes no further down than a box that it would reach.
        const struct gn_overlay_box taken = {w - 100, h - 60, 94, 54};
        gn_overlay_draw_plan(&canvas, &receipt, taken);
        assert_inside(&canvas, 6, 6, w - 6, taken.x < 380 ? h - 66 : h - 6);
        gn_overlay_draw_note(&canvas, drop, true, taken);
        assert_inside(&canvas, 6, 6, taken.x, h - 6);
        gn_overlay_draw_help(&canvas, "keys", keys, GN_ARRAY_LEN(keys));
        assert_inside(&canvas, 6, 6, w - 6, h - 6);
        gn_canvas_finish(&canvas);
    }
    for (int side = 1; side < 60; side++) { // too small for anything: it must only come back
        struct gn_canvas canvas = {0};
        const struct gn_overlay_box taken = {side / 2, side / 2, side, side};
        assert_int_equal(gn_canvas_begin(&canvas, side, side), 0);
        gn_overlay_draw_figures(&canvas, &figures, taken);
        gn_overlay_draw_plan(&canvas, &receipt, taken);
        gn_overlay_draw_note(&canvas, drop, false, taken);
        gn_overlay_draw_help(&canvas, "keys", keys, GN_ARRAY_LEN(keys));
        gn_canvas_finish(&canvas);
    }
}

static void test_words_of_a_receipt(void **state)
{
    (void)state;
    char text[256];
    struct gn_msg_receipt r = {.refined_error = -1};
    assert_int_equal(gn_overlay_print_budget(&r, text, sizeof(text)), 0);
    assert_int_equal(gn_overlay_print_refined(&r, text, sizeof(text)), 0);
    assert_string_equal(text, "");
    r.refined_passes = 3;
    (void)gn_overlay_print_refined(&r, text, sizeof(text));
    assert_string_equal(text, "3 passes");
    r.refined_error = 0.0125f;
    (void)gn_overlay_print_refined(&r, text, sizeof(text));
    assert_string_equal(text, "3 passes, error 0.0125");
    r.has_budget = true;
    r.budget = (struct gn_msg_budget_use){.budget_ms = 33,
                                          .busy_ms = 28.25f,
                                          .verdict = GN_MSG_BUDGET_VERDICT_FITS,
                                          .lights = 16,
                                          .grid = 3,
                                          .shadow_step = 2,
                                          .misses = 4};
    (void)gn_overlay_print_budget(&r, text, sizeof(text));
    assert_string_equal(text, "28.2 of 33.0 ms (fits): 16 lights, grid 3, step 2; 4 late");
}

/** A light as LIGHTING_STATE's payload has it. */
static void put_light(uint8_t *payload, int i, const float dir[static 3], float red, float rest)
{
    const float values[8] = {dir[0], dir[1], dir[2], 0, red, rest, rest, 0};
    memcpy(payload + (size_t)i * sizeof(values), values, sizeof(values)); // little-endian, as here
}

/** Of the ball's pixels, one at x, y in [-1, 1] of its radius. */
static const uint8_t *get_on_ball(const struct gn_canvas *canvas, double x, double y)
{
    struct gn_overlay_box box = gn_light_ball_get_box(canvas);
    int radius = canvas->height / 8; // a quarter of the shorter side across
    int x0 = box.x + box.width / 2, y0 = box.y + 6 + radius;
    return get_pixel(canvas, (int)lround(x0 + x * radius), (int)lround(y0 + y * radius));
}

static void test_light_ball(void **state)
{
    (void)state;
    static const float to_camera[3] = {0, 0, -1}, right[3] = {1, 0, 0}, down[3] = {0, 1, 0};
    static const float none[3] = {NAN, 0, 0};
    uint8_t payload[4 * 32];
    put_light(payload, 0, to_camera, 9, 0); // red, in the middle
    put_light(payload, 1, right, 1, 1);     // at half the angle
    put_light(payload, 2, none, 100, 100);
    put_light(payload, 3, down, -5, -5);
    struct gn_msg_lighting_state message = {.probe = 3, .sequence = 1, .light_count = 4};
    message.sh[0] = message.sh[1] = message.sh[2] = 1;
    message.sh[3 * 1] = 1; // redder towards +y
    struct gn_light_ball ball = {0};
    gn_light_ball_take(&ball, &message, payload, sizeof(payload));
    assert_int_equal(ball.n_drawn, 2);
    assert_int_equal(ball.n_lights, 4);
    struct gn_canvas canvas = {0};
    assert_int_equal(gn_canvas_begin(&canvas, 320, 240), 0);
    const struct gn_pose straight = {.rotation = {1, 0, 0, 0}};
    gn_light_ball_draw(&ball, &straight, &canvas);
    const uint8_t *p = get_on_ball(&canvas, 0, 0);
    assert_true(p[0] == 255 && p[1] == 0 && p[3] == 255);
    p = get_on_ball(&canvas, M_SQRT1_2, 0);
    assert_true(p[0] == 255 && p[1] == 255 && p[2] == 255);
    p = get_on_ball(&canvas, -M_SQRT1_2, 0); // the harmonics alone
    assert_true(abs(p[0] - p[1]) <= 6 && p[1] == p[2] && p[0] > 60 && p[0] < 200);
    uint8_t level = p[0];
    p = get_on_ball(&canvas, 0, M_SQRT1_2); // y of the picture is down, of this camera's world too
    assert_true(p[0] > level + 20 && p[1] == p[2]);
    assert_inside(&canvas, 160, 120, 314, 234);
    // A camera that looks along world -z, turned about x: what was behind it is in front.
    const struct gn_pose turned = {.rotation = {0, 1, 0, 0}};
    gn_light_ball_draw(&ball, &turned, &canvas);
    p = get_on_ball(&canvas, 0, -M_SQRT1_2);
    assert_true(p[0] > level + 20);

    message.gone = true;
    message.probe = 4;
    gn_light_ball_take(&ball, &message, NULL, 0);
    assert_true(ball.is_known);
    message.probe = 3;
    gn_light_ball_take(&ball, &message, NULL, 0);
    assert_false(ball.is_known);
    assert_int_equal(gn_canvas_begin(&canvas, 320, 240), 0);
    gn_light_ball_draw(&ball, &straight, &canvas);
    assert_true(get_on_ball(&canvas, 0, 0)[0] < 20);
    gn_canvas_finish(&canvas);
}

static void test_light_ball_keeps_the_strongest(void **state)
{
    (void)state;
    enum { N = 300 };
    static uint8_t payload[N * 32];
    static const float right[3] = {1, 0, 0};
    for (int i = 0; i < N; i++)
        put_light(payload, i, right, (float)(i * 7 % N), (float)(i * 7 % N));
    const struct gn_msg_lighting_state message = {.light_count = N};
    struct gn_light_ball ball = {0};
    gn_light_ball_take(&ball, &message, payload, sizeof(payload));
    assert_int_equal(ball.n_drawn, GN_LIGHT_BALL_LIGHTS);
    for (int i = 0; i < GN_LIGHT_BALL_LIGHTS; i++)
        assert_true(ball.lights[i].irradiance[0] == (float)(N - 1 - i));
    gn_light_ball_take(&ball, &message, payload, 100); // a payload that was cut
    assert_int_equal(ball.n_drawn, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fit),
        cmocka_unit_test(test_letters),
        cmocka_unit_test(test_panels_stay_inside),
        cmocka_unit_test(test_words_of_a_receipt),
        cmocka_unit_test(test_light_ball),
        cmocka_unit_test(test_light_ball_keeps_the_strongest),
    };
    return cmocka_run_group_tests_name("overlay", tests, NULL, NULL);
}
