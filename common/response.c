/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/response.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

static const char *const names[GN_RESPONSE_COUNT] = {
    [GN_RESPONSE_LINEAR] = "linear", [GN_RESPONSE_SRGB] = "srgb",   [GN_RESPONSE_GAMMA] = "gamma",
    [GN_RESPONSE_LOG] = "log",       [GN_RESPONSE_TABLE] = "table",
};

/* Of a scale and of a matrix times it: the products with any float stay in double's range. */
static const double gain_max = 1e30;

static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

const char *gn_response_get_name(enum gn_response_type type)
{
    return (unsigned)type < GN_RESPONSE_COUNT ? names[type] : NULL;
}

int gn_response_from_name(const char *name, enum gn_response_type *out_type)
{
    for (int i = 0; i < GN_RESPONSE_COUNT; i++) {
        if (strcmp(name, names[i]) == 0) {
            *out_type = (enum gn_response_type)i;
            return 0;
        }
    }
    return -EINVAL;
}

static bool is_all_zero(const double m[static 9])
{
    for (int i = 0; i < 9; i++)
        if (m[i] != 0)
            return false;
    return true;
}

/* False where m is not finite or nearly singular: |det| < 1e-9 times the product of its rows' norms
 * (Hadamard's bound). */
static bool invert_matrix(const double m[static 9], double out[static 9])
{
    double c[9] = {m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
                   m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
                   m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
    double det = m[0] * c[0] + m[1] * c[3] + m[2] * c[6], bound = 1;
    for (int i = 0; i < 9; i += 3)
        bound *= sqrt(m[i] * m[i] + m[i + 1] * m[i + 1] + m[i + 2] * m[i + 2]);
    if (!isfinite(bound) || !(fabs(det) > 1e-9 * bound))
        return false;
    for (int i = 0; i < 9; i++)
        out[i] = c[i] / det;
    return true;
}

static const char *check_table(const struct gn_response *r)
{
    if (!r->table || r->table_size < 2 || r->table_size > 4096)
        return "a response table has 2 to 4096 values";
    for (int i = 0; i < r->table_size; i++) {
        if (!isfinite(r->table[i]) || r->table[i] < 0)
            return "a response table's values must be finite and not negative";
        if (i > 0 && r->table[i] < r->table[i - 1])
            return "a response table's values must not fall";
    }
    if (!(r->table[r->table_size - 1] > r->table[0]))
        return "a response table must rise";
    return NULL;
}

static const char *check(const struct gn_response *r)
{
    if ((unsigned)r->type >= GN_RESPONSE_COUNT)
        return "unknown type of camera response";
    if (r->type == GN_RESPONSE_GAMMA && !(r->gamma >= 0.1 && r->gamma <= 10))
        return "a response's gamma must lie in [0.1, 10]";
    if (r->type == GN_RESPONSE_LOG &&
        !(isfinite(r->log_a) && isfinite(r->log_b) && r->log_b > 0 && isfinite(r->log_c) &&
          r->log_c >= 0 && (1 - r->log_a) / r->log_b < 80))
        return "a log response needs finite a, b > 0, c >= 0, and (1 - a) / b below 80";
    if (!(r->scale >= 0 && r->scale <= gain_max))
        return "a response's scale must lie in [0, 1e30]";
    double inverse[9];
    if (!is_all_zero(r->to_rec709) && !invert_matrix(r->to_rec709, inverse))
        return "a response's matrix to Rec.709 must be finite and invertible";
    for (int i = 0; i < 9; i++)
        if (!(fabs(r->to_rec709[i]) * (r->scale == 0 ? 1 : r->scale) <= gain_max))
            return "a response's matrix times its scale must lie in [-1e30, 1e30]";
    return r->type == GN_RESPONSE_TABLE ? check_table(r) : NULL;
}

int gn_response_check(const struct gn_response *response, const char **out_reason)
{
    const char *reason = check(response);
    if (reason && out_reason)
        *out_reason = reason;
    return reason ? -EINVAL : 0;
}

static float decode_table(const struct gn_response *r, double code)
{
    double position = fmin(code, 1) * (r->table_size - 1);
    int i = (int)position;
    if (i >= r->table_size - 1)
        return r->table[r->table_size - 1];
    double t = position - i;
    return (float)((1 - t) * (double)r->table[i] + t * (double)r->table[i + 1]);
}

/* The lowest code of that value. */
static double encode_table(const struct gn_response *r, double linear)
{
    int low = 0, high = r->table_size - 1;
    if (linear <= (double)r->table[low])
        return 0;
    if (linear >= (double)r->table[high]) // first of a flat top
        linear = (double)r->table[high];
    while (high - low > 1) { // table[low] < linear <= table[high]
        int middle = (low + high) / 2;
        if ((double)r->table[middle] < linear)
            low = middle;
        else
            high = middle;
    }
    double span = (double)r->table[high] - (double)r->table[low];
    return (low + (linear - (double)r->table[low]) / span) / (r->table_size - 1);
}

float gn_response_decode(const struct gn_response *response, float code)
{
    const struct gn_response *r = response;
    if (!(code >= 0)) // NaN too
        return 0;
    double y = (double)code;
    switch (r->type) {
    case GN_RESPONSE_SRGB:
        return (float)(y <= 0.04045 ? y / 12.92 : pow((y + 0.055) / 1.055, 2.4));
    case GN_RESPONSE_GAMMA:
        return (float)pow(y, r->gamma);
    case GN_RESPONSE_LOG:
        return (float)fmax(exp((y - r->log_a) / r->log_b) - r->log_c, 0);
    case GN_RESPONSE_TABLE:
        return decode_table(r, y);
    default:
        return code;
    }
}

float gn_response_encode(const struct gn_response *response, float linear)
{
    const struct gn_response *r = response;
    double x = linear > 0 ? (double)linear : 0, code;
    switch (r->type) {
    case GN_RESPONSE_SRGB:
        code = x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
        break;
    case GN_RESPONSE_GAMMA:
        code = pow(x, 1 / r->gamma);
        break;
    case GN_RESPONSE_LOG:
        code = r->log_a + r->log_b * log(r->log_c + x);
        break;
    case GN_RESPONSE_TABLE:
        code = encode_table(r, x);
        break;
    default:
        code = x;
        break;
    }
    return (float)fmin(fmax(code, 0), 1);
}

void gn_response_multiply(const double m[static 9], float rgb[static 3])
{
    double r = (double)rgb[0], g = (double)rgb[1], b = (double)rgb[2];
    for (int i = 0; i < 3; i++) {
        double v = m[3 * i] * r + m[3 * i + 1] * g + m[3 * i + 2] * b;
        rgb[i] = v > 0 ? (float)v : 0;
    }
}

bool gn_response_get_matrices(const struct gn_response *response,
                              double out_radiance_from_device[static 9],
                              double out_device_from_radiance[static 9])
{
    bool is_identity = is_all_zero(response->to_rec709);
    double scale = response->scale == 0 ? 1 : response->scale;
    for (int i = 0; i < 9; i++)
        out_radiance_from_device[i] = scale * (is_identity ? identity[i] : response->to_rec709[i]);
    if (!invert_matrix(out_radiance_from_device, out_device_from_radiance))
        memcpy(out_device_from_radiance, identity,
               sizeof(identity)); // gn_response_check refuses it
    return !(is_identity && scale == 1);
}

void gn_response_to_radiance(const struct gn_response *response, float *rgb, long n)
{
    double m[9], inverse[9];
    bool has_matrix = gn_response_get_matrices(response, m, inverse);
    for (long i = 0; i < n; i++) {
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = gn_response_decode(response, rgb[3 * i + c]);
        if (has_matrix)
            gn_response_multiply(m, rgb + 3 * i);
    }
}

void gn_response_from_radiance(const struct gn_response *response, float *rgb, long n)
{
    double m[9], inverse[9];
    bool has_matrix = gn_response_get_matrices(response, m, inverse);
    for (long i = 0; i < n; i++) {
        if (has_matrix)
            gn_response_multiply(inverse, rgb + 3 * i);
        for (int c = 0; c < 3; c++)
            rgb[3 * i + c] = gn_response_encode(response, rgb[3 * i + c]);
    }
}
