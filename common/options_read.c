/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Options from the INI file and from the environment. */
#include "common/options.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <ini.h>

#include "common/file.h"
#include "common/options_internal.h"
#include "common/text.h"

/*
 * libinih cuts longer lines in two and longer section names off, silently (INI_MAX_LINE 200 and
 * MAX_SECTION 50 in Debian's build), so both are refused before it sees them.
 */
#define MAX_LINE_BYTES 190
#define MAX_SECTION_BYTES 48
#define MAX_FILE_BYTES ((size_t)1 << 20)

struct ini_reader {
    struct gn_options *options;
    const char *path;
    const char *next;                    // rest of the text
    int line;                            // of the line handed out last
    struct gn_option_instance *instance; // of the section we are in; may be NULL
    const char *section;                 // as in the table
    int ret;
    struct gn_error *error;
};

/* "gnomond.ini:12"; long paths keep their end. */
static const char *locate(const struct ini_reader *reader, size_t size, char *out_where)
{
    size_t length = strlen(reader->path);
    bool is_long = length > 90;
    snprintf(out_where, size, "%s%s:%d", is_long ? "..." : "",
             is_long ? reader->path + length - 87 : reader->path, reader->line);
    return out_where;
}

/* The section of the table that `text` ("room", length bytes) begins, or NULL. */
static const char *find_section(const struct gn_program *program, const char *text, size_t length)
{
    for (int i = 0; i < program->n_options; i++) {
        const char *section = program->options[i].section;
        if (section != NULL && gn_section_get_length(section) == length &&
            strncmp(section, text, length) == 0)
            return section;
    }
    return NULL;
}

static int refuse_section(struct ini_reader *reader, const char *where, const char *text)
{
    const struct gn_program *program = reader->options->program;
    const char *meant = NULL;
    char known[256] = "";
    size_t n = 0;
    for (int i = 0; i < program->n_options; i++) {
        const char *section = program->options[i].section;
        if (section == NULL ||
            (i > 0 && gn_section_is_same(section, program->options[i - 1].section)))
            continue;
        gn_text_suggest(text, section, &meant);
        if (n < sizeof(known))
            n += (size_t)snprintf(known + n, sizeof(known) - n, "%s[%.*s%s]", n == 0 ? "" : ", ",
                                  (int)gn_section_get_length(section), section,
                                  gn_section_is_named(section) ? " NAME" : "");
    }
    if (meant != NULL)
        return gn_error_set(reader->error, -EINVAL,
                            "%s: unknown section [%s]; did you mean [%.*s]?", where, text,
                            (int)gn_section_get_length(meant), meant);
    return gn_error_set(reader->error, -EINVAL, "%s: unknown section [%s]; known are %s", where,
                        text, known);
}

/* "[room demo]": text is what stands between the brackets. */
static int enter_section(struct ini_reader *reader, const char *where, const char *text)
{
    size_t length = strcspn(text, " \t");
    const char *name = text + length + strspn(text + length, " \t");
    reader->instance = NULL;
    reader->section = find_section(reader->options->program, text, length);
    if (reader->section == NULL)
        return refuse_section(reader, where, text);
    if (!gn_section_is_named(reader->section) && *name != '\0')
        return gn_error_set(reader->error, -EINVAL, "%s: [%s] takes no name, expected [%.*s]",
                            where, text, (int)length, text);
    return gn_options_add(reader->options, reader->section, name, strlen(name), where,
                          &reader->instance, reader->error);
}

