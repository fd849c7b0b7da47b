/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/poses.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "client/feature.h"
#include "client/live.h"
#include "client/vision/markers.h"
#include "common/clock.h"
#include "common/device_json.h"
#include "common/json.h"
#include "common/png.h"

/** So many pictures in a row must say that something is wrong before that is told. */
enum { SURE_AFTER = 3 };
/** Between two lines that tell it. */
static const int64_t tell_interval_ns = INT64_C(20000000000);
/** A marker's side that is rather millimetres, m. */
#define LARGE_SIDE 1.0

struct gn_poses {
    struct gn_bodies bodies;
    struct gn_tracker *tracker;
    int world;          // its body
    const char *dir;    // for --debug-markers, borrowed; NULL: none
    FILE *log;          // NULL: none
    const char *source; // where the bodies are listed, borrowed
    int n_doubtful;     // pictures in a row that speak against that
    bool has_told;
    char doubt[768]; // told last
    int64_t told_ns;
    long n_damaged; // pictures of a camera
};

bool gn_poses_is_asked(const struct gn_options *options)
{
    return gn_options_is_set(options, NULL, NULL, "markers") ||
           gn_options_is_set(options, NULL, NULL, "marker");
}

const char *gn_poses_find_misuse(const struct gn_options *options)
{
    if (gn_options_is_set(options, NULL, NULL, "markers") &&
        gn_options_is_set(options, NULL, NULL, "marker"))
        return "give one of --markers FILE and --marker DICT:ID:SIZE";
    if (!gn_poses_is_asked(options) && (gn_options_is_set(options, NULL, NULL, "debug-markers") ||
                                        !gn_options_get_bool(options, NULL, NULL, "steady")))
        return "--debug-markers and --no-steady are for poses from markers: give --markers FILE or "
               "--marker DICT:ID:SIZE";
    return NULL;
}

int gn_poses_read_camera(const char *path, struct gn_camera *out_camera, bool *out_has_place,
                         struct gn_error *out_error)
{
    struct gn_json root;
    int err = gn_json_load_file(path, &root, out_error);
    if (err)
        return err;
    *out_has_place = gn_json_has(&root, "world_from_camera");
    err = gn_camera_read_json(&root, *out_has_place, out_camera, out_error);
    gn_json_finish(&root);
    return err;
}

int gn_poses_write_to(struct gn_poses *p, const char *dir, struct gn_error *out_error)
{
    char path[4096];
    int n = snprintf(path, sizeof(path), "%s/poses.jsonl", dir);
    if (n >= (int)sizeof(path))
        return gn_error_set(out_error, -ENAMETOOLONG, "%s: the path is too long", dir);
    p->log = fopen(path, "w");
    return p->log ? 0
                  : gn_error_set(out_error, -errno, "cannot write %s: %s", path, strerror(errno));
}

int64_t gn_poses_get_time_ns(const struct gn_capture *capture)
{
    return capture->time_ns ? capture->time_ns : (int64_t)llround(capture->time_s * 1e9);
}

void gn_poses_doubt_sizes(const struct gn_bodies *bodies, const char *source)
{
    for (int i = 0; i < bodies->n_bodies; i++) {
        for (int k = 0; k < bodies->bodies[i].n_markers; k++) {
            const struct gn_body_marker *m = &bodies->bodies[i].markers[k];
            const double(*c)[3] = m->corners_body;
            double side = sqrt(pow(c[1][0] - c[0][0], 2) + pow(c[1][1] - c[0][1], 2) +
                               pow(c[1][2] - c[0][2], 2));
            if (side > LARGE_SIDE * (1 + 1e-9)) {
                fprintf(stderr, "gnomon: %s: marker %d: sizes are in metres: %g m?\n", source,
                        m->id, side);
                return;
            }
        }
    }
}

