// Waiting for a camera: what the one who waits is told.
#include "platform/cli/live_camera.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace stillmesh::live_camera_test {
namespace {

// Fails to open for a reason after the other, then opens.
class LateCamera final : public DepthCamera {
public:
    explicit LateCamera(std::vector<std::string> reasons) : reasons_(std::move(reasons)) {}
    [[nodiscard]] Status open() noexcept override {
        return tries_++ < reasons_.size() ? Status::kUnavailable : Status::kOk;
    }
    [[nodiscard]] std::string reason() const { return reasons_[tries_ - 1]; }

private:
    std::vector<std::string> reasons_;
    std::size_t tries_ = 0;
};

[[nodiscard]] std::size_t times_in(const std::string& text, const std::string& word) {
    std::size_t times = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++times;
    return times;
}

// Promise: who waits for a camera hears of each reason why it does not open, once, though reasons take turns; and that
// it is waited for.
TEST(OpenLiveCamera, TellsEachReasonOnce) {
    LateCamera camera({"none is plugged in.", "none is plugged in.", "it may not be opened.", "none is plugged in."});
    std::string message;
    ::testing::internal::CaptureStderr();
    const Status status = open_live_camera(
        camera, [&] { return camera.reason(); }, true, message);
    const std::string said = ::testing::internal::GetCapturedStderr();
    EXPECT_EQ(status, Status::kOk);
    EXPECT_EQ(times_in(said, "none is plugged in. Waiting for one"), 1U) << said;
    EXPECT_EQ(times_in(said, "it may not be opened. Waiting for one"), 1U) << said;
    EXPECT_EQ(times_in(said, "\n"), 2U) << said;
}

}  // namespace
}  // namespace stillmesh::live_camera_test
