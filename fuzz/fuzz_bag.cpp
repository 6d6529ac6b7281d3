// Bags of ROS. The first byte says what the rest is: a whole file of ROS 1, MCAP or SQLite, which BagCamera plays (a
// sentence or a camera; polling ends; every frame has all its pixels), or one message in either layout (a sentence, or
// an image whose pixels fit, or a camera that the engine's door would take, or frames whose rotations are rotations).
#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "fuzz/fuzz.hpp"
#include "hal/bag/bag_camera.hpp"
#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_images.hpp"
#include "hal/bag/frame_messages.hpp"
#include "hal/bag/ros_camera.hpp"
#include "tests/replay/recording_folder.hpp"

namespace {

using namespace stillmesh;
using Input = std::span<const std::uint8_t>;

constexpr std::uint32_t kSideMax = 256;

void play(Input bytes, bool has_camera) {
    static const test::TemporaryFolder folder;
    const std::string path = folder.path("bag");
    test::write_text(path, std::string(bytes.begin(), bytes.end()));
    BagOptions options;
    options.path = path;
    options.width_max = options.height_max = kSideMax;
    if (has_camera) options.calibration = "tum-fr1";
    BagCamera camera(options);
    Frame frame;
    if (camera.open() != Status::kOk) {
        fuzz::expect(!camera.message().empty(), "a bag that cannot be opened gets a sentence");
        fuzz::expect(camera.poll(frame) == Status::kUnavailable, "a closed camera has no frames");
        return;
    }
    const CameraModel model = camera.info().model;
    fuzz::expect(model.width > 0 && model.width <= kSideMax && model.height > 0 && model.height <= kSideMax,
                 "an open camera knows its size, within the limits");
    std::int64_t last_ns = -1;
    std::size_t polls = 0;
    for (Status status = Status::kOk; status != Status::kEnd; ++polls) {
        fuzz::expect(polls <= bytes.size() + 2, "a bag ends");
        status = camera.poll(frame);
        if (status != Status::kOk) {
            fuzz::expect(status == Status::kEnd || status == Status::kTimedOut ||
                             (status == Status::kCorrupt && !camera.message().empty()),
                         "what is passed over gets a sentence");
            continue;
        }
        fuzz::expect(frame.time_ns > last_ns, "times rise");
        last_ns = frame.time_ns;
        fuzz::expect(frame.colour.width == model.width && frame.colour.height == model.height &&
                         frame.depth.width == model.width && frame.depth.height == model.height,
                     "all frames have the camera's size");
        std::uint32_t sum = 0;  // of every pixel that the views promise
        for (std::uint32_t y = 0; y < model.height; ++y) {
            for (std::uint32_t x = 0; x < model.width * channels_of(frame.format); ++x) sum += frame.colour.at(x, y);
            for (std::uint32_t x = 0; x < model.width; ++x) sum += frame.depth.at(x, y);
        }
        volatile std::uint32_t sink = sum;
        static_cast<void>(sink);
    }
    fuzz::expect(camera.poll(frame) == Status::kEnd, "the end stays the end");
    static_cast<void>(camera.closing_notes());
}

void read_image_message(Input bytes, MessageLayout layout, std::string_view type) {
    std::vector<std::uint8_t> buffer;
    if (!unpack_message(bytes, buffer)) return;
    const BagTopic topic{"/topic", std::string(type), layout, true};
    BagImage image;
    std::string message;
    const Status status = read_bag_image(topic, bytes, image, message);
    fuzz::expect((status == Status::kOk) == message.empty(), "a sentence for an error, and only for an error");
    if (status != Status::kOk || image.coding == PixelCoding::kOther) return;
    fuzz::expect(image.size.width > 0 && image.size.height > 0, "an image has pixels");
    if (image.size.width > kSideMax || image.size.height > kSideMax) return;
    const std::size_t pixels = std::size_t{image.size.width} * image.size.height;
    if (is_depth(image.coding)) {
        std::vector<std::uint16_t> depth(pixels);
        static_cast<void>(depth_pixels(image, topic.name, 1000, depth, message));
    } else {
        std::vector<std::uint8_t> colour(pixels * bytes_per_pixel(image.kind));
        static_cast<void>(colour_pixels(image, topic.name, colour, message));
    }
}

void read_camera_message(Input bytes, MessageLayout layout, bool is_rectified) {
    CameraInfoMessage from;
    if (!read_message(bytes, layout, from)) return;
    CameraInfo info;
    std::string message;
    const Status status = camera_of_message(from, "/topic", is_rectified, info, message);
    fuzz::expect((status == Status::kOk) == message.empty(), "a sentence for an error, and only for an error");
    if (status == Status::kOk) fuzz::expect(info.model.fx > 0 && info.model.fy > 0, "a camera has focal lengths");
    fuzz::expect(is_same_view(from, from) || from.width == 0 || from.height == 0 || status != Status::kOk,
                 "a camera sees its own view");
}

void read_transforms(Input bytes, MessageLayout layout) {
    FrameTree tree;
    take_transforms("/tf_static", kTransformsType, bytes, layout, tree);
    take_transforms("/device_0/sensor_0/Depth_0/tf/0", kTransformType, bytes, layout, tree);
    for (const auto& pose : {tree.between("depth", "colour"), tree.between("/colour", "link")}) {
        if (!pose) continue;
        double norm = 0;
        for (const double value : pose->rotation_xyzw) norm += value * value;
        fuzz::expect(norm > 0.999 && norm < 1.001, "a rotation has the length of one");
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const Input input(data, size_bytes);
    if (input.empty()) return 0;
    const Input rest = input.subspan(1);
    const MessageLayout layout = (input[0] & 8U) != 0 ? MessageLayout::kCdr : MessageLayout::kRos1;
    switch (input[0] & 7U) {
        case 0: play(rest, false); break;
        case 1: play(rest, true); break;
        case 2: read_image_message(rest, layout, kImageType); break;
        case 3: read_image_message(rest, layout, kCompressedType); break;
        case 4: read_camera_message(rest, layout, false); break;
        case 5: read_camera_message(rest, layout, true); break;
        case 6: read_transforms(rest, layout); break;
        default: break;
    }
    return 0;
}
