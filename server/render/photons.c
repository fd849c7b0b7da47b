/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Where the photons of caustics come from: lights of the map and lamps, aimed at balls about the
 * virtual objects of mirror and glass. */
#include "server/render/caustics.h"

#include <math.h>

#include "server/light/luminance.h"
#include "server/render/random.h"

/** Pixels for each photon of each of paths_per_pixel. */
#define PIXELS 8
/** Of the square that a photon is chosen in. */
#define JITTER (1.0 / 32)

static bool is_clear(const struct gn_scene_object *object)
{
    bool is_any = object->has_material && (CLEAR_MATERIALS >> object->material.type & 1);
    for (int m = 0; !object->has_material && m < object->mesh.n_materials; m++)
        is_any |= CLEAR_MATERIALS >> object->mesh.materials[m].factors.type & 1;
    return is_any;
}

/** The ball about the object's vertices. */
static void make_target(const struct gn_scene *scene, int object, struct caustic_target *out)
{
    const struct gn_scene_object *o = &scene->objects[object];
    struct box box = EMPTY_BOX;
    double radius2 = 0;
    float p[3];
    for (int i = 0; i < o->mesh.n_vertices; i++) {
        gn_movers_get_vertex(o, o->mesh.positions + 3 * (size_t)i, p);
        gn_box_grow(&box, p);
    }
    out->object = (uint32_t)object;
    for (int k = 0; k < 3; k++)
        out->center[k] = 0.5 * ((double)box.min[k] + box.max[k]);
    for (int i = 0; i < o->mesh.n_vertices; i++) {
        gn_movers_get_vertex(o, o->mesh.positions + 3 * (size_t)i, p);
        double distance2 = 0;
        for (int k = 0; k < 3; k++)
            distance2 += (p[k] - out->center[k]) * (p[k] - out->center[k]);
        radius2 = fmax(radius2, distance2);
    }
    out->radius = 1.0001 * sqrt(radius2);
}

/** Two unit vectors across a unit one. Duff et al., JCGT 6(1), 2017. */
static void make_across(const double n[static 3], double s[static 3], double t[static 3])
{
    double sign = copysign(1, n[2]);
    double a = -1 / (sign + n[2]);
    double b = n[0] * n[1] * a;
    s[0] = 1 + sign * n[0] * n[0] * a;
    s[1] = sign * b;
    s[2] = -sign * n[0];
    t[0] = b;
    t[1] = sign + n[1] * n[1] * a;
    t[2] = -n[1];
}

/** The target that share u [0, 1) of their summed radius^2 falls on. */
static const struct caustic_target *choose_target(const struct photon_job *job, double u)
{
    const struct caustics *c = job->caustics;
    double sum = u * job->squares;
    int i = 0;
    while (i < c->n_targets - 1 && sum >= c->targets[i].radius * c->targets[i].radius) {
        sum -= c->targets[i].radius * c->targets[i].radius;
        i++;
    }
    return &c->targets[i];
}

static bool is_lamp(const struct frame *frame, int l)
{
    return frame->near.lights[l].object == GN_NEAR_NO_OBJECT;
}

/** The cosine of the cone that the ball fills from a lamp; -1: the lamp is in it. */
static double get_cone(const struct gn_near_light *lamp, const struct caustic_target *target,
                       double out_axis[static 3])
{
    double distance2 = 0;
    for (int k = 0; k < 3; k++) {
        out_axis[k] = target->center[k] - lamp->position_world[k];
        distance2 += out_axis[k] * out_axis[k];
    }
    double sine2 = target->radius * target->radius / distance2;
    if (!(sine2 < 1)) {
        out_axis[0] = out_axis[1] = 0;
        out_axis[2] = 1;
        return -1;
    }
    for (int k = 0; k < 3; k++)
        out_axis[k] /= sqrt(distance2);
    return sqrt(1 - sine2);
}

/** Power of the lamp's light, in luminance, into the cone. */
static double get_power(const struct gn_near_light *lamp, double cosine)
{
    return gn_luminance(lamp->intensity) * 2 * M_PI * (1 - cosine);
}

/** A photon of the map: from a light chosen by luminance, through the disc about a ball. False: it
 * is hidden on its way to there. u[3] in [0, 1). */
static bool send_distant(const struct photon_job *job, const double u[static 3],
                         struct photon *photon, const struct caustic_target **out_target,
                         int *out_light)
{
    const struct light_list *lights = job->frame->lights;
    int l = gn_render_lights_choose(lights, u[0]);
    double before = l > 0 ? lights->cdf[l - 1] : 0;
    double probability = lights->cdf[l] - before;
    if (!(probability > 0))
        return false;
    const struct caustic_target *target = choose_target(job, (u[0] - before) / probability);
    const double d[3] = {lights->dir[0][l], lights->dir[1][l], lights->dir[2][l]};
    double s[3];
    double t[3];
    double r = target->radius * sqrt(u[1]);
    make_across(d, s, t);
    for (int k = 0; k < 3; k++) {
        photon->org[k] = (float)(target->center[k] + r * cos(2 * M_PI * u[2]) * s[k] +
                                 r * sin(2 * M_PI * u[2]) * t[k] + 1.01 * target->radius * d[k]);
        photon->dir[k] = (float)-d[k];
        // The area of all discs, of which each is chosen by its own.
        photon->flux[k] = lights->irradiance[k][l] * M_PI * job->squares / probability;
    }
    *out_target = target;
    *out_light = l;
    const float back[3] = {(float)d[0], (float)d[1], (float)d[2]};
    return !gn_rt_is_occluded(job->frame->rt, GN_RT_ALL, photon->org, back, 0, INFINITY);
}

