// Keeps a live camera alive: whoever polls sees frames or silence, never a dead device. Unplugged, it is opened again
// as soon as it is back; silent for a second (or frozen, or with images of another size), it is reset, closed and
// opened again, with back-off, for as long as it takes. Frames pass a FrameGuard: their form is the camera's, their
// time goes on. Only silence that somebody listened to is a stall: who polls late (a busy machine, a stopped process)
// does not reset a camera that is well. What happens is told as news, sentences for the user. Cost: a few microseconds
// per poll. While a device is opened, poll takes as long as the source's open() does.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_guard.hpp"
#include "hal/live/frame_times.hpp"

namespace stillmesh {

enum class CameraLife : std::uint8_t {
    kClosed,
    kStreaming,
    kSilent,  // open, and no frame came for a while
    kAway,    // gone: opened again and again
};
[[nodiscard]] constexpr const char* camera_life_name(CameraLife life) noexcept {
    constexpr const char* kNames[] = {"closed", "streaming", "silent", "away"};
    return kNames[static_cast<std::uint32_t>(life)];
}

struct ReconnectOptions {
    std::function<std::int64_t()> now_ns;
    std::function<void(std::int64_t)> sleep_until_ns;
    std::function<std::string()> source_message;  // why the last open or poll failed
    std::function<std::string()> silence;         // what is known of a silence, such as which stream; may be empty
    std::function<std::string()> remark;          // what the source has to say otherwise, once each; may be empty
    std::function<bool()> reset;                  // of a stalled device, closed by then; may be empty
    FrameTimes* times = nullptr;                  // the source's, if it has them
    bool is_live = true;                          // frames come by the host's clock
    std::int64_t stall_ns = 1'000'000'000;        // silence that counts as a stall
    std::int64_t stall_max_ns = 8'000'000'000;    // back-off: so long at most between two resets
    std::int64_t retry_first_ns = 100'000'000;    // until an unplugged device is looked for
    std::int64_t retry_max_ns = 500'000'000;  // and between two looks at most: part of the time until it tracks again
};

struct LifeCounts {
    std::uint64_t unplugs = 0;
    std::uint64_t stalls = 0;
    std::uint64_t returns = 0;    // frames again after either
    std::uint64_t bad_polls = 0;  // frames that the camera itself called corrupt
    std::int64_t away_ns = 0;     // without frames, all together
    std::int64_t away_longest_ns = 0;
    std::int64_t reopen_longest_ns = 0;  // the slowest open(), failures included
};

class ReconnectingCamera final : public DepthCamera, public FrameTimes {
public:
    static constexpr std::size_t kNewsMax = 64;  // kept until they are taken; more are counted only

    // `source` outlives this camera and is nobody else's.
    ReconnectingCamera(DepthCamera& source, ReconnectOptions options);

    // As the source's: the first time there is no waiting.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return info_; }
    // kOk: a frame; kTimedOut: none now, whatever the reason; kEnd: the source has ended.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override;
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;
    [[nodiscard]] std::uint64_t dropped() noexcept override;

    [[nodiscard]] CameraLife life() const noexcept { return life_; }
    [[nodiscard]] const LifeCounts& counts() const noexcept { return counts_; }
    [[nodiscard]] const GuardCounts& guard_counts() const noexcept { return guard_.counts(); }
    // The oldest sentence nobody has taken yet; empty: none.
    [[nodiscard]] std::string take_news();

private:
    [[nodiscard]] bool is_same_camera() const noexcept;
    void open_again(std::int64_t now_ns);
    void lost(std::int64_t now_ns);
    void stalled(std::int64_t now_ns, const char* why);
    void delivered(std::int64_t now_ns);
    void tell(std::string sentence);

    DepthCamera& source_;
    ReconnectOptions options_;
    CameraInfo info_;
    FrameGuard guard_;
    CameraLife life_ = CameraLife::kClosed;
    bool is_open_ = false;             // the source
    bool is_disturbed_ = false;        // since the last frame
    std::int64_t last_frame_ns_ = 0;   // when one came
    std::int64_t quiet_since_ns_ = 0;  // frame or opening, whichever was last; later by what nobody asked for frames
    std::int64_t last_poll_ns_ = 0;
    std::int64_t stall_after_ns_ = 0;
    std::int64_t retry_ns_ = 0;
    std::int64_t next_try_ns_ = 0;
    std::uint32_t wrong_in_a_row_ = 0;
    std::string last_refusal_;  // told once
    std::vector<std::string> news_;
    LifeCounts counts_;
};

}  // namespace stillmesh
