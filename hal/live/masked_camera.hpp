// A camera that is told where not to look, for what it always sees of its own robot: an arm, a bumper, a cable. Masked
// pixels are painted one grey, so that no feature is spent on them, and have no depth, so that nothing there has a say
// in the pose or becomes a point of the map. Depth goes for an eightieth of the picture's width more, since patches of
// features reach across the border. Memory: one colour and one depth image, taken when it is made. Cost: 0.5 ms for a
// frame of 640x480 in colour.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/depth_camera.hpp"

namespace stillmesh {

class MaskedCamera final : public DepthCamera {
public:
    // `source` is open, and outlives this. `mask` is of its size, row by row: what is not 0 is not looked at.
    MaskedCamera(DepthCamera& source, std::vector<std::uint8_t> mask);

    [[nodiscard]] Status open() noexcept override { return source_.open(); }
    [[nodiscard]] const CameraInfo& info() const noexcept override { return source_.info(); }
    // As the source's; kCorrupt also for a frame of another size than the mask.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override { return source_.wait(timeout_ms); }
    void close() noexcept override { source_.close(); }

private:
    DepthCamera& source_;
    std::uint32_t width_, height_;
    std::vector<std::uint8_t> mask_;
    std::vector<std::uint16_t> keep_;  // of depth: all bits, or none
    std::vector<std::uint8_t> colour_;
    std::vector<std::uint16_t> depth_;
};

}  // namespace stillmesh
