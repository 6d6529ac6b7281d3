// A recording of a run (platform/record), any bytes: a header that is refused or read back to the same bytes, records
// that are refused or read back to the same bytes, and never a byte looked at behind the end.
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/engine.hpp"
#include "fuzz/fuzz.hpp"
#include "platform/record/recording_format.hpp"

namespace {

using namespace stillmesh;

void records(std::span<const std::byte> bytes) {
    RecordingEntry entry;
    for (;;) {
        const Result<std::size_t> used = decode_entry(bytes, entry);
        if (!used.is_ok()) {
            fuzz::expect(used.status() == Status::kEnd || used.status() == Status::kCorrupt,
                         "a closed list of answers");
            fuzz::expect(used.status() != Status::kEnd || bytes.size() < kRecordingEntryBytesMax,
                         "no record asks for more than the limit");
            return;
        }
        fuzz::expect(used.value() > 0 && used.value() <= bytes.size(), "a record lies inside its bytes");
        std::array<std::byte, kRecordingEntryBytesMax> again{};
        const Result<std::size_t> size =
            entry.is_end ? encode_end(entry.end, entry.end_frames, again) : encode_frame(entry.frame, again);
        fuzz::expect(
            size.is_ok() && size.value() == used.value() &&
                std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(used.value()), again.begin()),
            "what is read is written back to the same bytes");
        bytes = bytes.subspan(used.value());
    }
}

// Gives every record and the header a good CRC, so that what lies behind it is reached.
void mend(std::vector<std::byte>& bytes) {
    const auto u32_at = [&](std::size_t at) {
        std::uint32_t value = 0;
        for (std::size_t i = 0; i < 4; ++i) value |= std::to_integer<std::uint32_t>(bytes[at + i]) << (8 * i);
        return value;
    };
    const auto seal = [&](std::size_t begin, std::size_t body_end) {
        const std::uint32_t crc = crc32(std::span(bytes).subspan(begin, body_end - begin));
        for (std::size_t i = 0; i < 4; ++i) bytes[body_end + i] = static_cast<std::byte>(crc >> (8 * i));
    };
    if (bytes.size() < 20) return;
    std::size_t at = 0;
    if (bytes[0] == std::byte{'S'}) {
        const std::size_t size = u32_at(12);
        if (size > bytes.size() - 20) return;
        seal(0, 16 + size);
        at = 20 + size;
    }
    while (bytes.size() - at >= 8) {
        const std::size_t size = u32_at(at);
        if (size > bytes.size() - at - 8) return;
        seal(at, at + 4 + size);
        at += 8 + size;
    }
}

// "+", a count, so many edits of today's header (place in two bytes, value in one), then records.
std::vector<std::byte> edited_header(std::span<const std::byte> from) {
    std::vector<std::byte> out(kRecordingHeaderBytesMax);
    const Result<std::size_t> size = encode_header(RecordingHeader{}, out);
    fuzz::expect(size.is_ok(), "the default header can be written");
    out.resize(size.value());
    RecordingHeader header;
    RecordingProblem problem;
    fuzz::expect(decode_header(out, header, problem).is_ok(), "and read");
    auto edits = std::to_integer<std::size_t>(from[1]);
    from = from.subspan(2);
    for (; edits > 0 && from.size() >= 3; --edits, from = from.subspan(3)) {
        const auto at = std::to_integer<std::size_t>(from[0]) | std::to_integer<std::size_t>(from[1]) << 8;
        out[at % out.size()] = from[2];
    }
    out.insert(out.end(), from.begin(), from.end());
    return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> bytes(first, first + size_bytes);
    if (size_bytes >= 2 && data[0] == '+') bytes = edited_header(bytes);
    for (int round = 0; round < 2; ++round) {
        RecordingHeader header;
        RecordingProblem problem;
        const Result<std::size_t> used = decode_header(bytes, header, problem);
        if (used.is_ok()) {
            std::vector<std::byte> again(kRecordingHeaderBytesMax);
            const Result<std::size_t> size = encode_header(header, again);
            fuzz::expect(size.is_ok(), "a header that was read can be written");
            RecordingHeader once_more;
            std::vector<std::byte> third(kRecordingHeaderBytesMax);
            fuzz::expect(decode_header(again, once_more, problem).is_ok() && once_more.unknown_keys == 0 &&
                             encode_header(once_more, third).is_ok() && third == again,
                         "and is then the same, whatever order its keys had");
            // The next door: whatever the numbers are, it has an answer.
            const ConfigurationProblem wrong = validate(header.limits);
            if (wrong.key == nullptr) static_cast<void>(validate(header.configuration, header.limits));
            records(std::span<const std::byte>(bytes).subspan(used.value()));
        } else {
            fuzz::expect(used.status() == Status::kEnd || used.status() == Status::kInvalid ||
                             used.status() == Status::kCorrupt || used.status() == Status::kNotFound,
                         "a closed list of answers");
            fuzz::expect(problem.key.back() == '\0', "the key ends");
        }
        records(bytes);
        mend(bytes);
    }
    return 0;
}
