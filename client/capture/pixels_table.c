/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Names and codes: GenICam Pixel Format Naming Convention 2.4, appendix of values. */
#include "client/capture/pixels.h"
#include "proto/attr.h"

#define PLAIN GN_PIXELS_UNPACKED
#define LSB GN_PIXELS_LSB
#define GIGE GN_PIXELS_GIGE

#define BAYER(suffix, packing, bits, gr, rg, gb, bg)                                               \
    {"BayerGR" suffix, gr, GN_PIXELS_BAYER, packing, bits, 1, 0},                                  \
        {"BayerRG" suffix, rg, GN_PIXELS_BAYER, packing, bits, 0, 0},                              \
        {"BayerGB" suffix, gb, GN_PIXELS_BAYER, packing, bits, 0, 1},                              \
    {                                                                                              \
        "BayerBG" suffix, bg, GN_PIXELS_BAYER, packing, bits, 1, 1                                 \
    }

static const struct gn_pixels_format formats[] = {
    {"Mono8", 0x01080001, GN_PIXELS_MONO, PLAIN, 8, 0, 0},
    {"Mono10", 0x01100003, GN_PIXELS_MONO, PLAIN, 10, 0, 0},
    {"Mono10Packed", 0x010C0004, GN_PIXELS_MONO, GIGE, 10, 0, 0},
    {"Mono10p", 0x010A0046, GN_PIXELS_MONO, LSB, 10, 0, 0},
    {"Mono12", 0x01100005, GN_PIXELS_MONO, PLAIN, 12, 0, 0},
    {"Mono12Packed", 0x010C0006, GN_PIXELS_MONO, GIGE, 12, 0, 0},
    {"Mono12p", 0x010C0047, GN_PIXELS_MONO, LSB, 12, 0, 0},
    {"Mono14", 0x01100025, GN_PIXELS_MONO, PLAIN, 14, 0, 0},
    {"Mono16", 0x01100007, GN_PIXELS_MONO, PLAIN, 16, 0, 0},
    BAYER("8", PLAIN, 8, 0x01080008, 0x01080009, 0x0108000A, 0x0108000B),
    BAYER("10", PLAIN, 10, 0x0110000C, 0x0110000D, 0x0110000E, 0x0110000F),
    BAYER("10Packed", GIGE, 10, 0x010C0026, 0x010C0027, 0x010C0028, 0x010C0029),
    BAYER("10p", LSB, 10, 0x010A0056, 0x010A0058, 0x010A0054, 0x010A0052),
    BAYER("12", PLAIN, 12, 0x01100010, 0x01100011, 0x01100012, 0x01100013),
    BAYER("12Packed", GIGE, 12, 0x010C002A, 0x010C002B, 0x010C002C, 0x010C002D),
    BAYER("12p", LSB, 12, 0x010C0057, 0x010C0059, 0x010C0055, 0x010C0053),
    BAYER("16", PLAIN, 16, 0x0110002E, 0x0110002F, 0x01100030, 0x01100031),
    {"RGB8", 0x02180014, GN_PIXELS_RGB, PLAIN, 8, 0, 0},
    {"BGR8", 0x02180015, GN_PIXELS_BGR, PLAIN, 8, 0, 0},
    {"RGB10", 0x02300018, GN_PIXELS_RGB, PLAIN, 10, 0, 0},
    {"BGR10", 0x02300019, GN_PIXELS_BGR, PLAIN, 10, 0, 0},
    {"RGB12", 0x0230001A, GN_PIXELS_RGB, PLAIN, 12, 0, 0},
    {"BGR12", 0x0230001B, GN_PIXELS_BGR, PLAIN, 12, 0, 0},
    {"RGB16", 0x02300033, GN_PIXELS_RGB, PLAIN, 16, 0, 0},
    {"BGR16", 0x0230004B, GN_PIXELS_BGR, PLAIN, 16, 0, 0},
};

const struct gn_pixels_format *gn_pixels_find(uint32_t code)
{
    for (size_t i = 0; i < GN_ARRAY_LEN(formats); i++) {
        if (formats[i].code == code)
            return &formats[i];
    }
    return NULL;
}

const char *gn_pixels_get_names(void)
{
    return "Mono8, 10, 12, 14, 16; BayerXX8, 10, 12, 16; 10 and 12 also p and Packed; RGB and "
           "BGR 8, 10, 12, 16";
}
