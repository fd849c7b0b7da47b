/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * One run of `gnomon view`: the frames that are on their way, what becomes of each answer, and,
 * with a window, the way back to a server that was lost.
 */
#ifndef GN_CLIENT_CMD_VIEW_VIEWER_H
#define GN_CLIENT_CMD_VIEW_VIEWER_H

#include "client/feed.h"
#include "client/poses.h"
#include "client/view/record.h"
#include "client/view/show.h"
#include "common/camera.h"

/** Most frames on their way at once. */
#define GN_VIEWER_MAX_OUTSTANDING 16

/** Where the composites go for which there is no window. */
#define GN_VIEWER_DEFAULT_DIR "composites"

/** A frame that has been sent and not answered. id 0: free. */
struct gn_viewer_pending {
    uint64_t id;
    int64_t sent_ns;
    bool wants_virtual; // virtual objects are to be in the picture
    bool waits_light;   // the server may hold it until there is light
    char name[GN_FILE_NAME_BYTES];
};

/** Zeroed at first. */
struct gn_viewer {
    struct gn_feed feed;
    const char *dir;          // borrowed from the options; NULL: no files are wanted
    struct gn_record *record; // NULL: likewise
    struct gn_show *show;     // NULL: no window
    bool is_closed;           // the person at the window has had enough
    struct gn_camera camera;
    struct gn_poses *poses;    // from markers; NULL: the source knows them, or the camera rests
    long n_unplaced;           // frames in which no marker said where the camera was
    struct gn_msg_frame frame; // what all frames have in common
    uint64_t sync_light;       // 0: not asked for
    int64_t first_sent_ns;
    int max_outstanding;
    int n_outstanding;
    struct gn_viewer_pending pending[GN_VIEWER_MAX_OUTSTANDING];
    long n_results, n_dropped;
    long n_wanting;      // results; in which virtual objects were asked for
    long n_empty;        // of these: whose pictures show none
    long n_lost;         // frames, with the server
    int n_reconnected;   // times
    int n_dropped_since; // frames since the last result
    double latency_sum_ms, latency_max_ms;
    char last_drop[256]; // why a frame was dropped
    bool is_unlit;       // because there was no light
};

/* What feed.h asks of a command; feed is that of a viewer. */

/** Opens source, camera, markers and window as the options say. */
GN_MUST_USE int gn_viewer_open(struct gn_feed *feed, const struct gn_options *options,
                               struct gn_error *out_error);
/** Waits until the picture is due, places it and sends it. */
GN_MUST_USE int gn_viewer_send(struct gn_feed *feed, const struct gn_capture *capture,
                               struct gn_error *out_error);

/** Tells the server about the camera. Returns 0, or a negative errno and a sentence. */
GN_MUST_USE int gn_viewer_send_camera(struct gn_viewer *v, struct gn_error *out_error);

/** A free place for a frame; there is one where less than max_outstanding are out. */
struct gn_viewer_pending *gn_viewer_get_free(struct gn_viewer *v);

/**
 * Takes events until due_ns and until no more than max_left frames are out; keeps the window alive
 * meanwhile. With a window a lost server is waited for. Returns 0, -EINTR (Ctrl-C, or the window
 * was closed), or another negative errno and a sentence.
 */
GN_MUST_USE int gn_viewer_serve(struct gn_viewer *v, int64_t due_ns, int max_left,
                                struct gn_error *out_error);

/** Keeps the window alive. False: it is to be closed. */
bool gn_viewer_pump(struct gn_viewer *v);

/**
 * Connects. With a window a server that is not there yet is waited for. Returns 0, -EINTR (Ctrl-C,
 * or the window was closed) or another negative errno, and a sentence.
 */
GN_MUST_USE int gn_viewer_connect(struct gn_viewer *v, struct gn_error *out_error);

/**
 * The server is gone, `why` says how: shows that, and comes back as soon as it is there. Frames
 * that were out are lost. Same returns; without a window at once err and why.
 */
GN_MUST_USE int gn_viewer_reconnect(struct gn_viewer *v, int err, struct gn_error *why);

#endif
