/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "common/composite.h"
#include "common/exr.h"
#include "common/file.h"
#include "common/png.h"
#include "server/light/light_picture.h"
#include "server/render_cli/cli.h"

#define MAX_OUTPUTS 6

/** All paths that are written, the layers last. Returns their number. */
static int list_outputs(const struct gn_cli_request *request, const char *out[MAX_OUTPUTS])
{
    const char *const all[MAX_OUTPUTS] = {request->report,         request->light_map,
                                          request->irradiance_map, request->shadow_png,
                                          request->composite_png,  request->out};
    int n = 0;
    for (int i = 0; i < MAX_OUTPUTS; i++) {
        if (all[i])
            out[n++] = all[i];
    }
    return n;
}

/** Names say what is in the files. */
static int check_names(const struct gn_cli_request *request, struct gn_error *out_error)
{
    const struct {
        const char *key, *path, *ending;
    } outputs[] = {
        {"out", request->out, ".exr"},
        {"irradiance-map", request->irradiance_map, ".exr"},
        {"light-map", request->light_map, ".png"},
        {"shadow-png", request->shadow_png, ".png"},
        {"composite-png", request->composite_png, ".png"},
    };
    for (size_t i = 0; i < sizeof(outputs) / sizeof(outputs[0]); i++) {
        if (!outputs[i].path)
            continue;
        size_t n = strlen(outputs[i].path), n_ending = strlen(outputs[i].ending);
        if (n <= n_ending || strcasecmp(outputs[i].path + n - n_ending, outputs[i].ending) != 0)
            return gn_error_set(out_error, -EINVAL,
                                "--%s %s: is written as %s: the name must end so", outputs[i].key,
                                outputs[i].path, outputs[i].ending);
    }
    return 0;
}

int gn_cli_check_outputs(const struct gn_cli_request *request, struct gn_error *out_error)
{
    const char *const inputs[] = {request->scene, request->env, request->env_params,
                                  request->camera, request->background};
    const char *outputs[MAX_OUTPUTS];
    int n = list_outputs(request, outputs);
    int ret = check_names(request, out_error);
    if (ret < 0)
        return ret;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++) {
            if (strcmp(outputs[i], outputs[k]) == 0)
                return gn_error_set(out_error, -EINVAL, "%s: named for two outputs", outputs[i]);
        }
        for (size_t k = 0; k < sizeof(inputs) / sizeof(inputs[0]); k++) {
            if (inputs[k] && strcmp(outputs[i], inputs[k]) == 0)
                return gn_error_set(out_error, -EINVAL, "%s: an input and an output", outputs[i]);
        }
        struct gn_file_writer writer = {0};
        ret = gn_file_writer_open(&writer, outputs[i], out_error);
        if (ret < 0)
            return ret;
        gn_file_writer_abort(&writer);
    }
    return 0;
}

static void add_channels(struct gn_exr_channel *channels, int *n, const char *const *names,
                         const struct gn_image *image)
{
    for (int k = 0; k < image->channels; k++)
        channels[(*n)++] = (struct gn_exr_channel){
            .name = names[k], .data = image->data + k, .stride = image->channels};
}

static int write_layers(const char *path, const struct gn_layers *layers,
                        const struct gn_image *composite, struct gn_error *out_error)
{
    static const char *const names[5][4] = {
        {"virtual.R", "virtual.G", "virtual.B", "virtual.A"},
        {"shadow.R", "shadow.G", "shadow.B"},
        {"added.R", "added.G", "added.B"},
        {"depth.Z"},
        {"composite.R", "composite.G", "composite.B"},
    };
    const struct gn_image *const images[5] = {&layers->virtual_rgba, &layers->shadow,
                                              &layers->added, &layers->depth, composite};
    struct gn_exr_channel channels[16];
    int n = 0;
    for (int i = 0; i < 5; i++) {
        if (images[i])
            add_channels(channels, &n, names[i], images[i]);
    }
    return gn_exr_write_file(path, layers->width, layers->height, channels, n, out_error);
}

/** Codes of [0, 1] values, rounded. */
static int write_png(const char *path, const float *values, int width, int height,
                     struct gn_error *out_error)
{
    struct gn_image8 image = {0};
    int ret = gn_image8_init(&image, width, height, 3);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: out of memory", path);
    size_t n = 3 * (size_t)width * (size_t)height;
    for (size_t i = 0; i < n; i++)
        image.data[i] = (uint8_t)lrintf(255.0f * fminf(fmaxf(values[i], 0.0f), 1.0f));
    ret = gn_png_write_file(path, &image, out_error);
    gn_image8_finish(&image);
    return ret;
}

static struct gn_composite_layers get_composite_layers(const struct gn_layers *layers)
{
    return (struct gn_composite_layers){
        .virtual_rgba = &layers->virtual_rgba, .shadow = &layers->shadow, .added = &layers->added};
}

/** In codes where the background has codes, so that untouched pixels keep theirs. composite is
 * encoded in place otherwise, so it comes after the layers' copy is taken. is_literal: the factor
 * scales the codes, as the 2007 paper has it. */
