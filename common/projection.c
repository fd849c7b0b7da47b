/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/projection.h"

#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/cube_map.h"
#include "common/image.h"
#include "common/octahedral.h"

static const double pi = 3.14159265358979323846;

/* Of a theta_max. */
static const double pi_slack = GN_PROJECTION_MAX_THETA - 3.14159265358979323846;

static const char *const names[GN_PROJECTION_COUNT] = {
    [GN_PROJECTION_LATLONG] = "latlong",
    [GN_PROJECTION_ANGULAR] = "angular",
    [GN_PROJECTION_MIRRORBALL] = "mirrorball",
    [GN_PROJECTION_FISHEYE_EQUIDISTANT] = "fisheye-equidistant",
    [GN_PROJECTION_FISHEYE_EQUISOLID] = "fisheye-equisolid",
    [GN_PROJECTION_FISHEYE_ORTHOGRAPHIC] = "fisheye-orthographic",
    [GN_PROJECTION_FISHEYE_STEREOGRAPHIC] = "fisheye-stereographic",
    [GN_PROJECTION_FISHEYE_KANNALA_BRANDT] = "fisheye-kannala-brandt",
    [GN_PROJECTION_CUBE] = "cube",
    [GN_PROJECTION_OCTAHEDRAL] = "octahedral",
};

bool gn_projection_is_radial(enum gn_projection_type type)
{
    return type != GN_PROJECTION_LATLONG && type != GN_PROJECTION_CUBE &&
           type != GN_PROJECTION_OCTAHEDRAL;
}

const char *gn_projection_get_name(enum gn_projection_type type)
{
    return (unsigned)type < GN_PROJECTION_COUNT ? names[type] : NULL;
}

int gn_projection_from_name(const char *name, enum gn_projection_type *out_type)
{
    for (int i = 0; i < GN_PROJECTION_COUNT; i++) {
        if (strcmp(name, names[i]) == 0) {
            *out_type = (enum gn_projection_type)i;
            return 0;
        }
    }
    return -EINVAL;
}

/* Kannala-Brandt's rho(theta), an odd polynomial, and its slope. */
static double kb_rho(const double k[static 4], double t)
{
    double s = t * t;
    return t * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}

static double kb_slope(const double k[static 4], double t)
{
    double s = t * t;
    return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
}

/*
 * True where the quartic with Bernstein coefficients b on [0, 1] is positive: its coefficients
 * bound it, and halving the interval (de Casteljau) tightens them. A minimum so near to 0 that 40
 * halvings do not decide it counts as not positive.
 */
static bool is_positive(const double b[static 5], int depth)
{
    if (b[0] <= 0 || b[4] <= 0)
        return false;
    if (b[1] > 0 && b[2] > 0 && b[3] > 0)
        return true;
    if (depth == 0)
        return false;
    double left[5], right[5];
    memcpy(right, b, sizeof(right));
    for (int i = 0; i < 5; i++) {
        left[i] = right[0];
        for (int j = 0; j < 4 - i; j++)
            right[j] = 0.5 * (right[j] + right[j + 1]);
    }
    return is_positive(left, depth - 1) && is_positive(right, depth - 1);
}

/* True where a[0] + a[1] x + ... + a[4] x^4 is positive on all of [0, 1]. */
static bool is_polynomial_positive(const double a[static 5])
{
    static const double binomial[5][5] = {
        {1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}, {1, 4, 6, 4, 1}}; // [n][k]
    double b[5] = {0}; // b_i = sum over j <= i of C(i, j) / C(4, j) a_j
    for (int i = 0; i < 5; i++) {
        for (int j = 0; j <= i; j++)
            b[i] += binomial[i][j] / binomial[4][j] * a[j];
        if (!isfinite(b[i]))
            return false;
    }
    return is_positive(b, 40);
}

/* True where rho rises on all of [0, theta_max]. */
static bool kb_is_monotone(const double k[static 4], double theta_max)
{
    double s = theta_max * theta_max;
    return is_polynomial_positive((double[5]){1, 3 * k[0] * s, 5 * k[1] * s * s,
                                              7 * k[2] * s * s * s, 9 * k[3] * s * s * s * s});
}

