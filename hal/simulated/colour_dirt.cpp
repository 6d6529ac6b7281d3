#include "hal/simulated/colour_dirt.hpp"

#include <algorithm>
#include <array>

#include "engine/base/random.hpp"
#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kHunting = 1.0 / 3;
constexpr double kLampsHz = 100.04;  // mains are never quite at 50 Hz: the bands wander
constexpr double kFlicker = 0.09;

constexpr std::uint32_t kSide = 8;
using Block = std::array<std::array<float, kSide>, kSide>;

// ITU-T T.81, table K.1.
constexpr std::array<std::array<std::int32_t, kSide>, kSide> kLuminance = {{
    {16, 11, 10, 16, 24, 40, 51, 61},
    {12, 12, 14, 19, 26, 58, 60, 55},
    {14, 13, 16, 24, 40, 57, 69, 56},
    {14, 17, 22, 29, 51, 87, 80, 62},
    {18, 22, 37, 56, 68, 109, 103, 77},
    {24, 35, 55, 64, 81, 104, 113, 92},
    {49, 64, 78, 87, 103, 121, 120, 101},
    {72, 92, 95, 98, 112, 100, 103, 99},
}};

// Row k: the k-th cosine over eight pixels, of length 1.
constexpr Block kCosines = [] {
    Block out{};
    for (std::uint32_t k = 0; k < kSide; ++k) {
        for (std::uint32_t i = 0; i < kSide; ++i) {
            const double norm = k == 0 ? 0.35355339059327379 : 0.5;
            out[k][i] = static_cast<float>(norm * cosine((2 * i + 1) * k * kPi / 16));
        }
    }
    return out;
}();

// a b, or a b^T.
[[nodiscard]] Block product(const Block& a, const Block& b, bool is_transposed) noexcept {
    Block out;
    for (std::uint32_t y = 0; y < kSide; ++y) {
        for (std::uint32_t x = 0; x < kSide; ++x) {
            float sum = 0;
            for (std::uint32_t k = 0; k < kSide; ++k) sum += a[y][k] * (is_transposed ? b[x][k] : b[k][x]);
            out[y][x] = sum;
        }
    }
    return out;
}

[[nodiscard]] Block transposed(const Block& a) noexcept {
    Block out;
    for (std::uint32_t y = 0; y < kSide; ++y) {
        for (std::uint32_t x = 0; x < kSide; ++x) out[y][x] = a[x][y];
    }
    return out;
}

// |value| below 2^12.
[[nodiscard]] std::int32_t nearest(float value) noexcept {
    return static_cast<std::int32_t>(value + 4096.5F) - 4096;
}

}  // namespace

ColourDirt::ColourDirt(const Dirt& dirt, std::uint64_t seed) : hunting_(dirt.hunting), flicker_(dirt.flicker) {
    Random random(seed ^ 0x636f'6c6f'7572'0001ULL);
    for (double& phase : phase_) phase = random.uniform(0, 2 * kPi);
}

double ColourDirt::exposure(double time_s) const noexcept {
    if (!(hunting_ > 0)) return 1;
    // It creeps most of the time, and now and then it jumps within a few frames.
    const double slow = sine(0.9 * time_s + phase_[0]);
    const double steep = smooth_step(0.5 + 1.8 * sine(1.7 * time_s + phase_[1])) * 2 - 1;
    const double factor = 1 + hunting_ * kHunting * (0.4 * slow + 0.6 * steep);
    return std::max(factor, 0.1);
}

double ColourDirt::lamps(double row_time_s) const noexcept {
    return 1 + flicker_ * kFlicker * sine(2 * kPi * kLampsHz * row_time_s + phase_[2]);
}

void compress(std::vector<std::uint8_t>& grey, std::uint32_t width, std::uint32_t height, std::int32_t quality) {
    const std::int32_t scale = quality < 50 ? 5000 / std::max(quality, 1) : 200 - 2 * std::min(quality, 100);
    Block steps;
    for (std::uint32_t y = 0; y < kSide; ++y) {
        for (std::uint32_t x = 0; x < kSide; ++x) {
            steps[y][x] = static_cast<float>(std::clamp((kLuminance[y][x] * scale + 50) / 100, 1, 255));
        }
    }
    const Block back = transposed(kCosines);
    for (std::uint32_t top = 0; top < height; top += kSide) {
        for (std::uint32_t left = 0; left < width; left += kSide) {
            Block block;  // beyond the border: the border's own grey
            for (std::uint32_t y = 0; y < kSide; ++y) {
                const std::size_t row = std::size_t{std::min(top + y, height - 1)} * width;
                for (std::uint32_t x = 0; x < kSide; ++x) {
                    block[y][x] = static_cast<float>(grey[row + std::min(left + x, width - 1)]) - 128.0F;
                }
            }
            block = product(product(kCosines, block, false), kCosines, true);
            for (std::uint32_t y = 0; y < kSide; ++y) {
                for (std::uint32_t x = 0; x < kSide; ++x) {
                    block[y][x] = static_cast<float>(nearest(block[y][x] / steps[y][x])) * steps[y][x];
                }
            }
            block = product(product(back, block, false), back, true);
            for (std::uint32_t y = 0; y < kSide && top + y < height; ++y) {
                const std::size_t row = std::size_t{top + y} * width;
                for (std::uint32_t x = 0; x < kSide && left + x < width; ++x) {
                    grey[row + left + x] = static_cast<std::uint8_t>(std::clamp(nearest(block[y][x] + 128.0F), 0, 255));
                }
            }
        }
    }
}

}  // namespace stillmesh::simulated
