/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#define _GNU_SOURCE // gettid
#include "client/capture/gige_device.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <arv.h>

#define N_BUFFERS 6
/** Bounds of what a camera may announce. */
#define MAX_PICTURE_BYTES (64 << 20)
#define MAX_EXTRA_BYTES (1 << 20) // chunks behind the picture
/** Receive buffer; the kernel cuts it to net.core.rmem_max. Without CAP_NET_RAW Aravis receives by
 * a plain socket, and with the usual 208 KiB most of a picture is lost. */
#define SOCKET_BUFFER_BYTES (8 << 20)
/** How often control is asked for again. */
#define CONTROL_RETRY_MS 200
/** Longest exposure that a camera is believed. */
#define MAX_EXPOSURE_US 3.6e9
/** Kinds of triggers that are looked at; the standard has 18 (SFNC 2.7, "TriggerSelector"). */
#define MAX_TRIGGERS 64

static int set_arv_error(struct gn_error *out_error, int err, const struct gn_gige_place *place,
                         const char *what, GError **error)
{
    gn_error_set(out_error, err, "camera %s: %s: %s", place->id, what,
                 *error ? (*error)->message : "no reason given");
    g_clear_error(error);
    return err;
}

/** Opens the device: where its interface is known, without asking all networks for it. */
static ArvDevice *open_device(const struct gn_gige_place *place, GError **error)
{
    if (!place->interface[0])
        return arv_interface_open_device(arv_gv_interface_get_instance(), place->id, error);
    GInetAddress *interface = g_inet_address_new_from_string(place->interface);
    GInetAddress *address = g_inet_address_new_from_string(place->address);
    ArvDevice *device = NULL;
    if (interface && address)
        device = arv_gv_device_new(interface, address, error);
    g_clear_object(&interface);
    g_clear_object(&address);
    return device;
}

static void copy_address(GSocketAddress *socket_address, char *out, size_t size)
{
    GInetAddress *address =
        g_inet_socket_address_get_address(G_INET_SOCKET_ADDRESS(socket_address));
    char *text = g_inet_address_to_string(address);
    snprintf(out, size, "%s", text);
    g_free(text);
}

/** A client that died keeps the camera until its heartbeat is missed, 3 s with most. Tries are
 * counted, not time: where the machine stands still the camera does not see the time either. */
static int take_control(ArvGvDevice *device, const struct gn_gige_place *place, int patience_ms,
                        struct gn_error *out_error)
{
    for (int waited_ms = 0; !arv_gv_device_is_controller(device); waited_ms += CONTROL_RETRY_MS) {
        if (waited_ms >= patience_ms)
            return gn_error_set(out_error, -EBUSY,
                                "camera %s: another program controls it; end that first",
                                place->id);
        g_usleep(CONTROL_RETRY_MS * 1000);
        (void)!arv_gv_device_take_control(device, NULL);
    }
    return 0;
}

/** How well a format serves: more bits first, then colour, then what need not be copied. */
static int rate_format(const struct gn_pixels_format *f, bool is_8_bit)
{
    int bits = is_8_bit ? 8 - abs(f->bits - 8) : f->bits;
    return 100 * bits + 10 * (f->kind != GN_PIXELS_MONO) + (f->packing == GN_PIXELS_UNPACKED) * 2 +
           gn_pixels_is_same(f, is_8_bit);
}

/** The best of the camera's formats; NULL: none that we read. */
static const struct gn_pixels_format *choose_format(ArvCamera *camera, bool is_8_bit)
{
    const struct gn_pixels_format *best = NULL;
    guint n = 0;
    gint64 *codes = arv_camera_dup_available_pixel_formats(camera, &n, NULL);
    for (guint i = 0; i < n; i++) {
        const struct gn_pixels_format *f = gn_pixels_find((uint32_t)codes[i]);
        if (f && (!best || rate_format(f, is_8_bit) > rate_format(best, is_8_bit)))
            best = f;
    }
    g_free(codes);
    return best;
}

static int set_format(struct gn_gige_device *d, const struct gn_gige_place *place,
                      const struct gn_live_options *options, struct gn_error *out_error)
{
    GError *error = NULL;
    if (options->pixel_format)
        arv_camera_set_pixel_format_from_string(d->camera, options->pixel_format, &error);
    else if (choose_format(d->camera, options->is_8_bit))
        arv_camera_set_pixel_format(d->camera, choose_format(d->camera, options->is_8_bit)->code,
                                    &error);
    return error ? set_arv_error(out_error, -EINVAL, place, "cannot set --pixel-format", &error)
                 : 0;
}

