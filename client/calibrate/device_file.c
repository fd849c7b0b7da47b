/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/device_file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/device_json.h"
#include "common/file.h"

/* Codes of a table that stands for a straight line: exact between its first two steps, too. */
#define LINE_CODES 4096

json_t *gn_device_file_make_numbers(const double *values, int n)
{
    json_t *array = json_array();
    for (int i = 0; i < n && array; i++) {
        char digits[32]; // 9 digits: what a float needs, and what a person can read
        snprintf(digits, sizeof(digits), "%.9g", values[i]);
        if (json_array_append_new(array, json_real(strtod(digits, NULL))) < 0) {
            json_decref(array);
            array = NULL;
        }
    }
    return array;
}

static json_t *make_line(const struct gn_curve *curve)
{
    double *table = malloc(LINE_CODES * sizeof(*table));
    if (!table)
        return NULL;
    for (int i = 0; i < LINE_CODES; i++)
        table[i] = gn_curve_decode(curve, (double)i / (LINE_CODES - 1));
    json_t *object = json_pack("{s:s, s:o}", "type", "table", "table",
                               gn_device_file_make_numbers(table, LINE_CODES));
    free(table);
    return object;
}

json_t *gn_device_file_make_curve(const struct gn_curve *curve)
{
    if (curve->model == GN_CURVE_LINEAR)
        return make_line(curve);
    double abc[3] = {curve->a, curve->b, curve->c};
    json_t *numbers = gn_device_file_make_numbers(abc, 3);
    json_t *object =
        json_pack("{s:s, s:O, s:O, s:O}", "type", "log", "a", json_array_get(numbers, 0), "b",
                  json_array_get(numbers, 1), "c", json_array_get(numbers, 2));
    json_decref(numbers);
    return object;
}

/* Members one below the other, each on a line of its own. */
static char *print(json_t *root, size_t *out_size)
{
    char *text = NULL;
    FILE *out = open_memstream(&text, out_size);
    if (!out)
        return NULL;
    const char *key;
    json_t *value;
    const char *before = "{";
    json_object_foreach(root, key, value)
    {
        char *dumped = json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
        fprintf(out, "%s\"%s\": %s", before, key, dumped ? dumped : "null");
        free(dumped);
        before = ",\n ";
    }
    fprintf(out, "}\n");
    if (fclose(out) == 0)
        return text;
    free(text);
    return NULL;
}

/* Refuses what the commands that take the file would refuse. */
static int check(const char *text, size_t size, const char *path, struct gn_error *out_error)
{
    struct gn_json root = {0};
    int err = gn_json_load_text(text, size, path, &root, out_error);
    struct gn_camera camera;
    struct gn_probe_setup setup;
    struct gn_response response = {.type = GN_RESPONSE_LINEAR};
    if (!err && gn_json_has(&root, "fx"))
        err =
            gn_camera_read_json(&root, gn_json_has(&root, "world_from_camera"), &camera, out_error);
    else if (!err && gn_json_has(&root, "projection"))
        err = gn_probe_setup_read_json(&root, &setup, out_error);
    else if (!err) // not yet one or the other
        err = gn_response_read_json(&root, &response, out_error);
    gn_json_finish(&root);
    return err;
}

int gn_device_file_update(const char *path, json_t *found, struct gn_error *out_error)
{
    struct gn_json old = {0};
    json_t *root = NULL;
    char *text = NULL;
    size_t size = 0;
    int err = found ? 0 : gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    if (!err && access(path, F_OK) == 0)
        err = gn_json_load_file(path, &old, out_error);
    if (!err) {
        root = old.value ? json_incref(old.value) : json_object();
        const char *key;
        json_t *value;
        json_object_foreach(found, key, value)
        {
            if (json_is_null(value))
                json_object_del(root, key);
            else if (json_object_set(root, key, value) < 0)
                err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
        }
    }
    if (!err && !(text = print(root, &size)))
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", path);
    if (!err)
        err = check(text, size, path, out_error);
    if (!err)
        err = gn_file_write(path, text, size, out_error);
    free(text);
    json_decref(root);
    json_decref(found);
    gn_json_finish(&old);
    return err;
}
