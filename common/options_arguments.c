/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Options from the command line, and the usual start of a program. */
#include "common/options.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "common/options_internal.h"

extern char **environ;

void gn_option_get_flag(const struct gn_option *option, const char *name, size_t size,
                        char *out_flag)
{
    const char *section = option->section;
    if (gn_section_is_named(section))
        snprintf(out_flag, size, "%.*s.%s.%s", (int)gn_section_get_length(section), section, name,
                 option->key);
    else if (option->flag != NULL)
        snprintf(out_flag, size, "%s", option->flag);
    else
        snprintf(out_flag, size, "%s%s%s", section == NULL ? "" : section,
                 section == NULL ? "" : "-", option->key);
}

/* What "--flag" means: an option, an instance, and whether "no-" stood before it. */
struct flag {
    int index; // -1: unknown
    bool is_negated;
    struct gn_option_instance *instance;
};

static int refuse_flag(const struct gn_options *options, const char *flag,
                       struct gn_error *out_error)
{
    char candidate[GN_OPTIONS_MAX_LABEL], best[GN_OPTIONS_MAX_LABEL] = "";
    for (int i = 0; i < options->program->n_options; i++) {
        gn_option_get_flag(&options->program->options[i], "NAME", sizeof(candidate), candidate);
        gn_option_suggest(flag, candidate, best);
    }
    if (best[0] != '\0')
        return gn_error_set(out_error, -EINVAL,
                            "command line: unknown option '--%.64s'; did you mean '--%s'?", flag,
                            best);
    return gn_error_set(out_error, -EINVAL, "command line: unknown option '--%.64s'; see %s --help",
                        flag, options->program->name);
}

/* "room.demo.scene": makes the instance where the option exists. */
static int find_named_flag(struct gn_options *options, const char *text, struct flag *out_flag,
                           struct gn_error *out_error)
{
    size_t section_length = strcspn(text, ".");
    const char *name = text + section_length + 1;
    size_t name_length = strcspn(name, ".");
    if (name[name_length] != '.')
        return 0;
    for (int i = 0; i < options->program->n_options; i++) {
        const struct gn_option *option = &options->program->options[i];
        if (!gn_section_is_named(option->section) ||
            gn_section_get_length(option->section) != section_length ||
            strncmp(option->section, text, section_length) != 0 ||
            strcmp(option->key, name + name_length + 1) != 0)
            continue;
        out_flag->index = i;
        return gn_options_add(options, option->section, name, name_length, "command line",
                              &out_flag->instance, out_error);
    }
    return 0;
}

static int find_flag(struct gn_options *options, const char *text, struct flag *out_flag,
                     struct gn_error *out_error)
{
    *out_flag = (struct flag){.index = -1};
    if (strchr(text, '.') != NULL)
        return find_named_flag(options, text, out_flag, out_error);
    const char *negated = strncmp(text, "no-", 3) == 0 ? text + 3 : NULL;
    for (int i = 0; i < options->program->n_options; i++) {
        const struct gn_option *option = &options->program->options[i];
        char flag[GN_OPTIONS_MAX_LABEL];
        if (gn_section_is_named(option->section))
            continue;
        gn_option_get_flag(option, "", sizeof(flag), flag);
        bool is_negated =
            option->type == GN_OPTION_BOOL && negated != NULL && strcmp(negated, flag) == 0;
        if (!is_negated && strcmp(text, flag) != 0)
            continue;
        const char *section = option->section;
        *out_flag = (struct flag){
            .index = i,
            .is_negated = is_negated,
            .instance = gn_options_find(
                options, section, section == NULL ? 0 : gn_section_get_length(section), NULL)};
        return 0;
    }
    return 0;
}

