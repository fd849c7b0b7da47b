/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Directions to pixels and back for every kind of environment frame, with exact solid angles.
 * Directions are unit vectors in the frame of the picture:
 *   fisheye, angular map: x right, y down, z along the optical axis (the middle of the picture);
 *   mirror ball: x right, y up, seen along -z: the middle of the ball reflects +z, its rim -z;
 *   lat-long: z up, row 0 is +z; picture position (u, v) in [0, 1]^2 is theta = pi v,
 *     phi = pi - 2 pi u, d = (sin theta cos phi, sin theta sin phi, cos theta): the middle looks
 *     along +x, the right half towards -y;
 *   cube: the axes of lat-long; six square faces one below the other (common/cube_map.h);
 *   octahedral, equal-area: the axes of a fisheye; the middle of the picture shows +z, its corners
 *     -z (common/octahedral.h).
 * Pixel centres lie at half-integers: the centre of pixel (0, 0) is (0.5, 0.5).
 */
#ifndef GN_COMMON_PROJECTION_H
#define GN_COMMON_PROJECTION_H

#include <stdbool.h>

#include "proto/attr.h"

/** rad: pi and what a float32 or a file's seven digits add to it; gn_projection_init cuts that off.
 */
#define GN_PROJECTION_MAX_THETA 3.1415936535897932

enum gn_projection_type {
    GN_PROJECTION_LATLONG = 0,
    GN_PROJECTION_ANGULAR = 1,                // Debevec's light probe: theta = pi r
    GN_PROJECTION_MIRRORBALL = 2,             // seen from far: r = R sin(theta / 2)
    GN_PROJECTION_FISHEYE_EQUIDISTANT = 3,    // r = f t
    GN_PROJECTION_FISHEYE_EQUISOLID = 4,      // r = 2 f sin(t / 2)
    GN_PROJECTION_FISHEYE_ORTHOGRAPHIC = 5,   // r = f sin t
    GN_PROJECTION_FISHEYE_STEREOGRAPHIC = 6,  // r = 2 f tan(t / 2)
    GN_PROJECTION_FISHEYE_KANNALA_BRANDT = 7, // r = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9)
    GN_PROJECTION_CUBE = 8,                   // height = 6 width
    GN_PROJECTION_OCTAHEDRAL = 9,             // every pixel 4 pi / (width height) sr
    GN_PROJECTION_COUNT
};

/** A projection of a picture of known size. A value; make it with gn_projection_init. */
struct gn_projection {
    enum gn_projection_type type;
    int width;  // px
    int height; // px
    // The rest is of the radial models (fisheyes, angular map, mirror ball); init overwrites it for
    // the others.
    double center[2]; // px; both 0: the middle of the picture
    double radius; // px, of the circle at theta_max; default from focal, or half the smaller side
    double theta_max; // rad, (0, pi]; default pi/2 for a fisheye, pi for angular and mirror ball
    double k[4];      // Kannala-Brandt only
    double focal;     // px; default from radius and theta_max
    // a, b, c of the lens's fall-off V(r) = 1 + a r^2 + b r^4 + c r^6, r in radii: linear radiance
    // is divided by it
    double vignetting[3];
};

/**
 * Fills what is zero with the defaults above and checks everything; twice is as once.
 * Returns 0, or -EINVAL and a sentence (static string) in *out_reason (may be NULL): unknown type,
 * a size out of range, a number not finite, theta_max beyond the model's domain (orthographic pi/2,
 * stereographic below pi), a polynomial that does not rise up to theta_max, a radius and a focal
 * length that contradict each other, a circle that misses the picture. *projection is untouched
 * then; or a cube map that is not six squares, a fall-off that is not above 0 on the whole circle.
 */
GN_MUST_USE int gn_projection_init(struct gn_projection *projection, const char **out_reason);

/** True for the pictures that are a circle: fisheyes, angular map, mirror ball. */
bool gn_projection_is_radial(enum gn_projection_type type);

/** The names of all types, in their order, as a list of choices. */
#define GN_PROJECTION_NAMES                                                                        \
    "latlong|angular|mirrorball|fisheye-equidistant|fisheye-equisolid|fisheye-orthographic|"       \
    "fisheye-stereographic|fisheye-kannala-brandt|cube|octahedral"

/** "latlong", "angular", "mirrorball", "fisheye-equidistant", ...; NULL for a bad type. */
const char *gn_projection_get_name(enum gn_projection_type type);
/** The type of that name, or -EINVAL. */
GN_MUST_USE int gn_projection_from_name(const char *name, enum gn_projection_type *out_type);

/**
 * Unit direction seen at picture position (x, y) px. False outside the picture's valid area (and
 * for NaN); out_dir is untouched then. Thread-safety of this and all below: safe.
 */
bool gn_projection_get_direction(const struct gn_projection *projection, double x, double y,
                                 double out_dir[static 3]);

/**
 * Picture position px of unit direction dir. False where the picture does not show it; out_xy is
 * untouched then. Where a whole rim shows one direction (-z at theta_max pi) it is the rim's point
 * at the right.
 */
bool gn_projection_get_position(const struct gn_projection *projection, const double dir[static 3],
                                double out_xy[static 2]);

/**
 * Solid angle in sr of pixel (ix, iy), the part inside the valid circle; 0 outside. Lat-long, cube
 * and octahedral: closed forms. Radial models: the integral of sin(theta) / (f^2 rho rho') over the
 * pixel, as the contour integral of (1 - cos theta) dpsi around it (Green's theorem; psi is the
 * azimuth), which needs no clipping at the rim. Pixels share their edges' integrals, so the sum
 * over a picture is the shown solid angle to rounding. ix in [0, width), iy in [0, height).
 */
double gn_projection_get_solid_angle(const struct gn_projection *projection, int ix, int iy);

/** True where the lens's fall-off is anything but 1. */
bool gn_projection_has_vignetting(const struct gn_projection *projection);

/** V at picture position (x, y) px, the rim's outside the circle; > 0. */
double gn_projection_get_vignetting(const struct gn_projection *projection, double x, double y);

/**
 * Moves *xy from a pixel by dx and dy, no more than the picture's or a cube's face's width and
 * height, as the sphere goes on: a lat-long closes at its sides and over its poles, an octahedral
 * map folds at its border, a cube's face meets the next. False, and *xy untouched, beyond the
 * picture, and beyond a cube's corner, where three faces meet and nothing lies diagonally.
 */
bool gn_projection_step(const struct gn_projection *projection, int dx, int dy, int xy[static 2]);

/** True where the picture shows all 4 pi sr: lat-long, cube, octahedral, and whole circles with
 * theta_max pi. */
bool gn_projection_is_full_sphere(const struct gn_projection *projection);

#endif
