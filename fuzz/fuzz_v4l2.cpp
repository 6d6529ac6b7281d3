// What a camera behind V4L2 may answer. First byte even: calibration tables, details, depth unit and metadata of
// images, as they are and with their checksum repaired: a sentence, or cameras that can be. Odd: a whole device whose
// every answer comes from the bytes (nodes, modes, formats, buffers, errors, images): opened, polled, closed and opened
// again, it gives a sentence or frames of the camera's form; everything it gave is given back.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/crc.hpp"
#include "fuzz/fuzz.hpp"
#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/realsense_metadata.hpp"
#include "hal/v4l2/realsense_tables.hpp"
#include "hal/v4l2/v4l2_camera.hpp"

namespace {

using namespace stillmesh;

void expect_sentence(Status status, const std::string& message) {
    fuzz::expect(status == Status::kOk || (status == Status::kCorrupt && !message.empty()),
                 "what is damaged is kCorrupt with a sentence");
}

void expect_camera(const CameraModel& model) {
    for (const double value :
         {model.fx, model.fy, model.cx, model.cy, model.k1, model.k2, model.p1, model.p2, model.k3}) {
        fuzz::expect(std::isfinite(value), "numbers are finite");
    }
    fuzz::expect(model.fx > 0 && model.fy > 0, "focal lengths are positive");
}

void read_tables(std::span<const std::uint8_t> bytes, std::uint16_t product_id) {
    std::string message;
    CameraModel depth, colour;
    depth.width = colour.width = 640;
    depth.height = colour.height = 480;
    RigidTransform pose;
    Status status = v4l2::parse_depth_table(bytes, depth, message);
    expect_sentence(status, message);
    if (status == Status::kOk) expect_camera(depth);
    status = v4l2::parse_colour_table(bytes, product_id, colour, pose, message);
    expect_sentence(status, message);
    if (status == Status::kOk) {
        expect_camera(colour);
        double length = 0;
        for (const double q : pose.rotation_xyzw) length += q * q;
        fuzz::expect(std::abs(length - 1) < 1e-9, "a pose has a unit quaternion");
        for (const double t : pose.translation_m) fuzz::expect(std::abs(t) < 2, "cameras stand beside each other");
    }
    v4l2::DeviceDetails details;
    expect_sentence(v4l2::parse_details(bytes, details, message), message);
    double units = 1000;
    expect_sentence(v4l2::parse_depth_units(bytes, units, message), message);
    fuzz::expect(units >= 100 && units <= 1e6, "a depth unit is one");
    v4l2::ImageFacts facts;
    const bool is_read = v4l2::parse_metadata(bytes, facts) == Status::kOk;
    fuzz::expect(facts.device_us.has_value() == is_read, "metadata has a time, or is not used");
    fuzz::expect(facts.exposure_us.value_or(0) <= 1'000'000, "no exposure is longer than a second");
}

// A device that says what the bytes say.
class ByteLink final : public V4l2Link {
public:
    explicit ByteLink(fuzz::Bytes bytes) : bytes_(bytes) {}
    ~ByteLink() { fuzz::expect(open_ == 0 && mapped_.empty(), "everything is given back"); }

