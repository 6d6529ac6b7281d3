// Frames in a row whose pose is not sure, judged when the next sure one comes. While they last nothing says whether the
// path is right; then both ends are known, and poses that left the straight line between them by more than a hand does
// in that time were those of a body. Cost: a pass over at most kPosesMax poses at the end of a stretch.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/fixed_vector.hpp"
#include "engine/geometry/se3.hpp"

namespace stillmesh {

class UnsureStretch {
public:
    static constexpr std::size_t kPosesMax = 15;  // half a second; a longer stretch is not looked into

    void reset() noexcept { *this = UnsureStretch{}; }
    // A frame that is not sure, and where its pose lies, m; of one that has none, or no position, only that it was.
    void add(std::int64_t time_ns, const Vector3& position) noexcept;
    void add_without_pose() noexcept { ++frames_; }
    // A sure frame, later than all before: where the next stretch begins. True: a stretch of at least `frames_min`
    // frames ends here that left the line by more than `stray_m`, or had more poses than are looked into.
    [[nodiscard]] bool end(std::int64_t time_ns, const Vector3& position, std::uint32_t frames_min,
                           double stray_m) noexcept;

private:
    struct Pose {
        float after_s = 0;    // behind the last sure frame
        float off_m[3] = {};  // from its position
    };
    [[nodiscard]] bool strays(std::int64_t time_ns, const Vector3& position, double stray_m) const noexcept;

    InlineVector<Pose, kPosesMax> poses_;
    std::int64_t sure_ns_ = 0;
    Vector3 sure_position_ = Vector3::Zero();
    std::uint32_t frames_ = 0;
    bool has_sure_ = false;
    bool is_long_ = false;
};

}  // namespace stillmesh