/* The inverse of kb_rho on [0, theta_max]: Newton, kept inside its bracket by bisection. */
static double kb_theta(const double k[static 4], double theta_max, double rho)
{
    double low = 0, high = theta_max;
    double t = rho < theta_max ? rho : theta_max;
    for (int i = 0; i < 100; i++) {
        double error = kb_rho(k, t) - rho;
        if (error > 0)
            high = t;
        else
            low = t;
        double next = t - error / kb_slope(k, t);
        if (fabs(next - t) <= 1e-11 * theta_max) // the next step would be its square
            return fmin(fmax(next, 0), theta_max);
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        t = next;
    }
    return t;
}

/* rho(theta) = r / f of the radial models. */
static double get_rho(const struct gn_projection *p, double theta)
{
    switch (p->type) {
    case GN_PROJECTION_MIRRORBALL:
    case GN_PROJECTION_FISHEYE_EQUISOLID:
        return 2 * sin(0.5 * theta);
    case GN_PROJECTION_FISHEYE_ORTHOGRAPHIC:
        return sin(theta);
    case GN_PROJECTION_FISHEYE_STEREOGRAPHIC:
        return 2 * tan(0.5 * theta);
    case GN_PROJECTION_FISHEYE_KANNALA_BRANDT:
        return kb_rho(p->k, theta);
    default:
        return theta;
    }
}

static double get_theta(const struct gn_projection *p, double rho)
{
    switch (p->type) {
    case GN_PROJECTION_MIRRORBALL:
    case GN_PROJECTION_FISHEYE_EQUISOLID:
        return 2 * asin(fmin(0.5 * rho, 1));
    case GN_PROJECTION_FISHEYE_ORTHOGRAPHIC:
        return asin(fmin(rho, 1));
    case GN_PROJECTION_FISHEYE_STEREOGRAPHIC:
        return 2 * atan(0.5 * rho);
    case GN_PROJECTION_FISHEYE_KANNALA_BRANDT:
        return kb_theta(p->k, p->theta_max, rho);
    default:
        return rho;
    }
}

static const char *check_radial(struct gn_projection *p)
{
    bool is_whole = p->type == GN_PROJECTION_ANGULAR || p->type == GN_PROJECTION_MIRRORBALL;
    if (p->theta_max == 0)
        p->theta_max = is_whole ? pi : 0.5 * pi;
    if (!(p->theta_max > 0 && p->theta_max <= GN_PROJECTION_MAX_THETA))
        return "theta_max must lie in (0, pi]";
    p->theta_max = fmin(p->theta_max, pi);
    if (p->type == GN_PROJECTION_FISHEYE_ORTHOGRAPHIC) {
        if (p->theta_max > 0.5 * pi + pi_slack)
            return "an orthographic fisheye shows no more than theta_max pi/2";
        p->theta_max = fmin(p->theta_max, 0.5 * pi);
    }
    if (p->type == GN_PROJECTION_FISHEYE_STEREOGRAPHIC && p->theta_max > pi - 1e-3)
        return "a stereographic fisheye needs theta_max below pi";
    if (p->type == GN_PROJECTION_FISHEYE_KANNALA_BRANDT && !kb_is_monotone(p->k, p->theta_max))
        return "the Kannala-Brandt polynomial must rise on all of [0, theta_max]";
    const double *v = p->vignetting;
    if (!is_polynomial_positive((double[5]){1, v[0], v[1], v[2]}))
        return "the vignetting 1 + a r^2 + b r^4 + c r^6 must be above 0 for all r in [0, 1]";

    if (p->center[0] == 0 && p->center[1] == 0) {
        p->center[0] = 0.5 * p->width;
        p->center[1] = 0.5 * p->height;
    }
    double rho_max = get_rho(p, p->theta_max);
    if (!(p->focal >= 0 && isfinite(p->focal) && p->radius >= 0 && isfinite(p->radius)))
        return "radius and focal length must be finite and not negative";
    if (p->radius == 0)
        p->radius = p->focal > 0 ? p->focal * rho_max : 0.5 * fmin(p->width, p->height);
    double focal = p->radius / rho_max;
    if (p->focal != 0 && !(fabs(p->focal - focal) <= 1e-6 * focal))
        return "radius and focal length contradict each other; give one of them";
    p->focal = focal;
    if (!(p->radius >= 0.5 && p->radius <= 16.0 * GN_IMAGE_MAX_SIDE))
        return "radius must lie in [0.5, 262144] px";

    double dx = fmin(fmax(p->center[0], 0), p->width) - p->center[0];
    double dy = fmin(fmax(p->center[1], 0), p->height) - p->center[1];
    if (!(hypot(dx, dy) < p->radius)) // NaN too
        return "the circle of the fisheye lies outside the picture";
    return NULL;
}

