/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/bench/error_time/settings.h"

#include <stdio.h>
#include <string.h>

#include "server/light/method.h"

/** What else a method can be asked for, as a row of the tables of its own. */
static const struct variant {
    enum gn_light_method method;
    const char *suffix;
    enum gn_light_weights weights;
    bool relaxed;
} variants[] = {
    {GN_LIGHT_PENROSE, " equal", GN_WEIGHTS_EQUAL, false},
    {GN_LIGHT_PENROSE, " relaxed", GN_WEIGHTS_PARTITION, true},
};

struct list {
    int n;
    struct gn_bench_setting *settings;
};

static struct gn_bench_setting *add(struct list *list, const char *method, const char *suffix)
{
    if (list->n == GN_BENCH_SETTINGS_MAX)
        return NULL;
    struct gn_bench_setting *s = &list->settings[list->n++];
    *s = (struct gn_bench_setting){.quality = GN_QUALITY_INTERACTIVE};
    snprintf(s->method, sizeof(s->method), "%s%s", method, suffix);
    return s;
}

static void add_aims(struct list *list, enum gn_bench_extent extent, enum gn_light_method method,
                     const struct variant *variant)
{
    static const int aims[] = {4, 8, 16, 32, 64, 128, 256, 512, 1024};
    for (size_t i = 0; i < GN_ARRAY_LEN(aims); i++) {
        if ((extent == GN_BENCH_STREAM && aims[i] != 64) ||
            (extent == GN_BENCH_QUICK && aims[i] != 16 && aims[i] != 64))
            continue;
        struct gn_bench_setting *s =
            add(list, gn_light_method_get_name(method), variant ? variant->suffix : "");
        if (!s)
            return;
        s->asked = aims[i];
        s->light = (struct gn_light_options){.method = method, .n_lights = aims[i]};
        if (variant) {
            s->light.weights = variant->weights;
            s->light.relaxed = variant->relaxed;
        }
        snprintf(s->params, sizeof(s->params), "n=%d", aims[i]);
    }
}

/** One reading of the paper's partition; "paper" has its sums without cosine too. */
static void add_seed(struct list *list, const struct gn_light_options *options, bool is_paper)
{
    struct gn_bench_setting *s = add(list, is_paper ? "paper" : "seed", "");
    if (!s)
        return;
    s->light = *options;
    s->light.method = GN_LIGHT_PARTITION_SEED;
    s->quality = is_paper ? GN_QUALITY_SEED : GN_QUALITY_INTERACTIVE;
    snprintf(s->params, sizeof(s->params), "%dx%d maxLS=%d %s mean of %s", options->rings,
             options->sectors, options->max_ls, options->metric == GN_METRIC_POW2 ? "2^k" : "2k",
             options->mended & GN_READ_SAMPLE_MEAN ? "texels" : "samples");
}

/** The paper leaves the base division, the metric and what MLEM is the mean of open: the baseline
 * may choose among all of these. */
static void add_seeds(struct list *list, enum gn_bench_extent extent)
{
    static const int divisions[][2] = {{2, 6}, {4, 12}, {8, 24}, {10, 32}, {14, 48}};
    static const int max_ls[] = {1, 4, 8, 64};
    for (int i = 0; i < 5 * 4 * 2 * 2; i++) {
        const int *division = divisions[i / 16];
        int ls = max_ls[i / 4 % 4];
        bool is_twice = i % 2, is_texels = i / 2 % 2;
        if ((ls == 1 && is_twice) || (extent != GN_BENCH_DEFAULT && division[0] != 8) ||
            (extent == GN_BENCH_QUICK && (is_twice || ls < 8)) ||
            (extent == GN_BENCH_STREAM && (ls != 8 || is_twice)))
            continue;
        struct gn_light_options options = {.rings = division[0],
                                           .sectors = division[1],
                                           .max_ls = ls,
                                           .metric = is_twice ? GN_METRIC_TWICE : GN_METRIC_POW2,
                                           .mended = is_texels ? GN_READ_SAMPLE_MEAN : 0};
        add_seed(list, &options, false);
        if (division[0] == 8 && !is_twice && extent != GN_BENCH_STREAM)
            add_seed(list, &options, true);
    }
}

int gn_bench_list_settings(enum gn_bench_extent extent,
                           struct gn_bench_setting out[static GN_BENCH_SETTINGS_MAX])
{
    struct list list = {0, out};
    for (int i = 0; i < GN_LIGHT_METHOD_COUNT; i++) {
        enum gn_light_method method = (enum gn_light_method)i;
        if (method == GN_LIGHT_PARTITION_SEED)
            add_seeds(&list, extent);
        else
            add_aims(&list, extent, method, NULL);
        for (size_t v = 0; v < GN_ARRAY_LEN(variants); v++) {
            if (variants[v].method == method)
                add_aims(&list, extent, method, &variants[v]);
        }
    }
    return list.n;
}
