/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/kernels/kernels.h"

#include <stdbool.h>
#include <stddef.h>

extern const struct gn_kernels gn_kernels_plain;
#ifdef GN_KERNELS_X86
extern const struct gn_kernels gn_kernels_avx2;
extern const struct gn_kernels gn_kernels_avx512;

static bool has_avx2(void)
{
    return __builtin_cpu_supports("avx2");
}

static bool has_avx512(void)
{
    return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#else
#define gn_kernels_avx2 gn_kernels_plain
#define gn_kernels_avx512 gn_kernels_plain

static bool has_avx2(void)
{
    return false;
}

static bool has_avx512(void)
{
    return false;
}
#endif

const struct gn_kernels *gn_kernels_get(void)
{
    return has_avx512() ? &gn_kernels_avx512 : has_avx2() ? &gn_kernels_avx2 : &gn_kernels_plain;
}

const struct gn_kernels *gn_kernels_get_at(int i)
{
    if (i == 0)
        return &gn_kernels_plain;
    if (i == 1 && has_avx2())
        return &gn_kernels_avx2;
    return i == 2 && has_avx512() ? &gn_kernels_avx512 : NULL;
}
