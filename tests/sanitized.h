/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Sanitizers slow code down several times and look for what goes wrong on a way through it, not at
 * figures. So tests that judge many pictures judge some of them there; each says which.
 */
#ifndef GN_TESTS_SANITIZED_H
#define GN_TESTS_SANITIZED_H

#include <stdbool.h>
#include <stddef.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define GN_TEST_IS_SANITIZED true
#else
#define GN_TEST_IS_SANITIZED false
#endif

/** The case after i of the n of a list: all in turn; under sanitizers the first and the last. */
static inline size_t gn_test_get_next(size_t i, size_t n)
{
    return GN_TEST_IS_SANITIZED && i + 1 < n ? n - 1 : i + 1;
}

#endif
