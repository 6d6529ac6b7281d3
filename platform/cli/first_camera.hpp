// `--camera auto`: the first of several drivers that opens a camera, which it stays from then on. Until one does, each
// opening asks them all, in order, and says what each found.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/live/live_camera.hpp"

namespace stillmesh {

class FirstLiveCamera final : public LiveCamera {
public:
    struct Candidate {
        std::string driver;  // as in a sentence: "OpenNI2"
        std::unique_ptr<LiveCamera> camera;
    };
    // At least one.
    explicit FirstLiveCamera(std::vector<Candidate> candidates);

    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return chosen().info(); }
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override { return chosen().wait(timeout_ms); }
    void close() noexcept override { chosen().close(); }

    [[nodiscard]] std::int64_t due_ns() const noexcept override { return chosen().due_ns(); }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override { return chosen().next_due_ns(); }

    [[nodiscard]] std::string message() const override { return message_; }
    [[nodiscard]] std::string silence() const override { return chosen().silence(); }
    [[nodiscard]] std::string remark() override { return chosen().remark(); }
    [[nodiscard]] std::string device() const override { return chosen().device(); }
    [[nodiscard]] std::string calibration_source() const override { return chosen().calibration_source(); }
    [[nodiscard]] std::vector<std::string> notes() const override { return chosen().notes(); }
    [[nodiscard]] std::optional<std::string> usb_place() const override {
        return has_chosen_ ? chosen().usb_place() : std::nullopt;
    }
    [[nodiscard]] LiveCounts counts() const noexcept override { return chosen().counts(); }

private:
    // The one that was opened last, or the first.
    [[nodiscard]] LiveCamera& chosen() const noexcept { return *candidates_[chosen_].camera; }

    std::vector<Candidate> candidates_;
    std::size_t chosen_ = 0;
    bool has_chosen_ = false;
    std::string message_;
};

}  // namespace stillmesh
