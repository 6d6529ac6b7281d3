#include "bench/accuracy/masks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace stillmesh::accuracy {
namespace {

constexpr MaskKind kMaskKinds[] = {
    {"right", MaskFault::kRight, "bodies that move, pixel by pixel"},
    {"inverted", MaskFault::kInverted, "everything else"},
    {"late", MaskFault::kLate, "the right one of a third of a second before"},
    {"boxes", MaskFault::kBoxes, "squares of 64 px that hold any of it"},
    {"mirrored", MaskFault::kMirrored, "the right one, left and right exchanged"},
};
constexpr std::size_t kLateFrames = 10;
constexpr std::uint32_t kBox_px = 64;

void fill_boxes(std::vector<std::uint8_t>& pixels, std::uint32_t width, std::uint32_t height) {
    for (std::uint32_t y0 = 0; y0 < height; y0 += kBox_px) {
        for (std::uint32_t x0 = 0; x0 < width; x0 += kBox_px) {
            const std::uint32_t x1 = std::min(x0 + kBox_px, width), y1 = std::min(y0 + kBox_px, height);
            bool is_any = false;
            for (std::uint32_t y = y0; y < y1 && !is_any; ++y) {
                const auto row = pixels.begin() + static_cast<std::ptrdiff_t>(y) * width;
                is_any = std::find(row + x0, row + x1, std::uint8_t{255}) != row + x1;
            }
            for (std::uint32_t y = y0; y < y1 && is_any; ++y) {
                const auto row = pixels.begin() + static_cast<std::ptrdiff_t>(y) * width;
                std::fill(row + x0, row + x1, std::uint8_t{255});
            }
        }
    }
}

}  // namespace

const MaskKind* mask_kind(const std::string& name) {
    const auto* const found = std::find_if(std::begin(kMaskKinds), std::end(kMaskKinds),
                                           [&](const MaskKind& kind) { return name == kind.name; });
    return found == std::end(kMaskKinds) ? nullptr : found;
}

std::string mask_kinds_text() {
    std::string out;
    for (const MaskKind& kind : kMaskKinds)
        out += fmt::format("{}{}: {}", out.empty() ? "" : "; ", kind.name, kind.sentence);
    return out;
}

ImageView<std::uint8_t> MaskMaker::mask(ImageView<std::uint8_t> truth) {
    if (kind_ == nullptr || truth.data == nullptr) return {};
    const std::uint32_t width = truth.width, height = truth.height;
    pixels_.resize(std::size_t{width} * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::uint32_t column = kind_->fault == MaskFault::kMirrored ? width - 1 - x : x;
            const bool is_body = truth.at(column, y) > 127;
            pixels_[std::size_t{y} * width + x] =
                is_body != (kind_->fault == MaskFault::kInverted) ? std::uint8_t{255} : std::uint8_t{0};
        }
    }
    if (kind_->fault == MaskFault::kBoxes) fill_boxes(pixels_, width, height);
    if (kind_->fault == MaskFault::kLate) {
        past_.push_back(pixels_);
        if (past_.size() <= kLateFrames) return {};
        pixels_ = past_.front();
        past_.pop_front();
    }
    return {pixels_.data(), width, height, width};
}

}  // namespace stillmesh::accuracy
