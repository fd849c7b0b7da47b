/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Whole frames of triangles that go wrong: without area, twice in one place, huge, thin as needles,
 * coincident, one, a million; a camera inside an object; light of one channel only. Where a plain
 * scene must look the same, it is the judge. Under sanitizers fewer of the places; all of the
 * meshes.
 */
#include "tests/unit/cmocka_setup.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/pose.h"
#include "proto/attr.h"
#include "tests/meshes.h"
#include "tests/numeric/extreme.h"
#include "tests/sanitized.h"

#define SIDE 32
#define N_PIXELS (SIDE * SIDE)

static const float grey[3] = {0.5f, 0.5f, 0.5f};
static const struct gn_render_options one_ray = {.single_ray = true};

/** Pictures of the three qualities. */
struct pictures {
    struct {
        float virtual_rgba[4 * N_PIXELS], shadow[3 * N_PIXELS];
    } of[3];
    int n_shadowed;
    double worst_virtual, worst_shadow; // differences
    bool skip_reference;                // it is not compared
};

static void keep(void *context, const struct gn_extreme_view *view)
{
    struct pictures *p = context;
    memcpy(p->of[view->quality].virtual_rgba, view->layers->virtual_rgba.data,
           sizeof(p->of[0].virtual_rgba));
    memcpy(p->of[view->quality].shadow, view->layers->shadow.data, sizeof(p->of[0].shadow));
    for (int i = 0; i < N_PIXELS; i++)
        p->n_shadowed += view->layers->shadow.data[3 * i] < 0.9f;
}

static void compare(void *context, const struct gn_extreme_view *view)
{
    struct pictures *p = context;
    if (p->skip_reference && view->quality == GN_QUALITY_REFERENCE)
        return;
    for (int i = 0; i < N_PIXELS; i++) {
        for (int c = 0; c < 4; c++)
            p->worst_virtual =
                fmax(p->worst_virtual, fabs((double)view->layers->virtual_rgba.data[4 * i + c] -
                                            p->of[view->quality].virtual_rgba[4 * i + c]));
        for (int c = 0; c < 3; c++) {
            double d = fabs((double)view->layers->shadow.data[3 * i + c] -
                            p->of[view->quality].shadow[3 * i + c]);
            p->worst_shadow = fmax(p->worst_shadow, d);
        }
    }
}

/** A floor and what stands on it, made by a builder at a place, seen from one side. */
static void check_scene(void (*build)(struct gn_test_stage *stage, int variant), int variant,
                        const struct gn_extreme_place *place, struct pictures *first)
{
    static const double eye[3] = {1.7, -2.3, 1.9}, target[3] = {0, 0, 0.2};
    struct gn_test_stage stage = {0};
    build(&stage, variant);
    gn_extreme_move_objects(&stage, place);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, place, 8);
    gn_extreme_aim(&stage, place, SIDE, 32, eye, target);
    first->worst_virtual = first->worst_shadow = 0;
    gn_extreme_check(&stage, NULL, &one_ray, variant == 0 ? keep : compare, first);
    gn_test_stage_finish(&stage);
}

/** A mesh of the caller's numbers. */
static struct gn_mesh make_mesh(const float *positions, int n_vertices, const uint32_t *triangles,
                                int n_triangles)
{
    struct gn_mesh mesh = {.n_vertices = n_vertices, .n_triangles = n_triangles};
    mesh.positions = malloc((size_t)n_vertices * 3 * sizeof(float));
    mesh.triangles = malloc((size_t)n_triangles * 3 * sizeof(uint32_t));
    assert_true(mesh.positions && mesh.triangles);
    memcpy(mesh.positions, positions, (size_t)n_vertices * 3 * sizeof(float));
    memcpy(mesh.triangles, triangles, (size_t)n_triangles * 3 * sizeof(uint32_t));
    return mesh;
}