int gn_projection_init(struct gn_projection *projection, const char **out_reason)
{
    struct gn_projection p = *projection;
    const char *reason = NULL;
    if ((unsigned)p.type >= GN_PROJECTION_COUNT) {
        reason = "unknown type of projection";
    } else if (p.width < 1 || p.width > GN_IMAGE_MAX_SIDE || p.height < 1 ||
               p.height > GN_IMAGE_MAX_SIDE || (long)p.width * p.height > GN_IMAGE_MAX_PIXELS) {
        reason = "the picture's sides must lie in [1, 16384] px, its pixels below 67108864";
    } else if (p.type == GN_PROJECTION_CUBE && p.height != GN_CUBE_FACES * p.width) {
        reason = "a cube map is six squares, one below the other: its height must be six times its "
                 "width";
    } else if (!gn_projection_is_radial(p.type)) {
        p = (struct gn_projection){.type = p.type,
                                   .width = p.width,
                                   .height = p.height,
                                   .center = {0.5 * p.width, 0.5 * p.height},
                                   .radius = 0.5 * p.height,
                                   .theta_max = pi,
                                   .focal = p.height / pi};
    } else {
        reason = check_radial(&p);
    }
    if (reason) {
        if (out_reason)
            *out_reason = reason;
        return -EINVAL;
    }
    *projection = p;
    return 0;
}

static bool is_inside(const struct gn_projection *p, double x, double y)
{
    return x >= 0 && x <= p->width && y >= 0 && y <= p->height;
}

/* Of the pictures that show the whole sphere edge to edge; (x, y) inside. */
static void get_sphere_direction(const struct gn_projection *p, double x, double y,
                                 double out_dir[static 3])
{
    if (p->type == GN_PROJECTION_CUBE) {
        double side = p->width;
        int face = (int)fmin(y / side, GN_CUBE_FACES - 1);
        gn_cube_map_to_direction(face, 2 * x / side - 1, 1 - 2 * (y - face * side) / side, out_dir);
    } else if (p->type == GN_PROJECTION_OCTAHEDRAL) {
        gn_octahedral_to_direction(x / p->width, y / p->height, out_dir);
    } else {
        double theta = pi * y / p->height, phi = pi - 2 * pi * x / p->width;
        out_dir[0] = sin(theta) * cos(phi);
        out_dir[1] = sin(theta) * sin(phi);
        out_dir[2] = cos(theta);
    }
}

static void get_sphere_position(const struct gn_projection *p, const double dir[static 3],
                                double out_xy[static 2])
{
    if (p->type == GN_PROJECTION_CUBE) {
        double st[2];
        int face = gn_cube_map_from_direction(dir, st);
        out_xy[0] = 0.5 * (1 + st[0]) * p->width;
        // A face's lower edge is the upper edge of the next square, which looks elsewhere.
        double end = nextafter((face + 1.0) * p->width, 0);
        out_xy[1] = fmin((face + 0.5 * (1 - st[1])) * p->width, end);
    } else if (p->type == GN_PROJECTION_OCTAHEDRAL) {
        double uv[2];
        gn_octahedral_from_direction(dir, uv);
        out_xy[0] = uv[0] * p->width;
        out_xy[1] = uv[1] * p->height;
    } else {
        double x = (pi - atan2(dir[1], dir[0])) / (2 * pi) * p->width;
        out_xy[0] = x >= p->width ? 0 : x; // phi = -pi is phi = pi
        out_xy[1] = fmin(atan2(hypot(dir[0], dir[1]), dir[2]) / pi, 1) * p->height;
    }
}

bool gn_projection_get_direction(const struct gn_projection *projection, double x, double y,
                                 double out_dir[static 3])
{
    const struct gn_projection *p = projection;
    if (!is_inside(p, x, y))
        return false;
    if (!gn_projection_is_radial(p->type)) {
        get_sphere_direction(p, x, y, out_dir);
        return true;
    }
    double dx = x - p->center[0], dy = y - p->center[1], r = hypot(dx, dy);
    if (r > p->radius * (1 + 1e-12)) // what get_position gives of the rim lies on it
        return false;
    double theta = fmin(get_theta(p, r / p->focal), p->theta_max);
    double scale = r > 0 ? sin(theta) / r : 0;
    out_dir[0] = scale * dx;
    out_dir[1] = scale * (p->type == GN_PROJECTION_MIRRORBALL ? -dy : dy);
    out_dir[2] = cos(theta);
    return true;
}

