/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Reports as pictures: plots as SVG text. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_CALIBRATE_PLOT_H
#define GN_CLIENT_CALIBRATE_PLOT_H

#include "client/calibrate/chart_response.h"
#include "common/error.h"
#include "proto/attr.h"

/**
 * The fit of a chart as an SVG file: relative error of each patch's light over that light on a
 * logarithmic axis, greys black, the rest in their colour, outliers hollow, pale what its code does
 * not say to 5 %. Returns 0, or a negative errno and a sentence.
 */
GN_MUST_USE int gn_plot_chart(const char *path, const struct gn_chart_response *response,
                              struct gn_error *out_error);

#endif
