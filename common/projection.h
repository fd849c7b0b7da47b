/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Directions to pixels and back for every kind of environment frame, with exact solid angles.
 * Directions are unit vectors in the frame of the picture:
 *   fisheye, angular map: x right, y down, z along the optical axis (the middle of the picture);
 *   mirror ball: x right, y up, seen along -z: the middle of the ball reflects +z, its rim shows
 * -z; lat-long: z up, row 0 is +z; pixel centre (u, v) in [0, 1]^2 is theta = pi v, phi = pi - 2 pi
 * u, d = (sin theta cos phi, sin theta sin phi, cos theta): the middle looks along +x. Pixel
 * centres lie at half-integers: the centre of pixel (0, 0) is (0.5, 0.5).
 */
#ifndef GN_COMMON_PROJECTION_H
#define GN_COMMON_PROJECTION_H

#include <stdbool.h>

#include "proto/attr.h"

enum gn_projection_type {
    GN_PROJECTION_LATLONG = 0,
    GN_PROJECTION_ANGULAR = 1, // Debevec's light probe: theta = pi r
    GN_PROJECTION_MIRRORBALL = 2,
    GN_PROJECTION_FISHEYE_EQUIDISTANT = 3,
    GN_PROJECTION_FISHEYE_EQUISOLID = 4,
    GN_PROJECTION_FISHEYE_ORTHOGRAPHIC = 5,
    GN_PROJECTION_FISHEYE_STEREOGRAPHIC = 6,
    GN_PROJECTION_FISHEYE_KANNALA_BRANDT = 7, // r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9)
    GN_PROJECTION_COUNT
};

/** A projection of a picture of known size. A value; make it with gn_projection_init. */
struct gn_projection {
    enum gn_projection_type type;
    int width;        // px
    int height;       // px
    double center[2]; // px; default the middle of the picture
    double radius;    // px, of the circle at theta_max; default half the smaller side
    double theta_max; // rad, (0, pi]; default pi/2 for a fisheye, pi for angular and mirror ball
    double k[4];      // Kannala-Brandt only
    double focal;     // px; filled by init from radius and theta_max
};

/**
 * Fills what is zero with the defaults above, checks everything and derives focal.
 * Returns 0, or -EINVAL and a sentence (static string) in *out_reason: unknown type, a size out of
 * range, radius not finite, theta_max beyond the model's domain, a polynomial that is not monotone.
 */
GN_MUST_USE int gn_projection_init(struct gn_projection *projection, const char **out_reason);

/** "latlong", "angular", "mirrorball", "fisheye-equidistant", ...; NULL for a bad type. */
const char *gn_projection_get_name(enum gn_projection_type type);
/** The type of that name, or -EINVAL. */
GN_MUST_USE int gn_projection_from_name(const char *name, enum gn_projection_type *out_type);

/** Direction seen at picture position (x, y) px. False outside the picture's valid area. */
bool gn_projection_get_direction(const struct gn_projection *projection, double x, double y,
                                 double out_dir[static 3]);

/** Picture position px of unit direction dir. False where the picture does not show it. */
bool gn_projection_get_position(const struct gn_projection *projection, const double dir[static 3],
                                double out_xy[static 2]);

/**
 * Solid angle in sr of pixel (ix, iy), the part inside the valid circle: exact per row for
 * lat-long; for radial models the integral of sin(theta) / (f^2 rho rho') over the pixel, rim
 * pixels by their covered share. Sums to the shown solid angle within 1e-5. Source: change of
 * variables for radial lenses (dOmega/dA = sin(theta) / (f^2 rho(theta) rho'(theta))).
 */
double gn_projection_get_solid_angle(const struct gn_projection *projection, int ix, int iy);

/** True where the projection shows all 4 pi sr (lat-long; angular and mirror ball at theta_max pi).
 */
bool gn_projection_is_full_sphere(const struct gn_projection *projection);

#endif
