#include "platform/record/frame_bag.hpp"

#include <array>
#include <bit>
#include <filesystem>
#include <span>
#include <string_view>

#include "engine/base/crc.hpp"

namespace stillmesh {
namespace {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);
enum Kind : std::uint8_t {
    kHeader = 1,
    kFooter = 2,
    kSchema = 3,
    kChannel = 4,
    kMessage = 5,
    kChunk = 6,
    kMessageIndex = 7,
    kChunkIndex = 8,
    kStatistics = 11,
    kDataEnd = 15,
};
// Of channels and schemas, counted from 1.
constexpr std::uint16_t kColour = 1, kDepth = 2, kInfo = 3, kChannels = 3;
constexpr std::size_t kIndexBytes = 9 + 2 + 4 + 16;  // of one message
constexpr std::uint16_t kImageSchema = 1, kInfoSchema = 2, kSchemas = 2;
constexpr std::string_view kFrameId = "camera_color_optical_frame";
constexpr double kMillimetres = 1000;

// The fields of the messages, for readers that know none: the definitions of sensor_msgs, std_msgs and
// builtin_interfaces without their comments.
constexpr std::string_view kHeaderFields =
    "================================================================================\nMSG: std_msgs/Header\n"
    "builtin_interfaces/Time stamp\nstring frame_id\n"
    "================================================================================\nMSG: builtin_interfaces/Time\n"
    "int32 sec\nuint32 nanosec\n";
constexpr std::string_view kImageFields =
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
    "uint8[] data\n";
constexpr std::string_view kInfoFields =
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
    "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"
    "================================================================================\n"
    "MSG: sensor_msgs/RegionOfInterest\n"
    "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n";

void put(std::string& out, std::uint64_t value, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xffU);
}
void put_text(std::string& out, std::string_view text) {
    put(out, text.size(), 4);
    out += text;
}
void put_record(std::string& out, Kind kind, std::string_view content) {
    put(out, kind, 1);
    put(out, content.size(), 8);
    out += content;
}

