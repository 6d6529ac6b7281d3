#include "hal/bag/ros1_reader.hpp"

#include <algorithm>
#include <array>

namespace stillmesh {
namespace {

constexpr std::string_view kRos1Magic = "#ROSBAG V2.0\n";
constexpr std::uint32_t kHeaderBytesMax = 64 * 1024;
constexpr std::size_t kConnectionsMax = 65536;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

enum class Op : std::uint8_t {
    kNone = 0,
    kMessage = 2,
    kBagHeader = 3,
    kIndex = 4,
    kChunk = 5,
    kChunkInfo = 6,
    kConnection = 7
};

using Bytes = std::span<const std::uint8_t>;

[[nodiscard]] std::uint32_t u32_at(Bytes bytes, std::size_t at = 0) {
    return std::uint32_t{bytes[at]} | std::uint32_t{bytes[at + 1]} << 8U | std::uint32_t{bytes[at + 2]} << 16U |
           std::uint32_t{bytes[at + 3]} << 24U;
}

// What stands behind "name=" in a header; empty: it is not there, or the header is broken before it.
[[nodiscard]] Bytes field(Bytes header, std::string_view name) {
    while (header.size() >= 4) {
        const std::uint32_t size = u32_at(header);
        header = header.subspan(4);
        if (size > header.size()) return {};
        const Bytes whole = header.first(size);
        header = header.subspan(size);
        if (size <= name.size() || whole[name.size()] != '=') continue;
        if (std::equal(name.begin(), name.end(), whole.begin())) return whole.subspan(name.size() + 1);
    }
    return {};
}
[[nodiscard]] std::string_view text_field(Bytes header, std::string_view name) {
    const Bytes bytes = field(header, name);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
[[nodiscard]] bool number_field(Bytes header, std::string_view name, std::uint32_t& value) {
    const Bytes bytes = field(header, name);
    if (bytes.size() != 4) return false;
    value = u32_at(bytes);
    return true;
}
[[nodiscard]] Op op_of(Bytes header) {
    const Bytes bytes = field(header, "op");
    return bytes.size() == 1 ? static_cast<Op>(bytes[0]) : Op::kNone;
}

}  // namespace

Status Ros1Reader::open(const std::string& file, BagTopics& topics, std::string& message) {
    name_ = file;
    topics_ = &topics;
    STILLMESH_TRY(file_.open(file, message));
    std::array<std::uint8_t, kRos1Magic.size()> magic{};
    if (!file_.read(0, magic) || !std::equal(kRos1Magic.begin(), kRos1Magic.end(), magic.begin())) {
        message = file + ": is a bag of another version than 2.0; bring it up to date with 'rosbag fix'.";
        return Status::kInvalid;
    }
    at_ = kRos1Magic.size();
    return Status::kOk;
}

Status Ros1Reader::read_file_record(BagMessage& out, std::string& message) {
    if (at_ == file_.size_bytes()) return Status::kEnd;
    const std::uint64_t begin = at_;
    std::array<std::uint8_t, 4> size{};
    if (!file_.read(begin, size) || u32_at(size) > kHeaderBytesMax) return torn(begin, message);
    header_.resize(u32_at(size));
    const std::uint64_t data_at = begin + 8 + header_.size();
    if (!file_.read(begin + 4, header_) || !file_.read(data_at - 4, size)) return torn(begin, message);
    const std::uint32_t data_bytes = u32_at(size);
    const Op op = op_of(header_);
    at_ = data_at + data_bytes;
    if (op == Op::kChunk) return read_chunk(data_at, data_bytes, message);
    if (at_ > file_.size_bytes()) return torn(begin, message);
    if (op == Op::kBagHeader) {
        const Bytes index = field(header_, "index_pos");
        is_unclosed_ = std::all_of(index.begin(), index.end(), [](std::uint8_t byte) { return byte == 0; });
    }
    if (op != Op::kMessage && op != Op::kConnection) {
        return op == Op::kBagHeader || op == Op::kIndex || op == Op::kChunkInfo ? Status::kNotFound
                                                                                : torn(begin, message);
    }
    if (data_bytes > kBagPieceBytesMax) return torn(begin, message);
    packed_.resize(data_bytes);
    if (!file_.read(data_at, packed_)) return torn(begin, message);
    const Status status = take({header_, packed_}, out);
    return status == Status::kCorrupt ? torn(begin, message) : status;
}

Status Ros1Reader::read_chunk(std::uint64_t at, std::uint32_t data_bytes, std::string& message) {
    const std::string_view name = text_field(header_, "compression");
    const Packing packing = packing_named(name);
    std::uint32_t size = 0;
    if (!number_field(header_, "size", size) || packing == Packing::kUnknown || packing == Packing::kZstd) {
        message = name_ + ": a chunk at byte " + std::to_string(at) + " is packed as '" +
                  std::string(name.substr(0, 20)) + "', which is not known: passed over.";
        if (at_ > file_.size_bytes()) return torn(at, message);
        return Status::kCorrupt;
    }
    if (data_bytes == 0) return Status::kNotFound;  // never finished: its records follow, if they are not packed
    if (size > kBagPieceBytesMax || data_bytes > kBagPieceBytesMax) {
        message = name_ + ": a chunk at byte " + std::to_string(at) + " is larger than " +
                  std::to_string(kBagPieceBytesMax >> 20U) +
                  " MiB: passed over; 'rosbag record --chunksize=1024' "
                  "makes smaller ones.";
        if (at_ > file_.size_bytes()) return torn(at, message);
        return Status::kCorrupt;
    }
    const std::uint64_t there =
        std::min<std::uint64_t>(data_bytes, file_.size_bytes() - std::min(at, file_.size_bytes()));
    is_chunk_torn_ = there < data_bytes;
    if (is_chunk_torn_ && packing != Packing::kNone) return torn(at, message);
    std::vector<std::uint8_t>& packed = packing == Packing::kNone ? chunk_ : packed_;
    packed.resize(static_cast<std::size_t>(there));
    bool is_whole = file_.read(at, packed);
    if (packing != Packing::kNone) {
        chunk_.resize(size);
        is_whole = is_whole && unpack(packing, packed_, chunk_);
    }
    chunk_next_ = 0;
    chunk_at_ = at;
    if (is_whole) return Status::kNotFound;
    chunk_.clear();
    message = name_ + ": the chunk at byte " + std::to_string(at) + " is damaged: its images were passed over.";
    return Status::kCorrupt;
}

Status Ros1Reader::read_chunk_record(BagMessage& out, std::string& message) {
    const Bytes rest = Bytes(chunk_).subspan(chunk_next_);
    const auto broken = [&] {
        if (is_chunk_torn_) return torn(chunk_at_ + chunk_next_, message);
        chunk_.clear();
        chunk_next_ = 0;
        message = name_ + ": the chunk at byte " + std::to_string(chunk_at_) +
                  " is damaged: the rest of its images was passed over.";
        return Status::kCorrupt;
    };
    if (rest.size() < 8) return broken();
    const std::size_t header_bytes = u32_at(rest);
    if (header_bytes > rest.size() - 8) return broken();
    const std::size_t data_bytes = u32_at(rest, 4 + header_bytes);
    if (data_bytes > rest.size() - 8 - header_bytes) return broken();
    chunk_next_ += 8 + header_bytes + data_bytes;
    const Status status = take({rest.subspan(4, header_bytes), rest.subspan(8 + header_bytes, data_bytes)}, out);
    return status == Status::kCorrupt ? broken() : status;
}

Status Ros1Reader::take(const Record& record, BagMessage& out) {
    const Op op = op_of(record.header);
    if (op == Op::kConnection) take_connection(record);
    if (op == Op::kNone) return Status::kCorrupt;
    std::uint32_t connection = 0;
    if (op != Op::kMessage) return Status::kNotFound;
    const Bytes time = field(record.header, "time");
    if (!number_field(record.header, "conn", connection) || time.size() != 8) return Status::kCorrupt;
    const auto at = places_.find(connection);
    if (at == places_.end() || !(*topics_)[at->second].is_wanted) return Status::kNotFound;
    out = {at->second, std::int64_t{u32_at(time)} * kSecond_ns + u32_at(time, 4), record.data};
    return Status::kOk;
}

void Ros1Reader::take_connection(const Record& record) {
    std::uint32_t connection = 0;
    const std::string_view topic = text_field(record.header, "topic");
    const std::string_view type = text_field(record.data, "type");
    if (!number_field(record.header, "conn", connection) || places_.size() >= kConnectionsMax) return;
    if (const auto place = topics_->place_of(topic, type, MessageLayout::kRos1)) places_[connection] = *place;
}

}  // namespace stillmesh
