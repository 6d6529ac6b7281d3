// The MapStore port: where regions of the map go that memory has no room for, and where they come back from when their
// words are seen again. A region is one keyframe with the static points that it shows; its bytes
// are the engine's own business. The engine never waits: what is
// kept or asked is copied by the store before the call returns, and an answer is polled for. Bodies fail a CHECK (a
// pure virtual would pull the C++ runtime into the engine); no call may throw.
//
// The same answers at the same polls give the same bits. A store that answers from another thread therefore lets
// answers, and room for what is kept, become visible only between frames, where a recording notes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/check.hpp"
#include "engine/base/status.hpp"
#include "engine/place/bag_of_words.hpp"

namespace stillmesh {

// A region that leaves the map; everything is borrowed for the call.
struct LeavingRegion {
    std::uint64_t id = 0;           // of its keyframe: the number of its frame. A later region of one id replaces it
    std::int64_t time_ns = 0;       // on the map's clock
    float position_m[3] = {};       // where its camera was, world
    float axis[3] = {};             // where it looked, a unit vector
    std::uint32_t alike_score = 0;  // bag_score() of the least alike of its neighbours; 0: it has none
    std::span<const WordWeight> words;  // its bag, by word
    std::span<const std::byte> body;
};

// Which stored region looks like this? Everything is borrowed for the call.
struct StoreQuestion {
    std::uint64_t number = 0;                // the answer has the same
    std::span<const WordWeight> words;       // a bag, by word
    std::span<const std::uint64_t> without;  // ids that are not meant: they are in the map, or were just now
    std::uint64_t older_than = 0;            // only ids below
    std::uint32_t score_min = 1;             // bag_score() of the least alike that is meant
};

struct StoreAnswer {
    std::uint64_t question = 0;  // its number
    std::uint64_t id = 0;
    std::uint32_t score = 0;
    std::size_t size_bytes = 0;  // of the body
};

// What a store held when it was opened.
struct StoreContent {
    std::uint64_t regions = 0;
    std::uint64_t ids_end = 0;  // above every id in it; beyond 2^37 not believed
    std::int64_t time_ns = 0;   // the latest, on the map's clock; beyond 2^61 not believed
};

class MapStore {
public:
    [[nodiscard]] virtual StoreContent content() const noexcept {
        check_failed("MapStore::content not implemented", __FILE__, __LINE__);
    }
    //   kOk    taken, or known already: a region of the same place that looks alike is there
    //   kFull  no room at the moment: the region is lost
    [[nodiscard]] virtual Status keep(const LeavingRegion&) noexcept {
        check_failed("MapStore::keep not implemented", __FILE__, __LINE__);
    }
    //   kOk    it will be answered, in time or never; a question before it is forgotten
    //   kFull  not at the moment
    [[nodiscard]] virtual Status ask(const StoreQuestion&) noexcept {
        check_failed("MapStore::ask not implemented", __FILE__, __LINE__);
    }
    // The answer to a question, once.
    //   kOk        `body` begins with the region, answer.size_bytes of it (0: larger than `body`, left out)
    //   kNotFound  no region is meant; only answer.question counts     kTimedOut  no answer yet
    [[nodiscard]] virtual Status poll(StoreAnswer&, std::span<std::byte>) noexcept {
        check_failed("MapStore::poll not implemented", __FILE__, __LINE__);
    }
    // A region that came back was seen to be of use: it stays longest.
    virtual void note_use(std::uint64_t) noexcept {
        check_failed("MapStore::note_use not implemented", __FILE__, __LINE__);
    }

protected:
    ~MapStore() = default;
};

}  // namespace stillmesh