// CDR, little-endian (OMG DDSI-RTPS 10): numbers are aligned to their size, counted from behind the head.
class Cdr {
public:
    Cdr() : out_(std::string("\0\1\0\0", 4)) {}
    void number(std::uint64_t value, std::size_t bytes) {
        while ((out_.size() - kHeadBytes) % bytes != 0) out_ += '\0';
        put(out_, value, bytes);
    }
    void real(double value) { number(std::bit_cast<std::uint64_t>(value), 8); }
    void text(std::string_view text) {
        number(text.size() + 1, 4);
        out_ += text;
        out_ += '\0';
    }
    void header(std::int64_t time_ns) {
        number(static_cast<std::uint64_t>(time_ns / 1'000'000'000), 4);
        number(static_cast<std::uint64_t>(time_ns % 1'000'000'000), 4);
        text(kFrameId);
    }
    [[nodiscard]] std::string& bytes() { return out_; }

private:
    static constexpr std::size_t kHeadBytes = 4;
    std::string out_;
};

// An image's message but for its pixels.
[[nodiscard]] Cdr begin_image(std::int64_t time_ns, const CameraModel& size, std::string_view encoding,
                              std::uint32_t bytes_per_pixel) {
    Cdr cdr;
    cdr.header(time_ns);
    cdr.number(size.height, 4);
    cdr.number(size.width, 4);
    cdr.text(encoding);
    cdr.number(0, 1);
    cdr.number(std::uint64_t{size.width} * bytes_per_pixel, 4);
    cdr.number(std::uint64_t{size.width} * size.height * bytes_per_pixel, 4);
    return cdr;
}

[[nodiscard]] std::string colour_message(const Frame& frame, const CameraModel& size) {
    const std::uint32_t channels = channels_of(frame.format);
    Cdr cdr = begin_image(frame.time_ns, size, channels == 1 ? "mono8" : "rgb8", channels);
    const std::size_t bytes = std::size_t{size.width} * size.height * channels;
    cdr.bytes().append(reinterpret_cast<const char*>(frame.colour.data), bytes);
    return std::move(cdr.bytes());
}

[[nodiscard]] std::string depth_message(const Frame& frame, const CameraInfo& camera) {
    const bool is_mm = camera.depth_units_per_m == kMillimetres;
    const std::int64_t time_ns = frame.depth_time_ns > 0 ? frame.depth_time_ns : frame.time_ns;
    Cdr cdr = begin_image(time_ns, camera.model, is_mm ? "16UC1" : "32FC1", is_mm ? 2 : 4);
    const std::size_t pixels = std::size_t{camera.model.width} * camera.model.height;
    for (std::size_t i = 0; i < pixels; ++i) {
        const std::uint16_t z = frame.depth.data[i];
        const auto metres = static_cast<float>(z / camera.depth_units_per_m);
        put(cdr.bytes(), is_mm ? z : std::bit_cast<std::uint32_t>(metres), is_mm ? 2 : 4);
    }
    return std::move(cdr.bytes());
}

[[nodiscard]] std::string info_message(std::int64_t time_ns, const CameraModel& m) {
    Cdr cdr;
    cdr.header(time_ns);
    cdr.number(m.height, 4);
    cdr.number(m.width, 4);
    const bool is_rational = m.k4 != 0 || m.k5 != 0 || m.k6 != 0;
    const std::array<double, 8> brown = {m.k1, m.k2, m.p1, m.p2, m.k3, m.k4, m.k5, m.k6};
    const std::array<double, 4> fisheye = {m.k1, m.k2, m.k3, m.k4};
    const bool is_fisheye = m.lens == Lens::kFisheye;
    cdr.text(is_fisheye ? "equidistant" : is_rational ? "rational_polynomial" : "plumb_bob");
    const std::span<const double> d =
        is_fisheye ? std::span<const double>(fisheye) : std::span<const double>(brown).first(is_rational ? 8 : 5);
    cdr.number(d.size(), 4);
    for (const double value : d) cdr.real(value);
    for (const double value : {m.fx, 0.0, m.cx, 0.0, m.fy, m.cy, 0.0, 0.0, 1.0}) cdr.real(value);
    for (const double value : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) cdr.real(value);
    for (const double value : {m.fx, 0.0, m.cx, 0.0, 0.0, m.fy, m.cy, 0.0, 0.0, 0.0, 1.0, 0.0}) cdr.real(value);
    for (int i = 0; i < 6; ++i) cdr.number(0, 4);  // no binning, the whole picture
    cdr.number(0, 1);
    return std::move(cdr.bytes());
}

void put_message(std::string& out, std::uint16_t channel, std::uint64_t sequence, std::int64_t time_ns,
                 const std::string& data) {
    std::string head;
    put(head, channel, 2);
    put(head, sequence, 4);
    for (int i = 0; i < 2; ++i) put(head, static_cast<std::uint64_t>(time_ns), 8);
    put(out, kMessage, 1);
    put(out, head.size() + data.size(), 8);
    out += head;
    out += data;
}

void put_index(std::string& out, std::uint16_t channel, std::int64_t time_ns, std::uint64_t at) {
    std::string content;
    put(content, channel, 2);
    put(content, 16, 4);
    put(content, static_cast<std::uint64_t>(time_ns), 8);
    put(content, at, 8);
    put_record(out, kMessageIndex, content);
}

void put_schema(std::string& out, std::uint16_t id, std::string_view name, std::string_view fields) {
    std::string content;
    put(content, id, 2);
    put_text(content, name);
    put_text(content, "ros2msg");
    put_text(content, std::string(fields) + std::string(kHeaderFields));
    put_record(out, kSchema, content);
}

void put_channel(std::string& out, std::uint16_t id, std::uint16_t schema, std::string_view topic) {
    std::string content;
    put(content, id, 2);
    put(content, schema, 2);
    put_text(content, topic);
    put_text(content, "cdr");
    put(content, 0, 4);  // nothing more about it
    put_record(out, kChannel, content);
}

// At the file's begin, and again before its index.
void put_channels(std::string& out) {
    put_schema(out, kImageSchema, "sensor_msgs/msg/Image", kImageFields);
    put_schema(out, kInfoSchema, "sensor_msgs/msg/CameraInfo", kInfoFields);
    put_channel(out, kColour, kImageSchema, "/camera/color/image_raw");
    put_channel(out, kDepth, kImageSchema, "/camera/aligned_depth_to_color/image_raw");
    put_channel(out, kInfo, kInfoSchema, "/camera/color/camera_info");
}

}  // namespace

bool FrameBag::open(const std::string& file, const CameraInfo& camera, std::string& message) {
    std::error_code error;
    if (std::filesystem::exists(file, error)) {
        message = file + ": is there already; nothing was changed.";
        return false;
    }
    if (camera.separate_depth) {
        message = file + ": a bag takes depth that is registered to colour; give a folder.";
        return false;
    }
    camera_ = camera;
    out_ = kMagic;
    std::string content;
    put_text(content, "ros2");
    put_text(content, "stillmesh");
    put_record(out_, kHeader, content);
    put_channels(out_);
    size_ = out_.size();
    return file_.open(file, message) && file_.write(out_, message);
}

bool FrameBag::write(const Frame& frame, std::string& message) {
    records_.clear();
    const std::uint64_t sequence = chunks_.size();
    const std::int64_t time_ns = frame.time_ns;
    std::string index;
    const auto add = [&](std::uint16_t channel, const std::string& data) {
        put_index(index, channel, time_ns, records_.size());
        put_message(records_, channel, sequence, time_ns, data);
    };
    add(kInfo, info_message(time_ns, camera_.model));
    add(kColour, colour_message(frame, camera_.model));
    add(kDepth, depth_message(frame, camera_));
    std::string head;
    for (int i = 0; i < 2; ++i) put(head, static_cast<std::uint64_t>(time_ns), 8);
    put(head, records_.size(), 8);
    put(head, crc32(std::as_bytes(std::span<const char>(records_))), 4);
    put_text(head, "");  // not compressed
    put(head, records_.size(), 8);
    out_.clear();
    put(out_, kChunk, 1);
    put(out_, head.size() + records_.size(), 8);
    out_ += head;
    out_ += records_;
    const std::uint64_t chunk_bytes = out_.size();
    out_ += index;
    if (!file_.write(out_, message)) return false;
    chunks_.push_back({size_, chunk_bytes, time_ns});
    size_ += out_.size();
    return true;
}

bool FrameBag::close(std::string& message) {
    out_.clear();
    put_record(out_, kDataEnd, std::string(4, '\0'));
    const std::uint64_t summary_at = size_ + out_.size();
    put_channels(out_);
    constexpr std::uint64_t kHeadBytes = 9 + 8 + 8 + 8 + 4 + 4 + 8;  // of a chunk, before its records
    for (const Chunk& chunk : chunks_) {
        std::string content;
        for (int i = 0; i < 2; ++i) put(content, static_cast<std::uint64_t>(chunk.time_ns), 8);
        put(content, chunk.at, 8);
        put(content, chunk.bytes, 8);
        put(content, kChannels * 10U, 4);
        std::uint64_t index_at = chunk.at + chunk.bytes;
        for (const std::uint16_t channel : {kInfo, kColour, kDepth}) {
            put(content, channel, 2);
            put(content, index_at, 8);
            index_at += kIndexBytes;
        }
        put(content, kChannels * kIndexBytes, 8);
        put_text(content, "");
        for (int i = 0; i < 2; ++i) put(content, chunk.bytes - kHeadBytes, 8);
        put_record(out_, kChunkIndex, content);
    }
    std::string content;
    put(content, kChannels * chunks_.size(), 8);
    put(content, kSchemas, 2);
    put(content, kChannels, 4);
    put(content, 0, 4), put(content, 0, 4);  // attachments, metadata
    put(content, chunks_.size(), 4);
    for (const bool is_last : {false, true}) {
        const std::int64_t time_ns = chunks_.empty() ? 0 : (is_last ? chunks_.back() : chunks_.front()).time_ns;
        put(content, static_cast<std::uint64_t>(time_ns), 8);
    }
    put(content, kChannels * 10U, 4);
    for (std::uint16_t channel = 1; channel <= kChannels; ++channel) {
        put(content, channel, 2);
        put(content, chunks_.size(), 8);
    }
    put_record(out_, kStatistics, content);
    content.clear();
    put(content, summary_at, 8);
    put(content, 0, 8);  // no offsets of the summary's groups
    put(content, 0, 4);  // no checksum of it
    put_record(out_, kFooter, content);
    out_ += kMagic;
    const bool is_written = file_.write(out_, message);
    file_.close();
    return is_written;
}

}  // namespace stillmesh
