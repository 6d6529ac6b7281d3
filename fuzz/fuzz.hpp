// What every target shares: an entry point, a reader that turns bytes into numbers, and a promise check that stops with
// a sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>
#include <string_view>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes);

namespace stillmesh::fuzz {

// Stops unless the promise was kept; libFuzzer then saves the input.
inline void expect(bool was_kept, std::string_view promise) {
    if (was_kept) return;
    std::fprintf(stderr, "promise broken: %.*s\n", static_cast<int>(promise.size()), promise.data());
    std::abort();
}

// Numbers from bytes; zeros once they run out.
class Bytes {
public:
    explicit Bytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
    [[nodiscard]] bool is_empty() const { return bytes_.empty(); }
    [[nodiscard]] std::size_t left_bytes() const { return bytes_.size(); }
    [[nodiscard]] std::uint8_t u8() {
        if (bytes_.empty()) return 0;
        const std::uint8_t value = bytes_.front();
        bytes_ = bytes_.subspan(1);
        return value;
    }
    [[nodiscard]] std::uint16_t u16() {
        const std::uint32_t low = u8();
        return static_cast<std::uint16_t>(low | static_cast<std::uint32_t>(u8()) << 8);
    }
    [[nodiscard]] std::uint32_t u32() {
        const std::uint32_t low = u16();
        return low | static_cast<std::uint32_t>(u16()) << 16;
    }
    [[nodiscard]] std::uint64_t u64() {
        const std::uint64_t low = u32();
        return low | static_cast<std::uint64_t>(u32()) << 32;
    }
    [[nodiscard]] std::span<const std::uint8_t> rest() const { return bytes_; }

private:
    std::span<const std::uint8_t> bytes_;
};

}  // namespace stillmesh::fuzz