/** Appends n triangles of vertices of the mesh's own; NULL: the mesh's own triangles once more. */
static void append(struct gn_mesh *mesh, const uint32_t *triangles, int n)
{
    size_t old = (size_t)mesh->n_triangles * 3;
    mesh->triangles = realloc(mesh->triangles, (old + (size_t)n * 3) * sizeof(uint32_t));
    assert_non_null(mesh->triangles);
    memcpy(mesh->triangles + old, triangles ? triangles : mesh->triangles,
           (size_t)n * 3 * sizeof(uint32_t));
    mesh->n_triangles += n;
}

/** Variant 1: the cube has triangles of one point, of two, and of three in line. 2: each triangle
 * of cube and floor is there twice. 3: the floor is there as two objects. 4: twice, the second cut
 * along the other diagonals. 5: a second cube exactly in the first one. 6: standing on the floor's
 * very plane, upside down. */
static void build_doubles(struct gn_test_stage *stage, int variant)
{
    static const uint32_t flat[] = {0, 0, 0, 1, 1, 2, 3, 5, 3};
    struct gn_mesh floor = gn_test_make_plane(4, 4);
    struct gn_mesh cube = gn_test_make_cube(0.8f);
    if (variant == 1)
        append(&cube, flat, 3);
    if (variant == 2) {
        append(&floor, NULL, floor.n_triangles);
        append(&cube, NULL, cube.n_triangles);
    }
    gn_test_stage_add(stage, GN_RT_REAL, floor, 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, cube, 0, 0, 0.4, GN_MATERIAL_DIFFUSE, grey);
    if (variant == 3 || variant == 4)
        gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(4, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                          grey);
    if (variant == 4) { // a quarter of a turn
        double *m = stage->objects[2].world_from_object;
        m[0] = m[5] = 0;
        m[1] = -1;
        m[4] = 1;
    }
    if (variant == 5)
        gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.8f), 0, 0, 0.4,
                          GN_MATERIAL_DIFFUSE, grey);
    if (variant == 6) { // half a turn about x
        stage->objects[1].world_from_object[5] = -1;
        stage->objects[1].world_from_object[10] = -1;
    }
}

static void test_what_is_there_twice_changes_nothing(void **state)
{
    static const double distances[] = {0, 100};
    struct pictures *first = calloc(1, sizeof(*first));
    (void)state;
    assert_non_null(first);
    for (size_t d = GN_TEST_IS_SANITIZED; d < GN_ARRAY_LEN(distances); d++) {
        const struct gn_extreme_place place =
            d == 0 ? gn_extreme_at_scale(1) : gn_extreme_away(1, distances[d]);
        for (int variant = 0; variant <= 6; variant++) {
            check_scene(build_doubles, variant, &place, first);
            // Where it is cut otherwise or turned, points are rounded otherwise: cells, one size
            // wide, tilt by 2.5 steps.
            double limit =
                variant < 4 || variant == 5 ? 0 : 2.5 * gn_extreme_get_step(distances[d]);
            assert_true(first->worst_virtual <= limit + 1e-7 &&
                        first->worst_shadow <= limit + 1e-7);
        }
    }
    assert_true(first->n_shadowed > (GN_TEST_IS_SANITIZED ? 150 : 300)); // 150 a distance
    free(first);
}

/** The floor as two triangles of a size, in m; the larger of them reach far beyond the picture. */
static void build_huge(struct gn_test_stage *stage, int variant)
{
    float size = powf(10, (float)variant) * 40;
    gn_test_stage_add(stage, GN_RT_REAL, gn_test_make_plane(size, 1), 0.123 * (double)size,
                      0.077 * (double)size, 0, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_cube(0.8f), 0, 0, 0.4, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.2f, 6), 0.5, -0.5, 0.3,
                      GN_MATERIAL_DIFFUSE, grey);
    // A roof whose near edge throws a shadow across the picture.
    gn_test_stage_add(stage, GN_RT_VIRTUAL, gn_test_make_plane(size, 1), 0.4 + 0.5 * (double)size,
                      0.077 * (double)size, 1.2, GN_MATERIAL_DIFFUSE, grey);
}

