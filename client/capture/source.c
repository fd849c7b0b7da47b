/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/source.h"

int gn_source_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    return source->ops->read(source, out, out_error);
}

void gn_source_close(struct gn_source **source)
{
    if (*source)
        (*source)->ops->close(*source);
    *source = NULL;
}
