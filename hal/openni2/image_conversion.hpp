// Images that the device does not give as they are needed: depth brought into the colour camera's view or to colour's
// size, mirrored images turned round, grey out of YUV. What is right already is not touched. Memory: taken in the
// constructor, at most one colour and two depth images.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/frame/frame.hpp"
#include "hal/depth_camera.hpp"
#include "hal/live/depth_registration.hpp"
#include "hal/openni2/stream_modes.hpp"

namespace stillmesh::openni2 {

class ImageConversion {
public:
    // `camera`: of the frames that come out. `baseline_m`: where depth is registered here.
    ImageConversion(const Streams& streams, const CameraInfo& camera, double baseline_m);

    // `frame` holds the pixels as they came; afterwards what is needed, here or there until the next call.
    void convert(Frame& frame) noexcept;

private:
    CameraModel model_;
    openni::PixelFormat format_;
    bool is_colour_mirrored_;
    std::optional<DepthRegistration> registration_;
    std::vector<std::uint16_t> depth_;          // registered or scaled
    std::vector<std::uint16_t> depth_upright_;  // not mirrored
    std::vector<std::uint8_t> colour_;          // not mirrored, or grey made of YUV
};

}  // namespace stillmesh::openni2