/* Looks at a line before libinih does. line has no leading blanks. */
static int check_line(struct ini_reader *reader, const char *line, size_t length)
{
    char where[128], section[MAX_SECTION_BYTES + 1];
    (void)locate(reader, sizeof(where), where);
    if (length > MAX_LINE_BYTES)
        return gn_error_set(reader->error, -EINVAL, "%s: the line has %zu bytes, %d are allowed",
                            where, length, MAX_LINE_BYTES);
    if (length == 0 || strchr("#;", line[0]) != NULL)
        return 0;
    if (line[0] == '[') {
        const char *end = memchr(line, ']', length);
        if (end == NULL)
            return gn_error_set(reader->error, -EINVAL, "%s: the section lacks its ']'", where);
        const char *rest = end + 1 + strspn(end + 1, " \t\r");
        if (rest < line + length && strchr("#;", *rest) == NULL)
            return gn_error_set(reader->error, -EINVAL,
                                "%s: text after the section's ']', expected a new line", where);
        if (end - line - 1 > MAX_SECTION_BYTES)
            return gn_error_set(reader->error, -EINVAL,
                                "%s: the section's name has more than %d bytes", where,
                                MAX_SECTION_BYTES);
        snprintf(section, sizeof(section), "%.*s", (int)(end - line - 1), line + 1);
        return enter_section(reader, where, section);
    }
    if (memchr(line, '=', length) == NULL && memchr(line, ':', length) == NULL)
        return gn_error_set(reader->error, -EINVAL,
                            "%s: expected 'key = value', '[section]' or a "
                            "comment, found '%.*s'",
                            where, (int)(length > 40 ? 40 : length), line);
    return 0;
}

/*
 * Hands libinih one line, as fgets does. Leading blanks go, so that no line is taken for the
 * continuation of the one before; after an error the text is at its end.
 */
static char *read_line(char *buffer, int size, void *context)
{
    struct ini_reader *reader = context;
    if (reader->ret < 0 || *reader->next == '\0')
        return NULL;
    reader->line++;
    const char *line = reader->next + strspn(reader->next, " \t\r");
    size_t length = strcspn(line, "\n");
    reader->next = line + length + (line[length] == '\n' ? 1 : 0);
    reader->ret = check_line(reader, line, length);
    if (reader->ret < 0)
        return NULL;
    snprintf(buffer, (size_t)size, "%.*s\n", (int)length, line);
    return buffer;
}

static int refuse_key(struct ini_reader *reader, const char *where, const char *key)
{
    const struct gn_program *program = reader->options->program;
    const char *meant = NULL;
    for (int i = 0; i < program->n_options; i++)
        if (gn_section_is_same(program->options[i].section, reader->section))
            gn_text_suggest(key, program->options[i].key, &meant);
    int length = (int)gn_section_get_length(reader->section);
    if (meant != NULL)
        return gn_error_set(reader->error, -EINVAL,
                            "%s: unknown key '%.64s' in [%.*s]; did you mean '%s'?", where, key,
                            length, reader->section, meant);
    char known[256] = "";
    size_t n = 0;
    for (int i = 0; i < program->n_options && n < sizeof(known); i++)
        if (gn_section_is_same(program->options[i].section, reader->section))
            n += (size_t)snprintf(known + n, sizeof(known) - n, "%s%s", n == 0 ? "" : ", ",
                                  program->options[i].key);
    return gn_error_set(reader->error, -EINVAL, "%s: unknown key '%.64s' in [%.*s]; known are %s",
                        where, key, length, reader->section, known);
}

static int read_pair(struct ini_reader *reader, const char *key, const char *text)
{
    char where[128], label[GN_OPTIONS_MAX_LABEL];
    (void)locate(reader, sizeof(where), where);
    if (reader->instance == NULL)
        return gn_error_set(reader->error, -EINVAL,
                            "%s: '%.64s' stands before any section, expected a [section] first",
                            where, key);
    const struct gn_program *program = reader->options->program;
    int index = -1;
    for (int i = 0; i < program->n_options; i++)
        if (gn_section_is_same(program->options[i].section, reader->section) &&
            strcmp(program->options[i].key, key) == 0)
            index = i;
    if (index < 0)
        return refuse_key(reader, where, key);
    const struct gn_option_instance *instance = reader->instance;
    snprintf(label, sizeof(label), "%s in [%.*s%s%s]", key,
             (int)gn_section_get_length(reader->section), reader->section,
             instance->name[0] == '\0' ? "" : " ", instance->name);
    int line = instance->values[index].line;
    if (line > 0)
        return gn_error_set(reader->error, -EINVAL, "%s: %s is already set in line %d", where,
                            label, line);
    int ret = gn_options_set(reader->options, reader->instance, index, text, GN_RANK_FILE, where,
                             label, reader->error);
    reader->instance->values[index].line = reader->line;
    return ret;
}

