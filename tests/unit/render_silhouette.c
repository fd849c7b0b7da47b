/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What a silhouette settles is what rays find; what it keeps from frame to frame is what it makes.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/render/silhouette.h"
#include "tests/meshes.h"
#include "tests/stage.h"

#define N_LIGHTS 60
#define N_BLOCKS 400

static const float grey[3] = {0.5f, 0.5f, 0.5f};

/** What rays are asked of. */
struct bench {
    struct gn_test_stage stage;
    struct clusters clusters;
    struct light_list lights;
    struct silhouettes silhouettes;
    float margin;
    struct frame frame; // its kernels
    float size;         // m, of the part of space that is tried
    float at;           // its middle, on each axis
    bool without_flat;
    const struct gn_rt *rt; // of what the silhouettes are of
};

static void add_lights(struct bench *b, uint64_t *seed)
{
    static const double one[3] = {1, 1, 1};
    static const double axes[4][3] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -0.6, 0.8}};
    assert_int_equal(gn_render_lights_reserve(&b->lights, N_LIGHTS), 0);
    for (int i = 0; i < N_LIGHTS; i++) {
        float dir[3];
        gn_test_random_direction(seed, dir);
        const double d[3] = {dir[0], dir[1], dir[2]};
        gn_render_lights_add(&b->lights, i < 4 ? axes[i] : d, one);
    }
}

static void make(struct bench *b)
{
    assert_int_equal(gn_silhouettes_make(&b->silhouettes, &b->clusters, b->without_flat, &b->lights,
                                         b->margin, b->stage.pool),
                     0);
}

/** Of the stage's virtual objects. */
static void init(struct bench *b, uint64_t *seed)
{
    gn_test_stage_commit(&b->stage, 2);
    assert_int_equal(gn_clusters_make(b->stage.scene, GN_RT_VIRTUAL, &b->clusters), 0);
    b->frame.kernels = gn_kernels_get();
    b->rt = b->stage.scene->rt;
    b->margin = 1e-5f * (fabsf(b->at) + b->size);
    add_lights(b, seed);
    make(b);
}

static void finish(struct bench *b)
{
    gn_silhouettes_finish(&b->silhouettes);
    gn_render_lights_finish(&b->lights);
    gn_clusters_finish(&b->clusters);
    gn_test_stage_finish(&b->stage);
}

/** Does the line through p, both ways, meet the set? */
static bool meets_line(const struct bench *b, const float p[static 3], const float dir[static 3])
{
    float org[3];
    for (int k = 0; k < 3; k++)
        org[k] = p[k] - 4 * b->size * dir[k];
    return gn_rt_is_occluded(b->rt, GN_RT_VIRTUAL, org, dir, 0, INFINITY);
}

/** 16 points of a box of random size. */
static void fill_block(const struct bench *b, uint64_t *seed, struct receivers *r, struct box *box)
{
    float width = b->size * (float)pow(10, -3 * gn_test_random_unit(seed));
    for (int k = 0; k < 3; k++) {
        float middle = b->at + b->size * ((float)gn_test_random_unit(seed) - 0.5f);
        box->min[k] = INFINITY;
        box->max[k] = -INFINITY;
        for (int i = 0; i < LANES; i++) {
            r->org[k][i] = middle + width * ((float)gn_test_random_unit(seed) - 0.5f);
            box->min[k] = fminf(box->min[k], r->org[k][i]);
            box->max[k] = fmaxf(box->max[k], r->org[k][i]);
        }
    }
}

/** Tries blocks against rays; n_states: how many lanes were of each state. */
static void check(const struct bench *b, uint64_t *seed, int n_states[static 3])
{
    struct receivers *r = calloc(1, sizeof(*r));
    assert_non_null(r);
    for (int i = 0; i < N_BLOCKS; i++) {
        const struct silhouette *s = &b->silhouettes.of[i % N_LIGHTS];
        struct box box;
        unsigned dark;
        unsigned edge;
        fill_block(b, seed, r, &box);
        enum silhouette_state of_all = gn_silhouette_get_box(s, &box);
        gn_silhouette_get_block(&b->frame, s, r, 0, &dark, &edge);
        assert_int_equal(dark & edge, 0);
        assert_true(of_all != SILHOUETTE_FREE || (dark | edge) == 0);
        assert_true(of_all != SILHOUETTE_DARK || dark == 0xffff);
        for (int lane = 0; lane < LANES; lane++) {
            const float p[3] = {r->org[0][lane], r->org[1][lane], r->org[2][lane]};
            bool is_dark = dark >> lane & 1;
            bool is_edge = edge >> lane & 1;
            n_states[is_edge ? SILHOUETTE_EDGE : is_dark ? SILHOUETTE_DARK : SILHOUETTE_FREE]++;
            if (!is_edge)
                assert_int_equal(is_dark, meets_line(b, p, s->dir));
        }
    }
    free(r);
}

static void add(struct bench *b, struct gn_mesh mesh, double x, double y, double z)
{
    gn_test_stage_add(&b->stage, GN_RT_VIRTUAL, mesh, b->at + x, b->at + y, b->at + z,
                      GN_MATERIAL_DIFFUSE, grey);
}

