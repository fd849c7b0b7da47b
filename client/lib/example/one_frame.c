/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * The smallest viewer: sends one grey camera frame, writes the composited one as a PPM file.
 *   one_frame [HOST [PORT [ROOM]]] > out.ppm
 * Build it outside the tree with: cc one_frame.c $(pkg-config --cflags --libs gnomon)
 */
#include <gnomon.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 320
#define HEIGHT 240

static uint8_t picture[WIDTH * HEIGHT * 3];

static int send_one(struct gn_client *client)
{
    struct gn_msg_camera camera = {
        .width = WIDTH,
        .height = HEIGHT,
        .fx = 300,
        .fy = 300,
        .cx = WIDTH / 2.0,
        .cy = HEIGHT / 2.0,
    };
    int err = gn_client_send_camera(client, &camera);
    if (err)
        return err;
    memset(picture, 128, sizeof(picture));
    struct gn_msg_frame frame = {
        .id = 1,
        .capture_time_ns = gn_client_to_server_ns(client, gn_client_now_ns()),
        .views_count = 1,
        .result_format = GN_MSG_PICTURE_FORMAT_RGB8,
    };
    // Half a metre above the marker, looking down on it: half a turn around x.
    frame.views[0] = (struct gn_msg_frame_view){
        .has_world_from_camera = true,
        .world_from_camera = {.orientation = {0, 1, 0, 0}, .position_m = {0, 0, 0.5}},
        .picture_format = GN_MSG_PICTURE_FORMAT_RGB8,
        .payload_length = sizeof(picture),
    };
    return gn_client_send_frame(client, &frame, picture, sizeof(picture));
}

/** Returns 0 once the frame is back as a picture. */
static int receive_one(struct gn_client *client)
{
    struct gn_client_event event;
    int n;
    while ((n = gn_client_poll(client, 10000, &event)) > 0) {
        if (event.type == GN_WIRE_DROPPED) {
            fprintf(stderr, "dropped: %s (%s)\n",
                    gn_wire_get_drop_text(event.message.dropped.reason),
                    event.message.dropped.sentence);
            return -1;
        }
        if (event.type == GN_WIRE_ERROR)
            fprintf(stderr, "error: %s\n", event.message.error.sentence);
        if (event.type != GN_WIRE_RESULT || event.message.result.views_count < 1)
            continue;
        const struct gn_msg_result_view *view = &event.message.result.views[0];
        fprintf(stderr, "%u lights, light %.0f ms old\n", event.message.result.receipt.lights_used,
                (double)event.message.result.receipt.lighting_age_ms);
        printf("P6\n%u %u\n255\n", view->width, view->height);
        fwrite(event.payload + view->payload_offset, 1, view->payload_length, stdout);
        return 0;
    }
    fprintf(stderr, "%s\n", n == 0 ? "no answer in 10 s" : gn_client_get_fault(client));
    return -1;
}

int main(int argc, char **argv)
{
    struct gn_client_options options = {
        .host = argc > 1 ? argv[1] : NULL,
        .port = (uint16_t)(argc > 2 ? atoi(argv[2]) : 0),
        .room = argc > 3 ? argv[3] : NULL,
        .role = GN_MSG_ROLE_VIEWER,
        .client_name = "one_frame",
    };
    struct gn_client *client;
    struct gn_wire_fault why;
    if (gn_client_connect(&options, &client, &why)) {
        fprintf(stderr, "cannot connect: %s\n", why.text);
        return 1;
    }
    int err = gn_client_sync_clock(client, 8, 2000);
    if (!err)
        err = send_one(client);
    if (err)
        fprintf(stderr, "%s\n", gn_client_get_fault(client));
    else
        err = receive_one(client);
    if (gn_client_bye(client, GN_MSG_BYE_REASON_DONE))
        fprintf(stderr, "%s\n", gn_client_get_fault(client));
    gn_client_destroy(&client);
    return err ? 1 : 0;
}
