/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Error against run time of every way to make lights: on a set of maps and scenes, each method over
 * its parameter, against the texel-exact picture. One thread; times are processor time of that
 * thread, medians after a warm-up. Writes into the folder
 *   error.csv       one line for each scene, map and setting (metrics.h says what the errors are)
 *   irradiance.csv  harmonics at 200 normals
 *   stream.csv      flicker, noise and response of each method (sequence.h)
 *   run.csv         the compiler and the extent
 *   reference.csv   the references' own error, from how they change with the size of their parts
 * --quick estimates no such error and writes 0. Fails where more than a third of a map's settings
 * come so near to the truth that the reference's own error is over a tenth of theirs; such settings
 * are for nobody to judge. tests/bench/error_time/report.py makes docs/error.md of them; guard.py
 * keeps the quick ones.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "common/compare.h"
#include "tests/bench/error_time/metrics.h"
#include "tests/bench/error_time/sequence.h"
#include "tests/bench/error_time/settings.h"

enum { MAX_REPEATS = 21, MIN_REPEATS = 3, MAX_MAPS = 16 };
/** What takes longer than this, ms, is not repeated more than MIN_REPEATS times. */
#define LONG_MS 200.0

/** How much is done. */
struct extent {
    const char *option;
    enum gn_bench_extent settings;
    int width, height; // of the pictures, px
    int map_size;      // of painted fisheyes, px; 0: their own
    bool is_quick;     // the guard's: references of whole texels, not checked
    int repeats;       // of times, [1, MAX_REPEATS]
    int n_maps;        // of gn_bench_maps
};

static const struct extent extents[] = {
    {"--quick", GN_BENCH_QUICK, 64, 48, 150, true, 3, 3},
    {"--default", GN_BENCH_DEFAULT, 128, 96, 0, false, 3, 7},
    {"--full", GN_BENCH_DEFAULT, 128, 96, 0, false, MAX_REPEATS, MAX_MAPS},
};

struct bench {
    const struct extent *extent;
    const char *folder;
    const char *only_map; // NULL: all
    struct gn_bench_cache cache;
    struct gn_bench_scene scenes[GN_BENCH_SCENES];
    FILE *errors, *irradiance, *stream, *reference;
    double self_error[GN_BENCH_SCENES]; // of the map at hand
    int n_too_near[GN_BENCH_SCENES];    // settings whose error is less than ten times that
    bool is_bad;                        // a reference is not enough
    struct gn_bench_setting settings[GN_BENCH_SETTINGS_MAX];
    int n_settings;
};

/** Median and interquartile range, ms. */
struct timing {
    double median, range;
};

/** Times being taken. The first, a warm-up, does not count. */
struct stopwatch {
    int n; // -1: nothing yet
    double ms[MAX_REPEATS], sum, start;
};

static void check(int result, const char *what, const char *which)
{
    if (result >= 0)
        return;
    fprintf(stderr, "error_time: %s %s: %s\n", what, which, strerror(-result));
    exit(1);
}

static double get_cpu_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void stop(struct stopwatch *watch)
{
    double ms = get_cpu_ms() - watch->start;
    if (watch->n >= 0) {
        watch->ms[watch->n] = ms;
        watch->sum += ms;
    }
    watch->n++;
}

static bool is_enough(const struct bench *b, const struct stopwatch *watch)
{
    return watch->n >= b->extent->repeats || (watch->n >= MIN_REPEATS && watch->sum > LONG_MS);
}

static struct timing sum_up(struct stopwatch *watch)
{
    int n = watch->n;
    qsort(watch->ms, (size_t)n, sizeof(watch->ms[0]), gn_compare_doubles);
    return (struct timing){watch->ms[n / 2], watch->ms[3 * n / 4] - watch->ms[n / 4]};
}

/** The state as a stream has it: its tables are the last state's. */
static struct gn_lighting_state *make_state(const struct bench *b, const struct gn_bench_map *map,
                                            const struct gn_light_options *wanted,
                                            const struct gn_lighting_state *previous,
                                            struct timing *out_timing)
{
    struct gn_lighting_state *state = NULL;
    struct stopwatch watch = {.n = -1};
    while (!is_enough(b, &watch)) {
        struct gn_light_options options = *wanted;
        struct gn_lighting_state *next;
        options.previous = state ? state : previous;
        watch.start = get_cpu_ms();
        check(gn_lighting_state_create(&map->frame, NULL, &options, NULL, &next, NULL),
              "the light of", map->name);
        stop(&watch);
        gn_lighting_state_unref(&state);
        state = next;
    }
    *out_timing = sum_up(&watch);
    return state;
}

