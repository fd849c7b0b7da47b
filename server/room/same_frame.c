/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/same_frame.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/half.h"
#include "server/room/convert.h"

void gn_worked_frame_finish(struct gn_worked_frame *worked)
{
    gn_buf_unref(&worked->job.payload);
    free(worked->bounds);
    memset(worked, 0, sizeof(*worked));
}

/* What of a header says how its pixels are to be read. */
static void get_reading(const struct gn_msg_environment_frame *frame,
                        struct gn_msg_environment_frame *out)
{
    memcpy(out, frame, sizeof(*out));
    out->sequence = 0;
    out->capture_time_ns = 0;
    out->exposure_s = 0;
}

/* To the byte: padding that differs only costs the work that would have been spared. */
static bool is_same_reading(const struct gn_environment_job *a, const struct gn_environment_job *b)
{
    struct gn_msg_environment_frame x, y;
    get_reading(&a->frame, &x);
    get_reading(&b->frame, &y);
    return a->session_id == b->session_id && memcmp(&x, &y, sizeof(x)) == 0;
}

/* The response's table lies in the payload, before the pixels. */
static size_t get_table_bytes(const struct gn_environment_job *job)
{
    const struct gn_msg_response *r = &job->frame.response;
    return r->type == GN_MSG_RESPONSE_TYPE_TABLE ? 4 * (size_t)r->table_entries : 0;
}

/* Of two jobs with the same reading. */
static bool is_same_table(const struct gn_environment_job *a, const struct gn_environment_job *b)
{
    size_t n = get_table_bytes(a);
    return n == 0 || (a->payload && b->payload && n <= a->payload->len && n <= b->payload->len &&
                      memcmp(a->payload->data, b->payload->data, n) == 0);
}

void gn_worked_frame_keep(struct gn_worked_frame *worked, const struct gn_environment_job *job)
{
    bool keeps_bounds = is_same_reading(&worked->job, job) && is_same_table(&worked->job, job);
    gn_buf_unref(&worked->job.payload);
    if (!keeps_bounds) {
        free(worked->bounds);
        worked->bounds = NULL;
        worked->n_codes = 0;
    }
    memcpy(&worked->job, job, sizeof(*job));
    worked->job.payload = job->payload ? gn_buf_ref(job->payload) : NULL;
}

static int get_n_codes(enum gn_msg_pixel_format format)
{
    switch (format) {
    case GN_MSG_PIXEL_FORMAT_MONO12:
    case GN_MSG_PIXEL_FORMAT_RGB12:
        return 4096;
    case GN_MSG_PIXEL_FORMAT_MONO16:
    case GN_MSG_PIXEL_FORMAT_RGB16:
        return 65536;
    default:
        return 0;
    }
}

static unsigned get_u16(const uint8_t *p)
{
    return (unsigned)p[0] | (unsigned)p[1] << 8;
}

