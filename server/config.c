/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "server/config.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "common/text.h"
#include "server/light_options.h"

/** Lights to choose from under a budget where nothing is said. */
#define BUDGET_LIGHTS 256

/** The path as the server opens it. */
static int get_scene_path(const struct gn_options *o, const char *room, char out[static 4096],
                          struct gn_error *error)
{
    const char *path = gn_options_get_string(o, "room", room, "scene");
    const char *config = gn_options_get_string(o, NULL, NULL, "config");
    const char *slash = config ? strrchr(config, '/') : NULL;
    bool is_from_file =
        strcmp(gn_options_get_source(o, "room", room, "scene"), "command line") != 0;
    int n = slash && is_from_file && path[0] != '/'
                ? snprintf(out, 4096, "%.*s/%s", (int)(slash - config), config, path)
                : snprintf(out, 4096, "%s", path);
    if (n >= 4096)
        return gn_error_set(error, -ENAMETOOLONG, "room %s: the scene's path is too long", room);
    return 0;
}

static int get_light(const struct gn_options *o, const char *room, struct gn_light_options *out,
                     struct gn_error *out_error)
{
    *out = (struct gn_light_options){
        .method = (enum gn_light_method)gn_options_get_enum(o, "room", room, "light-method"),
        .n_lights = gn_options_get_int(o, "room", room, "lights"),
        .smoothing = 1e-3 * gn_options_get_double(o, "room", room, "light-smoothing-ms"),
    };
    return gn_light_options_read(o, "room", room, out, out_error);
}

int gn_config_get_room(const struct gn_options *options, int i, char out_scene_path[static 4096],
                       struct gn_room_options *out_room, struct gn_error *out_error)
{
    const struct gn_options *o = options;
    const char *room = gn_options_get_name(o, "room", i);
    int rc = get_scene_path(o, room, out_scene_path, out_error);
    if (rc < 0)
        return rc;
    double albedo = gn_options_get_double(o, "room", room, "ground-albedo");
    struct gn_room_options r = {
        .name = room,
        .node = gn_options_get_string(o, "server", NULL, "name"),
        .scene_path = out_scene_path,
        .map = {.ground_albedo = (float)albedo, .no_fill = albedo == 0},
        .render =
            {
                .shading = (enum gn_shading)gn_options_get_enum(o, "room", room, "shading"),
                .no_shadow = !gn_options_get_bool(o, "room", room, "shadows"),
                .shadow_unweighted = !gn_options_get_bool(o, "room", room, "shadow-cosine"),
                .shadow_ignore_real = !gn_options_get_bool(o, "room", room, "shadow-real-blockers"),
            },
        .emitters = {.n_pieces = gn_options_get_int(o, "room", room, "emitter-pieces")},
        .budget_ms = gn_options_get_double(o, "room", room, "budget-ms"),
        .environment_noise = gn_options_get_double(o, "room", room, "environment-noise"),
        .encoded_multiply = gn_options_get_enum(o, "room", room, "composite") == 1,
        .unmatched = GN_MATCH_ALL & ~gn_options_get_set(o, "room", room, "match"),
        .refuse_reference = !gn_options_get_bool(o, "room", room, "allow-reference"),
        .no_refining = !gn_options_get_bool(o, "room", room, "refine"),
        .max_picture_width = gn_options_get_int(o, "room", room, "max-picture-width"),
        .max_picture_height = gn_options_get_int(o, "room", room, "max-picture-height"),
        .max_environment_width = gn_options_get_int(o, "room", room, "max-environment-width"),
        .max_environment_height = gn_options_get_int(o, "room", room, "max-environment-height"),
        .holdable_margin = gn_options_get_double(o, "room", room, "rate-margin"),
    };
    rc = get_light(o, room, &r.light, out_error);
    if (r.budget_ms > 0 && gn_options_is_default(o, "room", room, "lights"))
        r.light.n_lights = BUDGET_LIGHTS;
    if (rc == 0)
        *out_room = r;
    return rc;
}

int gn_config_get_net(const struct gn_options *options, struct gn_net_options *out_net,
                      struct gn_error *out_error)
{
    const struct gn_options *o = options;
    const char *name = gn_options_get_string(o, "server", NULL, "name");
    char clean[64]; // as messages and documents can hold it
    snprintf(clean, sizeof(clean), "%s", name);
    gn_text_clean(clean);
    if (!name[0] || strcmp(clean, name) != 0)
        return gn_error_set(out_error, -EINVAL,
                            "[server] name = %s: 1 to 63 bytes of UTF-8 without control "
                            "characters are right",
                            clean);
    out_net->address = gn_options_get_address(o, "server", NULL, "listen");
    out_net->server_name = gn_options_get_string(o, "server", NULL, "name");
    out_net->max_connections = gn_options_get_int(o, "server", NULL, "max-connections");
    out_net->hello_timeout_ms = gn_options_get_int(o, "server", NULL, "hello-timeout-ms");
    out_net->idle_timeout_ms = gn_options_get_int(o, "server", NULL, "idle-timeout-ms");
    out_net->stall_timeout_ms = gn_options_get_int(o, "server", NULL, "stall-timeout-ms");
    return 0;
}
