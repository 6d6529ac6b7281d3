// `--camera auto`: the first of several drivers that opens a camera, which it stays from then on. Until one does, each
// opening asks them all, in order, and says what each found.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "platform/cli/live_camera.hpp"

namespace stillmesh {

class FirstLiveCamera final : public LiveCamera, private DepthCamera, private FrameTimes {
public:
    struct Candidate {
        std::string driver;  // as in a sentence: "OpenNI2"
        std::unique_ptr<LiveCamera> camera;
    };
    // At least one.
    explicit FirstLiveCamera(std::vector<Candidate> candidates);

    DepthCamera& camera() override { return *this; }
    FrameTimes& times() override { return *this; }
    std::string message() const override { return message_; }
    std::string silence() const override { return has_chosen_ ? chosen().silence() : std::string(); }
    bool is_file() const override { return false; }
    std::string device() const override { return chosen().device(); }
    std::string calibration_source() const override { return chosen().calibration_source(); }
    std::vector<std::string> notes() const override { return chosen().notes(); }
    std::uint64_t frames_expected() const override { return 0; }
    void account(CameraRecord& record) const override { chosen().account(record); }
    bool reset() override { return has_chosen_ && chosen().reset(); }

private:
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return chosen().camera().info(); }
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override { return chosen().camera().wait(timeout_ms); }
    void close() noexcept override { chosen().camera().close(); }
    [[nodiscard]] std::int64_t due_ns() const noexcept override { return chosen().times().due_ns(); }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override { return chosen().times().next_due_ns(); }
    [[nodiscard]] std::uint64_t dropped() noexcept override { return chosen().times().dropped(); }

    // The one that was opened last, or the first.
    [[nodiscard]] LiveCamera& chosen() const noexcept { return *candidates_[chosen_].camera; }

    std::vector<Candidate> candidates_;
    std::size_t chosen_ = 0;
    bool has_chosen_ = false;
    std::string message_;
};

}  // namespace stillmesh
