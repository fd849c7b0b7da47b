/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/options.h"

#include <assert.h>
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/options_internal.h"

size_t gn_section_get_length(const char *section)
{
    return strcspn(section, " ");
}

bool gn_section_is_named(const char *section)
{
    return section != NULL && strchr(section, '*') != NULL;
}

bool gn_section_is_same(const char *a, const char *b)
{
    return a == b || (a != NULL && b != NULL && strcmp(a, b) == 0);
}

struct gn_option_instance *gn_options_find(const struct gn_options *options, const char *section,
                                           size_t section_length, const char *name)
{
    for (int i = 0; i < options->n_instances; i++) {
        struct gn_option_instance *instance = &options->instances[i];
        if ((section == NULL) != (instance->section == NULL))
            continue;
        if (section != NULL && (gn_section_get_length(instance->section) != section_length ||
                                strncmp(instance->section, section, section_length) != 0))
            continue;
        if (strcmp(instance->name, name == NULL ? "" : name) == 0)
            return instance;
    }
    return NULL;
}

/* Fills the defaults of a new instance; they are ours and must be right. */
static int set_defaults(const struct gn_options *options, struct gn_option_instance *instance)
{
    for (int i = 0; i < options->program->n_options; i++) {
        const struct gn_option *option = &options->program->options[i];
        if (option->default_value == NULL ||
            !gn_section_is_same(option->section, instance->section))
            continue;
        struct gn_error error = {0};
        int ret = gn_options_set(options, instance, i, option->default_value, GN_RANK_DEFAULT,
                                 "default", option->key, &error);
        assert(ret != -EINVAL);
        if (ret < 0)
            return ret;
    }
    return 0;
}

static void finish_instance(const struct gn_options *options, struct gn_option_instance *instance)
{
    for (int i = 0; instance->values != NULL && i < options->program->n_options; i++)
        free(instance->values[i].text);
    free(instance->values);
    *instance = (struct gn_option_instance){0};
}

static bool is_good_name(const char *name, size_t length)
{
    if (length < 1 || length > GN_OPTIONS_MAX_NAME)
        return false;
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)name[i]) && name[i] != '-' && name[i] != '_')
            return false;
    return true;
}

int gn_options_add(struct gn_options *options, const char *section, const char *name,
                   size_t name_length, const char *where, struct gn_option_instance **out_instance,
                   struct gn_error *out_error)
{
    char copy[GN_OPTIONS_MAX_NAME + 1] = "";
    size_t section_length = section == NULL ? 0 : gn_section_get_length(section);
    if (gn_section_is_named(section)) {
        if (!is_good_name(name, name_length))
            return gn_error_set(out_error, -EINVAL,
                                "%s: '%.*s' is no name for a %.*s: expected 1 to %d letters, "
                                "digits, '-' or '_'",
                                where, (int)(name_length > 40 ? 40 : name_length), name,
                                (int)section_length, section, GN_OPTIONS_MAX_NAME);
        memcpy(copy, name, name_length);
    }
    *out_instance = gn_options_find(options, section, section_length, copy);
    if (*out_instance != NULL)
        return 0;
    int n_same = 0;
    for (int i = 0; i < options->n_instances; i++)
        n_same += gn_section_is_same(options->instances[i].section, section) ? 1 : 0;
    if (n_same >= GN_OPTIONS_MAX_NAMES)
        return gn_error_set(out_error, -ENOSPC, "%s: more than %d sections [%s]", where,
                            GN_OPTIONS_MAX_NAMES, section);

    struct gn_option_instance *grown = realloc(
        options->instances, (size_t)(options->n_instances + 1) * sizeof(*options->instances));
    if (grown == NULL)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", where);
    options->instances = grown;
    struct gn_option_instance *instance = &grown[options->n_instances];
    *instance = (struct gn_option_instance){.section = section};
    memcpy(instance->name, copy, sizeof(copy));
    instance->values = calloc((size_t)options->program->n_options + 1, sizeof(*instance->values));
    int ret = instance->values == NULL ? -ENOMEM : set_defaults(options, instance);
    if (ret < 0) {
        finish_instance(options, instance);
        return gn_error_set(out_error, ret, "%s: out of memory", where);
    }
    options->n_instances++;
    *out_instance = instance;
    return 0;
}

