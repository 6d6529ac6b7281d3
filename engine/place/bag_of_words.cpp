#include "engine/place/bag_of_words.hpp"

namespace stillmesh {

void FrameWords::create(Arena& arena, std::uint32_t features_max) noexcept {
    by_word_.create(arena, features_max);
    bag_.create(arena, features_max);
    scratch_ = arena.array<WordOfFeature>(features_max);
}

void FrameWords::clear() noexcept {
    by_word_.clear();
    bag_.clear();
}

void FrameWords::find(const Vocabulary& vocabulary, std::span<const Descriptor> descriptors) noexcept {
    clear();
    for (std::size_t i = 0; i < descriptors.size(); ++i)
        STILLMESH_CHECK(by_word_.push({vocabulary.word_of(descriptors[i]), static_cast<std::uint16_t>(i)}));
    sort_by_word();
}

void FrameWords::assign(std::span<const std::uint16_t> words) noexcept {
    clear();
    for (std::size_t i = 0; i < words.size(); ++i)
        STILLMESH_CHECK(by_word_.push({words[i], static_cast<std::uint16_t>(i)}));
    sort_by_word();
}

// By the low byte, then by the high one; each pass keeps the order of equals, so that features stay ascending.
void FrameWords::sort_by_word() noexcept {
    std::span<WordOfFeature> from = by_word_.span();
    std::span<WordOfFeature> to = scratch_;
    for (std::uint32_t shift = 0; shift <= 8; shift += 8) {
        std::uint16_t begin[257] = {};
        for (const WordOfFeature& entry : from) ++begin[(entry.word >> shift & 0xffU) + 1];
        for (std::size_t i = 1; i < 257; ++i) begin[i] = static_cast<std::uint16_t>(begin[i] + begin[i - 1]);
        for (const WordOfFeature& entry : from) to[begin[entry.word >> shift & 0xffU]++] = entry;
        const std::span<WordOfFeature> sorted = to.first(from.size());
        to = from;
        from = sorted;
    }
}

void FrameWords::weigh(const Vocabulary& vocabulary, std::span<const std::uint8_t> is_eligible) noexcept {
    STILLMESH_CHECK(is_eligible.size() == by_word_.size());
    bag_.clear();
    std::uint64_t sum = 0;  // at most 16000 features of 2^24
    for (std::size_t i = 0; i < by_word_.size();) {
        const std::uint16_t word = by_word_[i].word;
        std::uint32_t count = 0;
        for (; i < by_word_.size() && by_word_[i].word == word; ++i) count += is_eligible[by_word_[i].feature] != 0;
        const std::uint32_t weight = vocabulary.weight(word);
        if (count == 0 || weight == 0) continue;
        sum += static_cast<std::uint64_t>(count) * weight;
        STILLMESH_CHECK(bag_.push({count, word}));
    }
    if (sum == 0) return;
    // weight: count times rarity, as its share of the sum. Below 2^14 * 2^24 * 2^24.
    for (WordWeight& entry : bag_) {
        const std::uint64_t part = static_cast<std::uint64_t>(entry.weight) * vocabulary.weight(entry.word);
        entry.weight = static_cast<std::uint32_t>(part * kBagWeightOne / sum);
    }
}

std::uint32_t FrameWords::find_units(const Vocabulary& vocabulary, std::size_t features) noexcept {
    const std::size_t distances = features * vocabulary.info().branching * vocabulary.info().levels;
    return static_cast<std::uint32_t>((distances + 31) / 32);
}

}  // namespace stillmesh
