/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* In place of v4l2*.c where the build has no V4L2. */
#include <errno.h>
#include <stddef.h>

#include "client/capture/v4l2.h"
#include "client/feature.h"

int gn_v4l2_open(const struct gn_live_options *options, struct gn_source **out_source,
                 struct gn_error *out_error)
{
    (void)options;
    *out_source = NULL;
    return gn_feature_refuse(GN_FEATURE_V4L2, out_error);
}

int gn_v4l2_describe_all(gn_v4l2_say_fn say, void *context)
{
    (void)say;
    (void)context;
    return -ENOSYS;
}
