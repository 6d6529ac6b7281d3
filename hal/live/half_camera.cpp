#include "hal/live/half_camera.hpp"

#include <algorithm>
#include <exception>

namespace stillmesh {
namespace {

// Of four depths the lower middle one of those that are any; 0: none is. Without branches: depth is as good as random
// to them. One less than each, none is the largest; then the smallest of one or two, or the second of three or four.
[[nodiscard]] std::uint16_t middle(std::uint16_t a, std::uint16_t b, std::uint16_t c, std::uint16_t d) noexcept {
    const auto less = [](std::uint16_t value) { return static_cast<std::uint16_t>(value - 1); };
    const std::uint16_t low_ab = std::min(less(a), less(b)), high_ab = std::max(less(a), less(b));
    const std::uint16_t low_cd = std::min(less(c), less(d)), high_cd = std::max(less(c), less(d));
    const std::uint16_t first = std::min(low_ab, low_cd);
    const std::uint16_t second = std::min(std::max(low_ab, low_cd), std::min(high_ab, high_cd));
    const int count = (a != 0) + (b != 0) + (c != 0) + (d != 0);
    return static_cast<std::uint16_t>((count >= 3 ? second : first) + 1);
}

}  // namespace

// Any of four covers.
void HalfCamera::halve_mask(const ImageView<std::uint8_t>& whole, ImageView<std::uint8_t>& half) noexcept {
    const std::uint32_t width = info_.model.width, height = info_.model.height;
    half = {};
    if (whole.width / 2 != width || whole.height / 2 != height) return;
    for (std::uint32_t y = 0; y < height; ++y) {
        const std::uint8_t* const upper = whole.row(2 * y);
        const std::uint8_t* const lower = whole.row(2 * y + 1);
        for (std::uint32_t x = 0; x < width; ++x) {
            mask_[std::size_t{y} * width + x] =
                std::max({upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]});
        }
    }
    half = {mask_.data(), width, height, width};
}

CameraModel halved(const CameraModel& model) noexcept {
    CameraModel half = model;
    half.width /= 2;
    half.height /= 2;
    half.fx /= 2;
    half.fy /= 2;
    half.cx = (half.cx + 0.5) / 2 - 0.5;  // pixel (0, 0) is the centre of the first pixel
    half.cy = (half.cy + 0.5) / 2 - 0.5;
    return half;
}

HalfCamera::HalfCamera(DepthCamera& source) : source_(source) {
    fit();
}

void HalfCamera::fit() {
    info_ = source_.info();
    info_.model = halved(info_.model);
    const std::size_t pixels = std::size_t{info_.model.width} * info_.model.height;
    colour_.resize(pixels * 3);
    depth_.resize(pixels);
    mask_.resize(pixels);
}

Status HalfCamera::open() noexcept {
    STILLMESH_TRY(source_.open());
    try {
        fit();
    } catch (const std::exception&) {
        return Status::kUnavailable;
    }
    return Status::kOk;
}

Status HalfCamera::poll(Frame& frame) noexcept {
    Frame whole;
    STILLMESH_TRY(source_.poll(whole));
    const std::uint32_t width = info_.model.width, height = info_.model.height;
    if (whole.colour.width / 2 != width || whole.colour.height / 2 != height || whole.depth.width / 2 != width ||
        whole.depth.height / 2 != height) {
        return Status::kCorrupt;
    }
    const std::size_t channels = channels_of(whole.format);
    for (std::uint32_t y = 0; y < height; ++y) {
        const std::uint8_t* const upper = whole.colour.row(2 * y);
        const std::uint8_t* const lower = whole.colour.row(2 * y + 1);
        std::uint8_t* const out = &colour_[y * width * channels];
        for (std::uint32_t x = 0; x < width; ++x) {
            for (std::size_t c = 0; c < channels; ++c) {
                const std::size_t left = 2 * x * channels + c, right = left + channels;
                out[x * channels + c] =
                    static_cast<std::uint8_t>((upper[left] + upper[right] + lower[left] + lower[right] + 2) / 4);
            }
        }
        const std::uint16_t* const above = whole.depth.row(2 * y);
        const std::uint16_t* const below = whole.depth.row(2 * y + 1);
        for (std::uint32_t x = 0; x < width; ++x) {
            depth_[std::size_t{y} * width + x] = middle(above[2 * x], above[2 * x + 1], below[2 * x], below[2 * x + 1]);
        }
    }
    frame = whole;
    if (whole.mask.data != nullptr) halve_mask(whole.mask, frame.mask);
    frame.colour = {colour_.data(), width, height, width * channels};
    frame.depth = {depth_.data(), width, height, width};
    return Status::kOk;
}

}  // namespace stillmesh
