/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_collect.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "client/cmd_calibrate/calibrate_input.h"
#include "common/clock.h"

/** A board at rest: between two pictures its corners move by less, in diagonals of the picture. */
#define MAX_MOTION 0.005
/** Pictures in which another board is looked for. */
#define MAX_SEARCHES 3

void gn_calibrate_views_finish(struct gn_calibrate_views *set)
{
    for (int v = 0; v < set->n_views; v++) {
        free(set->corners[v]);
        free(set->residuals[v]);
        free(set->names[v]);
    }
    memset(set, 0, sizeof(*set));
}

/* Looks whether the board has a square more each way: those who counted inner corners. A few times
 * only, it takes as long as looking for the board. */
static int look_for_larger(struct gn_calibrate_views *set, const struct gn_image8 *gray,
                           struct gn_board_corner *found, struct gn_error *out_error)
{
    struct gn_board larger = set->board;
    int n = 0;
    larger.columns++;
    larger.rows++;
    if (set->board.is_charuco || set->n_views > 0 || set->hint[0] ||
        set->n_searched == MAX_SEARCHES || gn_board_check(&larger, NULL) < 0)
        return 0;
    set->n_searched++;
    int err = gn_board_find(&larger, gray->data, gray->width, gray->height, found, &n, out_error);
    if (!err && n > 0)
        snprintf(set->hint, sizeof(set->hint),
                 "a board of %dx%d squares is seen, and --board counts squares, not inner corners",
                 larger.columns, larger.rows);
    return err;
}

int gn_calibrate_views_look(struct gn_calibrate_views *set, const char *name,
                            struct gn_image *image, struct gn_board_corner *found, int *out_n,
                            struct gn_error *out_error)
{
    struct gn_image8 gray = {0};
    int err = 0;
    if (set->width == 0) {
        set->width = image->width;
        set->height = image->height;
    }
    if (image->width != set->width || image->height != set->height)
        err = gn_error_set(out_error, -EINVAL,
                           "%s: %d x %d, but the first picture is %d x %d: all must be of one "
                           "camera in one mode",
                           name, image->width, image->height, set->width, set->height);
    if (!err && gn_calibrate_stretch_gray(image, &gray) < 0)
        err = gn_error_set(out_error, -ENOMEM, "%s: out of memory", name);
    if (!err)
        err =
            gn_board_find(&set->board, gray.data, gray.width, gray.height, found, out_n, out_error);
    if (!err && *out_n == 0)
        err = look_for_larger(set, &gray, found, out_error);
    gn_image_finish(image);
    gn_image8_finish(&gray);
    return err;
}

int gn_calibrate_views_add(struct gn_calibrate_views *set, const char *name,
                           const struct gn_board_corner *found, int n, struct gn_error *out_error)
{
    int v = set->n_views++;
    set->corners[v] = malloc((size_t)n * sizeof(*found));
    set->residuals[v] = calloc(2 * (size_t)n, sizeof(double));
    set->names[v] = strdup(name);
    if (!set->corners[v] || !set->residuals[v] || !set->names[v])
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    memcpy(set->corners[v], found, (size_t)n * sizeof(*found));
    set->views[v] =
        (struct gn_board_view){.corners = set->corners[v], .n = n, .residuals = set->residuals[v]};
    return 0;
}

/* What a live picture is to the views that are there. */
enum sight { SIGHT_EMPTY, SIGHT_MOVING, SIGHT_ALIKE, SIGHT_NEW };

/* A camera's or video's pictures, watched until there are enough views. */
struct watch {
    const struct gn_program *program;
    const char *folder; // of the pictures kept; NULL: none are
    int n_wanted;
    struct gn_board_corner found[GN_BOARD_MAX_CORNERS];  // in this picture
    struct gn_board_corner before[GN_BOARD_MAX_CORNERS]; // in the one before
    int n_found, n_before;
    enum sight told;
    int64_t told_ns;
};

static enum sight judge(const struct gn_calibrate_views *set, struct watch *w, int *out_like)
{
    const struct gn_board_view now = {.corners = w->found, .n = w->n_found};
    const struct gn_board_view before = {.corners = w->before, .n = w->n_before};
    double shift = gn_views_get_shift(&now, &before);
    memcpy(w->before, w->found, sizeof(w->before));
    w->n_before = w->n_found;
    if (w->n_found < GN_CALIBRATE_MIN_CORNERS)
        return SIGHT_EMPTY;
    if (shift > MAX_MOTION * hypot(set->width, set->height))
        return SIGHT_MOVING;
    for (int v = 0; v < set->n_views; v++) {
        *out_like = v;
        if (gn_views_are_alike(&set->views[v], &now, set->width, set->height))
            return SIGHT_ALIKE;
    }
    return SIGHT_NEW;
}