int gn_poses_open(const struct gn_options *options, const struct gn_camera *camera,
                  const char *object, struct gn_poses **out_poses, struct gn_error *out_error)
{
    *out_poses = NULL;
    if (!gn_vision_is_built())
        return gn_feature_refuse(GN_FEATURE_VISION, out_error);
    const char *path = gn_options_get_string(options, NULL, NULL, "markers");
    struct gn_poses *p = calloc(1, sizeof(*p));
    if (!p)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    p->source = path ? path : "--marker";
    p->dir = gn_options_get_string(options, NULL, NULL, "debug-markers");
    int err = path ? gn_bodies_read_file(path, &p->bodies, out_error)
                   : gn_bodies_read_text(gn_options_get_string(options, NULL, NULL, "marker"),
                                         &p->bodies, out_error);
    if (!err && !path && object) {
        struct gn_body *b = &p->bodies.bodies[0];
        snprintf(b->name, sizeof(b->name), "%s", object);
    }
    if (!err)
        gn_poses_doubt_sizes(&p->bodies, p->source);
    p->world = gn_bodies_find(&p->bodies, GN_BODY_WORLD);
    const struct gn_tracker_options wanted = {
        .camera = camera,
        .bodies = &p->bodies,
        .is_live = gn_live_count_asked(options) > 0,
        .is_raw = object || !gn_options_get_bool(options, NULL, NULL, "steady")};
    if (!err)
        err = gn_tracker_create(&wanted, &p->tracker, out_error);
    if (!err && p->dir && mkdir(p->dir, 0777) < 0 && errno != EEXIST)
        err = gn_error_set(out_error, -errno, "cannot create the folder %s: %s", p->dir,
                           strerror(errno));
    if (err)
        gn_poses_close(&p);
    *out_poses = p;
    return err;
}

