/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/track/watch.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "client/track/follow.h"

enum {
    /** Where some markers are missing, the whole picture is searched again after so many. */
    SEARCH_INTERVAL = 15,
};

/** Least times between two searches of the whole picture and two looks for small markers, ns: soon
 * after a marker was seen, and later. */
static const struct interval {
    int64_t whole_ns, small_ns;
} soon = {0, INT64_C(100000000)}, later = {INT64_C(150000000), INT64_C(300000000)};
/** What live pictures share of the later searches, in turn, and how long each lasts, ns. */
static const unsigned shares[] = {GN_SEARCH_MIDDLE, GN_SEARCH_SMALL, GN_SEARCH_COARSE,
                                  GN_SEARCH_FINE};
static const int64_t share_ns = INT64_C(100000000);
/** How long that is soon after, ns. */
static const int64_t soon_ns = INT64_C(500000000);

/** A marker of the last picture. */
struct followed {
    struct gn_marker_sighting sighting;
    double step[4][2]; // how its corners moved since the picture before, px
};

struct gn_watch {
    const struct gn_camera *camera; // borrowed, as are:
    const struct gn_bodies *bodies;
    int n_known; // the bodies' markers
    struct gn_search *search;
    struct gn_search_finds finds;
    int since_whole; // pictures since all of one was searched
    unsigned looks;  // at this picture
    bool is_live;
    size_t n_shares; // looked for, all in all
    bool was_ever_seen;
    int64_t last_seen_ns, last_whole_ns, last_small_ns, last_share_ns;
    struct gn_marker_window window;
    int n_last;
    struct followed last[GN_SEARCH_MAX_FOUND], next[GN_SEARCH_MAX_FOUND];
    struct gn_foreign_finds strangers; // of the bodies' dictionary
    struct gn_foreign *foreign;        // of others; NULL: not needed yet
    struct gn_watch_counts counts;
};

int gn_watch_create(const struct gn_camera *camera, const struct gn_bodies *bodies, bool is_live,
                    struct gn_watch **out_watch, struct gn_error *out_error)
{
    *out_watch = NULL;
    struct gn_watch *w = calloc(1, sizeof(*w));
    int n = 0;
    for (int i = 0; i < bodies->n_bodies; i++)
        n += bodies->bodies[i].n_markers;
    int *ids = calloc((size_t)n + 1, sizeof(*ids));
    int err = w && ids ? 0 : gn_error_set(out_error, -ENOMEM, "out of memory");
    if (!err) {
        for (int i = 0; i < bodies->n_bodies; i++)
            for (int k = 0; k < bodies->bodies[i].n_markers; k++)
                ids[w->n_known++] = bodies->bodies[i].markers[k].id;
        const struct gn_search_options wanted = {
            .camera = camera, .dictionary = bodies->dictionary, .ids = ids, .n_ids = n};
        w->camera = camera;
        w->bodies = bodies;
        w->is_live = is_live;
        w->strangers.dictionary = bodies->dictionary;
        w->since_whole = SEARCH_INTERVAL;
        err = gn_search_create(&wanted, &w->search, out_error);
    }
    free(ids);
    if (err)
        gn_watch_destroy(&w);
    *out_watch = w;
    return err;
}

void gn_watch_destroy(struct gn_watch **watch)
{
    if (*watch) {
        gn_search_destroy(&(*watch)->search);
        gn_foreign_destroy(&(*watch)->foreign);
    }
    free(*watch);
    *watch = NULL;
}

static void note_stranger(struct gn_watch *w, int id)
{
    struct gn_foreign_finds *f = &w->strangers;
    for (int i = 0; i < f->n_ids; i++)
        if (f->ids[i] == id)
            return;
    int at = f->n_ids;
    if (at == GN_FOREIGN_MAX_IDS)
        return;
    for (; at > 0 && f->ids[at - 1] > id; at--)
        f->ids[at] = f->ids[at - 1];
    f->ids[at] = id;
    f->n_ids++;
}

