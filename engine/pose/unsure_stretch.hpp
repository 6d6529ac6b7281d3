// Frames in a row that are not sure of their pose, looked at again by the next one that is. While they last nothing
// says whether the path is right. Then it is known where the camera was before and behind them, and a pose that lies
// farther off the straight line between than a hand strays in that time was more likely wrong than right. Cost: a pass
// over at most kPosesMax poses at the end of a stretch.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/fixed_vector.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

class UnsureStretch {
public:
    static constexpr std::size_t kPosesMax = 15;  // half a second; a longer stretch is not looked into

    void reset() noexcept { *this = UnsureStretch{}; }
    // A frame that is not sure of its pose, and where that lies, m; or that has none.
    void add(std::int64_t time_ns, const Vector3& position) noexcept;
    void add_without_pose() noexcept { is_whole_ = false; }
    struct Verdict {
        // It had a pose more than `stray_m` off the line, or more poses than are looked into.
        bool has_strayed = false;
        // The sure frame before it, if the line is nearer to the truth than its poses are: each frame had one, and all
        // were looked into.
        std::int64_t since_ns = kNoTime;
    };
    // A sure frame, later than all before: a stretch ends here, if there was one, and the next begins.
    [[nodiscard]] Verdict end(std::int64_t time_ns, const Vector3& position, double stray_m) noexcept;

private:
    struct Pose {
        float after_s = 0;    // behind the last sure frame
        float off_m[3] = {};  // from its position
    };
    [[nodiscard]] bool strays(std::int64_t time_ns, const Vector3& position, double stray_m) const noexcept;

    InlineVector<Pose, kPosesMax> poses_;
    std::int64_t sure_ns_ = 0;
    Vector3 sure_position_ = Vector3::Zero();
    bool has_sure_ = false;
    bool is_long_ = false;  // more poses than are kept
    bool is_whole_ = true;  // each frame has a pose
};

}  // namespace stillmesh
