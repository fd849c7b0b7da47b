/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
#include "client/vision/squares.hpp"

#include <algorithm>
#include <new>
#include <numeric>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace {

double get_square(const cv::Point2f &a, const cv::Point2f &b)
{
    return double(a.x - b.x) * double(a.x - b.x) + double(a.y - b.y) * double(a.y - b.y);
}

} // namespace

gn_squares::gn_squares(cv::Ptr<cv::aruco::Dictionary> known,
                       cv::Ptr<cv::aruco::DetectorParameters> how)
    : dictionary(std::move(known)), parameters(std::move(how))
{
    gn_outlines *made = nullptr;
    if (gn_outlines_create(&made) < 0)
        throw std::bad_alloc();
    outlines.reset(made);
}

/** The squares among the outlines of what is darker than the mean of a window. */
void gn_squares::gather(const cv::Mat &grey, int window)
{
    const cv::aruco::DetectorParameters &p = *parameters;
    const int side = std::max(grey.cols, grey.rows);
    gn_outlines_options wanted = {};
    wanted.grey = grey.data;
    wanted.width = grey.cols;
    wanted.height = grey.rows;
    wanted.stride = long(grey.step);
    wanted.window = window;
    wanted.min_points = std::max(4, int(p.minMarkerPerimeterRate * side));
    wanted.max_points = int(p.maxMarkerPerimeterRate * side);
    wanted.tolerance = p.polygonalApproxAccuracyRate;
    if (gn_outlines_find(outlines.get(), &wanted) < 0)
        throw std::bad_alloc();
    std::vector<cv::Point> figure;
    for (int i = 0; i < gn_outlines_count(outlines.get()); i++) {
        int n;
        const int32_t(*points)[2] = gn_outlines_get(outlines.get(), i, &n);
        // OpenCV only reads it.
        const cv::Mat outline(n, 1, CV_32SC2, const_cast<int32_t(*)[2]>(points));
        cv::approxPolyDP(outline, figure, n * wanted.tolerance, true);
        if (figure.size() != 4 || !cv::isContourConvex(figure))
            continue;
        square s = {{figure.begin(), figure.end()}, cv::contourArea(figure, true), n};
        double shortest = get_square(s.corners[3], s.corners[0]);
        for (size_t k = 0; k < 3; k++)
            shortest = std::min(shortest, get_square(s.corners[k], s.corners[k + 1]));
        if (shortest < n * p.minCornerDistanceRate * n * p.minCornerDistanceRate)
            continue;
        if (s.area < 0)
            std::swap(s.corners[1], s.corners[3]);
        s.area = std::abs(s.area);
        found.push_back(std::move(s));
    }
}

/** Whether they are of one marker: its border's two sides, or seen with two windows. */
bool gn_squares::is_same(const square &a, const square &b) const
{
    double limit = std::min(a.n_points, b.n_points) * parameters->minMarkerDistanceRate;
    for (size_t turn = 0; turn < 4; turn++) {
        double sum = 0;
        for (size_t k = 0; k < 4; k++)
            sum += get_square(a.corners[(k + turn) % 4], b.corners[k]);
        if (sum / 4 < limit * limit)
            return true;
    }
    return false;
}

/** Of the squares that are the same one keeps the largest, all others in their order. */
void gn_squares::drop_doubles()
{
    std::vector<size_t> kept, order(found.size());
    std::iota(order.begin(), order.end(), size_t(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](size_t a, size_t b) { return found[a].area > found[b].area; });
    for (size_t i : order)
        if (std::none_of(kept.begin(), kept.end(),
                         [&](size_t other) { return is_same(found[i], found[other]); }))
            kept.push_back(i);
    std::sort(kept.begin(), kept.end());
    for (size_t i = 0; i < kept.size(); i++)
        std::swap(found[i], found[kept[i]]);
    found.resize(kept.size());
}

/** The light in the middle of each cell of a square, four times four of the eight times eight
 * places that OpenCV takes. */
void gn_squares::sample(const cv::Mat &grey, const std::vector<cv::Point2f> &corners, int cells)
{
    const float last = float(8 * cells - 1);
    const cv::Point2f places[] = {{0, 0}, {last, 0}, {last, last}, {0, last}};
    const cv::Matx33d h = cv::getPerspectiveTransform(places, corners.data());
    const cv::Rect all(0, 0, grey.cols, grey.rows);
    samples.create(N_SAMPLES * cells, N_SAMPLES * cells, CV_8U);
    for (int y = 0; y < samples.rows; y++) {
        for (int x = 0; x < samples.cols; x++) {
            const cv::Vec3d at = h * cv::Vec3d(x / N_SAMPLES * 8 + 2 + x % N_SAMPLES,
                                               y / N_SAMPLES * 8 + 2 + y % N_SAMPLES, 1);
            const cv::Point pixel(cvRound(at[0] / at[2]), cvRound(at[1] / at[2]));
            samples.at<uchar>(y, x) = all.contains(pixel) ? grey.at<uchar>(pixel) : uchar(0);
        }
    }
}

/** Which marker a square is; its corners begin at the marker's own top left then. */
bool gn_squares::read(const cv::Mat &grey, std::vector<cv::Point2f> &corners, int &id)
{
    constexpr int n = N_SAMPLES;
    const cv::aruco::DetectorParameters &p = *parameters;
    const int cells = dictionary->markerSize + 2;
    sample(grey, corners, cells);
    cv::Scalar mean, deviation;
    cv::meanStdDev(samples, mean, deviation);
    if (deviation[0] < p.minOtsuStdDev)
        return false;
    cv::threshold(samples, samples, 0, 1, cv::THRESH_BINARY | cv::THRESH_OTSU);
    bits.create(cells - 2, cells - 2, CV_8U);
    int n_wrong = 0;
    for (int y = 0; y < cells; y++) {
        for (int x = 0; x < cells; x++) {
            const bool is_white = cv::sum(samples(cv::Rect(n * x, n * y, n, n)))[0] > n * n / 2;
            if (x > 0 && y > 0 && x < cells - 1 && y < cells - 1)
                bits.at<uchar>(y - 1, x - 1) = is_white;
            else
                n_wrong += is_white;
        }
    }
    const int size = dictionary->markerSize;
    int turns = 0;
    if (n_wrong > int(size * size * p.maxErroneousBitsInBorderRate) ||
        !dictionary->identify(bits, id, turns, p.errorCorrectionRate))
        return false;
    std::rotate(corners.begin(), corners.end() - turns, corners.end());
    return true;
}

void gn_squares::find(const cv::Mat &grey, std::vector<std::vector<cv::Point2f>> &corners,
                      std::vector<int> &ids, std::vector<std::vector<cv::Point2f>> &unread)
{
    const cv::aruco::DetectorParameters &p = *parameters;
    found.clear();
    for (int w = p.adaptiveThreshWinSizeMin; w <= p.adaptiveThreshWinSizeMax;
         w += p.adaptiveThreshWinSizeStep)
        gather(grey, w);
    drop_doubles();
    for (square &s : found) {
        int id = -1;
        if (read(grey, s.corners, id)) {
            corners.push_back(std::move(s.corners));
            ids.push_back(id);
        } else {
            unread.push_back(std::move(s.corners));
        }
    }
}
