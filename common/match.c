/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "common/match.h"

#include <errno.h>
#include <string.h>

#include "common/camera.h"

int gn_match_check(const struct gn_match *match, const char **out_reason)
{
    const char *reason = NULL;
    for (int i = 0; i < 3; i++)
        if (!(match->noise_slope[i] >= 0 && match->noise_slope[i] <= 1 &&
              match->noise_offset[i] >= 0 && match->noise_offset[i] <= 1))
            reason = "slope and offset of a camera's noise must lie in [0, 1] in each channel";
    if (!(match->blur_px >= 0 && match->blur_px <= GN_MATCH_MAX_BLUR_PX))
        reason = "a camera's blur must lie in [0, 8] px";
    if (reason && out_reason)
        *out_reason = reason;
    return reason ? -EINVAL : 0;
}

bool gn_match_has_noise(const struct gn_match *match)
{
    for (int i = 0; i < 3; i++)
        if (match->noise_slope[i] > 0 || match->noise_offset[i] > 0)
            return true;
    return false;
}

void gn_match_keep(unsigned parts, struct gn_camera *camera)
{
    struct gn_response *response = &camera->response;
    struct gn_match *match = &camera->match;
    if (!(parts & GN_MATCH_EXPOSURE))
        response->scale = 1;
    if (!(parts & GN_MATCH_WHITE_BALANCE))
        memset(response->to_rec709, 0, sizeof(response->to_rec709));
    if (!(parts & GN_MATCH_RESPONSE))
        response->type = GN_RESPONSE_SRGB;
    if (!(parts & GN_MATCH_DISTORTION))
        memset(camera->distortion, 0, sizeof(camera->distortion));
    if (!(parts & GN_MATCH_NOISE)) {
        memset(match->noise_slope, 0, sizeof(match->noise_slope));
        memset(match->noise_offset, 0, sizeof(match->noise_offset));
    }
    if (!(parts & GN_MATCH_BLUR))
        match->blur_px = 0;
}
