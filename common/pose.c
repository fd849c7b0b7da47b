/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/pose.h"

#include <errno.h>
#include <math.h>
#include <string.h>

/* A 3x3 matrix by columns: column j is c[j]. */
struct mat3_columns {
    double c[3][3];
};

static double dot3(const double a[static 3], const double b[static 3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Columns p and q of m become cos p - sin q and sin p + cos q. */
static void rotate_columns(struct mat3_columns *m, int p, int q, double cos_t, double sin_t)
{
    for (int i = 0; i < 3; i++) {
        double a = m->c[p][i];
        double b = m->c[q][i];
        m->c[p][i] = cos_t * a - sin_t * b;
        m->c[q][i] = sin_t * a + cos_t * b;
    }
}

/*
 * One-sided Jacobi: turns the columns of a pairwise until they are orthogonal, so that
 * a_before = a_after v^T with a_after = U diag(sigma).
 * Source: Golub, Van Loan, Matrix Computations, 4th ed., 8.6.3 (Hestenes 1958). Converges
 * quadratically; a 3x3 matrix needs about 5 sweeps.
 */
static void orthogonalise_columns(struct mat3_columns *a, struct mat3_columns *v)
{
    static const int pairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
    *v = (struct mat3_columns){{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    for (int sweep = 0; sweep < 30; sweep++) {
        bool is_turned = false;
        for (int k = 0; k < 3; k++) {
            int p = pairs[k][0];
            int q = pairs[k][1];
            double alpha = dot3(a->c[p], a->c[p]);
            double beta = dot3(a->c[q], a->c[q]);
            double gamma = dot3(a->c[p], a->c[q]);
            if (fabs(gamma) <= 1e-16 * sqrt(alpha * beta))
                continue;
            is_turned = true;
            double zeta = (beta - alpha) / (2.0 * gamma);
            double t = copysign(1.0, zeta) / (fabs(zeta) + hypot(1.0, zeta));
            double cos_t = 1.0 / sqrt(1.0 + t * t);
            rotate_columns(a, p, q, cos_t, cos_t * t);
            rotate_columns(v, p, q, cos_t, cos_t * t);
        }
        if (!is_turned)
            return;
    }
}

/*
 * Unit quaternion of a rotation matrix r[row][column], w >= 0.
 * Source: Shepperd 1978, Quaternion from rotation matrix: divide by the largest component.
 */
static void quaternion_from_rotation(double r[static 3][3], double q[static 4])
{
    double trace = r[0][0] + r[1][1] + r[2][2];
    int i = 0;
    for (int k = 1; k < 3; k++)
        if (r[k][k] > r[i][i])
            i = k;
    if (trace >= r[i][i]) {
        q[0] = 1.0 + trace;
        q[1] = r[2][1] - r[1][2];
        q[2] = r[0][2] - r[2][0];
        q[3] = r[1][0] - r[0][1];
    } else {
        int j = (i + 1) % 3;
        int k = (i + 2) % 3;
        q[0] = r[k][j] - r[j][k];
        q[1 + i] = 1.0 + r[i][i] - r[j][j] - r[k][k];
        q[1 + j] = r[j][i] + r[i][j];
        q[1 + k] = r[k][i] + r[i][k];
    }
    double norm = copysign(sqrt(q[0] * q[0] + dot3(q + 1, q + 1)), q[0]);
    for (int k = 0; k < 4; k++)
        q[k] /= norm;
}

static double det3(const double m[static 16])
{
    return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
           m[2] * (m[4] * m[9] - m[5] * m[8]);
}

/* Why m is not near a rigid motion before any decomposition, or NULL. */
static const char *find_fault(const double m[static 16])
{
    for (int i = 0; i < 16; i++)
        if (!isfinite(m[i]))
            return "the matrix holds a number that is not finite";
    if (m[12] != 0.0 || m[13] != 0.0 || m[14] != 0.0 || m[15] != 1.0)
        return "the last row of the matrix is not 0 0 0 1 (matrices are row-major)";
    for (int i = 0; i < 12; i++)
        if (i % 4 != 3 && fabs(m[i]) > 2.0)
            return "the matrix scales by more than 10 % (lengths are metres)";
    if (det3(m) < 0.0)
        return "the matrix mirrors (determinant < 0)";
    return NULL;
}

int gn_pose_from_matrix(const double m[static 16], struct gn_pose *out_pose,
                        const char **out_reason)
{
    struct mat3_columns a, v;
    double sigma[3], r[3][3];
    const char *reason = find_fault(m);
    if (reason != NULL)
        goto out;

    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            a.c[j][i] = m[4 * i + j];
    orthogonalise_columns(&a, &v);
    for (int j = 0; j < 3; j++)
        sigma[j] = sqrt(dot3(a.c[j], a.c[j]));
    double largest = fmax(sigma[0], fmax(sigma[1], sigma[2]));
    double smallest = fmin(sigma[0], fmin(sigma[1], sigma[2]));
    double scale = (sigma[0] + sigma[1] + sigma[2]) / 3.0;
    if (smallest <= 1e-12 * largest)
        reason = "the matrix is singular";
    else if (smallest < 0.9 * largest)
        reason = "the matrix shears or stretches (singular values differ by more than 10 %)";
    else if (scale < 0.9 || scale > 1.1)
        reason = "the matrix scales by more than 10 % (lengths are metres)";
    if (reason != NULL)
        goto out;

    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            r[i][k] = 0.0;
            for (int j = 0; j < 3; j++)
                r[i][k] += a.c[j][i] / sigma[j] * v.c[j][k];
        }
    quaternion_from_rotation(r, out_pose->rotation);
    for (int i = 0; i < 3; i++)
        out_pose->translation[i] = m[4 * i + 3];
out:
    if (reason != NULL && out_reason != NULL)
        *out_reason = reason;
    return reason != NULL ? -EDOM : 0;
}

void gn_pose_to_matrix(const struct gn_pose *pose, double out_m[static 16])
{
    const double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    gn_mat4_identity(out_m);
    for (int j = 0; j < 3; j++) {
        double column[3];
        gn_pose_rotate(pose, axes[j], column);
        for (int i = 0; i < 3; i++)
            out_m[4 * i + j] = column[i];
    }
    for (int i = 0; i < 3; i++)
        out_m[4 * i + 3] = pose->translation[i];
}

int gn_pose_normalize(struct gn_pose *pose)
{
    double *q = pose->rotation;
    double norm = sqrt(q[0] * q[0] + dot3(q + 1, q + 1));
    const double *t = pose->translation;
    if (!(norm >= 0.9 && norm <= 1.1) || !isfinite(t[0]) || !isfinite(t[1]) || !isfinite(t[2]))
        return -EDOM;
    for (int i = 0; i < 4; i++)
        q[i] /= norm;
    return 0;
}

void gn_pose_multiply(const struct gn_pose *a, const struct gn_pose *b, struct gn_pose *out)
{
    const double *p = a->rotation;
    const double *q = b->rotation;
    struct gn_pose result = {.rotation = {p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
                                          p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
                                          p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
                                          p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]}};
    gn_pose_transform(a, b->translation, result.translation);
    *out = result;
}

void gn_pose_invert(const struct gn_pose *pose, struct gn_pose *out)
{
    const double *q = pose->rotation;
    struct gn_pose result = {.rotation = {q[0], -q[1], -q[2], -q[3]}};
    gn_pose_rotate(&result, pose->translation, result.translation);
    for (int i = 0; i < 3; i++)
        result.translation[i] = -result.translation[i];
    *out = result;
}

void gn_pose_interpolate(const struct gn_pose *a, const struct gn_pose *b, double t,
                         struct gn_pose *out)
{
    struct gn_pose result;
    double sign = 1.0, length_diff = 0.0, length_sum = 0.0;
    double dot = a->rotation[0] * b->rotation[0] + dot3(a->rotation + 1, b->rotation + 1);
    if (dot < 0.0)
        sign = -1.0;
    for (int i = 0; i < 4; i++) {
        double diff = sign * b->rotation[i] - a->rotation[i];
        double sum = sign * b->rotation[i] + a->rotation[i];
        length_diff += diff * diff;
        length_sum += sum * sum;
    }
    /* The angle between the quaternions; exact near 0, where acos of their product is not. */
    double angle = 2.0 * atan2(sqrt(length_diff), sqrt(length_sum));
    double weight_a = 1.0 - t;
    double weight_b = t;
    if (angle > 1e-6) {
        weight_a = sin((1.0 - t) * angle) / sin(angle);
        weight_b = sin(t * angle) / sin(angle);
    }
    double norm = 0.0;
    for (int i = 0; i < 4; i++) {
        result.rotation[i] = weight_a * a->rotation[i] + weight_b * sign * b->rotation[i];
        norm += result.rotation[i] * result.rotation[i];
    }
    for (int i = 0; i < 4; i++)
        result.rotation[i] /= sqrt(norm);
    for (int i = 0; i < 3; i++)
        result.translation[i] = (1.0 - t) * a->translation[i] + t * b->translation[i];
    *out = result;
}

/* v + 2 w (u x v) + 2 u x (u x v), with the quaternion (w, u). */
void gn_pose_rotate(const struct gn_pose *pose, const double v[static 3], double out[static 3])
{
    const double w = pose->rotation[0];
    const double *u = pose->rotation + 1;
    const double s[3] = {2.0 * (u[1] * v[2] - u[2] * v[1]), 2.0 * (u[2] * v[0] - u[0] * v[2]),
                         2.0 * (u[0] * v[1] - u[1] * v[0])};
    const double r[3] = {v[0] + w * s[0] + u[1] * s[2] - u[2] * s[1],
                         v[1] + w * s[1] + u[2] * s[0] - u[0] * s[2],
                         v[2] + w * s[2] + u[0] * s[1] - u[1] * s[0]};
    memcpy(out, r, sizeof(r));
}

void gn_pose_transform(const struct gn_pose *pose, const double p[static 3], double out[static 3])
{
    gn_pose_rotate(pose, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += pose->translation[i];
}

void gn_mat4_multiply(const double a[static 16], const double b[static 16], double out[static 16])
{
    double r[16];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            r[4 * i + j] = 0.0;
            for (int k = 0; k < 4; k++)
                r[4 * i + j] += a[4 * i + k] * b[4 * k + j];
        }
    memcpy(out, r, sizeof(r));
}

bool gn_mat4_invert(const double m[static 16], double out[static 16])
{
    double det = det3(m);
    if (!isfinite(det) || det == 0.0)
        return false;
    double r[16];
    gn_mat4_identity(r);
    /* Cofactors; the cyclic indices carry the sign. */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (j + 1) % 3, b = (j + 2) % 3;
            int c = (i + 1) % 3, d = (i + 2) % 3;
            r[4 * i + j] = (m[4 * a + c] * m[4 * b + d] - m[4 * a + d] * m[4 * b + c]) / det;
        }
    for (int i = 0; i < 3; i++)
        r[4 * i + 3] = -(r[4 * i] * m[3] + r[4 * i + 1] * m[7] + r[4 * i + 2] * m[11]);
    for (int i = 0; i < 12; i++)
        if (!isfinite(r[i]))
            return false;
    memcpy(out, r, sizeof(r));
    return true;
}

void gn_mat4_transform_point(const double m[static 16], const double p[static 3],
                             double out[static 3])
{
    double r[3];
    for (int i = 0; i < 3; i++)
        r[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
    memcpy(out, r, sizeof(r));
}

void gn_mat4_identity(double out_m[static 16])
{
    for (int i = 0; i < 16; i++)
        out_m[i] = i % 5 == 0 ? 1.0 : 0.0;
}
