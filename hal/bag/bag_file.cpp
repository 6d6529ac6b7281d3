#include "hal/bag/bag_file.hpp"

#include <bzlib.h>
#include <fcntl.h>
#include <lz4frame.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace stillmesh {

Status BagFile::open(const std::string& file, std::string& message) {
    close();
    descriptor_ = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
    struct stat about {};
    if (descriptor_ < 0 || ::fstat(descriptor_, &about) != 0 || !S_ISREG(about.st_mode)) {
        message = file + ": " + (descriptor_ < 0 ? std::strerror(errno) : "not a file") +
                  "; give a bag (.bag, .db3, .mcap) or the folder of one.";
        close();
        return Status::kUnavailable;
    }
    size_bytes_ = static_cast<std::uint64_t>(about.st_size);
    return Status::kOk;
}

void BagFile::close() noexcept {
    if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
    descriptor_ = -1;
    size_bytes_ = 0;
}

bool BagFile::read(std::uint64_t at, std::span<std::uint8_t> into) const noexcept {
    if (at > size_bytes_ || into.size() > size_bytes_ - at) return false;
    while (!into.empty()) {
        const ssize_t count = ::pread(descriptor_, into.data(), into.size(), static_cast<off_t>(at));
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return false;
        at += static_cast<std::uint64_t>(count);
        into = into.subspan(static_cast<std::size_t>(count));
    }
    return true;
}

Packing packing_named(std::string_view name) noexcept {
    if (name.empty() || name == "none") return Packing::kNone;
    if (name == "bz2") return Packing::kBz2;
    if (name == "lz4") return Packing::kLz4;
    if (name == "zstd") return Packing::kZstd;
    return Packing::kUnknown;
}

namespace {

bool unpack_lz4(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) noexcept {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) return false;
    bool is_whole = false;
    while (!packed.empty()) {
        std::size_t taken = packed.size(), made = out.size();
        const std::size_t hint = LZ4F_decompress(context, out.data(), &made, packed.data(), &taken, nullptr);
        if (LZ4F_isError(hint) != 0 || (taken == 0 && made == 0)) break;
        packed = packed.subspan(taken);
        out = out.subspan(made);
        is_whole = hint == 0 && out.empty();
        if (hint == 0) break;
    }
    static_cast<void>(LZ4F_freeDecompressionContext(context));
    return is_whole;
}

bool unpack_zstd(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) noexcept {
    ZSTD_DCtx* const context = ZSTD_createDCtx();
    if (context == nullptr) return false;
    const std::size_t made = ZSTD_decompressDCtx(context, out.data(), out.size(), packed.data(), packed.size());
    static_cast<void>(ZSTD_freeDCtx(context));
    return ZSTD_isError(made) == 0 && made == out.size();
}

}  // namespace

bool unpack(Packing packing, std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) noexcept {
    switch (packing) {
        case Packing::kNone:
            if (packed.size() != out.size()) return false;
            std::copy(packed.begin(), packed.end(), out.begin());
            return true;
        case Packing::kBz2: {
            auto made = static_cast<unsigned int>(out.size());
            auto* const from = reinterpret_cast<char*>(const_cast<std::uint8_t*>(packed.data()));  // it only reads
            return BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(out.data()), &made, from,
                                              static_cast<unsigned int>(packed.size()), 0, 0) == BZ_OK &&
                   made == out.size();
        }
        case Packing::kLz4: return unpack_lz4(packed, out);
        case Packing::kZstd: return unpack_zstd(packed, out);
        case Packing::kUnknown: break;
    }
    return false;
}

bool unpack_message(std::span<const std::uint8_t>& bytes, std::vector<std::uint8_t>& buffer) {
    constexpr std::uint8_t kZstdMagic[] = {0x28, 0xb5, 0x2f, 0xfd};  // no CDR begins so
    if (bytes.size() < 4 || std::memcmp(bytes.data(), kZstdMagic, 4) != 0) return true;
    const unsigned long long size = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
    if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR || size > kBagPieceBytesMax) return false;
    buffer.resize(static_cast<std::size_t>(size));
    if (!unpack(Packing::kZstd, bytes, buffer)) return false;
    bytes = buffer;
    return true;
}

}  // namespace stillmesh
