/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <math.h>

#include "server/light/luminance.h"
#include "server/light/partition_internal.h"

/* The largest luminance after a 5 x 5 mean over texels that show something: one hot texel does not
 * decide for all. */
double gn_partition_get_smoothed_max(const struct gn_radiance_map *map)
{
    double max = 0;
    int width = map->radiance.width, height = map->radiance.height;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double sum = 0, weight = 0;
            for (int i = 0; i < 25; i++) {
                int nx = x + i % 5 - 2, ny = y + i / 5 - 2;
                if (nx < 0 || nx >= width || ny < 0 || ny >= height)
                    continue;
                double w = (double)map->solid_angle[(size_t)ny * (size_t)width + (size_t)nx];
                sum += w * gn_luminance(gn_image_at(&map->radiance, nx, ny));
                weight += w;
            }
            max = weight > 0 ? fmax(max, sum / weight) : max;
        }
    }
    return max;
}
