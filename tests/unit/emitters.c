/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Emissive meshes and lamps as near lights: energy, places, pictures. */
#include "server/light/emitters.h"

#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "server/light/picture_mean.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/meshes.h"

/** A turned, moved, mirroring frame; rows are unit and orthogonal. */
static const double tilted[16] = {0.6, 0, 0.8, 3, 0, -1, 0, -2, -0.8, 0, 0.6, 1, 0, 0, 0, 1};

static struct gn_mesh make_quad(float width, float height)
{
    struct gn_mesh mesh = gn_test_make_plane(1, 1);
    for (int i = 0; i < mesh.n_vertices; i++) {
        mesh.positions[3 * i] *= width;
        mesh.positions[3 * i + 1] *= height;
    }
    return mesh;
}

static struct gn_scene *make_scene(struct gn_mesh mesh, const float emission[static 3],
                                   const char *stream)
{
    struct gn_scene_object object = {
        .role = GN_RT_REAL, .mesh = mesh, .emission_scale = stream ? 100.0f : 0};
    struct gn_scene *scene = NULL;
    struct gn_error error = {0};
    memcpy(object.world_from_object, tilted, sizeof(tilted));
    memcpy(object.emission, emission, sizeof(object.emission));
    object.emission_stream = stream ? strdup(stream) : NULL;
    assert_int_equal(gn_scene_create(&object, 1, NULL, &scene, &error), 0);
    return scene;
}

static struct gn_emitters *make_emitters(const struct gn_scene *scene, int n_pieces)
{
    struct gn_emitters *emitters = NULL;
    const struct gn_emitter_options options = {.n_pieces = n_pieces};
    assert_int_equal(gn_emitters_create(scene, &options, &emitters, NULL), 0);
    return emitters;
}

/** Sums of intensity, and of the discs' areas. */
static void add_up(const struct gn_emission *emission, double out_sum[static 3], double *out_area)
{
    *out_area = 0;
    memset(out_sum, 0, 3 * sizeof(*out_sum));
    for (int i = 0; i < emission->n_lights; i++) {
        const struct gn_near_light *light = &emission->lights[i];
        for (int k = 0; k < 3; k++)
            out_sum[k] += light->intensity[k];
        *out_area += M_PI * (double)light->radius * light->radius;
    }
}

static void test_pieces_keep_the_power(void **state)
{
    (void)state;
    static const float emission[3] = {2, 30, 500};
    static const int numbers[] = {1, 2, 7, 32, 1000};
    struct gn_scene *scene = make_scene(make_quad(1.6f, 0.9f), emission, NULL);
    for (size_t i = 0; i < sizeof(numbers) / sizeof(numbers[0]); i++) {
        struct gn_emitters *emitters = make_emitters(scene, numbers[i]);
        struct gn_emission *sent = gn_emitters_get_emission(emitters);
        double sum[3], area;
        assert_int_equal(sent->n_lights, numbers[i]);
        add_up(sent, sum, &area);
        assert_near(area, 1.6 * 0.9, 1e-6);
        for (int k = 0; k < 3; k++) // pi times this is the flux: radiance times area times pi
            assert_near(sum[k] / emission[k], 1.6 * 0.9, 1e-6);
        for (int j = 0; j < sent->n_lights; j++) {
            const struct gn_near_light *light = &sent->lights[j];
            // Halvings: no piece is more than twice another, nor longer than 4 times its width.
            assert_true(light->radius < 1.5 * sqrt(1.44 / numbers[i] / M_PI) + 1e-9);
            // On the quad, moved off it a little, to its outside: object z, here (0.8, 0, 0.6).
            double height = 0;
            for (int k = 0; k < 3; k++) {
                double n = tilted[4 * k + 2];
                assert_near(light->normal_world[k], n, 1e-6);
                height += n * (light->position_world[k] - tilted[4 * k + 3]);
            }
            assert_near(height, 5e-6, 4.9e-6);
            assert_int_equal(light->role, GN_RT_REAL);
        }
        gn_emission_unref(&sent);
        gn_emitters_destroy(&emitters);
    }
    gn_scene_destroy(&scene);
}