int gn_options_create(const struct gn_program *program, struct gn_options **out)
{
    *out = NULL;
    struct gn_options *options = calloc(1, sizeof(*options));
    if (options == NULL)
        return -ENOMEM;
    options->program = program;
    int ret = 0;
    for (int i = 0; i < program->n_options && ret == 0; i++) {
        struct gn_option_instance *instance = NULL;
        if (!gn_section_is_named(program->options[i].section))
            ret = gn_options_add(options, program->options[i].section, "", 0, "default", &instance,
                                 NULL);
    }
    if (ret < 0) {
        gn_options_destroy(&options);
        return ret;
    }
    *out = options;
    return 0;
}

void gn_options_destroy(struct gn_options **options)
{
    if (*options == NULL)
        return;
    for (int i = 0; i < (*options)->n_instances; i++)
        finish_instance(*options, &(*options)->instances[i]);
    free((*options)->instances);
    free((*options)->arguments);
    free(*options);
    *options = NULL;
}

int gn_options_check(const struct gn_options *options, struct gn_error *out_error)
{
    for (int i = 0; i < options->n_instances; i++) {
        const struct gn_option_instance *instance = &options->instances[i];
        for (int k = 0; k < options->program->n_options; k++) {
            const struct gn_option *option = &options->program->options[k];
            char flag[GN_OPTIONS_MAX_LABEL], expected[256];
            if (!option->is_required || instance->values[k].text != NULL ||
                !gn_section_is_same(option->section, instance->section))
                continue;
            gn_option_get_flag(option, instance->name, sizeof(flag), flag);
            gn_option_get_expectation(option, sizeof(expected), expected);
            if (option->section == NULL)
                return gn_error_set(out_error, -EINVAL,
                                    "command line: --%s is missing, expected %s; see %s --help",
                                    flag, expected, options->program->name);
            return gn_error_set(out_error, -EINVAL,
                                "configuration: '%s' of [%.*s%s%s] (or --%s) is missing, expected "
                                "%s",
                                option->key, (int)gn_section_get_length(option->section),
                                option->section, instance->name[0] == '\0' ? "" : " ",
                                instance->name, flag, expected);
        }
    }
    int n = options->n_arguments;
    const struct gn_program *program = options->program;
    if (n < program->min_arguments || n > program->max_arguments)
        return gn_error_set(
            out_error, -EINVAL, "command line: %s%.64s%s; usage: %s %s",
            n > program->max_arguments ? "too many words, unexpected " : "a word is missing",
            n > program->max_arguments ? options->arguments[program->max_arguments] : "",
            options->is_after_pattern ? " (put a pattern in quotes)" : "", program->name,
            program->usage);
    return 0;
}

/* The value asked for; asking for what the table does not hold is a bug. */
static const struct gn_option_value *get_value(const struct gn_options *options,
                                               const char *section, const char *name,
                                               const char *key, const struct gn_option **out_option)
{
    size_t length = section == NULL ? 0 : strlen(section);
    const struct gn_option_instance *instance = gn_options_find(options, section, length, name);
    assert(instance != NULL);
    for (int i = 0; i < options->program->n_options; i++) {
        const struct gn_option *option = &options->program->options[i];
        if (gn_section_is_same(option->section, instance->section) &&
            strcmp(option->key, key) == 0) {
            *out_option = option;
            return &instance->values[i];
        }
    }
    assert(!"an option that the table does not hold");
    abort();
}

static const struct gn_option_value *get_typed(const struct gn_options *options,
                                               const char *section, const char *name,
                                               const char *key, enum gn_option_type type)
{
    const struct gn_option *option = NULL;
    const struct gn_option_value *value = get_value(options, section, name, key, &option);
    assert(option->type == type);
    (void)type;
    return value;
}

bool gn_options_is_known(const struct gn_options *options, const char *section, const char *key)
{
    for (int i = 0; i < options->program->n_options; i++)
        if (gn_section_is_same(options->program->options[i].section, section) &&
            strcmp(options->program->options[i].key, key) == 0)
            return true;
    return false;
}

bool gn_options_is_set(const struct gn_options *options, const char *section, const char *name,
                       const char *key)
{
    const struct gn_option *option = NULL;
    return get_value(options, section, name, key, &option)->text != NULL;
}

