#include "hal/bag/mcap_reader.hpp"

#include <algorithm>
#include <array>

#include "engine/base/crc.hpp"

namespace stillmesh {
namespace {

constexpr std::array<std::uint8_t, 8> kMagic = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr std::size_t kRecordHeadBytes = 9;
constexpr std::size_t kChunkHeadBytesMax = 8 + 8 + 8 + 4 + 4 + 64 + 8;  // with the name of a packing

enum Kind : std::uint8_t { kSchema = 3, kChannel = 4, kMessage = 5, kChunk = 6, kDataEnd = 15, kLastKind = 15 };

using Bytes = std::span<const std::uint8_t>;

// Numbers and texts of a record. What runs out stays failed and gives zeros.
class Fields {
public:
    explicit Fields(Bytes bytes) : bytes_(bytes) {}
    [[nodiscard]] bool is_ok() const { return is_ok_; }
    [[nodiscard]] Bytes rest() const { return bytes_; }
    [[nodiscard]] std::uint64_t number(std::size_t size) {
        std::uint64_t value = 0;
        const Bytes bytes = take(size);
        for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::uint64_t{bytes[i]} << (8 * i);
        return value;
    }
    [[nodiscard]] std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
    [[nodiscard]] std::string_view text() {
        const Bytes bytes = take(number(4));
        return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    }

private:
    [[nodiscard]] Bytes take(std::uint64_t size) {
        if (!is_ok_ || size > bytes_.size()) {
            is_ok_ = false;
            return {};
        }
        const Bytes out = bytes_.first(static_cast<std::size_t>(size));
        bytes_ = bytes_.subspan(static_cast<std::size_t>(size));
        return out;
    }
    Bytes bytes_;
    bool is_ok_ = true;
};

}  // namespace

Status McapReader::open(const std::string& file, BagTopics& topics, std::string& message) {
    name_ = file;
    topics_ = &topics;
    STILLMESH_TRY(file_.open(file, message));
    std::array<std::uint8_t, kMagic.size()> magic{};
    if (!file_.read(0, magic) || magic != kMagic) {
        message = file + ": is an MCAP file of another version than 0, or its beginning is lost.";
        return Status::kInvalid;
    }
    at_ = kMagic.size();
    return Status::kOk;
}

Status McapReader::damaged(std::uint64_t at, const char* what, std::string& message) const {
    message = name_ + ": the chunk at byte " + std::to_string(at) + " " + what + ".";
    return Status::kCorrupt;
}

Status McapReader::read_file_record(BagMessage& out, std::string& message) {
    if (at_ == file_.size_bytes()) return Status::kEnd;
    const std::uint64_t begin = at_;
    std::array<std::uint8_t, kRecordHeadBytes> head{};
    if (!file_.read(begin, head)) return torn(begin, message);
    const std::uint8_t kind = head[0];
    const std::uint64_t size = Fields(Bytes(head).subspan(1)).number(8);
    const std::uint64_t data_at = begin + kRecordHeadBytes;
    const bool is_whole = size <= file_.size_bytes() - data_at;
    if (kind == 0 || (kind > kLastKind && kind < 0x80)) return torn(begin, message);  // 0x80 on: of others
    if (kind == kChunk) return read_chunk(data_at, size, message);
    if (!is_whole) return torn(begin, message);
    at_ = data_at + size;
    if (kind == kDataEnd) {
        is_unclosed_ = false;
        at_ = file_.size_bytes();
    }
    if (kind != kSchema && kind != kChannel && kind != kMessage) return Status::kNotFound;
    if (size > kBagPieceBytesMax) return torn(begin, message);
    packed_.resize(static_cast<std::size_t>(size));
    if (!file_.read(data_at, packed_)) return torn(begin, message);
    const Status status = take(kind, packed_, out);
    return status == Status::kCorrupt ? torn(begin, message) : status;
}

Status McapReader::read_chunk(std::uint64_t at, std::uint64_t size, std::string& message) {
    const std::uint64_t left = file_.size_bytes() - at;
    const std::uint64_t there = std::min(size, left);
    std::array<std::uint8_t, kChunkHeadBytesMax> head{};
    const std::size_t head_bytes = static_cast<std::size_t>(std::min<std::uint64_t>(there, head.size()));
    if (!file_.read(at, std::span(head).first(head_bytes))) return torn(at, message);
    Fields fields(Bytes(head).first(head_bytes));
    static_cast<void>(fields.number(8)), static_cast<void>(fields.number(8));  // times
    const std::uint64_t unpacked_bytes = fields.number(8);
    const auto crc = static_cast<std::uint32_t>(fields.number(4));
    const Packing packing = packing_named(fields.text());
    const std::uint64_t packed_bytes = fields.number(8);
    const std::uint64_t packed_at = at + head_bytes - fields.rest().size();
    is_chunk_torn_ = size > left;
    if (!fields.is_ok() || (is_chunk_torn_ && packing != Packing::kNone)) return torn(at, message);
    at_ = at + there;
    if (packing == Packing::kUnknown || packing == Packing::kBz2) {
        return damaged(at, "is packed in a way that is not known: passed over", message);
    }
    if (unpacked_bytes > kBagPieceBytesMax || packed_bytes > kBagPieceBytesMax) {
        return damaged(at, "is larger than 64 MiB: passed over; record with smaller chunks (chunkSize)", message);
    }
    if (!is_chunk_torn_ && packed_bytes > at_ - packed_at) return damaged(at, "is damaged: passed over", message);
    std::vector<std::uint8_t>& packed = packing == Packing::kNone ? chunk_ : packed_;
    packed.resize(static_cast<std::size_t>(std::min(packed_bytes, at_ - packed_at)));
    bool is_whole = file_.read(packed_at, packed);
    if (packing != Packing::kNone) {
        chunk_.resize(static_cast<std::size_t>(unpacked_bytes));
        is_whole = is_whole && unpack(packing, packed_, chunk_);
    }
    if (is_whole && crc != 0 && !is_chunk_torn_) is_whole = crc32(std::as_bytes(std::span(chunk_))) == crc;
    chunk_next_ = 0;
    chunk_at_ = at;
    if (is_whole) return Status::kNotFound;
    chunk_.clear();
    return damaged(at, "is damaged: its images were passed over", message);
}

Status McapReader::read_chunk_record(BagMessage& out, std::string& message) {
    Fields fields(Bytes(chunk_).subspan(chunk_next_));
    const auto kind = static_cast<std::uint8_t>(fields.number(1));
    const std::uint64_t size = fields.number(8);
    Status status = Status::kCorrupt;
    if (fields.is_ok() && size <= fields.rest().size()) {
        chunk_next_ += kRecordHeadBytes + static_cast<std::size_t>(size);
        status = take(kind, fields.rest().first(static_cast<std::size_t>(size)), out);
    }
    if (status != Status::kCorrupt) return status;
    if (is_chunk_torn_) return torn(chunk_at_, message);
    chunk_.clear();
    chunk_next_ = 0;
    return damaged(chunk_at_, "is damaged: the rest of its images was passed over", message);
}

Status McapReader::take(std::uint8_t kind, std::span<const std::uint8_t> data, BagMessage& out) {
    Fields fields(data);
    if (kind == kSchema) {
        const std::uint16_t id = fields.u16();
        types_[id] = std::string(fields.text().substr(0, kTopicNameMax));
    } else if (kind == kChannel) {
        const std::uint16_t id = fields.u16();
        const auto type = types_.find(fields.u16());
        const std::string_view topic = fields.text();
        const std::string_view encoding = fields.text();
        places_.erase(id);
        if (!fields.is_ok()) return Status::kCorrupt;
        if (type == types_.end() || (encoding != "cdr" && encoding != "ros1")) return Status::kNotFound;
        const MessageLayout layout = encoding == "cdr" ? MessageLayout::kCdr : MessageLayout::kRos1;
        if (const auto place = topics_->place_of(topic, type->second, layout)) places_[id] = *place;
    } else if (kind == kMessage) {
        const auto place = places_.find(fields.u16());
        static_cast<void>(fields.number(4));
        const std::uint64_t time_ns = fields.number(8);
        static_cast<void>(fields.number(8));
        if (!fields.is_ok()) return Status::kCorrupt;
        if (place == places_.end() || !(*topics_)[place->second].is_wanted) return Status::kNotFound;
        out = {place->second, static_cast<std::int64_t>(time_ns & 0x7fffffffffffffffU), fields.rest()};
        return Status::kOk;
    }
    return fields.is_ok() ? Status::kNotFound : Status::kCorrupt;
}

}  // namespace stillmesh
