/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/encoder.h"

#include <math.h>

/* The linear value from which on the code is this one; infinity where none has it. */
static float find_edge(const struct gn_response *response, int code)
{
    float edge = gn_response_decode(response, ((float)code - 0.5f) / 255);
    const float least = (float)code - 0.501f; // 0.001: rounding in encode
    /* Where a table is flat, encode gives the lowest code of the flat part; the others begin above.
     */
    if (gn_response_encode(response, edge) * 255 < least)
        edge = nextafterf(edge, INFINITY);
    return gn_response_encode(response, edge) * 255 < least ? INFINITY : edge;
}

void gn_encoder_init(const struct gn_response *response, struct gn_encoder *out_encoder)
{
    out_encoder->edges[0] = 0;
    for (int k = 1; k < 256; k++)
        out_encoder->edges[k] = find_edge(response, k);
    out_encoder->edges[256] = out_encoder->edges[257] = INFINITY;
    int code = 0;
    for (uint32_t i = 0; i < GN_ENCODER_GUIDES; i++) {
        uint32_t bits = i << GN_ENCODER_SHIFT;
        float smallest;
        memcpy(&smallest, &bits, sizeof(smallest));
        while (code < 255 &&
               smallest >= out_encoder->edges[code + 1]) // false for the NaNs at the end
            code++;
        out_encoder->guide[i] = (uint8_t)code;
    }
}