static void test_a_ball_shines_all_around(void **state)
{
    (void)state;
    static const float emission[3] = {1, 1, 1};
    struct gn_mesh ball = gn_test_make_sphere(0.1f, 24);
    struct gn_scene *scene = make_scene(ball, emission, NULL);
    struct gn_emitters *emitters = make_emitters(scene, 2);
    struct gn_emission *sent = gn_emitters_get_emission(emitters);
    double sum[3], area, resultant[3] = {0};
    assert_int_equal(sent->n_lights, 6); // it faces six ways, however few are wanted
    add_up(sent, sum, &area);
    assert_near(sum[0], area, 1e-6 * area);
    assert_near(area, 4 * M_PI * 0.01, 0.01 * 4 * M_PI * 0.01); // flat facets are a little less
    for (int i = 0; i < sent->n_lights; i++) {
        const struct gn_near_light *light = &sent->lights[i];
        double out = 0, distance2 = 0;
        for (int k = 0; k < 3; k++) {
            double d = light->position_world[k] - tilted[4 * k + 3];
            out += light->normal_world[k] * d;
            distance2 += d * d;
            resultant[k] += light->intensity[k] * light->normal_world[k];
        }
        assert_near(sqrt(distance2), 0.1, 1e-3); // on the ball, not in it
        assert_true(out > 0.09);
    }
    for (int k = 0; k < 3; k++)
        assert_near(resultant[k], 0, 0.01 * area);
    gn_emission_unref(&sent);
    gn_emitters_destroy(&emitters);
    gn_scene_destroy(&scene);
}

struct point {
    double x, y;
};

/** Keeps what lies on the side of the line a x + b y <= c. */
static int clip(struct point *p, int n, double a, double b, double c)
{
    struct point out[16];
    int m = 0;
    for (int i = 0; i < n; i++) {
        struct point q = p[(i + 1) % n];
        double h = a * p[i].x + b * p[i].y - c, g = a * q.x + b * q.y - c;
        if (h <= 0)
            out[m++] = p[i];
        if ((h < 0 && g > 0) || (h > 0 && g < 0))
            out[m++] = (struct point){p[i].x + h / (h - g) * (q.x - p[i].x),
                                      p[i].y + h / (h - g) * (q.y - p[i].y)};
    }
    memcpy(p, out, (size_t)m * sizeof(*p));
    return m;
}

/** Area and centroid of a polygon. */
static double measure(const struct point *p, int n, double out_centre[static 2])
{
    double area = 0, x = 0, y = 0;
    for (int i = 1; i + 1 < n; i++) {
        double a = 0.5 * ((p[i].x - p[0].x) * (p[i + 1].y - p[0].y) -
                          (p[i].y - p[0].y) * (p[i + 1].x - p[0].x));
        area += a;
        x += a * (p[0].x + p[i].x + p[i + 1].x) / 3;
        y += a * (p[0].y + p[i].y + p[i + 1].y) / 3;
    }
    out_centre[0] = area != 0 ? x / area : 0;
    out_centre[1] = area != 0 ? y / area : 0;
    return fabs(area);
}

/** The mean pixel by pixel: the triangle cut to each of them. */
static void get_mean_by_clipping(const struct gn_image *image, const struct gn_picture_triangle *t,
                                 struct gn_picture_mean *out)
{
    double all = 0, luminances = 0;
    memset(out, 0, sizeof(*out));
    for (int i = 0; i < image->width * image->height; i++) {
        struct point p[16];
        double x = i % image->width, y = (double)(i / image->width), centre[2];
        for (int c = 0; c < 3; c++)
            p[c] = (struct point){t->uvs[c][0] * image->width, (1 - t->uvs[c][1]) * image->height};
        int n = clip(p, 3, 1, 0, x + 1);
        n = clip(p, n, -1, 0, -x);
        n = clip(p, n, 0, 1, y + 1);
        n = clip(p, n, 0, -1, -y);
        double area = measure(p, n, centre);
        const float *rgb = gn_image_at(image, (int)x, (int)y);
        double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        for (int k = 0; k < 3; k++)
            out->rgb[k] += area * rgb[k];
        out->centroid_uv[0] += area * luminance * centre[0] / image->width;
        out->centroid_uv[1] += area * luminance * (1 - centre[1] / image->height);
        luminances += area * luminance;
        all += area;
    }
    for (int k = 0; k < 3; k++)
        out->rgb[k] /= all;
    for (int k = 0; k < 2; k++)
        out->centroid_uv[k] /= luminances;
}

