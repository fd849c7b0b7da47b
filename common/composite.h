/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Puts layers over a camera picture, in linear light of the camera:
 *   composite = (shadow * background + added) * (1 - A) + virtual
 * with the camera's blur and noise where it has them. Works on plain arrays so that server and
 * clients share it.
 */
#ifndef GN_COMMON_COMPOSITE_H
#define GN_COMMON_COMPOSITE_H

#include <stdbool.h>
#include <stdint.h>

#include "common/image.h"
#include "common/match.h"
#include "common/pool.h"
#include "common/response.h"
#include "proto/attr.h"

/** Layers as gn_renderer_render makes them; borrowed during the call. All of one size. */
struct gn_composite_layers {
    const struct gn_image *virtual_rgba; // [h][w][4] premultiplied linear radiance
    const struct gn_image *shadow;       // [h][w][3]; may be NULL: 1
    const struct gn_image *added;        // [h][w][3]; may be NULL: 0
};

/** All-zero is the plain formula. */
struct gn_composite_options {
    bool encoded_multiply; // the paper's literal reading: the factor scales the codes themselves;
                           // only of pictures of codes
    struct gn_match match; // of the camera
    uint64_t frame;        // another one is another noise: tell views apart, too
};

/** Keeps what pictures share. Thread-safety: unsafe (one picture at a time). */
struct gn_compositor;

/** pool is borrowed until destroy; may be NULL. Returns 0 or -ENOMEM. */
GN_MUST_USE int gn_compositor_create(struct gn_pool *pool, struct gn_compositor **out_compositor);
/** NULL-safe; nulls *compositor. */
void gn_compositor_destroy(struct gn_compositor **compositor);
/** Pixels of the last picture that show a virtual surface: covered by virtual_rgba, blurred where
 * the camera blurs. 0 before the first. */
uint32_t gn_compositor_get_n_covered(const struct gn_compositor *compositor);

/**
 * 8-bit in, 8-bit out, RGB. The camera's response turns codes to radiance and back; a pixel that no
 * layer touches, and no blur carries a layer to, keeps its codes to the bit.
 *
 * Blur: the layers are spread, the background is not (common/point_spread.h).
 * Noise: a composite pixel has the mean m = f x + u in the camera's linear values, x of the
 * background, f = shadow (1 - A), u of the layers. Of the variance slope m + offset that the camera
 * would give it, the background brings f^2 (slope x + offset); normal deviates bring the rest. So
 * covered, shadowed and half-covered pixels alike have the noise of a photograph of them. Where a
 * matrix mixes the channels and a shadow is coloured, f is the diagonal of what it does to them.
 * The same frame and pixel has the same noise; noise and blur are options->match's.
 *
 * out has the background's size, and may be the background. The result does not depend on the pool.
 * Takes memory only where blur's strips are larger than before. Returns 0, -ENOMEM, or -EINVAL
 * where sizes or channels differ or gn_response_check or gn_match_check refuses.
 */
GN_MUST_USE int
gn_compositor_put_image8(struct gn_compositor *compositor, const struct gn_composite_layers *layers,
                         const struct gn_image8 *background, const struct gn_response *response,
                         const struct gn_composite_options *options, struct gn_image8 *out);

/** Linear radiance in, linear radiance out; the response is there for the noise's units. Same
 * rules; pixels that got noise are not negative. */
GN_MUST_USE int
gn_compositor_put_linear(struct gn_compositor *compositor, const struct gn_composite_layers *layers,
                         const struct gn_image *background, const struct gn_response *response,
                         const struct gn_composite_options *options, struct gn_image *out);

#endif
