/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/error_time/sequence.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/compare.h"
#include "tests/bench/error_time/metrics.h"

#define FRAME_NS (GN_NS_PER_S / 30)
#define NOISE 0.01
#define STEP_DEG 0.5
#define SWITCH_FRAME 4 // whose map has the lamp first
#define MASK_BELOW 0.995f

static struct gn_bench_change get_change(enum gn_bench_stream kind, int frame, bool has_noise)
{
    return (struct gn_bench_change){.turn_deg = kind == GN_BENCH_MOVING ? STEP_DEG * frame : 0,
                                    .is_lamp_off =
                                        kind == GN_BENCH_SWITCHED && frame < SWITCH_FRAME,
                                    .noise = has_noise && kind != GN_BENCH_SWITCHED ? NOISE : 0,
                                    .seed = 1000 * (uint64_t)kind + (uint64_t)frame};
}

static int init_map(enum gn_bench_stream kind, int frame, struct gn_bench_map *out_map)
{
    const struct gn_bench_change change = get_change(kind, frame, true);
    int ret = gn_bench_map_init_lamps(GN_BENCH_STREAM_SIZE, &change, out_map);
    out_map->frame.capture_time_ns = (frame + 1) * FRAME_NS;
    out_map->frame.sequence = (uint64_t)frame + 1;
    return ret;
}

int gn_bench_streams_init(struct gn_bench_streams *streams, struct gn_bench_cache *cache,
                          struct gn_bench_scene *scene)
{
    int ret = 0;
    *streams = (struct gn_bench_streams){.scene = scene};
    for (int i = 0; i < GN_BENCH_FRAMES && ret == 0; i++) {
        const struct gn_bench_change change = get_change(GN_BENCH_MOVING, i, false);
        struct gn_bench_map map = {0};
        ret = gn_bench_map_init_lamps(GN_BENCH_STREAM_SIZE, &change, &map);
        if (ret == 0)
            ret = gn_bench_make_reference(cache, scene, &map, 1, &streams->references[i]);
        gn_bench_map_finish(&map);
    }
    for (int i = 0; i < GN_BENCH_STREAMS * GN_BENCH_FRAMES && ret == 0; i++) {
        int kind = i / GN_BENCH_FRAMES, frame = i % GN_BENCH_FRAMES;
        ret = init_map((enum gn_bench_stream)kind, frame, &streams->maps[kind][frame]);
    }
    return ret;
}

void gn_bench_streams_finish(struct gn_bench_streams *streams)
{
    for (int i = 0; i < GN_BENCH_FRAMES; i++)
        gn_bench_picture_finish(&streams->references[i]);
    for (int i = 0; i < GN_BENCH_STREAMS * GN_BENCH_FRAMES; i++)
        gn_bench_map_finish(&streams->maps[i / GN_BENCH_FRAMES][i % GN_BENCH_FRAMES]);
    *streams = (struct gn_bench_streams){0};
}

/** Frames as the renderer gives them: shadow factors, or the composite in 8-bit sRGB codes. */
struct take {
    size_t n; // floats of a frame
    float *frame[GN_BENCH_FRAMES];
    int n_lights;
};

static float to_code(float linear)
{
    double v = fmin(fmax(linear, 0), 1); // IEC 61966-2-1
    return (float)(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055));
}

static int keep_frame(const struct gn_bench_streams *streams, enum gn_bench_stream kind, float *out)
{
    const struct gn_layers *layers = &streams->scene->stage.layers;
    size_t n = 3 * (size_t)layers->width * (size_t)layers->height;
    if (kind == GN_BENCH_MOVING) {
        memcpy(out, layers->shadow.data, n * sizeof(*out));
        return 0;
    }
    struct gn_image picture;
    int ret = gn_image_init(&picture, layers->width, layers->height, 3);
    if (ret < 0)
        return ret;
    gn_bench_compose(&streams->references[0], &layers->shadow, &layers->virtual_rgba, true,
                     &picture);
    for (size_t i = 0; i < n; i++)
        out[i] = to_code(picture.data[i]);
    gn_image_finish(&picture);
    return 0;
}

