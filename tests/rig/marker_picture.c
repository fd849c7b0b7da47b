/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/marker_picture.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

const double gn_rig_paper = 0.80, gn_rig_ink = 0.035, gn_rig_backdrop = 0.18;

enum { POINTS = 16 };

/** What a ray meets: its linear value, and a number that differs from cell to cell. */
struct met {
    double value;
    int what;
};

/** A sheet as the camera has it: its frame's origin and axes in the camera's. */
struct placed {
    const struct gn_rig_sheet *sheet;
    double eye[3];     // the camera's place in the sheet's frame
    double turn[3][3]; // sheet_from_camera
};

static void place(const struct gn_rig_view *view, const struct gn_rig_sheet *sheet,
                  struct placed *out)
{
    const double *w = view->world_from_camera, *s = sheet->world_from_sheet;
    out->sheet = sheet;
    for (int i = 0; i < 3; i++) {
        out->eye[i] = 0;
        for (int k = 0; k < 3; k++)
            out->eye[i] += s[4 * k + i] * (w[4 * k + 3] - s[4 * k + 3]);
        for (int j = 0; j < 3; j++) {
            out->turn[i][j] = 0;
            for (int k = 0; k < 3; k++)
                out->turn[i][j] += s[4 * k + i] * w[4 * k + j];
        }
    }
}

static struct met look(const struct placed *sheets, int n_sheets, double least_z,
                       const double ray[static 3])
{
    struct met met = {gn_rig_backdrop, 0};
    if (ray[2] < least_z) // outside a fisheye's circle
        return (struct met){0, -1};
    double nearest = INFINITY;
    for (int s = 0; s < n_sheets; s++) {
        const struct gn_rig_sheet *sheet = sheets[s].sheet;
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = sheets[s].turn[k][0] * ray[0] + sheets[s].turn[k][1] * ray[1] +
                   sheets[s].turn[k][2] * ray[2];
        const double *eye = sheets[s].eye;
        double t = -eye[2] / d[2];
        double x = eye[0] + t * d[0], y = eye[1] + t * d[1];
        if (!(eye[2] > 0 && t > 0 && t < nearest && fabs(x) <= sheet->half_width &&
              fabs(y) <= sheet->half_height))
            continue;
        nearest = t;
        met = (struct met){gn_rig_paper, 100000 * (s + 1)};
        for (int i = 0; i < sheet->n_printed; i++) {
            const struct gn_rig_printed *q = &sheet->printed[i];
            double u = (x - q->x) / q->size + 0.5, v = 0.5 - (y - q->y) / q->size;
            if (!(u >= 0 && u < 1 && v >= 0 && v < 1))
                continue;
            int cell = (int)(v * q->cells) * q->cells + (int)(u * q->cells);
            met.value = q->white[cell] ? gn_rig_paper : gn_rig_ink;
            met.what += 1 + 100 * i + cell;
        }
    }
    return met;
}

static int take_memory(struct gn_rig_marker_camera *camera, const struct gn_rig_view *view)
{
    size_t n = (size_t)(2 * view->width + 1) * (size_t)(2 * view->height + 1);
    *camera = (struct gn_rig_marker_camera){.view = *view};
    camera->rays = malloc(n * 3 * sizeof(*camera->rays));
    return camera->rays ? 0 : -ENOMEM;
}

int gn_rig_marker_camera_init(struct gn_rig_marker_camera *camera, const struct gn_rig_view *view)
{
    struct gn_rig_view still = *view;
    if (take_memory(camera, view) < 0)
        return -ENOMEM;
    for (int i = 0; i < 16; i++)
        still.world_from_camera[i] = i % 5 == 0;
    double *ray = camera->rays;
    for (int y = 0; y <= 2 * view->height; y++) {
        for (int x = 0; x <= 2 * view->width; x++, ray += 3) {
            double dir[3];
            gn_rig_view_get_ray(&still, 0.5 * x, 0.5 * y, dir);
            ray[0] = dir[0] / dir[2];
            ray[1] = dir[1] / dir[2];
            ray[2] = 1;
        }
    }
    return 0;
}

/** The angle from the axis at r = focal rho, by Newton's method; a little beyond theta_max at most.
 */
static double get_theta(const struct gn_rig_fisheye *lens, double rho)
{
    double t = rho;
    for (int i = 0; i < 8; i++) {
        double t2 = t * t, value = t * (1 + t2 * (lens->k[0] + t2 * lens->k[1])) - rho;
        t -= value / (1 + t2 * (3 * lens->k[0] + t2 * 5 * lens->k[1]));
    }
    return fmin(t, lens->theta_max + 0.05);
}