/*
 * Rays start above a triangle by 2^-19 of its size (gn_rt_offset_origin), 8 mm where the floor is
 * two triangles of 4 km: no pixel changes up to there. Beyond, bits still do not depend on rules
 * and threads, and no number is out of range. The reference sees more sky low under a larger roof.
 */
static void test_huge_triangles(void **state)
{
    struct pictures *first = calloc(1, sizeof(*first));
    (void)state;
    assert_non_null(first);
    first->skip_reference = true;
    for (int turned = GN_TEST_IS_SANITIZED; turned < 2; turned++) {
        const struct gn_extreme_place place =
            turned ? gn_extreme_away(1, 0) : gn_extreme_at_scale(1);
        for (int variant = 0; variant <= 5; variant += variant < 2 ? 2 : 3) {
            check_scene(build_huge, variant, &place, first);
            print_message("# floor of %g m: off by %.1e, shadow %.1e\n", 40 * pow(10, variant),
                          first->worst_virtual, first->worst_shadow);
            assert_true(variant > 2 || (first->worst_virtual < 1e-4 && first->worst_shadow < 1e-4));
        }
    }
    free(first);
}

/** A square as n strips of two needles each. */
static struct gn_mesh make_needles(float size, int n)
{
    struct gn_mesh mesh = gn_test_make_plane(size, 1);
    mesh.positions = realloc(mesh.positions, (size_t)(2 * n + 2) * 3 * sizeof(float));
    mesh.triangles = realloc(mesh.triangles, (size_t)(2 * n) * 3 * sizeof(uint32_t));
    assert_true(mesh.positions && mesh.triangles);
    mesh.n_vertices = 2 * n + 2;
    mesh.n_triangles = 2 * n;
    for (int i = 0; i <= n; i++) {
        for (int j = 0; j < 2; j++) {
            float *p = mesh.positions + 3 * (2 * i + j);
            p[0] = size * ((float)i / (float)n - 0.5f);
            p[1] = size * ((float)j - 0.5f);
            p[2] = 0;
        }
    }
    for (int i = 0; i < n; i++) {
        const uint32_t a = (uint32_t)(2 * i);
        const uint32_t cell[6] = {a, a + 2, a + 3, a, a + 3, a + 1};
        memcpy(mesh.triangles + 6 * (size_t)i, cell, sizeof(cell));
    }
    return mesh;
}

static const int needle_counts[] = {1, 100, 4000, 30000};

