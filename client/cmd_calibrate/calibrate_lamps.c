/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/cmd_calibrate/calibrate_lamps.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"

/* One line. Returns 1, 0 where it is blank or a comment, or a negative errno. */
static int read_lamp(const char *path, const char *line, int number, struct gn_lamp *out,
                     struct gn_error *out_error)
{
    char name[GN_FILE_NAME_BYTES], rest;
    double d[3], norm = 0;
    if (line[strspn(line, " \t\r")] == '\0' || line[strspn(line, " \t")] == '#')
        return 0;
    if (sscanf(line, "%255s %lf %lf %lf %c", name, &d[0], &d[1], &d[2], &rest) == 4)
        norm = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (!(norm > 1e-9 && norm < 1e9))
        return gn_error_set(out_error, -EINVAL,
                            "%s, line %d: right would be PICTURE X Y Z, the way to the lamp, not 0",
                            path, number);
    gn_file_get_name(name, out->picture);
    for (int k = 0; k < 3; k++)
        out->dir_world[k] = d[k] / norm;
    return 1;
}

int gn_lamps_read_file(const char *path, struct gn_lamp *out_lamps, struct gn_error *out_error)
{
    char *text = NULL;
    size_t size = 0;
    int ret = gn_file_read_text(path, (size_t)1 << 20, &text, &size, out_error);
    if (ret < 0)
        return ret;
    int n = 0, number = 1;
    for (char *line = text; ret >= 0 && *line; number++) {
        char *end = line + strcspn(line, "\n");
        bool is_last = *end == '\0';
        struct gn_lamp lamp;
        *end = '\0';
        ret = read_lamp(path, line, number, &lamp, out_error);
        if (ret > 0 && n == GN_LAMPS_MAX)
            ret = gn_error_set(out_error, -E2BIG, "%s: more than %d lamps", path, GN_LAMPS_MAX);
        else if (ret > 0)
            out_lamps[n++] = lamp;
        line = is_last ? end : end + 1;
    }
    free(text);
    if (ret >= 0 && n == 0)
        ret = gn_error_set(out_error, -EINVAL, "%s: no lamp in it", path);
    return ret < 0 ? ret : n;
}
