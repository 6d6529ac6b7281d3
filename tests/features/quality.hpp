// How good features are: an image and a transformed copy of it whose geometry is known exactly. Needs OpenCV.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace stillmesh::testing {

struct Found {
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;  // CV_8U, 32 columns
};
using Finder = std::function<Found(const cv::Mat&)>;

// The transformed image, and the 2x3 matrix that takes a pixel of the original to it.
struct Transformed {
    std::string name;
    cv::Mat image;
    cv::Matx23d map;
};

// Rotations, scales, blurs, noise, dimming, and all of them a little. Deterministic.
std::vector<Transformed> transformations(const cv::Mat& image);

// rotation, scale, blur, noise or mixed.
std::string kind_of(const Transformed& transformed);

struct Quality {
    double visible = 0;       // keypoints of the original that lie inside the copy
    double repeated = 0;      // of them, found again within 2.5 px
    double matches = 0;       // mutual nearest descriptors
    double right = 0;         // of them, within 3 px of the truth
    double error2_px2 = 0;    // sum over the right ones of the squared distance to the truth
    double error2_level = 0;  // the same in pixels of the original keypoint's level, over those under 2 of them
    double right_level = 0;
    // Distance of the descriptors, and whether the match is right.
    std::vector<std::pair<float, bool>> ranked;
    // Inlier ratio of the `count` matches with the smallest distances: an extractor that gives out more features, and
    // so harder ones, is compared at the same number of matches.
    [[nodiscard]] double inlier_ratio_of_best(std::size_t count) const;
    [[nodiscard]] double repeatability() const { return repeated / visible; }
    [[nodiscard]] double inlier_ratio() const { return right / matches; }
    [[nodiscard]] double matching_score() const { return right / visible; }
    [[nodiscard]] double error_px() const;
    [[nodiscard]] double error_level_px() const;
    void add(const Quality& other);
};

Quality measure(const Found& original, const Found& copy, const Transformed& transformed);

}  // namespace stillmesh::testing
