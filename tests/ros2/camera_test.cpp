// Images that a driver of ROS 2 publishes, with Fast DDS as the driver.
#include "hal/ros2/ros2_camera.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <string>
#include <thread>

#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/png_bytes.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::camera_test {
namespace {

using test::within;
namespace fast = test::fast;

constexpr std::uint32_t kWidth = 160, kHeight = 120;
constexpr std::int64_t kPeriod_ns = 33'333'333;
constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'111;
constexpr std::int64_t kPatience_ms = 30'000;

[[nodiscard]] fast::Header header_of(std::int64_t time_ns) {
    return {static_cast<std::int32_t>(time_ns / 1'000'000'000), static_cast<std::uint32_t>(time_ns % 1'000'000'000),
            "camera_color_optical_frame"};
}
[[nodiscard]] std::uint8_t colour_at(std::uint64_t frame, std::size_t i) {
    return static_cast<std::uint8_t>(frame * 31 + i * 7);
}
[[nodiscard]] std::uint16_t depth_at(std::uint64_t frame, std::size_t i) {
    return static_cast<std::uint16_t>(1000 + (frame * 13 + i) % 3000);
}
[[nodiscard]] fast::Image colour_image(std::uint64_t frame, const char* encoding) {
    const std::uint32_t channels = std::strcmp(encoding, "mono8") == 0 ? 1 : 3;
    fast::Image image{header_of(kBegin_ns + static_cast<std::int64_t>(frame) * kPeriod_ns),
                      kHeight,
                      kWidth,
                      encoding,
                      0,
                      kWidth * channels,
                      {}};
    image.data.resize(std::size_t{image.step} * kHeight);
    for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = colour_at(frame, i);
    return image;
}
[[nodiscard]] fast::Image depth_image(std::uint64_t frame, const char* encoding) {
    const bool is_float = std::strcmp(encoding, "32FC1") == 0;
    const std::uint32_t bytes = is_float ? 4 : 2;
    fast::Image image{header_of(kBegin_ns + static_cast<std::int64_t>(frame) * kPeriod_ns + 2'000'000),
                      kHeight,
                      kWidth,
                      encoding,
                      0,
                      kWidth * bytes,
                      {}};
    image.data.resize(std::size_t{image.step} * kHeight);
    for (std::size_t i = 0; i < std::size_t{kWidth} * kHeight; ++i) {
        const std::uint16_t millimetres = depth_at(frame, i);
        const float metres = static_cast<float>(millimetres) * 1e-3F;
        if (is_float) {
            std::memcpy(image.data.data() + 4 * i, &metres, 4);
        } else {
            std::memcpy(image.data.data() + 2 * i, &millimetres, 2);
        }
    }
    return image;
}
[[nodiscard]] fast::CameraInfo info_of() {
    fast::CameraInfo info;
    info.header = header_of(kBegin_ns);
    info.height = kHeight;
    info.width = kWidth;
    info.distortion_model = "plumb_bob";
    info.d = {0.1, -0.2, 0.001, -0.002, 0.05};
    info.k = {150.25, 0, 79.5, 0, 151.5, 59.75, 0, 0, 1};
    return info;
}

// A driver: publishes at a camera's pace until it goes, some streams of it.
class Driver {
public:
    struct Options {
        std::string prefix = "/camera";
        const char* colour = "rgb8";
        const char* depth = "16UC1";
        bool has_depth = true, has_info = true;
        bool is_reliable = true;
    };
    explicit Driver(const Options& options)
        : colour_(node_, options.prefix + "/color/image_raw", {.is_reliable = options.is_reliable, .depth = 2}),
          depth_(node_, options.prefix + "/aligned_depth_to_color/image_raw",
                 {.is_reliable = options.is_reliable, .depth = 2}),
          info_(node_, options.prefix + "/color/camera_info", {.is_reliable = options.is_reliable, .depth = 2}),
          thread_([this, options](const std::stop_token& stop) {
              for (std::uint64_t frame = 0; !stop.stop_requested(); ++frame) {
                  const bool is_sent = colour_.write(colour_image(frame, options.colour)) &&
                                       (!options.has_depth || depth_.write(depth_image(frame, options.depth))) &&
                                       (!options.has_info || info_.write(info_of()));
                  static_cast<void>(is_sent);
                  sent_ = frame + 1;
                  std::this_thread::sleep_for(std::chrono::milliseconds(20));
              }
          }) {}
    [[nodiscard]] std::uint64_t sent() const { return sent_; }

private:
    fast::Node node_;
    fast::Node::Writer<fast::Image> colour_, depth_;
    fast::Node::Writer<fast::CameraInfo> info_;
    std::atomic<std::uint64_t> sent_ = 0;
    std::jthread thread_;
};

// One that packs them: colour as PNG, depth as compressedDepth.
class PackedDriver {
public:
    PackedDriver()
        : colour_(node_, "/p/color/image_raw/compressed", {.is_reliable = false, .depth = 2}),
          depth_(node_, "/p/depth/image_raw/compressedDepth", {.is_reliable = false, .depth = 2}),
          info_(node_, "/p/camera_info", {.is_reliable = false, .depth = 2}),
          thread_([this](const std::stop_token& stop) {
              for (std::uint64_t frame = 0; !stop.stop_requested(); ++frame) {
                  const fast::Image colour = colour_image(frame, "rgb8"), depth = depth_image(frame, "16UC1");
                  std::vector<std::uint8_t> packed(12);
                  const auto png = test::png_bytes(depth.data.data(), kWidth, kHeight, PngPixels::kGrey16);
                  packed.insert(packed.end(), png.begin(), png.end());
                  const bool is_sent =
                      colour_.write({colour.header, "rgb8; png compressed bgr8",
                                     test::png_bytes(colour.data.data(), kWidth, kHeight, PngPixels::kRgb8)}) &&
                      depth_.write({depth.header, "16UC1; compressedDepth png", packed}) && info_.write(info_of());
                  static_cast<void>(is_sent);
                  std::this_thread::sleep_for(std::chrono::milliseconds(20));
              }
          }) {}

private:
    fast::Node node_;
    fast::Node::Writer<fast::CompressedImage> colour_, depth_;
    fast::Node::Writer<fast::CameraInfo> info_;
    std::jthread thread_;
};

// Opens as a run with --wait does.
[[nodiscard]] Status open_patiently(Ros2Camera& camera) {
    Status status = Status::kUnavailable;
    static_cast<void>(within(kPatience_ms, [&] { return (status = camera.open()) != Status::kUnavailable; }));
    return status;
}

void expect_frame(const Frame& frame, const char* colour, double depth_scale) {
    const std::uint32_t channels = std::strcmp(colour, "mono8") == 0 ? 1 : 3;
    EXPECT_EQ(frame.format, channels == 1                      ? PixelFormat::kGrey8
                            : std::strcmp(colour, "bgr8") == 0 ? PixelFormat::kBgr8
                                                               : PixelFormat::kRgb8);
    ASSERT_EQ((frame.time_ns - kBegin_ns) % kPeriod_ns, 0);
    const auto number = static_cast<std::uint64_t>((frame.time_ns - kBegin_ns) / kPeriod_ns);
    EXPECT_EQ(frame.depth_time_ns, frame.time_ns + 2'000'000);
    ASSERT_EQ(frame.colour.width, kWidth);
    ASSERT_EQ(frame.depth.height, kHeight);
    std::size_t wrong = 0;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
        for (std::uint32_t x = 0; x < kWidth * channels; ++x) {
            wrong += frame.colour.row(y)[x] != colour_at(number, std::size_t{y} * kWidth * channels + x) ? 1U : 0U;
        }
        for (std::uint32_t x = 0; x < kWidth; ++x) {
            const double expected = depth_scale * depth_at(number, std::size_t{y} * kWidth + x);
            wrong += frame.depth.row(y)[x] != expected ? 1U : 0U;
        }
    }
    EXPECT_EQ(wrong, 0U) << "pixels of frame " << number;
}

