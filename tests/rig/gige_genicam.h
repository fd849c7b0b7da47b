/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The GenICam file of the fake camera: Aravis' own, with the pixel formats and the chunks that it
 * leaves out.
 */
#ifndef GN_TESTS_RIG_GIGE_GENICAM_H
#define GN_TESTS_RIG_GIGE_GENICAM_H

/** Registers that the client writes: chunks are on; the two are on, together. */
#define GN_GIGE_REG_CHUNK_MODE 0x0380
#define GN_GIGE_REG_CHUNK_ENABLE 0x0388
/** The chunks of the stamp and of the exposure time, and what the payload is longer by while chunks
 * are on. */
#define GN_GIGE_CHUNK_ID 0x10
#define GN_GIGE_CHUNK_ID_EXPOSURE 0x11
#define GN_GIGE_CHUNK_BYTES 40

/** Writes it to a file in /tmp that the caller removes; its name, static, or NULL. */
const char *gn_gige_write_genicam(void);

#endif
