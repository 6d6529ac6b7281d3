// `--camera auto`: who is asked, who is taken, what is said.
#include "platform/cli/first_camera.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace stillmesh::first_camera_test {
namespace {

class FakeCamera final : public LiveCamera {
public:
    explicit FakeCamera(std::string name) : name_(std::move(name)) {}

    Status answer = Status::kUnavailable;
    int openings = 0, closings = 0;

    Status open() noexcept override {
        ++openings;
        return answer;
    }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame&) noexcept override { return answer; }
    void close() noexcept override { ++closings; }
    std::string message() const override { return name_ + " has none."; }
    std::string device() const override { return name_; }
    std::string calibration_source() const override { return {}; }
    std::optional<std::string> usb_place() const override { return name_; }
    LiveCounts counts() const noexcept override {
        LiveCounts counts;
        counts.pairing.pairs = 7;
        return counts;
    }

private:
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
    EXPECT_EQ(rig.camera->open(), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "A: one has none.\n  B: two has none.");
    EXPECT_EQ(rig.camera->usb_place(), std::nullopt) << "whose plug would be pulled?";
    rig.first->answer = Status::kInvalid;
    EXPECT_EQ(rig.camera->open(), Status::kInvalid);
    EXPECT_EQ(rig.first->closings, 2);
}

// Promise: the first that opens is the camera from then on, also when it is away and another comes.
TEST(FirstCamera, StaysWithTheFirst) {
    Rig rig;
    rig.second->answer = Status::kOk;
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    EXPECT_EQ(rig.camera->device(), "two");
    EXPECT_EQ(rig.camera->counts().pairing.pairs, 7U);
    EXPECT_EQ(rig.camera->usb_place(), "two");
    rig.first->answer = Status::kOk;
    rig.second->answer = Status::kUnavailable;
    Frame frame;
    EXPECT_EQ(rig.camera->poll(frame), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "two has none.");
    rig.camera->close();
    EXPECT_EQ(rig.camera->open(), Status::kUnavailable);
    EXPECT_EQ(rig.first->openings, 1);
    EXPECT_EQ(rig.camera->device(), "two");
}

}  // namespace
}  // namespace stillmesh::first_camera_test