static void test_rays_agree(void **state)
{
    (void)state;
    static const float places[3] = {0, 30, -2000};
    uint64_t seed = 11;
    for (int i = 0; i < 3; i++) {
        int n[3] = {0};
        struct bench b = {.at = places[i], .size = 2};
        add(&b, gn_test_make_sphere(0.4f, 12), 0, 0, 0.1);
        add(&b, gn_test_make_box(0.2f, 0.9f, 0.4f), 0.3, 0.1, 0.2); // into the sphere
        add(&b, gn_test_make_plane(0.5f, 3), -0.6, 0.2, 0);         // open
        add(&b, gn_test_make_plane(0.5f, 3), -0.6, 0.2, 0);         // the same again
        add(&b, gn_test_make_sphere(0.1f, 40), -0.3, -0.7, 0);      // too fine to keep edges
        init(&b, &seed);
        check(&b, &seed, n);
        print_message("# at %g m: %d free, %d dark, %d for rays\n", (double)b.at, n[0], n[1], n[2]);
        assert_true(n[SILHOUETTE_FREE] > 1000);
        assert_true(n[SILHOUETTE_EDGE] > 100);
        if (i < 2)
            assert_true(n[SILHOUETTE_DARK] > 20);
        finish(&b);
    }
}

/** A tent beside a floor that begins at its edge; the floor is left out. */
static void test_flat_ones_left_out(void **state)
{
    (void)state;
    uint64_t seed = 17;
    int n[3] = {0};
    struct bench tent = {.size = 2};
    struct bench both = {.size = 2, .without_flat = true};
    for (int i = 0; i < 2; i++) {
        struct gn_mesh mesh = gn_test_make_plane(1, 2);
        mesh.positions[3 * 4 + 2] = 0.7f; // its middle
        add(i == 0 ? &tent : &both, mesh, 0, 0, 0);
    }
    add(&both, gn_test_make_plane(1, 2), 1, 0, 0);
    init(&tent, &seed);
    init(&both, &seed);
    both.rt = tent.rt;
    check(&both, &seed, n);
    assert_true(n[SILHOUETTE_DARK] > 20);
    finish(&both);
    finish(&tent);
}

/** The sphere hides pi r^2 of the plane; cells along its edge are few. */
static void test_most_is_settled(void **state)
{
    (void)state;
    uint64_t seed = 3;
    struct bench b = {.size = 2};
    add(&b, gn_test_make_sphere(0.5f, 16), 0, 0, 0);
    init(&b, &seed);
    for (int l = 0; l < N_LIGHTS; l++) {
        const struct silhouette *s = &b.silhouettes.of[l];
        double cell = 1 / sqrt(dot3(s->axis[0], s->axis[0]) * dot3(s->axis[1], s->axis[1]));
        int n_dark = 0;
        int n_edge = 0;
        for (int y = 0; y < SILHOUETTE_SIDE; y++) {
            n_dark += __builtin_popcountll(s->dark[y]);
            n_edge += __builtin_popcountll(s->edge[y]);
        }
        assert_true(n_dark * cell < M_PI * 0.25);
        assert_true((n_dark + n_edge) * cell > 0.97 * M_PI * 0.25); // the mesh lies inside
        assert_true(n_edge < 0.3 * n_dark);
    }
    finish(&b);
}

static void test_kept_is_as_made(void **state)
{
    (void)state;
    uint64_t seed = 5;
    struct bench b = {.size = 2};
    struct bench fresh = {.size = 2};
    add(&b, gn_test_make_sphere(0.5f, 9), 0, 0, 0);
    add(&fresh, gn_test_make_sphere(0.5f, 9), 0, 0, 0);
    init(&b, &seed);
    for (int round = 0; round < 3; round++) { // the second with fewer lights, the third with all
        int n = round == 1 ? N_LIGHTS / 2 : N_LIGHTS;
        b.lights.n = n;
        for (int l = round; l < n; l += 3) {
            float dir[3];
            gn_test_random_direction(&seed, dir);
            for (int k = 0; k < 3; k++)
                b.lights.dir[k][l] = dir[k];
        }
        make(&b);
        uint64_t unused = 1;
        if (round == 0)
            init(&fresh, &unused);
        memset(fresh.silhouettes.of[0].edge, round, sizeof(fresh.silhouettes.of[0].edge));
        gn_silhouettes_forget(&fresh.silhouettes);
        fresh.lights.n = n;
        for (int k = 0; k < 3; k++)
            memcpy(fresh.lights.dir[k], b.lights.dir[k], (size_t)n * sizeof(float));
        make(&fresh);
        assert_memory_equal(b.silhouettes.of, fresh.silhouettes.of,
                            (size_t)n * sizeof(*b.silhouettes.of));
    }
    finish(&fresh);
    finish(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rays_agree),
        cmocka_unit_test(test_flat_ones_left_out),
        cmocka_unit_test(test_most_is_settled),
        cmocka_unit_test(test_kept_is_as_made),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
