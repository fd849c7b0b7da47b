/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Environment frames with known light, for the tests and benchmarks of server/light. */
#ifndef GN_TESTS_LIGHT_FIXTURE_H
#define GN_TESTS_LIGHT_FIXTURE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/image.h"
#include "server/light/state.h"

/** In double: cmocka's own comparison rounds to float first. Fails for NaN. */
#define assert_near(value, expected, tolerance)                                                    \
    assert_true(fabs((double)(value) - (double)(expected)) <= (double)(tolerance))

/** Whether two lights are the same to the bit (padding has none). */
static inline bool light_fixture_is_same(const struct gn_light *a, const struct gn_light *b)
{
    return a->id == b->id && memcmp(a->dir_world, b->dir_world, sizeof(a->dir_world)) == 0 &&
           memcmp(a->irradiance, b->irradiance, sizeof(a->irradiance)) == 0 &&
           memcmp(a->normal, b->normal, sizeof(a->normal)) == 0 &&
           memcmp(&a->angular_radius, &b->angular_radius, sizeof(a->angular_radius)) == 0 &&
           memcmp(&a->distance, &b->distance, sizeof(a->distance)) == 0;
}

/** A frame and the picture it borrows. */
struct light_fixture {
    struct gn_image image;
    struct gn_environment_frame frame;
};

/** A black linear frame of that projection, its axes the world's; of a cube map the height follows
 * from the width. 0 or a negative errno. */
static inline int light_fixture_init(struct light_fixture *f, enum gn_projection_type type,
                                     int width, int height)
{
    *f = (struct light_fixture){0};
    if (type == GN_PROJECTION_CUBE)
        height = 6 * width;
    int rc = gn_image_init(&f->image, width, height, 3);
    f->frame = (struct gn_environment_frame){
        .projection = {.type = type, .width = width, .height = height},
        .world_from_probe = {1, 0, 0, 0},
    };
    const char *reason = NULL;
    return rc < 0 ? rc : gn_projection_init(&f->frame.projection, &reason);
}

static inline void light_fixture_finish(struct light_fixture *f)
{
    gn_image_finish(&f->image);
}

/** Fills the picture with what radiance says of each texel's direction (probe axes); black outside.
 */
static inline void light_fixture_fill(struct light_fixture *f,
                                      void (*radiance)(const double dir[static 3],
                                                       float out[static 3]))
{
    for (int y = 0; y < f->image.height; y++) {
        for (int x = 0; x < f->image.width; x++) {
            double dir[3];
            float rgb[3] = {0};
            if (gn_projection_get_direction(&f->frame.projection, x + 0.5, y + 0.5, dir))
                radiance(dir, rgb);
            for (int c = 0; c < 3; c++)
                gn_image_at(&f->image, x, y)[c] = rgb[c];
        }
    }
    f->frame.codes = &f->image;
}

static inline void light_fixture_constant(const double dir[static 3], float out[static 3])
{
    (void)dir;
    out[0] = out[1] = out[2] = 1;
}

/** Four lamps of different colour and size and a window, over dim walls and a bright ceiling. */
static inline void light_fixture_room(const double dir[static 3], float out[static 3])
{
    static const struct {
        double dir[3], cos_radius;
        float rgb[3];
    } lamp[4] = {
        {{0.30, 0.25, 0.9206}, 0.9976, {90, 80, 60}},  // 4 degrees
        {{-0.45, 0.35, 0.8216}, 0.9945, {55, 50, 42}}, // 6
        {{-0.20, -0.60, 0.7746}, 0.9962, {60, 62, 70}},
        {{0.65, -0.30, 0.6982}, 0.9986, {95, 70, 45}}, // 3
    };
    float wall = (float)(0.25 + 0.2 * dir[2]);
    out[0] = wall * 1.05f;
    out[1] = wall;
    out[2] = wall * 0.9f;
    if (dir[0] < -0.85 && fabs(dir[1]) < 0.3 && dir[2] > 0.1 && dir[2] < 0.45) {
        out[0] = 5;
        out[1] = 6;
        out[2] = 7.5f;
    }
    for (int i = 0; i < 4; i++) {
        double dot = lamp[i].dir[0] * dir[0] + lamp[i].dir[1] * dir[1] + lamp[i].dir[2] * dir[2];
        for (int c = 0; c < 3 && dot > lamp[i].cos_radius; c++)
            out[c] = lamp[i].rgb[c];
    }
}

#endif
