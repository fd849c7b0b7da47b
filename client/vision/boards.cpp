/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/vision/boards.h"

#include <cerrno>
#include <cmath>
#include <vector>

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>

#include "client/vision/guard.hpp"
#include "common/image.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/lsan_interface.h>
using theirs_leak = __lsan::ScopedDisabler;
#else
struct theirs_leak {
    ~theirs_leak()
    {
    } // or the variable counts as unused
};
#endif

namespace {

bool is_picture(const uint8_t *pixels, int width, int height)
{
    return pixels && width >= 8 && height >= 8 && width <= GN_IMAGE_MAX_SIDE &&
           height <= GN_IMAGE_MAX_SIDE && (long)width * height <= GN_IMAGE_MAX_PIXELS;
}

/* OpenCV writes through Mat only where it is told to; it is not told to here. */
cv::Mat wrap(const uint8_t *pixels, int width, int height, int type)
{
    return cv::Mat(height, width, type, const_cast<uint8_t *>(pixels));
}

std::vector<cv::Point2f> find_chessboard(const gn_board &board, const cv::Mat &grey)
{
    cv::Size inner(board.columns - 1, board.rows - 1);
    std::vector<cv::Point2f> corners;
    if (!cv::findChessboardCorners(grey, inner, corners,
                                   cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE |
                                       cv::CALIB_CB_FAST_CHECK))
        return {};
    // A window of less than half a square, or the next corner is seen in it.
    double least = 1e9;
    for (int i = 0; i + 1 < inner.width; i++)
        least = std::min(least, (double)cv::norm(corners[i + 1] - corners[i]));
    for (int i = 0; i + 1 < inner.height; i++)
        least = std::min(
            least, (double)cv::norm(corners[(i + 1) * inner.width] - corners[i * inner.width]));
    int half = std::max(2, std::min(11, (int)(least * 0.4)));
    cv::cornerSubPix(grey, corners, cv::Size(half, half), cv::Size(-1, -1),
                     cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 60, 1e-4));
    return corners;
}

/* The corners and, as the board numbers them, their ids. */
std::vector<cv::Point2f> find_charuco(const gn_board &board, const cv::Mat &grey,
                                      std::vector<int> &ids)
{
    cv::Ptr<cv::aruco::Dictionary> dictionary =
        cv::aruco::getPredefinedDictionary(board.dictionary);
    cv::Ptr<cv::aruco::CharucoBoard> pattern = cv::aruco::CharucoBoard::create(
        board.columns, board.rows, (float)board.square_m, (float)board.marker_m, dictionary);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> marker_ids;
    std::vector<cv::Point2f> corners;
    cv::aruco::detectMarkers(grey, dictionary, markers, marker_ids);
    if (!marker_ids.empty())
        cv::aruco::interpolateCornersCharuco(markers, marker_ids, grey, pattern, corners, ids);
    return corners;
}

int find_board(const gn_board &board, const cv::Mat &grey, gn_board_corner *out, int *out_n)
{
    std::vector<int> ids;
    std::vector<cv::Point2f> corners =
        board.is_charuco ? find_charuco(board, grey, ids) : find_chessboard(board, grey);
    int columns = board.columns - 1;
    // OpenCV's pixel centres are whole numbers, but not where it interpolates ChArUco corners.
    double half = board.is_charuco ? 0 : 0.5;
    for (size_t i = 0; i < corners.size(); i++) {
        int id = board.is_charuco ? ids[i] : (int)i;
        out[i] = {id % columns, id / columns, {corners[i].x + half, corners[i].y + half}};
    }
    *out_n = (int)corners.size();
    return 0;
}

