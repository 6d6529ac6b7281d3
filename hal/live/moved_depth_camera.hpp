// A camera whose depth is older than its picture, with depth moved to where the picture sees it: as the camera moves in
// between, if it goes on as it did between its last two poses, which whoever tracks tells. What moved by itself stays
// where it was, so that a frame keeps its `depth_time_ns`. Depth stays as it comes while there are no two measured
// poses in a row, where it would move by less than a tenth of a pixel half a metre away, and where the camera would
// turn by more than 0.1 rad, which none that is tracked does in a sixtieth of a second. A stream that is stuck is to be
// seen before this (FrameGuard does): moved, it repeats no more. Of one thread. Memory: one depth image, and what
// DepthRegistration takes. Cost: DepthRegistration's.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/depth_registration.hpp"

namespace stillmesh {

class MovedDepthCamera final : public DepthCamera {
public:
    // `source` is open, and outlives this.
    explicit MovedDepthCamera(DepthCamera& source);

    [[nodiscard]] Status open() noexcept override { return source_.open(); }
    [[nodiscard]] const CameraInfo& info() const noexcept override { return source_.info(); }
    // As the source's.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override { return source_.wait(timeout_ms); }
    void close() noexcept override { source_.close(); }

    // Between two polls: where the camera was when the last frame's picture was taken, in a frame of reference that
    // stays. None: it was not measured.
    void learn(std::int64_t time_ns, const std::optional<RigidTransform>& odom_from_camera) noexcept;

private:
    struct Speed {
        double rad_per_s[3] = {}, m_per_s[3] = {};  // of points in the camera's frame
    };

    DepthCamera& source_;
    CameraModel model_;
    DepthRegistration registration_;
    std::vector<std::uint16_t> depth_;
    std::int64_t last_ns_ = 0;
    std::optional<RigidTransform> last_;
    Speed speed_;  // 0: not known
};

}  // namespace stillmesh
