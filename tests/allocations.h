/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Counts what our own code allocates, on any thread. A test that links test_allocations_dep has the
 * linker put these counters before malloc, calloc, realloc and aligned_alloc in our static
 * libraries; what shared libraries allocate inside is not seen.
 */
#ifndef GN_TESTS_ALLOCATIONS_H
#define GN_TESTS_ALLOCATIONS_H

#include <stdatomic.h>

/** Calls so far. Thread-safety: safe. */
extern atomic_long gn_test_n_allocations;
/** Bytes that they asked for. Thread-safety: safe. */
extern atomic_long gn_test_allocated_bytes;

#endif
