#include "hal/live/masked_camera.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr std::uint8_t kGrey = 128;
constexpr std::uint32_t kBordersPerWidth = 80;  // 8 px of 640: half a patch of the finest levels

}  // namespace

MaskedCamera::MaskedCamera(DepthCamera& source, std::vector<std::uint8_t> mask)
    : source_(source),
      width_(source.info().model.width),
      height_(source.info().model.height),
      mask_(std::move(mask)),
      keep_(mask_.size(), 0xffff),
      colour_(3 * mask_.size()),
      depth_(mask_.size()) {
    STILLMESH_CHECK(mask_.size() == std::size_t{width_} * height_);
    const std::uint32_t border = std::max(width_ / kBordersPerWidth, 1U);
    for (std::uint32_t y = 0; y < height_; ++y) {
        for (std::uint32_t x = 0; x < width_; ++x) {
            if (mask_[std::size_t{y} * width_ + x] == 0) continue;
            const std::uint32_t left = x - std::min(x, border), right = std::min(x + border, width_ - 1);
            const std::uint32_t bottom = std::min(y + border, height_ - 1);
            for (std::uint32_t v = y - std::min(y, border); v <= bottom; ++v) {
                std::fill(&keep_[std::size_t{v} * width_ + left], &keep_[std::size_t{v} * width_ + right] + 1,
                          std::uint16_t{0});
            }
        }
    }
}

Status MaskedCamera::poll(Frame& frame) noexcept {
    STILLMESH_TRY(source_.poll(frame));
    if (frame.depth.width != width_ || frame.depth.height != height_ || frame.colour.width != width_ ||
        frame.colour.height != height_) {
        return Status::kCorrupt;
    }
    const std::size_t channels = channels_of(frame.format);
    for (std::uint32_t y = 0; y < height_; ++y) {
        const std::size_t row = std::size_t{y} * width_;
        const std::uint16_t* const in = frame.depth.row(y);
        for (std::uint32_t x = 0; x < width_; ++x) depth_[row + x] = in[x] & keep_[row + x];
        const std::uint8_t* const seen = frame.colour.row(y);
        for (std::uint32_t x = 0; x < width_; ++x) {
            for (std::size_t c = 0; c < channels; ++c) {
                colour_[(row + x) * channels + c] = mask_[row + x] != 0 ? kGrey : seen[x * channels + c];
            }
        }
    }
    frame.colour = {colour_.data(), width_, height_, width_ * channels};
    frame.depth = {depth_.data(), width_, height_, width_};
    return Status::kOk;
}

}  // namespace stillmesh
