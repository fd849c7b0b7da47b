/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "client/capture/file.h"
#include "common/text.h"

void gn_file_list_finish(struct gn_file_list *list)
{
    for (int i = 0; i < list->n_entries; i++)
        free(list->entries[i].path);
    free(list->entries);
    memset(list, 0, sizeof(*list));
}

int gn_file_list_add(struct gn_file_list *list, const char *path, struct gn_file_entry **out_entry)
{
    if (list->n_entries == GN_FILE_SOURCE_MAX)
        return -E2BIG;
    // Grows at powers of two.
    int n = list->n_entries;
    if ((n & (n - 1)) == 0) {
        size_t capacity = n ? 2 * (size_t)n : 1;
        struct gn_file_entry *grown = realloc(list->entries, capacity * sizeof(*grown));
        if (!grown)
            return -ENOMEM;
        list->entries = grown;
    }
    struct gn_file_entry *entry = &list->entries[n];
    memset(entry, 0, sizeof(*entry));
    entry->path = strdup(path);
    if (!entry->path)
        return -ENOMEM;
    list->n_entries = n + 1;
    if (out_entry)
        *out_entry = entry;
    return 0;
}

/** Where a picture's extension begins, or the name's end. */
static const char *find_extension(const char *path)
{
    static const char *const known[] = {".exr", ".hdr", ".pic", ".png", ".jpg", ".jpeg"};
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < GN_ARRAY_LEN(known); i++) {
        if (strcasecmp(dot, known[i]) == 0)
            return dot;
    }
    return path + strlen(path);
}

void gn_file_get_name(const char *path, char out_name[static GN_FILE_NAME_BYTES])
{
    const char *base = strrchr(path, '/');
    base = base ? base + 1 : path;
    const char *end = find_extension(base);
    if (end == base)
        end = base + strlen(base);
    snprintf(out_name, GN_FILE_NAME_BYTES, "%.*s", (int)(end - base), base);
    gn_text_clean(out_name);
}

static int compare_names(const void *a, const void *b)
{
    char name_a[GN_FILE_NAME_BYTES], name_b[GN_FILE_NAME_BYTES];
    gn_file_get_name(*(char *const *)a, name_a);
    gn_file_get_name(*(char *const *)b, name_b);
    return strcmp(name_a, name_b);
}

int gn_file_list_check_names(const struct gn_file_list *list, struct gn_error *out_error)
{
    size_t n = (size_t)list->n_entries;
    const char **paths = calloc(n ? n : 1, sizeof(*paths));
    if (!paths)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    for (size_t i = 0; i < n; i++)
        paths[i] = list->entries[i].path;
    qsort(paths, n, sizeof(*paths), compare_names);
    int err = 0;
    for (size_t i = 1; i < n && !err; i++) {
        if (compare_names(&paths[i - 1], &paths[i]) == 0)
            err = gn_error_set(out_error, -EEXIST,
                               "%s and %s: what is written about them would have the same name",
                               paths[i - 1], paths[i]);
    }
    free(paths);
    return err;
}

/**
 * The glob pattern for what the user wrote: a folder stands for all in it, and what exists is meant
 * as it is, special characters or not.
 */
static char *make_pattern(const char *pattern, bool *out_is_folder)
{
    struct stat st;
    *out_is_folder = false;
    if (stat(pattern, &st) != 0)
        return strdup(pattern);
    *out_is_folder = S_ISDIR(st.st_mode);
    char *out = malloc(2 * strlen(pattern) + 3);
    if (!out)
        return NULL;
    char *p = out;
    for (const char *c = pattern; *c; c++) {
        if (strchr("*?[\\", *c))
            *p++ = '\\';
        *p++ = *c;
    }
    memcpy(p, *out_is_folder ? "/*" : "", *out_is_folder ? 3 : 1);
    return out;
}

static bool is_regular(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

/** What the pattern matches, into the list. */
static int list_matches(const char *pattern, double rate_hz, bool *out_is_folder,
                        struct gn_file_list *list)
{
    glob_t found = {0};
    char *whole = make_pattern(pattern, out_is_folder);
    int err = whole ? 0 : -ENOMEM;
    if (!err) {
        int got = glob(whole, 0, NULL, &found); // sorts by name
        if (got == GLOB_NOSPACE)
            err = -ENOMEM;
        else if (got != 0 && got != GLOB_NOMATCH)
            err = -EIO;
    }
    for (size_t i = 0; !err && i < found.gl_pathc; i++) {
        const char *path = found.gl_pathv[i];
        // In a folder lie other files, too; who writes a pattern means what it matches.
        if (!is_regular(path) || (*out_is_folder && !*find_extension(path)))
            continue;
        struct gn_file_entry *entry = NULL;
        err = gn_file_list_add(list, path, &entry);
        if (!err)
            entry->time_s = rate_hz > 0 ? (list->n_entries - 1) / rate_hz : 0;
    }
    globfree(&found);
    free(whole);
    return err;
}

int gn_file_list_find(const char *pattern, double rate_hz, struct gn_file_list *list,
                      struct gn_error *out_error)
{
    bool is_folder = false;
    int err = list_matches(pattern, rate_hz, &is_folder, list);
    if (!err && list->n_entries > 0)
        return 0;
    gn_file_list_finish(list);
    if (!err && is_folder)
        return gn_error_set(out_error, -ENOENT,
                            "%s: no picture in this folder (.exr, .hdr, .png, .jpg)", pattern);
    if (!err)
        return gn_error_set(out_error, -ENOENT,
                            "%s: no file there (a folder, or a pattern such as 'frames/*.png')",
                            pattern);
    if (err == -E2BIG)
        return gn_error_set(out_error, err, "%s: more than %d files", pattern, GN_FILE_SOURCE_MAX);
    return gn_error_set(out_error, err, "%s: %s", pattern, strerror(-err));
}
