/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/view/record.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/image.h"
#include "common/jpeg.h"
#include "common/png.h"
#include "common/text.h"

#define MAX_PATH_BYTES 4096
/** Longest text of a message or a name, and the NUL. */
#define MAX_TEXT_BYTES 512

struct gn_record {
    char dir[MAX_PATH_BYTES - 300]; // leaves room for a file's name
    struct gn_file_writer writer;   // of view.json
    uint64_t n_bytes;               // of view.json so far
    long n_results, n_dropped;
};

static int put(struct gn_record *r, const char *text, struct gn_error *out_error)
{
    size_t n = strlen(text);
    int err = gn_file_writer_put(&r->writer, text, n, r->n_bytes);
    if (err)
        return gn_error_set(out_error, err, "%s/view.json: %s", r->dir, strerror(-err));
    r->n_bytes += n;
    return 0;
}

int gn_record_open(const char *dir, struct gn_record **out, struct gn_error *out_error)
{
    *out = NULL;
    struct gn_record *r = calloc(1, sizeof(*r));
    if (!r)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    char path[MAX_PATH_BYTES];
    int n = snprintf(r->dir, sizeof(r->dir), "%s", dir), err = 0;
    if (n < 0 || (size_t)n >= sizeof(r->dir))
        err = -ENAMETOOLONG;
    else if (mkdir(dir, 0777) != 0 && errno != EEXIST)
        err = -errno;
    if (err) {
        gn_error_set(out_error, err, "%s: cannot be the folder of results: %s", dir,
                     strerror(-err));
        goto out;
    }
    snprintf(path, sizeof(path), "%s/view.json", r->dir);
    err = gn_file_writer_open(&r->writer, path, out_error);
    if (err)
        goto out;
    // An old one beside new pictures would lie, should this run be killed.
    unlink(path);
    err = put(r, "{\"format\": \"gnomon-view 1\",\n\"frames\": [", out_error);
    if (err) {
        gn_file_writer_abort(&r->writer);
        goto out;
    }
    *out = r;
    return 0;
out:
    free(r);
    return err;
}

/** Writes what came back about one view. */
static int write_picture(const struct gn_record *r, const char *name,
                         const struct gn_msg_result_view *view, const uint8_t *payload,
                         struct gn_error *out_error)
{
    char path[MAX_PATH_BYTES];
    bool is_jpeg = view->format == GN_MSG_PICTURE_FORMAT_JPEG;
    snprintf(path, sizeof(path), "%s/%s.%s", r->dir, name, is_jpeg ? "jpg" : "png");
    const uint8_t *data = payload + view->payload_offset;
    if (is_jpeg && !gn_jpeg_is_jpeg(data, view->payload_length))
        return gn_error_set(out_error, -EPROTO, "%s: the server's JPEG is none", name);
    if (is_jpeg)
        return gn_file_write(path, data, view->payload_length, out_error);
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

/** A string of the server's as JSON: it may hold anything. */
static json_t *make_text(const char *text)
{
    char clean[MAX_TEXT_BYTES];
    snprintf(clean, sizeof(clean), "%s", text);
    gn_text_clean(clean);
    return json_string(clean);
}

/** null where the frame had none. */
static json_t *make_budget(const struct gn_msg_receipt *r)
{
    static const char *const verdicts[] = {"learns", "fits", "too small"};
    const struct gn_msg_budget_use *b = &r->budget;
    if (!r->has_budget)
        return json_null();
    return json_pack("{s:f, s:f, s:s, s:f, s:f, s:I, s:I, s:I, s:I, s:I}", "budget_ms",
                     (double)b->budget_ms, "busy_ms", (double)b->busy_ms, "verdict",
                     verdicts[b->verdict], "predicted_ms", (double)b->predicted_ms,
                     "predicted_error", (double)b->predicted_error, "lights", (json_int_t)b->lights,
                     "grid", (json_int_t)b->grid, "shadow_step", (json_int_t)b->shadow_step,
                     "misses", (json_int_t)b->misses, "switches", (json_int_t)b->switches);
}

static json_t *make_receipt(const struct gn_msg_receipt *r)
{
    json_t *left_out = json_array();
    for (int i = 0; i < (int)r->left_out_count; i++) {
        json_t *entry = json_pack("{s:o, s:o}", "pass", make_text(r->left_out[i].pass), "why",
                                  make_text(r->left_out[i].why));
        if (json_array_append_new(left_out, entry) != 0) {
            json_decref(left_out);
            return NULL;
        }
    }
    json_t *stages = json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "queue",
                               (double)r->queue_ms, "decode", (double)r->decode_ms, "plan",
                               (double)r->plan_ms, "primary", (double)r->primary_ms, "shade",
                               (double)r->shade_ms, "shadow", (double)r->shadow_ms, "composite",
                               (double)r->composite_ms, "encode", (double)r->encode_ms);
    json_t *rays =
        json_pack("{s:I, s:I, s:I}", "primary", (json_int_t)r->rays_primary, "shadow",
                  (json_int_t)r->rays_shadow, "secondary", (json_int_t)r->rays_secondary);
    // A negative estimate means that there is none.
    json_t *error = r->estimated_error >= 0 ? json_real((double)r->estimated_error) : json_null();
    json_t *refined = json_null();
    if (r->refined_passes > 0)
        refined =
            json_pack("{s:I, s:o}", "passes", (json_int_t)r->refined_passes, "error",
                      r->refined_error >= 0 ? json_real((double)r->refined_error) : json_null());
    json_t *shown =
        r->has_virtual_pixels ? json_integer((json_int_t)r->virtual_pixels) : json_null();
    return json_pack("{s:o, s:I, s:f, s:i, s:o, s:o, s:o, s:o, s:o, s:o}", "stages_ms", stages,
                     "lighting_sequence", (json_int_t)r->lighting_sequence, "lighting_age_ms",
                     (double)r->lighting_age_ms, "lights", (int)r->lights_used, "rays", rays,
                     "left_out", left_out, "estimated_error", error, "budget", make_budget(r),
                     "refined", refined, "virtual_pixels", shown);
}

