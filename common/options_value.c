/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Values from text: each type's grammar, and the sentence that says what would be right. */
#include "common/options.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "common/options_internal.h"
#include "common/text.h"

static bool is_bounded(const struct gn_option *option)
{
    return option->min != 0.0 || option->max != 0.0;
}

static bool is_in_range(const struct gn_option *option, double value)
{
    return !is_bounded(option) || (value >= option->min && value <= option->max);
}

static bool parse_bool(const char *text, bool *out_value)
{
    static const char *const words[] = {"false", "true", "no", "yes", "off", "on", "0", "1"};
    for (int i = 0; i < 8; i++) {
        if (strcasecmp(text, words[i]) == 0) {
            *out_value = i % 2 == 1;
            return true;
        }
    }
    return false;
}

static bool parse_int(const char *text, int *out_value)
{
    char *end = NULL;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (end == text || *end != '\0' || isspace((unsigned char)text[0]) || errno != 0 ||
        value < INT_MIN || value > INT_MAX)
        return false;
    *out_value = (int)value;
    return true;
}

/* Decimal only: strtod would take "nan", "inf" and hexadecimal. */
static bool parse_double(const char *text, double *out_value)
{
    char *end = NULL;
    if (text[0] == '\0' || strspn(text, "+-0123456789.eE") != strlen(text))
        return false;
    double value = strtod(text, &end);
    if (end == text || *end != '\0' || !isfinite(value))
        return false;
    *out_value = value;
    return true;
}

static bool parse_bytes(const char *text, uint64_t *out_value)
{
    static const char *const units[] = {"", "KiB", "MiB", "GiB", "TiB"};
    char *end = NULL;
    if (!isdigit((unsigned char)text[0]))
        return false;
    errno = 0;
    unsigned long long value = strtoull(text, &end, 10);
    if (errno != 0)
        return false;
    for (int i = 0; i < 5; i++) {
        int shift = 10 * i;
        if (strcmp(end, units[i]) == 0 && value <= UINT64_MAX >> shift) {
            *out_value = (uint64_t)value << shift;
            return true;
        }
    }
    return false;
}

static bool parse_choice(const char *choices, const char *text, size_t length, int *out_index)
{
    for (int i = 0;; i++) {
        size_t n = strcspn(choices, "|");
        if (n == length && strncmp(choices, text, n) == 0) {
            *out_index = i;
            return true;
        }
        if (choices[n] == '\0')
            return false;
        choices += n + 1;
    }
}

/* Takes the next name of a list of names: its length, with blanks about it left out. */
static size_t take_name(const char **rest, const char **out_name)
{
    const char *name = *rest + strspn(*rest, " ");
    size_t n = strcspn(name, ",");
    *rest = name + n + (name[n] == ',');
    while (n > 0 && name[n - 1] == ' ')
        n--;
    *out_name = name;
    return n;
}

static bool parse_set(const char *choices, const char *text, unsigned *out_set)
{
    unsigned set = 0, n_choices = 1;
    for (const char *c = choices; *c != '\0'; c++)
        n_choices += *c == '|';
    if (strcmp(text, "all") == 0 || strcmp(text, "none") == 0) {
        *out_set = text[0] == 'a' ? (1u << n_choices) - 1 : 0;
        return true;
    }
    for (const char *rest = text; *rest != '\0';) {
        const char *name;
        int index;
        size_t n = take_name(&rest, &name);
        if (!parse_choice(choices, name, n, &index))
            return false;
        set |= 1u << index;
    }
    *out_set = set;
    return text[0] != '\0' && text[strlen(text) - 1] != ',';
}

int gn_address_parse(const char *text, struct gn_address *out_address)
{
    struct gn_address address = {0};
    const char *host = text;
    const char *colon = strrchr(text, ':');
    int port = 0;
    if (colon == NULL || colon == text || !isdigit((unsigned char)colon[1]) ||
        !parse_int(colon + 1, &port) || port > 65535)
        return -EINVAL;
    size_t length = (size_t)(colon - text);
    bool is_bracketed = text[0] == '[';
    if (is_bracketed) {
        if (colon[-1] != ']')
            return -EINVAL;
        host++;
        length -= 2;
    }
    if (length < 1 || length >= sizeof(address.host))
        return -EINVAL;
    memcpy(address.host, host, length);
    if (is_bracketed) {
        struct in6_addr ignored;
        if (inet_pton(AF_INET6, address.host, &ignored) != 1)
            return -EINVAL;
    } else {
        for (size_t i = 0; i < length; i++)
            if (!isalnum((unsigned char)host[i]) && strchr(".-_", host[i]) == NULL)
                return -EINVAL;
    }
    address.port = (uint16_t)port;
    *out_address = address;
    return 0;
}

static bool parse_value(const struct gn_option *option, const char *text,
                        struct gn_option_value *out_value)
{
    switch (option->type) {
    case GN_OPTION_STRING:
        return text[0] != '\0';
    case GN_OPTION_BOOL:
        return parse_bool(text, &out_value->as.boolean);
    case GN_OPTION_INT:
        return parse_int(text, &out_value->as.integer) &&
               is_in_range(option, out_value->as.integer);
    case GN_OPTION_DOUBLE:
        return parse_double(text, &out_value->as.number) &&
               is_in_range(option, out_value->as.number);
    case GN_OPTION_ENUM:
        return parse_choice(option->choices, text, strlen(text), &out_value->as.integer);
    case GN_OPTION_SET:
        return parse_set(option->choices, text, &out_value->as.set);
    case GN_OPTION_BYTES:
        return parse_bytes(text, &out_value->as.bytes) &&
               is_in_range(option, (double)out_value->as.bytes);
    case GN_OPTION_ADDRESS:
        return gn_address_parse(text, &out_value->as.address) == 0;
    }
    return false;
}

