/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/gloss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/rig/vec.h"

/* Facets of an integral, per side of the unit square. */
enum { SIDE = 96 };

/* A facet's normal about +z: the share u of the facets, by projected area, leans less than it. */
static void draw_facet(double alpha, double u, double v, double out[static 3])
{
    double tangent = alpha * sqrt(u / (1 - u)), cosine = 1 / sqrt(1 + tangent * tangent);
    out[0] = tangent * cosine * cos(2 * GN_RIG_PI * v);
    out[1] = tangent * cosine * sin(2 * GN_RIG_PI * v);
    out[2] = cosine;
}

/* sqrt(1 + alpha^2 tan^2), of the direction's cosine: 1 + 2 Lambda. */
static double stretch(double alpha, double cosine)
{
    double c2 = cosine * cosine;
    return sqrt(1 + alpha * alpha * (1 - c2) / c2);
}

/* Facets seen from one side and lit from the other, of all: both heights known together. */
static double share_open(double alpha, double cos_a, double cos_b)
{
    return 2 / (stretch(alpha, cos_a) + stretch(alpha, cos_b));
}

/* D G (o . m) / (cos_o D m_z): the weight of a facet drawn as above; 0 where it sends light into
 * the surface. */
static double weigh(double alpha, const double eye[static 3], const double m[static 3],
                    double out_light[static 3])
{
    double along = vec_dot(eye, m);
    for (int k = 0; k < 3; k++)
        out_light[k] = 2 * along * m[k] - eye[k];
    if (along <= 0 || out_light[2] <= 0)
        return 0;
    return share_open(alpha, eye[2], out_light[2]) * along / (eye[2] * m[2]);
}

static double fifth_power(double cosine)
{
    return pow(1 - cosine, 5);
}

static void integrate(struct gn_rig_gloss *gloss, int angle)
{
    double theta = 0.5 * GN_RIG_PI * angle / (GN_RIG_GLOSS_ANGLES - 1);
    theta = fmin(theta, 0.5 * GN_RIG_PI - 1e-3);
    const double eye[3] = {sin(theta), 0, cos(theta)};
    for (int i = 0; i < SIDE * SIDE; i++) {
        double m[3], light[3];
        draw_facet(gloss->alpha, (i / SIDE + 0.5) / SIDE, (i % SIDE + 0.5) / SIDE, m);
        double weight = weigh(gloss->alpha, eye, m, light) / (SIDE * SIDE);
        gloss->whole[angle] += weight;
        gloss->edge[angle] += weight > 0 ? weight * fifth_power(vec_dot(eye, m)) : 0;
    }
}

struct gn_rig_gloss *gn_rig_gloss_create(double roughness, double metallic, double ior)
{
    struct gn_rig_gloss *gloss = calloc(1, sizeof(*gloss));
    if (!gloss)
        return NULL;
    gloss->alpha = roughness * roughness;
    gloss->metallic = metallic;
    gloss->dielectric = pow((1 - ior) / (1 + ior), 2);
    for (int i = 0; i < GN_RIG_GLOSS_ANGLES; i++)
        integrate(gloss, i);
    return gloss;
}

static void look_up(const struct gn_rig_gloss *gloss, double cosine, double *whole, double *edge)
{
    double x = acos(fmin(cosine, 1)) / (0.5 * GN_RIG_PI) * (GN_RIG_GLOSS_ANGLES - 1);
    int i = x < GN_RIG_GLOSS_ANGLES - 1 ? (int)x : GN_RIG_GLOSS_ANGLES - 2;
    *whole = gloss->whole[i] + (x - i) * (gloss->whole[i + 1] - gloss->whole[i]);
    *edge = gloss->edge[i] + (x - i) * (gloss->edge[i + 1] - gloss->edge[i]);
}

void gn_rig_gloss_get_base(const struct gn_rig_gloss *gloss, const double albedo[static 3],
                           double cosine, double out_base[static 3])
{
    double whole, edge, f0 = gloss->dielectric;
    look_up(gloss, cosine, &whole, &edge);
    double sent_back = (f0 * (whole - edge) + edge) * (1 + f0 / whole - f0);
    for (int k = 0; k < 3; k++)
        out_base[k] = albedo[k] * (1 - gloss->metallic) * (1 - sent_back);
}

bool gn_rig_gloss_reflect(const struct gn_rig_gloss *gloss, const double albedo[static 3],
                          const double normal[static 3], const double uv[static 2],
                          double io_dir[static 3], double io_weight[static 3])
{
    double axes[3][3], eye[3], m[3], light[3], whole, edge;
    const double helper[3] = {fabs(normal[0]) < 0.5, fabs(normal[0]) >= 0.5, 0};
    memcpy(axes[2], normal, sizeof(axes[2]));
    vec_cross(helper, normal, axes[0]);
    vec_normalize(axes[0]);
    vec_cross(normal, axes[0], axes[1]);
    for (int k = 0; k < 3; k++)
        eye[k] = -vec_dot(axes[k], io_dir);
    draw_facet(gloss->alpha, uv[0], uv[1], m);
    double weight = weigh(gloss->alpha, eye, m, light);
    if (weight <= 0)
        return false;
    look_up(gloss, eye[2], &whole, &edge);
    double fifth = fifth_power(vec_dot(eye, m));
    for (int k = 0; k < 3; k++) {
        double f0 = gloss->dielectric + gloss->metallic * (albedo[k] - gloss->dielectric);
        io_weight[k] *= weight * (f0 + (1 - f0) * fifth) * (1 + f0 / whole - f0);
        io_dir[k] = light[0] * axes[0][k] + light[1] * axes[1][k] + light[2] * axes[2][k];
    }
    vec_normalize(io_dir);
    return true;
}

/* By the angles: sin^2(a - b) / sin^2(a + b) and tan^2(a - b) / tan^2(a + b). */
static double get_fresnel(double a, double b)
{
    if (a < 1e-4) { // both as the angles vanish, whose ratio is the indices'
        double r = (a - b) / (a + b);
        return a > 0 ? r * r : 0;
    }
    double s = sin(a - b) / sin(a + b), p = tan(a - b) / tan(a + b);
    return 0.5 * (s * s + p * p);
}

bool gn_rig_glass_choose(const double normal[static 3], double ratio, double choice,
                         double io_dir[static 3])
{
    double along = -vec_dot(normal, io_dir), across[3];
    for (int k = 0; k < 3; k++)
        across[k] = io_dir[k] + along * normal[k];
    double sine = vec_length(across), beyond = sine / ratio;
    double a = atan2(sine, along);
    bool is_total = beyond >= 1;
    double share = is_total ? 1 : get_fresnel(fmax(a, 1e-7), asin(fmax(1e-7, sine) / ratio));
    if (choice < share) {
        for (int k = 0; k < 3; k++)
            io_dir[k] += 2 * along * normal[k];
        return false;
    }
    double down = sqrt(1 - beyond * beyond);
    for (int k = 0; k < 3; k++)
        io_dir[k] = across[k] / ratio - down * normal[k];
    vec_normalize(io_dir);
    return true;
}