/** Keeps the sightings of the bodies' own markers; one that is seen twice tells nothing. */
static void sort_out(struct gn_watch *w)
{
    struct gn_marker_sighting *found = w->finds.found;
    int n = 0, body, marker;
    for (int i = 0; i < w->finds.n_found; i++) {
        bool is_own = gn_bodies_find_marker(w->bodies, found[i].id, &body, &marker);
        bool is_alone = is_own;
        if (!is_own)
            note_stranger(w, found[i].id);
        for (int k = 0; k < w->finds.n_found && is_alone; k++)
            is_alone = k == i || found[k].id != found[i].id;
        // Marked first, moved later: the others are still compared with it.
        found[i].corners[0][0] = is_alone ? found[i].corners[0][0] : NAN;
    }
    for (int i = 0; i < w->finds.n_found; i++)
        if (!isnan(found[i].corners[0][0]))
            found[n++] = found[i];
    w->finds.n_found = n;
}

static int search(struct gn_watch *w, const struct gn_grey *grey,
                  const struct gn_marker_window *window, struct gn_error *out_error)
{
    int err = gn_search_find(w->search, grey, window, w->looks, &w->finds, out_error);
    if (err)
        return err;
    w->counts.n_coarse_corners += (uint64_t)w->finds.n_coarse;
    sort_out(w);
    return 0;
}

/** The surroundings of all that was seen: half a marker and more around. */
static void set_window(struct gn_watch *w)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, side = 0;
    for (int i = 0; i < w->finds.n_found; i++) {
        double(*c)[2] = w->finds.found[i].corners;
        for (int k = 0; k < 4; k++) {
            for (int a = 0; a < 2; a++) {
                low[a] = fmin(low[a], c[k][a]);
                high[a] = fmax(high[a], c[k][a]);
            }
            side = fmax(side, hypot(c[k][0] - c[(k + 1) % 4][0], c[k][1] - c[(k + 1) % 4][1]));
        }
    }
    double around = 16 + 0.6 * side;
    w->window = (struct gn_marker_window){.x = (int)(low[0] - around),
                                          .y = (int)(low[1] - around),
                                          .width = (int)(high[0] - low[0] + 2 * around),
                                          .height = (int)(high[1] - low[1] + 2 * around)};
}

/** Follows every marker of the last picture. False where one is not where it should be. */
static bool follow(struct gn_watch *w, const struct gn_grey *grey)
{
    for (int i = 0; i < w->n_last; i++) {
        struct gn_marker_sighting *s = &w->finds.found[i];
        *s = w->last[i].sighting;
        for (int k = 0; k < 8; k++)
            s->corners[k / 2][k % 2] += w->last[i].step[k / 2][k % 2];
        if (!gn_follow_marker(grey, w->camera, gn_search_get_pattern(w->search, s->id), s->corners))
            return false;
    }
    w->finds.n_found = w->n_last;
    return w->n_last > 0;
}

/** Whether so much time has passed since the last one; it has where time does not go on. */
static bool is_due(int64_t time_ns, int64_t last_ns, int64_t interval_ns)
{
    return time_ns <= last_ns || time_ns - last_ns >= interval_ns;
}

/** The shares that are due; all of them where time does not go on, or by more than they take. */
static unsigned get_shares(struct gn_watch *w, int64_t time_ns)
{
    const int64_t n_all = GN_ARRAY_LEN(shares), since_ns = time_ns - w->last_share_ns;
    unsigned looks = 0;
    if (since_ns <= 0 || since_ns >= n_all * share_ns) {
        w->last_share_ns = time_ns;
        return GN_SEARCH_WHOLE | GN_SEARCH_SMALL;
    }
    for (; time_ns - w->last_share_ns >= share_ns; w->last_share_ns += share_ns)
        looks |= shares[w->n_shares++ % GN_ARRAY_LEN(shares)];
    return looks;
}

/** How to look at this picture now; 0: it is not time yet. */
static unsigned get_looks(struct gn_watch *w, int64_t time_ns)
{
    bool is_first = w->counts.n_searched_whole == 0;
    bool is_soon =
        w->n_last > 0 || (w->was_ever_seen && !is_due(time_ns, w->last_seen_ns, soon_ns));
    if (w->is_live && !is_first && !is_soon)
        return get_shares(w, time_ns);
    w->last_share_ns = time_ns;
    const struct interval *least = is_soon ? &soon : &later;
    bool with_small = is_first || is_due(time_ns, w->last_small_ns, least->small_ns);
    if (with_small)
        w->last_small_ns = time_ns;
    return with_small                                           ? GN_SEARCH_WHOLE | GN_SEARCH_SMALL
           : is_due(time_ns, w->last_whole_ns, least->whole_ns) ? GN_SEARCH_WHOLE
                                                                : 0;
}

