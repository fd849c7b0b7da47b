/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/vision/markers.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <memory>
#include <new>
#include <vector>

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "client/vision/guard.hpp"
#include "client/vision/squares.hpp"
#include "common/image.h"

namespace {

/* In the order of GN_MARKER_DICTIONARIES, which is OpenCV's own. */
constexpr int n_dictionaries = cv::aruco::DICT_APRILTAG_36h11 + 1;

bool is_dictionary(int dictionary)
{
    return dictionary >= 0 && dictionary < n_dictionaries;
}

cv::Ptr<cv::aruco::DetectorParameters> make_parameters(gn_marker_refinement refinement)
{
    cv::Ptr<cv::aruco::DetectorParameters> p = cv::aruco::DetectorParameters::create();
    // Finer than OpenCV's own: cells of 3 px are read, which it misses.
    p->perspectiveRemovePixelPerCell = 8;
    p->perspectiveRemoveIgnoredMarginPerCell = 0.33;
    p->minDistanceToBorder = 0; // what the picture's border cuts off is not read anyway
    switch (refinement) {
    case GN_MARKER_REFINE_NONE:
        p->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
        break;
    case GN_MARKER_REFINE_SUBPIX:
        p->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
        break;
    case GN_MARKER_REFINE_CONTOUR:
        p->cornerRefinementMethod = cv::aruco::CORNER_REFINE_CONTOUR;
        break;
    case GN_MARKER_REFINE_APRILTAG:
        p->cornerRefinementMethod = cv::aruco::CORNER_REFINE_APRILTAG;
        break;
    }
    return p;
}

// In a picture at twice its size: the one window that leaves least of the pixels' own stairs and
// tells cells of 3 px apart; corners rounded off by the enlargement; neighbours on a cube.
void look_closely(cv::aruco::DetectorParameters &p)
{
    p.adaptiveThreshWinSizeMin = p.adaptiveThreshWinSizeMax = 7;
    p.polygonalApproxAccuracyRate = 0.08;
    p.minMarkerDistanceRate = 0.02;
}

} // namespace

struct gn_marker_finder {
    cv::Ptr<cv::aruco::Dictionary> dictionary;
    cv::Ptr<cv::aruco::DetectorParameters> parameters;
    std::unique_ptr<gn_squares> squares; // nullptr: OpenCV itself, as it alone refines
    std::vector<std::vector<cv::Point2f>> corners, unread;
    std::vector<int> ids;
    cv::Mat enlarged;
    cv::Point origin; // of the searched part
    double scale;     // by which it is enlarged
};

namespace {

// OpenCV's pixel centres are at whole numbers, of the enlarged picture too.
void place(const gn_marker_finder &finder, const std::vector<cv::Point2f> &corners,
           double (*out_px)[2])
{
    for (size_t k = 0; k < 4; k++) {
        out_px[k][0] = (double(corners[k].x) + 0.5) / finder.scale + finder.origin.x;
        out_px[k][1] = (double(corners[k].y) + 0.5) / finder.scale + finder.origin.y;
    }
}

} // namespace

const char *gn_vision_get_version(void)
{
    return "OpenCV " CV_VERSION;
}

bool gn_vision_is_built(void)
{
    return true;
}

int gn_marker_count_ids(int dictionary)
{
    int n = 0;
    if (is_dictionary(dictionary))
        (void)gn_vision_guard(nullptr, "the dictionary", [&] {
            n = cv::aruco::getPredefinedDictionary(dictionary)->bytesList.rows;
            return 0;
        });
    return n;
}

int gn_marker_finder_create(const struct gn_marker_finder_options *options,
                            struct gn_marker_finder **out_finder, struct gn_error *out_error)
{
    *out_finder = nullptr;
    const gn_marker_finder_options defaults = {};
    const gn_marker_finder_options &o = options ? *options : defaults;
    if (!is_dictionary(o.dictionary))
        return gn_error_set(out_error, -EINVAL, "there is no marker dictionary %d", o.dictionary);
    return gn_vision_guard(out_error, "the marker dictionary", [&] {
        cv::setNumThreads(1);
        auto finder = std::make_unique<gn_marker_finder>();
        finder->dictionary = cv::aruco::getPredefinedDictionary(o.dictionary);
        finder->parameters = make_parameters(o.refinement);
        finder->scale = o.is_small ? 2 : 1;
        if (o.is_small)
            look_closely(*finder->parameters);
        if (o.window > 0)
            finder->parameters->adaptiveThreshWinSizeMin =
                finder->parameters->adaptiveThreshWinSizeMax = o.window;
        if (o.refinement == GN_MARKER_REFINE_NONE)
            finder->squares = std::make_unique<gn_squares>(finder->dictionary, finder->parameters);
        *out_finder = finder.release();
        return 0;
    });
}

void gn_marker_finder_destroy(struct gn_marker_finder **finder)
{
    delete *finder;
    *finder = nullptr;
}