/* One "--flag[=value]"; next is the word after it, or NULL. *out_used: words taken. */
static int read_flag(struct gn_options *options, const char *word, const char *next, int *out_used,
                     struct gn_error *out_error)
{
    char text[GN_OPTIONS_MAX_LABEL], label[GN_OPTIONS_MAX_LABEL + 2], expected[256];
    struct flag flag;
    const char *equals = strchr(word, '=');
    size_t length = equals == NULL ? strlen(word) : (size_t)(equals - word);
    *out_used = 1;
    snprintf(text, sizeof(text), "%.*s", (int)(length > 150 ? 150 : length), word);
    int ret = find_flag(options, text, &flag, out_error);
    if (ret < 0)
        return ret;
    if (flag.index < 0)
        return refuse_flag(options, text, out_error);
    const struct gn_option *option = &options->program->options[flag.index];
    const struct gn_option_value *value = &flag.instance->values[flag.index];
    const char *source = equals == NULL ? next : equals + 1;
    snprintf(label, sizeof(label), "--%s", text);
    if (option->type == GN_OPTION_BOOL && equals == NULL) {
        source = flag.is_negated ? "false" : "true";
    } else if (flag.is_negated) {
        return gn_error_set(out_error, -EINVAL, "command line: %s takes no value", label);
    } else if (source == NULL || (equals == NULL && strncmp(source, "--", 2) == 0)) {
        gn_option_get_expectation(option, sizeof(expected), expected);
        return gn_error_set(out_error, -EINVAL, "command line: %s lacks its value, expected %s",
                            label, expected);
    } else if (equals == NULL) {
        *out_used = 2;
    }
    if (value->text != NULL && value->rank == GN_RANK_ARGUMENTS)
        return gn_error_set(out_error, -EINVAL, "command line: %s is given twice", label);
    return gn_options_set(options, flag.instance, flag.index, source, GN_RANK_ARGUMENTS,
                          "command line", label, out_error);
}

/* Whether the word is an option that takes a pattern. */
static bool takes_pattern(struct gn_options *options, const char *word)
{
    struct flag flag;
    struct gn_error unused = {0};
    if (strncmp(word, "--", 2) != 0 || find_flag(options, word + 2, &flag, &unused) < 0 ||
        flag.index < 0)
        return false;
    const char *value_name = options->program->options[flag.index].value_name;
    return value_name != NULL && strcmp(value_name, "PATTERN") == 0;
}

int gn_options_read_arguments(struct gn_options *options, int argc, char *const argv[],
                              struct gn_error *out_error)
{
    bool is_flag_allowed = true;
    free(options->arguments);
    options->n_arguments = 0;
    options->arguments = calloc((size_t)argc + 1, sizeof(*options->arguments));
    if (options->arguments == NULL)
        return gn_error_set(out_error, -ENOMEM, "command line: out of memory");
    for (int i = 1; i < argc;) {
        char *word = argv[i];
        int n_used = 1;
        if (is_flag_allowed && strcmp(word, "--") == 0) {
            is_flag_allowed = false;
        } else if (is_flag_allowed && (strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0)) {
            options->wants_help = true;
            return 0;
        } else if (is_flag_allowed && strcmp(word, "--version") == 0) {
            options->wants_version = true;
            return 0;
        } else if (is_flag_allowed && strncmp(word, "--", 2) == 0) {
            int ret =
                read_flag(options, word + 2, i + 1 < argc ? argv[i + 1] : NULL, &n_used, out_error);
            if (ret < 0)
                return ret;
        } else if (is_flag_allowed && word[0] == '-' && word[1] != '\0') {
            return gn_error_set(out_error, -EINVAL,
                                "command line: unknown option '%.64s'; options begin with '--', "
                                "see %s --help",
                                word, options->program->name);
        } else {
            // What the shell makes of a pattern without quotes.
            options->is_after_pattern |= i > 2 && takes_pattern(options, argv[i - 2]);
            options->arguments[options->n_arguments++] = word;
        }
        i += n_used;
    }
    return 0;
}

int gn_options_load(const struct gn_program *program, int argc, char *const argv[],
                    struct gn_options **out, struct gn_error *out_error)
{
    struct gn_options *options = NULL;
    *out = NULL;
    int ret = gn_options_create(program, &options);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: out of memory", program->name);
    ret = gn_options_read_arguments(options, argc, argv, out_error);
    if (ret < 0 || options->wants_help || options->wants_version)
        goto out;
    for (int i = 0; i < program->n_options && ret == 0; i++) {
        const struct gn_option *option = &program->options[i];
        if (option->section == NULL && strcmp(option->key, "config") == 0 &&
            gn_options_is_set(options, NULL, NULL, "config"))
            ret = gn_options_read_file(
                options, gn_options_get_string(options, NULL, NULL, "config"), out_error);
    }
    if (ret == 0)
        ret = gn_options_read_environment(options, environ, out_error);
    if (ret == 0)
        ret = gn_options_check(options, out_error);
out:
    if (ret < 0)
        gn_options_destroy(&options);
    *out = options;
    return ret;
}