/* 67108864 as "64MiB". */
static void print_bytes(double value, size_t size, char *out)
{
    static const char *const units[] = {"", "KiB", "MiB", "GiB", "TiB"};
    int unit = 0;
    while (unit < 4 && value >= 1024.0 && fmod(value, 1024.0) == 0.0) {
        value /= 1024.0;
        unit++;
    }
    snprintf(out, size, "%.0f%s", value, units[unit]);
}

/* "one of a, b, c". */
static void print_choices(const struct gn_option *option, const char *before, const char *after,
                          size_t size, char *out)
{
    size_t n = (size_t)snprintf(out, size, "%s", before);
    for (const char *c = option->choices; *c != '\0' && n + 3 < size; c++) {
        out[n++] = *c == '|' ? ',' : *c;
        if (*c == '|')
            out[n++] = ' ';
    }
    snprintf(out + n, size - n, "%s", after);
}

void gn_option_get_expectation(const struct gn_option *option, size_t size, char *out_text)
{
    char range[96] = "", low[32], high[32];
    if (is_bounded(option) && option->type == GN_OPTION_BYTES) {
        print_bytes(option->min, sizeof(low), low);
        print_bytes(option->max, sizeof(high), high);
        snprintf(range, sizeof(range), " in [%s, %s]", low, high);
    } else if (is_bounded(option)) {
        snprintf(range, sizeof(range), " in [%.10g, %.10g]", option->min, option->max);
    }
    switch (option->type) {
    case GN_OPTION_STRING:
        snprintf(out_text, size, "%s",
                 option->value_name == NULL ? "text that is not empty" : option->value_name);
        return;
    case GN_OPTION_BOOL:
        snprintf(out_text, size, "true or false");
        return;
    case GN_OPTION_INT:
        snprintf(out_text, size, "a whole number%s", range);
        return;
    case GN_OPTION_DOUBLE:
        snprintf(out_text, size, "a number%s", range);
        return;
    case GN_OPTION_ENUM:
        print_choices(option, "one of ", "", size, out_text);
        return;
    case GN_OPTION_SET:
        print_choices(option, "names of ", " with commas between them, or all, or none", size,
                      out_text);
        return;
    case GN_OPTION_BYTES:
        snprintf(out_text, size, "bytes%s, as 1048576, 512KiB, 64MiB or 2GiB", range);
        return;
    case GN_OPTION_ADDRESS:
        snprintf(out_text, size, "HOST:PORT or [IPV6]:PORT, as 127.0.0.1:7340");
        return;
    }
}

void gn_option_suggest(const char *name, const char *candidate,
                       char best[static GN_OPTIONS_MAX_LABEL])
{
    const char *meant = best[0] == '\0' ? NULL : best;
    gn_text_suggest(name, candidate, &meant);
    if (meant == candidate)
        snprintf(best, GN_OPTIONS_MAX_LABEL, "%s", candidate);
}

/* The choice that was meant, "" where none is near; of a list, for its first wrong name. */
static void suggest_choice(const struct gn_option *option, const char *text,
                           char best[static GN_OPTIONS_MAX_LABEL])
{
    char wrong[64];
    const char *rest = text, *name = text;
    size_t n = strlen(text);
    int index;
    bool is_known = option->type == GN_OPTION_SET;
    while (is_known && *rest != '\0') {
        n = take_name(&rest, &name);
        is_known = parse_choice(option->choices, name, n, &index);
    }
    if (is_known || n >= sizeof(wrong)) // all names are, and the commas are wrong
        return;
    snprintf(wrong, sizeof(wrong), "%.*s", (int)n, name);
    for (const char *c = option->choices; *c != '\0';) {
        char choice[64];
        n = strcspn(c, "|");
        snprintf(choice, sizeof(choice), "%.*s", (int)n, c);
        gn_option_suggest(wrong, choice, best);
        c += n + (c[n] == '|' ? 1 : 0);
    }
}

int gn_options_set(const struct gn_options *options, struct gn_option_instance *instance, int index,
                   const char *text, enum gn_option_rank rank, const char *where, const char *label,
                   struct gn_error *out_error)
{
    const struct gn_option *option = &options->program->options[index];
    struct gn_option_value *value = &instance->values[index];
    struct gn_option_value new_value = {.rank = rank, .line = value->line};
    if (!parse_value(option, text, &new_value)) {
        char expected[512], meant[GN_OPTIONS_MAX_LABEL] = "";
        const char *unit = option->type == GN_OPTION_DOUBLE ? option->value_name : NULL;
        gn_option_get_expectation(option, sizeof(expected), expected);
        if (option->type == GN_OPTION_ENUM || option->type == GN_OPTION_SET)
            suggest_choice(option, text, meant);
        return gn_error_set(out_error, -EINVAL, "%s: %s: expected %s%s%s%s, found '%.80s'%s%s%s",
                            where, label, expected, unit ? " (" : "", unit ? unit : "",
                            unit ? ")" : "", option->is_secret ? "(hidden)" : text,
                            meant[0] == '\0' ? "" : "; did you mean '", meant,
                            meant[0] == '\0' ? "" : "'?");
    }
    if (value->text != NULL && value->rank > rank)
        return 0;
    snprintf(new_value.source, sizeof(new_value.source), "%s", where);
    new_value.text = strdup(text);
    if (new_value.text == NULL)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", where);
    free(value->text);
    *value = new_value;
    return 0;
}