    std::vector<V4l2Node> nodes() override {
        std::vector<V4l2Node> nodes(2 + bytes_.u8() % 3U);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            nodes[i].path = "/dev/video" + std::to_string(i);
            nodes[i].usb_port = rarely() ? "" : "2-1";
            nodes[i].vendor_id = rarely() ? std::uint16_t{0x1234} : v4l2::kRealSenseVendor;
            nodes[i].product_id = rarely() ? v4l2::kD405 : v4l2::kD435;
            nodes[i].interface = static_cast<std::uint8_t>(nodes.size() == 4 ? i / 2 : i);
        }
        has_metadata_ = nodes.size() == 4;  // two of images, each with one of metadata behind it
        return nodes;
    }
    int open(const std::string& path, int& handle) override {
        if (const int error = fails(); error != 0) return error;
        handle = next_++;
        is_first_[handle] = path == "/dev/video0";
        is_metadata_[handle] = has_metadata_ && (path.back() == '1' || path.back() == '3');
        ++open_;
        return 0;
    }
    void close(int) override { --open_; }
    int query_capability(int handle, std::uint32_t& capabilities) override {
        capabilities = kV4l2Streaming | (is_metadata_[handle] ? kV4l2Metadata : kV4l2Capture);
        if (rarely()) capabilities = bytes_.u32();
        return fails();
    }
    int format_at(int handle, std::uint32_t index, std::uint32_t& code) override {
        constexpr std::uint32_t kCodes[] = {v4l2::kYuyv, v4l2::kGrey, v4l2::kMjpg, v4l2::kUyvy,
                                            v4l2::kRgb3, v4l2::kY8i,  v4l2::kY16};
        code = is_first_[handle] ? v4l2::kZ16 : kCodes[bytes_.u8() % 7];
        if (is_metadata_[handle]) code = bytes_.u8() % 4 == 0 ? v4l2::kUvcMetadata : v4l2::kD4xxMetadata;
        if (rarely()) code = bytes_.u32();
        return index > 0 && !rarely() ? EINVAL : fails();
    }
    int size_at(int, std::uint32_t, std::uint32_t index, V4l2Size& size) override {
        size = {40U + bytes_.u8() % 64U, 40U + bytes_.u8() % 64U};
        if (rarely()) size = {bytes_.u32(), bytes_.u32()};
        return index > 0 && !rarely() ? EINVAL : fails();
    }
    int interval_at(int, const V4l2Format&, std::uint32_t index, V4l2Interval& interval) override {
        interval = {1, 30};
        if (rarely()) interval = {bytes_.u32(), bytes_.u32()};
        return index > 0 && !rarely() ? EINVAL : fails();
    }
    int set_format(int handle, V4l2Format& format) override {
        const std::uint32_t pixel = std::max(v4l2::bytes_per_pixel(format.fourcc), 1U);
        format.bytes_per_line = pixel * format.width + (rarely() ? bytes_.u8() : 0U);
        format.bytes = format.bytes_per_line * format.height;
        if (is_metadata_[handle]) format.bytes = 256;
        if (rarely()) format.bytes = bytes_.u32();
        if (rarely()) format.bytes_per_line = bytes_.u32();
        if (rarely()) format.width = bytes_.u32();
        sizes_[handle] = std::min(format.bytes, 1U << 20U);
        return fails();
    }
    int set_interval(int, V4l2Interval& interval) override {
        if (rarely()) interval = {bytes_.u32(), bytes_.u32()};
        return fails();
    }
    int set_control(int, std::uint32_t, std::int32_t) override { return fails(); }
    int request_buffers(int, std::uint32_t& count) override {
        if (count != 0 && rarely()) count = bytes_.u8();
        return fails();
    }
    int map(int handle, std::uint32_t, std::span<const std::uint8_t>& bytes) override {
        if (const int error = fails(); error != 0) return error;
        auto buffer = std::make_unique<std::vector<std::uint8_t>>(sizes_[handle] + std::size_t{1});
        for (std::size_t i = 0; i < 32 && i < buffer->size(); ++i) (*buffer)[i] = bytes_.u8();
        // A header with a time, and one block.
        constexpr std::uint8_t kHeader[] = {246, 0x04};
        if (is_metadata_[handle] && buffer->size() > 256) std::copy_n(kHeader, 2, buffer->begin() + 10);
        bytes = *buffer;
        mapped_.push_back(std::move(buffer));
        return 0;
    }
    void unmap(std::span<const std::uint8_t> bytes) override {
        const std::size_t count =
            std::erase_if(mapped_, [&bytes](const auto& buffer) { return buffer->data() == bytes.data(); });
        fuzz::expect(count == 1, "what is unmapped was mapped");
    }
    int queue(int, std::uint32_t) override { return fails(); }
    int dequeue(int handle, V4l2Buffer& buffer) override {
        if (bytes_.is_empty() || bytes_.u8() % 4 == 3) return EAGAIN;
        buffer.index = rarely() ? bytes_.u32() : next_buffer_++ % 6U;
        buffer.bytes_used = rarely() ? bytes_.u32() : sizes_[handle];
        buffer.sequence = bytes_.u8();
        buffer.stamp_us = rarely() ? static_cast<std::int64_t>(bytes_.u64()) : 1'000'000 + bytes_.u8() * 100;
        buffer.is_broken = rarely();
        buffer.is_monotonic = !rarely();
        return fails();
    }
    int set_streaming(int, bool) override { return fails(); }
    int wait(std::span<const int>, std::uint32_t timeout_ms, std::span<V4l2Ready> ready) override {
        now_ns_ += std::int64_t{timeout_ms} * 1'000'000 + 1;
        for (V4l2Ready& one : ready) one = {!rarely(), rarely()};
        return fails();
    }
    int extension(int, std::uint8_t, std::uint8_t control, V4l2Query query, std::span<std::uint8_t> data) override {
        if (control != v4l2::kCommandControl || data.size() != v4l2::kMessageBytes) return fails();
        if (query == V4l2Query::kSet) {
            code_ = data[4];
            is_depth_ = data[8] == v4l2::kDepthTable;
            return fails();
        }
        std::fill(data.begin(), data.end(), std::uint8_t{0});
        data[0] = code_;
        if (code_ == 0x15 && !rarely()) {
            write_table(data);
        } else {
            for (std::size_t i = 0; i < 64; ++i) data[i] = bytes_.u8();
        }
        return fails();
    }
    std::int64_t now_ns() override { return now_ns_; }

private:
    // A table like a camera's, with numbers near good ones.
    void write_table(std::span<std::uint8_t> data) {
        const std::span<std::uint8_t> table = data.subspan(4, is_depth_ ? 512 : 256);
        const auto put = [&table](std::size_t at, float value) {
            const auto bits = std::bit_cast<std::uint32_t>(value);
            for (std::size_t i = 0; i < 4; ++i) table[at + i] = static_cast<std::uint8_t>(bits >> (8 * i));
        };
        const auto spoiled = [this](float value) {
            return bytes_.u8() < 250 ? value : static_cast<float>(bytes_.u16());
        };
        if (is_depth_) {
            for (std::size_t k = 0; k < 16; ++k) {
                for (std::size_t i = 0; i < 4; ++i) put(256 + 16 * k + 4 * i, i < 2 ? 1300.0F : 500.0F);
            }
            put(256, spoiled(1300));
        } else {
            for (const std::size_t at : {16U, 32U, 184U, 200U, 216U}) put(at, spoiled(1.0F));
            for (const std::size_t at : {52U, 56U, 220U, 224U}) put(at, spoiled(0.01F));
        }
        const std::uint32_t sum = crc32(std::as_bytes(std::span<const std::uint8_t>(table).subspan(16)));
        for (std::size_t i = 0; i < 4; ++i) table[12 + i] = static_cast<std::uint8_t>(sum >> (8 * i));
        data[1020] = static_cast<std::uint8_t>(table.size() & 0xffU);
        data[1021] = static_cast<std::uint8_t>(table.size() >> 8U);
    }
    [[nodiscard]] bool rarely() { return bytes_.u8() >= 248; }
    int fails() {
        constexpr int kErrors[] = {EIO, ENODEV, EBUSY, ENOSPC, EINVAL, EACCES, ENOENT, EPIPE};
        return bytes_.u8() < 253 ? 0 : kErrors[bytes_.u8() % 8];
    }

