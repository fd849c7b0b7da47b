/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/capture/source.h"

#include <errno.h>
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

int gn_source_hold_exposure(struct gn_source *source, enum gn_exposure_unit unit,
                            struct gn_exposure *out, struct gn_error *out_error)
{
    if (!source->ops->hold_exposure)
        return gn_error_set(out_error, -ENOTSUP, "what was recorded has its exposure");
    return source->ops->hold_exposure(source, unit, out, out_error);
}

int gn_source_set_exposure(struct gn_source *source, double value, double *out_value,
                           struct gn_error *out_error)
{
    return source->ops->set_exposure(source, value, out_value, out_error);
}

int gn_source_restore_exposure(struct gn_source *source, struct gn_error *out_error)
{
    return source->ops->restore_exposure ? source->ops->restore_exposure(source, out_error) : 0;
}

void gn_source_close(struct gn_source **source)
{
    if (*source)
        (*source)->ops->close(*source);
    *source = NULL;
}
