// Would a camera that is lost find its way if it began anew where it is? A second, small engine is given the frames and
// says: whoever is lost among people, or in a blur, is lost there too; whoever stands in a place that the map does not
// hold is not. Taken up when a camera has been lost for a while, and given back with the answer. Cost: memory of the
// preset `pocket` (8 MiB at 640x480) and the time of a frame, for kFrames frames.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/engine.hpp"
#include "hal/depth_camera.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {

class PlaceProbe {
public:
    static constexpr std::uint32_t kFrames = 20;
    static constexpr std::uint32_t kTrackedMin = 16;  // of them: `tracked`, not `unsure`

    // Each frame that is not wrong in itself. Empty: not known yet.
    [[nodiscard]] std::optional<bool> frame(const CameraModel& camera, const Configuration& configuration,
                                            const Frame& frame);
    // Found again: whatever it was about to say is of no interest.
    void forget();

private:
    [[nodiscard]] bool begin(const CameraModel& camera, const Configuration& configuration);

    MemoryBlock block_;
    Engine* engine_ = nullptr;
    std::uint32_t frames_ = 0, tracked_ = 0;
    std::optional<bool> answer_;
};

}  // namespace stillmesh