int gn_rig_marker_fisheye_init(struct gn_rig_marker_camera *camera,
                               const struct gn_rig_fisheye *lens)
{
    const struct gn_rig_view view = {
        .width = lens->width, .height = lens->height, .blur_px = lens->blur_px};
    if (take_memory(camera, &view) < 0)
        return -ENOMEM;
    double *ray = camera->rays;
    camera->least_z = cos(lens->theta_max);
    for (int y = 0; y <= 2 * lens->height; y++) {
        for (int x = 0; x <= 2 * lens->width; x++, ray += 3) {
            double dx = 0.5 * x - lens->center[0], dy = 0.5 * y - lens->center[1];
            double r = hypot(dx, dy), theta = get_theta(lens, r / lens->focal);
            ray[0] = r > 0 ? sin(theta) * dx / r : 0;
            ray[1] = r > 0 ? sin(theta) * dy / r : 0;
            ray[2] = cos(theta);
        }
    }
    return 0;
}

void gn_rig_marker_camera_finish(struct gn_rig_marker_camera *camera)
{
    free(camera->rays);
    *camera = (struct gn_rig_marker_camera){0};
}

/** The mean over a pixel; ray: at its top left corner. Between half pixels the lens is linear. */
static double get_mean(const struct placed *sheets, int n_sheets, double least_z, const double *ray,
                       long stride)
{
    double sum = 0;
    for (int i = 0; i < POINTS * POINTS; i++) {
        double u = 2 * (i % POINTS + 0.5) / POINTS, v = 2 * (i / POINTS + 0.5) / POINTS;
        const double *r = ray + 3 * ((v >= 1) * stride + (u >= 1));
        const double *s = r + 3 * stride;
        double p[3];
        u -= u >= 1;
        v -= v >= 1;
        for (int k = 0; k < 3; k++)
            p[k] = (1 - v) * ((1 - u) * r[k] + u * r[3 + k]) + v * ((1 - u) * s[k] + u * s[3 + k]);
        sum += look(sheets, n_sheets, least_z, p).value;
    }
    return sum / (POINTS * POINTS);
}

/** One pass of the normal point spread along x (step 1) or y (step width). */
static void blur_line(const float *in, float *out, int n, long step, double deviation)
{
    enum { MAX_REACH = 40 };
    double weight[MAX_REACH + 1], whole = 0;
    int reach = (int)fmin(MAX_REACH, ceil(4 * deviation));
    for (int k = 0; k <= reach; k++) {
        weight[k] = exp(-0.5 * k * k / (deviation * deviation));
        whole += k ? 2 * weight[k] : weight[k];
    }
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int k = -reach; k <= reach; k++) {
            int at = i + k < 0 ? 0 : i + k >= n ? n - 1 : i + k;
            sum += weight[abs(k)] * (double)in[at * step];
        }
        out[i * step] = (float)(sum / whole);
    }
}

/** mean[height][width] of each pixel's square. */
static void expose(const struct gn_rig_marker_camera *camera, const struct placed *sheets,
                   int n_sheets, struct met *met, float *mean)
{
    long w = camera->view.width, h = camera->view.height, stride = 2 * w + 1;
    for (long i = 0; i < stride * (2 * h + 1); i++)
        met[i] = look(sheets, n_sheets, camera->least_z, camera->rays + 3 * i);
    for (long i = 0; i < w * h; i++) {
        long at = 2 * (i / w) * stride + 2 * (i % w);
        bool is_even = true;
        for (int k = 0; k < 9; k++)
            is_even = is_even && met[at + k / 3 * stride + k % 3].what == met[at].what;
        mean[i] = (float)(is_even ? met[at].value
                                  : get_mean(sheets, n_sheets, camera->least_z,
                                             camera->rays + 3 * at, stride));
    }
}

int gn_rig_take_markers(const struct gn_rig_marker_camera *camera,
                        const struct gn_rig_sheet *sheets, int n_sheets,
                        struct gn_image *out_linear)
{
    long w = camera->view.width, h = camera->view.height;
    struct placed *placed = calloc((size_t)n_sheets + 1, sizeof(*placed));
    struct met *met = malloc((size_t)((2 * w + 1) * (2 * h + 1)) * sizeof(*met));
    float *mean = malloc((size_t)(w * h) * sizeof(*mean));
    float *spread = malloc((size_t)(w * h) * sizeof(*spread));
    int err =
        placed && met && mean && spread ? gn_image_init(out_linear, (int)w, (int)h, 3) : -ENOMEM;
    if (err)
        goto out;
    for (int i = 0; i < n_sheets; i++)
        place(&camera->view, &sheets[i], &placed[i]);
    expose(camera, placed, n_sheets, met, mean);
    double blur_px = camera->view.blur_px;
    for (long y = 0; y < h && blur_px > 0; y++)
        blur_line(mean + y * w, spread + y * w, (int)w, 1, blur_px);
    for (long x = 0; x < w && blur_px > 0; x++)
        blur_line(spread + x, mean + x, (int)h, w, blur_px);
    for (long i = 0; i < 3 * w * h; i++)
        out_linear->data[i] = mean[i / 3];
out:
    free(placed);
    free(met);
    free(mean);
    free(spread);
    return err;
}