// Promise: every byte of colour and depth, every number of the lens and both stamps come as the driver published them,
// in each encoding and whether it publishes reliably or not; times only go on.
TEST(Ros2Camera, EveryPixelComesAsItWasSent) {
    struct Case {
        const char* colour;
        const char* depth;
        double units_per_m;
        bool is_reliable;
    };
    for (const Case& c :
         {Case{"rgb8", "16UC1", 1000, true}, Case{"bgr8", "32FC1", 4000, false}, Case{"mono8", "16UC1", 1000, false}}) {
        Ros2Camera camera;
        const Driver driver({.colour = c.colour, .depth = c.depth, .is_reliable = c.is_reliable});
        ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
        const CameraInfo& info = camera.info();
        EXPECT_EQ(info.depth_units_per_m, c.units_per_m);
        EXPECT_NEAR(info.frames_per_s, 30, 0.01);
        EXPECT_EQ(info.model.width, kWidth);
        EXPECT_EQ(info.model.fx, 150.25);
        EXPECT_EQ(info.model.fy, 151.5);
        EXPECT_EQ(info.model.cx, 79.5);
        EXPECT_EQ(info.model.cy, 59.75);
        EXPECT_EQ(info.model.k3, 0.05);
        std::int64_t last_ns = 0;
        std::size_t frames = 0;
        EXPECT_TRUE(within(kPatience_ms, [&] {
            Frame frame;
            if (camera.wait(100) != Status::kOk || camera.poll(frame) != Status::kOk) return false;
            EXPECT_GT(frame.time_ns, last_ns);
            EXPECT_EQ(frame.depth_units_per_m, c.units_per_m);
            last_ns = frame.time_ns;
            expect_frame(frame, c.colour, c.units_per_m / 1000);
            EXPECT_LE(camera.due_ns(), test::now_ns());
            return ++frames == 20 || testing::Test::HasFailure();
        }));
        EXPECT_EQ(camera.counts().images_unusable, 0U);
    }
}

