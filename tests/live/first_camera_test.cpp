// `--camera auto`: who is asked, who is taken, what is said.
#include "platform/cli/first_camera.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace stillmesh {
namespace {

class FakeCamera final : public LiveCamera, private DepthCamera, private FrameTimes {
public:
    explicit FakeCamera(std::string name) : name_(std::move(name)) {}

    Status answer = Status::kUnavailable;
    int openings = 0, closings = 0;

    DepthCamera& camera() override { return *this; }
    FrameTimes& times() override { return *this; }
    std::string message() const override { return name_ + " has none."; }
    bool is_file() const override { return false; }
    std::string device() const override { return name_; }
    std::string calibration_source() const override { return {}; }
    std::vector<std::string> notes() const override { return {}; }
    std::uint64_t frames_expected() const override { return 0; }
    void account(CameraRecord& record) const override { record.pairs = 7; }
    bool reset() override { return true; }

private:
    Status open() noexcept override {
        ++openings;
        return answer;
    }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame&) noexcept override { return answer; }
    Status wait(std::uint32_t) noexcept override { return Status::kOk; }
    void close() noexcept override { ++closings; }

    std::string name_;
    CameraInfo info_;
};

struct Rig {
    FakeCamera* first;
    FakeCamera* second;
    std::unique_ptr<FirstLiveCamera> camera;

    Rig() {
        auto a = std::make_unique<FakeCamera>("one"), b = std::make_unique<FakeCamera>("two");
        first = a.get();
        second = b.get();
        std::vector<FirstLiveCamera::Candidate> candidates;
        candidates.push_back({"A", std::move(a)});
        candidates.push_back({"B", std::move(b)});
        camera = std::make_unique<FirstLiveCamera>(std::move(candidates));
    }
};

// Promise: where none opens, what each found is said; one that may come is waited for, unless another is broken.
TEST(FirstCamera, SaysWhatEachFound) {
    Rig rig;
    EXPECT_EQ(rig.camera->camera().open(), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "A: one has none.\n  B: two has none.");
    EXPECT_FALSE(rig.camera->reset());
    rig.first->answer = Status::kInvalid;
    EXPECT_EQ(rig.camera->camera().open(), Status::kInvalid);
    EXPECT_EQ(rig.first->closings, 2);
}

// Promise: the first that opens is the camera from then on, also when it is away and another comes.
TEST(FirstCamera, StaysWithTheFirst) {
    Rig rig;
    rig.second->answer = Status::kOk;
    ASSERT_EQ(rig.camera->camera().open(), Status::kOk);
    EXPECT_EQ(rig.camera->device(), "two");
    CameraRecord record;
    rig.camera->account(record);
    EXPECT_EQ(record.pairs, 7U);
    EXPECT_TRUE(rig.camera->reset());
    rig.first->answer = Status::kOk;
    rig.second->answer = Status::kUnavailable;
    Frame frame;
    EXPECT_EQ(rig.camera->camera().poll(frame), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "two has none.");
    rig.camera->camera().close();
    EXPECT_EQ(rig.camera->camera().open(), Status::kUnavailable);
    EXPECT_EQ(rig.first->openings, 1);
    EXPECT_EQ(rig.camera->device(), "two");
}

}  // namespace
}  // namespace stillmesh
