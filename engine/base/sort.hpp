// Sorting in place without recursion (std::sort recurses, if only to the logarithm) and without memory: heapsort.
// Equal elements land in any order, so `is_before` must be a total order wherever the result matters. n log n.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace stillmesh {

template <typename T, typename IsBefore>
constexpr void sort(std::span<T> items, IsBefore is_before) noexcept {
    // Lets items[at] sink until no child below `end` comes after it.
    const auto sink = [&](std::size_t at, std::size_t end) {
        const T item = items[at];
        for (std::size_t child = 2 * at + 1; child < end; child = 2 * at + 1) {
            if (child + 1 < end && is_before(items[child], items[child + 1])) ++child;
            if (!is_before(item, items[child])) break;
            items[at] = items[child];
            at = child;
        }
        items[at] = item;
    };
    for (std::size_t i = items.size() / 2; i > 0; --i) sink(i - 1, items.size());
    for (std::size_t end = items.size(); end > 1; --end) {
        std::swap(items[0], items[end - 1]);
        sink(0, end - 1);
    }
}

template <typename T>
constexpr void sort(std::span<T> items) noexcept {
    sort(items, [](const T& a, const T& b) { return a < b; });
}

// Puts an item among the `count` best so far, which lie in order: behind all that it does not come before. Of more than
// there is room for the last falls out.
template <typename T, typename IsBefore>
constexpr void keep_best(std::span<T> best, std::uint32_t& count, const T& item, IsBefore is_before) noexcept {
    std::uint32_t at = count;
    while (at > 0 && is_before(item, best[at - 1])) --at;
    if (at >= best.size()) return;
    if (count < best.size()) ++count;
    for (std::uint32_t i = count - 1; i > at; --i) best[i] = best[i - 1];
    best[at] = item;
}

}  // namespace stillmesh
