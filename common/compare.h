/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* Orders for qsort(): ascending. No NAN: it has no place. */
#ifndef GN_COMMON_COMPARE_H
#define GN_COMMON_COMPARE_H

int gn_compare_doubles(const void *a, const void *b);
int gn_compare_floats(const void *a, const void *b);

#endif