static void test_picture_means_are_exact(void **state)
{
    (void)state;
    enum { N = 300 };
    static const int sizes[][2] = {{1, 1}, {7, 5}, {1, 40}, {64, 2}, {33, 48}};
    static struct gn_picture_triangle triangles[N];
    static struct gn_picture_mean means[N];
    uint64_t seed = 5;
    for (size_t s = 0; s < sizeof(sizes) / sizeof(sizes[0]); s++) {
        struct gn_image image;
        assert_int_equal(gn_image_init(&image, sizes[s][0], sizes[s][1], 3), 0);
        for (int i = 0; i < 3 * image.width * image.height; i++)
            image.data[i] = (float)exp(8 * gn_test_random_unit(&seed) - 4);
        for (int i = 0; i < N; i++) {
            // Large ones, small ones, corners on the grid, sides along it.
            double size = i % 3 == 0 ? 1 : i % 3 == 1 ? 0.1 : 0.03;
            bool is_on_grid = i % 12 == 0 && image.width > 1 && image.height > 1;
            double at[2] = {gn_test_random_unit(&seed), gn_test_random_unit(&seed)};
            for (int c = 0; c < 6; c++) {
                double x = at[c % 2] + size * (gn_test_random_unit(&seed) - 0.5);
                if (is_on_grid)
                    x = round(x * (c % 2 ? image.height : image.width)) /
                        (c % 2 ? image.height : image.width);
                triangles[i].uvs[c / 2][c % 2] = fmin(fmax(x, 0), 1);
            }
            if (i % 15 == 1)
                triangles[i].uvs[1][1] = triangles[i].uvs[0][1];
            double(*uv)[2] = triangles[i].uvs;
            double area = (uv[1][0] - uv[0][0]) * (uv[2][1] - uv[0][1]) -
                          (uv[1][1] - uv[0][1]) * (uv[2][0] - uv[0][0]);
            if (fabs(area) * image.width * image.height < 4e-6)
                i--; // another one: this is next to nothing
        }
        assert_int_equal(gn_picture_get_means(&image, triangles, N, means), 0);
        for (int i = 0; i < N; i++) {
            struct gn_picture_mean exact;
            get_mean_by_clipping(&image, &triangles[i], &exact);
            for (int k = 0; k < 3; k++)
                assert_near(means[i].rgb[k], exact.rgb[k], 1e-8 * exact.rgb[k]);
            for (int k = 0; k < 2; k++)
                assert_near(means[i].centroid_uv[k], exact.centroid_uv[k], 1e-8);
        }
        gn_image_finish(&image);
    }
}

