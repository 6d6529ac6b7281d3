// PNG files: any bytes give either a sentence or a whole image, never more bytes than the buffer holds, and never an
// image of another size or kind than expected.
#include <algorithm>
#include <string>
#include <vector>

#include "fuzz/fuzz.hpp"
#include "hal/replay/png_reader.hpp"

#ifdef STILLMESH_LIBFUZZER
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size_bytes, std::size_t size_max_bytes);

namespace {

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = 0xffffffffU;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
    }
    return ~crc;
}

}  // namespace

// Mutated bytes get the checksums of their chunks right nine times of ten, else nothing behind them would be reached.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size_bytes, std::size_t size_max_bytes,
                                               unsigned int seed) {
    const std::size_t mutated_bytes = LLVMFuzzerMutate(data, size_bytes, size_max_bytes);
    if (seed % 10 == 0) return mutated_bytes;
    std::size_t at = 8;
    while (mutated_bytes >= 12 && at <= mutated_bytes - 12) {
        std::size_t length = 0;
        for (std::size_t i = 0; i < 4; ++i) length = length << 8 | data[at + i];
        if (length > mutated_bytes - 12 - at) break;
        const std::uint32_t crc = crc_of({data + at + 4, length + 4});
        for (std::size_t i = 0; i < 4; ++i) data[at + 8 + length + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
        at += 12 + length;
    }
    return mutated_bytes;
}
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    using namespace stillmesh;
    constexpr std::uint32_t kSideMax = 256;  // a limit as replay has one
    const std::span<const std::uint8_t> bytes(data, size_bytes);
    ImageHeader header;
    std::string message;
    const Status status = decode_png_header(bytes, "file", header, message);
    fuzz::expect((status == Status::kOk) == message.empty(), "a sentence for an error, and only for an error");
    fuzz::expect(status == Status::kOk || status == Status::kCorrupt || status == Status::kInvalid,
                 "a bad header is kCorrupt or kInvalid");
    if (status != Status::kOk) header = {8, 6, ImageKind::kGrey8};
    if (header.width > kSideMax || header.height > kSideMax) return 0;
    fuzz::expect(header.width > 0 && header.height > 0, "an image has pixels");

    std::vector<std::uint8_t> pixels(std::size_t{header.width} * header.height * bytes_per_pixel(header.kind));
    const Status decoded = decode_png(bytes, "file", header, pixels, message);
    fuzz::expect(status == Status::kOk || decoded != Status::kOk, "no image without a header");
    fuzz::expect(decoded == Status::kOk || !message.empty(), "an error has a sentence");

    // Another size, kind or buffer than expected is refused, and the buffer is left alone.
    std::fill(pixels.begin(), pixels.end(), std::uint8_t{0xa5});
    ImageHeader other = header;
    other.width += 1;
    fuzz::expect(decode_png(bytes, "file", other, pixels, message) != Status::kOk, "the width is compared");
    other = header;
    other.height += 1;
    fuzz::expect(decode_png(bytes, "file", other, pixels, message) != Status::kOk, "the height is compared");
    other = header;
    other.kind = header.kind == ImageKind::kGrey8 ? ImageKind::kGrey16 : ImageKind::kGrey8;
    fuzz::expect(decode_png(bytes, "file", other, pixels, message) != Status::kOk, "the kind is compared");
    const std::span<std::uint8_t> short_buffer = std::span(pixels).first(pixels.size() - 1);
    fuzz::expect(decode_png(bytes, "file", header, short_buffer, message) != Status::kOk, "the buffer is compared");
    fuzz::expect(std::all_of(pixels.begin(), pixels.end(), [](std::uint8_t byte) { return byte == 0xa5; }),
                 "a refused image leaves the buffer alone");
    return 0;
}
