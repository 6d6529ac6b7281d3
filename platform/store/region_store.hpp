// Regions of maps on disk: append-only segment files, every record with its CRC, and an index by words that is built
// when the store is opened and lies in files without names, so that neither regions nor index need memory: the system
// pages both (docs/map-store.md, docs/SPEC-map-store.md). A kill at any moment loses at most the record that was being
// written; what is damaged is left out, never what is whole beside it. One thread at a time. The answer to a question
// is a function of the records and of nothing else.
// Limits: regions_max regions; beyond it the ones longest without use go. Cost: opening reads heads and words (and all
// of the last segment); keeping and asking walk the postings of a bag's words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/paging/map_store.hpp"
#include "platform/store/region_index.hpp"
#include "platform/store/store_records.hpp"

namespace stillmesh {

struct RegionStoreOptions {
    std::string folder;
    store_records::StoreOrigin origin;
    std::uint32_t regions_max = 20000;
    double twin_m = 0.3;  // regions of one place: views as near (view_distance_m2)
    std::uint64_t segment_bytes_max = std::uint64_t{64} << 20U;
    // Nothing in the folder is changed: what is written goes to files without names, and goes with them. Records from
    // after `sequence_max` are left out: the store as it was.
    bool is_scratch = false;
    bool is_durable = true;  // false: a power cut may take anything; for tests
    std::uint64_t sequence_max = ~std::uint64_t{0};
};

struct RegionStoreCounts {
    std::uint64_t regions = 0;  // there now
    std::uint64_t bytes = 0;    // of all segments
    std::uint64_t segments = 0;
    std::uint64_t written = 0;    // regions, since it was opened
    std::uint64_t known = 0;      // not written: the place is there and looks alike
    std::uint64_t forgotten = 0;  // to stay within regions_max
    std::uint64_t damaged = 0;    // records left out, since it was opened and then
    std::uint64_t cut_bytes = 0;  // torn off the end when it was opened
};

class RegionStore {
public:
    RegionStore() = default;
    ~RegionStore() { close(); }
    RegionStore(const RegionStore&) = delete;
    RegionStore& operator=(const RegionStore&) = delete;

    // Makes the folder if it is not there (with an empty name and is_scratch: none at all). False: `message` says why,
    // and nothing was changed. kOk with a message: a note for the user.
    [[nodiscard]] bool open(const RegionStoreOptions& options, std::string& message);
    [[nodiscard]] bool is_open() const { return is_open_; }
    // Writes everything down to the disk.
    void close();

    // False: it could not be written; problem() says why, and from then on nothing is.
    [[nodiscard]] bool keep(const LeavingRegion& region);
    // The most alike region that is meant; ties: the lower id. False: there is none.
    [[nodiscard]] bool find(const StoreQuestion& question, StoreAnswer& answer, std::span<std::byte> body);
    void note_use(std::uint64_t id);
    // Down to the disk, when something is not there yet.
    void sync();

    [[nodiscard]] StoreContent content() const;
    // Of all regions that are there; equal for equal ones, wherever they lie.
    [[nodiscard]] std::uint64_t checksum() const;
    [[nodiscard]] std::uint64_t sequence() const { return sequence_; }  // of the last record
    [[nodiscard]] const RegionStoreCounts& counts() const { return counts_; }
    [[nodiscard]] bool has_failed() const { return !problem_.empty(); }
    [[nodiscard]] const std::string& problem() const { return problem_; }
    // Everything computed anew: empty, or what is wrong. For tests; slow.
    [[nodiscard]] std::string find_fault() const;

private:
    struct Segment {
        int descriptor = -1;
        std::string file;  // empty: without a name
        std::uint64_t size = 0;
        std::uint64_t alive = 0;  // regions
        std::uint64_t alive_bytes = 0;
    };
    [[nodiscard]] bool lock(std::string& message);
    [[nodiscard]] bool open_segments(std::string& message);
    [[nodiscard]] bool scan(std::uint64_t number, Segment& segment, bool is_last, std::string& message);
    [[nodiscard]] bool begin_segment();
    [[nodiscard]] bool append(store_records::RecordHead& head, std::span<const WordWeight> words,
                              std::span<const std::byte> body);
    bool fail(const char* what, int error);
    // --- index
    [[nodiscard]] bool add(const store_records::RecordHead& head, std::uint64_t segment, std::uint64_t offset,
                           std::span<const WordWeight> words);
    void remove(std::uint32_t place);
    void forget(const IndexedRegion& gone);
    [[nodiscard]] bool rebuild_index();
    [[nodiscard]] bool has_twin(const LeavingRegion& region);
    void make_room();
    void tidy();
    [[nodiscard]] bool read_words(const IndexedRegion& entry, std::vector<WordWeight>& words) const;
    [[nodiscard]] bool read_body(const IndexedRegion& entry, std::span<std::byte> body) const;

    RegionStoreOptions options_;
    bool is_open_ = false;
    int lock_ = -1;
    std::map<std::uint64_t, Segment> segments_;  // by number; the last is written to
    std::uint64_t sequence_ = 0;
    std::int64_t synced_ns_ = 0;
    bool is_dirty_ = false;
    RegionIndex index_;
    std::uint32_t tidy_cursor_ = 0;
    std::vector<std::byte> record_;
    std::vector<WordWeight> words_;
    std::vector<std::uint64_t> without_;
    RegionStoreCounts counts_;
    std::string problem_;
};

}  // namespace stillmesh
