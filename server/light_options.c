/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light_options.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

enum {
    ALL = (1 << GN_LIGHT_METHOD_COUNT) - 1,
    SEED = 1 << GN_LIGHT_PARTITION_SEED,
    PARTITION = 1 << GN_LIGHT_PARTITION_ENERGY | SEED,
    PENROSE = 1 << GN_LIGHT_PENROSE,
};

/** Which methods an option means something to. */
static const struct {
    const char *key;
    unsigned methods;
} takers[] = {
    {"lights", ALL & ~SEED},
    {"light-rings", PARTITION},
    {"light-sectors", PARTITION},
    {"light-max-ls", PARTITION},
    {"light-samples", PARTITION},
    {"light-metric", PARTITION},
    {"light-weights", PENROSE},
    {"light-relaxed", PARTITION | PENROSE},
    {"light-literal", PARTITION | PENROSE},
    {"light-mended", PARTITION | PENROSE},
};

/** "a", "a and b", "a, b and c". */
static void list_methods(unsigned methods, char *out, size_t size)
{
    size_t length = 0;
    out[0] = '\0';
    for (int i = 0; i < GN_LIGHT_METHOD_COUNT && length < size; i++) {
        if (!(methods & 1u << i))
            continue;
        unsigned rest = methods >> (i + 1);
        const char *before = length == 0 ? "" : rest ? ", " : " and ";
        length += (size_t)snprintf(out + length, size - length, "%s%s", before,
                                   gn_light_method_get_name((enum gn_light_method)i));
    }
}

static int refuse(const struct gn_options *o, const char *section, const char *name,
                  const char *key, const char *why, struct gn_error *out_error)
{
    return gn_error_set(out_error, -EINVAL, "%s: %s = %s has no effect: %s",
                        gn_options_get_source(o, section, name, key), key,
                        gn_options_get_string(o, section, name, key), why);
}

static int check_takers(const struct gn_options *o, const char *section, const char *name,
                        enum gn_light_method method, struct gn_error *out_error)
{
    for (size_t i = 0; i < GN_ARRAY_LEN(takers); i++) {
        char methods[96], why[192];
        if (takers[i].methods & 1u << method ||
            gn_options_is_default(o, section, name, takers[i].key))
            continue;
        list_methods(takers[i].methods, methods, sizeof(methods));
        snprintf(why, sizeof(why), "the method %s does not take it; %s do%s",
                 gn_light_method_get_name(method), methods, strchr(methods, ' ') ? "" : "es");
        return refuse(o, section, name, takers[i].key, why, out_error);
    }
    return 0;
}

/** What else a method does not look at. */
static int check_readings(const struct gn_options *o, const char *section, const char *name,
                          const struct gn_light_options *light, struct gn_error *out_error)
{
    static const char *const sampling[] = {"light-samples", "light-relaxed"};
    bool is_seed = light->method == GN_LIGHT_PARTITION_SEED;
    unsigned readings = ((is_seed ? GN_READ_SEED : 0) | light->literal) & ~light->mended;
    unsigned penrose = GN_READ_PLAIN_SAMPLING | GN_READ_DISCARD_DARK;
    bool is_partition = (1u << light->method & PARTITION) != 0;
    bool is_log = light->metric == GN_METRIC_LOG2 || light->metric == GN_METRIC_DEFAULT;
    if (light->method == GN_LIGHT_PENROSE && (light->literal | light->mended) & ~penrose)
        return refuse(o, section, name,
                      light->literal & ~penrose ? "light-literal" : "light-mended",
                      "of the readings, the method penrose takes plain-sampling and discard-dark; "
                      "partition and seed take all",
                      out_error);
    if (light->method == GN_LIGHT_PARTITION_ENERGY && !is_log &&
        !gn_options_is_default(o, section, name, "lights"))
        return refuse(o, section, name, "lights",
                      "the method partition aims at a number with light-metric log2 only",
                      out_error);
    for (size_t i = 0; i < GN_ARRAY_LEN(sampling); i++)
        if (is_partition && !(readings & GN_READ_SAMPLED) &&
            !gn_options_is_default(o, section, name, sampling[i]))
            return refuse(o, section, name, sampling[i],
                          "the partition draws samples only where light-literal has sample-mean, "
                          "sample-max or brightest",
                          out_error);
    return 0;
}

int gn_light_options_read(const struct gn_options *options, const char *section, const char *name,
                          struct gn_light_options *light, struct gn_error *out_error)
{
    const struct gn_options *o = options;
    light->rings = gn_options_get_int(o, section, name, "light-rings");
    light->sectors = gn_options_get_int(o, section, name, "light-sectors");
    light->max_ls = gn_options_get_int(o, section, name, "light-max-ls");
    light->n_samples = gn_options_get_int(o, section, name, "light-samples");
    light->metric = (enum gn_partition_metric)gn_options_get_enum(o, section, name, "light-metric");
    light->literal = gn_options_get_set(o, section, name, "light-literal");
    light->mended = gn_options_get_set(o, section, name, "light-mended");
    light->weights = (enum gn_light_weights)gn_options_get_enum(o, section, name, "light-weights");
    light->relaxed = gn_options_get_bool(o, section, name, "light-relaxed");
    light->no_discs = !gn_options_get_bool(o, section, name, "light-discs");
    light->irradiance = (struct gn_irradiance_options){
        .order = gn_options_get_enum(o, section, name, "sh-order") == 0 ? 2 : 4,
        .dering = gn_options_get_bool(o, section, name, "sh-dering"),
        .keep_lights = gn_options_get_bool(o, section, name, "sh-keep-lights"),
    };
    int rc = check_takers(o, section, name, light->method, out_error);
    return rc ? rc : check_readings(o, section, name, light, out_error);
}
