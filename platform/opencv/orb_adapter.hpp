// For people who come with OpenCV: cv::Mat as our views without a copy, and cv::ORB behind the FeatureExtractor port
// (`--features opencv`), to compare with and to fall back on. cv::ORB takes memory from the heap on every image;
// nothing that it throws passes through here.
#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "engine/features/features.hpp"

namespace stillmesh {

// Views of a CV_8UC1 and of a CV_16UC1 matrix; empty when it is of another type. Borrowed: the matrix must live longer.
[[nodiscard]] GreyView grey_view(const cv::Mat& image) noexcept;
[[nodiscard]] DepthView depth_view(const cv::Mat& depth) noexcept;
// A matrix over pixels that somebody else owns; not to be written to.
[[nodiscard]] cv::Mat matrix_over(const GreyView& image);

class CvOrbExtractor final : public FeatureExtractor {
public:
    // Throws what cv::ORB::create throws: this is start-up.
    CvOrbExtractor(int features_max, double scale_factor, int levels);
    ~CvOrbExtractor();
    CvOrbExtractor(const CvOrbExtractor&) = delete;
    CvOrbExtractor& operator=(const CvOrbExtractor&) = delete;

    //   kOk    kInvalid  empty image, or OpenCV refused it; `features` is then empty
    [[nodiscard]] Status extract(const GreyView& image, FeatureSet& features) noexcept override;

private:
    struct Inner;
    std::unique_ptr<Inner> inner_;
};

}  // namespace stillmesh
