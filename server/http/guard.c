/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/http/guard.h"

#include <string.h>
#include <strings.h>

#include "proto/attr.h"

bool gn_guard_is_host(const char *host)
{
    static const char *const names[] = {"127.0.0.1", "localhost", "[::1]"};
    for (size_t i = 0; host && i < GN_ARRAY_LEN(names); i++) {
        size_t n = strlen(names[i]);
        if (strncasecmp(host, names[i], n) != 0)
            continue;
        const char *rest = host + n;
        if (!rest[0])
            return true;
        size_t digits = strspn(rest + 1, "0123456789");
        return rest[0] == ':' && digits >= 1 && digits <= 5 && !rest[1 + digits];
    }
    return false;
}

bool gn_guard_is_origin(const char *origin)
{
    return !origin || (strncmp(origin, "http://", 7) == 0 && gn_guard_is_host(origin + 7));
}
