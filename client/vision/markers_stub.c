/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What stands for OpenCV where the build has none. */
#include <errno.h>

#include "client/vision/markers.h"

static int refuse(struct gn_error *out_error)
{
    return gn_error_set(out_error, -ENOSYS,
                        "this build cannot see markers: it was made without OpenCV (install "
                        "libopencv-dev and libopencv-contrib-dev, meson setup -Dopencv=enabled)");
}

const char *gn_vision_get_version(void)
{
    return "this build has no OpenCV";
}

bool gn_vision_is_built(void)
{
    return false;
}

int gn_marker_count_ids(int dictionary)
{
    (void)dictionary;
    return 0;
}

int gn_marker_finder_create(const struct gn_marker_finder_options *options,
                            struct gn_marker_finder **out_finder, struct gn_error *out_error)
{
    (void)options;
    *out_finder = NULL;
    return refuse(out_error);
}

void gn_marker_finder_destroy(struct gn_marker_finder **finder)
{
    *finder = NULL;
}

int gn_marker_finder_find(struct gn_marker_finder *finder, const uint8_t *grey, int width,
                          int height, const struct gn_marker_window *window, int max_sightings,
                          struct gn_marker_sighting *out_sightings, int *out_n_sightings,
                          struct gn_error *out_error)
{
    (void)finder, (void)grey, (void)width, (void)height, (void)window;
    (void)max_sightings, (void)out_sightings, (void)out_n_sightings;
    return refuse(out_error);
}

int gn_marker_finder_get_unread(const struct gn_marker_finder *finder, int max_quads,
                                double (*out_quads)[4][2])
{
    (void)finder, (void)max_quads, (void)out_quads;
    return 0;
}

int gn_marker_get_cells(int dictionary, int id, uint8_t *out_cells)
{
    (void)dictionary, (void)id, (void)out_cells;
    return 0;
}

int gn_vision_solve_pose(const double *points_object, const double *rays, int n, bool is_planar,
                         struct gn_vision_pose *out_poses, struct gn_error *out_error)
{
    (void)points_object, (void)rays, (void)n, (void)is_planar, (void)out_poses;
    return refuse(out_error);
}
