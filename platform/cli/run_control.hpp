// What somebody who looks on may do to a run (view_commands.hpp), done by the run loop between two frames: it waits
// while the run is paused, or a frame is not due at the speed that is wanted. Neither changes what the engine is given,
// so that the state hash of each frame is that of the same run undisturbed; a reset does, by what it is.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "platform/cli/session.hpp"
#include "platform/linux/process.hpp"
#include "platform/view/view_feed.hpp"

namespace stillmesh {

class RunControl {
public:
    // `feed`, `wishes` (those of ROS 2): null for none. `is_localising`: the run begins so.
    RunControl(ViewFeed* feed, const ViewControls& controls, ViewCommands* wishes = nullptr, bool is_localising = false)
        : feed_(feed), wishes_(wishes), controls_(controls) {
        standing_.is_localising = is_localising;
        if (feed_ == nullptr) return;
        feed_->commands().allow(controls);
        say();
    }

    // At the head of the loop, before a frame is fetched. True: not yet; it has waited a moment, look again.
    [[nodiscard]] bool holds() {
        if (feed_ == nullptr && wishes_ == nullptr) return false;
        take();
        if (!standing_.is_paused || steps_ > 0) return false;
        rest();
        return true;
    }
    // Behind the fetch of a frame: waits until it is due, a moment at a time. False: the frame can be tracked now.
    [[nodiscard]] bool is_early(std::int64_t time_ns) {
        if (holds()) return true;
        if (feed_ == nullptr || standing_.speed <= 0 || steps_ > 0) return false;
        const std::int64_t now_ns = monotonic_ns();
        if (!has_base_) {
            has_base_ = true;
            base_time_ns_ = time_ns;
            base_ns_ = now_ns;
        }
        const auto due_ns =
            base_ns_ + static_cast<std::int64_t>(static_cast<double>(time_ns - base_time_ns_) / standing_.speed);
        if (now_ns >= due_ns) return false;
        sleep_until_ns(due_ns < now_ns + kMoment_ns ? due_ns : now_ns + kMoment_ns);
        return true;
    }
    void frame_is_done() {
        if (steps_ > 0) --steps_;
    }
    [[nodiscard]] bool is_saving() const { return standing_.is_saving; }
    // Behind a frame: does what else was wanted of the map, and says what came of it; empty: nothing was wanted.
    [[nodiscard]] std::string carry_out(TrackingSession& session) {
        std::string said;
        if (std::exchange(wants_save_, false)) said = session.save_map();
        if (const auto only = std::exchange(localise_only_, std::nullopt)) {
            said += (said.empty() ? "" : "; ") + session.localise_only(*only);
            if (controls_.can_localise) show_localising(*only);
        }
        return said.empty() ? said : (is_by_ros_ ? "as ROS 2 asked: " : "as was asked on the page: ") + said + ".";
    }
    // Who wanted something last.
    [[nodiscard]] const char* wisher() const { return is_by_ros_ ? "by ROS 2" : "on the page"; }
    // A new map is added to.
    void map_is_new() { show_localising(false); }
    // Once for each time that it was wanted.
    [[nodiscard]] bool takes_reset() {
        const bool wants = wants_reset_;
        wants_reset_ = false;
        return wants;
    }

private:
    static constexpr std::int64_t kMoment_ns = 20'000'000;

    void show_localising(bool is_localising) {
        standing_.is_localising = is_localising;
        if (feed_ != nullptr) say();
    }
    void rest() { sleep_until_ns(monotonic_ns() + kMoment_ns); }
    void say() { feed_->commands().stand(standing_); }
    void take() {
        bool is_any = false;
        for (ViewCommands* const queue : {feed_ != nullptr ? &feed_->commands() : nullptr, wishes_}) {
            while (const auto command = queue != nullptr ? queue->take() : std::nullopt) {
                is_any = true;
                is_by_ros_ = queue == wishes_;
                obey(*command);
            }
        }
        if (is_any && feed_ != nullptr) say();
    }
    void obey(const ViewCommand& command) {
        const bool is_of_time = command.verb == ViewVerb::kPause || command.verb == ViewVerb::kResume ||
                                command.verb == ViewVerb::kStep || command.verb == ViewVerb::kSpeed;
        if (is_of_time && !controls_.can_pause) return;
        if (is_of_time) has_base_ = false;  // from here on anew
        switch (command.verb) {
            case ViewVerb::kPause: standing_.is_paused = true; break;
            case ViewVerb::kResume: standing_.is_paused = false; break;
            case ViewVerb::kStep:
                standing_.is_paused = true;
                ++steps_;
                break;
            case ViewVerb::kSpeed: standing_.speed = command.value; break;
            case ViewVerb::kSaving:
                if (controls_.can_save) standing_.is_saving = command.value != 0;
                break;
            case ViewVerb::kReset: wants_reset_ = wants_reset_ || controls_.can_reset; break;
            // What cannot be is answered by the session, with a sentence.
            case ViewVerb::kSaveMap: wants_save_ = true; break;
            case ViewVerb::kLocaliseOnly: localise_only_ = command.value != 0; break;
        }
    }

    ViewFeed* feed_;
    ViewCommands* wishes_;
    ViewControls controls_;
    ViewStanding standing_;
    std::uint32_t steps_ = 0;
    bool wants_reset_ = false, wants_save_ = false, is_by_ros_ = false;
    std::optional<bool> localise_only_;
    bool has_base_ = false;
    std::int64_t base_time_ns_ = 0, base_ns_ = 0;
};

}  // namespace stillmesh
