#include "hal/simulated/depth_dirt.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/base/random.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kTiltRad = radians(0.2), kAsideM = 0.002, kFocal = 0.005;
constexpr double kLateS = 0.025, kLatePeriodS = 9.0;
constexpr double kScale = 0.015, kDrift = 0.004, kDriftPeriodS = 40.0;
constexpr double kDark = 0.009;
// Grey that is dark for certain, and that is not at all.
constexpr float kDarkBelow = 30.0F, kBrightAbove = 90.0F;
constexpr double kNoiseStaysS = 0.5;
// A standard deviation of .062 px of disparity (depth_sensor.cpp) becomes 1.5 times that: so much is added, and that is
// a little more than half of the whole.
constexpr double kSigma = 0.062, kNoise = 1.5;

}  // namespace

DepthDirt::DepthDirt(const Dirt& dirt, std::uint64_t seed, const Pinhole& colour)
    : dirt_(dirt),
      key_(scramble(static_cast<std::uint32_t>(seed ^ (seed >> 32U)) + 0x6465'7074U)),
      pinhole_(colour),
      before_(colour.width, colour.height),
      after_(colour.width, colour.height) {
    Random random(seed ^ 0x6465'7074'6800'0001ULL);
    late_phase_ = random.uniform(0, 2 * kPi);
    drift_phase_ = random.uniform(0, 2 * kPi);
    const auto side = [&] { return random.uniform() < 0.5 ? -1.0 : 1.0; };
    if (dirt.borders > 0) {
        // About an axis between right and down.
        const double tilt = dirt.borders * kTiltRad * std::sqrt(0.5);
        place_.rotation = rotation_y(side() * tilt) * rotation_x(side() * tilt);
        place_.translation = {side() * dirt.borders * kAsideM, 0, 0};
        const double focal = 1 + side() * dirt.borders * kFocal;
        pinhole_.fx = colour.fx * focal;
        pinhole_.fy = colour.fy * focal;
    }
    const std::size_t pixels = std::size_t{colour.width} * colour.height;
    if (!is_clean(dirt)) {
        nearness_.assign(pixels, 1.0F);
        disparity_.assign(pixels, 0.0F);
    }
    if (dirt.scale > 0) {
        // Three waves, a half to one and a half over the image, and a bowl: what is left of a depth camera's lens.
        double phase[3], across[3], down[3];
        for (int i = 0; i < 3; ++i) {
            phase[i] = random.uniform(0, 2 * kPi);
            across[i] = side() * random.uniform(kPi, 3 * kPi);
            down[i] = random.uniform(kPi, 3 * kPi);
        }
        const double bowl = side();
        pattern_.resize(pixels);
        float most = 0;
        for (std::uint32_t y = 0; y < colour.height; ++y) {
            const double v = static_cast<double>(y) / colour.height - 0.5;
            for (std::uint32_t x = 0; x < colour.width; ++x) {
                const double u = static_cast<double>(x) / colour.width - 0.5;
                double sum = bowl * (2 * (u * u + v * v) - 0.5);
                for (int i = 0; i < 3; ++i) sum += sine(across[i] * u + down[i] * v + phase[i]) * (1.0 / 6);
                const auto value = static_cast<float>(sum);
                pattern_[std::size_t{y} * colour.width + x] = value;
                most = std::max(most, value < 0 ? -value : value);
            }
        }
        for (float& value : pattern_) value /= most;
    }
}

double DepthDirt::late_s(double time_s) const noexcept {
    if (!(dirt_.late > 0)) return 0;
    return dirt_.late * kLateS * 0.5 * (1 + sine(2 * kPi * time_s / kLatePeriodS + late_phase_));
}

void DepthDirt::add_scale(double time_s) {
    const double drift = 1 + dirt_.scale * kDrift * sine(2 * kPi * time_s / kDriftPeriodS + drift_phase_);
    const auto scale = static_cast<float>(dirt_.scale * kScale);
    const auto all = static_cast<float>(1 / drift);
    for (std::size_t i = 0; i < nearness_.size(); ++i) nearness_[i] = all / (1.0F + scale * pattern_[i]);
}

void DepthDirt::add_darkness(const std::vector<float>& grey) {
    // The sensor compares windows: the mean of 8 x 8 pixels decides.
    constexpr std::uint32_t kSide = 8;
    const auto farther = static_cast<float>(dirt_.dark * kDark);
    for (std::uint32_t top = 0; top < pinhole_.height; top += kSide) {
        for (std::uint32_t left = 0; left < pinhole_.width; left += kSide) {
            const std::uint32_t bottom = std::min(top + kSide, pinhole_.height);
            const std::uint32_t right = std::min(left + kSide, pinhole_.width);
            float sum = 0;
            for (std::uint32_t y = top; y < bottom; ++y) {
                for (std::uint32_t x = left; x < right; ++x) sum += grey[std::size_t{y} * pinhole_.width + x];
            }
            const float mean = sum / static_cast<float>((bottom - top) * (right - left));
            const float dark = std::clamp((kBrightAbove - mean) / (kBrightAbove - kDarkBelow), 0.0F, 1.0F);
            const float factor = 1.0F / (1.0F + farther * dark);
            for (std::uint32_t y = top; y < bottom; ++y) {
                for (std::uint32_t x = left; x < right; ++x) nearness_[std::size_t{y} * pinhole_.width + x] *= factor;
            }
        }
    }
}

void DepthDirt::add_noise(double time_s) {
    // Between two fields of noise half a second apart, so that the variance stays.
    const double at = time_s / kNoiseStaysS + 1000;
    const std::int32_t slot = floor_clamped(at, 0, 1'000'000'000);
    const double share = at - slot;
    before_.fill(scramble(key_ + static_cast<std::uint32_t>(slot)));
    after_.fill(scramble(key_ + static_cast<std::uint32_t>(slot) + 1U));
    const double sigma = dirt_.noise * kSigma * std::sqrt(kNoise * kNoise - 1);
    const auto a = static_cast<float>(sigma * std::sqrt(1 - share));
    const auto b = static_cast<float>(sigma * std::sqrt(share));
    for (std::uint32_t y = 0; y < pinhole_.height; ++y) {
        before_.take_row(y);
        after_.take_row(y);
        float* const row = disparity_.data() + std::size_t{y} * pinhole_.width;
        for (std::uint32_t x = 0; x < pinhole_.width; ++x) row[x] = a * before_.at(x) + b * after_.at(x);
    }
}

DepthErrors DepthDirt::errors(double time_s, const std::vector<float>& grey) {
    if (dirt_.scale > 0) add_scale(time_s);
    if (dirt_.dark > 0) {
        if (!(dirt_.scale > 0)) std::fill(nearness_.begin(), nearness_.end(), 1.0F);
        add_darkness(grey);
    }
    if (dirt_.noise > 0) add_noise(time_s);
    return {nearness_.data(), disparity_.data(), static_cast<float>(dirt_.ragged)};
}

}  // namespace stillmesh::simulated
