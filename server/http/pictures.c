/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The page's pictures, encoded when somebody asks. */
#include <errno.h>
#include <stdlib.h>

#include "server/http/http_internal.h"
#include "server/light/light_picture.h"

static int encode(struct gn_jpeg *jpeg, const struct gn_image8 *image, struct gn_document *out)
{
    size_t bound = gn_jpeg_get_bound(image->width, image->height), size = 0;
    uint8_t *data = malloc(bound);
    if (!data)
        return -ENOMEM;
    const struct gn_jpeg_options options = {.quality = 85};
    int rc = gn_jpeg_encode(jpeg, image, &options, data, bound, &size, NULL);
    if (rc < 0) {
        free(data);
        return rc;
    }
    *out = (struct gn_document){data, size, "image/jpeg"};
    return 0;
}

int gn_http_make_composite(struct gn_http_view *view, struct gn_room *room, struct gn_document *out)
{
    struct gn_snapshot *snapshot = gn_room_get_composite(room);
    if (!snapshot)
        return -ENOENT;
    int rc = encode(view->jpeg, &snapshot->image, out);
    gn_snapshot_unref(&snapshot);
    return rc;
}

int gn_http_make_light(struct gn_http_view *view, struct gn_room *room, struct gn_document *out)
{
    struct gn_lighting_state *light = gn_room_get_light(room);
    if (!light)
        return -ENOENT;
    struct gn_image8 picture = {0};
    int rc = gn_light_picture_make(light, NULL, NULL, &picture);
    gn_lighting_state_unref(&light);
    if (rc == 0)
        rc = encode(view->jpeg, &picture, out);
    gn_image8_finish(&picture);
    return rc;
}
