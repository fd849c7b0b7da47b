/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/feature.h"

#include <errno.h>

/* GN_HAS_...: 0 or 1, from client/meson.build. */
static const struct gn_feature features[GN_FEATURE_COUNT] = {
    [GN_FEATURE_GIGE] = {"gige", "GigE Vision cameras", "libaravis-dev and libusb-1.0-0-dev",
                         "aravis", GN_HAS_ARAVIS},
    [GN_FEATURE_V4L2] = {"v4l2", "cameras of the Linux kernel (V4L2)", "linux-libc-dev", "v4l2",
                         GN_HAS_V4L2},
    [GN_FEATURE_VIDEO] = {"video", "video files",
                          "libavformat-dev, libavcodec-dev and libswscale-dev", "libav",
                          GN_HAS_LIBAV},
    [GN_FEATURE_VISION] = {"vision", "markers and calibration",
                           "libopencv-dev and libopencv-contrib-dev", "opencv", GN_HAS_OPENCV},
    [GN_FEATURE_WINDOW] = {"window", "the viewer's window", "libsdl2-dev", "sdl2", GN_HAS_SDL2},
};

const struct gn_feature *gn_feature_get(enum gn_feature_id id)
{
    return &features[id];
}

int gn_feature_refuse(enum gn_feature_id id, struct gn_error *out_error)
{
    const struct gn_feature *f = &features[id];
    return gn_error_set(out_error, -ENOSYS,
                        "gnomon was built without %s: install %s and configure with -D%s=enabled",
                        f->gives, f->package, f->option);
}
