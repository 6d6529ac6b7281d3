// Frames in a row whose pose is not sure, judged when the next sure one comes. While they last nothing says whether the
// path is right; then both ends are known, and poses that left the straight line between them by more than a hand does
// in that time were those of a body. Cost: a pass over at most kPosesMax poses at the end of a stretch.
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
    // A frame that is not sure, and where its pose lies, m; of one that has none, or no position, only that it was.
    void add(std::int64_t time_ns, const Vector3& position) noexcept;
    void add_without_pose() noexcept { ++frames_; }
    // Of a stretch that ends: it had at least the frames asked for, and left the line or had more poses than are looked
    // into; behind which frame, if the line says more than its poses do: each frame had one, and all were looked into.
    struct Verdict {
        bool has_strayed = false;
        std::int64_t since_ns = kNoTime;
    };
    // A sure frame, later than all before: where the next stretch begins.
    [[nodiscard]] Verdict end(std::int64_t time_ns, const Vector3& position, std::uint32_t frames_min,
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
