/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a camera and a frame's view say of exposure, white balance, noise and blur. */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <string.h>

#include "server/room/convert.h"

static struct gn_camera make(void)
{
    const struct gn_msg_camera message = {.width = 4,
                                          .height = 3,
                                          .fx = 5,
                                          .fy = 5,
                                          .has_response = true,
                                          .response = {.type = GN_MSG_RESPONSE_TYPE_SRGB},
                                          .matrix_to_rec709 = {2, 0, 0, 0, 1, 0, 0, 0, 3},
                                          .scale = 7,
                                          .noise_slope = {1e-3, 2e-3, 3e-3},
                                          .noise_offset = {1e-5, 2e-5, 3e-5},
                                          .blur_px = 0.5};
    struct gn_camera camera;
    assert_int_equal(gn_convert_camera(&message, &camera, NULL), 0);
    return camera;
}

static void test_camera(void **state)
{
    (void)state;
    struct gn_camera camera = make();
    assert_true(camera.match.noise_slope[1] == 2e-3 && camera.match.noise_offset[2] == 3e-5);
    assert_true(camera.match.blur_px == 0.5 && camera.response.scale == 7);
}

/* A view that says nothing leaves the camera as it is; what it says counts, each by itself. */
static void test_view(void **state)
{
    (void)state;
    struct gn_camera camera = make();
    struct gn_msg_frame_view view = {0};
    assert_int_equal(gn_convert_view(&view, &camera, NULL), 0);
    assert_true(camera.response.scale == 7 && camera.response.to_rec709[8] == 3);
    view.scale = 0.25;
    assert_int_equal(gn_convert_view(&view, &camera, NULL), 0);
    assert_true(camera.response.scale == 0.25 && camera.response.to_rec709[8] == 3);
    view.scale = 0;
    memcpy(view.matrix_to_rec709, (const double[9]){1, 0, 0, 0, 2, 0, 0, 0, 4},
           sizeof(view.matrix_to_rec709));
    assert_int_equal(gn_convert_view(&view, &camera, NULL), 0);
    assert_true(camera.response.scale == 0.25 && camera.response.to_rec709[8] == 4);
}

static void test_view_refused(void **state)
{
    (void)state;
    struct gn_camera camera = make();
    const struct gn_msg_frame_view view = {.scale = 2,
                                           .matrix_to_rec709 = {1, 0, 0, 1, 0, 0, 0, 0, 1}};
    struct gn_error error = {0};
    assert_int_equal(gn_convert_view(&view, &camera, &error), -EINVAL);
    assert_non_null(strstr(error.text, "finite and invertible"));
    assert_true(camera.response.scale == 7 && camera.response.to_rec709[8] == 3); // untouched
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_camera),
        cmocka_unit_test(test_view),
        cmocka_unit_test(test_view_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
