/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Streams of frames through every method: what noise moves, what a lamp elsewhere moves, what the
 * sums say, on one thread and on four. */
#include "tests/unit/cmocka_setup.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/pool.h"
#include "server/light/luminance.h"
#include "server/light/state.h"
#include "tests/light_fixture.h"
#include "tests/random.h"

enum { SIDE = 128, N_FRAMES = 75, N_SETTLE = 30, IDS_MAX = 512 };
static const double pi = 3.14159265358979323846;

struct stream {
    struct light_fixture clean, shown;
    struct gn_light_options options;
    struct gn_radiance_map_options map_options;
    struct gn_lighting_state *state;
    struct gn_pool *pool;
    uint64_t seed;
};

static void begin(struct stream *s, enum gn_light_method method, double smoothing)
{
    *s = (struct stream){.options = {.method = method, .smoothing = smoothing}, .seed = 7};
    enum gn_projection_type type = GN_PROJECTION_FISHEYE_EQUIDISTANT;
    assert_int_equal(light_fixture_init(&s->clean, type, SIDE, SIDE), 0);
    assert_int_equal(light_fixture_init(&s->shown, type, SIDE, SIDE), 0);
    light_fixture_fill(&s->clean, light_fixture_room);
    light_fixture_fill(&s->shown, light_fixture_room);
}

static void end(struct stream *s)
{
    gn_lighting_state_unref(&s->state);
    light_fixture_finish(&s->clean);
    light_fixture_finish(&s->shown);
}

/* The clean frame with noise of that share of each texel, 1 / rate after the last. */
static void show(struct stream *s, double noise, double rate)
{
    size_t n = (size_t)SIDE * SIDE * 3;
    for (size_t i = 0; i < n; i++) { // uniform, of that standard deviation
        double factor =
            noise > 0 ? 1 + noise * sqrt(12) * (gn_test_random_unit(&s->seed) - 0.5) : 1;
        s->shown.image.data[i] = (float)((double)s->clean.image.data[i] * factor);
    }
    s->shown.frame.sequence++;
    s->shown.frame.capture_time_ns += (int64_t)(1e9 / rate);
    struct gn_error error = {0};
    struct gn_lighting_state *next;
    s->options.previous = s->state;
    if (gn_lighting_state_create(&s->shown.frame, &s->map_options, &s->options, s->pool, &next,
                                 &error) < 0)
        fail_msg("%s", error.text);
    gn_lighting_state_unref(&s->state);
    s->state = next;
}

/* Multiplies the radiance of the fixture's first lamp. */
static void set_lamp(struct stream *s, float factor)
{
    static const double lamp[3] = {0.30, 0.25, 0.9206};
    light_fixture_fill(&s->clean, light_fixture_room);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double d[3];
            if (!gn_projection_get_direction(&s->clean.frame.projection, x + 0.5, y + 0.5, d) ||
                d[0] * lamp[0] + d[1] * lamp[1] + d[2] * lamp[2] < 0.9976)
                continue;
            for (int c = 0; c < 3; c++)
                gn_image_at(&s->clean.image, x, y)[c] *= factor;
        }
    }
}

/* One light through the stream. */
struct track {
    uint64_t id;
    int n;
    double sum[3], squares, energy;
};

static struct track *get_track(struct track *tracks, int *n, uint64_t id)
{
    for (int i = 0; i < *n; i++) {
        if (tracks[i].id == id)
            return &tracks[i];
    }
    if (*n == IDS_MAX)
        return NULL;
    tracks[*n] = (struct track){.id = id};
    return &tracks[(*n)++];
}

/* RMS angle, degrees, by which lights that are always there stray from their mean direction,
 * weighted by energy; out_share: of all energy that is in such lights. */
