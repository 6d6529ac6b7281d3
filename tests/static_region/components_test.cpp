#include "engine/static_region/components.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::components_test {
namespace {

// Promise: components are those of a flood fill, numbered by descending size and then by their lowest node; nodes that
// were left out and components beyond the limit have no number; what was there before leaves no trace.
TEST(Components, EqualFloodFill) {
    test::InMemory<Components> components(std::size_t{200});
    ASSERT_EQ(components.used_bytes(), components.planned_bytes());
    std::size_t beyond = 0;
    for (std::uint64_t seed = 0; seed < 500; ++seed) {
        Random random(seed);
        const std::size_t count = random.below(201);
        const std::uint32_t limit = 1 + random.below(20);
        std::vector<bool> is_in(count);
        components->begin(count);
        for (std::size_t i = 0; i < count; ++i) {
            is_in[i] = random.below(8) > 0;
            if (is_in[i]) components->add(i);
            EXPECT_EQ(components->has(i), is_in[i]);
        }
        std::vector<std::pair<std::size_t, std::size_t>> links;
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t a = random.below(static_cast<std::uint32_t>(count));
            const std::size_t b = random.below(static_cast<std::uint32_t>(count));
            if (!is_in[a] || !is_in[b] || random.below(3) == 0) continue;
            links.emplace_back(a, b);
            components->join(a, b);
        }
        std::vector<std::vector<std::size_t>> wanted;  // each by ascending node
        std::vector<bool> is_done(count);
        for (std::size_t i = 0; i < count; ++i) {
            if (!is_in[i] || is_done[i]) continue;
            std::vector<std::size_t> here = {i};
            is_done[i] = true;
            for (std::size_t k = 0; k < here.size(); ++k) {
                for (const auto& [a, b] : links) {
                    for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, a}}) {
                        if (from != here[k] || is_done[to]) continue;
                        is_done[to] = true;
                        here.push_back(to);
                    }
                }
            }
            wanted.push_back(here);
        }
        std::stable_sort(wanted.begin(), wanted.end(),
                         [](const auto& a, const auto& b) { return a.size() > b.size(); });
        ASSERT_EQ(components->number(limit), std::min<std::size_t>(limit, wanted.size()));
        std::vector<std::uint16_t> number(count, Components::kNone);
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            beyond += k >= limit ? 1U : 0U;
            for (const std::size_t i : wanted[k]) {
                number[i] = k < limit ? static_cast<std::uint16_t>(k) : Components::kNone;
            }
        }
        for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(components->of(i), number[i]) << "seed " << seed;
    }
    EXPECT_GT(beyond, 100U);
}

}  // namespace
}  // namespace stillmesh::components_test
