/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What options.c (the table's values), options_value.c (their grammar), options_read.c (file,
 * environment), options_arguments.c (command line) and options_print.c (help, example) share. Not
 * for others.
 */
#ifndef GN_COMMON_OPTIONS_INTERNAL_H
#define GN_COMMON_OPTIONS_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/options.h"
#include "proto/attr.h"

#define GN_OPTIONS_MAX_NAME 32   // bytes of NAME in [room NAME], without NUL
#define GN_OPTIONS_MAX_NAMES 64  // sections of one kind
#define GN_OPTIONS_MAX_LABEL 160 // "[room demo] max-sessions", "--room.demo.max-sessions"

/** Who wins; a higher rank overrides a lower one. */
enum gn_option_rank {
    GN_RANK_DEFAULT = 0,
    GN_RANK_FILE = 1,
    GN_RANK_ENVIRONMENT = 2,
    GN_RANK_ARGUMENTS = 3,
};

/** One value of one option (of one NAME). */
struct gn_option_value {
    char *text;       // owned; NULL: unset
    char source[128]; // for people
    enum gn_option_rank rank;
    int line; // where the file sets it, even if that is overridden; 0: it does not
    union {
        bool boolean;
        int integer;  // and the index into choices
        unsigned set; // bits of choices
        double number;
        uint64_t bytes;
        struct gn_address address;
    } as;
};

/** One plain section (name ""), or one [room NAME]. */
struct gn_option_instance {
    const char *section; // borrowed from the table: NULL, "server", "room *"
    char name[GN_OPTIONS_MAX_NAME + 1];
    struct gn_option_value *values; // [program->n_options], those of other sections unset; owned
};

struct gn_options {
    const struct gn_program *program;
    struct gn_option_instance *instances; // [n_instances], owned
    int n_instances;
    char **arguments; // [n_arguments], owned array of words borrowed from argv
    int n_arguments;
    bool wants_help;
    bool wants_version;
    bool is_after_pattern; // a word stands where the shell's second match of a pattern would
};

/** Length of "room" in "room *", of "server" in "server". */
size_t gn_section_get_length(const char *section);
/** Whether the section is "room *": many, each with a NAME. */
bool gn_section_is_named(const char *section);
/** Whether two rows of the table stand in one section; NULL is one too. */
bool gn_section_is_same(const char *a, const char *b);

/** The option's name on the command line, without "--" and without NAME. */
void gn_option_get_flag(const struct gn_option *option, const char *name, size_t size,
                        char *out_flag);
/** "GNOMON_HTTP_LISTEN"; false where the option has none. */
bool gn_option_get_variable(const struct gn_option *option, size_t size, char *out_variable);
/** What a right value looks like: "a whole number in [1, 64]". */
void gn_option_get_expectation(const struct gn_option *option, size_t size, char *out_text);

/** gn_text_suggest for candidates that do not last: keeps a copy in best, "" where none is near. */
void gn_option_suggest(const char *name, const char *candidate,
                       char best[static GN_OPTIONS_MAX_LABEL]);

/** The instance, or NULL. section as in the table, or "room". */
struct gn_option_instance *gn_options_find(const struct gn_options *options, const char *section,
                                           size_t section_length, const char *name);
/**
 * The instance of [section name], made if it is new. name may not be NUL-terminated. -EINVAL where
 * the name is bad (letters, digits, '-', '_'; [1, 32] bytes), -ENOSPC, -ENOMEM; where begins the
 * sentence.
 */
GN_MUST_USE int gn_options_add(struct gn_options *options, const char *section, const char *name,
                               size_t name_length, const char *where,
                               struct gn_option_instance **out_instance,
                               struct gn_error *out_error);

/**
 * Checks text and stores it unless a higher rank has. where begins the sentence ("a.ini:3",
 * "environment", "command line"); label is what the user wrote ("[http] listen", "--http").
 */
GN_MUST_USE int gn_options_set(const struct gn_options *options,
                               struct gn_option_instance *instance, int index, const char *text,
                               enum gn_option_rank rank, const char *where, const char *label,
                               struct gn_error *out_error);

#endif