bool gn_options_is_default(const struct gn_options *options, const char *section, const char *name,
                           const char *key)
{
    const struct gn_option *option = NULL;
    const char *text = get_value(options, section, name, key, &option)->text;
    return text == NULL ||
           (option->default_value != NULL && strcmp(text, option->default_value) == 0);
}

bool gn_options_get_bool(const struct gn_options *options, const char *section, const char *name,
                         const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_BOOL)->as.boolean;
}

int gn_options_get_int(const struct gn_options *options, const char *section, const char *name,
                       const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_INT)->as.integer;
}

double gn_options_get_double(const struct gn_options *options, const char *section,
                             const char *name, const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_DOUBLE)->as.number;
}

const char *gn_options_get_string(const struct gn_options *options, const char *section,
                                  const char *name, const char *key)
{
    const struct gn_option *option = NULL;
    return get_value(options, section, name, key, &option)->text;
}

int gn_options_get_enum(const struct gn_options *options, const char *section, const char *name,
                        const char *key)
{
    const struct gn_option_value *value = get_typed(options, section, name, key, GN_OPTION_ENUM);
    return value->text == NULL ? -1 : value->as.integer;
}

unsigned gn_options_get_set(const struct gn_options *options, const char *section, const char *name,
                            const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_SET)->as.set;
}

uint64_t gn_options_get_bytes(const struct gn_options *options, const char *section,
                              const char *name, const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_BYTES)->as.bytes;
}

struct gn_address gn_options_get_address(const struct gn_options *options, const char *section,
                                         const char *name, const char *key)
{
    return get_typed(options, section, name, key, GN_OPTION_ADDRESS)->as.address;
}

const char *gn_options_get_source(const struct gn_options *options, const char *section,
                                  const char *name, const char *key)
{
    const struct gn_option *option = NULL;
    return get_value(options, section, name, key, &option)->source;
}

/* The i-th instance of a named section, or NULL; *out_n is their number. */
static const struct gn_option_instance *get_named(const struct gn_options *options,
                                                  const char *section, int i, int *out_n)
{
    const struct gn_option_instance *result = NULL;
    *out_n = 0;
    for (int k = 0; k < options->n_instances; k++) {
        const struct gn_option_instance *instance = &options->instances[k];
        if (!gn_section_is_named(instance->section) ||
            gn_section_get_length(instance->section) != strlen(section) ||
            strncmp(instance->section, section, strlen(section)) != 0)
            continue;
        if (*out_n == i)
            result = instance;
        (*out_n)++;
    }
    return result;
}

int gn_options_get_name_count(const struct gn_options *options, const char *section)
{
    int n;
    (void)get_named(options, section, -1, &n);
    return n;
}

const char *gn_options_get_name(const struct gn_options *options, const char *section, int i)
{
    int n;
    const struct gn_option_instance *instance = get_named(options, section, i, &n);
    assert(instance != NULL);
    return instance->name;
}

int gn_options_get_argument_count(const struct gn_options *options)
{
    return options->n_arguments;
}

const char *gn_options_get_argument(const struct gn_options *options, int i)
{
    assert(i >= 0 && i < options->n_arguments);
    return options->arguments[i];
}

bool gn_options_wants_help(const struct gn_options *options)
{
    return options->wants_help;
}

bool gn_options_wants_version(const struct gn_options *options)
{
    return options->wants_version;
}

void gn_options_visit(const struct gn_options *options, gn_options_visit_fn visit, void *context)
{
    for (int k = 0; k < options->program->n_options; k++) {
        const struct gn_option *option = &options->program->options[k];
        char section[64] = "";
        if (option->section != NULL)
            snprintf(section, sizeof(section), "%.*s", (int)gn_section_get_length(option->section),
                     option->section);
        for (int i = 0; i < options->n_instances; i++) {
            const struct gn_option_instance *instance = &options->instances[i];
            const struct gn_option_value *value = &instance->values[k];
            if (value->text == NULL || !gn_section_is_same(option->section, instance->section))
                continue;
            visit(context, section, instance->name[0] == '\0' ? NULL : instance->name, option->key,
                  option->is_secret ? "(hidden)" : value->text, value->source);
        }
    }
}
