// What a structured-light depth camera makes of the true depth: noise growing with z^2 and disparity in eighths of a
// pixel (Khoshelham & Elberink 2012: sigma_z = 1.425e-3 z^2), part of the noise shared by neighbours, ragged borders,
// the shadow of the projector beside near things, holes on dark, glossy and grazing surfaces, 0.5 to 4.5 m. Cost: about
// 6 ms for 640x480.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/simulated/renderer.hpp"

namespace stillmesh::simulated {

inline constexpr float kDepthMin = 0.5F;  // m
inline constexpr float kDepthMax = 4.5F;

// Smooth random numbers over the image.
class Lattice {
public:
    Lattice(std::uint32_t width, std::uint32_t height);
    void fill(std::uint32_t key);
    // The values of a row, for at().
    void take_row(std::uint32_t y);
    [[nodiscard]] float at(std::uint32_t x) const noexcept { return row_[x]; }

private:
    std::uint32_t width_;
    std::vector<float> values_, row_;
};

// What a dirty sensor adds (depth_dirt.hpp); a clean one adds nothing.
struct DepthErrors {
    const float* nearness = nullptr;   // factor on each pixel's inverse depth
    const float* disparity = nullptr;  // px, on each pixel's disparity
    float ragged = 0;                  // how much more ragged borders are than a clean sensor's
};

// For pictures of one size; its buffers stay from frame to frame.
class DepthSensor {
public:
    DepthSensor(std::uint32_t width, std::uint32_t height)
        : shared_(width, height),
          edges_(width, height),
          loss_(width, height),
          hidden_(width),
          ray_x_(width),
          ray_length_(width),
          noise_(width),
          inverse_(width),
          dice_(width),
          is_seen_(width) {}
    // From a picture to depth in units of 1 / units_per_m, 0 = nothing.
    void sense(const Picture& picture, std::uint64_t seed, float units_per_m, std::vector<std::uint16_t>& depth,
               const DepthErrors& errors = {});

private:
    [[nodiscard]] float between(const std::vector<float>& inverse, std::size_t row, std::uint32_t x, float w,
                                float share, std::uint32_t dice) const noexcept;

    Lattice shared_, edges_, loss_;
    // Of a row, by column.
    std::vector<std::uint8_t> hidden_;  // from the projector
    std::vector<float> ray_x_, ray_length_, noise_, inverse_;
    std::vector<std::uint32_t> dice_, is_seen_;
};

// A quick hash of 32 bits: neighbours in, strangers out (lowbias32, Wellons 2018).
[[nodiscard]] constexpr std::uint32_t scramble(std::uint32_t x) noexcept {
    x ^= x >> 16U;
    x *= 0x7feb352dU;
    x ^= x >> 15U;
    x *= 0x846ca68bU;
    x ^= x >> 16U;
    return x;
}
// Mean 0, variance 1, from the four bytes of a random word; ends at 3.4 sigma.
[[nodiscard]] constexpr float bell(std::uint32_t word) noexcept {
    const std::uint32_t sum = (word & 255U) + (word >> 8U & 255U) + (word >> 16U & 255U) + (word >> 24U);
    return (static_cast<float>(sum) - 510.0F) * (1.0F / 147.8F);
}

}  // namespace stillmesh::simulated
