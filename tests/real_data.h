/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Tests that take their input from the folder GNOMON_DATA names. Without it they are skipped: by
 * the name they are listed under, as cmocka 1.1.5 prints the skip() of a test as a failure in TAP.
 */
#ifndef GN_TESTS_REAL_DATA_H
#define GN_TESTS_REAL_DATA_H

#include <limits.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

/** A cmocka_unit_test() that needs file, a literal: a path in the folder GNOMON_DATA names. */
#define unit_test_with_real_data(test, file)                                                       \
    (real_data_has(file)                                                                           \
         ? (struct CMUnitTest)cmocka_unit_test(test)                                               \
         : (struct CMUnitTest){#test " # SKIP GNOMON_DATA names no folder with " file,             \
                               real_data_skip, NULL, NULL, NULL})

/** The path of file in the folder GNOMON_DATA names, in out; out. */
static inline const char *real_data_path(const char *file, char out[static PATH_MAX])
{
    const char *folder = getenv("GNOMON_DATA");
    int n = snprintf(out, PATH_MAX, "%s/%s", folder ? folder : "", file);
    assert_in_range(n, 1, PATH_MAX - 1);
    return out;
}

static inline bool real_data_has(const char *file)
{
    char path[PATH_MAX];
    const char *folder = getenv("GNOMON_DATA");
    return folder && folder[0] && access(real_data_path(file, path), R_OK) == 0;
}

static inline void real_data_skip(void **state)
{
    (void)state;
}

#endif
