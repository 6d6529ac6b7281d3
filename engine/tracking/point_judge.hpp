// What a frame whose pose is known says of the points it matched: still or moving; a sure frame moves their static
// weights (Algorithm 2, method.md 7), still ones with depth are refined by a Kalman filter along and across the ray,
// those without a weight are followed, so that they do not breed new points. Limit: features_max features. Cost: one
// pass over the matches.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/tracked_shutter.hpp"

namespace stillmesh {

// kUnclear: it has no weight, and is not far from where it was first seen.
enum class Verdict : std::uint8_t { kNone = 0, kStill = 1, kMoving = 2, kUnclear = 3 };

// A frame whose pose is known.
struct PosedFrame {
    const MeasuredFrame& frame;
    const TrackedShutter& shutter;
    SE3 world_from_camera;
    std::uint64_t number = 0;
    std::int64_t time_ns = 0;
    double travelled = 0;  // the odometer's

    // The point is where this frame measures it as `feature`, which has depth...
    void place(std::size_t feature, MapPoint& point) const noexcept;
    // ... and was first seen there.
    void anchor(MapPoint& point) const noexcept;
};

class PointJudge {
public:
    // The frame that judges.
    struct Witness {
        PosedFrame posed;
        bool is_sure = false;    // only such a frame changes weights
        bool is_frozen = false;  // the map stays as it is, apart from marks of use
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<Verdict>(limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept;

    // No verdicts on `features` features.
    void clear(std::size_t features) noexcept;
    // Puts into `still` the indices of the correspondences with a weight from now on.
    void judge(std::span<const Correspondence> correspondences, const Witness& witness, Map& map,
               FixedVector<std::uint16_t>& still) noexcept;
    // By feature of the last frame judged or cleared for.
    [[nodiscard]] Verdict verdict(std::size_t feature) const noexcept { return verdicts_[feature]; }

private:
    void move_weight(const Correspondence& c, bool is_still, bool is_moving, std::int64_t time_ns,
                     MapPoint& point) const noexcept;
    void refine(const Correspondence& c, const PosedFrame& posed, const SE3& camera_from_world,
                MapPoint& point) const noexcept;
    void follow(const Correspondence& c, const PosedFrame& posed, MapPoint& point) const noexcept;

    const Parameters* parameters_ = nullptr;  // outlives it
    std::span<Verdict> verdicts_;
};

}  // namespace stillmesh
