// Small recordings in memory, encoded as the program does.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "platform/record/recording_format.hpp"

namespace stillmesh::test {

using ByteVector = std::vector<std::byte>;

inline RecordingHeader some_header() {
    RecordingHeader header;
    header.limits = Limits::tiny();
    header.configuration.features.count = 100;
    header.configuration.features.levels = 3;
    header.configuration.seed = 0x1f0123456789abULL;
    header.camera = {160, 120, 131.5, 132.5, 79.5, 59.5, 0.1, -0.2, 0.001, -0.002, 0.3};
    header.depth_units_per_m = 5000;
    return header;
}

inline RecordedFrame some_frame(std::uint64_t index) {
    RecordedFrame frame;
    frame.index = index;
    frame.time_ns = 1'000'000'000 + static_cast<std::int64_t>(index) * 33'333'333;
    frame.digest = 0x0123456789abcdefULL + index;
    frame.pose_state = 3;
    frame.is_keyframe = index == 0;
    frame.features = 100;
    frame.matches = 90;
    frame.static_matches = 80;
    frame.groups = 2;
    frame.hash_tracked = 0x1111111111111111ULL;
    frame.hash = 0x2222222222222222ULL;
    for (std::uint32_t i = 0; i < 10; ++i) {
        if (!frame.add_grant(2000)) throw std::logic_error("no room for ten equal grants");
    }
    return frame;
}

template <typename Encode>
ByteVector encoded(std::size_t bytes_max, Encode&& encode) {
    ByteVector bytes(bytes_max);
    const Result<std::size_t> size = encode(std::span<std::byte>(bytes));
    if (!size.is_ok()) throw std::logic_error("does not fit");
    bytes.resize(size.value());
    return bytes;
}
inline ByteVector header_bytes(const RecordingHeader& header) {
    return encoded(kRecordingHeaderBytesMax, [&](std::span<std::byte> out) { return encode_header(header, out); });
}
inline ByteVector frame_bytes(const RecordedFrame& frame) {
    return encoded(kRecordingEntryBytesMax, [&](std::span<std::byte> out) { return encode_frame(frame, out); });
}
inline ByteVector end_bytes(RecordingEnd end, std::uint64_t frames) {
    return encoded(kRecordingEntryBytesMax, [&](std::span<std::byte> out) { return encode_end(end, frames, out); });
}
inline void append(ByteVector& to, const ByteVector& bytes) {
    to.insert(to.end(), bytes.begin(), bytes.end());
}
inline ByteVector recording_of(std::uint64_t frames) {
    ByteVector all = header_bytes(some_header());
    for (std::uint64_t i = 0; i < frames; ++i) append(all, frame_bytes(some_frame(i)));
    append(all, end_bytes(RecordingEnd::kDone, frames));
    return all;
}

}  // namespace stillmesh::test
