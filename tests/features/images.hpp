// Images for the tests of features: owned pixels with any stride, and makers of hard ones.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/frame/image_view.hpp"
#include "engine/frame/kernels.hpp"

namespace stillmesh::testing {

struct Image {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::size_t stride = 0;
    std::vector<std::uint8_t> pixels;  // exactly up to the last pixel of the last row: overreads are seen

    Image(std::uint32_t w, std::uint32_t h, std::size_t s = 0) : width(w), height(h), stride(s == 0 ? w : s) {
        pixels.assign(stride * (h - 1) + w, 0);
    }
    [[nodiscard]] GreyView view() const { return {pixels.data(), width, height, stride}; }
    [[nodiscard]] std::uint8_t* row(std::uint32_t y) { return pixels.data() + y * stride; }
};

inline void fill(Image& image, std::uint8_t value) {
    std::memset(image.pixels.data(), value, image.pixels.size());
}

inline void fill_noise(Image& image, std::uint64_t seed, std::uint32_t low = 0, std::uint32_t high = 255) {
    Random random(seed);
    for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(low + random.below(high - low + 1));
}

// Leaves of many sizes dropped over one another ("dead leaves"): edges and corners at all scales, like a room.
inline void fill_leaves(Image& image, std::uint64_t seed, std::uint32_t count = 1500, std::uint32_t contrast = 200) {
    Random random(seed);
    fill(image, 128);
    for (std::uint32_t i = 0; i < count; ++i) {
        const double u = random.uniform(0.04, 1.0);
        const double radius = 3.0 / u;
        const double x0 = random.uniform(-radius, image.width + radius);
        const double y0 = random.uniform(-radius, image.height + radius);
        const double a = random.uniform(0.3, 1.0);
        const double cx = random.uniform(-1.0, 1.0);
        const double cy = random.uniform(-1.0, 1.0);
        const bool box = random.below(3) != 0;
        const auto value = static_cast<std::uint8_t>(128 - contrast / 2 + random.below(contrast + 1));
        for (std::uint32_t y = 0; y < image.height; ++y) {
            const double dy = y - y0;
            if (dy > radius * 1.5 || dy < -radius * 1.5) continue;
            for (std::uint32_t x = 0; x < image.width; ++x) {
                const double dx = x - x0;
                const double p = dx * cx + dy * cy;
                const double q = (dy * cx - dx * cy) * a;
                const bool inside =
                    box ? p < radius && p > -radius && q < radius && q > -radius : dx * dx + dy * dy < radius * radius;
                if (inside) image.row(y)[x] = value;
            }
        }
    }
}

// Pixels that break careless arithmetic: noise of full and of little contrast, black, white, stripes and boards of
// both.
inline std::vector<Image> hard_images(std::uint32_t width, std::uint32_t height) {
    std::vector<Image> all;
    const std::size_t slack = kKernelSlackBytes;
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        all.emplace_back(width, height, width + slack + seed);
        fill_noise(all.back(), seed);
        all.emplace_back(width, height, width + slack);
        fill_noise(all.back(), seed, 100, 110);
        all.emplace_back(width, height, width + slack);
        fill_noise(all.back(), seed, 0, 1);
        for (std::uint8_t& pixel : all.back().pixels) pixel = pixel == 0 ? 0 : 255;
        all.emplace_back(width, height, width + slack);
        fill_leaves(all.back(), seed, 300);
    }
    for (const int value : {0, 255}) {
        all.emplace_back(width, height, width + slack);
        fill(all.back(), static_cast<std::uint8_t>(value));
    }
    for (std::uint32_t period = 1; period < 4; ++period) {
        all.emplace_back(width, height, width + slack);
        for (std::uint32_t y = 0; y < height; ++y)
            for (std::uint32_t x = 0; x < width; ++x)
                all.back().row(y)[x] = (x / period + y / period) % 2 == 0 ? 0 : 255;
    }
    // Rows may be read, not used, beyond their end.
    for (Image& image : all) image.pixels.resize(image.pixels.size() + slack, 77);
    return all;
}

}  // namespace stillmesh::testing
