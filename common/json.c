/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/json.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/text.h"

/* The path of a member (key) or an element (index) of parent; "..." ends what does not fit. */
static void extend_path(const struct gn_json *parent, const char *key, size_t index, char *out,
                        size_t out_size)
{
    int n;
    if (key == NULL)
        n = snprintf(out, out_size, "%s[%zu]", parent->path, index);
    else
        n = snprintf(out, out_size, "%s%s%s", parent->path, parent->path[0] == '\0' ? "" : ".",
                     key);
    if (n < 0 || (size_t)n >= out_size)
        memcpy(out + out_size - 4, "...", 4);
}

int gn_json_refuse(const struct gn_json *object, const char *key, struct gn_error *out_error,
                   const char *format, ...)
{
    char path[sizeof(object->path)];
    char text[384];
    if (key != NULL)
        extend_path(object, key, 0, path, sizeof(path));
    else
        snprintf(path, sizeof(path), "%s", object->path);
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof(text), format, args);
    va_end(args);
    return gn_error_set(out_error, -EINVAL, "%s: %s%s%s", object->file, path,
                        path[0] == '\0' ? "" : ": ", text);
}

static const char *get_type_name(const json_t *value)
{
    switch (json_typeof(value)) {
    case JSON_OBJECT:
        return "an object";
    case JSON_ARRAY:
        return "an array";
    case JSON_STRING:
        return "a string";
    case JSON_INTEGER:
    case JSON_REAL:
        return "a number";
    case JSON_TRUE:
    case JSON_FALSE:
        return "a boolean";
    case JSON_NULL:
        break;
    }
    return "null";
}

int gn_json_load_text(const char *text, size_t size_bytes, const char *name,
                      struct gn_json *out_root, struct gn_error *out_error)
{
    *out_root = (struct gn_json){.file = name};
    if (size_bytes > GN_JSON_MAX_BYTES)
        return gn_error_set(out_error, -EFBIG, "%s: larger than %zu MiB, the most that is read",
                            name, GN_JSON_MAX_BYTES >> 20);
    json_error_t fault;
    json_t *value = json_loadb(text, size_bytes, JSON_REJECT_DUPLICATES, &fault);
    if (value == NULL && json_error_code(&fault) == json_error_out_of_memory)
        return gn_error_set(out_error, -ENOMEM, "%s: out of memory", name);
    if (value == NULL)
        return gn_error_set(out_error, -EINVAL, "%s:%d:%d: not JSON: %s", name, fault.line,
                            fault.column, fault.text);
    if (!json_is_object(value)) {
        int ret = gn_error_set(out_error, -EINVAL, "%s: expected an object {...}, found %s", name,
                               get_type_name(value));
        json_decref(value);
        return ret;
    }
    out_root->value = value;
    return 0;
}

int gn_json_load_file(const char *path, struct gn_json *out_root, struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    *out_root = (struct gn_json){.file = path};
    int ret = gn_file_read_text(path, GN_JSON_MAX_BYTES, &text, &size, out_error);
    if (ret < 0)
        return ret;
    ret = gn_json_load_text(text, size, path, out_root, out_error);
    free(text);
    return ret;
}

void gn_json_finish(struct gn_json *root)
{
    json_decref(root->value);
    *root = (struct gn_json){0};
}

static bool is_among(const char *key, const char *const *keys, size_t n_keys)
{
    for (size_t i = 0; i < n_keys; i++)
        if (strcmp(key, keys[i]) == 0)
            return true;
    return false;
}

int gn_json_check_keys(const struct gn_json *object, const char *const *keys, size_t n_keys,
                       struct gn_error *out_error)
{
    const char *key;
    json_t *value;
    json_object_foreach(object->value, key, value)
    {
        if (is_among(key, keys, n_keys))
            continue;
        const char *meant = NULL;
        char known[256] = "";
        for (size_t i = 0, n = 0; i < n_keys; i++) {
            gn_text_suggest(key, keys[i], &meant);
            if (n < sizeof(known))
                n += (size_t)snprintf(known + n, sizeof(known) - n, "%s%s", i == 0 ? "" : ", ",
                                      keys[i]);
        }
        if (meant != NULL)
            return gn_json_refuse(object, NULL, out_error,
                                  "unknown key '%.40s'; did you mean '%s'?", key, meant);
        return gn_json_refuse(object, NULL, out_error, "unknown key '%.40s'; known are %s", key,
                              known);
    }
    return 0;
}

bool gn_json_has(const struct gn_json *object, const char *key)
{
    return json_object_get(object->value, key) != NULL;
}

/* The member, or NULL with the error said. */
static json_t *find_member(const struct gn_json *object, const char *key, const char *expected,
                           struct gn_error *out_error)
{
    json_t *value = json_object_get(object->value, key);
    if (value == NULL)
        (void)gn_json_refuse(object, key, out_error, "missing, expected %s", expected);
    return value;
}

static int refuse_type(const struct gn_json *object, const char *key, const char *expected,
                       const json_t *value, struct gn_error *out_error)
{
    return gn_json_refuse(object, key, out_error, "expected %s, found %s", expected,
                          get_type_name(value));
}

