#include "platform/store/region_index.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr std::uint32_t kWordsEnd = 65536;

}  // namespace

int RegionIndex::open(const std::string& folder, std::uint32_t regions_max) {
    regions_count_ = blocks_count_ = touched_count_ = 0;
    buckets_count_ = 1024;
    while (buckets_count_ < regions_max) buckets_count_ *= 2;
    int error = regions_.open(folder);
    if (error == 0) error = buckets_.open(folder);
    if (error == 0) error = blocks_.open(folder);
    if (error == 0) error = first_.open(folder);
    if (error == 0) error = scores_.open(folder);
    if (error == 0) error = touched_.open(folder);
    if (error == 0) error = buckets_.reserve(buckets_count_);
    if (error == 0) error = first_.reserve(kWordsEnd);
    if (error == 0) error = reserve(1, 1);
    return error;
}

int RegionIndex::reserve(std::size_t regions, std::size_t blocks) {
    int error = regions_.reserve(regions);
    if (error == 0) error = scores_.reserve(regions);
    if (error == 0) error = touched_.reserve(regions);
    if (error == 0) error = blocks_.reserve(blocks);
    return error;
}

std::uint32_t RegionIndex::bucket_of(std::uint64_t id) const {
    return static_cast<std::uint32_t>((id * 0x9e3779b97f4a7c15ULL) >> 32U) & (buckets_count_ - 1);
}

std::uint32_t RegionIndex::place_of(std::uint64_t id) const {
    for (std::uint32_t at = buckets_[bucket_of(id)]; at != 0; at = regions_[at - 1].next_plus_one) {
        if (regions_[at - 1].id == id) return at - 1;
    }
    return kNone;
}

void RegionIndex::link(std::uint32_t place) {
    std::uint32_t& bucket = buckets_[bucket_of(regions_[place].id)];
    regions_[place].next_plus_one = bucket;
    bucket = place + 1;
}

int RegionIndex::add_postings(std::uint32_t place, std::span<const WordWeight> words) {
    if (const int error = reserve(regions_count_, blocks_count_ + words.size()); error != 0) return error;
    for (const WordWeight& word : words) {
        std::uint32_t& first = first_[word.word];
        if (first == 0 || blocks_[first - 1].count == kPostings) {
            Block& block = blocks_[blocks_count_];
            block.next_plus_one = first;
            block.count = 0;
            first = ++blocks_count_;
        }
        Block& block = blocks_[first - 1];
        block.postings[block.count++] = {place, word.weight};
    }
    return 0;
}

int RegionIndex::add(const IndexedRegion& region, std::span<const WordWeight> words) {
    if (const int error = reserve(regions_count_ + 1, blocks_count_ + words.size()); error != 0) return error;
    const std::uint32_t place = regions_count_++;
    regions_[place] = region;
    regions_[place].is_alive = 1;
    link(place);
    return add_postings(place, words);
}

void RegionIndex::remove(std::uint32_t place) {
    IndexedRegion& gone = regions_[place];
    if (gone.is_alive == 0) return;
    std::uint32_t* link = &buckets_[bucket_of(gone.id)];
    while (*link != place + 1) link = &regions_[*link - 1].next_plus_one;
    *link = gone.next_plus_one;
    gone.is_alive = 0;
}

int RegionIndex::rebuild(const ReadWords& read_words) {
    buckets_.fill_zero();
    first_.fill_zero();
    blocks_count_ = 0;
    const std::uint32_t count = regions_count_;
    regions_count_ = 0;
    std::vector<WordWeight> words;
    for (std::uint32_t i = 0; i < count; ++i) {
        if (regions_[i].is_alive == 0 || !read_words(regions_[i], words)) continue;
        const std::uint32_t place = regions_count_++;
        regions_[place] = regions_[i];
        link(place);
        if (const int error = add_postings(place, words); error != 0) return error;
    }
    return 0;
}

std::span<const std::uint32_t> RegionIndex::begin_question(std::span<const WordWeight> words) {
    touched_count_ = 0;
    for (const WordWeight& word : words) {
        for (std::uint32_t at = first_[word.word]; at != 0;) {
            const Block& block = blocks_[at - 1];
            for (std::uint32_t i = 0; i < block.count; ++i) {
                const Posting& posting = block.postings[i];
                const std::uint32_t common = std::min(posting.weight, word.weight);
                if (common == 0 || regions_[posting.place].is_alive == 0) continue;
                std::uint32_t& sum = scores_[posting.place];
                if (sum == 0) touched_[touched_count_++] = posting.place;
                sum += common;
            }
            at = block.next_plus_one;
        }
    }
    return {touched_count_ > 0 ? &touched_[0] : nullptr, touched_count_};
}

void RegionIndex::end_question() {
    for (std::uint32_t i = 0; i < touched_count_; ++i) scores_[touched_[i]] = 0;
    touched_count_ = 0;
}

}  // namespace stillmesh