    fuzz::Bytes bytes_;
    bool has_metadata_ = false;
    std::map<int, bool> is_metadata_;
    int open_ = 0, next_ = 3;
    std::uint32_t next_buffer_ = 0;
    std::int64_t now_ns_ = 1'000'000'000;
    std::uint8_t code_ = 0;
    bool is_depth_ = false;
    std::map<int, std::uint32_t> sizes_;
    std::map<int, bool> is_first_;
    std::vector<std::unique_ptr<std::vector<std::uint8_t>>> mapped_;
};

void run_device(fuzz::Bytes bytes) {
    constexpr const char* kDevices[] = {"", "", "/dev/video0,/dev/video1", "123", "ir"};
    V4l2Options options;
    options.has_thread = false;
    options.device = kDevices[bytes.u8() % 5];
    if (bytes.u8() % 2 == 0) options.calibration = "tum-fr1";
    options.is_registered = bytes.u8() % 4 == 0;
    V4l2Camera camera(options, std::make_shared<ByteLink>(bytes));
    for (int opening = 0; opening < 2; ++opening) {
        const Status opened = camera.open();
        fuzz::expect(opened == Status::kOk ||
                         ((opened == Status::kUnavailable || opened == Status::kInvalid) && !camera.message().empty()),
                     "a camera that cannot be opened says why");
        if (opened != Status::kOk) continue;
        const CameraInfo& info = camera.info();
        expect_camera(info.model);
        for (int i = 0; i < 12; ++i) {
            Frame frame;
            static_cast<void>(camera.wait(10));
            const Status polled = camera.poll(frame);
            if (polled == Status::kUnavailable) break;
            if (polled != Status::kOk) continue;
            fuzz::expect(frame.colour.width == info.model.width && frame.colour.height == info.model.height &&
                             frame.depth.width == info.model.width && frame.depth.height == info.model.height,
                         "a frame has the camera's form");
            std::uint32_t sum = frame.depth.at(frame.depth.width - 1, frame.depth.height - 1);
            sum += frame.colour.row(frame.colour.height - 1)[frame.colour.width * channels_of(frame.format) - 1];
            fuzz::expect(sum <= 65535 + 255, "every pixel is there");
        }
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::span<const std::uint8_t> input(data, size_bytes);
    fuzz::Bytes bytes(input);
    if (bytes.u8() % 2 == 1) {
        run_device(bytes);
        return 0;
    }
    const std::uint16_t product_id = bytes.u8() % 2 == 0 ? v4l2::kD435 : v4l2::kD405;
    std::vector<std::uint8_t> table(bytes.rest().begin(), bytes.rest().end());
    read_tables(table, product_id);
    if (table.size() >= 16) {
        const std::uint32_t sum = crc32(std::as_bytes(std::span<const std::uint8_t>(table).subspan(16)));
        for (std::size_t i = 0; i < 4; ++i) table[12 + i] = static_cast<std::uint8_t>(sum >> (8 * i));
        read_tables(table, product_id);
    }
    if (table.size() >= v4l2::kMessageBytes) {
        std::span<const std::uint8_t> body;
        std::string message;
        const Status status =
            v4l2::answer_body(v4l2::Command::kCalibration,
                              std::span<const std::uint8_t>(table).first<v4l2::kMessageBytes>(), body, message);
        expect_sentence(status, message);
        fuzz::expect(status != Status::kOk || body.size() <= v4l2::kMessageBytes - 8, "a body lies in its answer");
    }
    return 0;
}
