/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The light of the room as a small mirror ball that the camera sees: of LIGHTING_STATE the
 * harmonics, which are smooth, and the lights as dots, larger where they are stronger. It needs no
 * map, which would be megabytes for each state. Thread-safety: unsafe.
 */
#ifndef GN_CLIENT_VIEW_LIGHT_BALL_H
#define GN_CLIENT_VIEW_LIGHT_BALL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "client/view/overlay.h"
#include "common/pose.h"

/** Lights that are drawn: the strongest. */
#define GN_LIGHT_BALL_LIGHTS 64

/** Zeroed at first. */
struct gn_light_ball {
    bool is_known;
    uint64_t probe;    // whose light this is
    uint32_t n_lights; // that it has
    float sh[27];      // as LIGHTING_STATE
    int n_drawn;       // strongest first
    struct gn_light_ball_light {
        float dir_world[3]; // unit
        float irradiance[3];
        float luminance;
    } lights[GN_LIGHT_BALL_LIGHTS];
};

/** The newest state of any probe; one of a probe that has left ends what it showed. payload: as it
 * came, checked by the connection; lights that are no numbers are passed over. */
void gn_light_ball_take(struct gn_light_ball *ball, const struct gn_msg_lighting_state *state,
                        const uint8_t *payload, size_t payload_bytes);

/** The panel that it is drawn on, at the lower right. */
struct gn_overlay_box gn_light_ball_get_box(const struct gn_canvas *canvas);

/** As a camera of that pose sees it. */
void gn_light_ball_draw(const struct gn_light_ball *ball, const struct gn_pose *world_from_camera,
                        struct gn_canvas *canvas);

#endif