static int read_format(struct gn_gige_device *d, const struct gn_gige_place *place,
                       struct gn_error *out_error)
{
    GError *error = NULL;
    ArvPixelFormat code = arv_camera_get_pixel_format(d->camera, &error);
    if (error)
        return set_arv_error(out_error, -EIO, place, "cannot read its pixel format", &error);
    d->format = gn_pixels_find(code);
    if (!d->format)
        return gn_error_set(out_error, -ENOTSUP,
                            "camera %s: pixel format 0x%08x cannot be read; what can: %s",
                            place->id, code, gn_pixels_get_names());
    return 0;
}

static int set_size(struct gn_gige_device *d, const struct gn_gige_place *place,
                    const struct gn_live_options *options, struct gn_error *out_error)
{
    GError *error = NULL;
    int x, y;
    if (options->width > 0)
        arv_camera_set_region(d->camera, -1, -1, options->width, options->height, &error);
    if (!error)
        arv_camera_get_region(d->camera, &x, &y, &d->width, &d->height, &error);
    if (error)
        return set_arv_error(out_error, -EINVAL, place, "cannot set the size of its pictures",
                             &error);
    if (options->width > 0 && (d->width != options->width || d->height != options->height))
        return gn_error_set(out_error, -EINVAL,
                            "camera %s: asked for pictures of %dx%d, it gives %dx%d", place->id,
                            options->width, options->height, d->width, d->height);
    d->picture_bytes = gn_pixels_get_bytes(d->format, d->width, d->height);
    int least = d->format->kind == GN_PIXELS_BAYER ? 2 : 1;
    if (d->picture_bytes == 0 || d->picture_bytes > MAX_PICTURE_BYTES || d->width < least ||
        d->height < least)
        return gn_error_set(out_error, -EINVAL,
                            "camera %s: its pictures of %dx%d %s cannot be; sides are in [%d, "
                            "16384], a picture has at most %d MiB",
                            place->id, d->width, d->height, d->format->name, least,
                            MAX_PICTURE_BYTES >> 20);
    return 0;
}

/** Aravis switches all triggers off for it, and leaves the selector at the last. */
static void set_rate(ArvCamera *camera, double rate_hz, GError **error)
{
    ArvDevice *device = arv_camera_get_device(camera);
    char *selector = g_strdup(arv_device_get_string_feature_value(device, "TriggerSelector", NULL));
    arv_camera_set_frame_rate(camera, rate_hz, error);
    if (selector)
        arv_device_set_string_feature_value(device, "TriggerSelector", selector, NULL);
    g_free(selector);
}

/** Rate, exposure and gain, where asked for. */
static int set_exposure(struct gn_gige_device *d, const struct gn_gige_place *place,
                        const struct gn_live_options *options, struct gn_error *out_error)
{
    GError *error = NULL;
    ArvCamera *c = d->camera;
    arv_camera_set_acquisition_mode(c, ARV_ACQUISITION_MODE_CONTINUOUS, NULL);
    if (options->exposure_us > 0) {
        if (arv_camera_is_exposure_auto_available(c, NULL))
            arv_camera_set_exposure_time_auto(c, ARV_AUTO_OFF, NULL);
        arv_camera_set_exposure_time(c, options->exposure_us, &error);
    }
    if (error)
        return set_arv_error(out_error, -EINVAL, place, "cannot set --exposure-us", &error);
    if (options->has_gain) {
        if (arv_camera_is_gain_auto_available(c, NULL))
            arv_camera_set_gain_auto(c, ARV_AUTO_OFF, NULL);
        arv_camera_set_gain(c, options->gain, &error);
    }
    if (error)
        return set_arv_error(out_error, -EINVAL, place, "cannot set --gain", &error);
    if (options->frame_rate_hz > 0)
        set_rate(c, options->frame_rate_hz, &error);
    if (error)
        return set_arv_error(out_error, -EINVAL, place, "cannot set --frame-rate", &error);
    return 0;
}

void gn_gige_device_read_exposure(struct gn_gige_device *device)
{
    double us = arv_camera_get_exposure_time(device->camera, NULL);
    device->exposure_us = us > 0 && us <= MAX_EXPOSURE_US ? us : 0;
}

static bool is_trigger_on(ArvDevice *device)
{
    const char *mode = arv_device_get_string_feature_value(device, "TriggerMode", NULL);
    return mode && strcmp(mode, "On") == 0;
}

