/* SPDX-FileCopyrightText: 2026 the Gnomon authors */
/* SPDX-License-Identifier: ISC */
/*
 * Markers in a picture: what cv::aruco::detectMarkers() finds without refinement, several times
 * sooner where the picture is full of dark and light specks. The method is that of Garrido-Jurado,
 * Munoz-Salinas, Madrid-Cuevas and Marin-Jimenez 2014 (Pattern Recognition 47), section 4.
 */
#ifndef GN_CLIENT_VISION_SQUARES_HPP
#define GN_CLIENT_VISION_SQUARES_HPP

#include <memory>
#include <vector>

#include <opencv2/aruco.hpp>

#include "client/vision/outlines.h"

/** Throws. Thread-safety: unsafe. */
class gn_squares {
  public:
    gn_squares(cv::Ptr<cv::aruco::Dictionary> dictionary,
               cv::Ptr<cv::aruco::DetectorParameters> parameters);

    /** The picture's markers: corners clockwise from their own top left, whole pixels, and ids;
     * unread: other convex figures of four corners, clockwise. */
    void find(const cv::Mat &grey, std::vector<std::vector<cv::Point2f>> &corners,
              std::vector<int> &ids, std::vector<std::vector<cv::Point2f>> &unread);

  private:
    enum { N_SAMPLES = 4 }; // along a cell's side

    /** A figure of four corners. */
    struct square {
        std::vector<cv::Point2f> corners; // clockwise
        double area;                      // px^2
        int n_points;                     // of its outline
    };
    struct release {
        void operator()(gn_outlines *outlines) const
        {
            gn_outlines_destroy(&outlines);
        }
    };

    bool is_same(const square &a, const square &b) const;
    void gather(const cv::Mat &grey, int window);
    void drop_doubles();
    void sample(const cv::Mat &grey, const std::vector<cv::Point2f> &corners, int cells);
    bool read(const cv::Mat &grey, std::vector<cv::Point2f> &corners, int &id);

    cv::Ptr<cv::aruco::Dictionary> dictionary;
    cv::Ptr<cv::aruco::DetectorParameters> parameters;
    std::unique_ptr<gn_outlines, release> outlines;
    std::vector<square> found;
    cv::Mat samples, bits;
};

#endif