static double get_jitter(enum gn_light_method method, double smoothing, double *out_share,
                         double *out_births)
{
    static struct track tracks[IDS_MAX];
    struct stream s;
    int n = 0, n_frames = 0;
    double all = 0, births = 0;
    begin(&s, method, smoothing);
    for (int i = 0; i < N_FRAMES; i++) {
        show(&s, 0.01, 30);
        if (i < N_SETTLE)
            continue;
        n_frames++;
        births += s.state->in_time.n_births;
        for (int k = 0; k < s.state->n_lights; k++) {
            const struct gn_light *light = &s.state->lights[k];
            struct track *track = get_track(tracks, &n, light->id);
            double energy = gn_luminance(light->irradiance);
            all += energy;
            if (!track)
                continue;
            track->n++;
            track->energy += energy;
            for (int c = 0; c < 3; c++) {
                track->sum[c] += (double)light->dir_world[c];
                track->squares += (double)light->dir_world[c] * (double)light->dir_world[c];
            }
        }
    }
    double sum = 0, kept = 0;
    for (int i = 0; i < n; i++) {
        const struct track *t = &tracks[i];
        if (t->n != n_frames)
            continue;
        double m = 0; // var = E |d|^2 - |E d|^2
        for (int c = 0; c < 3; c++)
            m += t->sum[c] / t->n * (t->sum[c] / t->n);
        sum += t->energy * fmax(t->squares / t->n - m, 0);
        kept += t->energy;
    }
    *out_share = kept / all;
    *out_births = births / n_frames;
    end(&s);
    return kept > 0 ? sqrt(sum / kept) * 180 / pi : 0;
}

static void noise_moves_lights_less(void **test)
{
    (void)test;
    print_message("# 1 %% noise at 30 Hz: jitter, degrees RMS, alone and smoothed by 400 ms\n");
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        double share[2], births[2];
        double alone = get_jitter((enum gn_light_method)m, 0, &share[0], &births[0]);
        double smooth = get_jitter((enum gn_light_method)m, 0.4, &share[1], &births[1]);
        print_message("# %-12s %8.5f %8.5f ratio %.3f  kept %.3f %.3f  births/frame %.2f\n",
                      gn_light_method_get_name((enum gn_light_method)m), alone, smooth,
                      alone > 0 ? smooth / alone : 0, share[0], share[1], births[1]);
        bool keeps_lights = m == GN_LIGHT_PARTITION_ENERGY || m == GN_LIGHT_QUADTREE;
        if (keeps_lights) // sqrt(alpha / (2 - alpha)) is 0.204
            assert_true(share[1] > 0.9999 && births[1] == 0 && smooth < 0.2 * alone);
        assert_true(smooth <= alone + 1e-5); // that of a float
    }
}

/* What a lamp that blinks does to lights more than 60 degrees from it. */
struct blink {
    double moved;   // degrees, of the one that moved most and is there before and after
    double changed; // share of their energy that is other lights' afterwards
    double dimmed;  // largest change of a power
};

static double get_angle(const float a[3], const float b[3])
{
    double chord = 0;
    for (int c = 0; c < 3; c++)
        chord += ((double)a[c] - (double)b[c]) * ((double)a[c] - (double)b[c]);
    return 2 * asin(fmin(sqrt(chord) / 2, 1)) * 180 / pi;
}

static struct blink blink(enum gn_light_method method)
{
    static const float lamp[3] = {0.30f, 0.25f, 0.9206f};
    struct stream s;
    struct blink b = {0};
    begin(&s, method, 0);
    s.map_options.no_fill = true; // the ground shines by the light of all lamps
    for (int i = 0; i < 5; i++)
        show(&s, 0, 30);
    struct gn_lighting_state *before = gn_lighting_state_ref(s.state);
    set_lamp(&s, 0.1f);
    show(&s, 0, 30);
    double all = 0, lost = 0;
    for (int i = 0; i < before->n_lights; i++) {
        const struct gn_light *old = &before->lights[i], *now = NULL;
        if (get_angle(old->dir_world, lamp) < 60)
            continue;
        double energy = gn_luminance(old->irradiance);
        all += energy;
        for (int k = 0; k < s.state->n_lights && !now; k++) {
            if (old->id != 0 && s.state->lights[k].id == old->id)
                now = &s.state->lights[k];
        }
        if (!now) {
            lost += energy;
            continue;
        }
        b.moved = fmax(b.moved, get_angle(old->dir_world, now->dir_world));
        b.dimmed = fmax(b.dimmed, fabs(gn_luminance(now->irradiance) / energy - 1));
    }
    b.changed = all > 0 ? lost / all : 0;
    gn_lighting_state_unref(&before);
    end(&s);
    return b;
}

