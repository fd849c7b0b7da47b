/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * What show.c keeps and show_draw.c draws.
 */
#ifndef GN_CLIENT_VIEW_SHOW_INTERNAL_H
#define GN_CLIENT_VIEW_SHOW_INTERNAL_H

#include "client/view/keep.h"
#include "client/view/light_ball.h"
#include "client/view/overlay.h"
#include "client/view/show.h"
#include "client/view/window.h"
#include "common/image.h"
#include "common/jpeg.h"

/** Results that the rate and the largest latency are of. */
#define GN_SHOW_OF_LATE 32

/** What o goes through. */
enum gn_show_page {
    GN_SHOW_PAGE_NONE = 0,
    GN_SHOW_PAGE_FIGURES,
    GN_SHOW_PAGE_PLAN,
    GN_SHOW_N_PAGES
};

struct gn_show {
    struct gn_window *window;
    struct gn_keep *keep;
    struct gn_jpeg *jpeg;
    struct gn_canvas canvas;
    struct gn_image8 picture; // what is shown; width 0: nothing yet
    uint64_t picture_id;
    struct gn_msg_receipt receipt; // of it
    struct gn_light_ball light;
    struct gn_pose world_from_camera;
    struct gn_show_counts counts; // source: NULL or &source_counts
    struct gn_source_counts source_counts;
    enum gn_show_page page;
    bool shows_help, shows_light, no_virtual, no_shadow;
    bool is_stale; // to be drawn again
    int64_t presented_ns;
    char note[512];
    int64_t note_until_ns;
    enum gn_show_state state;
    char sentence[512]; // about the state; "": none
    char room[128];     // "": not known yet
    char title[768];    // as it was set last
    bool is_hint_wanted;
    int64_t hint_until_ns; // 0: until there is a picture
    char last_drop[256];
    struct {
        int64_t at_ns;
        double latency_ms;
    } of_late[GN_SHOW_OF_LATE]; // a ring
    uint64_t n_of_late;
};

/** What lies over the picture; NULL: nothing. */
const struct gn_canvas *gn_show_draw(struct gn_show *show);

#endif