static int handle_pair(void *context, const char *section, const char *key, const char *text)
{
    struct ini_reader *reader = context;
    (void)section;
    if (reader->ret == 0)
        reader->ret = read_pair(reader, key, text);
    return reader->ret == 0;
}

int gn_options_read_text(struct gn_options *options, const char *text, const char *path,
                         struct gn_error *out_error)
{
    struct ini_reader reader = {.options = options, .path = path, .next = text, .error = out_error};
    if (strncmp(text, "\xef\xbb\xbf", 3) == 0)
        reader.next += 3;
    int line = ini_parse_stream(read_line, &reader, handle_pair, &reader);
    if (reader.ret == 0 && line != 0) // nothing that check_line lets through, as far as we know
        return gn_error_set(out_error, -EINVAL, "%s:%d: expected 'key = value'", path, line);
    return reader.ret;
}

int gn_options_read_file(struct gn_options *options, const char *path, struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    int ret = gn_file_read_text(path, MAX_FILE_BYTES, &text, &size, out_error);
    if (ret < 0)
        return ret;
    if (strlen(text) != size)
        ret = gn_error_set(out_error, -EINVAL, "%s: holds a NUL byte: not a text file", path);
    else
        ret = gn_options_read_text(options, text, path, out_error);
    free(text);
    return ret;
}

/* ---- environment ---- */

bool gn_option_get_variable(const struct gn_option *option, size_t size, char *out_variable)
{
    if (option->section == NULL || gn_section_is_named(option->section))
        return false;
    snprintf(out_variable, size, "GNOMON_%s_%s", option->section, option->key);
    for (char *c = out_variable; *c != '\0'; c++)
        *c = *c == '-' ? '_' : (char)toupper((unsigned char)*c);
    return true;
}

static int refuse_variable(const struct gn_options *options, const char *name,
                           struct gn_error *out_error)
{
    char variable[GN_OPTIONS_MAX_LABEL], best[GN_OPTIONS_MAX_LABEL] = "";
    for (int i = 0; i < options->program->n_options; i++)
        if (gn_option_get_variable(&options->program->options[i], sizeof(variable), variable))
            gn_option_suggest(name, variable, best);
    if (best[0] == '\0')
        return gn_error_set(out_error, -EINVAL,
                            "environment: unknown variable '%.64s', expected GNOMON_SECTION_KEY",
                            name);
    return gn_error_set(out_error, -EINVAL,
                        "environment: unknown variable '%.64s'; did you mean '%s'?", name, best);
}

int gn_options_read_environment(struct gn_options *options, char *const environment[],
                                struct gn_error *out_error)
{
    const struct gn_program *program = options->program;
    bool has_variables = false;
    for (int i = 0; i < program->n_options; i++)
        has_variables = has_variables || (program->options[i].section != NULL &&
                                          !gn_section_is_named(program->options[i].section));
    if (!has_variables)
        return 0;
    for (; *environment != NULL; environment++) {
        const char *equals = strchr(*environment, '=');
        if (equals == NULL || strncmp(*environment, "GNOMON_", 7) != 0 ||
            strncmp(*environment, "GNOMON_DATA=", 12) == 0)
            continue;
        char name[GN_OPTIONS_MAX_LABEL], variable[GN_OPTIONS_MAX_LABEL];
        snprintf(name, sizeof(name), "%.*s", (int)(equals - *environment), *environment);
        int index = -1;
        for (int i = 0; i < program->n_options; i++)
            if (gn_option_get_variable(&program->options[i], sizeof(variable), variable) &&
                strcmp(variable, name) == 0)
                index = i;
        if (index < 0)
            return refuse_variable(options, name, out_error);
        const char *section = program->options[index].section;
        struct gn_option_instance *instance =
            gn_options_find(options, section, gn_section_get_length(section), NULL);
        int ret = gn_options_set(options, instance, index, equals + 1, GN_RANK_ENVIRONMENT,
                                 "environment", name, out_error);
        if (ret < 0)
            return ret;
    }
    return 0;
}