static void test_a_picture_changes_the_pieces(void **state)
{
    (void)state;
    static const float emission[3] = {1, 2, 3};
    struct gn_scene *scene = make_scene(make_quad(2, 1), emission, "tv");
    struct gn_emitters *emitters = make_emitters(scene, 8);
    struct gn_emission *before = gn_emitters_get_emission(emitters);
    struct gn_image image;
    double sum[3], area;
    assert_int_equal(gn_emitters_get_stream_count(emitters), 1);
    assert_int_equal(gn_emitters_find_stream(emitters, "tv"), 0);
    assert_string_equal(gn_emitters_get_stream_name(emitters, 0), "tv");
    assert_null(gn_emitters_get_stream_name(emitters, 1));
    assert_int_equal(gn_emitters_find_stream(emitters, "radio"), -ENOENT);
    add_up(before, sum, &area);
    assert_near(sum[1], 2 * 2, 1e-6);

    // Left quarter of 4 x 1: 0, NaN, -1; the third quarter 1 in green; the last one 0.5 in red.
    assert_int_equal(gn_image_init(&image, 4, 1, 3), 0);
    const float pixels[12] = {0, NAN, -1, 0, 0, 0, 0, 1, 0, 0.5f, 0, 0};
    memcpy(image.data, pixels, sizeof(pixels));
    assert_int_equal(gn_emitters_set_picture(emitters, 1, &image, NULL), -EINVAL);
    assert_int_equal(gn_emitters_set_picture(emitters, 0, &image, NULL), 0);
    struct gn_emission *after = gn_emitters_get_emission(emitters);
    add_up(after, sum, &area);
    assert_near(sum[0], 100 * 2 * 0.5 / 4, 1e-5);
    assert_near(sum[1], 100 * 2 * 1.0 / 4, 1e-5);
    assert_near(sum[2], 0, 0);
    add_up(before, sum, &area);
    assert_near(sum[1], 2 * 2, 1e-6); // what was taken before stays as it was
    for (int i = 0; i < 8; i++) {
        const struct gn_near_light *light = &after->lights[i];
        assert_true(light->id == before->lights[i].id && light->id > 0);
        // The object's x: from the centre along (0.6, 0, -0.8).
        double x = 0.6 * (light->position_world[0] - 3) - 0.8 * (light->position_world[2] - 1);
        double all = light->intensity[0] + light->intensity[1];
        assert_true((all > 1e-6) == (x > 0)); // a cut is off by 2^-32 of the length
        if (all > 1e-6) // each piece is a quarter of the width: it lies in one pixel
            assert_near(fabs(x - 0.5), 0.25, 1e-5);
    }

    // One white pixel of a great picture: one piece sends it, from where it is.
    gn_image_finish(&image);
    assert_int_equal(gn_image_init(&image, 200, 100, 3), 0);
    gn_image_at(&image, 160, 20)[1] = 1;
    assert_int_equal(gn_emitters_set_picture(emitters, 0, &image, NULL), 0);
    struct gn_lighting_state *light = NULL;
    gn_emission_unref(&after);
    after = gn_emitters_get_emission(emitters);
    assert_int_equal(gn_lighting_state_create_dark(after, NULL, 7, &light, NULL), 0);
    assert_int_equal(light->n_near, 1);
    assert_int_equal(light->n_lights, 0);
    assert_near(light->near[0].intensity[1], 100 * 1e-4, 1e-8);
    const float *p = light->near[0].position_world;
    assert_near(0.6 * (p[0] - 3) - 0.8 * (p[2] - 1), 160.5 / 100 - 1, 1e-5);
    assert_near(-(p[1] + 2), 0.5 - 20.5 / 100, 1e-5); // v upwards: row 20 is near the top
    gn_lighting_state_unref(&light);

    // Without a picture again.
    assert_int_equal(gn_emitters_set_picture(emitters, 0, NULL, NULL), 0);
    gn_emission_unref(&after);
    after = gn_emitters_get_emission(emitters);
    add_up(after, sum, &area);
    assert_near(sum[2], 2 * 3, 1e-6);
    gn_image_finish(&image);
    gn_emission_unref(&after);
    gn_emission_unref(&before);
    gn_emitters_destroy(&emitters);
    gn_scene_destroy(&scene);
}