static void build_needles(struct gn_test_stage *stage, int variant)
{
    int n = needle_counts[variant];
    gn_test_stage_add(stage, GN_RT_REAL, make_needles(4, n), 0, 0, 0, GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(stage, GN_RT_VIRTUAL, make_needles(1, n), 0, 0, 0.6, GN_MATERIAL_GGX, grey);
    stage->objects[1].material.roughness = 0.5f;
}

/*
 * Needles up to 30000 times as long as wide look as the squares they make. Where the place rounds
 * their corners, each tilts by 2.5 steps over its width; 0.1 sizes away from the light's horizon a
 * cosine changes by ten times that. So far away that corners fall together (their width is less
 * than a step), most are no triangles any more: no number may be out of range.
 */
static void test_needles(void **state)
{
    static const double distances[] = {0, 10, 1e4};
    struct pictures *first = calloc(1, sizeof(*first));
    (void)state;
    assert_non_null(first);
    for (size_t d = 0; d < GN_ARRAY_LEN(distances);
         d = gn_test_get_next(d, GN_ARRAY_LEN(distances))) {
        const struct gn_extreme_place place =
            d == 0 ? gn_extreme_at_scale(1) : gn_extreme_away(1, distances[d]);
        for (int variant = 0; variant <= (d == 0 ? 3 : 2); variant++) {
            double step = d == 0 ? 0 : gn_extreme_get_step(distances[d]);
            double tilt = 2.5 * step * needle_counts[variant];
            // Of its hundreds of lights one may turn at a shadow's edge.
            first->skip_reference = d > 0;
            check_scene(build_needles, variant, &place, first);
            print_message("# %d needles, %g sizes away: off by %.1e, shadow %.1e\n",
                          2 * needle_counts[variant], distances[d], first->worst_virtual,
                          first->worst_shadow);
            assert_true(tilt > 0.1 || (first->worst_virtual <= 10 * tilt + 1e-6 &&
                                       first->worst_shadow <= 10 * tilt + 1e-6));
        }
    }
    assert_true(first->n_shadowed > 300);
    free(first);
}

static void judge_dark(void *context, const struct gn_extreme_view *view)
{
    (void)context;
    for (int i = 0; i < N_PIXELS; i++) {
        const float *v = view->layers->virtual_rgba.data + 4 * i;
        assert_true(v[0] == 0 && v[1] == 0 && v[2] == 0 && v[3] == 1);
        assert_true(view->layers->shadow.data[3 * i] == 1);
    }
}

/* From within a closed virtual object only its dark inside is seen, however near its wall is. */
static void test_camera_inside_an_object(void **state)
{
    static const double to_wall[] = {0.4, 1e-3, 1e-6};
    (void)state;
    for (size_t i = 0; i < GN_ARRAY_LEN(to_wall); i++) {
        const struct gn_extreme_place place = gn_extreme_at_scale(1);
        const double eye[3] = {0.4 - to_wall[i], 0, 0.5}, target[3] = {-0.4, 0.03, 0.5};
        struct gn_test_stage stage = {0};
        gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, 4), 0, 0, 0,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_cube(0.8f), 0, 0, 0.5,
                          GN_MATERIAL_DIFFUSE, grey);
        gn_test_stage_commit(&stage, 0);
        gn_extreme_set_sky(&stage, &place, 8);
        gn_extreme_aim(&stage, &place, SIDE, 60, eye, target);
        gn_extreme_check(&stage, NULL, NULL, judge_dark, NULL);
        gn_test_stage_finish(&stage);
    }
}

static void judge_red(void *context, const struct gn_extreme_view *view)
{
    int *n_shadow = context;
    for (int i = 0; i < N_PIXELS; i++) {
        const float *factor = view->layers->shadow.data + 3 * i;
        *n_shadow += factor[0] < 0.9f;
        assert_true(factor[1] == 1 && factor[2] == 1);
    }
}

static void paint_red(void *context, const double dir[static 3], float out_rgb[static 3])
{
    (void)context;
    out_rgb[0] = dir[2] > 0.7 ? 3 : 0;
    out_rgb[1] = out_rgb[2] = 0;
}

/* Light of one channel: a ratio whose denominator is 0 is no shadow. */
static void test_no_light_in_two_channels(void **state)
{
    static const double eye[3] = {1.7, -2.3, 1.9}, target[3] = {0, 0, 0.2};
    const struct gn_extreme_place place = gn_extreme_at_scale(1);
    struct gn_test_stage stage = {0};
    int n_shadow = 0;
    (void)state;
    build_doubles(&stage, 0);
    gn_test_stage_commit(&stage, 0);
    gn_test_stage_set_map(&stage, 16, 8, paint_red, NULL);
    gn_test_stage_set_lights_from_map(&stage, 2);
    gn_extreme_aim(&stage, &place, SIDE, 32, eye, target);
    gn_extreme_check(&stage, NULL, NULL, judge_red, &n_shadow);
    assert_true(n_shadow > 60);
    gn_test_stage_finish(&stage);
}

static void count_covered(void *context, const struct gn_extreme_view *view)
{
    int *n = context;
    n[0] = n[1] = 0;
    for (int i = 0; i < N_PIXELS; i++) {
        n[0] += view->layers->virtual_rgba.data[4 * i + 3] > 0.5f;
        n[1] += view->layers->shadow.data[3 * i] < 1;
    }
    assert_true(n[0] > 20 && n[1] > 20);
}

