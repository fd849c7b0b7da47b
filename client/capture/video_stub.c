/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/video.h"
#include "client/feature.h"

int gn_video_source_open(const char *path, const struct gn_video_options *options,
                         struct gn_source **out_source, struct gn_error *out_error)
{
    (void)path;
    (void)options;
    *out_source = NULL;
    return gn_feature_refuse(GN_FEATURE_VIDEO, out_error);
}
