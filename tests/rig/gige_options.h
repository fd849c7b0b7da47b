/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What gnomon-fake-gige can be asked to be.
 */
#ifndef GN_TESTS_RIG_GIGE_OPTIONS_H
#define GN_TESTS_RIG_GIGE_OPTIONS_H

#include "common/options.h"

/** Its lies, in the order of --fault's choices, which say what each is. */
enum fault {
    FAULT_NONE,
    FAULT_SIZE,
    FAULT_FORMAT,
    FAULT_TRUNCATED,
    FAULT_CODES,
    FAULT_HUGE,
    FAULT_DROP,
    FAULT_CHANGE,
    FAULT_SILENT,
    FAULT_DIM,
    FAULT_EXPOSURE,
    FAULT_OVERLONG
};

/** The program and its options. */
extern const struct gn_program gn_gige_program;

#endif
