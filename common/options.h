/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Configuration from one table: the INI file, the environment and the command line are read by it,
 * and the help text and the example file are printed from it. The command line wins over the
 * environment (GNOMON_SECTION_KEY), that over the file, that over the default. Every value is
 * checked where it stands, also one that is overridden, and remembers where it came from.
 */
#ifndef GN_COMMON_OPTIONS_H
#define GN_COMMON_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "common/error.h"
#include "proto/attr.h"

enum gn_option_type {
    GN_OPTION_STRING = 0,
    GN_OPTION_BOOL,    // true, false, yes, no, on, off, 1, 0; --key alone means true
    GN_OPTION_INT,     // whole number in [min, max]
    GN_OPTION_DOUBLE,  // finite number in [min, max]
    GN_OPTION_ENUM,    // one of choices
    GN_OPTION_SET,     // any of choices, as a,c; or all, or none; at most 31 choices
    GN_OPTION_BYTES,   // 1048576, 512KiB, 64MiB, 2GiB; in [min, max]
    GN_OPTION_ADDRESS, // HOST:PORT, [IPV6]:PORT; port [0, 65535]
};

/**
 * One row of the table. Rows of one section stand together. Static; borrowed by the parser.
 * section "room *" describes the sections [room NAME], any number of them; their command line is
 * --room.NAME.key and they have no environment variable. section NULL: command line only.
 */
struct gn_option {
    const char *section;
    const char *key;  // words joined by '-'
    const char *flag; // command line name without "--"; NULL: section-key
    enum gn_option_type type;
    double min, max;           // for INT, DOUBLE, BYTES; both 0: no bound
    const char *choices;       // for ENUM and SET: "a|b|c"
    const char *default_value; // as in the file; NULL: unset
    const char *value_name;    // in the help: "FILE"; NULL: from the type
    const char *help;          // plain sentences; wrapped when printed
    bool is_secret;            // value not shown in status, help or errors
    bool is_required;          // gn_options_load refuses its absence (of each NAME)
};

/** What a program takes. Static; borrowed until gn_options_destroy. */
struct gn_program {
    const char *name;    // "gnomond"
    const char *usage;   // after the name: "--config FILE [OPTION]..."
    const char *summary; // what it is for; wrapped
    const char *notes;   // after the options in --help, as it is; may be NULL
    const struct gn_option *options;
    int n_options;
    int min_arguments, max_arguments; // words that are not options
};

/** Values of one run. Thread-safety: immutable after load. */
struct gn_options;

/** HOST and port of an address value. */
struct gn_address {
    char host[256]; // name or number, without brackets; "" never
    uint16_t port;
};

/**
 * The usual start of a program: reads the command line, the file that the option with key "config"
 * names (where the table has one) and the environment, then checks what is required. After --help
 * or --version nothing else is read or checked. On failure *out is NULL; -EINVAL and one sentence
 * for what is wrong, or the errno of the file. argv[0] is skipped.
 */
GN_MUST_USE int gn_options_load(const struct gn_program *program, int argc, char *const argv[],
                                struct gn_options **out, struct gn_error *out_error);

/* The same in steps; any order. */

/** All values at their defaults. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_options_create(const struct gn_program *program, struct gn_options **out);
/** NULL-safe; nulls *options. */
void gn_options_destroy(struct gn_options **options);
/** Reads "--key value", "--key=value", "--key" (bool), "--no-key" (bool), "--", "-h". */
GN_MUST_USE int gn_options_read_arguments(struct gn_options *options, int argc, char *const argv[],
                                          struct gn_error *out_error);
/**
 * environment: as environ. Variables that begin with GNOMON_ and are not in the table are refused,
 * but for GNOMON_DATA, which the tests take their input from. A program whose table has no plain
 * section takes no variables and looks at none, so that what is exported for gnomond does not stop
 * its clients. Two programs with sections would refuse each other's: there is one.
 */