/** Whether any of the camera's triggers is on: its selector is led through all, and put back. */
static bool waits_for_triggers(ArvDevice *device)
{
    const char *now = arv_device_get_string_feature_value(device, "TriggerSelector", NULL);
    char *before = g_strdup(now);
    bool is_on = is_trigger_on(device);
    guint n = 0;
    const char **names = before ? arv_device_dup_available_enumeration_feature_values_as_strings(
                                      device, "TriggerSelector", &n, NULL)
                                : NULL;
    for (guint i = 0; i < n && i < MAX_TRIGGERS && !is_on; i++) {
        arv_device_set_string_feature_value(device, "TriggerSelector", names[i], NULL);
        is_on = is_trigger_on(device);
    }
    if (n > 0)
        arv_device_set_string_feature_value(device, "TriggerSelector", before, NULL);
    g_free(names);
    g_free(before);
    return is_on;
}

/** Settings by the camera's own names, "NAME=VALUE,...", which have the last word. */
static int set_controls(struct gn_gige_device *d, const struct gn_gige_place *place,
                        const struct gn_live_options *options, struct gn_error *out_error)
{
    GError *error = NULL;
    int err = 0;
    if (options->is_white_balance_locked)
        arv_camera_set_string(d->camera, "BalanceWhiteAuto", "Off", &error);
    if (error)
        return set_arv_error(out_error, -EINVAL, place, "--lock-white-balance", &error);
    gchar **words = g_strsplit(options->controls ? options->controls : "", ",", -1);
    for (int i = 0; words[i] && !err; i++) {
        char what[128];
        snprintf(what, sizeof(what), "--controls %s", words[i]);
        if (!strchr(words[i], '='))
            err = gn_error_set(out_error, -EINVAL, "%s: each is NAME=VALUE", what);
        else if (!arv_device_set_features_from_string(arv_camera_get_device(d->camera), words[i],
                                                      &error))
            err = set_arv_error(out_error, -EINVAL, place, what, &error);
    }
    g_strfreev(words);
    return err;
}

/** Asks for a stamp behind each picture, of cameras that can: some leave the leader's empty. */
static void set_chunks(struct gn_gige_device *d)
{
    GError *error = NULL;
    if (!arv_camera_are_chunks_available(d->camera, NULL))
        return;
    arv_camera_set_chunks(d->camera, "Timestamp", &error);
    guint64 ticks_per_s = arv_gv_device_get_timestamp_tick_frequency(
        ARV_GV_DEVICE(arv_camera_get_device(d->camera)), NULL);
    d->ns_per_tick = ticks_per_s > 0 ? 1e9 / (double)ticks_per_s : 1;
    if (!error) {
        arv_camera_set_chunk_state(d->camera, "ExposureTime", TRUE, NULL); // where it has that, too
        d->chunks = arv_camera_create_chunk_parser(d->camera);
    } else {
        arv_camera_set_chunk_mode(d->camera, FALSE, NULL);
    }
    g_clear_error(&error);
}

uint64_t gn_gige_device_get_stamp(const struct gn_gige_device *device, ArvBuffer *buffer)
{
    GError *error = NULL;
    if (!device->chunks || !arv_buffer_has_chunks(buffer))
        return arv_buffer_get_timestamp(buffer);
    gint64 ticks =
        arv_chunk_parser_get_integer_value(device->chunks, buffer, "ChunkTimestamp", &error);
    bool is_good = !error && ticks > 0;
    g_clear_error(&error);
    if (!is_good)
        return arv_buffer_get_timestamp(buffer);
    // A clock of 1 GHz, the usual one, needs no rounding.
    double ns = (double)ticks * device->ns_per_tick;
    return device->ns_per_tick == 1 ? (uint64_t)ticks : ns < 9e18 ? (uint64_t)ns : 0;
}

double gn_gige_device_get_exposure(const struct gn_gige_device *device, ArvBuffer *buffer)
{
    GError *error = NULL;
    if (!device->chunks || !arv_buffer_has_chunks(buffer))
        return 0;
    double us =
        arv_chunk_parser_get_float_value(device->chunks, buffer, "ChunkExposureTime", &error);
    bool is_good = !error && us > 0 && us < 1e12;
    g_clear_error(&error);
    return is_good ? us : 0;
}

/** Called in Aravis' thread that takes packets, first when it begins. */
static void note_receiver(void *context, ArvStreamCallbackType type, ArvBuffer *buffer)
{
    atomic_int *receiver = context;
    (void)buffer;
    if (type == ARV_STREAM_CALLBACK_TYPE_INIT)
        atomic_store(receiver, gettid());
}

