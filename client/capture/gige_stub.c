/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* In place of gige.c where the build has no Aravis. */
#include "client/capture/gige.h"

#include <errno.h>
#include <stddef.h>

#include "client/feature.h"

int gn_gige_open(const struct gn_live_options *options, struct gn_source **out_source,
                 struct gn_error *out_error)
{
    (void)options;
    *out_source = NULL;
    return gn_feature_refuse(GN_FEATURE_GIGE, out_error);
}

int gn_gige_find(gn_gige_found_fn found, void *context)
{
    (void)found;
    (void)context;
    return -ENOSYS;
}