// Promise: of compressed topics, told by their names, every pixel and both stamps come as they were before packing.
TEST(Ros2Camera, PackedImagesComeAsTheyWere) {
    Ros2Options options;
    ASSERT_TRUE(
        parse_ros2_topics("/p/color/image_raw/compressed,/p/depth/image_raw/compressedDepth,/p/camera_info", options));
    Ros2Camera camera(options);
    const PackedDriver driver;
    ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    EXPECT_EQ(camera.info().model.fx, 150.25);
    std::size_t frames = 0;
    EXPECT_TRUE(within(kPatience_ms, [&] {
        Frame frame;
        if (camera.wait(100) != Status::kOk || camera.poll(frame) != Status::kOk) return false;
        EXPECT_EQ(frame.depth_units_per_m, 1000);
        expect_frame(frame, "rgb8", 1);
        return ++frames == 10 || testing::Test::HasFailure();
    }));
    EXPECT_EQ(camera.counts().images_unusable, 0U);
}

// Promise: who polls late gets the newest frame, and what it overtook is counted.
TEST(Ros2Camera, NewestWins) {
    Ros2Camera camera;
    const Driver driver({});
    ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    const std::uint64_t sent = driver.sent();
    ASSERT_TRUE(within(kPatience_ms, [&] { return driver.sent() > sent + 20 && camera.counts().dropped > 5; }));
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    const auto number = static_cast<std::uint64_t>((frame.time_ns - kBegin_ns) / kPeriod_ns);
    EXPECT_GT(number, sent + 5);
    expect_frame(frame, "rgb8", 1);
}

// Promise: a driver that is not there, or publishes something else, is said with its topics; one that goes is away, and
// is found again when it is back.
TEST(Ros2Camera, SaysWhatIsMissing) {
    Ros2Options quick;
    quick.open_max_ms = 200;
    {
        Ros2Camera camera(quick);
        EXPECT_EQ(camera.open(), Status::kUnavailable);
        EXPECT_NE(camera.message().find("nobody publishes /camera/color/image_raw, /camera/aligned_depth_to_color/"),
                  std::string::npos)
            << camera.message();
    }
    const auto says = [](const Driver::Options& options, Status expected, const char* words) {
        Ros2Camera camera;
        const Driver driver(options);
        std::string said;
        const bool is_said = within(kPatience_ms, [&] {
            const Status status = camera.open();
            said = camera.message();
            return status == expected && said.find(words) != std::string::npos;
        });
        EXPECT_TRUE(is_said) << said;
    };
    says({.colour = "yuv422"}, Status::kInvalid, "/camera/color/image_raw: an image has the encoding 'yuv422'");
    says({.depth = "8UC1"}, Status::kInvalid, "/camera/aligned_depth_to_color/image_raw: an image has the encoding");
    says({.has_depth = false}, Status::kUnavailable, "nothing comes on /camera/aligned_depth_to_color/image_raw");
    says({.has_info = false}, Status::kUnavailable, "nothing comes on /camera/color/camera_info");

    Ros2Camera camera;
    Frame frame;
    {
        const Driver driver({});
        ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    }
    EXPECT_TRUE(within(kPatience_ms, [&] { return camera.poll(frame) == Status::kUnavailable; }));
    const Driver back({});
    ASSERT_EQ(open_patiently(camera), Status::kOk) << camera.message();
    EXPECT_EQ(camera.poll(frame), Status::kOk);
}

// Promise: names of topics are three, as ROS allows them.
TEST(Ros2Camera, TopicsAreRead) {
    Ros2Options options;
    ASSERT_TRUE(parse_ros2_topics("a/rgb,/b/depth,/c", options));
    EXPECT_EQ(options.colour, "/a/rgb");
    EXPECT_EQ(options.depth, "/b/depth");
    EXPECT_EQ(options.info, "/c");
    for (const char* const wrong : {"", "a", "a,b", "a,b,", ",b,c", "a,b,c,d", "a b,c,d", "/a/,b,c"})
        EXPECT_FALSE(parse_ros2_topics(wrong, options)) << wrong;
}

}  // namespace
}  // namespace stillmesh::camera_test
