#include "tests/features/quality.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace stillmesh::testing {
namespace {

cv::Mat with_noise(const cv::Mat& image, double sigma, std::uint64_t seed) {
    cv::RNG random(seed);
    cv::Mat noise(image.size(), CV_16S);
    random.fill(noise, cv::RNG::NORMAL, 0, sigma);
    cv::Mat sum;
    cv::add(image, noise, sum, cv::noArray(), CV_8U);
    return sum;
}

Transformed turned(const cv::Mat& image, std::string name, double degrees, double scale, double shift_px) {
    const cv::Point2f centre(static_cast<float>(image.cols - 1) / 2, static_cast<float>(image.rows - 1) / 2);
    cv::Mat m = cv::getRotationMatrix2D(centre, degrees, scale);
    m.at<double>(0, 2) += shift_px;
    m.at<double>(1, 2) += shift_px;
    cv::Mat source = image;
    // What a smaller picture cannot show is smoothed away first, as a camera's pixels do.
    if (scale < 1) cv::GaussianBlur(image, source, cv::Size(), 0.5 * std::sqrt(1 / (scale * scale) - 1));
    Transformed result;
    result.name = std::move(name);
    cv::warpAffine(source, result.image, m, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
    result.map = cv::Matx23d(m.ptr<double>());
    return result;
}

}  // namespace

std::vector<Transformed> transformations(const cv::Mat& image) {
    const cv::Matx23d same(1, 0, 0, 0, 1, 0);
    std::vector<Transformed> all;
    for (const int degrees : {7, 23, 45, 90, 160})
        all.push_back(turned(image, "rotation " + std::to_string(degrees), degrees, 1, 0.3));
    for (const double scale : {0.55, 0.7, 0.85, 1.2, 1.5})
        all.push_back(turned(image, "scale " + std::to_string(scale).substr(0, 4), 0, scale, 0.3));
    cv::Mat blurred;
    for (const double sigma : {1.0, 2.0}) {
        cv::GaussianBlur(image, blurred, cv::Size(), sigma);
        all.push_back({"blur " + std::to_string(sigma).substr(0, 3), blurred.clone(), same});
    }
    // Motion: a row of pixels, as of a camera that turns sideways.
    cv::blur(image, blurred, cv::Size(7, 1));
    all.push_back({"motion 7 px", blurred.clone(), same});
    for (const int sigma : {4, 8, 16})
        all.push_back({"noise " + std::to_string(sigma), with_noise(image, sigma, 7), same});
    cv::Mat dim;
    image.convertTo(dim, CV_8U, 0.25);
    all.push_back({"dim 1/4 noise 2", with_noise(dim, 2, 8), same});
    for (const double shift : {0.25, 0.5}) {
        Transformed shifted = turned(image, "shift " + std::to_string(shift).substr(0, 4) + " noise 3", 0, 1, shift);
        shifted.image = with_noise(shifted.image, 3, 9);
        all.push_back(shifted);
    }
    Transformed mixed = turned(image, "all of it", 30, 0.8, 0.3);
    cv::GaussianBlur(mixed.image, blurred, cv::Size(), 0.8);
    mixed.image = with_noise(blurred, 4, 10);
    all.push_back(mixed);
    return all;
}

std::string kind_of(const Transformed& transformed) {
    const std::string word = transformed.name.substr(0, transformed.name.find(' '));
    if (word == "motion") return "blur";
    if (word == "dim" || word == "shift") return "noise";
    return word == "all" ? "mixed" : word;
}

double Quality::error_px() const {
    return std::sqrt(error2_px2 / right);
}

double Quality::error_level_px() const {
    return std::sqrt(error2_level / right_level);
}

double Quality::inlier_ratio_of_best(std::size_t count) const {
    std::vector<std::pair<float, bool>> sorted = ranked;
    std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    sorted.resize(std::min(count, sorted.size()));
    double inliers = 0;
    for (const auto& match : sorted) inliers += match.second ? 1 : 0;
    return inliers / static_cast<double>(sorted.size());
}

void Quality::add(const Quality& other) {
    visible += other.visible;
    repeated += other.repeated;
    matches += other.matches;
    right += other.right;
    ranked.insert(ranked.end(), other.ranked.begin(), other.ranked.end());
    error2_px2 += other.error2_px2;
    error2_level += other.error2_level;
    right_level += other.right_level;
}

Quality measure(const Found& original, const Found& copy, const Transformed& transformed) {
    const double border = 20;  // nobody finds corners there
    Quality quality;
    std::vector<cv::Point2d> truth;
    Found visible;
    for (std::size_t i = 0; i < original.keypoints.size(); ++i) {
        const cv::Point2f p = original.keypoints[i].pt;
        const cv::Vec2d q = transformed.map * cv::Vec3d(p.x, p.y, 1);
        if (q[0] < border || q[1] < border || q[0] > transformed.image.cols - 1 - border ||
            q[1] > transformed.image.rows - 1 - border)
            continue;
        truth.emplace_back(q[0], q[1]);
        visible.keypoints.push_back(original.keypoints[i]);
        visible.descriptors.push_back(original.descriptors.row(static_cast<int>(i)));
        double best = 1e9;
        for (const cv::KeyPoint& other : copy.keypoints)
            best = std::min(best, std::hypot(other.pt.x - q[0], other.pt.y - q[1]));
        quality.visible += 1;
        quality.repeated += best <= 2.5 ? 1 : 0;
    }
    if (truth.empty() || copy.keypoints.empty()) return quality;
    std::vector<cv::DMatch> matches;
    cv::BFMatcher(cv::NORM_HAMMING, true).match(visible.descriptors, copy.descriptors, matches);
    for (const cv::DMatch& match : matches) {
        const cv::Point2d q = truth[static_cast<std::size_t>(match.queryIdx)];
        const cv::Point2f p = copy.keypoints[static_cast<std::size_t>(match.trainIdx)].pt;
        const double error = std::hypot(p.x - q.x, p.y - q.y);
        quality.matches += 1;
        quality.ranked.emplace_back(match.distance, error <= 3);
        if (error > 3) continue;
        quality.right += 1;
        quality.error2_px2 += error * error;
        const int octave = visible.keypoints[static_cast<std::size_t>(match.queryIdx)].octave;
        const double in_level = error / std::pow(1.2, octave);
        if (in_level > 2) continue;
        quality.right_level += 1;
        quality.error2_level += in_level * in_level;
    }
    return quality;
}

}  // namespace stillmesh::testing