GN_MUST_USE int gn_options_read_environment(struct gn_options *options, char *const environment[],
                                            struct gn_error *out_error);
/** Reads an INI file of at most 1 MiB, lines of at most 190 bytes. */
GN_MUST_USE int gn_options_read_file(struct gn_options *options, const char *path,
                                     struct gn_error *out_error);
/** As gn_options_read_file, from text; path names it in errors. */
GN_MUST_USE int gn_options_read_text(struct gn_options *options, const char *text, const char *path,
                                     struct gn_error *out_error);
/** Refuses the absence of what is required. */
GN_MUST_USE int gn_options_check(const struct gn_options *options, struct gn_error *out_error);

/** Whether the table holds a key of the plain section: of rows that programs share some leave one
 * out. */
bool gn_options_is_known(const struct gn_options *options, const char *section, const char *key);

/*
 * Values. section and key as in the table, but "room" with name "demo" for [room demo]; name NULL
 * for plain sections. Asking for what the table does not hold, or with another type, is a bug.
 * Unset values give false, 0, NULL, index -1, or a zeroed address: ask gn_options_is_set.
 */
bool gn_options_is_set(const struct gn_options *options, const char *section, const char *name,
                       const char *key);
/** Whether it is unset or says what the table's default says. */
bool gn_options_is_default(const struct gn_options *options, const char *section, const char *name,
                           const char *key);
bool gn_options_get_bool(const struct gn_options *options, const char *section, const char *name,
                         const char *key);
int gn_options_get_int(const struct gn_options *options, const char *section, const char *name,
                       const char *key);
double gn_options_get_double(const struct gn_options *options, const char *section,
                             const char *name, const char *key);
/** Borrowed from options. Also gives the text of every other type. */
const char *gn_options_get_string(const struct gn_options *options, const char *section,
                                  const char *name, const char *key);
/** Index into choices. */
int gn_options_get_enum(const struct gn_options *options, const char *section, const char *name,
                        const char *key);
/** Bit i is set where the i-th of choices is in it. */
unsigned gn_options_get_set(const struct gn_options *options, const char *section, const char *name,
                            const char *key);
uint64_t gn_options_get_bytes(const struct gn_options *options, const char *section,
                              const char *name, const char *key);
struct gn_address gn_options_get_address(const struct gn_options *options, const char *section,
                                         const char *name, const char *key);
/** Where the value came from: "default", "gnomond.ini:12", "environment", "command line". */
const char *gn_options_get_source(const struct gn_options *options, const char *section,
                                  const char *name, const char *key);

/** Number of [room NAME] sections that were seen. */
int gn_options_get_name_count(const struct gn_options *options, const char *section);
/** The i-th NAME, in the order seen. */
const char *gn_options_get_name(const struct gn_options *options, const char *section, int i);

/** Number of words on the command line that are not options, and the i-th. */
int gn_options_get_argument_count(const struct gn_options *options);
const char *gn_options_get_argument(const struct gn_options *options, int i);

/** Whether --help (-h) or --version was given: the program prints and exits 0. */
bool gn_options_wants_help(const struct gn_options *options);
bool gn_options_wants_version(const struct gn_options *options);

/** Gets one value for gn_options_visit; name is NULL in plain sections, secrets read "(hidden)". */
typedef void (*gn_options_visit_fn)(void *context, const char *section, const char *name,
                                    const char *key, const char *value, const char *source);
/** Shows every value that is set, in the table's order: for status pages. */
void gn_options_visit(const struct gn_options *options, gn_options_visit_fn visit, void *context);

/** The help text, at most 80 columns. */
void gn_options_print_help(const struct gn_program *program, FILE *out);
/** The commented configuration file: every key with its help, range and default. */
void gn_options_print_example(const struct gn_program *program, FILE *out);

/** "HOST:PORT" or "[IPV6]:PORT" in parts. 0 or -EINVAL. */
GN_MUST_USE int gn_address_parse(const char *text, struct gn_address *out_address);

#endif
