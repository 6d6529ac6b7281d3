// Depth that is not aligned to colour, from a driver of ROS 2: where it is said to be, with Fast DDS as the driver.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

#include "hal/live/depth_registration.hpp"
#include "hal/ros2/ros2_camera.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/program.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::depth_place_test {
namespace {

using test::within;
namespace fast = test::fast;

constexpr std::int64_t kPatience_ms = 30'000;
constexpr const char* kColourFrame = "camera_color_optical_frame";
constexpr const char* kDepthFrame = "camera_depth_optical_frame";

[[nodiscard]] CameraModel lens(std::uint32_t width, std::uint32_t height, double focal_px) {
    CameraModel out;
    out.width = width;
    out.height = height;
    out.fx = out.fy = focal_px;
    out.cx = (width - 1) / 2.0;
    out.cy = (height - 1) / 2.0;
    return out;
}
const CameraModel kColourLens = lens(160, 120, 150);

// A wall 3 m away, and before its left half another, 1 m away; mm.
[[nodiscard]] std::vector<std::uint16_t> step_of(const CameraModel& model) {
    std::vector<std::uint16_t> depth(std::size_t{model.width} * model.height);
    for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = i % model.width < model.width / 2 ? 1000 : 3000;
    return depth;
}

struct DriverOptions {
    CameraModel depth = kColourLens;
    const char* depth_frame = kDepthFrame;
    bool has_depth_info = true;
    const char* frames = "/tf_static";
    int images_before_depth_info = 0;
    CameraModel told_of_depth = depth;
};

class Driver {
public:
    explicit Driver(const DriverOptions& options)
        : colour_(node_, "/camera/color/image_raw", {.is_reliable = false, .depth = 2}),
          depth_(node_, "/camera/depth/image_rect_raw", {.is_reliable = false, .depth = 2}),
          info_(node_, "/camera/color/camera_info", {.is_reliable = false, .depth = 2}),
          depth_info_(node_, options.has_depth_info ? "/camera/depth/camera_info" : "/elsewhere", {.depth = 2}),
          frames_(node_, options.frames, {.is_latched = true, .depth = 1}) {
        // As the driver of a RealSense has them: bodies look along x, optical frames along z.
        constexpr std::array<double, 4> kOptical = {-0.5, 0.5, -0.5, 0.5}, kStraight = {0, 0, 0, 1};
        EXPECT_TRUE(frames_.write({{{{.frame_id = "camera_link"}, "camera_depth_frame", {{0, 0, 0}, kStraight}},
                                    {{.frame_id = "camera_depth_frame"}, kDepthFrame, {{0, 0, 0}, kOptical}},
                                    {{.frame_id = "camera_link"}, "camera_color_frame", {{0.002, 0.1, 0}, kStraight}},
                                    {{.frame_id = "camera_color_frame"}, kColourFrame, {{0, 0, 0}, kOptical}}}}));
        thread_ = std::jthread([this, options](const std::stop_token& stop) { publish(options, stop); });
    }

private:
    [[nodiscard]] static fast::CameraInfo info_of(const CameraModel& model, const fast::Header& header) {
        fast::CameraInfo info;
        info.header = header;
        info.width = model.width;
        info.height = model.height;
        info.distortion_model = "plumb_bob";
        info.d = {0, 0, 0, 0, 0};
        info.k = {model.fx, 0, model.cx, 0, model.fy, model.cy, 0, 0, 1};
        return info;
    }
    // Of rectified images: the lens is P; K and D are of those that the distortion was taken out of.
    [[nodiscard]] static fast::CameraInfo rectified_info_of(const CameraModel& model, const fast::Header& header) {
        fast::CameraInfo info = info_of(model, header);
        info.d = {0.1, -0.2, 0.001, -0.002, 0.05};
        info.k[0] += 20;
        info.p = {model.fx, 0, model.cx, 0, 0, model.fy, model.cy, 0, 0, 0, 1, 0};
        return info;
    }
    void publish(const DriverOptions& options, const std::stop_token& stop) {
        const std::vector<std::uint16_t> step = step_of(options.depth);
        for (std::int64_t i = 0; !stop.stop_requested(); ++i) {
            const std::int64_t time_ns = 1'700'000'000'000'000'000 + i * 33'333'333;
            const fast::Header header{static_cast<std::int32_t>(time_ns / 1'000'000'000),
                                      static_cast<std::uint32_t>(time_ns % 1'000'000'000), kColourFrame};
            const fast::Header of_depth{header.sec, header.nanosec, options.depth_frame};
            fast::Image colour{header, kColourLens.height, kColourLens.width, "mono8", 0, kColourLens.width, {}};
            colour.data.resize(std::size_t{kColourLens.width} * kColourLens.height);
            fast::Image depth{of_depth, options.depth.height, options.depth.width, "16UC1", 0, 2 * options.depth.width,
                              {}};
            depth.data.resize(2 * step.size());
            std::memcpy(depth.data.data(), step.data(), depth.data.size());
            const bool is_sent = colour_.write(colour) && depth_.write(depth) &&
                                 info_.write(info_of(kColourLens, header)) &&
                                 (i < options.images_before_depth_info ||
                                  depth_info_.write(rectified_info_of(options.told_of_depth, of_depth)));
            static_cast<void>(is_sent);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
    }

    fast::Node node_;
    fast::Node::Writer<fast::Image> colour_, depth_;
    fast::Node::Writer<fast::CameraInfo> info_, depth_info_;
    fast::Node::Writer<fast::Tf> frames_;
    std::jthread thread_;
};

[[nodiscard]] Ros2Options unaligned() {
    Ros2Options options;
    options.depth = "/camera/depth/image_rect_raw";
    return options;
}

[[nodiscard]] Status open_patiently(Ros2Camera& camera) {
    Status status = Status::kUnavailable;
    static_cast<void>(within(kPatience_ms, [&] { return (status = camera.open()) != Status::kUnavailable; }));
    return status;
}

// The next frame's depth is what registration by these numbers makes of the step, and not the step as it was sent.
void expect_registered(Ros2Camera& camera, const CameraModel& depth, const RigidTransform& colour_from_depth) {
    DepthRegistration registration(depth, kColourLens, colour_from_depth, 1000);
    const std::vector<std::uint16_t> sent = step_of(depth);
    std::vector<std::uint16_t> expected(std::size_t{kColourLens.width} * kColourLens.height);
    registration.reproject({sent.data(), depth.width, depth.height, depth.width}, expected.data());
    EXPECT_GT(std::count_if(expected.begin(), expected.end(), [](std::uint16_t z) { return z > 2900; }), 2000);
    Frame frame;
    ASSERT_TRUE(
        within(kPatience_ms, [&] { return camera.wait(100) == Status::kOk && camera.poll(frame) == Status::kOk; }));
    ASSERT_EQ(frame.depth.width, kColourLens.width);
    ASSERT_EQ(frame.depth.height, kColourLens.height);
    std::size_t wrong = 0;
    for (std::uint32_t y = 0; y < kColourLens.height; ++y) {
        for (std::uint32_t x = 0; x < kColourLens.width; ++x) {
            wrong += frame.depth.row(y)[x] != expected[std::size_t{y} * kColourLens.width + x] ? 1U : 0U;
        }
    }
    EXPECT_EQ(wrong, 0U);
}

// Promise: depth of another size, field of view and place than colour's is registered by CameraInfo beside its topic
// (P, of images called rectified) and by the transforms on /tf_static, through the bodies' frames into the optical
// ones, or on that of a namespace that depth's topic is in; and that is said.
TEST(Ros2DepthPlace, IsRegisteredByFrames) {
    const CameraModel depth = lens(212, 120, 110);
    for (const std::string frames : {"/tf_static", "/camera/tf_static", "/camera/depth/tf_static"}) {
        const Driver driver({.depth = depth, .frames = frames.c_str()});
        Ros2Camera camera(unaligned());
        ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
        ASSERT_EQ(camera.notes().size(), 1U);
        EXPECT_NE(camera.notes()[0].find("/camera/depth/camera_info and " + frames + "): registered"),
                  std::string::npos)
            << camera.notes()[0];
        // The colour camera stands 2 mm ahead and 100 mm to the left.
        expect_registered(camera, depth, {{0, 0, 0, 1}, {0.1, 0, -0.002}});
    }
}

// Promise: so is depth of colour's size, which would be tracked wrongly else; and depth of colour's view in larger
// pixels is brought to its size.
TEST(Ros2DepthPlace, IsLookedForAtTheSameSize) {
    for (const CameraModel& depth : {lens(160, 120, 110), lens(80, 60, 75)}) {
        const Driver driver({.depth = depth});
        Ros2Camera camera(unaligned());
        ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
        const bool is_same_view = depth.width == 80;
        expect_registered(camera, depth, {{0, 0, 0, 1}, {is_same_view ? 0 : 0.1, 0, is_same_view ? 0 : -0.002}});
    }
}

// Promise: a CameraInfo of depth that somebody publishes is waited for, however late its first message comes: depth is
// not taken for colour's view meanwhile.
TEST(Ros2DepthPlace, ALateCameraInfoIsWaitedFor) {
    const CameraModel depth = lens(160, 120, 110);
    const Driver driver({.depth = depth, .images_before_depth_info = 300});
    Ros2Options quick = unaligned();
    quick.open_max_ms = 700;
    Ros2Camera camera(quick);
    const std::string words = "nothing comes on /camera/depth/camera_info, which says what camera depth is of";
    EXPECT_TRUE(within(kPatience_ms, [&] {
        return camera.open() == Status::kUnavailable && camera.message().find(words) != std::string::npos;
    })) << camera.message();
    ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    expect_registered(camera, depth, {{0, 0, 0, 1}, {0.1, 0, -0.002}});
}

// Promise: images of one frame are of one view, whatever else is published, and so are those of one camera; where no
// CameraInfo tells, depth of colour's size is taken for it, which is said.
TEST(Ros2DepthPlace, AlignedDepthStaysAsItIs) {
    struct Case {
        DriverOptions driver;
        std::size_t notes;
    };
    for (const Case& c : {Case{{.depth = lens(160, 120, 110), .depth_frame = kColourFrame}, 0},
                          Case{{.depth = kColourLens}, 0}, Case{{.has_depth_info = false}, 1}}) {
        const Driver driver(c.driver);
        Ros2Camera camera(unaligned());
        ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
        EXPECT_EQ(camera.notes().size(), c.notes);
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk);
        const std::vector<std::uint16_t> sent = step_of(kColourLens);
        EXPECT_EQ(std::memcmp(frame.depth.data, sent.data(), 2 * sent.size()), 0);
    }
}

// Promise: where nothing tells, or a CameraInfo of images of another size does, one sentence says which topic is
// missing and what to do.
TEST(Ros2DepthPlace, SaysWhatIsMissing) {
    struct Case {
        DriverOptions driver;
        Status status;
        const char* words;
    };
    for (const Case& c : {Case{{.depth = lens(212, 120, 110), .frames = "/elsewhere/tf_static"},
                               Status::kUnavailable,
                               "/tf_static does not say how 'camera_depth_optical_frame' lies to "
                               "'camera_color_optical_frame': give the topic of depth that is aligned"},
                          Case{{.depth = lens(212, 120, 110), .has_depth_info = false},
                               Status::kInvalid,
                               "is 212x120, /camera/color/image_raw is 160x120, and no /camera/depth/camera_info is of "
                               "it: give the topic of depth that is aligned"},
                          Case{{.depth = lens(160, 120, 110), .told_of_depth = lens(212, 120, 110)},
                               Status::kInvalid,
                               "is 160x120, /camera/color/image_raw is 160x120, and no /camera/depth/camera_info is of "
                               "it: give the topic of depth that is aligned"}}) {
        const Driver driver(c.driver);
        Ros2Options quick = unaligned();
        quick.open_max_ms = 1500;
        Ros2Camera camera(quick);
        Status status = Status::kOk;
        EXPECT_TRUE(within(kPatience_ms, [&] {
            status = camera.open();
            return status == c.status && camera.message().find(c.words) != std::string::npos;
        })) << camera.message();
    }
}

// Promise: a calibration of two cameras needs neither.
TEST(Ros2DepthPlace, IsRegisteredByACalibration) {
    const test::TemporaryFolder scratch;
    const std::string path = scratch.path("two.toml");
    std::ofstream(path) << "width = 160\nheight = 120\nfx = 150\nfy = 150\ncx = 79.5\ncy = 59.5\n[depth]\nwidth = 212\n"
                           "height = 120\nfx = 110\nfy = 110\ncx = 105.5\ncy = 59.5\ntx = 0.05\nty = 0.01\ntz = 0\n"
                           "qx = 0\nqy = 0\nqz = 0\nqw = 1\n";
    const CameraModel depth = lens(212, 120, 110);
    const Driver driver({.depth = depth, .has_depth_info = false, .frames = "/elsewhere/tf_static"});
    Ros2Options options = unaligned();
    options.calibration = path;
    Ros2Camera camera(options);
    ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    expect_registered(camera, depth, {{0, 0, 0, 1}, {0.05, 0.01, 0}});
}

}  // namespace
}  // namespace stillmesh::depth_place_test

int main(int argc, char** argv) {
    stillmesh::test::enter_own_ros_domain();
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