static int write_composite_png(const char *path, bool is_literal,
                               const struct gn_cli_result *result, const struct gn_image *composite,
                               struct gn_compositor *compositor, struct gn_error *out_error)
{
    const struct gn_image8 *codes = &result->background->codes8;
    const struct gn_response *response = &result->camera->response;
    if (codes->data) {
        struct gn_composite_layers layers = get_composite_layers(result->layers);
        const struct gn_composite_options options = {
            .encoded_multiply = is_literal, .match = result->camera->match, .frame = result->seed};
        struct gn_image8 out = {0};
        int ret = gn_image8_init(&out, codes->width, codes->height, 3);
        if (ret == 0)
            ret = gn_compositor_put_image8(compositor, &layers, codes, response, &options, &out);
        if (ret < 0)
            (void)gn_error_set(out_error, ret, "%s: cannot composite", path);
        else
            ret = gn_png_write_file(path, &out, out_error);
        gn_image8_finish(&out);
        return ret;
    }
    struct gn_image encoded = {0};
    int ret = gn_image_init(&encoded, composite->width, composite->height, 3);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: out of memory", path);
    long n = (long)composite->width * composite->height;
    memcpy(encoded.data, composite->data, 3 * (size_t)n * sizeof(float));
    gn_response_from_radiance(response, encoded.data, n);
    ret = write_png(path, encoded.data, encoded.width, encoded.height, out_error);
    gn_image_finish(&encoded);
    return ret;
}

static int write_light_map(const char *path, const struct gn_lighting_state *light,
                           struct gn_pool *pool, struct gn_error *out_error)
{
    struct gn_image8 picture = {0};
    int ret = gn_light_picture_make(light, NULL, pool, &picture);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: %s", path, strerror(-ret));
    ret = gn_png_write_file(path, &picture, out_error);
    gn_image8_finish(&picture);
    return ret;
}

static int write_irradiance_map(const char *path, const struct gn_lighting_state *light,
                                struct gn_error *out_error)
{
    static const char *const names[] = {"R", "G", "B"};
    struct gn_exr_channel channels[3];
    struct gn_image map = {0};
    int ret = gn_irradiance_make_map(&light->irradiance, GN_IRRADIANCE_MAP_WIDTH,
                                     GN_IRRADIANCE_MAP_WIDTH / 2, &map);
    if (ret < 0)
        return gn_error_set(out_error, ret, "%s: out of memory", path);
    int n = 0;
    add_channels(channels, &n, names, &map);
    ret = gn_exr_write_file(path, map.width, map.height, channels, n, out_error);
    gn_image_finish(&map);
    return ret;
}

static int make_composite(const struct gn_cli_result *result, struct gn_compositor *compositor,
                          struct gn_image *out, struct gn_error *out_error)
{
    struct gn_composite_layers layers = get_composite_layers(result->layers);
    const struct gn_composite_options options = {.match = result->camera->match,
                                                 .frame = result->seed};
    int ret = gn_image_init(out, result->layers->width, result->layers->height, 3);
    if (ret == 0)
        ret = gn_compositor_put_linear(compositor, &layers, &result->background->linear,
                                       &result->camera->response, &options, out);
    return ret < 0 ? gn_error_set(out_error, ret, "cannot composite") : 0;
}

static int write_all(const struct gn_cli_request *request, const struct gn_cli_result *result,
                     const struct gn_image *composite, struct gn_compositor *compositor,
                     struct gn_pool *pool, int *n_written, struct gn_error *out_error)
{
    const struct gn_layers *layers = result->layers;
    int ret = 0;
    if (request->report) {
        ret = gn_cli_write_report(request, result, out_error);
        *n_written += ret == 0;
    }
    if (ret == 0 && request->light_map) {
        ret = write_light_map(request->light_map, result->light, pool, out_error);
        *n_written += ret == 0;
    }
    if (ret == 0 && request->irradiance_map) {
        ret = write_irradiance_map(request->irradiance_map, result->light, out_error);
        *n_written += ret == 0;
    }
    if (ret == 0 && request->shadow_png) {
        ret = write_png(request->shadow_png, layers->shadow.data, layers->width, layers->height,
                        out_error);
        *n_written += ret == 0;
    }
    if (ret == 0 && request->composite_png) {
        ret =
            write_composite_png(request->composite_png, request->render.quality == GN_QUALITY_SEED,
                                result, composite, compositor, out_error);
        *n_written += ret == 0;
    }
    if (ret == 0)
        ret = write_layers(request->out, layers, composite, out_error);
    return ret;
}

int gn_cli_write_outputs(const struct gn_cli_request *request, const struct gn_cli_result *result,
                         struct gn_pool *pool, struct gn_error *out_error)
{
    struct gn_image composite = {0};
    struct gn_compositor *compositor = NULL;
    int n_written = 0;
    int ret = gn_compositor_create(pool, &compositor);
    if (ret < 0)
        return gn_error_set(out_error, ret, "out of memory");
    if (result->background)
        ret = make_composite(result, compositor, &composite, out_error);
    if (ret == 0)
        ret = write_all(request, result, result->background ? &composite : NULL, compositor, pool,
                        &n_written, out_error);
    if (ret < 0) {
        const char *outputs[MAX_OUTPUTS];
        (void)list_outputs(request, outputs);
        for (int i = 0; i < n_written; i++)
            (void)unlink(outputs[i]);
    }
    gn_image_finish(&composite);
    gn_compositor_destroy(&compositor);
    return ret;
}