/** Appends one frame to view.json; takes it. */
static int put_frame(struct gn_record *r, json_t *frame, struct gn_error *out_error)
{
    char *text = frame ? json_dumps(frame, JSON_REAL_PRECISION(9)) : NULL;
    json_decref(frame);
    if (!text)
        return gn_error_set(out_error, -ENOMEM, "%s/view.json: out of memory for a receipt",
                            r->dir);
    int err = put(r, r->n_results + r->n_dropped ? ",\n" : "\n", out_error);
    if (!err)
        err = put(r, text, out_error);
    free(text);
    return err;
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
    json_t *frame = json_pack("{s:o, s:I, s:s, s:f, s:o}", "name", make_text(name), "id",
                              (json_int_t)result->id, "outcome", "result", "latency_ms", latency_ms,
                              "receipt", make_receipt(&result->receipt));
    int err = put_frame(record, frame, out_error);
    record->n_results += !err;
    return err;
}

int gn_record_add_dropped(struct gn_record *record, const char *name,
                          const struct gn_msg_dropped *dropped, struct gn_error *out_error)
{
    json_t *frame =
        json_pack("{s:o, s:I, s:s, s:s, s:o}", "name", make_text(name), "id",
                  (json_int_t)dropped->id, "outcome", "dropped", "reason",
                  gn_wire_get_drop_text(dropped->reason), "sentence", make_text(dropped->sentence));
    int err = put_frame(record, frame, out_error);
    record->n_dropped += !err;
    return err;
}

/** As snprintf. */
static int print_counts(char *text, size_t size, const struct gn_source_counts *c)
{
    return snprintf(text, size,
                    "\"capture\": {\"complete\": %" PRIu64 ", \"incomplete\": %" PRIu64
                    ", \"lost\": %" PRIu64 ", \"skipped\": %" PRIu64 ", \"lost_packets\": %" PRIu64
                    ", \"resent_packets\": %" PRIu64 ", \"reopened\": %" PRIu64
                    ", \"read\": %" PRIu64 ", \"read_bytes\": %" PRIu64
                    ", \"copied_bytes\": %" PRIu64 "},\n",
                    c->n_complete, c->n_incomplete, c->n_lost, c->n_skipped, c->n_lost_packets,
                    c->n_resent_packets, c->n_reopened, c->n_read, c->read_bytes, c->copied_bytes);
}

int gn_record_close(struct gn_record **record, long n_sent, bool is_complete,
                    const struct gn_source_counts *counts, struct gn_error *out_error)
{
    struct gn_record *r = *record;
    *record = NULL;
    if (!r)
        return 0;
    char tail[1024];
    int n = snprintf(tail, sizeof(tail), "],\n");
    if (counts)
        n += print_counts(tail + n, sizeof(tail) - (size_t)n, counts);
    snprintf(tail + n, sizeof(tail) - (size_t)n,
             "\"sent\": %ld, \"results\": %ld, \"dropped\": %ld, \"complete\": %s}\n", n_sent,
             r->n_results, r->n_dropped, is_complete ? "true" : "false");
    int err = put(r, tail, out_error);
    if (err)
        gn_file_writer_abort(&r->writer);
    else
        err = gn_file_writer_commit(&r->writer, out_error);
    free(r);
    return err;
}