int gn_marker_finder_find(struct gn_marker_finder *finder, const uint8_t *grey, int width,
                          int height, const struct gn_marker_window *window, int max_sightings,
                          struct gn_marker_sighting *out_sightings, int *out_n_sightings,
                          struct gn_error *out_error)
{
    if (width < 1 || height < 1 || width > GN_IMAGE_MAX_SIDE || height > GN_IMAGE_MAX_SIDE)
        return gn_error_set(out_error, -EINVAL, "no picture to look for markers in: %dx%d", width,
                            height);
    return gn_vision_guard(out_error, "looking for markers", [&] {
        // OpenCV only reads it, but knows no pictures of const pixels.
        const cv::Mat picture(height, width, CV_8UC1, const_cast<uint8_t *>(grey));
        cv::Rect part(0, 0, width, height);
        if (window)
            part &= cv::Rect(window->x, window->y, window->width, window->height);
        *out_n_sightings = 0;
        finder->corners.clear();
        finder->ids.clear();
        finder->unread.clear();
        finder->origin = part.tl();
        if (part.empty())
            return 0;
        cv::Mat searched = picture(part);
        if (finder->scale > 1) {
            cv::resize(searched, finder->enlarged, {}, finder->scale, finder->scale,
                       cv::INTER_LINEAR);
            searched = finder->enlarged;
        }
        if (finder->squares)
            finder->squares->find(searched, finder->corners, finder->ids, finder->unread);
        else
            cv::aruco::detectMarkers(searched, finder->dictionary, finder->corners, finder->ids,
                                     finder->parameters, finder->unread);
        int n = static_cast<int>(std::min<size_t>(finder->ids.size(), size_t(max_sightings)));
        for (int i = 0; i < n; i++) {
            out_sightings[i].id = finder->ids[size_t(i)];
            place(*finder, finder->corners[size_t(i)], out_sightings[i].corners);
        }
        *out_n_sightings = n;
        return 0;
    });
}

int gn_marker_finder_get_unread(const struct gn_marker_finder *finder, int max_quads,
                                double (*out_quads)[4][2])
{
    int n = static_cast<int>(std::min<size_t>(finder->unread.size(), size_t(max_quads)));
    for (int i = 0; i < n; i++)
        place(*finder, finder->unread[size_t(i)], out_quads[i]);
    return n;
}

int gn_marker_get_cells(int dictionary, int id, uint8_t *out_cells)
{
    int side = 0;
    if (!is_dictionary(dictionary) || id < 0 || id >= gn_marker_count_ids(dictionary))
        return 0;
    (void)gn_vision_guard(nullptr, "the marker's cells", [&] {
        const auto d = cv::aruco::getPredefinedDictionary(dictionary);
        int n = d->markerSize + 2;
        if (n > GN_MARKER_MAX_CELLS)
            return 0;
        cv::Mat cells;
        d->drawMarker(id, n, cells, 1);
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++)
                out_cells[y * n + x] = cells.at<uchar>(y, x) > 127;
        side = n;
        return 0;
    });
    return side;
}

// Points are turned before they are given to OpenCV, half around an axis in their plane: its IPPE
// makes no turn of a turn by 180 degrees, and a marker seen face on is turned by just that; what is
// turned by 180 degrees after this lies askew by 1 rad as well, as nothing does exactly. Its own
// inverse.
static const cv::Matx33d aside(std::cos(1.0), std::sin(1.0), 0, std::sin(1.0), -std::cos(1.0), 0, 0,
                               0, -1);

int gn_vision_solve_pose(const double *points_object, const double *rays, int n, bool is_planar,
                         struct gn_vision_pose *out_poses, struct gn_error *out_error)
{
    if (n < 4 || n > 4096)
        return gn_error_set(out_error, -EINVAL, "a pose needs 4 to 4096 points, not %d", n);
    int n_poses = 0;
    int err = gn_vision_guard(out_error, "finding a pose", [&] {
        std::vector<cv::Point3d> points;
        std::vector<cv::Point2d> seen;
        for (int i = 0; i < n; i++) {
            const double *p = points_object + 3 * i;
            points.push_back(aside * cv::Point3d(p[0], p[1], p[2]));
            seen.emplace_back(rays[2 * i], rays[2 * i + 1]);
        }
        std::vector<cv::Mat> turns, shifts;
        cv::solvePnPGeneric(points, seen, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turns, shifts,
                            false, is_planar ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_SQPNP);
        size_t n_wanted = std::min<size_t>(turns.size(), is_planar ? 2 : 1);
        for (size_t i = 0; i < n_wanted; i++) {
            cv::Mat rotation;
            cv::Rodrigues(turns[i], rotation);
            rotation = rotation * cv::Mat(aside);
            gn_vision_pose &pose = out_poses[n_poses];
            std::copy_n(rotation.ptr<double>(), 9, pose.rotation);
            std::copy_n(shifts[i].ptr<double>(), 3, pose.translation);
            // What is behind the camera is not seen.
            n_poses +=
                cv::checkRange(rotation) && cv::checkRange(shifts[i]) && pose.translation[2] > 0;
        }
        return 0;
    });
    return err ? err : n_poses;
}