static float get_f32(const uint8_t *p)
{
    uint32_t bits = (uint32_t)get_u16(p) | (uint32_t)get_u16(p + 2) << 16;
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

/* The response with its table, which lies before the pixels, in *table. */
static bool get_response(const struct gn_environment_job *job,
                         float table[static GN_LIMIT_TABLE_ENTRIES],
                         struct gn_response *out_response)
{
    const struct gn_msg_environment_frame *f = &job->frame;
    size_t n = f->response.type == GN_MSG_RESPONSE_TYPE_TABLE ? f->response.table_entries : 0;
    if (n > GN_LIMIT_TABLE_ENTRIES || job->payload->len < 4 * n)
        return false;
    for (size_t i = 0; i < n; i++)
        table[i] = get_f32(job->payload->data + 4 * i);
    return gn_convert_response(&f->response, f->matrix_to_rec709, f->scale, table, out_response,
                               NULL) == 0;
}

/* For each code the lowest and highest that mean nearly the same; responses never fall. */
static bool make_bounds(struct gn_worked_frame *worked, double noise, int n_codes)
{
    struct gn_response response;
    float *table = malloc(GN_LIMIT_TABLE_ENTRIES * sizeof(*table));
    float *linear = malloc((size_t)n_codes * sizeof(*linear));
    struct gn_code_bounds *bounds = malloc((size_t)n_codes * sizeof(*bounds));
    bool ok = table && linear && bounds && get_response(&worked->job, table, &response);
    for (int i = 0; ok && i < n_codes; i++)
        linear[i] = gn_response_decode(&response, (float)i * (1.0f / (float)(n_codes - 1)));
    for (int i = 0, low = 0, high = 0; ok && i < n_codes; i++) {
        double value = (double)linear[i];
        while ((double)linear[low] < (1 - noise) * value)
            low++;
        high = high < i ? i : high;
        while (high + 1 < n_codes && (double)linear[high + 1] <= (1 + noise) * value)
            high++;
        bounds[i] = (struct gn_code_bounds){(uint16_t)low, (uint16_t)high};
    }
    free(table);
    free(linear);
    if (!ok) {
        free(bounds);
        return false;
    }
    free(worked->bounds);
    worked->bounds = bounds;
    worked->n_codes = n_codes;
    worked->noise = noise;
    return true;
}

static bool are_codes_same(const struct gn_worked_frame *worked, const uint8_t *a, const uint8_t *b,
                           size_t n)
{
    const struct gn_code_bounds *bounds = worked->bounds;
    for (size_t i = 0; i < n; i++) {
        unsigned old = get_u16(a + 2 * i), now = get_u16(b + 2 * i);
        if (old != now &&
            (old >= (unsigned)worked->n_codes || now < bounds[old].low || now > bounds[old].high))
            return false;
    }
    return true;
}

/* Never where one is NaN or the old one infinite or below 0. */
static bool are_values_same(float old, float now, double noise)
{
    double bound = noise * (double)old;
    return bound < INFINITY && fabs((double)now - (double)old) <= bound;
}

static bool are_floats_same(const uint8_t *a, const uint8_t *b, size_t n, double noise)
{
    for (size_t i = 0; i < n; i++) {
        if (memcmp(a + 4 * i, b + 4 * i, 4) != 0 &&
            !are_values_same(get_f32(a + 4 * i), get_f32(b + 4 * i), noise))
            return false;
    }
    return true;
}

static bool are_halves_same(const uint8_t *a, const uint8_t *b, size_t n, double noise)
{
    for (size_t i = 0; i < n; i++) {
        unsigned old = get_u16(a + 2 * i), now = get_u16(b + 2 * i);
        if (old != now && !are_values_same(gn_half_to_float((uint16_t)old),
                                           gn_half_to_float((uint16_t)now), noise))
            return false;
    }
    return true;
}

bool gn_worked_frame_is_same(struct gn_worked_frame *worked, const struct gn_environment_job *job,
                             double noise)
{
    const struct gn_buf *old = worked->job.payload, *now = job->payload;
    if (!old || !now || old->len != now->len || !is_same_reading(&worked->job, job))
        return false;
    if (old == now || memcmp(old->data, now->data, now->len) == 0)
        return true;
    if (!(noise > 0) || !is_same_table(&worked->job, job))
        return false;
    size_t n_table = get_table_bytes(job);
    const uint8_t *a = old->data + n_table, *b = now->data + n_table;
    size_t n_bytes = now->len - n_table;
    if (job->frame.pixel_format == GN_MSG_PIXEL_FORMAT_RGB_F32)
        return are_floats_same(a, b, n_bytes / 4, noise);
    if (job->frame.pixel_format == GN_MSG_PIXEL_FORMAT_RGB_F16)
        return are_halves_same(a, b, n_bytes / 2, noise);
    int n_codes = get_n_codes(job->frame.pixel_format);
    if (n_codes == 0)
        return false;
    if ((worked->n_codes != n_codes || worked->noise != noise) &&
        !make_bounds(worked, noise, n_codes))
        return false;
    return are_codes_same(worked, a, b, n_bytes / 2);
}