int gn_json_get_double(const struct gn_json *object, const char *key, double min, double max,
                       double *out_value, struct gn_error *out_error)
{
    const json_t *value = find_member(object, key, "a number", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_number(value))
        return refuse_type(object, key, "a number", value, out_error);
    double number = json_number_value(value);
    if (!isfinite(number) || !(number >= min && number <= max))
        return gn_json_refuse(object, key, out_error,
                              "expected a number in [%.10g, %.10g], found %.10g", min, max, number);
    *out_value = number;
    return 0;
}

int gn_json_get_int(const struct gn_json *object, const char *key, int min, int max, int *out_value,
                    struct gn_error *out_error)
{
    const json_t *value = find_member(object, key, "a whole number", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_number(value))
        return refuse_type(object, key, "a whole number", value, out_error);
    double number = json_number_value(value);
    if (!(number >= min && number <= max) || number != floor(number))
        return gn_json_refuse(object, key, out_error,
                              "expected a whole number in [%d, %d], found %.10g", min, max, number);
    *out_value = (int)number;
    return 0;
}

int gn_json_get_bool(const struct gn_json *object, const char *key, bool *out_value,
                     struct gn_error *out_error)
{
    const json_t *value = find_member(object, key, "true or false", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_boolean(value))
        return refuse_type(object, key, "true or false", value, out_error);
    *out_value = json_is_true(value);
    return 0;
}

int gn_json_get_string(const struct gn_json *object, const char *key, const char **out_value,
                       struct gn_error *out_error)
{
    const json_t *value = find_member(object, key, "a string", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_string(value))
        return refuse_type(object, key, "a string", value, out_error);
    *out_value = json_string_value(value); // jansson refuses \u0000 when it loads
    return 0;
}

int gn_json_get_enum(const struct gn_json *object, const char *key, const char *const *names,
                     size_t n_names, int *out_index, struct gn_error *out_error)
{
    const char *text = NULL;
    int ret = gn_json_get_string(object, key, &text, out_error);
    if (ret < 0)
        return ret;
    char known[256] = "";
    for (size_t i = 0, n = 0; i < n_names; i++) {
        if (strcmp(text, names[i]) == 0) {
            *out_index = (int)i;
            return 0;
        }
        if (n < sizeof(known))
            n += (size_t)snprintf(known + n, sizeof(known) - n, "%s'%s'", i == 0 ? "" : ", ",
                                  names[i]);
    }
    return gn_json_refuse(object, key, out_error, "expected one of %s, found '%.40s'", known, text);
}

int gn_json_get_numbers(const struct gn_json *object, const char *key, size_t n, double *out_values,
                        struct gn_error *out_error)
{
    struct gn_json array;
    int ret = gn_json_get_array(object, key, n, n, &array, out_error);
    if (ret < 0)
        return ret;
    for (size_t i = 0; i < n; i++) {
        const json_t *value = json_array_get(array.value, i);
        if (!json_is_number(value))
            return gn_json_refuse(object, key, out_error,
                                  "element %zu: expected a number, found %s", i,
                                  get_type_name(value));
        if (!isfinite(json_number_value(value)))
            return gn_json_refuse(object, key, out_error, "element %zu: not finite", i);
    }
    for (size_t i = 0; i < n; i++)
        out_values[i] = json_number_value(json_array_get(array.value, i));
    return 0;
}

int gn_json_get_object(const struct gn_json *object, const char *key, struct gn_json *out_value,
                       struct gn_error *out_error)
{
    json_t *value = find_member(object, key, "an object", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_object(value))
        return refuse_type(object, key, "an object", value, out_error);
    struct gn_json result = {.value = value, .file = object->file};
    extend_path(object, key, 0, result.path, sizeof(result.path));
    *out_value = result;
    return 0;
}

int gn_json_get_array(const struct gn_json *object, const char *key, size_t min_n, size_t max_n,
                      struct gn_json *out_value, struct gn_error *out_error)
{
    json_t *value = find_member(object, key, "an array", out_error);
    if (value == NULL)
        return -EINVAL;
    if (!json_is_array(value))
        return refuse_type(object, key, "an array", value, out_error);
    size_t n = json_array_size(value);
    if (min_n == max_n && n != min_n)
        return gn_json_refuse(object, key, out_error, "expected %zu elements, found %zu", min_n, n);
    if (n < min_n || n > max_n)
        return gn_json_refuse(object, key, out_error, "expected %zu to %zu elements, found %zu",
                              min_n, max_n, n);
    struct gn_json result = {.value = value, .file = object->file};
    extend_path(object, key, 0, result.path, sizeof(result.path));
    *out_value = result;
    return 0;
}

int gn_json_get_item(const struct gn_json *array, size_t index, struct gn_json *out_value,
                     struct gn_error *out_error)
{
    struct gn_json result = {.value = json_array_get(array->value, index), .file = array->file};
    extend_path(array, NULL, index, result.path, sizeof(result.path));
    if (result.value == NULL)
        return gn_json_refuse(&result, NULL, out_error, "no such element");
    if (!json_is_object(result.value))
        return gn_json_refuse(&result, NULL, out_error, "expected an object, found %s",
                              get_type_name(result.value));
    *out_value = result;
    return 0;
}
