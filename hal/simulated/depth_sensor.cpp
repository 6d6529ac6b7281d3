#include "hal/simulated/depth_sensor.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "hal/for_each_processor.hpp"

namespace stillmesh::simulated {
namespace {

// Focal length (px at VGA) times distance from camera to projector (m): the Kinect's.
constexpr float kFocalBaseline = 580.0F * 0.075F;
// In all sigma_z = 1.425e-3 z^2 is 0.062 px of disparity; steps of 1/8 px account for 0.036, the rest is noise: half
// of its variance shared by neighbours.
constexpr float kDisparitySteps = 8.0F;
constexpr float kNoiseOwn = 0.0357F;
constexpr float kNoiseShared = 0.0357F;
constexpr std::uint32_t kCell = 6;     // px of the shared noise
constexpr float kBilinearGain = 1.5F;  // interpolation takes 4/9 of the variance

// A word of chance for each pixel from `first` on, and the noise that is the pixel's own.
STILLMESH_FOR_EACH_PROCESSOR void throw_dice(std::uint32_t first, std::uint32_t key, std::size_t count,
                                             std::uint32_t* __restrict dice, float* __restrict noise) {
    for (std::size_t x = 0; x < count; ++x) {
        const std::uint32_t word = scramble((first + static_cast<std::uint32_t>(x)) * 747796405U + key);
        dice[x] = word;
        noise[x] = kNoiseOwn * bell(scramble(word));
    }
}

// Lengths of the rays of a row, whose third component is 1.
STILLMESH_FOR_EACH_PROCESSOR void measure_rays(const float* __restrict ray_x, float ray_y, std::size_t count,
                                               float* __restrict length) {
    for (std::size_t x = 0; x < count; ++x) length[x] = std::sqrt(1.0F + ray_x[x] * ray_x[x] + ray_y * ray_y);
}

// The nearest whole number in [low, high], halves away from zero, as round_clamped() of the value as a double: below
// 2^24 what is left over a whole number is exact.
[[nodiscard]] constexpr std::int32_t round_below_2_24(float value, std::int32_t low, std::int32_t high) noexcept {
    const float inside = std::clamp(value, static_cast<float>(low), static_cast<float>(high));
    const auto whole = static_cast<std::int32_t>(inside);
    return whole + (inside - static_cast<float>(whole) >= 0.5F ? 1 : 0);
}

// A row of what is seen: steps of disparity, and the depth that they stand for; 0 where nothing is seen or out of
// range.
STILLMESH_FOR_EACH_PROCESSOR void count_steps(const float* __restrict inverse, const float* __restrict noise,
                                              const std::uint32_t* __restrict is_seen, float units_per_m,
                                              std::size_t count, std::uint16_t* __restrict depth) {
    for (std::size_t x = 0; x < count; ++x) {
        const std::int32_t steps =
            round_below_2_24((kFocalBaseline * inverse[x] + noise[x]) * kDisparitySteps, 1, 100000);
        const float z = kFocalBaseline * kDisparitySteps / static_cast<float>(steps);
        const std::int32_t units = round_below_2_24(z * units_per_m, 1, 65535);
        const bool is_in_range = (is_seen[x] != 0) & (z >= kDepthMin) & (z <= kDepthMax);
        depth[x] = static_cast<std::uint16_t>(is_in_range ? units : 0);
    }
}

}  // namespace

Lattice::Lattice(std::uint32_t width, std::uint32_t height)
    : width_(width / kCell + 2),
      values_(static_cast<std::size_t>(width_) * (height / kCell + 2)),
      row_(static_cast<std::size_t>(width_ - 1) * kCell) {}

void Lattice::fill(std::uint32_t key) {
    for (std::size_t i = 0; i < values_.size(); ++i) {
        values_[i] = kBilinearGain * bell(scramble(static_cast<std::uint32_t>(i) * 2654435761U + key));
    }
}

void Lattice::take_row(std::uint32_t y) {
    const float s = static_cast<float>(y % kCell) / static_cast<float>(kCell);
    const float* const a = values_.data() + static_cast<std::size_t>(y / kCell) * width_;
    float left = a[0] + (a[width_] - a[0]) * s;
    for (std::uint32_t i = 0; i + 1 < width_; ++i) {
        const float right = a[i + 1] + (a[i + 1 + width_] - a[i + 1]) * s;
        for (std::uint32_t k = 0; k < kCell; ++k)
            row_[i * kCell + k] = left + (right - left) * (static_cast<float>(k) / static_cast<float>(kCell));
        left = right;
    }
}

// Within two pixels of a step some pixels see both sides and say something between.
float DepthSensor::between(const std::vector<float>& inverse, std::size_t row, std::uint32_t x, float w, float share,
                           std::uint32_t dice) const noexcept {
    const std::uint32_t left = x < 2 ? 0 : x - 2;
    const std::uint32_t right = std::min(x + 2, static_cast<std::uint32_t>(hidden_.size()) - 1);
    float other = w;
    for (std::uint32_t i = left; i <= right; ++i) {
        const float jump = inverse[row + i] - w;
        const float most = other - w;
        if ((jump < 0 ? -jump : jump) > (most < 0 ? -most : most)) other = inverse[row + i];
    }
    const float step = other - w;
    if (!(other > 0) || (step < 0 ? -step : step) < 0.04F * w) return w;
    if (static_cast<float>(dice & 255U) >= 90.0F * share) return w;  // a third of them
    const float part = 0.15F + 0.7F * static_cast<float>(dice >> 8U & 255U) * (1.0F / 255.0F);
    const float z = 1.0F / w;
    return 1.0F / (z + (1.0F / other - z) * part);
}

void DepthSensor::sense(const Picture& picture, std::uint64_t seed, float units_per_m,
                        std::vector<std::uint16_t>& depth, const DepthErrors& errors) {
    const Pinhole& camera = picture.camera();
    const std::vector<float>& inverse = picture.inverse_depth();
    const std::vector<std::uint32_t>& ids = picture.face_ids();
    const auto key = static_cast<std::uint32_t>(seed ^ (seed >> 32U));
    shared_.fill(key);
    edges_.fill(key ^ 0x1234567U);
    loss_.fill(key ^ 0x7654321U);
    const auto width = static_cast<std::int32_t>(camera.width);
    for (std::uint32_t x = 0; x < camera.width; ++x)
        ray_x_[x] = (static_cast<float>(x) - static_cast<float>(camera.cx)) / static_cast<float>(camera.fx);
    const float pixel_scale = static_cast<float>(camera.fx) / 580.0F;  // shadows in px of this image
    depth.resize(inverse.size());
    for (std::uint32_t y = 0; y < camera.height; ++y) {
        const std::size_t row = static_cast<std::size_t>(y) * camera.width;
        shared_.take_row(y);
        edges_.take_row(y);
        loss_.take_row(y);
        // The projector stands to the right: of two pixels that it sees in one direction, the one further right is in
        // the light.
        float lit = 1e9F;
        for (std::int32_t x = width - 1; x >= 0; --x) {
            const float w = inverse[row + static_cast<std::size_t>(x)];
            const float direction = static_cast<float>(x) - kFocalBaseline * pixel_scale * w;
            hidden_[static_cast<std::size_t>(x)] = direction > lit + 0.5F ? 1 : 0;
            lit = std::min(lit, direction);
        }
        const float ray_y = (static_cast<float>(y) - static_cast<float>(camera.cy)) / static_cast<float>(camera.fy);
        measure_rays(ray_x_.data(), ray_y, camera.width, ray_length_.data());
        throw_dice(static_cast<std::uint32_t>(row), key, camera.width, dice_.data(), noise_.data());
        for (std::uint32_t x = 0; x < camera.width; ++x) {
            is_seen_[x] = 0;
            // Ragged borders: where depth jumps, a neighbour's value may win.
            const float wander = edges_.at(x) * (1.3F + errors.ragged);
            const std::int32_t beside = std::clamp(
                static_cast<std::int32_t>(x) + round_clamped(static_cast<double>(wander), -3, 3), 0, width - 1);
            std::size_t from = row + x;
            const float here = inverse[from];
            const float there = inverse[row + static_cast<std::size_t>(beside)];
            const float jump = here - there;
            if ((jump < 0 ? -jump : jump) > 0.04F * here) from = row + static_cast<std::size_t>(beside);
            if (hidden_[from - row] != 0 || ids[from] == kNoFace) continue;
            float w = inverse[from];
            const VisibleFace& face = picture.face(ids[from]);
            const std::uint32_t dice = dice_[x];
            // Light that comes in at a slant comes back weak.
            const float slant = w / (face.normal_length * ray_length_[x]);
            float threshold = 2.9F - (slant < 0.3F ? (0.3F - slant) * 14.0F : 0.0F);
            if (face.material.infrared == Infrared::kPoor) threshold -= 1.6F;
            if (face.material.infrared == Infrared::kBad) threshold -= 3.0F;
            if (loss_.at(x) > threshold || (dice >> 8U) % 512U == 0) continue;
            noise_[x] += kNoiseShared * shared_.at(x);
            if (errors.nearness != nullptr) {
                if (errors.ragged > 0) w = between(inverse, row, x, w, errors.ragged, scramble(dice + 1U));
                w *= errors.nearness[row + x];
                noise_[x] += errors.disparity[row + x];
            }
            inverse_[x] = w;
            is_seen_[x] = 1;
        }
        count_steps(inverse_.data(), noise_.data(), is_seen_.data(), units_per_m, camera.width, depth.data() + row);
    }
}

}  // namespace stillmesh::simulated
