/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/record.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "common/image.h"
#include "common/png.h"

#define MAX_PATH_BYTES 4096

struct gn_record {
    char dir[MAX_PATH_BYTES - 300]; // leaves room for a file's name
    json_t *frames;
};

int gn_record_open(const char *dir, struct gn_record **out, struct gn_error *out_error)
{
    *out = NULL;
    struct gn_record *r = calloc(1, sizeof(*r));
    if (!r)
        return -ENOMEM;
    int err = 0;
    int n = snprintf(r->dir, sizeof(r->dir), "%s", dir);
    if (n < 0 || (size_t)n >= sizeof(r->dir))
        err = -ENAMETOOLONG;
    else if (mkdir(dir, 0777) != 0 && errno != EEXIST)
        err = -errno;
    r->frames = err ? NULL : json_array();
    if (!err && !r->frames)
        err = -ENOMEM;
    if (err) {
        free(r);
        return gn_error_set(out_error, err, "%s: cannot be the folder of results: %s", dir,
                            strerror(-err));
    }
    *out = r;
    return 0;
}

static int write_jpeg(const char *path, const uint8_t *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    if (!f)
        return -errno;
    bool is_written = fwrite(data, 1, size, f) == size;
    return fclose(f) == 0 && is_written ? 0 : -EIO;
}

static int write_picture(const struct gn_record *r, const char *name,
                         const struct gn_msg_result_view *view, const uint8_t *payload,
                         struct gn_error *out_error)
{
    char path[MAX_PATH_BYTES];
    bool is_jpeg = view->format == GN_MSG_PICTURE_FORMAT_JPEG;
    snprintf(path, sizeof(path), "%s/%s.%s", r->dir, name, is_jpeg ? "jpg" : "png");
    const uint8_t *data = payload + view->payload_offset;
    if (is_jpeg) {
        int err = write_jpeg(path, data, view->payload_length);
        return err ? gn_error_set(out_error, err, "%s: %s", path, strerror(-err)) : 0;
    }
    struct gn_image8 image = {0};
    int err = gn_image8_init(&image, (int)view->width, (int)view->height, 3);
    if (err)
        return gn_error_set(out_error, err, "%s: %s", path, strerror(-err));
    size_t size = (size_t)image.width * (size_t)image.height * 3;
    if (size != view->payload_length) {
        err = gn_error_set(out_error, -EPROTO, "%s: the result has %u bytes, not %zu", name,
                           view->payload_length, size);
    } else {
        memcpy(image.data, data, size);
        err = gn_png_write_file(path, &image, out_error);
    }
    gn_image8_finish(&image);
    return err;
}

static json_t *make_receipt(const struct gn_msg_receipt *r)
{
    json_t *left_out = json_array();
    for (int i = 0; i < (int)r->left_out_count; i++)
        json_array_append_new(left_out, json_pack("{s:s, s:s}", "pass", r->left_out[i].pass, "why",
                                                  r->left_out[i].why));
    json_t *stages = json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "queue",
                               (double)r->queue_ms, "decode", (double)r->decode_ms, "plan",
                               (double)r->plan_ms, "primary", (double)r->primary_ms, "shade",
                               (double)r->shade_ms, "shadow", (double)r->shadow_ms, "composite",
                               (double)r->composite_ms, "encode", (double)r->encode_ms);
    json_t *rays =
        json_pack("{s:I, s:I, s:I}", "primary", (json_int_t)r->rays_primary, "shadow",
                  (json_int_t)r->rays_shadow, "secondary", (json_int_t)r->rays_secondary);
    json_t *receipt =
        json_pack("{s:o, s:I, s:f, s:i, s:o, s:o}", "stages_ms", stages, "lighting_sequence",
                  (json_int_t)r->lighting_sequence, "lighting_age_ms", (double)r->lighting_age_ms,
                  "lights", (int)r->lights_used, "rays", rays, "left_out", left_out);
    // A negative estimate means that there is none.
    if (receipt && r->estimated_error >= 0)
        json_object_set_new(receipt, "estimated_error", json_real((double)r->estimated_error));
    else if (receipt)
        json_object_set_new(receipt, "estimated_error", json_null());
    return receipt;
}

int gn_record_add_result(struct gn_record *record, const char *name,
                         const struct gn_msg_result *result, const uint8_t *payload,
                         double latency_ms, struct gn_error *out_error)
{
    for (int i = 0; i < (int)result->views_count; i++) {
        char view_name[300];
        // The first view has the frame's name; a second eye's gets its number.
        snprintf(view_name, sizeof(view_name), i ? "%s-%d" : "%s", name, i);
        int err = write_picture(record, view_name, &result->views[i], payload, out_error);
        if (err)
            return err;
    }
    json_t *receipt = make_receipt(&result->receipt);
    json_t *frame =
        json_pack("{s:s, s:I, s:s, s:f, s:o}", "name", name, "id", (json_int_t)result->id,
                  "outcome", "result", "latency_ms", latency_ms, "receipt", receipt);
    if (json_array_append_new(record->frames, frame) != 0)
        return gn_error_set(out_error, -ENOMEM, "view.json: %s", strerror(ENOMEM));
    return 0;
}

int gn_record_add_dropped(struct gn_record *record, const char *name,
                          const struct gn_msg_dropped *dropped)
{
    json_t *frame = json_pack(
        "{s:s, s:I, s:s, s:s, s:s}", "name", name, "id", (json_int_t)dropped->id, "outcome",
        "dropped", "reason", gn_wire_get_drop_text(dropped->reason), "sentence", dropped->sentence);
    return json_array_append_new(record->frames, frame) != 0 ? -ENOMEM : 0;
}

int gn_record_close(struct gn_record **record, struct gn_error *out_error)
{
    struct gn_record *r = *record;
    *record = NULL;
    if (!r)
        return 0;
    char path[MAX_PATH_BYTES];
    snprintf(path, sizeof(path), "%s/view.json", r->dir);
    json_t *root = json_pack("{s:s, s:o}", "format", "gnomon-view 1", "frames", r->frames);
    int err = root ? 0 : -ENOMEM;
    if (!err && json_dump_file(root, path, JSON_INDENT(1) | JSON_REAL_PRECISION(9)) != 0)
        err = -EIO;
    json_decref(root);
    free(r);
    return err ? gn_error_set(out_error, err, "%s: could not be written", path) : 0;
}
