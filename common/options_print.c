/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The help text and the example configuration, from the table. */
#include "common/options.h"

#include <ctype.h>
#include <string.h>

#include "common/options_internal.h"

#define COLUMNS 80
#define FLAG_INDENT 2
#define HELP_INDENT 6

/*
 * Prints words with `first` in front of the first line and `indent` in front of the others, broken
 * at blanks before column COLUMNS.
 */
static void print_wrapped(FILE *out, const char *first, const char *indent, const char *text)
{
    size_t column = strlen(first);
    bool is_line_empty = true;
    fputs(first, out);
    while (*text != '\0') {
        size_t n = strcspn(text, " ");
        if (!is_line_empty && column + 1 + n > COLUMNS) {
            fprintf(out, "\n%s", indent);
            column = strlen(indent);
            is_line_empty = true;
        }
        fprintf(out, "%s%.*s", is_line_empty ? "" : " ", (int)n, text);
        column += n + (is_line_empty ? 0 : 1);
        is_line_empty = false;
        text += n;
        text += strspn(text, " ");
    }
    fputc('\n', out);
}

/* What stands for the value behind a flag of that length; choices where they fit in the line: the
 * text below names them in any case. */
static const char *get_value_name(const struct gn_option *option, size_t flag_length)
{
    if (option->value_name != NULL)
        return option->value_name;
    switch (option->type) {
    case GN_OPTION_BOOL:
        return "BOOL";
    case GN_OPTION_INT:
    case GN_OPTION_DOUBLE:
        return "N";
    case GN_OPTION_ENUM:
        return FLAG_INDENT + 2 + flag_length + 1 + strlen(option->choices) <= COLUMNS
                   ? option->choices
                   : "NAME";
    case GN_OPTION_SET:
        return "NAMES";
    case GN_OPTION_BYTES:
        return "BYTES";
    case GN_OPTION_ADDRESS:
        return "ADDR:PORT";
    case GN_OPTION_STRING:
        break;
    }
    return "TEXT";
}

/* The help, what is allowed and the default, in one paragraph. */
static void describe(const struct gn_option *option, size_t size, char *out_text)
{
    char expected[512];
    gn_option_get_expectation(option, sizeof(expected), expected);
    size_t n = (size_t)snprintf(out_text, size, "%s", option->help);
    if (option->type != GN_OPTION_STRING && n < size) {
        n += (size_t)snprintf(out_text + n, size - n, " %s.", expected);
        char *first = out_text + strlen(option->help) + 1;
        *first = (char)toupper((unsigned char)*first);
    }
    if (option->is_required && n < size)
        n += (size_t)snprintf(out_text + n, size - n, " Required.");
    else if (option->default_value != NULL && n < size)
        n += (size_t)snprintf(out_text + n, size - n, " Default %s.",
                              option->is_secret ? "(hidden)" : option->default_value);
}

void gn_options_print_help(const struct gn_program *program, FILE *out)
{
    char text[1024], flag[GN_OPTIONS_MAX_LABEL], variable[GN_OPTIONS_MAX_LABEL];
    char indent[HELP_INDENT + 1];
    snprintf(indent, sizeof(indent), "%*s", HELP_INDENT, "");
    snprintf(text, sizeof(text), "%s %s", program->name, program->usage);
    print_wrapped(out, "Usage: ", "         ", text);
    fputc('\n', out);
    print_wrapped(out, "", "", program->summary);
    fputs("\nOptions:\n", out);
    bool has_file = false;
    for (int i = 0; i < program->n_options; i++) {
        const struct gn_option *option = &program->options[i];
        gn_option_get_flag(option, "NAME", sizeof(flag), flag);
        if (option->type != GN_OPTION_BOOL)
            fprintf(out, "  --%s %s\n", flag, get_value_name(option, strlen(flag)));
        else if (gn_section_is_named(option->section))
            fprintf(out, "  --%s\n", flag);
        else
            fprintf(out, "  --%s, --no-%s\n", flag, flag);
        describe(option, sizeof(text), text);
        print_wrapped(out, indent, indent, text);
        if (gn_option_get_variable(option, sizeof(variable), variable)) {
            snprintf(text, sizeof(text), "File: [%s] %s. Environment: %s.", option->section,
                     option->key, variable);
            print_wrapped(out, indent, indent, text);
            has_file = true;
        }
    }
    fprintf(out, "  --help, -h\n%sPrint this text.\n  --version\n%sPrint the version.\n", indent,
            indent);
    if (has_file)
        fputs("\nThe command line wins over the environment, the environment over the file.\n",
              out);
    if (program->notes != NULL)
        fprintf(out, "\n%s", program->notes);
}

void gn_options_print_example(const struct gn_program *program, FILE *out)
{
    char text[1024];
    const char *section = NULL;
    snprintf(text, sizeof(text),
             "Configuration of %s: every key, with its default where it has one. Lines that begin "
             "with '#' or ';' are comments, and so is what follows a blank and ';'. The "
             "environment (GNOMON_SECTION_KEY) wins over this "
             "file, the command line over both; %s --help tells the names. Bytes are written as "
             "1048576, 512KiB, 64MiB or 2GiB.",
             program->name, program->name);
    print_wrapped(out, "# ", "# ", text);
    for (int i = 0; i < program->n_options; i++) {
        const struct gn_option *option = &program->options[i];
        if (option->section == NULL)
            continue;
        if (section == NULL || !gn_section_is_same(section, option->section)) {
            section = option->section;
            fputc('\n', out);
            if (gn_section_is_named(section))
                fprintf(out, "# One section for each %.*s; demo is its name.\n#[%.*s demo]\n",
                        (int)gn_section_get_length(section), section,
                        (int)gn_section_get_length(section), section);
            else
                fprintf(out, "[%s]\n", section);
        }
        describe(option, sizeof(text), text);
        fputc('\n', out);
        print_wrapped(out, "# ", "# ", text);
        fprintf(out, "#%s =%s%s\n", option->key, option->default_value == NULL ? "" : " ",
                option->default_value == NULL || option->is_secret ? "" : option->default_value);
    }
}
