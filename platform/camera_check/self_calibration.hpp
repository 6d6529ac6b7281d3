// Focal lengths and centre from what stands still: of pairs of views with depth, the motions and one correction of the
// calibration are fitted together (least squares, robust). What a motion tells: a turn shows the focal lengths, as the
// picture moves faster at its border than in its middle by their square; a turn about the axis their ratio; depth of
// different distances the centre. A straight way without turning tells nothing of the focal lengths, and nothing ever
// tells the depth unit: the world would look the same at twice the size. The covariance says which of these is so.
// Limits: kPairs pairs of at most kMatches matches; the oldest leaves. Cost: 2 ms an iteration when all is full.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geometry/camera_model.hpp"
#include "platform/camera_check/views.hpp"

namespace stillmesh {

// What would fit: each number with its standard deviation.
struct CameraCorrection {
    bool is_known = false;
    std::array<double, 4> value{};  // ln of the factors on fx and fy; the shifts of cx and cy, px
    std::array<double, 4> sigma{};
    double cost_before = 0, cost = 0;  // robust, per match: as given, and corrected
    std::uint32_t pairs = 0;
};

class SelfCalibration {
public:
    static constexpr std::uint32_t kPairs = 12, kMatches = 80;

    explicit SelfCalibration(const CameraModel& camera);
    // Matches that move as one body (Rigidity::is_inlier).
    void add(const std::vector<ViewMatch>& matches, const std::vector<bool>& is_inlier);
    [[nodiscard]] CameraCorrection estimate() const;
    [[nodiscard]] std::uint64_t pairs_added() const { return added_; }
    void clear() { added_ = 0; }

private:
    CameraModel camera_;
    std::array<std::vector<ViewMatch>, kPairs> pairs_;
    std::uint64_t added_ = 0;
};

}  // namespace stillmesh
