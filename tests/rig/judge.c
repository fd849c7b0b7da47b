/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdlib.h>

#include "tests/rig/sequence.h"

static const char *const part_names[2] = {"object", "shadow"};

static int get_difference(const uint8_t *a, const uint8_t *b, int *out_largest)
{
    int sum = 0;
    *out_largest = 0;
    for (int k = 0; k < 3; k++) {
        int d = abs(a[k] - b[k]);
        sum += d;
        *out_largest = d > *out_largest ? d : *out_largest;
    }
    return sum;
}

static void add_pixels(const struct gn_image8 *camera, const struct gn_image8 *truth,
                       const struct gn_image8 *object, const struct gn_image8 *composite,
                       struct gn_rig_errors io_errors[static 2])
{
    size_t n = (size_t)camera->width * (size_t)camera->height;
    for (size_t i = 0; i < 3 * n; i += 3) {
        int change, unused, untouched = get_difference(camera->data + i, truth->data + i, &change);
        if (change <= 1)
            continue;
        struct gn_rig_errors *e = &io_errors[object->data[i] > 0 ? 0 : 1];
        e->pixels++;
        e->untouched += untouched / 3.0;
        e->composite += get_difference(composite->data + i, truth->data + i, &unused) / 3.0;
    }
}

static int read_member(const struct gn_rig_sequence *sequence, int index, const char *key,
                       struct gn_image8 *out_image, struct gn_error *error)
{
    const char *name = gn_rig_sequence_get_text(sequence, index, key);
    if (!name)
        return gn_error_set(error, -EINVAL, "%s: frame %d has no \"%s\"", sequence->directory,
                            index, key);
    return gn_rig_read_picture(sequence->directory, name, out_image, error);
}

/* Sums, not yet means. */
static int judge_frame(const struct gn_rig_sequence *sequence, const char *composites, int index,
                       struct gn_rig_verdict *io_sums, struct gn_error *error)
{
    struct gn_image8 composite = {0}, object = {0}, camera = {0}, truth = {0};
    const char *name = gn_rig_sequence_get_name(sequence, index);
    int result = gn_rig_read_picture(composites, name, &composite, error);
    if (result == 0)
        result = read_member(sequence, index, "object", &object, error);
    if (result == 0)
        result = read_member(sequence, index, "picture", &camera, error);
    if (result == 0)
        result = read_member(sequence, index, "truth", &truth, error);
    if (result == 0 && (composite.width != camera.width || composite.height != camera.height ||
                        truth.width != camera.width || truth.height != camera.height ||
                        object.width != camera.width || object.height != camera.height))
        result = gn_error_set(error, -EINVAL, "%s/%s: %d x %d px, its camera frame has %d x %d",
                              composites, name, composite.width, composite.height, camera.width,
                              camera.height);
    if (result == 0)
        add_pixels(&camera, &truth, &object, &composite, io_sums->errors);
    gn_image8_finish(&composite);
    gn_image8_finish(&object);
    gn_image8_finish(&camera);
    gn_image8_finish(&truth);
    return result;
}

static void add_sums(const struct gn_rig_verdict *sums, struct gn_rig_verdict *io_total)
{
    for (int i = 0; i < 2; i++) {
        const struct gn_rig_errors *e = &sums->errors[i];
        struct gn_rig_errors *t = &io_total->errors[i];
        t->pixels += e->pixels;
        t->composite += e->composite;
        t->untouched += e->untouched;
    }
}

static json_t *describe(const struct gn_rig_verdict *sums)
{
    json_t *out = json_object();
    for (int part = 0; part < 2; part++) {
        const struct gn_rig_errors *e = &sums->errors[part];
        double n = e->pixels ? (double)e->pixels : 1;
        json_object_set_new(out, part_names[part],
                            json_pack("{s:I,s:f,s:f}", "pixels", (json_int_t)e->pixels, "composite",
                                      e->composite / n, "untouched", e->untouched / n));
    }
    return out;
}

static void print_row(FILE *table, const char *name, const char *label,
                      const struct gn_rig_verdict *sums)
{
    fprintf(table, "%-10s %-10s", name, label);
    for (int i = 0; i < 2; i++) {
        const struct gn_rig_errors *e = &sums->errors[i];
        double n = e->pixels ? (double)e->pixels : 1;
        fprintf(table, "  %6.2f (%5.1f)", e->composite / n, e->untouched / n);
    }
    fputc('\n', table);
}

int gn_rig_judge(const struct gn_rig_sequence *sequence, const char *composites, FILE *table,
                 json_t **out_report, struct gn_error *out_error)
{
    struct gn_rig_verdict total = {0};
    json_t *report = json_object(), *list = json_array();
    json_object_set_new(report, "unit", json_string("mean absolute difference, 8-bit codes"));
    json_object_set_new(report, "frames", list);
    if (table)
        fprintf(table,
                "error /255 of the composites (of untouched camera frames)\n%-10s %-10s"
                "  %-14s  %-14s\n",
                "frame", "light", "object", "shadow");
    for (int i = 0; i < (int)json_array_size(sequence->frames); i++) {
        struct gn_rig_verdict sums = {0};
        const char *label = gn_rig_sequence_get_text(sequence, i, "label");
        const char *name = gn_rig_sequence_get_name(sequence, i);
        int result = judge_frame(sequence, composites, i, &sums, out_error);
        if (result) {
            json_decref(report);
            return result;
        }
        json_t *item = describe(&sums);
        json_object_set_new(item, "name", json_string(name));
        json_object_set_new(item, "label", json_string(label ? label : ""));
        json_array_append_new(list, item);
        add_sums(&sums, &total);
        if (table)
            print_row(table, name, label ? label : "", &sums);
    }
    json_object_set_new(report, "all", describe(&total));
    if (table)
        print_row(table, "all", "", &total);
    *out_report = report;
    return 0;
}
