#include "engine/matching/feature_grid.hpp"

namespace stillmesh {

void FeatureGrid::build(std::uint32_t width, std::uint32_t height, std::span<const Keypoint> keypoints) noexcept {
    columns_ = cells(width);
    rows_ = cells(height);
    count_ = keypoints.size();
    const std::size_t count = static_cast<std::size_t>(columns_) * rows_;
    STILLMESH_CHECK(count + 1 <= begin_.size() && keypoints.size() <= order_.size());
    for (std::size_t i = 0; i <= count; ++i) begin_[i] = 0;
    for (const Keypoint& keypoint : keypoints) ++begin_[cell_of(keypoint)];
    std::uint32_t sum = 0;  // turn counts into ends, then fill from behind so that begins remain
    for (std::size_t i = 0; i < count; ++i) {
        sum += begin_[i];
        begin_[i] = static_cast<std::uint16_t>(sum);
    }
    begin_[count] = static_cast<std::uint16_t>(sum);
    for (std::size_t i = keypoints.size(); i > 0; --i) {
        order_[--begin_[cell_of(keypoints[i - 1])]] = static_cast<std::uint16_t>(i - 1);
    }
}

}  // namespace stillmesh
