// A map store in memory: some regions, answers at the next poll, the most words in common first, then the lower id.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/paging/map_store.hpp"

namespace stillmesh::fuzz {

class MemoryStore final : public MapStore {
public:
    static constexpr std::size_t kRegionsMax = 8;

    void clear() {
        regions_.clear();
        claimed_ = 0;
        has_question_ = false;
    }
    // What a disk may do to a region.
    void harm(std::size_t which, std::size_t place, std::byte value) {
        if (regions_.empty()) return;
        std::vector<std::byte>& body = regions_[which % regions_.size()].body;
        if (!body.empty()) body[place % body.size()] = value;
    }
    // What a store may say that it holds: names below this, until this time.
    void claim(std::uint64_t end) { claimed_ = end; }
    [[nodiscard]] bool claims() const { return claimed_ > 0; }
    [[nodiscard]] StoreContent content() const noexcept override {
        StoreContent out;
        out.regions = regions_.size();
        if (claimed_ > 0) return {out.regions, claimed_, static_cast<std::int64_t>(claimed_)};
        for (const Region& region : regions_) {
            out.ids_end = std::max(out.ids_end, region.id + 1);
            out.time_ns = std::max(out.time_ns, region.time_ns);
        }
        return out;
    }
    [[nodiscard]] Status keep(const LeavingRegion& leaving) noexcept override {
        Region region{leaving.id, leaving.time_ns, {}, {leaving.body.begin(), leaving.body.end()}};
        for (const WordWeight& word : leaving.words) region.words.push_back(word.word);
        const auto same =
            std::find_if(regions_.begin(), regions_.end(), [&](const Region& other) { return other.id == region.id; });
        if (same != regions_.end()) {
            *same = region;
        } else {
            if (regions_.size() == kRegionsMax) return Status::kFull;
            regions_.push_back(region);
        }
        return Status::kOk;
    }
    [[nodiscard]] Status ask(const StoreQuestion& question) noexcept override {
        number_ = question.number;
        older_than_ = question.older_than;
        words_.assign(question.words.begin(), question.words.end());
        without_.assign(question.without.begin(), question.without.end());
        has_question_ = true;
        return Status::kOk;
    }
    [[nodiscard]] Status poll(StoreAnswer& answer, std::span<std::byte> body) noexcept override {
        if (!has_question_) return Status::kTimedOut;
        has_question_ = false;
        answer.question = number_;
        const Region* best = nullptr;
        std::uint32_t best_score = 0;
        for (const Region& region : regions_) {
            const std::uint32_t score = score_of(region);
            if (score > best_score) {
                best = &region;
                best_score = score;
            }
        }
        if (best == nullptr) return Status::kNotFound;
        answer.id = best->id;
        answer.score = best_score;
        answer.size_bytes = best->body.size() <= body.size() ? best->body.size() : 0;
        std::copy_n(best->body.begin(), answer.size_bytes, body.begin());
        return Status::kOk;
    }
    void note_use(std::uint64_t) noexcept override {}

private:
    struct Region {
        std::uint64_t id = 0;
        std::int64_t time_ns = 0;
        std::vector<std::uint16_t> words;
        std::vector<std::byte> body;
    };
    // Words in common; 0: this one is not meant.
    [[nodiscard]] std::uint32_t score_of(const Region& region) const {
        if (region.id >= older_than_ || std::find(without_.begin(), without_.end(), region.id) != without_.end()) {
            return 0;
        }
        std::uint32_t score = 0;
        for (const WordWeight& word : words_) {
            score += std::find(region.words.begin(), region.words.end(), word.word) != region.words.end() ? 1U : 0U;
        }
        return score;
    }

    std::vector<Region> regions_;
    std::uint64_t claimed_ = 0;  // 0: what is there
    std::vector<WordWeight> words_;
    std::vector<std::uint64_t> without_;
    std::uint64_t number_ = 0, older_than_ = 0;
    bool has_question_ = false;
};

}  // namespace stillmesh::fuzz
