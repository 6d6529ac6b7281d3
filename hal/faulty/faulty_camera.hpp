// Any camera, with faults injected from a seed: what cables, drivers, clocks and lenses do, one at a time, each for a
// random while, with good frames between them. The same seed and the same calls on the same clock give the same faults.
// Limit: one fault at a time. Cost: a copy of each frame. Memory: three frames, taken in open().
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_times.hpp"

namespace stillmesh {

enum class Fault : std::uint8_t {
    kAbsent,      // it cannot be opened for a while
    kUnplugged,   // gone in the middle of it, and absent for a while
    kTimeout,     // no frames, until some time has passed or it is opened again
    kDuplicate,   // a frame once more, with its time
    kDropped,     // frames that do not come
    kOutOfOrder,  // an older frame behind a newer one
    kBackwards,   // its clock steps back
    kJump,        // its clock jumps forward
    kWrap,        // its clock starts at zero
    kFrozen,      // the same image with new times
    kBlack,
    kSaturated,
    kZeroDepth,
    kSaturatedDepth,
    kRandomPixels,
    kWrongSize,
    kTorn,               // the upper part of one image, the lower part of another
    kDifferentInstants,  // depth of an earlier frame
};
inline constexpr std::uint32_t kFaults = 18;
[[nodiscard]] const char* fault_name(Fault fault) noexcept;

struct FaultOptions {
    std::uint64_t seed = 1;
    double good_frames_mean = 60;                // between two faults
    std::uint32_t faults = (1U << kFaults) - 1;  // a bit for each kind that may happen
    std::int64_t timeout_max_ns = 2'500'000'000;
    std::uint32_t absent_opens_max = 4;  // openings that fail, at most
    bool is_absent_at_start = false;
    bool is_recording = false;  // the source would begin anew if it were opened again: it goes on, some frames later
    std::function<std::int64_t()> now_ns;
    std::function<void(std::int64_t)> sleep_until_ns;
    FrameTimes* times = nullptr;  // the source's, if it has them
};

class FaultyCamera final : public DepthCamera, public FrameTimes {
public:
    // `source` outlives this camera.
    FaultyCamera(DepthCamera& source, FaultOptions options);

    // As the source's; kUnavailable while it is absent.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return source_.info(); }
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override;
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;
    [[nodiscard]] std::uint64_t dropped() noexcept override;

    // How often each kind has begun.
    [[nodiscard]] std::uint64_t count(Fault fault) const noexcept { return counts_[static_cast<std::uint32_t>(fault)]; }
    // Whether a fault is under way; a clock that has been moved is not.
    [[nodiscard]] bool is_faulty() const noexcept { return has_fault_ || absent_opens_ > 0; }
    // "2 black, 1 torn".
    [[nodiscard]] std::string summary() const;

private:
    struct Image {
        Frame frame;
        std::vector<std::uint8_t> colour;
        std::vector<std::uint16_t> depth;
    };
    [[nodiscard]] std::uint64_t random() noexcept;
    [[nodiscard]] std::uint32_t random_below(std::uint32_t n) noexcept {
        return static_cast<std::uint32_t>(random() % n);
    }
    void begin_fault();
    [[nodiscard]] Status spoil(Frame& frame);
    static void copy(const Frame& frame, Image& image);
    static void give(Image& image, Frame& frame);

    DepthCamera& source_;
    FaultOptions options_;
    std::uint64_t state_;
    bool is_open_ = false;
    bool is_source_open_ = false;
    bool has_fault_ = false;
    Fault fault_ = Fault::kBlack;
    std::uint32_t frames_left_ = 0;  // of the fault, or until the next
    std::uint32_t absent_opens_ = 0;
    std::int64_t silent_until_ns_ = 0;
    std::int64_t clock_shift_ns_ = 0;
    Image now_, before_, made_;
    bool has_before_ = false;
    std::array<std::uint64_t, kFaults> counts_{};
};

}  // namespace stillmesh
