#include "engine/frame/pyramid.hpp"

#include <cstring>

namespace stillmesh {
namespace {

// Where the centre of output pixel `i` of `to` lies between two of `from` source pixels.
struct Sample {
    std::uint32_t left;         // and its right neighbour; left + 1 <= from - 1, as a level is smaller by a sixth or so
    std::uint8_t weight_right;  // of 128, in 1..127: the ends are left out, so that a weight fits a signed byte
};

Sample sample_at(std::uint32_t i, std::uint32_t to, std::uint32_t from) noexcept {
    // ((i + 1/2) * from / to - 1/2) * 128, rounded; never negative because from > to. Below 2047 * 2 * 2047 * 128.
    const std::uint64_t numerator = (static_cast<std::uint64_t>(2 * i + 1) * from - to) * 128 + to;
    const std::uint64_t position = numerator / (2 * static_cast<std::uint64_t>(to));
    const auto left = static_cast<std::uint32_t>(position / 128);
    const auto weight = static_cast<std::uint32_t>(position % 128);
    return {left, static_cast<std::uint8_t>(weight < 1 ? 1 : weight)};
}

}  // namespace

void Pyramid::create(Arena& arena, const Limits& limits, std::uint32_t levels, std::uint32_t scale_permille,
                     const Kernels& kernels) noexcept {
    STILLMESH_CHECK(levels >= 1 && levels <= limits.pyramid_levels_max && levels <= kPyramidLevelsMax);
    STILLMESH_CHECK(scale_permille >= kScalePermilleMin && scale_permille <= kScalePermilleMax);
    kernels_ = &kernels;
    width_max_ = limits.image_width_max;
    height_max_ = limits.image_height_max;
    levels_wanted_ = levels;
    scale_permille_ = scale_permille;
    const Sizes sizes = sizes_max(limits);
    pixels_ = arena.array<std::uint8_t>(sizes.pixels + kKernelSlackBytes);
    blocks_ = arena.array<ScaleBlock>(sizes.blocks);
    scratch_ = arena.array<std::uint8_t>(level_stride(width_max_) + kKernelSlackBytes);
}

void Pyramid::lay_out(std::uint32_t width, std::uint32_t height) noexcept {
    std::size_t pixels = 0;
    std::size_t blocks = 0;
    laid_out_levels_ = 0;
    for (std::uint32_t i = 0; i < levels_wanted_ && width >= kLevelSideMin && height >= kLevelSideMin; ++i) {
        const std::size_t stride = level_stride(width);
        views_[i] = {pixels_.data() + pixels, width, height, stride};
        pixels_begin_[i] = pixels;
        pixels += stride * height;
        STILLMESH_CHECK(pixels + kKernelSlackBytes <= pixels_.size());
        if (i > 0) {
            blocks_begin_[i] = blocks;
            const std::uint32_t source_width = views_[i - 1].width;
            for (std::uint32_t begin = 0; begin < width; begin += kScaleBlock) {
                ScaleBlock& block = blocks_[blocks++];
                block.first = static_cast<std::uint16_t>(sample_at(begin, width, source_width).left);
                for (std::uint32_t k = 0; k < kScaleBlock; ++k) {
                    // Beyond the last pixel: repeat it, so that every block is whole.
                    const std::uint32_t x = begin + k < width ? begin + k : width - 1;
                    const Sample sample = sample_at(x, width, source_width);
                    const std::uint32_t pick = sample.left - block.first;
                    STILLMESH_CHECK(pick + 1 < 2 * kScaleBlock);
                    block.picks[2 * k] = static_cast<std::uint8_t>(pick);
                    block.picks[2 * k + 1] = static_cast<std::uint8_t>(pick + 1);
                    block.weights[2 * k] = static_cast<std::uint8_t>(128 - sample.weight_right);
                    block.weights[2 * k + 1] = sample.weight_right;
                }
            }
        }
        laid_out_levels_ = i + 1;
        width = next_level_side(width, scale_permille_);
        height = next_level_side(height, scale_permille_);
    }
}

Status Pyramid::build(const GreyView& image) noexcept {
    levels_ = 0;
    if (image.is_empty() || image.stride < image.width) return Status::kInvalid;
    if (image.width > width_max_ || image.height > height_max_) return Status::kInvalid;
    if (image.width < kLevelSideMin || image.height < kLevelSideMin) return Status::kInvalid;
    if (image.width != views_[0].width || image.height != views_[0].height) lay_out(image.width, image.height);
    for (std::uint32_t y = 0; y < image.height; ++y)
        std::memcpy(pixels_.data() + y * views_[0].stride, image.row(y), image.width);
    for (std::uint32_t i = 1; i < laid_out_levels_; ++i) {
        const GreyView& from = views_[i - 1];
        const GreyView& to = views_[i];
        for (std::uint32_t y = 0; y < to.height; ++y) {
            const Sample sample = sample_at(y, to.height, from.height);
            kernels_->scale_row(from.row(sample.left), from.row(sample.left + 1), from.width, sample.weight_right,
                                blocks_.data() + blocks_begin_[i], to.width, scratch_.data(),
                                pixels_.data() + pixels_begin_[i] + y * to.stride);
        }
    }
    levels_ = laid_out_levels_;
    return Status::kOk;
}

}  // namespace stillmesh
