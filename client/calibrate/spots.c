/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/calibrate/spots.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "client/calibrate/solve.h"
#include "common/compare.h"

#define PI 3.14159265358979323846
#define MAX_RAYS 720
#define TRIPLES 400

static double get(const struct gn_image *image, int x, int y)
{
    float v = *gn_image_at(image, x, y);
    return isfinite(v) ? (double)v : 0;
}

/* Collects the pixels connected to `seed`; marks them in seen. */
static struct gn_spot flood(const struct gn_image *image, double bound, int seed, uint8_t *seen,
                            int *stack)
{
    struct gn_spot spot = {{0}, 0, 0};
    int n = 0;
    stack[n++] = seed;
    seen[seed] = 1;
    while (n > 0) {
        int at = stack[--n], x = at % image->width, y = at / image->width;
        double above = get(image, x, y) - bound;
        spot.xy[0] += above * (x + 0.5);
        spot.xy[1] += above * (y + 0.5);
        spot.light += above;
        spot.n_pixels++;
        for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < image->height; v++)
            for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < image->width; u++) {
                int next = v * image->width + u;
                if (!seen[next] && get(image, u, v) > bound) {
                    seen[next] = 1;
                    stack[n++] = next;
                }
            }
    }
    spot.xy[0] /= spot.light;
    spot.xy[1] /= spot.light;
    return spot;
}

static void insert(struct gn_spot *spots, int *n, int max, const struct gn_spot *spot)
{
    int at = *n;
    while (at > 0 && spots[at - 1].light < spot->light)
        at--;
    if (at >= max)
        return;
    int last = *n < max ? *n : max - 1;
    memmove(spots + at + 1, spots + at, (size_t)(last - at) * sizeof(*spots));
    spots[at] = *spot;
    *n = last + 1;
}

int gn_spots_find(const struct gn_image *light, double share, int max, struct gn_spot *out_spots)
{
    size_t pixels = (size_t)light->width * (size_t)light->height;
    int n = 0;
    double largest = 0;
    for (size_t i = 0; i < pixels; i++)
        largest = isfinite(light->data[i]) ? fmax(largest, (double)light->data[i]) : largest;
    uint8_t *seen = calloc(pixels, 1);
    int *stack = malloc(pixels * sizeof(*stack));
    for (size_t i = 0; seen && stack && largest > 0 && i < pixels; i++) {
        if (seen[i] || !isfinite(light->data[i]) || !((double)light->data[i] > share * largest))
            continue;
        struct gn_spot spot = flood(light, share * largest, (int)i, seen, stack);
        if ((size_t)spot.n_pixels <= pixels / 10 && spot.light > 0)
            insert(out_spots, &n, max, &spot);
    }
    bool has_memory = seen && stack;
    free(seen);
    free(stack);
    return has_memory ? n : -ENOMEM;
}

/* Least squares over the points within tolerance of *circle: Gauss-Newton on the distances. */
static int refine(const double *xy, int n, double tolerance, struct gn_circle *circle)
{
    double a[3 * MAX_RAYS], b[MAX_RAYS], step[3];
    for (int round = 0; round < 20; round++) {
        int m = 0;
        double sum = 0;
        for (int i = 0; i < n && m < MAX_RAYS; i++) {
            double dx = xy[2 * i] - circle->center[0], dy = xy[2 * i + 1] - circle->center[1];
            double d = hypot(dx, dy), e = d - circle->radius;
            if (fabs(e) > tolerance || !(d > 0))
                continue;
            a[3 * m] = dx / d;
            a[3 * m + 1] = dy / d;
            a[3 * m + 2] = 1;
            b[m++] = e;
            sum += e * e;
        }
        circle->n_points = m;
        circle->rms = m > 0 ? sqrt(sum / m) : 0;
        if (m < 3 || gn_solve_least_squares(a, b, m, 3, step) < 0)
            return -EDOM;
        circle->center[0] += step[0];
        circle->center[1] += step[1];
        circle->radius += step[2];
    }
    return 0;
}

