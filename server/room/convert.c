/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/convert.h"

#include <errno.h>
#include <math.h>
#include <string.h>

int gn_convert_transform(bool is_there, const struct gn_msg_transform *message,
                         struct gn_pose *out_pose, struct gn_error *out_error)
{
    struct gn_pose pose = {{1, 0, 0, 0}, {0, 0, 0}};
    if (is_there) {
        memcpy(pose.rotation, message->orientation, sizeof(pose.rotation));
        memcpy(pose.translation, message->position_m, sizeof(pose.translation));
    }
    if (gn_pose_normalize(&pose) < 0)
        return gn_error_set(out_error, -EINVAL, "orientation is not a unit quaternion");
    *out_pose = pose;
    return 0;
}

int gn_convert_response(const struct gn_msg_response *message, const double matrix[9], double scale,
                        const float *table, struct gn_response *out_response,
                        struct gn_error *out_error)
{
    struct gn_response response = {.gamma = message->gamma, .scale = scale};
    switch (message->type) {
    case GN_MSG_RESPONSE_TYPE_LINEAR:
        response.type = GN_RESPONSE_LINEAR;
        break;
    case GN_MSG_RESPONSE_TYPE_SRGB:
        response.type = GN_RESPONSE_SRGB;
        break;
    case GN_MSG_RESPONSE_TYPE_GAMMA:
        response.type = GN_RESPONSE_GAMMA;
        break;
    case GN_MSG_RESPONSE_TYPE_LOG:
        response.type = GN_RESPONSE_LOG;
        response.log_a = message->log_a;
        response.log_b = message->log_b;
        response.log_c = message->log_c;
        break;
    case GN_MSG_RESPONSE_TYPE_TABLE:
        response.type = GN_RESPONSE_TABLE;
        response.table = table;
        response.table_size = (int)message->table_entries;
        break;
    default:
        return gn_error_set(out_error, -EINVAL, "response %d is none that this server knows",
                            (int)message->type);
    }
    memcpy(response.to_rec709, matrix, sizeof(response.to_rec709));
    const char *reason = NULL;
    if (gn_response_check(&response, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "response: %s", reason);
    *out_response = response;
    return 0;
}

int gn_convert_camera(const struct gn_msg_camera *message, struct gn_camera *out_camera,
                      struct gn_error *out_error)
{
    struct gn_camera camera = {
        .width = (int)message->width,
        .height = (int)message->height,
        .fx = message->fx,
        .fy = message->fy,
        .cx = message->cx,
        .cy = message->cy,
        .distortion = {message->k1, message->k2, message->p1, message->p2, message->k3},
        .match = {.blur_px = message->blur_px},
        .world_from_camera = {{1, 0, 0, 0}, {0, 0, 0}},
    };
    memcpy(camera.match.noise_slope, message->noise_slope, sizeof(camera.match.noise_slope));
    memcpy(camera.match.noise_offset, message->noise_offset, sizeof(camera.match.noise_offset));
    int rc = gn_convert_response(&message->response, message->matrix_to_rec709, message->scale,
                                 NULL, &camera.response, out_error);
    if (rc < 0)
        return rc;
    const char *reason = NULL;
    if (gn_camera_check(&camera, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "camera: %s", reason);
    *out_camera = camera;
    return 0;
}

int gn_convert_view(const struct gn_msg_frame_view *view, struct gn_camera *camera,
                    struct gn_error *out_error)
{
    struct gn_response response = camera->response;
    bool has_matrix = false;
    for (int i = 0; i < 9; i++)
        has_matrix = has_matrix || view->matrix_to_rec709[i] != 0;
    if (has_matrix)
        memcpy(response.to_rec709, view->matrix_to_rec709, sizeof(response.to_rec709));
    if (view->scale > 0)
        response.scale = view->scale;
    const char *reason = NULL;
    if (gn_response_check(&response, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "%s", reason);
    camera->response = response;
    return 0;
}

/** Radius of theta for f = 1, the models of gnomon.proto. */
static double get_unit_radius(const struct gn_msg_projection *m)
{
    double t = m->theta_max, t2 = t * t;
    switch (m->type) {
    case GN_MSG_PROJECTION_TYPE_EQUIDISTANT:
        return t;
    case GN_MSG_PROJECTION_TYPE_EQUISOLID:
        return 2 * sin(t / 2);
    case GN_MSG_PROJECTION_TYPE_ORTHOGRAPHIC:
        return sin(t);
    case GN_MSG_PROJECTION_TYPE_STEREOGRAPHIC:
        return 2 * tan(t / 2);
    case GN_MSG_PROJECTION_TYPE_KANNALA_BRANDT:
        return t * (1 + t2 * (m->k1 + t2 * (m->k2 + t2 * (m->k3 + t2 * m->k4))));
    default:
        return 0; // no focal length in this model
    }
}

int gn_convert_projection(const struct gn_msg_projection *message, int width, int height,
                          struct gn_projection *out_projection, struct gn_error *out_error)
{
    static const enum gn_projection_type types[] = {
        [GN_MSG_PROJECTION_TYPE_LATLONG] = GN_PROJECTION_LATLONG,
        [GN_MSG_PROJECTION_TYPE_ANGULAR] = GN_PROJECTION_ANGULAR,
        [GN_MSG_PROJECTION_TYPE_MIRROR_BALL] = GN_PROJECTION_MIRRORBALL,
        [GN_MSG_PROJECTION_TYPE_EQUIDISTANT] = GN_PROJECTION_FISHEYE_EQUIDISTANT,
        [GN_MSG_PROJECTION_TYPE_EQUISOLID] = GN_PROJECTION_FISHEYE_EQUISOLID,
        [GN_MSG_PROJECTION_TYPE_ORTHOGRAPHIC] = GN_PROJECTION_FISHEYE_ORTHOGRAPHIC,
        [GN_MSG_PROJECTION_TYPE_STEREOGRAPHIC] = GN_PROJECTION_FISHEYE_STEREOGRAPHIC,
        [GN_MSG_PROJECTION_TYPE_KANNALA_BRANDT] = GN_PROJECTION_FISHEYE_KANNALA_BRANDT,
        [GN_MSG_PROJECTION_TYPE_CUBE] = GN_PROJECTION_CUBE,
        [GN_MSG_PROJECTION_TYPE_OCTAHEDRAL] = GN_PROJECTION_OCTAHEDRAL,
    };
    if (message->type <= GN_MSG_PROJECTION_TYPE_UNSPECIFIED ||
        (size_t)message->type >= GN_ARRAY_LEN(types))
        return gn_error_set(out_error, -EINVAL, "projection %d is none that this server knows",
                            (int)message->type);
    struct gn_projection projection = {
        .type = types[message->type],
        .width = width,
        .height = height,
        .center = {message->center_x_px, message->center_y_px},
        .radius = message->radius_px,
        .theta_max = message->theta_max,
        .k = {message->k1, message->k2, message->k3, message->k4},
        .vignetting = {message->vignetting_a, message->vignetting_b, message->vignetting_c},
    };
    if (message->focal_px > 0) {
        double unit = get_unit_radius(message);
        if (!(unit > 0))
            return gn_error_set(out_error, -EINVAL,
                                "focal_px does not fit the projection: give radius_px");
        projection.radius = message->focal_px * unit;
    }
    const char *reason = NULL;
    if (gn_projection_init(&projection, &reason) < 0)
        return gn_error_set(out_error, -EINVAL, "projection: %s", reason);
    *out_projection = projection;
    return 0;
}