static struct timing render(const struct bench *b, struct gn_bench_scene *scene,
                            const struct gn_lighting_state *state, enum gn_quality quality)
{
    const struct gn_render_options options = {.quality = quality, .single_ray = true};
    struct gn_test_stage *stage = &scene->stage;
    struct stopwatch watch = {.n = -1};
    while (!is_enough(b, &watch)) {
        watch.start = get_cpu_ms();
        check(gn_renderer_render(stage->renderer, &stage->camera, state, &options, &stage->layers,
                                 &stage->report, NULL),
              "a frame of", scene->name);
        stop(&watch);
    }
    const struct gn_render_options with_estimate = {
        .quality = quality, .single_ray = true, .estimate_error = true};
    check(gn_renderer_render(stage->renderer, &stage->camera, state, &with_estimate, &stage->layers,
                             &stage->report, NULL),
          "a frame of", scene->name);
    return sum_up(&watch);
}

static uint64_t count_rays(const struct gn_render_report *r)
{
    return r->rays_primary + r->rays_mirror + r->rays_shade + r->rays_shadow;
}

static void measure_setting(struct bench *b, const struct gn_bench_map *map,
                            const struct gn_bench_picture references[static GN_BENCH_SCENES],
                            double exact[static GN_BENCH_NORMALS][3],
                            const struct gn_lighting_state *previous,
                            const struct gn_bench_setting *s)
{
    struct gn_light_options options = s->light;
    struct timing light;
    options.no_sh = true;
    struct gn_lighting_state *state = make_state(b, map, &options, previous, &light);
    for (int i = 0; i < GN_BENCH_SCENES; i++) {
        struct gn_bench_scene *scene = &b->scenes[i];
        struct gn_bench_errors e;
        struct timing frame = render(b, scene, state, s->quality);
        check(gn_bench_measure_errors(&references[i], &scene->stage.layers, true, &e),
              "the errors of", scene->name);
        b->n_too_near[i] += e.rmse < 10 * b->self_error[i];
        fprintf(
            b->errors,
            "%s,%s,%s,%s,%d,%d,%.4f,%.4f,%.4f,%.4f,%llu,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%ld,%.6g\n",
            scene->name, map->name, s->method, s->params, s->asked, state->n_lights, light.median,
            light.range, frame.median, frame.range,
            (unsigned long long)count_rays(&scene->stage.report), e.rmse, e.bias, e.relmse,
            e.relmse_trimmed, gn_bench_compare_irradiance(state, exact), e.flip, e.n_masked,
            scene->stage.report.estimated_error);
    }
    gn_lighting_state_unref(&state);
}

/** Harmonics need no scene: diffuse surfaces take E(n) of them. */
static void measure_harmonics(struct bench *b, const struct gn_bench_map *map,
                              double exact[static GN_BENCH_NORMALS][3],
                              const struct gn_lighting_state *previous)
{
    static const struct {
        const char *name;
        struct gn_irradiance_options options;
    } kinds[] = {{"order 2 of all light (the paper)", {.order = 2, .keep_lights = true}},
                 {"order 2", {.order = 2}},
                 {"order 4", {.order = 4}},
                 {"order 2 without ringing", {.order = 2, .dering = true}},
                 {"order 4 without ringing", {.order = 4, .dering = true}}};
    for (size_t i = 0; i < GN_ARRAY_LEN(kinds); i++) {
        const struct gn_light_options options = {.no_lights = true, .irradiance = kinds[i].options};
        struct timing timing;
        struct gn_lighting_state *state = make_state(b, map, &options, previous, &timing);
        fprintf(b->irradiance, "%s,%s,%.4f,%.6g\n", map->name, kinds[i].name, timing.median,
                gn_bench_compare_sh(state, exact));
        gn_lighting_state_unref(&state);
    }
}

/** RMSE of the shadow between the picture and that of parts twice as wide. */
static double compare_with_wider(struct bench *b, struct gn_bench_scene *scene,
                                 const struct gn_bench_map *map,
                                 const struct gn_bench_picture *picture, int factor)
{
    struct gn_bench_picture wider;
    struct gn_bench_errors self;
    check(gn_bench_make_reference(&b->cache, scene, map, factor / 2, &wider),
          "the coarser reference of", map->name);
    const struct gn_layers layers = {.width = wider.shadow.width,
                                     .height = wider.shadow.height,
                                     .virtual_rgba = wider.virtual_rgba,
                                     .shadow = wider.shadow};
    check(gn_bench_measure_errors(picture, &layers, false, &self), "the self-error of", map->name);
    gn_bench_picture_finish(&wider);
    return self.rmse;
}

