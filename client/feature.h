/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What of the client is optional in the build: one table for `gnomon doctor` and for the refusals
 * of commands that need a part which was left out.
 */
#ifndef GN_CLIENT_FEATURE_H
#define GN_CLIENT_FEATURE_H

#include <stdbool.h>

#include "common/error.h"
#include "proto/attr.h"

enum gn_feature_id {
    GN_FEATURE_GIGE = 0,
    GN_FEATURE_V4L2,
    GN_FEATURE_VIDEO,
    GN_FEATURE_VISION,
    GN_FEATURE_WINDOW,
    GN_FEATURE_COUNT
};

/** One optional feature. Static. */
struct gn_feature {
    const char *name;    // one word, as gnomon doctor lists it
    const char *gives;   // a few words
    const char *package; // Debian's, that the build needs
    const char *option;  // of meson, without -D
    bool is_built;
};

/** id: below GN_FEATURE_COUNT. Thread-safety: safe. */
const struct gn_feature *gn_feature_get(enum gn_feature_id id);

/** "gnomon was built without ...: install PACKAGE and configure with -DOPTION=enabled". Returns
 * -ENOSYS. Thread-safety: safe. */
int gn_feature_refuse(enum gn_feature_id id, struct gn_error *out_error);

#endif
