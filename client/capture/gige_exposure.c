/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/* The exposure of a GigE Vision camera, set step by step while it streams, and put back. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include <arv.h>

#include "client/capture/gige_device.h"
#include "proto/attr.h"

/** GenICam features (SFNC 2.4) that would change the picture by themselves. */
static const char *const automatics[] = {"ExposureAuto", "GainAuto", "BalanceWhiteAuto"};

static int refuse(struct gn_error *out_error, const char *id, const char *what, GError **error)
{
    int err = gn_error_set(out_error, -EIO, "camera %s: %s: %s", id, what,
                           (*error)->message ? (*error)->message : "no reason given");
    g_clear_error(error);
    return err;
}

/** Notes what an automatic is set to and switches it off; those that the camera lacks stay "". */
static int switch_off(ArvCamera *camera, const char *id, int i, struct gn_gige_noted *noted,
                      struct gn_error *out_error)
{
    GError *error = NULL;
    if (!arv_camera_is_feature_available(camera, automatics[i], NULL))
        return 0;
    const char *value = arv_camera_get_string(camera, automatics[i], &error);
    if (error)
        return refuse(out_error, id, automatics[i], &error);
    if (!value || !*value || strcmp(value, "Off") == 0)
        return 0;
    char was[sizeof(noted->automatics[i])];
    snprintf(was, sizeof(was), "%s", value);
    arv_camera_set_string(camera, automatics[i], "Off", &error);
    if (error)
        return refuse(out_error, id, automatics[i], &error);
    memcpy(noted->automatics[i], was, sizeof(was));
    return 0;
}

int gn_gige_exposure_hold(struct gn_gige_device *device, const char *id, enum gn_exposure_unit unit,
                          struct gn_gige_noted *noted, struct gn_exposure *out,
                          struct gn_error *out_error)
{
    struct gn_gige_noted now = {.is_held = true};
    struct gn_exposure range = {0};
    GError *error = NULL;
    int err = 0;
    if (unit != GN_EXPOSURE_US)
        return gn_error_set(
            out_error, -ENOTSUP,
            "camera %s: its exposure is set by times, not by counts: give a unit, as 4,1,16ms", id);
    if (!arv_camera_is_exposure_time_available(device->camera, NULL))
        return gn_error_set(out_error, -ENOTSUP, "camera %s: no exposure time can be set", id);
    for (size_t i = 0; !err && i < GN_ARRAY_LEN(automatics); i++)
        err = switch_off(device->camera, id, (int)i, &now, out_error);
    if (!err) // what the automatic had come to
        now.exposure_us = range.now = arv_camera_get_exposure_time(device->camera, &error);
    if (!err && !error)
        arv_camera_get_exposure_time_bounds(device->camera, &range.least, &range.most, &error);
    if (!err && error)
        err = refuse(out_error, id, "its exposure time", &error);
    if (err) {
        (void)!gn_gige_exposure_restore(device, id, &now, NULL);
        return err;
    }
    *noted = now;
    *out = range;
    return 0;
}

int gn_gige_exposure_set(struct gn_gige_device *device, const char *id, double exposure_us,
                         double *out_exposure_us, struct gn_error *out_error)
{
    struct gn_gige_noted again = {0};
    GError *error = NULL;
    double least = 0, most = 0, took = 0;
    // Where the camera was lost and is back they may be on again.
    for (size_t i = 0; i < GN_ARRAY_LEN(automatics); i++) {
        int err = switch_off(device->camera, id, (int)i, &again, out_error);
        if (err)
            return err;
    }
    arv_camera_get_exposure_time_bounds(device->camera, &least, &most, &error);
    if (!error && !(exposure_us >= least && exposure_us <= most))
        return gn_error_set(out_error, -ERANGE,
                            "camera %s: exposure %g us is not in [%g, %g] us, which it takes", id,
                            exposure_us, least, most);
    if (!error)
        arv_camera_set_exposure_time(device->camera, exposure_us, &error);
    if (!error)
        took = arv_camera_get_exposure_time(device->camera, &error);
    if (error)
        return refuse(out_error, id, "its exposure time", &error);
    device->exposure_us = *out_exposure_us = took;
    return 0;
}

int gn_gige_exposure_restore(struct gn_gige_device *device, const char *id,
                             struct gn_gige_noted *noted, struct gn_error *out_error)
{
    GError *error = NULL;
    int first = 0;
    if (noted->exposure_us > 0) {
        arv_camera_set_exposure_time(device->camera, noted->exposure_us, &error);
        device->exposure_us = noted->exposure_us;
    }
    if (error)
        first = refuse(out_error, id, "its exposure time cannot be put back", &error);
    for (size_t i = 0; i < GN_ARRAY_LEN(automatics); i++) {
        if (noted->automatics[i][0])
            arv_camera_set_string(device->camera, automatics[i], noted->automatics[i], &error);
        if (error && !first)
            first = refuse(out_error, id, automatics[i], &error);
        g_clear_error(&error);
    }
    memset(noted, 0, sizeof(*noted));
    return first;
}
