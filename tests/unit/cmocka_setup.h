/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * cmocka with what it needs in front of it.
 */
#ifndef GN_TESTS_UNIT_CMOCKA_SETUP_H
#define GN_TESTS_UNIT_CMOCKA_SETUP_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#endif
