/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/rig/gige_genicam.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <arv.h>

#include "client/capture/pixels.h"
#include "proto/attr.h"

#define REGISTER(name, address)                                                                    \
    "<IntReg Name=\"" name "\"><Address>" address "</Address><Length>4</Length>"                   \
    "<AccessMode>RW</AccessMode><pPort>Device</pPort><Endianess>BigEndian</Endianess></IntReg>"

/** GenICam nodes (SFNC 2.4, "Chunk Data Control"); the numbers are those of the header. */
static const char chunk_nodes[] =
    "<Boolean Name=\"ChunkModeActive\"><pValue>ChunkModeReg</pValue></Boolean>"
    "<Enumeration Name=\"ChunkSelector\"><EnumEntry Name=\"Timestamp\"><Value>1</Value>"
    "</EnumEntry><EnumEntry "
    "Name=\"ExposureTime\"><Value>2</Value></EnumEntry><pValue>ChunkSelectorReg</pValue></"
    "Enumeration>"
    "<Boolean Name=\"ChunkEnable\"><pValue>ChunkEnableReg</pValue></Boolean>" REGISTER(
        "ChunkModeReg", "0x380") REGISTER("ChunkSelectorReg", "0x384")
        REGISTER("ChunkEnableReg",
                 "0x388") "<Port Name=\"ChunkPort\"><ChunkID>10</ChunkID></Port>"
                          "<IntReg Name=\"ChunkTimestamp\"><Address>0</Address><Length>8</Length>"
                          "<AccessMode>RO</AccessMode><pPort>ChunkPort</"
                          "pPort><Endianess>BigEndian</Endianess></IntReg>"
                          "<Port Name=\"ExposurePort\"><ChunkID>11</ChunkID></Port>"
                          "<FloatReg Name=\"ChunkExposureTime\"><Address>0</Address>"
                          "<Length>8</Length><AccessMode>RO</AccessMode>"
                          "<pPort>ExposurePort</pPort><Endianess>BigEndian</Endianess></FloatReg>";

/** As cameras have it: a client may ask whether packets of its size arrive (GigE Vision 2.0, 28).
 */
static const char test_packet_nodes[] =
    "<Boolean Name=\"GevSCPSFireTestPacket\"><pValue>FireTestPacketReg</pValue></Boolean>"
    "<MaskedIntReg Name=\"FireTestPacketReg\"><Address>0xd04</Address><Length>4</Length>"
    "<AccessMode>RW</AccessMode><pPort>Device</pPort><Bit>0</Bit>"
    "<Endianess>BigEndian</Endianess></MaskedIntReg>";

/** Inserts before the first `mark`. Whether it was there. */
static bool insert(GString *text, const char *mark, const char *what)
{
    const char *at = strstr(text->str, mark);
    if (at)
        g_string_insert(text, at - text->str, what);
    return at != NULL;
}

static bool extend(GString *text)
{
    static const uint32_t codes[] = {0x01100003, 0x010C0004, 0x010A0046, 0x01100005, 0x010C0006,
                                     0x010C0047, 0x01100025, 0x0110000D, 0x010C0027, 0x010A0058,
                                     0x01100011, 0x010C002B, 0x010C0059, 0x0110002F, 0x02180015,
                                     0x0230001A, 0x0230001B, 0x02300033};
    bool is_good = true;
    for (size_t i = 0; i < GN_ARRAY_LEN(codes); i++) {
        char entry[256];
        snprintf(entry, sizeof(entry),
                 "<EnumEntry Name=\"%s\" NameSpace=\"Standard\"><Value>%u</Value></EnumEntry>",
                 gn_pixels_find(codes[i])->name, codes[i]);
        is_good = is_good && insert(text, "<pValue>PixelFormatRegister</pValue>", entry);
    }
    static const char payload[] = "<Formula>WIDTH * HEIGHT * ((PIXELFORMAT>>16)&amp;0xFF) / 8";
    static const char variable[] = "<pVariable Name=\"CHUNKS\">ChunkModeReg</pVariable>";
    is_good = is_good && insert(text, payload, variable);
    const char *formula = strstr(text->str, payload);
    if (formula)
        g_string_insert(text, formula - text->str + (gssize)strlen(payload), " + 40 * CHUNKS");
    return is_good && insert(text, "</RegisterDescription>", test_packet_nodes) &&
           insert(text, "</RegisterDescription>", chunk_nodes);
}

const char *gn_gige_write_genicam(void)
{
    static char path[64];
    ArvFakeCamera *plain = arv_fake_camera_new("GN");
    size_t size = 0;
    const char *xml = arv_fake_camera_get_genicam_xml(plain, &size);
    GString *text = g_string_new_len(xml, (gssize)size);
    snprintf(path, sizeof(path), "/tmp/gnomon-fake-gige.XXXXXX");
    int fd = extend(text) ? mkstemp(path) : -1;
    bool is_good = fd >= 0 && write(fd, text->str, text->len) == (ssize_t)text->len;
    if (fd >= 0)
        close(fd);
    g_string_free(text, TRUE);
    g_object_unref(plain);
    return is_good ? path : NULL;
}
