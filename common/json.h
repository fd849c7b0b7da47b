/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What all readers of JSON files share: bounded loading, and typed getters whose errors name file,
 * key and what would be right. Values are jansson's and live as long as the root does.
 */
#ifndef GN_COMMON_JSON_H
#define GN_COMMON_JSON_H

#include <stdbool.h>
#include <stddef.h>

#include <jansson.h>

#include "common/error.h"
#include "proto/attr.h"

/** Largest JSON file that is read. */
#define GN_JSON_MAX_BYTES ((size_t)16 << 20)

/**
 * A value and where it is, for errors. A value type, cheap to copy; gn_json_finish only on the one
 * that gn_json_load_... filled. Thread-safety: unsafe (jansson counts references).
 */
struct gn_json {
    json_t *value;    // borrowed from the root; owned in the root itself
    const char *file; // borrowed: the name given to load
    char path[128];   // "objects[3].material"; "" for the root
};

/**
 * Reads a file of at most GN_JSON_MAX_BYTES; its top must be an object. path is borrowed until
 * gn_json_finish. Returns 0, the errno of opening or reading, -EFBIG, -EINVAL (not JSON, a key
 * twice) or -ENOMEM, and a sentence in *out_error (may be NULL, here and below).
 */
GN_MUST_USE int gn_json_load_file(const char *path, struct gn_json *out_root,
                                  struct gn_error *out_error);
/** The same from memory; name stands for the file in errors and is borrowed. */
GN_MUST_USE int gn_json_load_text(const char *text, size_t size_bytes, const char *name,
                                  struct gn_json *out_root, struct gn_error *out_error);
/** Frees the root's value and zeroes *root. A zeroed one is fine. */
void gn_json_finish(struct gn_json *root);

/** Refuses members of the object whose key is not among keys[n_keys]. 0 or -EINVAL. */
GN_MUST_USE int gn_json_check_keys(const struct gn_json *object, const char *const *keys,
                                   size_t n_keys, struct gn_error *out_error);

/** Whether the object has that member. A member that is null counts as one. */
bool gn_json_has(const struct gn_json *object, const char *key);

/*
 * Getters of an object's member: 0, or -EINVAL and a sentence where the member is absent, of
 * another type or out of range; outputs are untouched then. Ask gn_json_has for optional members.
 */

/** A finite number in [min, max]. */
GN_MUST_USE int gn_json_get_double(const struct gn_json *object, const char *key, double min,
                                   double max, double *out_value, struct gn_error *out_error);
/** A whole number in [min, max]. */
GN_MUST_USE int gn_json_get_int(const struct gn_json *object, const char *key, int min, int max,
                                int *out_value, struct gn_error *out_error);
GN_MUST_USE int gn_json_get_bool(const struct gn_json *object, const char *key, bool *out_value,
                                 struct gn_error *out_error);
/** A string without NUL; borrowed from the root. */
GN_MUST_USE int gn_json_get_string(const struct gn_json *object, const char *key,
                                   const char **out_value, struct gn_error *out_error);
/** A string that is one of names[n_names]; gives its index. */
GN_MUST_USE int gn_json_get_enum(const struct gn_json *object, const char *key,
                                 const char *const *names, size_t n_names, int *out_index,
                                 struct gn_error *out_error);
/** An array of exactly n finite numbers. */
GN_MUST_USE int gn_json_get_numbers(const struct gn_json *object, const char *key, size_t n,
                                    double *out_values, struct gn_error *out_error);
GN_MUST_USE int gn_json_get_object(const struct gn_json *object, const char *key,
                                   struct gn_json *out_value, struct gn_error *out_error);
/** An array of [min_n, max_n] elements; json_array_size(out_value->value) is their number. */
GN_MUST_USE int gn_json_get_array(const struct gn_json *object, const char *key, size_t min_n,
                                  size_t max_n, struct gn_json *out_value,
                                  struct gn_error *out_error);
/** Element index of an array, which must be an object. */
GN_MUST_USE int gn_json_get_item(const struct gn_json *array, size_t index,
                                 struct gn_json *out_value, struct gn_error *out_error);

/** "FILE: PATH.KEY: sentence", for checks of the caller's own; key may be NULL. Returns -EINVAL. */
int gn_json_refuse(const struct gn_json *object, const char *key, struct gn_error *out_error,
                   const char *format, ...) GN_PRINTF(4, 5);

#endif
