/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Linear values to 8-bit codes without evaluating the curve: code k begins at edges[k], and a guide
 * says where to begin looking. The same codes as gn_response_encode and rounding, up to the float
 * spacing at an edge.
 */
#ifndef GN_COMMON_ENCODER_H
#define GN_COMMON_ENCODER_H

#include <stdint.h>
#include <string.h>

#include "common/response.h"

/** A positive float's bits over this shift: its exponent and 7 bits of mantissa, steps of 1/128. */
#define GN_ENCODER_SHIFT 16
#define GN_ENCODER_GUIDES (1 << (31 - GN_ENCODER_SHIFT))

/** Immutable after init. */
struct gn_encoder {
    float edges[258];                 // [0] 0, [256] and [257] infinity
    uint8_t guide[GN_ENCODER_GUIDES]; // the code of the smallest float of the bucket
};

/** The response has passed gn_response_check. */
void gn_encoder_init(const struct gn_response *response, struct gn_encoder *out_encoder);

/** The code of one linear device value; of NaN that of 0. */
static inline uint8_t gn_encoder_get(const struct gn_encoder *encoder, float linear)
{
    if (!(linear > 0))
        return encoder->guide[0];
    uint32_t bits;
    memcpy(&bits, &linear, sizeof(bits));
    int code = encoder->guide[bits >> GN_ENCODER_SHIFT];
    code += linear >= encoder->edges[code + 1]; // without a branch: it is either
    while (linear >= encoder->edges[code + 1] && code < 255)
        code++;
    return (uint8_t)(code < 255 ? code : 255); // of infinity
}

#endif
