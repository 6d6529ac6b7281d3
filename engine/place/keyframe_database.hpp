// Which keyframes look like a frame: the inverted index. For every word the keyframes that have it, in chains of blocks
// of one cache line each: a question walks some thousand postings, and what it waits for is memory. Also keeps each
// keyframe's direct index. The pool has a block for the worst that keyframes_max bags of features_max words can ask
// for, so it is never full. Keyframes are named by their slot in the map's pool: remove() them when they are released,
// add() them anew when their words change. Memory: some 20 bytes times keyframes_max times features_max. Cost: adding
// one step per word, removing and asking one per posting of their words; questions in slices (PlaceQuery).
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/limits.hpp"
#include "engine/place/bag_of_words.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

class KeyframeDatabase {
    // All arrays, for the plan and for the arena. Above plan(): clang evaluates no template that it has not seen.
    template <typename A>
    constexpr void take_arrays(A& arena, const Limits& limits) noexcept {
        const std::size_t rows = static_cast<std::size_t>(limits.keyframes_max) * limits.features_max;
        arena.take(bags_, rows);
        arena.take(direct_, rows);
        arena.take(entries_, limits.keyframes_max);
        arena.take(blocks_, blocks_max(limits));
        arena.take(first_of_word_, limits.vocabulary_words_max);
    }

public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        KeyframeDatabase().take_arrays(arena, limits);
    }
    void create(Arena& arena, const Limits& limits) noexcept;
    void reset() noexcept;

    // Takes in the direct index and the bag of a keyframe whose static weights have settled. Its slot must be free.
    void add(std::uint32_t slot, const FrameWords& words) noexcept;
    // Nothing happens when it is not in.
    void remove(std::uint32_t slot) noexcept;
    [[nodiscard]] bool has(std::uint32_t slot) const noexcept { return entries_[slot].is_in; }
    [[nodiscard]] std::uint32_t size() const noexcept { return size_; }
    [[nodiscard]] std::uint32_t slots_count() const noexcept { return static_cast<std::uint32_t>(entries_.size()); }

    // Of a keyframe that is in.
    [[nodiscard]] std::span<const WordOfFeature> direct_index(std::uint32_t slot) const noexcept;
    [[nodiscard]] std::span<const WordWeight> bag(std::uint32_t slot) const noexcept {
        return entries_[slot].is_in ? bag_of(slot) : std::span<const WordWeight>{};
    }
    // How alike two keyframes are: bag_score().
    [[nodiscard]] std::uint32_t score(std::uint32_t slot_a, std::uint32_t slot_b) const noexcept;

    // Calls visit(keyframe slot, weight) for every keyframe that has the word, the latest added first. Returns how
    // many.
    template <typename Visit>
    std::uint32_t visit_keyframes(std::uint32_t word, Visit&& visit) const noexcept {
        std::uint32_t count = 0;
        for (std::uint32_t at = first_of_word_[word]; at != 0;) {
            const Block& block = blocks_[at - 1];
            for (std::uint32_t i = 0; i < block.count; ++i)
                visit(static_cast<std::uint32_t>(block.slots[i]), block.weights[i]);
            count += block.count;
            at = block.next_plus_one;
        }
        return count;
    }
    // The memory of a word's first postings, wanted soon.
    void prefetch(std::uint32_t word) const noexcept {
        if (first_of_word_[word] != 0) __builtin_prefetch(&blocks_[first_of_word_[word] - 1]);
    }
    // Grows with every add(): what was added after a query began does not belong to it.
    [[nodiscard]] std::uint64_t adds() const noexcept { return adds_; }
    [[nodiscard]] std::uint64_t added_at(std::uint32_t slot) const noexcept { return entries_[slot].added_at; }

private:
    static constexpr std::uint32_t kBlockPostings = 9;
    // Postings of one word. All blocks of a chain are full but the first, which holds at least one.
    struct alignas(64) Block {
        std::uint32_t next_plus_one = 0;  // in the chain, or in the list of free ones; 0: the last
        std::uint16_t count = 0;
        std::uint16_t slots[kBlockPostings] = {};
        std::uint32_t weights[kBlockPostings] = {};
    };
    // The chains of all words together: a full block for every kBlockPostings postings, and one begun for each word.
    [[nodiscard]] static constexpr std::size_t blocks_max(const Limits& limits) noexcept {
        const std::size_t rows = static_cast<std::size_t>(limits.keyframes_max) * limits.features_max;
        const std::size_t in_chains = rows / kBlockPostings + limits.vocabulary_words_max;
        return in_chains < rows ? in_chains : rows;
    }
    struct Entry {
        std::uint64_t added_at = 0;
        std::uint32_t words = 0;
        std::uint32_t features = 0;
        bool is_in = false;
    };
    [[nodiscard]] std::span<const WordWeight> bag_of(std::uint32_t slot) const noexcept {
        return bags_.subspan(static_cast<std::size_t>(slot) * features_max_, entries_[slot].words);
    }
    void add_posting(std::uint32_t word, std::uint32_t slot, std::uint32_t weight) noexcept;
    void remove_posting(std::uint32_t word, std::uint32_t slot) noexcept;

    std::span<WordWeight> bags_;       // features_max per slot
    std::span<WordOfFeature> direct_;  // likewise
    std::span<Entry> entries_;         // by slot
    std::span<Block> blocks_;
    std::span<std::uint32_t> first_of_word_;  // block + 1; 0: no keyframe has it
    std::uint32_t first_free_ = 0;            // block + 1
    std::uint32_t features_max_ = 0;
    std::uint32_t size_ = 0;
    std::uint64_t adds_ = 0;
};

struct PlaceCandidate {
    std::uint32_t keyframe_slot = 0;
    std::uint32_t score = 0;         // bag_score(), 1 to kBagWeightOne
    std::uint32_t common_words = 0;  // that both have
};

// One question to the database, cut into slices anywhere: the answer is the same. Keyframes that went meanwhile are
// left out of it, and those that came (or came back) meanwhile.
class PlaceQuery {
public:
    // A unit is so many postings; a step overdraws by at most the postings of one word, keyframes_max.
    static constexpr std::uint32_t kPostingsPerUnit = 32;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FixedVector<WordWeight>::plan(arena, limits.features_max);
        arena.array<PlaceCandidate>(limits.keyframes_max);
        FixedVector<PlaceCandidate>::plan(arena, limits.keyframes_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept;
    void reset() noexcept;

    // Forgets an earlier question. `bag` is copied.
    void begin(const KeyframeDatabase& database, std::span<const WordWeight> bag) noexcept;
    // kIdle: no question, or answered already; kDone: candidates() is the answer.
    Progress step(const KeyframeDatabase& database, WorkBudget& budget) noexcept;
    [[nodiscard]] bool is_running() const noexcept { return is_running_; }

    // All keyframes that share a word, the most alike first (ties: the lower slot). Empty until answered.
    [[nodiscard]] std::span<const PlaceCandidate> candidates() const noexcept { return candidates_.span(); }

private:
    FixedVector<WordWeight> bag_;
    std::span<PlaceCandidate> scores_;  // by slot
    FixedVector<PlaceCandidate> candidates_;
    std::uint64_t begun_at_ = 0;  // adds() of the database
    std::uint32_t next_word_ = 0;
    std::uint32_t postings_ = 0;  // of the unit that has begun
    bool is_running_ = false;
};

}  // namespace stillmesh
