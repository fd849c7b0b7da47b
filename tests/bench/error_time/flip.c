/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Two pipelines. Colour: the pictures in an opponent space whose axes are linear in light, blurred
 * by the eye's contrast sensitivity, then compared in Hunt-adjusted L*a*b* by the HyAB distance,
 * which is bent so that large differences count alike. Features: edges and points of the luminance.
 * FLIP = colour difference ^ (1 - feature difference).
 */
#include "tests/bench/error_time/flip.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

static const double pi = 3.14159265358979323846;

// Section 4: bending of the colour difference, and the size in degrees and exponent of features.
static const double q_color = 0.7, p_color = 0.4, p_target = 0.95;
static const double feature_width_deg = 0.082, q_feature = 0.5;

/** Contrast sensitivity of a channel in space: sum of a sqrt(pi / b) exp(-pi^2 x^2 / b), x in
 * degrees (table 1 of the paper: achromatic, red-green, blue-yellow). */
static const struct sensitivity {
    double a[2], b[2];
} sensitivities[3] = {
    {{1, 0}, {0.0047, 1e-5}}, {{1, 0}, {0.0053, 1e-5}}, {{34.1, 13.5}, {0.04, 0.025}}};

// IEC 61966-2-1, linear RGB to XYZ of D65, and back.
static const double xyz_from_rgb[3][3] = {{0.4124564, 0.3575761, 0.1804375},
                                          {0.2126729, 0.7151522, 0.0721750},
                                          {0.0193339, 0.1191920, 0.9503041}};
static const double rgb_from_xyz[3][3] = {{3.2404542, -1.5371385, -0.4985314},
                                          {-0.9692660, 1.8760108, 0.0415560},
                                          {0.0556434, -0.2040259, 1.0572252}};

enum { MAX_RADIUS = 256 };

/** A kernel of one dimension. */
struct kernel {
    int radius;
    double weight[2 * MAX_RADIUS + 1];
};

/** One picture on its way; planes of width * height. */
struct view {
    int width, height;
    double *opponent[3]; // Y_y, C_x, C_z, then L*, a, b
    double *edge, *point;
    double *scratch[2];
    double *block; // owns all of them
};