/* Why nothing is taken: where that changed, and no faster than one can read. */
static void tell(struct watch *w, enum sight sight, int like, const char *hint)
{
    int64_t now_ns = gn_clock_get_monotonic_ns();
    if (sight == w->told || now_ns - w->told_ns < GN_NS_PER_S)
        return;
    w->told = sight;
    w->told_ns = now_ns;
    if (sight == SIGHT_EMPTY)
        printf("no board is seen%s%s\n", hint[0] ? ": " : "", hint);
    else if (sight == SIGHT_MOVING)
        printf("the board moves: hold it still\n");
    else
        printf("like view %d: tilt the board otherwise, or move it\n", like + 1);
    fflush(stdout);
}

static int take_view(struct gn_calibrate_views *set, struct watch *w,
                     const struct gn_image_file *picture, struct gn_error *out_error)
{
    char name[4096], bare[GN_VIEWS_BARE_BYTES];
    int n = snprintf(name, sizeof(name), "%s%sview-%03d%s", w->folder ? w->folder : "",
                     w->folder ? "/" : "", set->n_views + 1, w->folder ? ".png" : "");
    if (n < 0 || (size_t)n >= sizeof(name))
        return gn_error_set(out_error, -ENAMETOOLONG, "--keep: the folder's name is too long");
    int err = w->folder ? gn_calibrate_write(name, picture, out_error) : 0;
    if (!err)
        err = gn_calibrate_views_add(set, name, w->found, w->n_found, out_error);
    if (err)
        return err;
    double coverage =
        gn_views_describe_bare(set->views, set->n_views, set->width, set->height, bare);
    printf("view %d of %d: %d corners; in %.0f %% of the picture so far%s%s\n", set->n_views,
           set->n_views > w->n_wanted ? set->n_views : w->n_wanted, w->n_found, 100 * coverage,
           *bare ? ", still few or none: " : "", bare);
    fflush(stdout);
    w->told = SIGHT_NEW;
    w->told_ns = gn_clock_get_monotonic_ns();
    return 0;
}

/* Whether the views suffice, in number and in what they show. */
static bool is_enough(const struct gn_calibrate_views *set, const struct watch *w)
{
    struct gn_views_figures figures;
    struct gn_error lack = {0};
    if (set->n_views < w->n_wanted)
        return false;
    if (set->n_views == GN_BOARD_MAX_VIEWS ||
        gn_views_check(set->views, set->n_views, set->width, set->height, &figures, &lack) == 0)
        return true;
    printf("more views: %s\n", lack.text);
    fflush(stdout);
    return false;
}

/* One picture; *out_is_done: there are enough views, or no more pictures. */
static int watch_once(struct gn_calibrate_views *set, struct watch *w, struct gn_source *source,
                      bool *out_is_done, struct gn_error *out_error)
{
    struct gn_image_file picture;
    struct gn_image image = {0};
    int full_scale = 0, like = 0;
    int ret = gn_calibrate_take(w->program, source, &picture, &full_scale, out_error);
    *out_is_done = ret == 0;
    if (ret <= 0)
        return ret;
    int err = gn_calibrate_convert("picture", &picture, &(struct gn_calibrate_format){0}, &image,
                                   NULL, out_error);
    if (!err)
        err = gn_calibrate_views_look(set, "picture", &image, w->found, &w->n_found, out_error);
    enum sight sight = err ? SIGHT_EMPTY : judge(set, w, &like);
    if (!err && sight != SIGHT_NEW)
        tell(w, sight, like, set->hint);
    if (!err && sight == SIGHT_NEW) {
        err = take_view(set, w, &picture, out_error);
        *out_is_done = !err && is_enough(set, w);
    }
    gn_image_file_finish(&picture);
    return err;
}

int gn_calibrate_views_collect(struct gn_calibrate_views *set, const struct gn_program *program,
                               const struct gn_options *options, int n_wanted, const char *folder,
                               struct gn_error *out_error)
{
    struct gn_source *source = NULL;
    bool is_done = false;
    struct watch *w = calloc(1, sizeof(*w));
    if (!w)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    w->program = program;
    w->folder = folder;
    w->n_wanted = n_wanted;
    w->told = SIGHT_NEW;
    w->told_ns = gn_clock_get_monotonic_ns();
    gn_cmd_catch_signals();
    int err = folder ? gn_calibrate_make_folder("keep", folder, out_error) : 0;
    if (!err)
        err = gn_calibrate_open(options, &(struct gn_live_options){0}, &source, out_error);
    while (!err && !is_done)
        err = watch_once(set, w, source, &is_done, out_error);
    if (source && source->is_live)
        gn_live_print_counts(source, stdout);
    gn_source_close(&source);
    free(w);
    return err;
}
