#include "platform/opencv/orb_adapter.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <vector>

namespace stillmesh {

struct CvOrbExtractor::Inner {
    cv::Ptr<cv::ORB> orb;
    double scale_factor = 1.2;
    std::vector<cv::KeyPoint> keypoints;
    std::vector<std::size_t> order;  // strongest first
    cv::Mat descriptors;
};

GreyView grey_view(const cv::Mat& image) noexcept {
    if (image.type() != CV_8UC1 || image.dims != 2 || image.empty()) return {};
    return {image.data, static_cast<std::uint32_t>(image.cols), static_cast<std::uint32_t>(image.rows), image.step[0]};
}

DepthView depth_view(const cv::Mat& depth) noexcept {
    if (depth.type() != CV_16UC1 || depth.dims != 2 || depth.empty()) return {};
    return {depth.ptr<std::uint16_t>(), static_cast<std::uint32_t>(depth.cols), static_cast<std::uint32_t>(depth.rows),
            depth.step[0] / sizeof(std::uint16_t)};
}

cv::Mat matrix_over(const GreyView& image) {
    // OpenCV has no matrix of constant pixels.
    return cv::Mat(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC1,
                   const_cast<std::uint8_t*>(image.data), image.stride);
}

CvOrbExtractor::CvOrbExtractor(int features_max, double scale_factor, int levels) : inner_(new Inner) {
    inner_->orb = cv::ORB::create(features_max, static_cast<float>(scale_factor), levels);
    inner_->scale_factor = scale_factor;
}

CvOrbExtractor::~CvOrbExtractor() = default;

Status CvOrbExtractor::extract(const GreyView& image, FeatureSet& features) noexcept {
    features.clear();
    if (image.is_empty() || image.stride < image.width) return Status::kInvalid;
    try {
        inner_->orb->detectAndCompute(matrix_over(image), cv::noArray(), inner_->keypoints, inner_->descriptors);
        inner_->order.resize(inner_->keypoints.size());
    } catch (...) {
        return Status::kInvalid;
    }
    std::vector<std::size_t>& order = inner_->order;
    std::iota(order.begin(), order.end(), std::size_t{0});
    const std::vector<cv::KeyPoint>& found = inner_->keypoints;
    std::sort(order.begin(), order.end(), [&found](std::size_t a, std::size_t b) {
        return found[a].response != found[b].response ? found[a].response > found[b].response : a < b;
    });
    const std::size_t count = std::min({order.size(), features.keypoints.capacity(), std::size_t{65535}});
    for (std::size_t i = 0; i < count; ++i) {
        const cv::KeyPoint& from = found[order[i]];
        Keypoint keypoint;
        // cv::ORB multiplies a level's pixel by its scale and so shifts it by half a pixel against the full image's.
        const double shift_px = 0.5 * (std::pow(inner_->scale_factor, from.octave) - 1);
        keypoint.x = static_cast<float>(static_cast<double>(from.pt.x) + shift_px);
        keypoint.y = static_cast<float>(static_cast<double>(from.pt.y) + shift_px);
        const double degrees = static_cast<double>(from.angle > 180.0f ? from.angle - 360.0f : from.angle);
        keypoint.angle_rad = static_cast<float>(degrees * 3.14159265358979323846 / 180.0);
        keypoint.score = static_cast<std::uint16_t>(count - i);  // its responses have no fixed range: rank
        keypoint.level = static_cast<std::uint8_t>(from.octave);
        Descriptor descriptor;
        std::memcpy(descriptor.words, inner_->descriptors.ptr(static_cast<int>(order[i])), sizeof descriptor.words);
        if (!features.keypoints.push(keypoint) || !features.descriptors.push(descriptor)) break;
    }
    return Status::kOk;
}

}  // namespace stillmesh
