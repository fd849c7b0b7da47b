/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "tests/folder.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "tests/unit/cmocka_setup.h"

static char folder[] = "/tmp/gnomon-test-XXXXXX";

int gn_test_folder_create(void)
{
    return mkdtemp(folder) ? 0 : -1;
}

int gn_test_folder_remove(const char *const *names, size_t n)
{
    for (size_t i = 0; i < n; i++)
        (void)unlink(gn_test_folder_get_path(names[i]));
    return rmdir(folder);
}

const char *gn_test_folder_get_path(const char *name)
{
    static char path[128];
    int n = snprintf(path, sizeof(path), "%s/%s", folder, name);
    assert_true(n > 0 && (size_t)n < sizeof(path));
    return path;
}

void gn_test_folder_write(const char *name, const void *data, size_t n_bytes)
{
    struct gn_error error = {0};
    if (gn_file_write(gn_test_folder_get_path(name), data, n_bytes, &error) < 0)
        fail_msg("%s", error.text);
}

void gn_test_folder_write_text(const char *name, const char *text)
{
    gn_test_folder_write(name, text, strlen(text));
}
