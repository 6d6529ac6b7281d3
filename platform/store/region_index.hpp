// Which regions of a map store there are, by id and by the words they show: where the record of each lies, and how much
// of a question's words it shares. In files without names (paged_array.hpp): neither needs memory. Removed regions keep
// their place until rebuild(). Cost: by id constant; a question walks the postings of its words.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/paging/map_store.hpp"
#include "platform/store/paged_array.hpp"

namespace stillmesh {

struct IndexedRegion {
    std::uint64_t id;
    std::uint64_t offset;  // of the record
    std::uint64_t sequence;
    std::uint64_t used;
    std::int64_t time_ns;
    std::uint64_t segment;  // number
    std::uint32_t words;
    std::uint32_t words_crc;
    std::uint32_t body_bytes;
    std::uint32_t body_crc;
    std::uint32_t next_plus_one;  // of the same bucket; the index's own
    std::uint32_t is_alive;       // likewise
    float position_m[3];
    float axis[3];
};

class RegionIndex {
public:
    static constexpr std::uint32_t kNone = 0xffffffffU;

    // Empty, in a folder (none: in memory). 0, or errno, here and below.
    [[nodiscard]] int open(const std::string& folder, std::uint32_t regions_max);

    // Places of regions, of removed ones too.
    [[nodiscard]] std::uint32_t size() const { return regions_count_; }
    [[nodiscard]] const IndexedRegion& operator[](std::uint32_t place) const { return regions_[place]; }
    void set_used(std::uint32_t place, std::uint64_t used) { regions_[place].used = used; }
    [[nodiscard]] std::uint32_t place_of(std::uint64_t id) const;  // kNone: there is none

    // Its id must be new.
    [[nodiscard]] int add(const IndexedRegion& region, std::span<const WordWeight> words);
    void remove(std::uint32_t place);
    // Whether more is left behind of what was removed than there is of `alive` regions.
    [[nodiscard]] bool is_worn(std::uint64_t alive) const { return regions_count_ > 2 * alive + 4096; }
    // Without what was removed. `read_words` says the words of a region; false: it is gone as well.
    using ReadWords = std::function<bool(const IndexedRegion&, std::vector<WordWeight>&)>;
    [[nodiscard]] int rebuild(const ReadWords& read_words);

    // The places that share any of these words, with score_of() until the next end_question(), which must follow.
    [[nodiscard]] std::span<const std::uint32_t> begin_question(std::span<const WordWeight> words);
    [[nodiscard]] std::uint32_t score_of(std::uint32_t place) const { return scores_[place]; }
    void end_question();

private:
    struct Posting {
        std::uint32_t place;
        std::uint32_t weight;
    };
    static constexpr std::uint32_t kPostings = 15;
    struct Block {
        std::uint32_t next_plus_one;
        std::uint32_t count;
        Posting postings[kPostings];
    };

    [[nodiscard]] int reserve(std::size_t regions, std::size_t blocks);
    [[nodiscard]] std::uint32_t bucket_of(std::uint64_t id) const;
    void link(std::uint32_t place);
    [[nodiscard]] int add_postings(std::uint32_t place, std::span<const WordWeight> words);

    PagedArray<IndexedRegion> regions_;
    std::uint32_t regions_count_ = 0;
    PagedArray<std::uint32_t> buckets_;  // place + 1
    std::uint32_t buckets_count_ = 0;
    PagedArray<Block> blocks_;
    std::uint32_t blocks_count_ = 0;
    PagedArray<std::uint32_t> first_;    // by word: block + 1
    PagedArray<std::uint32_t> scores_;   // by place; zeros between questions
    PagedArray<std::uint32_t> touched_;  // places with a score
    std::uint32_t touched_count_ = 0;
};

}  // namespace stillmesh
