// The bytes of a bag's file, read piece by piece from where they are wanted, and what is packed in them unpacked. Only
// regular files are opened, and nothing waits. Memory: none of its own; liblz4 and libbz2 take some MiB while they
// unpack, libzstd unpacks in one go, without a window of its own.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

// Of a chunk, packed and unpacked, and of a message: usual recorders make chunks of 768 KiB to 4 MiB, and an image of
// 4096x4096 with three bytes a pixel has 48.
inline constexpr std::size_t kBagPieceBytesMax = std::size_t{64} << 20U;

class BagFile {
public:
    BagFile() = default;
    ~BagFile() { close(); }
    BagFile(const BagFile&) = delete;
    BagFile& operator=(const BagFile&) = delete;

    // kUnavailable: no such file, or no regular one; `message` says so.
    [[nodiscard]] Status open(const std::string& file, std::string& message);
    void close() noexcept;
    [[nodiscard]] std::uint64_t size_bytes() const noexcept { return size_bytes_; }
    // All of `into`, from byte `at` on. False: the file ends before that, or the disk fails.
    [[nodiscard]] bool read(std::uint64_t at, std::span<std::uint8_t> into) const noexcept;

private:
    int descriptor_ = -1;
    std::uint64_t size_bytes_ = 0;
};

enum class Packing : std::uint8_t { kNone, kBz2, kLz4, kZstd, kUnknown };
[[nodiscard]] Packing packing_named(std::string_view name) noexcept;  // as bags call it; "": kNone

// Exactly `out`'s size comes out. False: broken, or of another size. Any bytes are safe.
[[nodiscard]] bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) noexcept;

// A message that was packed alone, as rosbag2 does it with zstd; other bytes are left alone. False: broken, or larger
// than kBagPieceBytesMax.
[[nodiscard]] bool unpack_message(std::span<const std::uint8_t>& bytes, std::vector<std::uint8_t>& buffer);

}  // namespace stillmesh