/** After Richardson 1911: where halving the parts divides the error by r, the error that is left is
 * the last difference / (r - 1). r is the ratio of the last two differences, within [1.5, 3]; with
 * only one difference it is taken for 2. */
static double estimate_self_error(struct bench *b, struct gn_bench_scene *scene,
                                  const struct gn_bench_map *map,
                                  const struct gn_bench_picture *picture, int factor)
{
    double last = compare_with_wider(b, scene, map, picture, factor);
    if (factor < 4)
        return last;
    struct gn_bench_picture middle;
    check(gn_bench_make_reference(&b->cache, scene, map, factor / 2, &middle),
          "the coarser reference of", map->name);
    double before = compare_with_wider(b, scene, map, &middle, factor / 2);
    gn_bench_picture_finish(&middle);
    return last / (fmin(fmax(before / last, 1.5), 3) - 1);
}

/** The pictures to compare with, and how far they are from the truth. */
static void make_references(struct bench *b, const struct gn_bench_map *map, int factor,
                            struct gn_bench_picture out[static GN_BENCH_SCENES])
{
    for (int i = 0; i < GN_BENCH_SCENES; i++) {
        check(gn_bench_make_reference(&b->cache, &b->scenes[i], map, factor, &out[i]),
              "the reference of", map->name);
        b->n_too_near[i] = 0;
        // Quick: only whether errors change is looked at.
        b->self_error[i] =
            b->extent->is_quick ? 0 : estimate_self_error(b, &b->scenes[i], map, &out[i], factor);
    }
}

static void check_references(struct bench *b, const struct gn_bench_map *map)
{
    for (int i = 0; i < GN_BENCH_SCENES; i++) {
        bool is_good = 3 * b->n_too_near[i] <= b->n_settings;
        fprintf(b->reference, "%s,%s,%.4g,%d\n", b->scenes[i].name, map->name, b->self_error[i],
                b->n_too_near[i]);
        printf("%-22s %-8s reference within %.2g; of %d settings %d are nearer than ten times "
               "that%s\n",
               map->name, b->scenes[i].name, b->self_error[i], b->n_settings, b->n_too_near[i],
               !is_good           ? ": TOO MANY"
               : b->n_too_near[i] ? ": requirement missed, left out"
                                  : "");
        b->is_bad = b->is_bad || !is_good;
    }
}

static void measure_map(struct bench *b, const struct gn_bench_map_kind *kind)
{
    static double exact[GN_BENCH_NORMALS][3];
    const struct gn_light_options first = {.no_sh = true};
    struct gn_bench_picture references[GN_BENCH_SCENES];
    struct gn_lighting_state *state = NULL;
    struct gn_bench_map map;
    struct timing unused;
    const char *name = kind->name;
    int ret = gn_bench_map_init(name, b->extent->map_size, &map);
    if (ret == -ENOENT) {
        printf("%-22s not here: left out\n", name);
        return;
    }
    check(ret, "the map", name);
    make_references(b, &map, b->extent->is_quick ? 1 : kind->factor, references);
    state = make_state(b, &map, &first, NULL, &unused);
    gn_bench_sum_texels(state->map, exact);
    for (int i = 0; i < b->n_settings; i++)
        measure_setting(b, &map, references, exact, state, &b->settings[i]);
    measure_harmonics(b, &map, exact, state);
    check_references(b, &map);
    fflush(NULL);
    gn_lighting_state_unref(&state);
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_picture_finish(&references[i]);
    gn_bench_map_finish(&map);
}

static void measure_streams(struct bench *b)
{
    static struct gn_bench_setting settings[GN_BENCH_SETTINGS_MAX];
    static const double smoothings[] = {0, 0.4}; // none, and the daemon's default
    static struct gn_bench_streams streams;
    struct gn_bench_scene scene;
    int n = gn_bench_list_settings(GN_BENCH_STREAM, settings);
    gn_bench_scene_init(&scene, 0, 64, 48);
    check(gn_bench_streams_init(&streams, &b->cache, &scene), "the references of", "streams");
    for (int i = 0; i < n; i++) {
        for (size_t k = 0; k < GN_ARRAY_LEN(smoothings); k++) {
            struct gn_bench_steadiness s;
            check(gn_bench_measure_steadiness(&streams, &settings[i], smoothings[k], &s),
                  "the stream of", settings[i].method);
            fprintf(b->stream, "%s,%s,%d,%g,%.6g,%.6g,%d\n", settings[i].method, settings[i].params,
                    s.n_lights, smoothings[k], s.flicker, s.noise_codes, s.response_frames);
        }
    }
    gn_bench_streams_finish(&streams);
    gn_bench_scene_finish(&scene);
}