/** A photon of a lamp, in the cone of a ball, both chosen by power. */
static bool send_lamp(const struct photon_job *job, const double u[static 3], struct photon *photon,
                      const struct caustic_target **out_target)
{
    const struct near_lights *near = &job->frame->near;
    const struct caustics *c = job->caustics;
    const struct gn_near_light *lamp = NULL;
    double axis[3];
    double cosine = 1;
    double left = u[0] * job->lamps;
    for (int l = near->n_placed; l < near->n && left >= 0; l++) {
        for (int i = 0; i < c->n_targets && left >= 0 && is_lamp(job->frame, l); i++) {
            lamp = &near->lights[l];
            *out_target = &c->targets[i];
            cosine = get_cone(lamp, *out_target, axis);
            left -= get_power(lamp, cosine);
        }
    }
    double luminance = lamp ? gn_luminance(lamp->intensity) : 0;
    if (!(luminance > 0))
        return false;
    double s[3];
    double t[3];
    double z = 1 - u[1] * (1 - cosine);
    double r = sqrt(fmax(0, 1 - z * z));
    make_across(axis, s, t);
    for (int k = 0; k < 3; k++) {
        photon->dir[k] = (float)(r * cos(2 * M_PI * u[2]) * s[k] + r * sin(2 * M_PI * u[2]) * t[k] +
                                 z * axis[k]);
        photon->org[k] = lamp->position_world[k] + lamp->radius * photon->dir[k];
        photon->flux[k] = (double)lamp->intensity[k] / luminance * job->lamps;
    }
    return true;
}

void gn_photons_prepare(struct caustics *c, const struct frame *frame, struct photon_job *job)
{
    const struct gn_scene *scene = frame->scene;
    const double *total = frame->lights->total;
    const float irradiance[3] = {(float)total[0], (float)total[1], (float)total[2]};
    uint64_t random = frame->options.seed ^ UINT64_C(0x632be59bd9b4e019);
    c->n_targets = 0;
    for (int i = 0; i < scene->n_objects; i++) {
        if (scene->objects[i].role == GN_RT_VIRTUAL && is_clear(&scene->objects[i]))
            make_target(scene, i, &c->targets[c->n_targets++]);
    }
    *job = (struct photon_job){.frame = frame, .caustics = c};
    uint64_t n_pixels = (uint64_t)frame->camera->width * (uint64_t)frame->camera->height;
    job->n = (uint64_t)frame->options.paths_per_pixel * ((n_pixels + PIXELS - 1) / PIXELS);
    for (int k = 0; k < 3; k++)
        job->shift[k] = random_unit(&random);
    for (int i = 0; i < c->n_targets; i++) {
        job->squares += c->targets[i].radius * c->targets[i].radius;
        for (int l = frame->near.n_placed; l < frame->near.n; l++) {
            double axis[3];
            if (is_lamp(frame, l))
                job->lamps += get_power(&frame->near.lights[l],
                                        get_cone(&frame->near.lights[l], &c->targets[i], axis));
        }
    }
    double distant = frame->lights->n_lit > 0 ? gn_luminance(irradiance) * M_PI * job->squares : 0;
    job->distant_share = distant > 0 ? distant / (distant + job->lamps) : 0;
    job->n = distant + job->lamps > 0 ? job->n : 0;
}

bool gn_photons_send(const struct photon_job *job, uint64_t i, struct photon *photon,
                     uint32_t *out_object, int *out_light, uint64_t *rays)
{
    // Points of the sequence R3, turned (Roberts, "The Unreasonable Effectiveness of Quasirandom
    // Sequences", 2018): even over the whole; shaken by JITTER, or their lattice would show.
    static const double steps[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    const struct caustic_target *target = NULL;
    uint64_t random = (job->frame->options.seed + 1) * UINT64_C(0x9e6c63d0876a9a47) ^ (i << 16);
    double u[3];
    for (int k = 0; k < 3; k++) {
        u[k] = job->shift[k] + (double)(i + 1) * steps[k] + JITTER * random_unit(&random);
        u[k] -= floor(u[k]);
    }
    bool is_distant = u[0] < job->distant_share;
    double share = is_distant ? job->distant_share : 1 - job->distant_share;
    u[0] = fmin((is_distant ? u[0] : u[0] - job->distant_share) / share, 1 - 0x1p-53);
    *out_light = -1;
    *rays += is_distant;
    if (!(is_distant ? send_distant(job, u, photon, &target, out_light)
                     : send_lamp(job, u, photon, &target)))
        return false;
    for (int k = 0; k < 3; k++)
        photon->flux[k] /= share;
    *out_object = target->object;
    return true;
}