/* The circle through three points; false where they lie on a line. */
static bool pass_through(const double *p, const double *q, const double *r, struct gn_circle *out)
{
    double ax = q[0] - p[0], ay = q[1] - p[1], bx = r[0] - p[0], by = r[1] - p[1];
    double det = 2 * (ax * by - ay * bx), a2 = ax * ax + ay * ay, b2 = bx * bx + by * by;
    if (fabs(det) < 1e-6 * sqrt(a2 * b2) || det == 0)
        return false;
    double ux = (by * a2 - ay * b2) / det, uy = (ax * b2 - bx * a2) / det;
    *out = (struct gn_circle){{p[0] + ux, p[1] + uy}, hypot(ux, uy), 0, 0};
    return true;
}

int gn_circle_fit(const double *xy, int n, double tolerance, struct gn_circle *out_circle,
                  struct gn_error *out_error)
{
    struct gn_circle best = {{0}, 0, 0, 0};
    uint32_t random = 12345;
    for (int i = 0; i < TRIPLES && n >= 3; i++) {
        int pick[3];
        for (int k = 0; k < 3; k++) {
            random = random * 1664525u + 1013904223u;
            pick[k] = (int)((uint64_t)random * (uint64_t)n >> 32);
        }
        struct gn_circle tried;
        if (!pass_through(xy + 2 * pick[0], xy + 2 * pick[1], xy + 2 * pick[2], &tried))
            continue;
        for (int k = 0; k < n; k++)
            tried.n_points +=
                fabs(hypot(xy[2 * k] - tried.center[0], xy[2 * k + 1] - tried.center[1]) -
                     tried.radius) < tolerance;
        if (tried.n_points > best.n_points)
            best = tried;
    }
    if (3 * best.n_points < n || n < 12 || refine(xy, n, tolerance, &best) < 0 ||
        refine(xy, n, tolerance, &best) < 0 || 3 * best.n_points < n)
        return gn_error_set(out_error, -EDOM,
                            "%d of %d points of an outline lie on one circle, at least a third is "
                            "needed",
                            best.n_points, n);
    *out_circle = best;
    return 0;
}

/* The code at a position, between pixel centres; false outside. */
static bool sample(const struct gn_image *image, double x, double y, double *out)
{
    double u = x - 0.5, v = y - 0.5;
    int i = (int)floor(u), j = (int)floor(v);
    if (i < 0 || j < 0 || i + 1 >= image->width || j + 1 >= image->height)
        return false;
    double s = u - i, t = v - j;
    *out = (1 - t) * ((1 - s) * get(image, i, j) + s * get(image, i + 1, j)) +
           t * ((1 - s) * get(image, i, j + 1) + s * get(image, i + 1, j + 1));
    return true;
}

/* Dark and typical code: the 2nd percentile and the median of what is above twice that. */
static int find_levels(const struct gn_image *image, double *out_dark, double *out_typical)
{
    int n = image->width * image->height, above = 0;
    float *values = malloc((size_t)n * sizeof(*values));
    if (!values)
        return -ENOMEM;
    for (int i = 0; i < n; i++)
        values[i] = isfinite(image->data[i]) ? image->data[i] : 0;
    qsort(values, (size_t)n, sizeof(*values), gn_compare_floats);
    *out_dark = (double)values[n / 50];
    double bound = *out_dark + 0.02 * ((double)values[n - 1 - n / 100] - *out_dark);
    while (above < n && (double)values[above] <= bound)
        above++;
    *out_typical = (double)values[above + (n - above) / 4 < n ? above + (n - above) / 4 : n - 1];
    free(values);
    return 0;
}

/* The mean along a ray, over what the picture shows of it; NAN: nothing. */
static double get_mean(const struct gn_image *image, const double from[2], const double way[2],
                       double near, double far)
{
    double sum = 0, v;
    int n = 0;
    for (double r = near; r <= far; r += 0.5)
        if (sample(image, from[0] + r * way[0], from[1] + r * way[1], &v)) {
            sum += v;
            n++;
        }
    return n > 0 ? sum / n : NAN;
}

/* Moves r along a ray to where the light is halfway between what lies inside and outside there; it
 * stays where the picture does not show both. */
