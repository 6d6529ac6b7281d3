// Masks as a detector gives them, made from the truth, with the faults that detectors have (--masks).
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "engine/frame/image_view.hpp"

namespace stillmesh::accuracy {

enum class MaskFault : std::uint8_t { kRight, kInverted, kLate, kBoxes, kMirrored };

// One kind of mask, by its name.
struct MaskKind {
    const char* name = "";
    MaskFault fault = MaskFault::kRight;
    const char* sentence = "";
};
// nullptr: no such kind.
[[nodiscard]] const MaskKind* mask_kind(const std::string& name);
// All names with their sentences.
[[nodiscard]] std::string mask_kinds_text();

// Of one run.
class MaskMaker {
public:
    explicit MaskMaker(const MaskKind* kind) : kind_(kind) {}
    // From the true mask of a frame, 255 where a body moves; valid until the next. No data: none.
    [[nodiscard]] ImageView<std::uint8_t> mask(ImageView<std::uint8_t> truth);

private:
    const MaskKind* kind_;
    std::vector<std::uint8_t> pixels_;
    std::deque<std::vector<std::uint8_t>> past_;
};

}  // namespace stillmesh::accuracy
