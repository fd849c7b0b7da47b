/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/exr.h"
#include "tests/rig/sensor.h"
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

/* What is read of a frame. */
struct frame {
    struct gn_image8 composite, object, camera, truth;
    struct gn_image light, error; // the truth in linear light, and its standard error
    double scale;                 // radiance per linear unit of the camera
};

/* Sum over the channels, codes. */
static double get_noise(const struct frame *frame, size_t i)
{
    double sum = 0;
    for (size_t k = i; k < i + 3; k++) {
        double light = frame->light.data[k], error = frame->error.data[k];
        sum += (gn_rig_encode_srgb8((light + error) / frame->scale) -
                gn_rig_encode_srgb8((light - error) / frame->scale)) /
               2;
    }
    return sum;
}

static void add_pixels(const struct frame *frame, struct gn_rig_errors io_errors[static 2])
{
    size_t n = (size_t)frame->camera.width * (size_t)frame->camera.height;
    for (size_t i = 0; i < 3 * n; i += 3) {
        const uint8_t *truth = frame->truth.data + i;
        int change, unused, untouched = get_difference(frame->camera.data + i, truth, &change);
        if (change <= 1)
            continue;
        struct gn_rig_errors *e = &io_errors[frame->object.data[i] > 0 ? 0 : 1];
        e->pixels++;
        e->untouched += untouched / 3.0;
        e->composite += get_difference(frame->composite.data + i, truth, &unused) / 3.0;
        e->noise += get_noise(frame, i) / 3;
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

static int read_light(const struct gn_rig_sequence *sequence, int index, struct frame *frame,
                      struct gn_error *error)
{
    char path[4096], error_layer[64];
    const char *name = gn_rig_sequence_get_text(sequence, index, "truth_exr");
    const char *layer = gn_rig_sequence_get_text(sequence, index, "truth_layer");
    const json_t *camera = json_object_get(sequence->root, "camera");
    frame->scale = json_number_value(json_object_get(camera, "scale"));
    if (!name || !(frame->scale > 0))
        return gn_error_set(error, -EINVAL, "%s: frame %d has no \"%s\"", sequence->directory,
                            index, name ? "scale" : "truth_exr");
    snprintf(path, sizeof(path), "%s/%s", sequence->directory, name);
    snprintf(error_layer, sizeof(error_layer), "%s%serror", layer ? layer : "", layer ? "_" : "");
    int result = gn_exr_read_layer(path, layer ? layer : "", "RGB", &frame->light, error);
    if (result == 0)
        result = gn_exr_read_layer(path, error_layer, "RGB", &frame->error, error);
    return result;
}

static bool is_same_size(const struct gn_image8 *a, int width, int height)
{
    return a->width == width && a->height == height;
}

static int read_frame(const struct gn_rig_sequence *sequence, const char *composites, int index,
                      struct frame *frame, struct gn_error *error)
{
    const char *name = gn_rig_sequence_get_name(sequence, index);
    const struct gn_image8 *camera = &frame->camera;
    int result = gn_rig_read_picture(composites, name, &frame->composite, error);
    if (result == 0)
        result = read_member(sequence, index, "object", &frame->object, error);
    if (result == 0)
        result = read_member(sequence, index, "picture", &frame->camera, error);
    if (result == 0)
        result = read_member(sequence, index, "truth", &frame->truth, error);
    if (result == 0)
        result = read_light(sequence, index, frame, error);
    if (result == 0 && !(is_same_size(camera, frame->composite.width, frame->composite.height) &&
                         is_same_size(camera, frame->truth.width, frame->truth.height) &&
                         is_same_size(camera, frame->object.width, frame->object.height) &&
                         is_same_size(camera, frame->light.width, frame->light.height)))
        result = gn_error_set(error, -EINVAL, "%s/%s: %d x %d px, its camera frame has %d x %d",
                              composites, name, frame->composite.width, frame->composite.height,
                              camera->width, camera->height);
    return result;
}

/* Sums, not yet means. */
static int judge_frame(const struct gn_rig_sequence *sequence, const char *composites, int index,
                       struct gn_rig_verdict *io_sums, struct gn_error *error)
{
    struct frame frame = {0};
    int result = read_frame(sequence, composites, index, &frame, error);
    if (result == 0)
        add_pixels(&frame, io_sums->errors);
    gn_image8_finish(&frame.composite);
    gn_image8_finish(&frame.object);
    gn_image8_finish(&frame.camera);
    gn_image8_finish(&frame.truth);
    gn_image_finish(&frame.light);
    gn_image_finish(&frame.error);
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
        t->noise += e->noise;
    }
}

static json_t *describe(const struct gn_rig_verdict *sums)
{
    json_t *out = json_object();
    for (int part = 0; part < 2; part++) {
        const struct gn_rig_errors *e = &sums->errors[part];
        double n = e->pixels ? (double)e->pixels : 1;
        json_object_set_new(out, part_names[part],
                            json_pack("{s:I,s:f,s:f,s:f}", "pixels", (json_int_t)e->pixels,
                                      "composite", e->composite / n, "untouched", e->untouched / n,
                                      "noise", e->noise / n));
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
        fprintf(table, "  %6.2f (%5.1f) %5.2f", e->composite / n, e->untouched / n, e->noise / n);
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
                "error /255 of the composites (of untouched camera frames), noise of the truth\n"
                "%-10s %-10s  %-20s  %-20s\n",
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
