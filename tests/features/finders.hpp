// Both extractors behind one face.
#pragma once

#include <memory>
#include <opencv2/features2d.hpp>

#include "tests/features/quality.hpp"
#include "tests/features/rig.hpp"

namespace stillmesh::testing {

inline Found found_of(const FeatureSet& features) {
    Found found;
    for (const Keypoint& k : features.keypoints.span())
        found.keypoints.emplace_back(k.x, k.y, 31.0f, k.angle_rad * 57.29578f, static_cast<float>(k.score), k.level);
    found.descriptors.create(static_cast<int>(features.size()), 32, CV_8U);
    for (std::size_t i = 0; i < features.size(); ++i)
        std::memcpy(found.descriptors.ptr(static_cast<int>(i)), features.descriptors[i].words, 32);
    return found;
}

inline Finder our_finder(const Kernels& kernels, const OrbOptions& options = {}) {
    auto rig = std::make_shared<Rig>(Limits::room(), kernels, options);
    return [rig](const cv::Mat& image) {
        const GreyView view{image.data, static_cast<std::uint32_t>(image.cols), static_cast<std::uint32_t>(image.rows),
                            image.step};
        const Status status = rig->extractor.extract(view, rig->features);
        STILLMESH_CHECK(status == Status::kOk);
        return found_of(rig->features);
    };
}

inline Finder their_finder(int features_max = 1000) {
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(features_max, 1.2f, 8);
    return [orb](const cv::Mat& image) {
        Found found;
        orb->detectAndCompute(image, cv::noArray(), found.keypoints, found.descriptors);
        return found;
    };
}

}  // namespace stillmesh::testing
