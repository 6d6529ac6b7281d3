#include "hal/live/half_camera.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace stillmesh::half_camera_test {
namespace {

// One frame again and again: colour is 4 x + 8 y (+ 10 a channel), depth what the test says.
class StillCamera final : public DepthCamera {
public:
    explicit StillCamera(std::size_t channels) : channels_(channels), colour(std::size_t{5} * 4 * channels), depth(20) {
        info_.model = {5, 4, 100, 90, 2.0, 1.5, 0.1};
        info_.depth_units_per_m = 1000;
        for (std::size_t i = 0; i < colour.size(); ++i) {
            const std::size_t pixel = i / channels;
            colour[i] = static_cast<std::uint8_t>(4 * (pixel % 5) + 8 * (pixel / 5) + 10 * (i % channels));
        }
    }
    Status open() noexcept override { return Status::kOk; }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame& frame) noexcept override {
        frame.time_ns = 7;
        frame.depth_time_ns = 9;
        frame.format = channels_ == 1 ? PixelFormat::kGrey8 : PixelFormat::kRgb8;
        frame.colour = {colour.data(), 5, 4, 5 * channels_};
        frame.depth = {depth.data(), depth_width, 4, depth_width};
        frame.depth_units_per_m = 1000;
        return status;
    }
    Status wait(std::uint32_t) noexcept override { return Status::kTimedOut; }

    std::size_t channels_;
    CameraInfo info_;
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    std::uint32_t depth_width = 5;
    Status status = Status::kOk;
};

// Promise: what a pixel of the half image shows is what its four pixels showed: the lens sees their middle under the
// same angle, and no coefficient changes.
TEST(HalfCamera, TheLensFollows) {
    const CameraModel whole{5, 4, 100, 90, 2.0, 1.5, 0.1};
    const CameraModel half = halved(whole);
    EXPECT_EQ(half.width, 2U);
    EXPECT_EQ(half.height, 2U);
    EXPECT_EQ(half.k1, 0.1);
    for (int x = 0; x < 2; ++x) {
        EXPECT_NEAR((x - half.cx) / half.fx, (2 * x + 0.5 - whole.cx) / whole.fx, 1e-12);
        EXPECT_NEAR((x - half.cy) / half.fy, (2 * x + 0.5 - whole.cy) / whole.fy, 1e-12);
    }
}

// Promise: colour is the mean of four pixels in every channel; depth is one of the four, no mean, and none only where
// all four have none.
TEST(HalfCamera, HalvesBothImages) {
    for (const std::size_t channels : {std::size_t{1}, std::size_t{3}}) {
        StillCamera source(channels);
        source.depth = {1000, 1010, 0, 0, 9,  //
                        5000, 5010, 0, 7, 9,  //
                        0,    0,    1, 2, 9,  //
                        0,    0,    3, 0, 9};
        HalfCamera camera(source);
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk);
        EXPECT_EQ(frame.time_ns, 7);
        EXPECT_EQ(frame.depth_time_ns, 9);
        for (std::uint32_t y = 0; y < 2; ++y) {
            for (std::uint32_t x = 0; x < 2; ++x) {
                for (std::size_t c = 0; c < channels; ++c) {
                    EXPECT_EQ(frame.colour.row(y)[x * channels + c], 8 * x + 16 * y + 6 + 10 * c);
                }
            }
        }
        EXPECT_EQ(frame.depth.row(0)[0], 1010);
        EXPECT_EQ(frame.depth.row(0)[1], 7);
        EXPECT_EQ(frame.depth.row(1)[0], 0);
        EXPECT_EQ(frame.depth.row(1)[1], 2);
    }
}

// Promise: what the source says is passed on, and a frame of another size is corrupt.
TEST(HalfCamera, PassesOn) {
    StillCamera source(1);
    HalfCamera camera(source);
    Frame frame;
    source.status = Status::kEnd;
    EXPECT_EQ(camera.poll(frame), Status::kEnd);
    EXPECT_EQ(camera.wait(1), Status::kTimedOut);
    source.status = Status::kOk;
    source.depth_width = 3;
    EXPECT_EQ(camera.poll(frame), Status::kCorrupt);
    EXPECT_EQ(camera.open(), Status::kOk);
    EXPECT_EQ(camera.info().model, halved(source.info().model));
    EXPECT_EQ(camera.info().depth_units_per_m, 1000);
}

}  // namespace
}  // namespace stillmesh::half_camera_test
