/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/source.h"

#include <string.h>

int gn_source_read(struct gn_source *source, struct gn_capture *out, struct gn_error *out_error)
{
    if (out_error)
        out_error->text[0] = '\0';
    return source->ops->read(source, out, out_error);
}

void gn_source_get_counts(const struct gn_source *source, struct gn_source_counts *out)
{
    memset(out, 0, sizeof(*out));
    if (source->ops->get_counts)
        source->ops->get_counts(source, out);
}

void gn_source_close(struct gn_source **source)
{
    if (*source)
        (*source)->ops->close(*source);
    *source = NULL;
}
