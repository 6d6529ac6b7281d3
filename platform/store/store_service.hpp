// A RegionStore as the engine's MapStore: what the engine keeps and asks is copied into a fixed ring and done in that
// order, by a thread of its own or between frames. Answers, and room for what is kept, become visible in begin_frame()
// alone, between a frame and its background work, and are events of a recording: whoever is given the same events, and
// begins with the same regions, gives the same bits (docs/map-store.md).
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "engine/paging/map_store.hpp"
#include "platform/store/region_store.hpp"

namespace stillmesh {

// What became visible behind a frame.
struct StoreEvents {
    std::uint64_t answered = 0;  // number of the question whose answer can be polled from now on; 0: none new
    bool is_accepting = true;    // regions are taken until the next frame
    friend bool operator==(const StoreEvents&, const StoreEvents&) = default;
};

class StoreService final : public MapStore {
public:
    enum class Mode : std::uint8_t {
        kAtOnce,    // the disk's work is done in begin_frame(): replay and simulation
        kThread,    // by a thread: live, and --realtime
        kRepeated,  // as events say that it went
    };
    static constexpr std::uint32_t kPerFrame = 8;  // regions and marks of use taken between two frames
    static constexpr std::uint32_t kJobsMax = 32;

    StoreService() = default;
    ~StoreService() { static_cast<void>(close()); }
    StoreService(const StoreService&) = delete;
    StoreService& operator=(const StoreService&) = delete;

    // False: `message` says why; true with a message: a note for the user. `body_bytes_max`: of a region.
    [[nodiscard]] bool open(const RegionStoreOptions& options, Mode mode, std::size_t body_bytes_max,
                            std::string& message);
    [[nodiscard]] bool is_open() const { return !jobs_.empty(); }
    // Behind every frame, before its background work. `events`: for kRepeated.
    StoreEvents begin_frame(const StoreEvents& events = {});
    // Waits until all that was given is done, and takes more: for the end of a run.
    StoreEvents wait_for_room();
    [[nodiscard]] bool has_failed() const;
    // Waits until everything is down on the disk. Empty, or what went wrong.
    [[nodiscard]] std::string close();

    // As it was when it was opened.
    [[nodiscard]] std::uint64_t sequence() const { return sequence_; }
    [[nodiscard]] std::uint64_t checksum() const { return checksum_; }
    [[nodiscard]] RegionStoreCounts counts() const;  // after close(): the last

    [[nodiscard]] StoreContent content() const noexcept override;
    [[nodiscard]] Status keep(const LeavingRegion& region) noexcept override;
    [[nodiscard]] Status ask(const StoreQuestion& question) noexcept override;
    [[nodiscard]] Status poll(StoreAnswer& answer, std::span<std::byte> body) noexcept override;
    void note_use(std::uint64_t id) noexcept override;

private:
    enum class Kind : std::uint8_t { kKeep, kAsk, kUse };
    struct Job {
        Kind kind = Kind::kKeep;
        LeavingRegion region;    // its spans: those below
        StoreQuestion question;  // likewise
        std::uint64_t id = 0;
        std::vector<WordWeight> words;
        std::vector<std::byte> body;
        std::vector<std::uint64_t> without;
    };
    struct Answered {
        StoreAnswer answer;
        bool is_found = false;
        std::vector<std::byte> body;
    };
    static constexpr std::size_t kAnswersMax = 4;

    [[nodiscard]] Job* claim();
    void publish();
    void work();
    void do_all();
    void do_job(Job& job);

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::thread thread_;
    Mode mode_ = Mode::kAtOnce;
    RegionStore store_;  // the thread's, if there is one
    std::size_t body_bytes_max_ = 0;
    std::vector<Job> jobs_;  // a ring
    std::size_t first_ = 0, size_ = 0;
    bool is_closing_ = false;
    bool has_failed_ = false, is_out_of_memory_ = false;
    std::vector<Answered> ready_;  // the oldest first; storage of kAnswersMax
    std::size_t ready_count_ = 0;
    Answered working_;  // that the thread is at
    Answered visible_;
    bool is_visible_ = false;
    bool is_accepting_ = true;
    std::uint32_t taken_ = 0;  // since the last frame
    std::uint64_t sequence_ = 0, checksum_ = 0;
    StoreContent content_;
    RegionStoreCounts counts_;
};

}  // namespace stillmesh
