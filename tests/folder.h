/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * A test program's folder of files. What fails fails the test.
 */
#ifndef GN_TESTS_FOLDER_H
#define GN_TESTS_FOLDER_H

#include <stddef.h>

/** Makes the process's one folder, empty. Returns 0, or -1 for cmocka's set-up. */
int gn_test_folder_create(void);

/** Removes it with the files of those names, there or not; -1 where any other is left in it. */
int gn_test_folder_remove(const char *const *names, size_t n);

/** The path of a file in it, there or not; borrowed until the next call of anything here. */
const char *gn_test_folder_get_path(const char *name);

void gn_test_folder_write(const char *name, const void *data, size_t n_bytes);
void gn_test_folder_write_text(const char *name, const char *text);

#endif
