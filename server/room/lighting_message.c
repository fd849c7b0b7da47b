/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/room/lighting_message.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "common/half.h"
#include "common/projection.h"
#include "proto/attr.h"

#define MAP_BYTES ((size_t)GN_LIGHTING_MAP_WIDTH * GN_LIGHTING_MAP_HEIGHT * 3 * 2)

static void put_float(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(bits >> (8 * i));
}

struct map_task {
    const struct gn_radiance_map *map;
    struct gn_projection latlong;
    uint8_t *out;
};

static void fill_map_row(void *context, int y, int worker)
{
    (void)worker;
    const struct map_task *task = context;
    uint8_t *at = task->out + (size_t)y * GN_LIGHTING_MAP_WIDTH * 6;
    for (int x = 0; x < GN_LIGHTING_MAP_WIDTH; x++) {
        double dir[3];
        float rgb[3] = {0, 0, 0};
        if (gn_projection_get_direction(&task->latlong, x + 0.5, y + 0.5, dir)) {
            const float dir_world[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
            gn_radiance_map_get_radiance(task->map, dir_world, rgb);
        }
        for (int c = 0; c < 3; c++, at += 2) {
            uint16_t half = gn_half_from_float(fminf(rgb[c], GN_HALF_MAX));
            at[0] = (uint8_t)half;
            at[1] = (uint8_t)(half >> 8);
        }
    }
}

static void put_lights(const struct gn_lighting_state *state, uint8_t *at)
{
    for (int i = 0; i < state->n_lights; i++, at += GN_LIGHT_RECORD_BYTES) {
        const struct gn_light *light = &state->lights[i];
        for (int c = 0; c < 3; c++) {
            put_float(at + 4 * c, light->dir_world[c]);
            put_float(at + 16 + 4 * c, light->irradiance[c]);
        }
        put_float(at + 12, light->angular_radius);
        put_float(at + 28, light->distance < INFINITY ? light->distance : 0);
    }
}

int gn_lighting_message_make(const struct gn_lighting_state *state, bool with_map,
                             struct gn_pool *pool, struct gn_msg_lighting_state *out_body,
                             struct gn_buf **out_payload)
{
    size_t light_bytes = (size_t)state->n_lights * GN_LIGHT_RECORD_BYTES;
    struct gn_buf *payload = NULL;
    int rc = gn_buf_create(light_bytes + (with_map ? MAP_BYTES : 0), &payload);
    if (rc < 0)
        return rc;
    put_lights(state, payload->data);

    struct gn_msg_lighting_state body = {
        .sequence = state->sequence,
        .capture_time_ns = state->capture_time_ns,
        .light_count = (uint32_t)state->n_lights,
        .probe = state->stream,
    };
    for (int i = 0; i < state->n_lights && body.discs_count < GN_ARRAY_LEN(body.discs); i++)
        if (state->lights[i].is_disc)
            body.discs[body.discs_count++] = (uint32_t)i;
    for (int i = 0; i < 3; i++)
        body.probe_position_m[i] = (float)state->map->world_from_probe.translation[i];
    for (int i = 0; state->has_sh && i < 27; i++)
        body.sh[i] = (float)state->sh[i / 3][i % 3];
    if (with_map) {
        struct map_task task = {
            .map = state->map,
            .latlong = {.type = GN_PROJECTION_LATLONG,
                        .width = GN_LIGHTING_MAP_WIDTH,
                        .height = GN_LIGHTING_MAP_HEIGHT},
            .out = payload->data + light_bytes,
        };
        const char *reason = NULL;
        if (gn_projection_init(&task.latlong, &reason) < 0) { // a bug: the size is ours
            gn_buf_unref(&payload);
            return -EINVAL;
        }
        gn_pool_run(pool, GN_LIGHTING_MAP_HEIGHT, fill_map_row, &task);
        body.map_width = GN_LIGHTING_MAP_WIDTH;
        body.map_height = GN_LIGHTING_MAP_HEIGHT;
    }
    *out_body = body;
    *out_payload = payload;
    return 0;
}
