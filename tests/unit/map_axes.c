/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Our lat-long axes against OpenEXR's: one scene as lat-long and as cube must agree through our
 * directions, and no longer once a mirror is put between. OpenEXR's y is up and the middle of its
 * lat-long is +z, the right half -x (ImfEnvmap.h): ours are (x, y, z) = (its z, x, y).
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "common/exr.h"
#include "common/projection.h"
#include "tests/real_data.h"

/* The pixel of OpenEXR's cube (faces +X, -X, +Y, -Y, +Z, -Z from the top) that shows d. */
static const float *look_up_cube(const struct gn_image *cube, const double d[static 3])
{
    double ax = fabs(d[0]), ay = fabs(d[1]), az = fabs(d[2]), last = cube->width - 1, x, y;
    int face;
    if (ax >= ay && ax >= az) {
        double u = (d[1] / ax + 1) / 2 * last, v = (d[2] / ax + 1) / 2 * last;
        face = d[0] > 0 ? 0 : 1;
        x = face == 0 ? v : last - v;
        y = last - u;
    } else if (ay >= az) {
        face = d[1] > 0 ? 2 : 3;
        x = (d[0] / ay + 1) / 2 * last;
        y = (d[2] / ay + 1) / 2 * last;
        y = face == 2 ? last - y : y;
    } else {
        face = d[2] > 0 ? 4 : 5;
        x = (d[0] / az + 1) / 2 * last;
        x = face == 4 ? last - x : x;
        y = last - (d[1] / az + 1) / 2 * last;
    }
    return gn_image_at(cube, (int)(x + 0.5), (int)(y + 0.5) + face * cube->width);
}

/* Mean absolute difference, sign applied to our x, y, z. */
static double compare(const struct gn_image *map, const struct gn_image *cube,
                      const double sign[static 3])
{
    struct gn_projection p = {
        .type = GN_PROJECTION_LATLONG, .width = map->width, .height = map->height};
    double sum = 0;
    assert_int_equal(gn_projection_init(&p, NULL), 0);
    for (int i = 0; i < map->width * map->height; i++) {
        double d[3];
        int x = i % map->width, y = i / map->width;
        assert_true(gn_projection_get_direction(&p, x + 0.5, y + 0.5, d));
        const float *a = gn_image_at(map, x, y);
        const float *b =
            look_up_cube(cube, (double[3]){sign[1] * d[1], sign[2] * d[2], sign[0] * d[0]});
        for (int c = 0; c < 3; c++)
            sum += fmin(fabs((double)a[c] - (double)b[c]), 1); // the sun is one texel
    }
    return sum / map->width / map->height / 3;
}

static void test_latlong_is_openexr_cube(void **state)
{
    (void)state;
    char name[PATH_MAX];
    struct gn_image map, cube;
    real_data_path("hdr/equirect/KernerEnvLatLong.exr", name);
    assert_int_equal(gn_exr_read_file(name, &map, NULL, NULL), 0);
    real_data_path("hdr/mapping/KernerEnvCube.exr", name);
    assert_int_equal(gn_exr_read_file(name, &cube, NULL, NULL), 0);
    double right = compare(&map, &cube, (double[3]){1, 1, 1});
    for (int axis = 0; axis < 3; axis++) {
        double sign[3] = {1, 1, 1};
        sign[axis] = -1;
        double mirrored = compare(&map, &cube, sign);
        if (!(mirrored > 4 * right))
            fail_msg("axis %d mirrored: %g, as it is: %g", axis, mirrored, right);
    }
    gn_image_finish(&map);
    gn_image_finish(&cube);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_with_real_data(test_latlong_is_openexr_cube, "hdr/mapping/KernerEnvCube.exr"),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
