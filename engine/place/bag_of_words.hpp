// The words of a frame. Every feature has a word; the features sorted by word are the frame's direct index (which
// features lie under one node of the tree); the words of the features that are known to stand still, weighted by their
// rarity and their number, are the bag that places are recognised by. Weights are whole numbers, so a score is exact,
// whatever the order. Limit: features_max. Cost: per feature branching * levels descriptor distances,
// 40 with the default vocabulary.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/features/features.hpp"
#include "engine/place/vocabulary.hpp"

namespace stillmesh {

// All weights of a bag together are at most this, and less than `entries` below it.
inline constexpr std::uint32_t kBagWeightOne = 1U << 24U;

// A word of a bag, and how much of the bag it is.
struct WordWeight {
    std::uint32_t weight = 0;
    std::uint16_t word = 0;
};

struct WordOfFeature {
    std::uint16_t word = 0;
    std::uint16_t feature = 0;
    friend constexpr bool operator==(WordOfFeature, WordOfFeature) noexcept = default;
};

// How alike two bags are, 0 to kBagWeightOne: 1 - |a - b| / 2 in the L1 norm, which is the sum of the smaller weights
// of the words they share. Both sorted by word.
[[nodiscard]] constexpr std::uint32_t bag_score(std::span<const WordWeight> a, std::span<const WordWeight> b) noexcept {
    std::uint32_t score = 0;
    std::size_t j = 0;
    for (const WordWeight& entry : a) {
        while (j < b.size() && b[j].word < entry.word) ++j;
        if (j == b.size()) break;
        if (b[j].word == entry.word) score += entry.weight < b[j].weight ? entry.weight : b[j].weight;
    }
    return score;
}

class FrameWords {
public:
    static constexpr void plan(ArenaPlan& arena, std::uint32_t features_max) noexcept {
        FixedVector<WordOfFeature>::plan(arena, features_max);
        FixedVector<WordWeight>::plan(arena, features_max);
        arena.array<WordOfFeature>(features_max);
    }
    void create(Arena& arena, std::uint32_t features_max) noexcept;
    void clear() noexcept;

    // The words of all features. The bag is empty until weigh(). At most features_max, the vocabulary not empty.
    void find(const Vocabulary& vocabulary, std::span<const Descriptor> descriptors) noexcept;
    // The same from words that are known already (by feature).
    void assign(std::span<const std::uint16_t> words) noexcept;
    // The bag of the features whose static weight reaches the threshold: is_eligible[feature] != 0, one for each.
    void weigh(const Vocabulary& vocabulary, std::span<const std::uint8_t> is_eligible) noexcept;
    // What find() costs in work units (one unit: 32 descriptors compared).
    [[nodiscard]] static std::uint32_t find_units(const Vocabulary& vocabulary, std::size_t features) noexcept;

    // The direct index: all features by (word, feature).
    [[nodiscard]] std::span<const WordOfFeature> by_word() const noexcept { return by_word_.span(); }
    // By word; words of weight 0 are left out.
    [[nodiscard]] std::span<const WordWeight> bag() const noexcept { return bag_.span(); }

private:
    void sort_by_word() noexcept;

    FixedVector<WordOfFeature> by_word_;
    FixedVector<WordWeight> bag_;
    std::span<WordOfFeature> scratch_;
};

// Calls visit(features of a, features of b) for every node at `level` that both frames have features under, in the
// order of the tree. a and b are direct indices.
template <typename Visit>
void visit_common_nodes(const Vocabulary& vocabulary, std::uint32_t level, std::span<const WordOfFeature> a,
                        std::span<const WordOfFeature> b, Visit&& visit) noexcept {
    std::size_t i = 0;
    std::size_t j = 0;
    while (i < a.size() && j < b.size()) {
        const WordRange node = vocabulary.node_of(a[i].word < b[j].word ? b[j].word : a[i].word, level);
        while (i < a.size() && a[i].word < node.begin) ++i;
        while (j < b.size() && b[j].word < node.begin) ++j;
        const std::size_t a_begin = i;
        const std::size_t b_begin = j;
        while (i < a.size() && a[i].word < node.end) ++i;
        while (j < b.size() && b[j].word < node.end) ++j;
        if (i > a_begin && j > b_begin) visit(a.subspan(a_begin, i - a_begin), b.subspan(b_begin, j - b_begin));
    }
}

}  // namespace stillmesh