static unsigned count_looks(unsigned looks)
{
    unsigned n = looks & GN_SEARCH_WHOLE ? 2 : 0;
    for (; looks; looks >>= 1)
        n += looks & 1;
    return n;
}

/** Searches near where the last picture had markers, and everywhere where that finds fewer. */
static int search_again(struct gn_watch *w, const struct gn_grey *grey, int64_t time_ns,
                        bool is_near, struct gn_error *out_error)
{
    int err = is_near ? search(w, grey, &w->window, out_error) : 0;
    if (err || (is_near && w->finds.n_found >= w->n_last))
        return err;
    w->since_whole = 0;
    w->last_whole_ns = time_ns;
    if (w->looks & (GN_SEARCH_WHOLE | GN_SEARCH_MIDDLE))
        w->strangers.n_ids = 0;
    w->counts.n_searched_whole++;
    w->counts.n_looks += count_looks(w->looks);
    err = search(w, grey, NULL, out_error);
    // Other markers may be there that this share does not find: all is searched next.
    if (!(w->looks & GN_SEARCH_WHOLE) && w->finds.n_found > 0)
        w->since_whole = SEARCH_INTERVAL;
    return err;
}

/** Keeps the sightings for following them into the next picture. */
static void remember(struct gn_watch *w)
{
    struct followed *next = w->next;
    for (int i = 0; i < w->finds.n_found; i++) {
        next[i] = (struct followed){.sighting = w->finds.found[i]};
        const struct followed *before = NULL;
        for (int k = 0; k < w->n_last && !before; k++)
            if (w->last[k].sighting.id == next[i].sighting.id)
                before = &w->last[k];
        for (int k = 0; k < 8 && before; k++)
            next[i].step[k / 2][k % 2] =
                next[i].sighting.corners[k / 2][k % 2] - before->sighting.corners[k / 2][k % 2];
    }
    w->n_last = w->finds.n_found;
    memcpy(w->last, next, (size_t)w->n_last * sizeof(*next));
    if (w->n_last > 0)
        set_window(w);
}

/** Whether it is time to look for markers of other dictionaries: as often as for small ones. */
static bool is_foreign_due(const struct gn_watch *w)
{
    unsigned whole = GN_SEARCH_WHOLE | GN_SEARCH_SMALL;
    return w->finds.n_found == 0 && ((w->looks & whole) == whole || w->looks & GN_SEARCH_MIDDLE);
}

/** Where nothing is seen: looks for markers of other dictionaries. */
static int look_for_others(struct gn_watch *w, const struct gn_grey *grey,
                           struct gn_error *out_error)
{
    int n;
    double(*quads)[4][2] = gn_search_get_unread(w->search, &n);
    if (n == 0 || w->strangers.n_ids > 0)
        return 0;
    if (!w->foreign && gn_foreign_create(&w->foreign) < 0)
        return gn_error_set(out_error, -ENOMEM, "out of memory");
    gn_foreign_look(w->foreign, grey, quads, n);
    return 0;
}

int gn_watch_update(struct gn_watch *w, const struct gn_grey *grey, int64_t time_ns,
                    struct gn_error *out_error)
{
    int err = 0;
    bool is_near = w->n_last > 0 && (w->n_last == w->n_known || w->since_whole < SEARCH_INTERVAL);
    w->since_whole++;
    if (is_near && follow(w, grey)) {
        w->counts.n_followed++;
    } else if ((w->looks = get_looks(w, time_ns)) != 0) {
        err = search_again(w, grey, time_ns, is_near, out_error);
        if (!err && is_foreign_due(w))
            err = look_for_others(w, grey, out_error);
    }
    if (err)
        w->finds.n_found = 0;
    if (w->finds.n_found > 0) {
        gn_foreign_destroy(&w->foreign);
        w->was_ever_seen = true;
        w->last_seen_ns = time_ns;
    }
    remember(w);
    return err;
}

const struct gn_marker_sighting *gn_watch_get_sightings(const struct gn_watch *w, int *out_n)
{
    *out_n = w->finds.n_found;
    return w->finds.found;
}

const struct gn_foreign_finds *gn_watch_get_strangers(const struct gn_watch *w)
{
    return &w->strangers;
}

bool gn_watch_get_foreign(const struct gn_watch *w, struct gn_foreign_finds *out)
{
    return w->foreign && gn_foreign_get(w->foreign, out);
}

void gn_watch_get_counts(const struct gn_watch *w, struct gn_watch_counts *out)
{
    *out = w->counts;
}
