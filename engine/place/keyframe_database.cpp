#include "engine/place/keyframe_database.hpp"

#include "engine/base/sort.hpp"

namespace stillmesh {

void KeyframeDatabase::create(Arena& arena, const Limits& limits) noexcept {
    features_max_ = limits.features_max;
    const std::size_t rows = static_cast<std::size_t>(limits.keyframes_max) * limits.features_max;
    postings_ = arena.array<Posting>(rows);
    direct_ = arena.array<WordOfFeature>(rows);
    entries_ = arena.array<Entry>(limits.keyframes_max);
    first_of_word_ = arena.array<std::uint32_t>(limits.vocabulary_words_max);
    reset();
}

void KeyframeDatabase::reset() noexcept {
    for (Entry& entry : entries_) entry = Entry{};
    for (std::uint32_t& first : first_of_word_) first = 0;
    size_ = 0;
    adds_ = 0;
}

void KeyframeDatabase::add(std::uint32_t slot, const FrameWords& words) noexcept {
    STILLMESH_CHECK(slot < entries_.size() && !entries_[slot].is_in);
    STILLMESH_CHECK(words.by_word().size() <= features_max_ && words.bag().size() <= features_max_);
    const std::size_t first_row = static_cast<std::size_t>(slot) * features_max_;
    std::size_t row = first_row;
    for (const WordOfFeature& entry : words.by_word()) direct_[row++] = entry;
    row = first_row;
    for (const WordWeight& entry : words.bag()) {
        std::uint32_t& first = first_of_word_[entry.word];
        postings_[row] = {entry.weight, first, 0, entry.word, static_cast<std::uint16_t>(slot)};
        ++row;
        if (first != 0) postings_[first - 1].previous_plus_one = static_cast<std::uint32_t>(row);
        first = static_cast<std::uint32_t>(row);
    }
    entries_[slot] = {++adds_, static_cast<std::uint32_t>(words.bag().size()),
                      static_cast<std::uint32_t>(words.by_word().size()), true};
    ++size_;
}

void KeyframeDatabase::remove(std::uint32_t slot) noexcept {
    STILLMESH_CHECK(slot < entries_.size());
    if (!entries_[slot].is_in) return;
    for (const Posting& posting : postings_of(slot)) {
        if (posting.next_plus_one != 0)
            postings_[posting.next_plus_one - 1].previous_plus_one = posting.previous_plus_one;
        if (posting.previous_plus_one != 0) {
            postings_[posting.previous_plus_one - 1].next_plus_one = posting.next_plus_one;
        } else {
            first_of_word_[posting.word] = posting.next_plus_one;
        }
    }
    entries_[slot] = Entry{};
    --size_;
}

std::span<const WordOfFeature> KeyframeDatabase::direct_index(std::uint32_t slot) const noexcept {
    STILLMESH_CHECK(slot < entries_.size() && entries_[slot].is_in);
    return direct_.subspan(static_cast<std::size_t>(slot) * features_max_, entries_[slot].features);
}

std::uint32_t KeyframeDatabase::score(std::uint32_t slot, std::span<const WordWeight> bag) const noexcept {
    STILLMESH_CHECK(slot < entries_.size() && entries_[slot].is_in);
    return common_weight(postings_of(slot), bag);
}

std::uint32_t KeyframeDatabase::score(std::uint32_t slot_a, std::uint32_t slot_b) const noexcept {
    STILLMESH_CHECK(slot_a < entries_.size() && entries_[slot_a].is_in);
    STILLMESH_CHECK(slot_b < entries_.size() && entries_[slot_b].is_in);
    return common_weight(postings_of(slot_a), postings_of(slot_b));
}

const char* KeyframeDatabase::find_fault() const noexcept {
    std::uint32_t in = 0;
    std::size_t postings = 0;
    for (std::uint32_t slot = 0; slot < entries_.size(); ++slot) {
        if (!entries_[slot].is_in) continue;
        ++in;
        postings += entries_[slot].postings;
        std::int32_t last = -1;
        for (const Posting& posting : postings_of(slot)) {
            if (posting.slot != slot) return "a posting in a foreign row";
            if (posting.word <= last) return "words out of order";
            last = posting.word;
        }
    }
    if (in != size_) return "size is not what is in";
    std::size_t linked = 0;
    for (std::uint32_t word = 0; word < first_of_word_.size(); ++word) {
        std::uint32_t previous = 0;
        for (std::uint32_t at = first_of_word_[word]; at != 0; at = postings_[at - 1].next_plus_one) {
            const Posting& posting = postings_[at - 1];
            if (++linked > postings) return "a list without an end, or of what went";
            if (posting.word != word) return "a posting in a foreign list";
            if (posting.previous_plus_one != previous) return "a link back that is wrong";
            if (!entries_[posting.slot].is_in) return "a posting of a keyframe that went";
            previous = at;
        }
    }
    return linked == postings ? nullptr : "a posting in no list";
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
        if (candidate.score == 0 || slot >= database.slots_count() || !database.has(slot)) continue;
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