int solve(const gn_board &board, gn_board_view *views, int n_views, cv::Size size,
          bool has_square_pixels, gn_intrinsics *out, gn_error *out_error)
{
    std::vector<std::vector<cv::Point3f>> objects(n_views);
    std::vector<std::vector<cv::Point2f>> pictures(n_views);
    for (int v = 0; v < n_views; v++)
        for (int i = 0; i < views[v].n; i++) {
            const gn_board_corner &c = views[v].corners[i];
            objects[v].emplace_back((float)((c.column + 1) * board.square_m),
                                    (float)((c.row + 1) * board.square_m), 0.0f);
            pictures[v].emplace_back((float)(c.xy[0] - 0.5), (float)(c.xy[1] - 0.5));
        }
    cv::Mat k = cv::Mat::eye(3, 3, CV_64F), distortion = cv::Mat::zeros(5, 1, CV_64F);
    cv::Mat deviations, ignored, errors;
    std::vector<cv::Mat> rotations, translations;
    out->rms_px = cv::calibrateCamera(
        objects, pictures, size, k, distortion, rotations, translations, deviations, ignored,
        errors, has_square_pixels ? cv::CALIB_FIX_ASPECT_RATIO : 0,
        cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-10));
    if (!std::isfinite(out->rms_px) || !cv::checkRange(k) || !cv::checkRange(distortion))
        return gn_error_set(out_error, -EDOM, "the fit of the camera does not converge");
    for (int v = 0; v < n_views; v++) {
        std::vector<cv::Point2f> predicted;
        cv::projectPoints(objects[v], rotations[v], translations[v], k, distortion, predicted);
        double sum = 0;
        for (int i = 0; i < views[v].n; i++) {
            views[v].residuals[2 * i] = pictures[v][i].x - predicted[i].x;
            views[v].residuals[2 * i + 1] = pictures[v][i].y - predicted[i].y;
            sum +=
                std::pow(views[v].residuals[2 * i], 2) + std::pow(views[v].residuals[2 * i + 1], 2);
        }
        views[v].rms_px = std::sqrt(sum / views[v].n);
        cv::Mat r;
        cv::Rodrigues(rotations[v], r);
        for (int i = 0; i < 3; i++)
            views[v].board_normal[i] = r.at<double>(i, 2);
    }
    out->fx = k.at<double>(0, 0);
    out->fy = k.at<double>(1, 1);
    out->cx = k.at<double>(0, 2) + 0.5;
    out->cy = k.at<double>(1, 2) + 0.5;
    for (int i = 0; i < 5; i++)
        out->distortion[i] = distortion.at<double>(i);
    for (int i = 0; i < 9; i++)
        out->deviation[i] = deviations.at<double>(i);
    if (has_square_pixels)
        out->deviation[0] = out->deviation[1]; // OpenCV reports fx as known: it follows fy
    return 0;
}

/* mcc's model of the chart: patches of 2.5 at distances of 2.75 in a box of 16.75 x 11.25. */
int find_chart(const cv::Mat &bgr, double out_corners[8])
{
    cv::setNumThreads(1);
    theirs_leak mcc; // OpenCV 4.6's mcc loses some of its pictures
    cv::Ptr<cv::mcc::CCheckerDetector> detector = cv::mcc::CCheckerDetector::create();
    if (!detector->process(bgr, cv::mcc::MCC24, 1))
        return 0;
    cv::Ptr<cv::mcc::CChecker> checker = detector->getBestColorChecker();
    if (checker.empty() || checker->getBox().size() != 4)
        return 0;
    std::vector<cv::Point2f> box = checker->getBox();
    std::vector<cv::Point2f> model = {{0, 0}, {16.75f, 0}, {16.75f, 11.25f}, {0, 11.25f}};
    std::vector<cv::Point2f> centres = {
        {1.5f, 1.5f}, {15.25f, 1.5f}, {15.25f, 9.75f}, {1.5f, 9.75f}};
    std::vector<cv::Point2f> seen;
    cv::perspectiveTransform(centres, seen, cv::getPerspectiveTransform(model, box));
    for (int i = 0; i < 4; i++) {
        out_corners[2 * i] = seen[i].x + 0.5;
        out_corners[2 * i + 1] = seen[i].y + 0.5;
    }
    return 1;
}

} // namespace

int gn_board_find(const struct gn_board *board, const uint8_t *grey, int width, int height,
                  struct gn_board_corner *out_corners, int *out_n, struct gn_error *out_error)
{
    *out_n = 0;
    if (!is_picture(grey, width, height) || board->columns < 3 || board->rows < 3 ||
        board->columns > 33 || board->rows > 33)
        return gn_error_set(out_error, -EINVAL, "a board of %d x %d in a picture of %d x %d",
                            board->columns, board->rows, width, height);
    return gn_vision_guard(out_error, "looking for the board", [&] {
        return find_board(*board, wrap(grey, width, height, CV_8UC1), out_corners, out_n);
    });
}

int gn_intrinsics_solve(const struct gn_board *board, struct gn_board_view *views, int n_views,
                        int width, int height, bool has_square_pixels, struct gn_intrinsics *out,
                        struct gn_error *out_error)
{
    return gn_vision_guard(out_error, "the camera's intrinsics", [&] {
        return solve(*board, views, n_views, cv::Size(width, height), has_square_pixels, out,
                     out_error);
    });
}

int gn_vision_find_chart(const uint8_t *rgb, int width, int height, double out_corners[8],
                         struct gn_error *out_error)
{
    if (!is_picture(rgb, width, height))
        return gn_error_set(out_error, -EINVAL, "a chart in a picture of %d x %d", width, height);
    return gn_vision_guard(out_error, "looking for the chart", [&] {
        cv::Mat bgr;
        cv::cvtColor(wrap(rgb, width, height, CV_8UC3), bgr, cv::COLOR_RGB2BGR);
        return find_chart(bgr, out_corners);
    });
}