static void a_lamp_leaves_the_others_where_they_are(void **test)
{
    (void)test;
    print_message("# a lamp goes to a tenth; lights over 60 degrees from it\n");
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        struct blink b = blink((enum gn_light_method)m);
        print_message("# %-12s moved %.4f degrees, power by %.4f, %.4f of the energy in others\n",
                      gn_light_method_get_name((enum gn_light_method)m), b.moved, b.dimmed,
                      b.changed);
        if (m == GN_LIGHT_PARTITION_ENERGY || m == GN_LIGHT_QUADTREE)
            assert_true(b.moved < 0.1 && b.dimmed < 0.001 && b.changed == 0);
    }
}

/* Sums of what is published are what one exponential makes of the maps' sums, and the harmonics
 * say the same. */
static void sums_follow_the_map(void **test)
{
    (void)test;
    static const enum gn_light_method methods[] = {GN_LIGHT_PARTITION_ENERGY, GN_LIGHT_MEDIAN_CUT,
                                                   GN_LIGHT_QUADTREE};
    for (size_t m = 0; m < sizeof(methods) / sizeof(methods[0]); m++) {
        struct stream s;
        double total[3] = {0};
        int n_snaps = 0;
        begin(&s, methods[m], 0.3);
        for (int i = 0; i < 40; i++) {
            set_lamp(&s, (float)(1 + 0.5 * sin(0.4 * i)));
            show(&s, 0.01, 30);
            n_snaps += s.state->in_time.n_snaps;
            double alpha = s.state->in_time.alpha;
            for (int c = 0; c < 3; c++) {
                const struct gn_radiance_map *map = s.state->map;
                double raw =
                    map->figures.shown_irradiance[c] + (double)map->fill[c] * map->fill_solid_angle;
                double sum = 0, published = s.state->total_irradiance[c];
                total[c] += alpha * (raw - total[c]);
                for (int k = 0; k < s.state->n_lights; k++)
                    sum += (double)s.state->lights[k].irradiance[c];
                assert_near(published, total[c], 1e-9 * total[c]);
                assert_near(sum, published, 1e-5 * published);
                assert_near(s.state->sh[0][c] * sqrt(4 * pi), published, 1e-5 * published);
            }
        }
        assert_int_equal(n_snaps, 0);
        end(&s);
    }
}

static void threads_change_nothing(void **test)
{
    (void)test;
    for (int m = 0; m < GN_LIGHT_METHOD_COUNT; m++) {
        struct stream one, many;
        struct gn_pool *pool = NULL;
        begin(&one, (enum gn_light_method)m, 0.3);
        begin(&many, (enum gn_light_method)m, 0.3);
        assert_int_equal(gn_pool_create(4, &pool), 0);
        many.pool = pool;
        for (int i = 0; i < 12; i++) {
            set_lamp(&one, i % 5 ? 1.0f : 0.02f);
            set_lamp(&many, i % 5 ? 1.0f : 0.02f);
            show(&one, 0.01, 30);
            show(&many, 0.01, 30);
            assert_int_equal(one.state->n_lights, many.state->n_lights);
            assert_memory_equal(one.state->lights, many.state->lights,
                                (size_t)one.state->n_lights * sizeof(struct gn_light));
            assert_memory_equal(one.state->sh, many.state->sh, sizeof(one.state->sh));
        }
        end(&one);
        end(&many);
        gn_pool_destroy(&pool);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_moves_lights_less),
        cmocka_unit_test(a_lamp_leaves_the_others_where_they_are),
        cmocka_unit_test(sums_follow_the_map),
        cmocka_unit_test(threads_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
