/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/light/method.h"

#include <errno.h>
#include <string.h>

static const struct gn_light_maker makers[GN_LIGHT_METHOD_COUNT] = {
    [GN_LIGHT_PARTITION_ENERGY] = {"partition", gn_partition_make_lights},
    [GN_LIGHT_PARTITION_SEED] = {"seed", gn_partition_make_lights},
    [GN_LIGHT_PENROSE] = {"penrose", gn_penrose_make_lights},
    [GN_LIGHT_MEDIAN_CUT] = {"median-cut", gn_median_cut_make_lights},
    [GN_LIGHT_VARIANCE] = {"variance", gn_variance_make_lights},
    [GN_LIGHT_INVERSION] = {"inversion", gn_inversion_make_lights},
    [GN_LIGHT_QUADTREE] = {"quadtree", gn_quadtree_make_lights, true},
};

const struct gn_light_maker *gn_light_maker_get(enum gn_light_method method)
{
    return (unsigned)method < GN_LIGHT_METHOD_COUNT ? &makers[method] : NULL;
}

const char *gn_light_method_get_name(enum gn_light_method method)
{
    const struct gn_light_maker *maker = gn_light_maker_get(method);
    return maker ? maker->name : NULL;
}

int gn_light_method_from_name(const char *name, enum gn_light_method *out_method)
{
    for (int i = 0; i < GN_LIGHT_METHOD_COUNT; i++) {
        if (strcmp(name, makers[i].name) == 0) {
            *out_method = (enum gn_light_method)i;
            return 0;
        }
    }
    return -EINVAL;
}
