/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * How fast the renderer is, beside peers in the same run. Wall times, medians after a warm-up;
 * writes CSV tables into the folder.
 */
#include "tests/bench/performance/performance.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/thread.h"
#include "tests/bench/timing.h"

static const struct part {
    const char *name;
    void (*measure)(const struct gn_performance *run);
} parts[] = {
    {"hardest", gn_performance_measure_hardest},
    {"rate", gn_performance_measure_rate},
    {"error", gn_performance_measure_error},
    {"scaling", gn_performance_measure_scaling},
};

FILE *gn_performance_open(const struct gn_performance *run, const char *name, const char *head)
{
    char path[4096];
    FILE *file = NULL;
    if (snprintf(path, sizeof(path), "%s/%s.csv", run->folder, name) < (int)sizeof(path))
        file = fopen(path, "w");
    gn_bench_check(file ? 0 : -errno, path);
    fprintf(file, "%s\n", head);
    return file;
}

void gn_performance_close(FILE *file)
{
    gn_bench_check(fclose(file) == 0 ? 0 : -errno, "cannot write a table");
}

static void write_run(const struct gn_performance *run)
{
    FILE *file = gn_performance_open(run, "run", "compiler,threads,repeats");
#if defined(__clang__)
    fprintf(file, "clang %s,", __clang_version__);
#else
    fprintf(file, "gcc %s,", __VERSION__);
#endif
    fprintf(file, "%d,%d\n", run->n_threads, run->n_repeats);
    gn_performance_close(file);
}

static int refuse(const char *name)
{
    fprintf(
        stderr,
        "usage: %s [--part NAME] [--cache FOLDER] [--repeats 3..%d] [--threads 1..256] FOLDER\n",
        name, GN_BENCH_REPEATS_MAX);
    fprintf(stderr, "Writes CSV tables into FOLDER. Parts:");
    for (size_t i = 0; i < GN_ARRAY_LEN(parts); i++)
        fprintf(stderr, " %s", parts[i].name);
    fprintf(stderr, "\n");
    return 2;
}

int main(int argc, char **argv)
{
    struct gn_performance run = {.n_threads = gn_thread_get_cpu_count(), .n_repeats = 7};
    const char *only = NULL;
    bool is_known = true;
    for (int i = 1; i < argc; i++) {
        bool has_value = i + 1 < argc;
        if (strcmp(argv[i], "--part") == 0 && has_value)
            only = argv[++i];
        else if (strcmp(argv[i], "--cache") == 0 && has_value)
            run.cache = argv[++i];
        else if (strcmp(argv[i], "--repeats") == 0 && has_value)
            run.n_repeats = atoi(argv[++i]);
        else if (strcmp(argv[i], "--threads") == 0 && has_value)
            run.n_threads = atoi(argv[++i]);
        else if (argv[i][0] == '-' || run.folder)
            return refuse(argv[0]);
        else
            run.folder = argv[i];
    }
    if (!run.folder || run.n_repeats < 3 || run.n_repeats > GN_BENCH_REPEATS_MAX ||
        run.n_threads < 1 || run.n_threads > 256)
        return refuse(argv[0]);
    if (only) {
        is_known = false;
        for (size_t i = 0; i < GN_ARRAY_LEN(parts); i++)
            is_known |= strcmp(only, parts[i].name) == 0;
    }
    if (!is_known)
        return refuse(argv[0]);
    const char *folders[] = {run.folder, run.cache};
    for (int i = 0; i < 2; i++) {
        if (folders[i] && mkdir(folders[i], 0777) != 0 && errno != EEXIST)
            gn_bench_check(-errno, folders[i]);
    }
    for (size_t i = 0; i < GN_ARRAY_LEN(parts); i++) {
        if (!only || strcmp(only, parts[i].name) == 0)
            parts[i].measure(&run);
    }
    write_run(&run);
    return 0;
}