/* One triangle is all there is, of the virtual objects; of the real ones, too. */
static void test_one_triangle(void **state)
{
    static const float corners[] = {-0.5f, -0.5f, 0, 0.5f, -0.5f, 0, 0, 0.6f, 0};
    static const float wide[] = {-3, -3, 0, 3, -3, 0, 0, 5, 0};
    static const uint32_t triangle[] = {0, 1, 2};
    static const double eye[3] = {1.7, -2.3, 1.9}, target[3] = {0, 0, 0.2};
    const struct gn_extreme_place place = gn_extreme_at_scale(1);
    struct gn_test_stage stage = {0};
    int n[2];
    (void)state;
    gn_test_stage_add(&stage, GN_RT_REAL, make_mesh(wide, 3, triangle, 1), 0, 0, 0,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, make_mesh(corners, 3, triangle, 1), 0, 0, 0.4,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    gn_extreme_set_sky(&stage, &place, 8);
    gn_extreme_aim(&stage, &place, SIDE, 32, eye, target);
    gn_extreme_check(&stage, NULL, NULL, count_covered, n);
    gn_test_stage_finish(&stage);
}

/* No triangle, or none with an area, is refused with a reason; so is no object. */
static void test_no_triangle_is_refused(void **state)
{
    static const float corners[] = {0, 0, 0, 1, 1, 1, 2, 2, 2};
    static const uint32_t triangle[] = {0, 1, 2};
    struct gn_scene *scene = NULL;
    (void)state;
    for (int n = 0; n < 3; n++) {
        struct gn_error error = {0};
        struct gn_scene_object object = {.role = GN_RT_VIRTUAL,
                                         .mesh = make_mesh(corners, 3, triangle, n == 1)};
        gn_mat4_identity(object.world_from_object);
        assert_int_equal(gn_scene_create(&object, n < 2, NULL, &scene, &error), -EINVAL);
        assert_null(scene);
        assert_non_null(strstr(error.text, n < 2 ? "object 0" : "0 objects"));
        assert_true(n == 2 || strstr(error.text, "empty") != NULL);
        gn_mesh_finish(&object.mesh);
    }
}

/* A ball of a million triangles on a floor. Tracing every ray of it takes as long as of a few. */
static void test_a_million_triangles(void **state)
{
    static const double eye[3] = {1.7, -2.3, 1.9}, target[3] = {0, 0, 0.4};
    const struct gn_extreme_place place = gn_extreme_at_scale(1);
    struct gn_test_stage stage = {0};
    int n[2];
    (void)state;
    gn_test_stage_add(&stage, GN_RT_REAL, gn_test_make_plane(4, 4), 0, 0, 0, GN_MATERIAL_DIFFUSE,
                      grey);
    gn_test_stage_add(&stage, GN_RT_VIRTUAL, gn_test_make_sphere(0.5f, 501), 0, 0, 0.6,
                      GN_MATERIAL_DIFFUSE, grey);
    gn_test_stage_commit(&stage, 0);
    assert_true(stage.scene->n_virtual_triangles > 1000000);
    gn_extreme_set_sky(&stage, &place, 8);
    gn_extreme_aim(&stage, &place, SIDE, 32, eye, target);
    gn_extreme_check(&stage, NULL, &one_ray, count_covered, n);
    gn_test_stage_finish(&stage);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_is_there_twice_changes_nothing),
        cmocka_unit_test(test_huge_triangles),
        cmocka_unit_test(test_needles),
        cmocka_unit_test(test_camera_inside_an_object),
        cmocka_unit_test(test_no_light_in_two_channels),
        cmocka_unit_test(test_one_triangle),
        cmocka_unit_test(test_no_triangle_is_refused),
        cmocka_unit_test(test_a_million_triangles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
