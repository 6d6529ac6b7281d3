#include "engine/place/keyframe_database.hpp"

#include "engine/base/sort.hpp"

namespace stillmesh {

void KeyframeDatabase::create(Arena& arena, const Limits& limits) noexcept {
    features_max_ = limits.features_max;
    take_arrays(arena, limits);
    reset();
}

void KeyframeDatabase::reset() noexcept {
    for (Entry& entry : entries_) entry = Entry{};
    for (std::uint32_t& first : first_of_word_) first = 0;
    for (std::uint32_t i = 0; i < blocks_.size(); ++i) blocks_[i] = {i + 1 < blocks_.size() ? i + 2 : 0, 0, {}, {}};
    first_free_ = blocks_.empty() ? 0 : 1;
    size_ = 0;
    adds_ = 0;
}

void KeyframeDatabase::add_posting(std::uint32_t word, std::uint32_t slot, std::uint32_t weight) noexcept {
    std::uint32_t& first = first_of_word_[word];
    if (first == 0 || blocks_[first - 1].count == kBlockPostings) {
        STILLMESH_CHECK(first_free_ != 0);  // blocks_max()
        const std::uint32_t taken = first_free_;
        first_free_ = blocks_[taken - 1].next_plus_one;
        blocks_[taken - 1].next_plus_one = first;
        blocks_[taken - 1].count = 0;
        first = taken;
    }
    Block& block = blocks_[first - 1];
    block.slots[block.count] = static_cast<std::uint16_t>(slot);
    block.weights[block.count] = weight;
    ++block.count;
}

// The last posting of the first block takes the empty place: no answer depends on their order.
void KeyframeDatabase::remove_posting(std::uint32_t word, std::uint32_t slot) noexcept {
    const std::uint32_t first = first_of_word_[word];
    STILLMESH_CHECK(first != 0);
    Block& head = blocks_[first - 1];
    for (std::uint32_t at = first; at != 0; at = blocks_[at - 1].next_plus_one) {
        Block& block = blocks_[at - 1];
        for (std::uint32_t i = 0; i < block.count; ++i) {
            if (block.slots[i] != slot) continue;
            --head.count;
            block.slots[i] = head.slots[head.count];
            block.weights[i] = head.weights[head.count];
            if (head.count == 0) {
                first_of_word_[word] = head.next_plus_one;
                head.next_plus_one = first_free_;
                first_free_ = first;
            }
            return;
        }
    }
    STILLMESH_CHECK(false);  // the keyframe has the word
}

void KeyframeDatabase::add(std::uint32_t slot, const FrameWords& words) noexcept {
    STILLMESH_CHECK(slot < entries_.size() && !entries_[slot].is_in);
    STILLMESH_CHECK(words.by_word().size() <= features_max_ && words.bag().size() <= features_max_);
    std::size_t row = static_cast<std::size_t>(slot) * features_max_;
    for (const WordOfFeature& entry : words.by_word()) direct_[row++] = entry;
    row = static_cast<std::size_t>(slot) * features_max_;
    for (const WordWeight& entry : words.bag()) {
        bags_[row++] = entry;
        add_posting(entry.word, slot, entry.weight);
    }
    entries_[slot] = {++adds_, static_cast<std::uint32_t>(words.bag().size()),
                      static_cast<std::uint32_t>(words.by_word().size()), true};
    ++size_;
}

void KeyframeDatabase::remove(std::uint32_t slot) noexcept {
    STILLMESH_CHECK(slot < entries_.size());
    if (!entries_[slot].is_in) return;
    for (const WordWeight& entry : bag_of(slot)) remove_posting(entry.word, slot);
    entries_[slot] = Entry{};
    --size_;
}

std::span<const WordOfFeature> KeyframeDatabase::direct_index(std::uint32_t slot) const noexcept {
    STILLMESH_CHECK(slot < entries_.size() && entries_[slot].is_in);
    return direct_.subspan(static_cast<std::size_t>(slot) * features_max_, entries_[slot].features);
}

std::uint32_t KeyframeDatabase::score(std::uint32_t slot_a, std::uint32_t slot_b) const noexcept {
    STILLMESH_CHECK(slot_a < entries_.size() && entries_[slot_a].is_in);
    STILLMESH_CHECK(slot_b < entries_.size() && entries_[slot_b].is_in);
    return bag_score(bag_of(slot_a), bag_of(slot_b));
}

void PlaceQuery::create(Arena& arena, const Limits& limits) noexcept {
    bag_.create(arena, limits.features_max);
    scores_ = arena.array<PlaceCandidate>(limits.keyframes_max);
    candidates_.create(arena, limits.keyframes_max);
    reset();
}

void PlaceQuery::reset() noexcept {
    bag_.clear();
    candidates_.clear();
    is_running_ = false;
}

void PlaceQuery::begin(const KeyframeDatabase& database, std::span<const WordWeight> bag) noexcept {
    STILLMESH_CHECK(scores_.size() >= database.slots_count());
    bag_.clear();
    for (const WordWeight& entry : bag) STILLMESH_CHECK(bag_.push(entry));
    candidates_.clear();
    for (std::uint32_t slot = 0; slot < scores_.size(); ++slot) scores_[slot] = {slot, 0, 0};
    begun_at_ = database.adds();
    next_word_ = 0;
    postings_ = 0;
    is_running_ = true;
}

Progress PlaceQuery::step(const KeyframeDatabase& database, WorkBudget& budget) noexcept {
    if (!is_running_) return Progress::kIdle;
    for (; next_word_ < bag_.size(); ++next_word_) {
        if (budget.is_spent()) return Progress::kWorking;
        const std::uint32_t weight = bag_[next_word_].weight;
        constexpr std::uint32_t kAhead = 4;  // words
        if (next_word_ + kAhead < bag_.size()) database.prefetch(bag_[next_word_ + kAhead].word);
        // A word without keyframes is work too.
        postings_ += 1 + database.visit_keyframes(bag_[next_word_].word, [&](std::uint32_t slot, std::uint32_t other) {
            PlaceCandidate& candidate = scores_[slot];
            candidate.score += other < weight ? other : weight;
            ++candidate.common_words;
        });
        budget.spend(postings_ / kPostingsPerUnit);
        postings_ %= kPostingsPerUnit;
    }
    if (budget.is_spent()) return Progress::kWorking;
    for (const PlaceCandidate& candidate : scores_) {
        const std::uint32_t slot = candidate.keyframe_slot;
        if (candidate.score == 0 || !database.has(slot)) continue;
        if (database.added_at(slot) > begun_at_) continue;
        STILLMESH_CHECK(candidates_.push(candidate));
    }
    sort(candidates_.span(), [](const PlaceCandidate& a, const PlaceCandidate& b) {
        return a.score != b.score ? a.score > b.score : a.keyframe_slot < b.keyframe_slot;
    });
    budget.spend(1 + static_cast<std::uint32_t>(candidates_.size()) / kPostingsPerUnit);
    is_running_ = false;
    return Progress::kDone;
}

}  // namespace stillmesh
