// What somebody who may steer wants of the run, from the threads of the page to the engine's: a queue of fixed size.
// The run loop takes what is in it between two frames; a request never touches the run itself. Nobody asks: one atomic
// load a frame. Full: the request is refused, nobody waits.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string_view>

namespace stillmesh {

enum class ViewVerb : std::uint8_t {
    kPause,  // of a recording or a simulation; no clock is waiting for it
    kResume,
    kStep,          // one frame, then pause
    kSpeed,         // `value` times the recording's; 0: as fast as it can
    kSaving,        // `value` 1: the trajectory is written again, 0: no more
    kReset,         // another map begins here
    kSaveMap,       // it is written where maps are written to, and so are grid and cloud
    kLocaliseOnly,  // `value` 1: the map stays as it is, 0: it is added to
};
struct ViewCommand {
    ViewVerb verb = ViewVerb::kPause;
    double value = 0;
};
inline constexpr double kViewSpeedMax = 16;

// "pause", "resume", "step", "speed=0.5", "saving=1", "reset", "save_map", "localise=1"; empty: none of these.
[[nodiscard]] std::optional<ViewCommand> parse_view_command(std::string_view text);

// What can be asked of this run, and how it stands: shown by the page.
struct ViewControls {
    bool can_pause = false;  // and step, and speed
    bool can_save = false;   // there is a trajectory to be written
    bool can_reset = false;
    bool can_save_map = false;  // or grid, or cloud: there is a place for it
    bool can_localise = false;  // alone, and map again
};
struct ViewStanding {
    bool is_paused = false;
    bool is_saving = true;
    double speed = 0;
    bool is_localising = false;  // the map stays as it is
};

class ViewCommands {
public:
    static constexpr std::size_t kCommandsMax = 16;

    // Any thread. False: full.
    [[nodiscard]] bool put(const ViewCommand& command) {
        const std::lock_guard lock(mutex_);
        if (count_.load(std::memory_order_relaxed) == kCommandsMax) return false;
        commands_[(first_ + count_.load(std::memory_order_relaxed)) % kCommandsMax] = command;
        count_.fetch_add(1, std::memory_order_release);
        return true;
    }
    // The engine's thread: the oldest; empty: none, or somebody is just putting one.
    [[nodiscard]] std::optional<ViewCommand> take() noexcept {
        if (count_.load(std::memory_order_acquire) == 0) return std::nullopt;
        const std::unique_lock lock(mutex_, std::try_to_lock);
        if (!lock.owns_lock()) return std::nullopt;
        const ViewCommand command = commands_[first_];
        first_ = (first_ + 1) % kCommandsMax;
        count_.fetch_sub(1, std::memory_order_relaxed);
        return command;
    }

    // What can be asked: nothing until this is said, when the run begins.
    void allow(const ViewControls& controls) noexcept {
        can_pause_.store(controls.can_pause);
        can_save_.store(controls.can_save);
        can_reset_.store(controls.can_reset);
        can_save_map_.store(controls.can_save_map);
        can_localise_.store(controls.can_localise);
        changes_.fetch_add(1);
    }
    [[nodiscard]] ViewControls controls() const noexcept {
        return {can_pause_.load(), can_save_.load(), can_reset_.load(), can_save_map_.load(), can_localise_.load()};
    }
    // How it stands, said by the engine's thread.
    void stand(const ViewStanding& standing) noexcept {
        is_paused_.store(standing.is_paused);
        is_saving_.store(standing.is_saving);
        speed_.store(standing.speed);
        is_localising_.store(standing.is_localising);
        changes_.fetch_add(1);
    }
    [[nodiscard]] ViewStanding standing() const noexcept {
        return {is_paused_.load(), is_saving_.load(), speed_.load(), is_localising_.load()};
    }
    [[nodiscard]] std::uint64_t changes() const noexcept { return changes_.load(); }

private:
    std::mutex mutex_;
    std::array<ViewCommand, kCommandsMax> commands_{};
    std::size_t first_ = 0;
    std::atomic<std::size_t> count_{0};
    std::atomic<bool> can_pause_{false}, can_save_{false}, can_reset_{false}, can_save_map_{false},
        can_localise_{false};
    std::atomic<bool> is_paused_{false}, is_saving_{true}, is_localising_{false};
    std::atomic<double> speed_{0};
    std::atomic<std::uint64_t> changes_{1};
};

}  // namespace stillmesh