/** Plays one stream into take. */
static int play(const struct gn_bench_streams *streams, const struct gn_bench_setting *setting,
                double smoothing, enum gn_bench_stream kind, struct take *take)
{
    struct gn_test_stage *stage = &streams->scene->stage;
    const struct gn_render_options render = {.quality = setting->quality, .single_ray = true};
    struct gn_lighting_state *state = NULL;
    int ret = 0;
    for (int i = 0; i < GN_BENCH_FRAMES && ret == 0; i++) {
        struct gn_light_options options = setting->light;
        struct gn_lighting_state *next = NULL;
        options.previous = state;
        options.smoothing = smoothing;
        options.no_sh = true;
        ret = gn_lighting_state_create(&streams->maps[kind][i].frame, NULL, &options, NULL, &next,
                                       NULL);
        if (ret == 0)
            ret = gn_renderer_render(stage->renderer, &stage->camera, next, &render, &stage->layers,
                                     &stage->report, NULL);
        if (ret == 0)
            ret = keep_frame(streams, kind, take->frame[i]);
        gn_lighting_state_unref(&state);
        state = next;
    }
    take->n_lights = state ? state->n_lights : 0;
    gn_lighting_state_unref(&state);
    return ret;
}

static double get_flicker(const struct gn_bench_streams *streams, const struct take *take)
{
    double wrong = 0, right = 0;
    for (size_t p = 0; p < take->n; p++) {
        bool is_in = false;
        for (int i = 0; i < GN_BENCH_FRAMES; i++)
            is_in = is_in || streams->references[i].shadow.data[p] < MASK_BELOW;
        if (!is_in || streams->references[0].virtual_rgba.data[p / 3 * 4 + 3] > 0)
            continue;
        for (int i = 1; i < GN_BENCH_FRAMES; i++) {
            double r = (double)streams->references[i].shadow.data[p] -
                       streams->references[i - 1].shadow.data[p];
            double x = (double)take->frame[i][p] - take->frame[i - 1][p];
            wrong += fabs(x - r);
            right += fabs(r);
        }
    }
    return right > 0 ? wrong / right : 0;
}

/** Overwrites the first frame. */
static double get_noise(struct take *take)
{
    for (size_t p = 0; p < take->n; p++) {
        double sum = 0, squares = 0;
        for (int i = 0; i < GN_BENCH_FRAMES; i++)
            sum += take->frame[i][p];
        for (int i = 0; i < GN_BENCH_FRAMES; i++) {
            double d = take->frame[i][p] - sum / GN_BENCH_FRAMES;
            squares += d * d;
        }
        take->frame[0][p] = (float)sqrt(squares / (GN_BENCH_FRAMES - 1));
    }
    qsort(take->frame[0], take->n, sizeof(float), gn_compare_floats);
    return take->frame[0][take->n * 95 / 100];
}

/** The way from before to after, and how far each frame has come on it. */
static int get_response(const struct take *take, const float *after)
{
    const float *before = take->frame[SWITCH_FRAME - 1];
    int first = GN_BENCH_FRAMES;
    for (int i = GN_BENCH_FRAMES - 1; i >= SWITCH_FRAME; i--) {
        double along = 0, whole = 0;
        for (size_t p = 0; p < take->n; p++) {
            double way = (double)after[p] - before[p];
            along += way * ((double)take->frame[i][p] - before[p]);
            whole += way * way;
        }
        if (along < 0.9 * whole)
            break;
        first = i - SWITCH_FRAME + 1;
    }
    return first;
}

int gn_bench_measure_steadiness(const struct gn_bench_streams *streams,
                                const struct gn_bench_setting *setting, double smoothing,
                                struct gn_bench_steadiness *out_steadiness)
{
    const struct gn_camera *camera = &streams->scene->stage.camera;
    struct take take = {.n = 3 * (size_t)camera->width * (size_t)camera->height};
    struct gn_bench_steadiness result = {0};
    float *block = malloc((GN_BENCH_FRAMES + 1) * take.n * sizeof(*block));
    if (!block)
        return -ENOMEM;
    for (size_t i = 0; i < GN_BENCH_FRAMES; i++)
        take.frame[i] = block + i * take.n;
    float *after = block + GN_BENCH_FRAMES * take.n;
    int ret = play(streams, setting, smoothing, GN_BENCH_MOVING, &take);
    if (ret == 0) {
        result.flicker = get_flicker(streams, &take);
        ret = play(streams, setting, smoothing, GN_BENCH_RESTING, &take);
    }
    if (ret == 0) {
        result.noise_codes = get_noise(&take);
        ret = play(streams, setting, 0, GN_BENCH_SWITCHED,
                   &take); // unfiltered: its last frame is the end
    }
    if (ret == 0) {
        memcpy(after, take.frame[GN_BENCH_FRAMES - 1], take.n * sizeof(*after));
        ret = play(streams, setting, smoothing, GN_BENCH_SWITCHED, &take);
    }
    if (ret == 0) {
        result.response_frames = get_response(&take, after);
        result.n_lights = take.n_lights;
        *out_steadiness = result;
    }
    free(block);
    return ret;
}
