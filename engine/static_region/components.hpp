// Connected components by union-find, numbered by descending size. Limit: `nodes_max` nodes. Cost: near linear, and a
// sort of the components.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/fixed_vector.hpp"
#include "engine/base/sort.hpp"

namespace stillmesh {

class Components {
public:
    static constexpr std::uint16_t kNone = 0xffffU;

    static constexpr void plan(ArenaPlan& arena, std::size_t nodes_max) noexcept {
        arena.array<std::uint16_t>(nodes_max);
        arena.array<std::uint16_t>(nodes_max);
        FixedVector<std::uint16_t>::plan(arena, nodes_max);
    }
    void create(Arena& arena, std::size_t nodes_max) noexcept {
        parent_ = arena.array<std::uint16_t>(nodes_max);
        number_ = arena.array<std::uint16_t>(nodes_max);
        roots_.create(arena, nodes_max);
    }

    // `count` nodes, none of them in a component...
    void begin(std::size_t count) noexcept {
        count_ = count;
        std::fill_n(parent_.begin(), count, kNone);
    }
    // ... until it makes one of its own...
    void add(std::size_t node) noexcept { parent_[node] = static_cast<std::uint16_t>(node); }
    [[nodiscard]] bool has(std::size_t node) const noexcept { return parent_[node] != kNone; }
    // ... and two that have been added make one. The root is the lowest node.
    void join(std::size_t a, std::size_t b) noexcept {
        const std::uint16_t root_a = root_of(a);
        const std::uint16_t root_b = root_of(b);
        parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
    }
    // Numbers the `components_max` largest, ties by the lowest node; how many have a number.
    std::uint32_t number(std::uint32_t components_max) noexcept {
        roots_.clear();
        std::fill_n(number_.begin(), count_, std::uint16_t{0});  // sizes, at first
        for (std::size_t i = 0; i < count_; ++i) {
            if (!has(i)) continue;
            const std::uint16_t root = root_of(i);
            if (number_[root]++ == 0) STILLMESH_CHECK(roots_.push(root));
        }
        sort(roots_.span(), [this](std::uint16_t a, std::uint16_t b) {
            return number_[a] != number_[b] ? number_[a] > number_[b] : a < b;
        });
        const auto numbered = static_cast<std::uint32_t>(std::min<std::size_t>(roots_.size(), components_max));
        for (std::uint32_t i = 0; i < roots_.size(); ++i)
            number_[roots_[i]] = i < numbered ? static_cast<std::uint16_t>(i) : kNone;
        return numbered;
    }
    // Its number; kNone where there is no component, or a small one beyond the limit.
    [[nodiscard]] std::uint16_t of(std::size_t node) noexcept { return has(node) ? number_[root_of(node)] : kNone; }

private:
    [[nodiscard]] std::uint16_t root_of(std::size_t node) noexcept {
        while (parent_[node] != node) {
            parent_[node] = parent_[parent_[node]];
            node = parent_[node];
        }
        return static_cast<std::uint16_t>(node);
    }

    std::span<std::uint16_t> parent_;  // kNone: in no component
    std::span<std::uint16_t> number_;  // by root: its size, then its number
    FixedVector<std::uint16_t> roots_;
    std::size_t count_ = 0;
};

}  // namespace stillmesh
