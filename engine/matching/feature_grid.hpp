// Features of a frame sorted into square cells, to find those near a projected point. Limit: features_max features,
// images up to the limits. Cost: two passes over the features.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"
#include "engine/base/numbers.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

class FeatureGrid {
public:
    static constexpr std::uint32_t kCellSide_px = 16;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::uint16_t>(cells(limits.image_width_max) * cells(limits.image_height_max) + 1);
        arena.array<std::uint16_t>(limits.features_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept {
        begin_ = arena.array<std::uint16_t>(cells(limits.image_width_max) * cells(limits.image_height_max) + 1);
        order_ = arena.array<std::uint16_t>(limits.features_max);
    }

    // Of anything that has a pixel x and y.
    template <typename Feature>
    void build(std::uint32_t width, std::uint32_t height, std::span<const Feature> features) noexcept {
        columns_ = cells(width);
        rows_ = cells(height);
        count_ = features.size();
        const std::size_t count = static_cast<std::size_t>(columns_) * rows_;
        STILLMESH_CHECK(count + 1 <= begin_.size() && features.size() <= order_.size());
        for (std::size_t i = 0; i <= count; ++i) begin_[i] = 0;
        for (const Feature& feature : features) ++begin_[cell_of(feature.x, feature.y)];
        std::uint32_t sum = 0;  // turn counts into ends, then fill from behind so that begins remain
        for (std::size_t i = 0; i < count; ++i) {
            sum += begin_[i];
            begin_[i] = static_cast<std::uint16_t>(sum);
        }
        begin_[count] = static_cast<std::uint16_t>(sum);
        for (std::size_t i = features.size(); i > 0; --i)
            order_[--begin_[cell_of(features[i - 1].x, features[i - 1].y)]] = static_cast<std::uint16_t>(i - 1);
    }

    // Calls visit(feature index) for every feature in a cell that the square of side 2 radius around (x, y) touches,
    // row by row: a superset of those within the radius.
    template <typename Visit>
    void visit_near(double x, double y, double radius_px, Visit&& visit) const noexcept {
        visit_rows(x, y, radius_px, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) visit(std::uint32_t{order_[k]});
        });
    }
    // The same by rows of cells: visit(begin, end) of in_order().
    template <typename Visit>
    void visit_rows(double x, double y, double radius_px, Visit&& visit) const noexcept {
        const auto last_column = static_cast<std::int32_t>(columns_) - 1;
        const auto last_row = static_cast<std::int32_t>(rows_) - 1;
        const std::int32_t x0 = floor_clamped((x - radius_px) / kCellSide_px, 0, last_column);
        const std::int32_t x1 = floor_clamped((x + radius_px) / kCellSide_px, 0, last_column);
        const std::int32_t y0 = floor_clamped((y - radius_px) / kCellSide_px, 0, last_row);
        const std::int32_t y1 = floor_clamped((y + radius_px) / kCellSide_px, 0, last_row);
        for (std::int32_t row = y0; row <= y1; ++row) {
            const std::size_t cell = static_cast<std::size_t>(row) * columns_;
            visit(std::size_t{begin_[cell + static_cast<std::size_t>(x0)]},
                  std::size_t{begin_[cell + static_cast<std::size_t>(x1) + 1]});
        }
    }
    // All features, cell by cell, ascending within a cell.
    [[nodiscard]] std::span<const std::uint16_t> in_order() const noexcept { return order_.first(count_); }

private:
    [[nodiscard]] static constexpr std::uint32_t cells(std::uint32_t pixels) noexcept {
        return (pixels + kCellSide_px - 1) / kCellSide_px;
    }
    [[nodiscard]] std::uint32_t cell_of(float x, float y) const noexcept {
        const auto cell = [](float at, std::uint32_t cells) {
            return static_cast<std::uint32_t>(
                floor_clamped(static_cast<double>(at) / kCellSide_px, 0, static_cast<std::int32_t>(cells) - 1));
        };
        return cell(y, rows_) * columns_ + cell(x, columns_);
    }

    std::span<std::uint16_t> begin_;  // of each cell in order_, and one past the last
    std::span<std::uint16_t> order_;  // features, cell by cell, ascending within a cell
    std::uint32_t columns_ = 0, rows_ = 0;
    std::size_t count_ = 0;
};

}  // namespace stillmesh
