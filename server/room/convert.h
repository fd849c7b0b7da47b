/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * From the wire's values to ours. What comes in was checked by gn_wire_decode(): finite and in
 * range; what the wire allows and the server cannot do is refused here.
 */
#ifndef GN_SERVER_ROOM_CONVERT_H
#define GN_SERVER_ROOM_CONVERT_H

#include "common/camera.h"
#include "common/error.h"
#include "common/projection.h"
#include "proto/attr.h"
#include "proto/wire.h"

/** Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_convert_camera(const struct gn_msg_camera *message, struct gn_camera *out_camera,
                                  struct gn_error *out_error);
/** Gives the camera what the view says of its exposure and white balance. Returns 0, or -EINVAL and
 * a sentence. */
GN_MUST_USE int gn_convert_view(const struct gn_msg_frame_view *view, struct gn_camera *camera,
                                struct gn_error *out_error);
/** An absent transform is the identity. Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_convert_transform(bool is_there, const struct gn_msg_transform *message,
                                     struct gn_pose *out_pose, struct gn_error *out_error);
/**
 * table: [table_entries], borrowed by *out_response. Returns 0, or -EINVAL and a sentence.
 */
GN_MUST_USE int gn_convert_response(const struct gn_msg_response *message, const double matrix[9],
                                    double scale, const float *table,
                                    struct gn_response *out_response, struct gn_error *out_error);
/** Returns 0, or -EINVAL and a sentence. */
GN_MUST_USE int gn_convert_projection(const struct gn_msg_projection *message, int width,
                                      int height, struct gn_projection *out_projection,
                                      struct gn_error *out_error);

#endif
