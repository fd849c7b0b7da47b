/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/render/kept.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int gn_kept_reserve(struct kept *kept, size_t n_blocks)
{
    gn_kept_finish(kept);
    kept->sights = aligned_alloc(_Alignof(struct sight), n_blocks * sizeof(*kept->sights));
    return kept->sights ? 0 : -ENOMEM;
}

void gn_kept_finish(struct kept *kept)
{
    free(kept->sights);
    memset(kept, 0, sizeof(*kept));
}

static bool is_same_pose(const struct gn_pose *a, const struct gn_pose *b)
{
    return memcmp(a->rotation, b->rotation, sizeof(a->rotation)) == 0 &&
           memcmp(a->translation, b->translation, sizeof(a->translation)) == 0;
}

void gn_kept_begin(struct kept *kept, struct frame *frame)
{
    if (frame->pass || frame->options.all_passes)
        return;
    bool rests = kept->version == frame->scene->version &&
                 kept->no_virtual == frame->options.no_virtual &&
                 gn_primary_has_same_rays(&kept->camera, frame->camera) &&
                 is_same_pose(&kept->camera.world_from_camera, &frame->camera->world_from_camera);
    if (!rests) {
        kept->camera = *frame->camera;
        kept->version = frame->scene->version;
        kept->no_virtual = frame->options.no_virtual;
        kept->is_full = false;
        return;
    }
    frame->kept = kept->sights;
    frame->is_seen = kept->is_full;
}

void gn_kept_end(struct kept *kept, const struct frame *frame)
{
    kept->is_full |= frame->kept != NULL;
}
