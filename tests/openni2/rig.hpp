// The test driver's cameras, from the test's side: makes the shared block, says what is plugged in, knows the frames.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/openni2/driver/control.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::test {

// OpenNI2's compression of depth is not quite without loss: with some images, and always the same, it changes two
// pixels.
inline constexpr long kDepthPixelsLost = 4;

class CameraRig {
public:
    explicit CameraRig(const std::string& frames_file) {
        const std::string name = folder_.path("control");
        const int file = ::open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
        EXPECT_GE(file, 0);
        EXPECT_EQ(::ftruncate(file, sizeof(Control)), 0);
        control_ = static_cast<Control*>(::mmap(nullptr, sizeof(Control), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0));
        ::close(file);
        control_->magic = kControlMagic;
        std::snprintf(control_->frames_file, sizeof(control_->frames_file), "%s", frames_file.c_str());
        load(frames_file);
        for (CameraControl& camera : control_->cameras) {
            camera.modes = head().width >= 640 ? 3 : 2;
            camera.can_register = camera.can_unmirror = 1;
            camera.depth_lag_us = 1500;
            camera.period_us = 33'333;
            camera.auto_exposure = 1;
        }
        ::setenv("STILLMESH_TEST_CAMERA", name.c_str(), 1);
    }
    ~CameraRig() { ::munmap(control_, sizeof(Control)); }
    CameraRig(const CameraRig&) = delete;
    CameraRig& operator=(const CameraRig&) = delete;

    [[nodiscard]] CameraControl& camera(std::uint32_t i = 0) { return control_->cameras[i]; }
    [[nodiscard]] const FramesHead& head() const { return *reinterpret_cast<const FramesHead*>(frames_.data()); }
    [[nodiscard]] const FramesHead::Pose& pose(std::uint32_t index) const {
        return *reinterpret_cast<const FramesHead::Pose*>(at(index));
    }
    [[nodiscard]] const std::uint8_t* grey(std::uint32_t index) const { return at(index) + sizeof(FramesHead::Pose); }
    [[nodiscard]] const std::uint16_t* depth_mm(std::uint32_t index) const {
        return reinterpret_cast<const std::uint16_t*>(grey(index) + pixels());
    }
    [[nodiscard]] const std::uint16_t* raw_depth_mm(std::uint32_t index) const { return depth_mm(index) + pixels(); }
    [[nodiscard]] std::size_t pixels() const { return std::size_t{head().width} * head().height; }
    // What the camera showed at a stamp of its log; -1: nothing.
    [[nodiscard]] int shown_at(std::int64_t stamp_us, std::uint32_t i = 0) {
        for (std::uint32_t n = camera(i).log_count; n-- > 0;) {
            if (camera(i).log[n].stamp_us == stamp_us) return static_cast<int>(camera(i).log[n].index);
        }
        return -1;
    }

private:
    void load(const std::string& file) {
        std::FILE* const stream = std::fopen(file.c_str(), "rb");
        ASSERT_NE(stream, nullptr) << file << ": made by render_frames; run through ctest";
        struct stat about {};
        ASSERT_EQ(::fstat(::fileno(stream), &about), 0);
        frames_.resize(static_cast<std::size_t>(about.st_size));
        ASSERT_EQ(std::fread(frames_.data(), 1, frames_.size(), stream), frames_.size());
        ASSERT_EQ(std::fclose(stream), 0);
        ASSERT_EQ(head().magic, kFramesMagic);
    }
    [[nodiscard]] const std::uint8_t* at(std::uint32_t index) const {
        return frames_.data() + sizeof(FramesHead) + index * head().frame_bytes();
    }

    TemporaryFolder folder_;
    Control* control_ = nullptr;
    std::vector<std::uint8_t> frames_;
};

}  // namespace stillmesh::test