static int start_stream(struct gn_gige_device *d, const struct gn_gige_place *place,
                        struct gn_error *out_error)
{
    GError *error = NULL;
    size_t payload = arv_camera_get_payload(d->camera, &error);
    if (error)
        return set_arv_error(out_error, -EIO, place, "cannot read its payload size", &error);
    if (payload < d->picture_bytes || payload > d->picture_bytes + MAX_EXTRA_BYTES)
        return gn_error_set(
            out_error, -EINVAL, "camera %s: %zu bytes a picture announced, but %dx%d %s has %zu",
            place->id, payload, d->width, d->height, d->format->name, d->picture_bytes);
    d->payload_bytes = payload;
    d->receiver = calloc(1, sizeof(*d->receiver));
    if (!d->receiver)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    d->stream = arv_camera_create_stream(d->camera, note_receiver, d->receiver, &error);
    if (!d->stream || error)
        return set_arv_error(out_error, -EIO, place, "cannot open its stream", &error);
    g_object_set(d->stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
                 "socket-buffer-size", SOCKET_BUFFER_BYTES, NULL);
    for (int i = 0; i < N_BUFFERS; i++)
        arv_stream_push_buffer(d->stream, arv_buffer_new_allocate(payload));
    arv_camera_start_acquisition(d->camera, &error);
    if (error)
        return set_arv_error(out_error, -EIO, place, "cannot start it", &error);
    return 0;
}

int gn_gige_device_open(struct gn_gige_place *place, const struct gn_live_options *options,
                        int patience_ms, struct gn_gige_device *out_device,
                        struct gn_error *out_error)
{
    struct gn_gige_device d = {0};
    GError *error = NULL;
    int err = gn_gige_place_check_description(place, out_error);
    if (err)
        return err;
    ArvDevice *device = open_device(place, &error);
    if (!device)
        return set_arv_error(out_error, -EIO, place, "cannot open it", &error);
    d.camera = arv_camera_new_with_device(device, &error);
    if (!d.camera)
        err = set_arv_error(out_error, -EIO, place, "cannot open it", &error);
    else
        err = take_control(ARV_GV_DEVICE(device), place, patience_ms, out_error);
    if (!err)
        err = set_format(&d, place, options, out_error);
    if (!err)
        err = set_exposure(&d, place, options, out_error);
    if (!err)
        err = set_controls(&d, place, options, out_error);
    if (!err)
        err = read_format(&d, place, out_error);
    if (!err)
        err = set_size(&d, place, options, out_error);
    if (!err) { // what it has come to, --controls and all
        d.frame_rate_hz = arv_camera_get_frame_rate(d.camera, NULL);
        gn_gige_device_read_exposure(&d);
        d.is_triggered = waits_for_triggers(device);
        set_chunks(&d);
        err = start_stream(&d, place, out_error);
    }
    if (!err) {
        ArvGvDevice *gv = ARV_GV_DEVICE(device);
        copy_address(arv_gv_device_get_device_address(gv), place->address, sizeof(place->address));
        copy_address(arv_gv_device_get_interface_address(gv), place->interface,
                     sizeof(place->interface));
        *out_device = d;
    } else {
        gn_gige_device_close(&d);
    }
    g_object_unref(device);
    return err;
}

bool gn_gige_device_is_ours(const struct gn_gige_device *device)
{
    return arv_gv_device_is_controller(ARV_GV_DEVICE(arv_camera_get_device(device->camera)));
}

bool gn_gige_device_has_read_all(const struct gn_gige_device *device)
{
    char path[64], text[64] = "";
    snprintf(path, sizeof(path), "/proc/self/task/%d/stat", atomic_load(device->receiver));
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd >= 0) {
        (void)!read(fd, text, sizeof(text) - 1);
        close(fd);
    }
    // "ID (NAME) STATE ...", proc(5); where it cannot be read nothing speaks against it.
    const char *state = strrchr(text, ')');
    return !state || state[1] != ' ' || state[2] == 'S';
}

uint64_t gn_gige_device_count_packets(const struct gn_gige_device *device)
{
    return arv_stream_get_info_uint64_by_name(device->stream, "n_received_packets");
}

void gn_gige_device_close(struct gn_gige_device *device)
{
    if (device->camera && device->stream)
        arv_camera_stop_acquisition(device->camera, NULL);
    g_clear_object(&device->chunks);
    g_clear_object(&device->stream); // ends its thread
    g_clear_object(&device->camera);
    free(device->receiver);
    device->receiver = NULL;
}
