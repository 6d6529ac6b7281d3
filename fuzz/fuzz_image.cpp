// Images that are no PNG (JPEG, PNM, NumPy): any bytes give a sentence or a whole image; never one of another size or
// kind, never a byte outside the buffer.
#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "fuzz/fuzz.hpp"
#include "hal/replay/image_reader.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    using namespace stillmesh;
    constexpr std::uint32_t kSideMax = 256;
    const std::span<const std::uint8_t> bytes(data, size_bytes);
    ImageHeader header;
    std::string message;
    const Status status = decode_other_image(bytes, "file", header, {}, message);
    fuzz::expect((status == Status::kOk) == message.empty(), "a sentence for an error, and only for an error");
    if (status != Status::kOk || header.width > kSideMax || header.height > kSideMax) return 0;
    fuzz::expect(header.width > 0 && header.height > 0, "an image has pixels");
    std::vector<std::uint8_t> pixels(std::size_t{header.width} * header.height * bytes_per_pixel(header.kind));
    ImageHeader expected = header;
    const Status decoded = decode_other_image(bytes, "file", expected, pixels, message);
    fuzz::expect(decoded == Status::kOk || !message.empty(), "an error has a sentence");
    std::fill(pixels.begin(), pixels.end(), std::uint8_t{0xa5});
    expected = header;
    expected.height += 1;
    fuzz::expect(decode_other_image(bytes, "file", expected, pixels, message) != Status::kOk, "the height is compared");
    expected = header;
    const std::span<std::uint8_t> short_buffer = std::span(pixels).first(pixels.size() - 1);
    if (!short_buffer.empty()) {
        fuzz::expect(decode_other_image(bytes, "file", expected, short_buffer, message) != Status::kOk,
                     "the buffer is compared");
    }
    fuzz::expect(std::all_of(pixels.begin(), pixels.end(), [](std::uint8_t byte) { return byte == 0xa5; }),
                 "a refused image leaves the buffer alone");
    return 0;
}