static void test_radiance_is_seen(void **state)
{
    (void)state;
    static const float emission[3] = {1, 2, 3};
    struct gn_scene *scene = make_scene(make_quad(2, 1), emission, "tv");
    struct gn_emitters *emitters = make_emitters(scene, 1);
    struct gn_surface surface = {.object = 0, .is_front = true, .uv = {0.75f, 0.5f}};
    struct gn_image image;
    float rgb[3];
    gn_emission_get_radiance(NULL, scene, &surface, rgb);
    assert_true(rgb[0] == 1 && rgb[2] == 3);
    assert_int_equal(gn_image_init(&image, 2, 2, 3), 0);
    gn_image_at(&image, 1, 0)[0] = 4; // right, top
    assert_int_equal(gn_emitters_set_picture(emitters, 0, &image, NULL), 0);
    struct gn_emission *sent = gn_emitters_get_emission(emitters);
    gn_emission_get_radiance(sent, scene, &surface, rgb); // between right top and right bottom
    assert_true(fabsf(rgb[0] - 200) < 1e-3f && rgb[1] == 0);
    surface.uv[1] = 1;
    gn_emission_get_radiance(sent, scene, &surface, rgb);
    assert_true(fabsf(rgb[0] - 400) < 1e-3f);
    surface.uv[0] = 0;
    gn_emission_get_radiance(sent, scene, &surface, rgb);
    assert_true(rgb[0] == 0);
    surface.is_front = false;
    surface.uv[0] = 1;
    gn_emission_get_radiance(sent, scene, &surface, rgb);
    assert_true(rgb[0] == 0);
    gn_image_finish(&image);
    gn_emission_unref(&sent);
    gn_emitters_destroy(&emitters);
    gn_scene_destroy(&scene);
}

static void test_lamps_come_first_and_states_share(void **state)
{
    (void)state;
    static const float emission[3] = {1, 2, 3};
    const struct gn_scene_light lamps[2] = {
        {{1, 2, 3}, {4, 5, 6}, 0.5f, GN_RT_REAL},
        {{0, 0, 9}, {0, 0, 0}, 0, GN_RT_VIRTUAL},
    };
    struct gn_scene *scene = make_scene(make_quad(2, 1), emission, NULL);
    assert_int_equal(gn_scene_set_lights(scene, lamps, 2, NULL), 0);
    struct gn_emitters *emitters = make_emitters(scene, 3);
    struct gn_emission *sent = gn_emitters_get_emission(emitters);
    assert_int_equal(sent->n_lights, 5);
    assert_true(sent->lights[0].intensity[2] == 6 && sent->lights[0].radius == 0.5f);
    assert_true(sent->lights[0].normal_world[0] == 0 && sent->lights[0].normal_world[2] == 0);
    assert_int_equal(sent->lights[1].role, GN_RT_VIRTUAL);
    assert_int_equal(sent->lights[1].object, GN_NEAR_NO_OBJECT);

    struct light_fixture fixture;
    struct gn_lighting_state *base = NULL, *lit = NULL;
    assert_int_equal(light_fixture_init(&fixture, GN_PROJECTION_LATLONG, 32, 16), 0);
    light_fixture_fill(&fixture, light_fixture_room);
    assert_int_equal(gn_lighting_state_create(&fixture.frame, NULL, NULL, NULL, &base, NULL), 0);
    assert_int_equal(base->n_near, 0);
    assert_int_equal(gn_lighting_state_replace_emission(base, sent, &lit), 0);
    assert_int_equal(lit->n_near, 4); // the dark lamp is left out
    assert_int_equal(base->n_near, 0);
    assert_ptr_equal(lit->map, base->map);
    assert_int_equal(lit->n_lights, base->n_lights);
    assert_memory_equal(lit->lights, base->lights, (size_t)lit->n_lights * sizeof(*lit->lights));
    gn_lighting_state_unref(&base);
    assert_int_equal(gn_lighting_state_replace_emission(lit, NULL, &base), 0);
    assert_true(base->n_near == 0 && !base->emission);
    gn_lighting_state_unref(&base);
    gn_lighting_state_unref(&lit);
    light_fixture_finish(&fixture);
    gn_emission_unref(&sent);
    gn_emitters_destroy(&emitters);
    gn_scene_destroy(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pieces_keep_the_power),
        cmocka_unit_test(test_a_ball_shines_all_around),
        cmocka_unit_test(test_picture_means_are_exact),
        cmocka_unit_test(test_a_picture_changes_the_pieces),
        cmocka_unit_test(test_radiance_is_seen),
        cmocka_unit_test(test_lamps_come_first_and_states_share),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
