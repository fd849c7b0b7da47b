/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* What emission.c and emitters.c share. */
#ifndef GN_SERVER_LIGHT_EMITTERS_INTERNAL_H
#define GN_SERVER_LIGHT_EMITTERS_INTERNAL_H

#include "server/light/emitters.h"

/** NULL-safe; nulls *picture. */
void gn_emission_picture_unref(struct gn_emission_picture **picture);

#endif
