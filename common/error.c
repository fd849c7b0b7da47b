/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/error.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>

#include "common/text.h"

int gn_error_set(struct gn_error *error, int code, const char *format, ...)
{
    if (error == NULL)
        return code;
    va_list args;
    va_start(args, format);
    vsnprintf(error->text, sizeof(error->text), format, args);
    va_end(args);
    gn_text_clean(error->text);
    return code;
}
