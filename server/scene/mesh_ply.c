/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "server/scene/mesh_import.h"

// Largest header of a PLY file, bytes.
#define MAX_PLY_HEADER 65536

int gn_mesh_check_ply_header(const char *path, struct gn_error *out_error)
{
    char header[MAX_PLY_HEADER + 1];
    FILE *file = fopen(path, "rbe");
    if (!file)
        return gn_error_set(out_error, -errno, "%s: cannot read the mesh: %s", path,
                            strerror(errno));
    size_t size = fread(header, 1, MAX_PLY_HEADER, file);
    struct stat info = {0};
    bool failed = ferror(file) != 0 || fstat(fileno(file), &info) != 0;
    fclose(file);
    if (failed)
        return gn_error_set(out_error, -EIO, "%s: cannot read the mesh", path);
    header[size] = '\0'; // the text ends at the first NUL, if any
    const char *end = strstr(header, "end_header");
    if (!end)
        return gn_error_set(out_error, -EINVAL, "%s: its PLY header has no end_header in %d bytes",
                            path, MAX_PLY_HEADER);
    for (const char *line = header; (line = strstr(line, "element")) && line < end; line++) {
        long long count = 0;
        if (sscanf(line, "element %*63s %18lld", &count) == 1 &&
            (count < 0 || count > (long long)info.st_size))
            return gn_error_set(out_error, -EINVAL,
                                "%s: its PLY header promises %lld elements in %lld bytes", path,
                                count, (long long)info.st_size);
    }
    for (const char *line = header; (line = strstr(line, "property list")) && line < end; line++) {
        char type[16] = "";
        if (sscanf(line, "property list %15s", type) == 1 && !strstr(type, "char") &&
            !strstr(type, "short") && !strstr(type, "int8") && !strstr(type, "int16"))
            return gn_error_set(out_error, -EINVAL,
                                "%s: its PLY lists are counted as %s; uchar and ushort are read",
                                path, type);
    }
    return 0;
}
