/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Puts layers over a camera picture, in linear light of the camera:
 *   composite = (shadow * background + added) * (1 - A) + virtual
 * Works on plain arrays so that server and clients share it.
 */
#ifndef GN_COMMON_COMPOSITE_H
#define GN_COMMON_COMPOSITE_H

#include <stdbool.h>

#include "common/image.h"
#include "common/pool.h"
#include "common/response.h"
#include "proto/attr.h"

/** Layers as gn_renderer_render makes them; borrowed during the call. All of one size. */
struct gn_composite_layers {
    const struct gn_image *virtual_rgba; // [h][w][4] premultiplied linear radiance
    const struct gn_image *shadow;       // [h][w][3]; may be NULL: 1
    const struct gn_image *added;        // [h][w][3]; may be NULL: 0
};

/**
 * 8-bit in, 8-bit out, RGB. The camera's response turns codes to radiance and back; a pixel that no
 * layer touches keeps its codes to the bit. encoded_multiply is the paper's literal reading: the
 * factor scales the codes themselves. out has the background's size, and may be the background.
 * The result does not depend on the pool. Thread-safety: safe.
 * Returns 0 or -EINVAL where sizes or channels differ or the response is refused by
 * gn_response_check.
 */
GN_MUST_USE int gn_composite_image8(const struct gn_composite_layers *layers,
                                    const struct gn_image8 *background,
                                    const struct gn_response *response, bool encoded_multiply,
                                    struct gn_pool *pool, struct gn_image8 *out);

/** Linear radiance in, linear radiance out. Same rules. */
GN_MUST_USE int gn_composite_linear(const struct gn_composite_layers *layers,
                                    const struct gn_image *background, struct gn_pool *pool,
                                    struct gn_image *out);

#endif
