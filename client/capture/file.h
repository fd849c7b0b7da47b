/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Pictures from files: EXR, Radiance, PNG, JPEG, one after another.
 */
#ifndef GN_CLIENT_CAPTURE_FILE_H
#define GN_CLIENT_CAPTURE_FILE_H

#include <stdbool.h>

#include "client/capture/source.h"

/** Most files one source lists. */
#define GN_FILE_SOURCE_MAX 100000

/** One file and what is known about it. */
struct gn_file_entry {
    char *path; // owned
    double time_s;
    bool has_pose;
    struct gn_pose world_from_camera;
};

/** A list of files. Caller's memory, our strings. */
struct gn_file_list {
    int n_entries;
    struct gn_file_entry *entries;
};

/** Frees the entries and zeroes *list. */
void gn_file_list_finish(struct gn_file_list *list);

/** Appends a copy of path. Returns 0, -E2BIG, -ENOMEM. */
GN_MUST_USE int gn_file_list_add(struct gn_file_list *list, const char *path,
                                 struct gn_file_entry **out_entry);

/**
 * Lists a folder's pictures (by their extension), one file, or the regular files that a glob
 * pattern matches, sorted by name; times follow rate_hz. list must be zeroed. Returns 0, or a
 * negative errno and a sentence: no match is an error.
 */
GN_MUST_USE int gn_file_list_find(const char *pattern, double rate_hz, struct gn_file_list *list,
                                  struct gn_error *out_error);

/** A file's name and the NUL. */
#define GN_FILE_NAME_BYTES 256

/**
 * What files written about path are called: its name without folder and without a picture's
 * extension, made printable.
 */
void gn_file_get_name(const char *path, char out_name[static GN_FILE_NAME_BYTES]);

/** Refuses a list in which two files have the same such name. 0, -EEXIST or -ENOMEM, a sentence. */
GN_MUST_USE int gn_file_list_check_names(const struct gn_file_list *list,
                                         struct gn_error *out_error);

/** All-zero is the default. */
struct gn_file_source_options {
    bool is_looped;   // begin again at the end, times going on
    bool is_12_bit;   // 16-bit PNG holds codes [0, 4095]; default [0, 65535]
    bool is_8_bit_16; // widen 8-bit PNG to 16 bits, exactly (code 257 times); default RGB8
};

/**
 * Takes the list (zeroed for the caller) on success. The name of each capture is
 * gn_file_get_name's. Returns 0 or -ENOMEM.
 */
GN_MUST_USE int gn_file_source_open(struct gn_file_list *list,
                                    const struct gn_file_source_options *options,
                                    struct gn_source **out_source);

#endif