bool gn_projection_get_position(const struct gn_projection *projection, const double dir[static 3],
                                double out_xy[static 2])
{
    const struct gn_projection *p = projection;
    double xy[2];
    if (!gn_projection_is_radial(p->type)) {
        get_sphere_position(p, dir, xy);
    } else {
        double sin_theta = hypot(dir[0], dir[1]), theta = atan2(sin_theta, dir[2]);
        if (!(theta <= p->theta_max))
            return false;
        double r = fmin(p->focal * get_rho(p, theta), p->radius);
        double ux = sin_theta > 0 ? dir[0] / sin_theta : 1;
        double uy = sin_theta > 0 ? dir[1] / sin_theta : 0;
        xy[0] = p->center[0] + r * ux;
        xy[1] = p->center[1] + (p->type == GN_PROJECTION_MIRRORBALL ? -r * uy : r * uy);
    }
    if (!is_inside(p, xy[0], xy[1])) // NaN too
        return false;
    out_xy[0] = xy[0];
    out_xy[1] = xy[1];
    return true;
}

/* (1 - cos theta) / r^2 in px^-2 at r = rho f: smooth, 1/(2 f^2) in the middle. */
static double get_cap_density(const struct gn_projection *p, double rho)
{
    double ff = p->focal * p->focal;
    switch (p->type) {
    case GN_PROJECTION_MIRRORBALL:
    case GN_PROJECTION_FISHEYE_EQUISOLID:
        return 0.5 / ff;
    case GN_PROJECTION_FISHEYE_STEREOGRAPHIC:
        return 0.5 / (ff * (1 + 0.25 * rho * rho));
    default:
        break;
    }
    if (rho < 1e-8)
        return 0.5 / ff;
    double s = sin(0.5 * get_theta(p, rho)) / rho;
    return 2 * s * s / ff;
}

/* Antiderivative in s of sqrt(1 - r^2/f^2) a / (a^2 + s^2), r^2 = a^2 + s^2 <= f^2, a > 0. */
static double get_orthographic_part(double f, double a, double s)
{
    double half_chord = sqrt(fmax(f * f - a * a, 0));
    if (half_chord == 0)
        return 0;
    double t = fmin(fmax(s / half_chord, -1), 1);
    return atan2(f * s, a * half_chord * sqrt(1 - t * t)) - a / f * asin(t);
}

/*
 * The part of the contour integral of (1 - cos theta) dpsi that lies inside the circle: along the
 * line at distance a > 0 from the middle, from s0 to s1; dpsi = a ds / (a^2 + s^2).
 */
static double integrate_inside(const struct gn_projection *p, double a, double s0, double s1)
{
    if (p->type == GN_PROJECTION_FISHEYE_ORTHOGRAPHIC) // a root at the rim: in closed form
        return atan2(s1, a) - atan2(s0, a) -
               (get_orthographic_part(p->focal, a, s1) - get_orthographic_part(p->focal, a, s0));
    /* Gauss-Legendre with 4 nodes; the integrand is smooth over a pixel. */
    static const double node[2] = {0.33998104358485626, 0.86113631159405258};
    static const double weight[2] = {0.65214515486254614, 0.34785484513745386};
    double middle = 0.5 * (s0 + s1), half = 0.5 * (s1 - s0), sum = 0;
    for (int i = 0; i < 2; i++) {
        double left = middle - half * node[i], right = middle + half * node[i];
        sum += weight[i] * (get_cap_density(p, sqrt(a * a + left * left) / p->focal) +
                            get_cap_density(p, sqrt(a * a + right * right) / p->focal));
    }
    return sum * half * a;
}

/* The integral of (1 - cos min(theta, theta_max)) dpsi along one edge of a pixel, s0 < s1. */
static double integrate_edge(const struct gn_projection *p, double a, double s0, double s1)
{
    if (a == 0)
        return 0;
    if (a < 0)
        return -integrate_edge(p, -a, s0, s1);
    double rr = p->radius * p->radius - a * a;
    double chord = rr > 0 ? sqrt(rr) : 0;
    double in0 = fmin(fmax(s0, -chord), chord), in1 = fmin(fmax(s1, -chord), chord);
    double rim = 1 - cos(p->theta_max), sum = 0;
    if (s0 < in0)
        sum += rim * (atan2(fmin(in0, s1), a) - atan2(s0, a));
    if (in0 < in1)
        sum += integrate_inside(p, a, in0, in1);
    if (in1 < s1)
        sum += rim * (atan2(s1, a) - atan2(fmax(in1, s0), a));
    return sum;
}