static FILE *open_table(const struct bench *b, const char *name, const char *head)
{
    char path[4096];
    FILE *file = NULL;
    if (snprintf(path, sizeof(path), "%s/%s", b->folder, name) < (int)sizeof(path))
        file = fopen(path, "w");
    check(file ? 0 : -errno, "cannot write", path);
    fprintf(file, "%s\n", head);
    return file;
}

/** How many threads of the whole machine wanted to run in the last minutes; < 0: unknown. */
static double get_load(void)
{
    double load = -1;
    FILE *file = fopen("/proc/loadavg", "r");
    if (file && fscanf(file, "%*f %*f %lf", &load) != 1)
        load = -1;
    if (file)
        fclose(file);
    return load;
}

static void write_run(const struct bench *b)
{
    FILE *file = open_table(b, "run.csv", "compiler,width,height,repeats,load");
#if defined(__clang__)
    fprintf(file, "clang %s,", __clang_version__);
#else
    fprintf(file, "gcc %s,", __VERSION__);
#endif
    fprintf(file, "%d,%d,%d,%.1f\n", b->extent->width, b->extent->height, b->extent->repeats,
            get_load());
    check(fclose(file) == 0 ? 0 : -errno, "cannot write into", b->folder);
}

static void run(struct bench *b)
{
    b->errors = open_table(
        b, "error.csv",
        "scene,map,method,params,asked,lights,ms_light,iqr_light,ms_frame,"
        "iqr_frame,rays,rmse,bias,relmse,relmse_trimmed,irradiance,flip,masked,estimated");
    b->irradiance = open_table(b, "irradiance.csv", "map,harmonics,ms,irradiance");
    b->stream = open_table(b, "stream.csv",
                           "method,params,lights,smoothing,flicker,noise_codes,response_frames");
    b->reference = open_table(b, "reference.csv", "scene,map,self_error,too_near");
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_scene_init(&b->scenes[i], i, b->extent->width, b->extent->height);
    b->n_settings = gn_bench_list_settings(b->extent->settings, b->settings);
    for (int i = 0; i < gn_bench_n_maps && i < b->extent->n_maps; i++) {
        if (!b->only_map || strcmp(b->only_map, gn_bench_maps[i].name) == 0)
            measure_map(b, &gn_bench_maps[i]);
    }
    if (!b->only_map)
        measure_streams(b);
    write_run(b);
    FILE *files[] = {b->errors, b->irradiance, b->stream, b->reference};
    for (size_t i = 0; i < GN_ARRAY_LEN(files); i++)
        check(fclose(files[i]) == 0 ? 0 : -errno, "cannot write into", b->folder);
    for (int i = 0; i < GN_BENCH_SCENES; i++)
        gn_bench_scene_finish(&b->scenes[i]);
    printf("%d settings; references: %d made in %.1f s, %d read\n", b->n_settings, b->cache.n_made,
           b->cache.seconds, b->cache.n_read);
}

static int refuse(const char *name)
{
    fprintf(
        stderr,
        "usage: %s [--quick | --default | --full] [--map NAME] [--cache FOLDER] FOLDER\n"
        "Writes CSV tables into FOLDER. --quick: seconds, for the guard: its references have\n"
        "whole texels, their own error is taken for 0 and nothing is checked against it; --full:\n"
        "more repeats and maps. GN_TEST_MAPS and GNOMON_DATA name folders of photographs.\n",
        name);
    return 2;
}

int main(int argc, char **argv)
{
    static struct bench b = {.extent = &extents[1]};
    for (int i = 1; i < argc; i++) {
        bool is_extent = false;
        for (size_t k = 0; k < GN_ARRAY_LEN(extents); k++) {
            if (strcmp(argv[i], extents[k].option) == 0) {
                b.extent = &extents[k];
                is_extent = true;
            }
        }
        if (is_extent)
            continue;
        if (strcmp(argv[i], "--cache") == 0 && i + 1 < argc)
            b.cache.folder = argv[++i];
        else if (strcmp(argv[i], "--map") == 0 && i + 1 < argc)
            b.only_map = argv[++i];
        else if (argv[i][0] == '-' || b.folder)
            return refuse(argv[0]);
        else
            b.folder = argv[i];
    }
    if (!b.folder)
        return refuse(argv[0]);
    const char *folders[] = {b.folder, b.cache.folder};
    for (int i = 0; i < 2; i++) {
        if (folders[i] && mkdir(folders[i], 0777) != 0 && errno != EEXIST)
            check(-errno, "cannot make", folders[i]);
    }
    run(&b);
    return b.is_bad ? 1 : 0;
}
