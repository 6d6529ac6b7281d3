// A mask that comes with a frame: where a detector takes what it sees for a person or another body that may move
// (Frame::mask). What it covers counts a tenth of what its past makes it count, so that in the first second, where
// nothing has a past, the room has the say; where nothing else is in view nothing changes. It may be wrong, turned
// round for one: a mask that covers more than half of the area in view, in square metres, or more than half of what is
// known to stand still, is not believed in this frame. Limit: a wrong one that covers less takes weight from what
// stands; what is left decides. Cost: with a mask, one look at each 64th pixel and two at each match; without, none.
#pragma once

#include <cstdint>
#include <span>

#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/tracking/tuning.hpp"

namespace stillmesh {

class FrameMask {
public:
    void create(const MaskParameters& parameters) noexcept { parameters_ = parameters; }
    // The mask of this frame, or none; borrowed until the next.
    void begin(const Frame& frame) noexcept;
    // Takes their weight from the matches that it covers, unless it is not believed.
    void weigh(std::span<const Keypoint> keypoints, std::span<Correspondence> matches) const noexcept;
    // There is one, and it covers no more of the area in view than it may.
    [[nodiscard]] bool is_plausible() const noexcept { return mask_.data != nullptr; }

private:
    [[nodiscard]] bool covers(float x, float y) const noexcept;

    MaskParameters parameters_;
    ImageView<std::uint8_t> mask_;
};

}  // namespace stillmesh