double gn_projection_get_solid_angle(const struct gn_projection *projection, int ix, int iy)
{
    const struct gn_projection *p = projection;
    if (p->type == GN_PROJECTION_LATLONG) // cos a - cos b = 2 sin((a + b) / 2) sin((b - a) / 2)
        return 4 * pi / p->width * sin(pi * (iy + 0.5) / p->height) * sin(0.5 * pi / p->height);
    if (p->type == GN_PROJECTION_OCTAHEDRAL)
        return 4 * pi / p->width / p->height;
    if (p->type == GN_PROJECTION_CUBE) {
        double step = 2.0 / p->width, s = ix * step - 1, t = iy % p->width * step - 1;
        return gn_cube_map_get_solid_angle(s, t, s + step, t + step); // alike upside down
    }
    double x0 = ix - p->center[0], y0 = iy - p->center[1], x1 = x0 + 1, y1 = y0 + 1;
    double near_x = fmax(fmax(x0, -x1), 0), near_y = fmax(fmax(y0, -y1), 0);
    if (near_x * near_x + near_y * near_y >= p->radius * p->radius)
        return 0;
    double sum = integrate_edge(p, x1, y0, y1) - integrate_edge(p, x0, y0, y1) +
                 integrate_edge(p, y1, x0, x1) - integrate_edge(p, y0, x0, x1);
    return fmax(sum, 0);
}

bool gn_projection_has_vignetting(const struct gn_projection *projection)
{
    const double *v = projection->vignetting;
    return v[0] != 0 || v[1] != 0 || v[2] != 0;
}

double gn_projection_get_vignetting(const struct gn_projection *projection, double x, double y)
{
    const double *v = projection->vignetting, *center = projection->center;
    double r = fmin(hypot(x - center[0], y - center[1]) / projection->radius, 1), s = r * r;
    return 1 + s * (v[0] + s * (v[1] + s * v[2]));
}

/* From one face's pixel to the one at (x, y) of that face, which may be beyond one of its edges. */
static bool step_on_cube(int side, int face, int x, int y, int xy[static 2])
{
    bool is_beside = x < 0 || x >= side, is_above = y < 0 || y >= side;
    if (is_beside && is_above)
        return false;
    if (is_beside || is_above) {
        double st[2];
        face = gn_cube_map_cross_edge(face, (2.0 * x + 1) / side - 1, 1 - (2.0 * y + 1) / side, st);
        x = (int)floor(0.5 * (1 + st[0]) * side);
        y = (int)floor(0.5 * (1 - st[1]) * side);
    }
    xy[0] = x;
    xy[1] = face * side + y;
    return true;
}

/* Where i arrives that turns back at the borders of [0, n). */
static int fold(int i, int n)
{
    return i < 0 ? -1 - i : i >= n ? 2 * n - 1 - i : i;
}

bool gn_projection_step(const struct gn_projection *projection, int dx, int dy, int xy[static 2])
{
    const struct gn_projection *p = projection;
    int x = xy[0] + dx, y = xy[1] + dy, width = p->width, height = p->height;
    if (p->type == GN_PROJECTION_CUBE)
        return step_on_cube(width, xy[1] / width, x, xy[1] % width + dy, xy);
    bool is_beside = x < 0 || x >= width, is_above = y < 0 || y >= height;
    if (p->type == GN_PROJECTION_LATLONG) {
        x += is_above ? width / 2 : 0; // over the pole
        x = (x % width + width) % width;
        y = fold(y, height);
    } else if (p->type == GN_PROJECTION_OCTAHEDRAL) { // each half of a side meets the other
        x = fold(x, width);
        y = fold(y, height);
        if (is_beside)
            y = height - 1 - y;
        if (is_above)
            x = width - 1 - x;
    }
    if (x < 0 || x >= width || y < 0 || y >= height)
        return false;
    xy[0] = x;
    xy[1] = y;
    return true;
}

bool gn_projection_is_full_sphere(const struct gn_projection *projection)
{
    const struct gn_projection *p = projection;
    if (!gn_projection_is_radial(p->type))
        return true;
    double slack = 1e-6 * p->radius;
    return p->theta_max >= pi - pi_slack && p->center[0] >= p->radius - slack &&
           p->center[1] >= p->radius - slack && p->width - p->center[0] >= p->radius - slack &&
           p->height - p->center[1] >= p->radius - slack;
}
