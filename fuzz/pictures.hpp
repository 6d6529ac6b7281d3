// Pictures from few bytes: blocks of the given bytes, repeated, plus seeded noise. Reaches flat, saturated, striped and
// noisy images of any size without asking the fuzzer for every pixel. The buffer ends with the last pixel, so that a
// read past it is seen.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/frame/image_view.hpp"
#include "fuzz/fuzz.hpp"

namespace stillmesh::fuzz {

template <typename T>
struct Picture {
    std::vector<T> pixels;
    ImageView<T> view;
};

// All zeros, one row behind the other. `values_per_pixel`: 3 for colour.
template <typename T>
Picture<T> empty_picture(std::uint32_t width, std::uint32_t height, std::uint32_t values_per_pixel) {
    const std::size_t stride = std::size_t{width} * values_per_pixel;
    Picture<T> picture{std::vector<T>(stride * height), {}};
    picture.view = {picture.pixels.data(), width, height, stride};
    return picture;
}

// `values_per_pixel`: 3 for colour. Consumes 5 bytes and the texture.
template <typename T>
Picture<T> picture_from(Bytes& bytes, std::uint32_t width, std::uint32_t height, std::uint32_t values_per_pixel) {
    const std::uint32_t block = 1U + bytes.u8() % 16;
    const std::uint32_t noise = bytes.u8();
    const std::size_t stride = std::size_t{width} * values_per_pixel + bytes.u8() % 8;
    Random random(bytes.u8());
    const std::uint32_t texture_size = 1U + bytes.u8() % 64;
    std::vector<std::uint32_t> texture;
    while (texture.size() < texture_size) texture.push_back(sizeof(T) == 1 ? bytes.u8() : bytes.u16());

    Picture<T> picture;
    const std::size_t row_size = std::size_t{width} * values_per_pixel;
    if (width > 0 && height > 0) picture.pixels.resize((height - 1) * stride + row_size);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::size_t i = 0; i < row_size; ++i) {
            const std::size_t cell = i / (std::size_t{block} * values_per_pixel) + std::size_t{y / block} * 7;
            std::uint32_t value = texture[(cell * cell + cell / 5) % texture_size];
            if (noise > 0) value += random.below(noise + 1);
            picture.pixels[y * stride + i] = static_cast<T>(value);
        }
    }
    picture.view = {picture.pixels.data(), width, height, stride};
    return picture;
}

}  // namespace stillmesh::fuzz
