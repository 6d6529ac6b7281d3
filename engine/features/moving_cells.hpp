// Where in the picture bodies move, as far as it is known: cells of a sixteenth of its width and height.
#pragma once

#include <array>
#include <cstdint>

namespace stillmesh {

class MovingCells {
public:
    static constexpr std::uint32_t kSide = 16;

    void add(std::uint32_t column, std::uint32_t row) noexcept {
        rows_[row] = static_cast<std::uint16_t>(rows_[row] | 1U << column);
    }
    [[nodiscard]] bool holds(std::uint32_t column, std::uint32_t row) const noexcept {
        return (rows_[row] >> column & 1U) != 0;
    }
    [[nodiscard]] bool is_empty() const noexcept { return rows_ == decltype(rows_){}; }

private:
    std::array<std::uint16_t, kSide> rows_{};
};

}  // namespace stillmesh