static void multiply(const double m[static 3][3], const double v[static 3], double out[static 3])
{
    double r[3];
    for (int i = 0; i < 3; i++)
        r[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    for (int i = 0; i < 3; i++)
        out[i] = r[i];
}

static double get_white(int i)
{
    return xyz_from_rgb[i][0] + xyz_from_rgb[i][1] + xyz_from_rgb[i][2];
}

/** The linearised L*a*b*: Y_y = 116 Y - 16, C_x = 500 (X - Y), C_z = 200 (Y - Z). */
static void to_opponent(const double rgb[static 3], double out[static 3])
{
    double xyz[3];
    multiply(xyz_from_rgb, rgb, xyz);
    for (int i = 0; i < 3; i++)
        xyz[i] /= get_white(i);
    out[0] = 116 * xyz[1] - 16;
    out[1] = 500 * (xyz[0] - xyz[1]);
    out[2] = 200 * (xyz[1] - xyz[2]);
}

static void from_opponent(const double opponent[static 3], double out_rgb[static 3])
{
    double y = (opponent[0] + 16) / 116;
    const double xyz[3] = {(y + opponent[1] / 500) * get_white(0), y * get_white(1),
                           (y - opponent[2] / 200) * get_white(2)};
    multiply(rgb_from_xyz, xyz, out_rgb);
    for (int i = 0; i < 3; i++)
        out_rgb[i] = fmin(fmax(out_rgb[i], 0), 1);
}

static double lab_curve(double t)
{
    const double d = 6.0 / 29;
    return t > d * d * d ? cbrt(t) : t / (3 * d * d) + 4.0 / 29;
}

/** CIELAB with Hunt's effect: chroma counts for less where it is dark. */
static void to_hunt_lab(const double rgb[static 3], double out[static 3])
{
    double f[3];
    multiply(xyz_from_rgb, rgb, f);
    for (int i = 0; i < 3; i++)
        f[i] = lab_curve(f[i] / get_white(i));
    out[0] = 116 * f[1] - 16;
    out[1] = 0.01 * out[0] * 500 * (f[0] - f[1]);
    out[2] = 0.01 * out[0] * 200 * (f[1] - f[2]);
}

static double get_hyab(const double a[static 3], const double b[static 3])
{
    return fabs(a[0] - b[0]) + hypot(a[1] - b[1], a[2] - b[2]);
}

/** The largest difference that counts: between green and blue. */
static double get_largest_difference(void)
{
    static const double green[3] = {0, 1, 0}, blue[3] = {0, 0, 1};
    double a[3], b[3];
    to_hunt_lab(green, a);
    to_hunt_lab(blue, b);
    return pow(get_hyab(a, b), q_color);
}

/** [0, largest] to [0, 1]: up to p_color of the largest fills p_target, the rest what is left. */
static double bend(double difference, double largest)
{
    double power = pow(difference, q_color), knee = p_color * largest;
    if (power < knee)
        return p_target / knee * power;
    return p_target + (power - knee) / (largest - knee) * (1 - p_target);
}

/** exp(-x^2 / (2 sd^2)) times 1, -x or x^2 / sd^2 - 1; positive and negative weights sum to 1 and
 * to -1. */
static struct kernel make_kernel(double sd, int radius, int derivative)
{
    struct kernel k = {.radius = radius < MAX_RADIUS ? radius : MAX_RADIUS};
    double sums[2] = {0};
    for (int x = -k.radius; x <= k.radius; x++) {
        double g = exp(-x * x / (2 * sd * sd));
        double w = derivative == 0 ? g : derivative == 1 ? -x * g : (x * x / (sd * sd) - 1) * g;
        k.weight[x + k.radius] = w;
        sums[w < 0] += fabs(w);
    }
    for (int i = 0; i <= 2 * k.radius; i++)
        k.weight[i] /= sums[k.weight[i] < 0] > 0 ? sums[k.weight[i] < 0] : 1;
    return k;
}

static int clamp(int i, int n)
{
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

/** Along x with one kernel, along y with the other; the border is repeated outwards. */
static void filter(const struct view *v, const double *in, const struct kernel *along_x,
                   const struct kernel *along_y, double *out)
{
    double *half = v->scratch[0];
    for (int y = 0; y < v->height; y++) {
        for (int x = 0; x < v->width; x++) {
            double sum = 0;
            for (int i = -along_x->radius; i <= along_x->radius; i++)
                sum += along_x->weight[i + along_x->radius] *
                       in[(size_t)y * (size_t)v->width + (size_t)clamp(x + i, v->width)];
            half[(size_t)y * (size_t)v->width + (size_t)x] = sum;
        }
    }
    for (int y = 0; y < v->height; y++) {
        for (int x = 0; x < v->width; x++) {
            double sum = 0;
            for (int i = -along_y->radius; i <= along_y->radius; i++)
                sum += along_y->weight[i + along_y->radius] *
                       half[(size_t)clamp(y + i, v->height) * (size_t)v->width + (size_t)x];
            out[(size_t)y * (size_t)v->width + (size_t)x] = sum;
        }
    }
}

/** out += scale * in. */
static void add_scaled(const struct view *v, const double *in, double scale, double *out)
{
    for (size_t i = 0; i < (size_t)v->width * (size_t)v->height; i++)
        out[i] += scale * in[i];
}

/** The two Gaussians of the channel, of weights in proportion to what they hold on the pixel grid;
 * together they sum to 1. */
static void blur(const struct view *v, const struct sensitivity *s, double pixels_per_degree,
                 double *plane, double *result)
{
    double widest = fmax(s->b[0], s->b[1]);
    int radius = (int)ceil(3 * sqrt(widest / (2 * pi * pi)) * pixels_per_degree);
    double weight[2] = {0};
    for (int i = 0; i < 2; i++) {
        double held = 0;
        for (int x = -radius; x <= radius; x++)
            held += exp(-pi * pi * x * x / (pixels_per_degree * pixels_per_degree * s->b[i]));
        weight[i] = s->a[i] * sqrt(pi / s->b[i]) * held * held;
    }
    for (size_t i = 0; i < (size_t)v->width * (size_t)v->height; i++)
        result[i] = 0;
    for (int i = 0; i < 2; i++) {
        if (!(weight[i] > 0))
            continue;
        struct kernel k = make_kernel(sqrt(s->b[i] / 2) / pi * pixels_per_degree, radius, 0);
        filter(v, plane, &k, &k, v->scratch[1]);
        add_scaled(v, v->scratch[1], weight[i] / (weight[0] + weight[1]), result);
    }
}

/** Length of the gradient, or of the second derivatives, of the luminance in [0, 1]. */
static void find_features(const struct view *v, double pixels_per_degree, int derivative,
                          const double *luminance, double *out)
{
    double sd = 0.5 * feature_width_deg * pixels_per_degree;
    int radius = (int)ceil(3 * sd);
    struct kernel smooth = make_kernel(sd, radius, 0);
    struct kernel change = make_kernel(sd, radius, derivative);
    filter(v, luminance, &change, &smooth, out);
    filter(v, luminance, &smooth, &change, v->scratch[1]);
    for (size_t i = 0; i < (size_t)v->width * (size_t)v->height; i++)
        out[i] = hypot(out[i], v->scratch[1][i]);
}

/** Everything of one picture. Returns 0 or -ENOMEM. */
static int view_init(struct view *v, const struct gn_image *image, double pixels_per_degree)
{
    size_t n = (size_t)image->width * (size_t)image->height;
    *v = (struct view){.width = image->width, .height = image->height};
    v->block = malloc(8 * n * sizeof(*v->block));
    if (!v->block)
        return -ENOMEM;
    for (size_t c = 0; c < 3; c++)
        v->opponent[c] = v->block + c * n;
    v->edge = v->block + 3 * n;
    v->point = v->block + 4 * n;
    v->scratch[0] = v->block + 5 * n;
    v->scratch[1] = v->block + 6 * n;
    double *spare = v->block + 7 * n;
    for (size_t i = 0; i < n; i++) {
        double rgb[3], opponent[3];
        for (size_t c = 0; c < 3; c++)
            rgb[c] = fmin(fmax((double)image->data[3 * i + c], 0), 1);
        to_opponent(rgb, opponent);
        for (size_t c = 0; c < 3; c++)
            v->opponent[c][i] = opponent[c];
        spare[i] = (opponent[0] + 16) / 116;
    }
    find_features(v, pixels_per_degree, 1, spare, v->edge);
    find_features(v, pixels_per_degree, 2, spare, v->point);
    for (int c = 0; c < 3; c++) {
        double *plane = v->opponent[c];
        blur(v, &sensitivities[c], pixels_per_degree, plane, spare);
        v->opponent[c] = spare;
        spare = plane;
    }
    for (size_t i = 0; i < n; i++) {
        const double opponent[3] = {v->opponent[0][i], v->opponent[1][i], v->opponent[2][i]};
        double rgb[3], lab[3];
        from_opponent(opponent, rgb);
        to_hunt_lab(rgb, lab);
        for (int c = 0; c < 3; c++)
            v->opponent[c][i] = lab[c];
    }
    return 0;
}

static double compare_at(const struct view *a, const struct view *b, size_t i, double largest)
{
    const double lab_a[3] = {a->opponent[0][i], a->opponent[1][i], a->opponent[2][i]};
    const double lab_b[3] = {b->opponent[0][i], b->opponent[1][i], b->opponent[2][i]};
    double color = bend(get_hyab(lab_a, lab_b), largest);
    double feature = fmax(fabs(a->edge[i] - b->edge[i]), fabs(a->point[i] - b->point[i]));
    return pow(color, 1 - pow(feature / sqrt(2), q_feature));
}

int gn_flip_compare(const struct gn_image *reference, const struct gn_image *test,
                    double pixels_per_degree, struct gn_image *out_map, double *out_mean)
{
    struct view a = {0}, b = {0};
    if (reference->width != test->width || reference->height != test->height ||
        reference->channels != 3 || test->channels != 3 || !(pixels_per_degree >= 1) ||
        !(pixels_per_degree <= 1000))
        return -EINVAL;
    int ret = view_init(&a, reference, pixels_per_degree);
    if (ret == 0)
        ret = view_init(&b, test, pixels_per_degree);
    if (ret == 0 && out_map)
        ret = gn_image_init(out_map, reference->width, reference->height, 1);
    if (ret == 0) {
        size_t n = (size_t)reference->width * (size_t)reference->height;
        double largest = get_largest_difference(), sum = 0;
        for (size_t i = 0; i < n; i++) {
            double difference = compare_at(&a, &b, i, largest);
            sum += difference;
            if (out_map)
                out_map->data[i] = (float)difference;
        }
        *out_mean = sum / (double)n;
    }
    free(a.block);
    free(b.block);
    return ret;
}
