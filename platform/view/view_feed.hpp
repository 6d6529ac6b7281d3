// From the engine's thread to those of a page that looks on, without the engine's thread ever waiting. It fills a
// snapshot of its own and swaps it for one that lies between the two, under a lock that it only tries: where the other
// side holds it, for the microseconds of a copy, this snapshot is not shown. Nobody looks: one atomic load a frame, and
// a place on the path ten times a second.
//
// What has been (path, events, what keyframes saw) is kept for whoever comes later, in rings of fixed size. Memory:
// some 1.6 MB, taken at construction; no heap call on the engine's thread after it.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "platform/view/view_commands.hpp"
#include "platform/view/view_downloads.hpp"
#include "platform/view/view_snapshot.hpp"

namespace stillmesh {

inline constexpr std::int64_t kViewPeriod_ns = 100'000'000;  // at most ten snapshots a second
inline constexpr std::size_t kViewPlacesMax = 4096;          // full: every second one is dropped
inline constexpr std::size_t kViewCloudsMax = 512;           // full: the oldest is forgotten
inline constexpr std::size_t kViewEventsMax = 32;            // likewise
inline constexpr std::size_t kViewEventBytesMax = 400;
inline constexpr std::size_t kViewCloudsAtOnce = 16;  // of one look at the history

// How much of the history somebody has seen.
struct ViewCursor {
    std::uint64_t life = 0;  // of the path; another one: all of it anew
    std::size_t places = 0;
    std::uint64_t clouds = 0;
    std::uint64_t events = 0;
};
// What is new to him.
struct ViewNews {
    std::uint64_t life = 0;
    bool is_new_map = false;       // what was shown before is of another map
    std::size_t places_begin = 0;  // number of the first of `places`; 0: they replace what was there
    std::vector<ViewPlace> places;
    std::vector<ViewCloud> clouds;
    std::vector<std::string> events;
};

struct ViewPose {
    std::int64_t time_ns = 0;
    ViewPlace place;
    std::array<float, 4> q{};  // x y z w
};

class ViewFeed {
public:
    ViewFeed();

    // --- The engine's thread -----------------------------------------------------------------------------------------
    // A frame came, at a time of monotonic_ns. True: somebody looks, and a snapshot is due; fill draft(), hand_over().
    [[nodiscard]] bool is_due(std::int64_t now_ns) noexcept;
    [[nodiscard]] ViewSnapshot& draft() noexcept { return draft_; }
    void hand_over() noexcept;
    // Of the frame's own time; kept ten times a second, rarer as the run grows. `q`: the camera's rotation, x y z w.
    void place(std::int64_t time_ns, const ViewPlace& place, const std::array<float, 4>& q = {0, 0, 0, 1}) noexcept;
    void cloud(const ViewCloud& cloud) noexcept;
    void event(std::string_view sentence) noexcept;
    // Path and clouds so far are of another map.
    void begin_map() noexcept;

    // --- Any other thread --------------------------------------------------------------------------------------------
    void come() noexcept { watchers_.fetch_add(1); }
    void leave() noexcept { watchers_.fetch_sub(1); }
    [[nodiscard]] int watchers() const noexcept { return watchers_.load(); }
    // False: there is none since the last. Else `snapshot` is swapped for it.
    [[nodiscard]] bool take(ViewSnapshot& snapshot);
    // What lies behind `cursor`, which goes on; at most kViewCloudsAtOnce clouds.
    void look(ViewCursor& cursor, ViewNews& news);
    // All places that are kept of the map at hand, with time and rotation.
    void poses(std::vector<ViewPose>& poses);
    // Files that may be taken home; any thread.
    [[nodiscard]] ViewDownloads& downloads() noexcept { return downloads_; }
    // What is wanted of the run.
    [[nodiscard]] ViewCommands& commands() noexcept { return commands_; }
    // Of the last frame, by monotonic_ns; 0: none yet.
    [[nodiscard]] std::int64_t last_frame_ns() const noexcept { return last_frame_ns_.load(std::memory_order_relaxed); }

private:
    struct Event {
        std::array<char, kViewEventBytesMax> text{};
        std::size_t size = 0;
    };
    void put_event(const Event& event) noexcept;
    void put_what_waits() noexcept;

    ViewCommands commands_;
    ViewDownloads downloads_;
    std::atomic<int> watchers_{0};
    std::atomic<std::int64_t> last_frame_ns_{0};

    // Of the engine's thread.
    ViewSnapshot draft_;
    std::int64_t last_snapshot_ns_ = 0;
    std::int64_t last_place_ns_ = -1;
    std::array<Event, 8> waiting_;  // events that came while the lock was held
    std::size_t waiting_count_ = 0;
    bool is_new_map_waiting_ = false;
    bool is_gap_waiting_ = false;

    std::mutex mutex_;
    ViewSnapshot between_;  // from here on under the lock
    bool is_fresh_ = false;
    std::vector<ViewPlace> places_;
    struct Stamp {
        std::int64_t time_ns;
        std::array<float, 4> q;
    };
    std::vector<Stamp> stamps_;  // of the places
    std::int64_t place_period_ns_ = kViewPeriod_ns;
    std::uint64_t life_ = 1;      // changes when the path is thinned out
    std::uint64_t map_life_ = 1;  // the life that the map began with
    std::vector<ViewCloud> clouds_;
    std::uint64_t clouds_made_ = 0, clouds_begin_ = 0;  // of all, and the first of this map
    std::array<Event, kViewEventsMax> events_;
    std::uint64_t events_made_ = 0;
};

}  // namespace stillmesh