static int draw(const struct gn_poses *p, const char *name, struct gn_error *out_error)
{
    char path[4096];
    struct gn_image8 drawn = {0};
    if (gn_tracker_draw(p->tracker, &drawn) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    int n = snprintf(path, sizeof(path), "%s/%s.png", p->dir, name);
    int err = n < (int)sizeof(path)
                  ? gn_png_write_file(path, &drawn, out_error)
                  : gn_error_set(out_error, -ENAMETOOLONG, "%s: the path is too long", p->dir);
    gn_image8_finish(&drawn);
    return err;
}

/** One body of the last picture, as poses.jsonl has it. */
static json_t *make_body(const struct gn_poses *p, int body)
{
    const struct gn_tracked_body *b = gn_tracker_get_body(p->tracker, body);
    double m[16];
    json_t *matrix = json_array();
    gn_pose_to_matrix(&b->camera_from_body, m);
    for (int i = 0; i < 16; i++)
        json_array_append_new(matrix, json_real(m[i]));
    return json_pack("{s:s, s:i, s:o, s:f, s:f, s:f}", "name", p->bodies.bodies[body].name,
                     "markers", b->n_markers, "camera_from_body", matrix, "rms_px", b->fit.rms_px,
                     "error_mm", 1e3 * b->fit.error_m, "error_rad", b->fit.error_rad);
}

static int write_line(const struct gn_poses *p, const struct gn_capture *capture, int64_t time_ns,
                      struct gn_error *out_error)
{
    json_t *seen = json_array();
    for (int i = 0; i < p->bodies.n_bodies; i++)
        if (gn_tracker_get_body(p->tracker, i)->is_seen)
            json_array_append_new(seen, make_body(p, i));
    json_t *line = json_pack("{s:s, s:I, s:o}", "picture", capture->name, "time_ns",
                             (json_int_t)time_ns, "bodies", seen);
    char *text = line ? json_dumps(line, JSON_REAL_PRECISION(12)) : NULL;
    json_decref(line);
    int err = text && fprintf(p->log, "%s\n", text) > 0 && fflush(p->log) == 0
                  ? 0
                  : gn_error_set(out_error, -EIO, "cannot write the poses of %s", capture->name);
    free(text);
    return err;
}

/** Says what is wrong with the list of the bodies. */
static void tell(struct gn_poses *p)
{
    if (!gn_tracker_explain(p->tracker, p->doubt, sizeof(p->doubt)))
        return;
    fprintf(stderr, "gnomon: %s: %s\n", p->source, p->doubt);
    p->has_told = true;
    p->told_ns = gn_clock_get_monotonic_ns();
}

/** Tells it once it is certain, and not often. */
static void doubt(struct gn_poses *p)
{
    p->n_doubtful = gn_tracker_is_doubtful(p->tracker) ? p->n_doubtful + 1 : 0;
    if (p->n_doubtful >= SURE_AFTER &&
        (!p->has_told || gn_clock_get_monotonic_ns() - p->told_ns >= tell_interval_ns))
        tell(p);
}

const char *gn_poses_get_doubt(const struct gn_poses *p)
{
    return p->has_told && p->n_doubtful >= SURE_AFTER ? p->doubt : NULL;
}

int gn_poses_take(struct gn_poses *p, const struct gn_capture *capture, struct gn_error *out_error)
{
    int64_t time_ns = gn_poses_get_time_ns(capture);
    struct gn_error why = {0};
    int n_seen = gn_tracker_update(p->tracker, capture, time_ns, &why);
    if (n_seen == -EBADMSG && capture->time_ns != 0) {
        if (p->n_damaged++ == 0)
            fprintf(stderr, "gnomon: %s: %s; no markers are looked for in such pictures\n",
                    capture->name, why.text);
        return 0;
    }
    if (n_seen < 0)
        return gn_error_set(out_error, n_seen, "%s", why.text);
    doubt(p);
    int err = p->dir ? draw(p, capture->name, out_error) : 0;
    if (!err && p->log)
        err = write_line(p, capture, time_ns, out_error);
    return err ? err : n_seen;
}

bool gn_poses_get_camera(const struct gn_poses *p, struct gn_pose *out_world_from_camera)
{
    return p->world >= 0 && gn_tracker_get_camera(p->tracker, p->world, out_world_from_camera);
}

bool gn_poses_get_body(const struct gn_poses *p, int body, struct gn_pose *out_world_from_body)
{
    return p->world >= 0 && gn_tracker_get_between(p->tracker, p->world, body, out_world_from_body);
}

bool gn_poses_get_in_camera(const struct gn_poses *p, int body,
                            struct gn_pose *out_camera_from_body)
{
    const struct gn_tracked_body *b = gn_tracker_get_body(p->tracker, body);
    if (b->is_seen)
        *out_camera_from_body = b->camera_from_body;
    return b->is_seen;
}

int gn_poses_find_body(const struct gn_poses *p, const char *name)
{
    return gn_bodies_find(&p->bodies, name);
}

void gn_poses_print(struct gn_poses *p, FILE *out)
{
    struct gn_tracker_counts c;
    if (!p)
        return;
    if (p->n_doubtful > 0 && !p->has_told)
        tell(p);
    gn_tracker_get_counts(p->tracker, &c);
    fprintf(out, "markers: %llu poses from %llu pictures, %.2f ms of a core each",
            (unsigned long long)c.n_seen, (unsigned long long)c.n_pictures,
            c.n_pictures ? 1e3 * c.time_s / (double)c.n_pictures : 0);
    if (c.n_flips_rejected + c.n_flips_corrected > 0)
        fprintf(out, "; %llu flips rejected, %llu corrected",
                (unsigned long long)c.n_flips_rejected, (unsigned long long)c.n_flips_corrected);
    if (c.n_misfits > 0)
        fprintf(out, "; %llu times they were not where they are listed",
                (unsigned long long)c.n_misfits);
    if (p->n_damaged > 0)
        fprintf(out, "; %ld pictures were damaged", p->n_damaged);
    if (c.n_rest > 0)
        fprintf(out, "; at rest steps of %.3f mm RMS, %.3f as measured",
                1e3 * sqrt(c.rest_steady_m2 / (double)c.n_rest),
                1e3 * sqrt(c.rest_measured_m2 / (double)c.n_rest));
    if (c.n_moving > 0)
        fprintf(out, "; in motion %.1f ms late", 1e3 * c.moving_lag_s / (double)c.n_moving);
    fprintf(out, "\n");
}

void gn_poses_close(struct gn_poses **poses)
{
    struct gn_poses *p = *poses;
    if (!p)
        return;
    gn_tracker_destroy(&p->tracker);
    gn_bodies_finish(&p->bodies);
    if (p->log)
        fclose(p->log);
    free(p);
    *poses = NULL;
}