static double refine_edge(const struct gn_image *light, const double from[2], const double way[2],
                          double r)
{
    double reach = fmax(4, 0.02 * r), before = NAN, now;
    double inside = get_mean(light, from, way, r - 2 * reach, r - reach);
    double outside = get_mean(light, from, way, r + reach, r + 2 * reach);
    double half = (inside + outside) / 2;
    if (!(inside > 2 * outside))
        return r;
    for (double at = r + reach; at > r - reach; at -= 0.25, before = now) {
        if (!sample(light, from[0] + at * way[0], from[1] + at * way[1], &now))
            now = NAN;
        if (now > half && before <= half)
            return at + 0.25 * (now - half) / (now - before);
    }
    return r;
}

int gn_circle_find_disc(const struct gn_image *codes, const struct gn_image *light,
                        struct gn_circle *out_circle, struct gn_error *out_error)
{
    double dark, typical, points[2 * MAX_RAYS], centre[2] = {0}, n_bright = 0;
    if (find_levels(codes, &dark, &typical) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    double bound = (dark + typical) / 2;
    for (int y = 0; y < codes->height; y++)
        for (int x = 0; x < codes->width; x++)
            if (get(codes, x, y) > bound) {
                centre[0] += x + 0.5;
                centre[1] += y + 0.5;
                n_bright++;
            }
    int n = 0;
    // From outside inwards: what is dark within the circle does not end it.
    for (int ray = 0; ray < 360 && n_bright > 0; ray++) {
        const double from[2] = {centre[0] / n_bright, centre[1] / n_bright};
        const double way[2] = {cos(ray * PI / 180), sin(ray * PI / 180)};
        double before = NAN, now;
        for (double r = hypot(codes->width, codes->height); r > 1; r -= 0.5) {
            if (!sample(codes, from[0] + r * way[0], from[1] + r * way[1], &now))
                continue;
            if (now > bound) {
                if (before < bound) { // not cut off by the picture's edge
                    double edge =
                        refine_edge(light, from, way, r + 0.5 * (now - bound) / (now - before));
                    points[2 * n] = from[0] + edge * way[0];
                    points[2 * n++ + 1] = from[1] + edge * way[1];
                }
                break;
            }
            before = now;
        }
    }
    struct gn_error why = {0};
    if (gn_circle_fit(points, n, 1.5, out_circle, &why) < 0)
        return gn_error_set(out_error, -EDOM,
                            "no image circle in a dark surround is seen (%s); write \"center\" "
                            "and \"radius\", in px, into probe.json instead of --find-circle",
                            why.text);
    return 0;
}

int gn_circle_find_ball(const struct gn_image *codes, const struct gn_circle *guess,
                        struct gn_circle *out_circle, struct gn_error *out_error)
{
    struct gn_circle circle = *guess;
    struct gn_error why = {0};
    double width = 0.3; // of the search, in radii
    for (int round = 0; round < 3; round++, width *= 0.35) {
        double points[2 * MAX_RAYS];
        int n = 0;
        for (int ray = 0; ray < MAX_RAYS; ray++) {
            double dx = cos(2 * PI * ray / MAX_RAYS), dy = sin(2 * PI * ray / MAX_RAYS);
            double best = 0, best_r = 0, in, out;
            for (double r = (1 - width) * circle.radius; r <= (1 + width) * circle.radius;
                 r += 0.25) {
                if (!sample(codes, circle.center[0] + (r - 1) * dx, circle.center[1] + (r - 1) * dy,
                            &in) ||
                    !sample(codes, circle.center[0] + (r + 1) * dx, circle.center[1] + (r + 1) * dy,
                            &out))
                    continue;
                if (fabs(in - out) > best) {
                    best = fabs(in - out);
                    best_r = r;
                }
            }
            if (best > 0) {
                points[2 * n] = circle.center[0] + best_r * dx;
                points[2 * n++ + 1] = circle.center[1] + best_r * dy;
            }
        }
        if (gn_circle_fit(points, n, round == 0 ? 0.02 * circle.radius + 1 : 1.5, &circle, &why) <
            0)
            return gn_error_set(out_error, -EDOM,
                                "no ball is seen near (%.0f, %.0f) with radius %.0f px: %s",
                                guess->center[0], guess->center[1], guess->radius, why.text);
    }
    *out_circle = circle;
    return 0;
}
