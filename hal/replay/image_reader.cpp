#include "hal/replay/image_reader.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>
#include <vector>

#include "hal/replay/jpeg_decoder.hpp"
#include "hal/replay/png_reader.hpp"

namespace stillmesh {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::uint32_t kSideMax = 16384;  // larger than any image of ours

// The file's bytes, or its first ones; kept from image to image.
thread_local std::vector<std::uint8_t> file_bytes;

[[nodiscard]] bool begins_with(Bytes bytes, std::string_view letters, std::size_t at = 0) {
    return bytes.size() >= at + letters.size() && std::memcmp(bytes.data() + at, letters.data(), letters.size()) == 0;
}
[[nodiscard]] bool is_png(Bytes bytes) {
    return begins_with(bytes, "\x89PNG");
}
[[nodiscard]] bool is_jpeg(Bytes bytes) {
    return begins_with(bytes, "\xff\xd8\xff");
}
[[nodiscard]] bool is_pnm(Bytes bytes) {
    return begins_with(bytes, "P5") || begins_with(bytes, "P6");
}
[[nodiscard]] bool is_npy(Bytes bytes) {
    return begins_with(bytes, "\x93NUMPY");
}

struct OtherFormat {
    std::string_view letters;
    const char* name;
    const char* extension;
};
// What is not read: by the letters that it begins with.
constexpr OtherFormat kOtherFormats[] = {{"II*", "TIFF", "tiff"},
                                         {"MM", "TIFF", "tiff"},
                                         {"RIFF", "WebP", "webp"},
                                         {"BM", "BMP", "bmp"},
                                         {"GIF8", "GIF", "gif"},
                                         {"v/1\x01", "OpenEXR", "exr"},
                                         {"P2", "a PNM of written numbers", "pgm"},
                                         {"P3", "a PNM of written numbers", "ppm"},
                                         {"PF", "PFM", "pfm"},
                                         {"Pf", "PFM", "pfm"}};

struct Stranger {
    std::string_view letters;
    const char* sentence;
};
// What stands in an image's place when it was never fetched.
constexpr Stranger kStrangers[] = {
    {"version https://g",
     "is a pointer of Git LFS, not the image itself; fetch it: git lfs pull, where the recording was cloned."},
    {"<!DOCTYPE", "is a page of the web, not an image; download it again."},
    {"<!doctype", "is a page of the web, not an image; download it again."},
    {"<html", "is a page of the web, not an image; download it again."}};

Status fail(Status status, const std::string& name, const std::string& sentence, std::string& message) {
    message = name + ": " + sentence;
    return status;
}

// A command for a whole folder; a name in quotes of the shell.
[[nodiscard]] std::string conversion(const std::string& name, const OtherFormat& format) {
    const std::size_t slash = name.rfind('/');
    const std::size_t dot = name.rfind('.');
    const bool has_extension = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1);
    const std::string extension = has_extension ? name.substr(dot + 1) : format.extension;
    const std::string folder = slash == std::string::npos ? "." : name.substr(0, slash);
    return "mogrify -format png -define png:bit-depth=16 '" + folder + "'/*." + extension +
           " (ImageMagick; colour without the -define), and name the .png files in the list";
}

// --- PNM -------------------------------------------------------------------------------------------------------------

// The next whole number of a PNM's head, behind blanks and comments; 0: there is none.
[[nodiscard]] std::uint32_t take_number(Bytes& rest) {
    std::size_t i = 0;
    while (i < rest.size() &&
           (rest[i] == ' ' || rest[i] == '\t' || rest[i] == '\r' || rest[i] == '\n' || rest[i] == '#')) {
        if (rest[i] == '#') {
            while (i < rest.size() && rest[i] != '\n') ++i;
        } else {
            ++i;
        }
    }
    std::uint32_t number = 0;
    for (; i < rest.size() && rest[i] >= '0' && rest[i] <= '9' && number < 1000000; ++i)
        number = number * 10 + (rest[i] - '0');
    rest = rest.subspan(i);
    return number;
}

[[nodiscard]] std::uint16_t big_endian(const std::uint8_t* p) {
    return static_cast<std::uint16_t>(p[0] << 8U | p[1]);
}

Status decode_pnm(Bytes bytes, const std::string& name, ImageHeader& header, std::span<std::uint8_t> pixels,
                  std::string& message) {
    const bool is_rgb = bytes[1] == '6';
    Bytes rest = bytes.subspan(2);
    const std::uint32_t width = take_number(rest), height = take_number(rest), most = take_number(rest);
    if (width == 0 || height == 0 || most == 0 || most > 65535 || width > kSideMax || height > kSideMax ||
        rest.empty()) {
        return fail(Status::kCorrupt, name, "the head of this PNM makes no sense; copy the recording again.", message);
    }
    const bool is_wide = most > 255;
    header = {width, height, is_rgb ? ImageKind::kRgb8 : is_wide ? ImageKind::kGrey16 : ImageKind::kGrey8};
    if (pixels.empty()) return Status::kOk;
    rest = rest.subspan(1);  // one blank
    const std::size_t samples = std::size_t{width} * height * (is_rgb ? 3 : 1);
    if (rest.size() < samples * (is_wide ? 2 : 1)) {
        return fail(Status::kCorrupt, name,
                    "the PNM is truncated; copy the recording again or remove this image from its list.", message);
    }
    for (std::size_t i = 0; i < samples; ++i) {
        if (!is_wide) {
            pixels[i] = rest[i];
        } else if (is_rgb) {
            pixels[i] = rest[2 * i];
        } else {
            const std::uint16_t value = big_endian(&rest[2 * i]);
            std::memcpy(&pixels[2 * i], &value, 2);
        }
    }
    return Status::kOk;
}

// --- NumPy -----------------------------------------------------------------------------------------------------------

// What stands behind 'key': in the dictionary of the head, up to a comma outside of brackets.
[[nodiscard]] std::string_view value_of(std::string_view head, std::string_view key) {
    const std::size_t at = head.find(key);
    if (at == std::string_view::npos) return {};
    std::string_view rest = head.substr(at + key.size());
    rest.remove_prefix(std::min(rest.find_first_not_of(": "), rest.size()));
    return rest.substr(0, rest.starts_with('(') ? rest.find(')') : rest.find(','));
}

// The sizes in "(480, 640" or "(480, 640, 3"; false: other dimensions than an image's.
[[nodiscard]] bool read_shape(std::string_view text, std::array<std::uint32_t, 3>& shape) {
    shape = {0, 0, 1};
    std::size_t count = 0;
    for (std::size_t i = 0; (i = text.find_first_of("0123456789", i)) != std::string_view::npos; ++count) {
        if (count == 3) return false;
        const auto [end, error] = std::from_chars(text.data() + i, text.data() + text.size(), shape[count]);
        if (error != std::errc()) return false;
        i = static_cast<std::size_t>(end - text.data());
    }
    return count >= 2 && shape[0] > 0 && shape[1] > 0 && shape[0] <= kSideMax && shape[1] <= kSideMax;
}

Status decode_npy(Bytes bytes, const std::string& name, ImageHeader& header, std::span<std::uint8_t> pixels,
                  std::string& message) {
    const bool is_long = bytes.size() > 6 && bytes[6] >= 2;
    const std::size_t head_at = is_long ? 12 : 10;
    if (bytes.size() < head_at) return fail(Status::kCorrupt, name, "the NumPy array is truncated.", message);
    std::size_t head_size = bytes[8] | std::size_t{bytes[9]} << 8U;
    if (is_long) head_size |= std::size_t{bytes[10]} << 16U | std::size_t{bytes[11]} << 24U;
    head_size = std::min(head_size, bytes.size() - head_at);
    const std::string_view head(reinterpret_cast<const char*>(bytes.data()) + head_at, head_size);
    const std::string_view type = value_of(head, "'descr'");
    const bool is_wide = type == "'<u2'" || type == "'>u2'";
    std::array<std::uint32_t, 3> shape{};
    const bool is_shape = read_shape(value_of(head, "'shape'"), shape);
    const bool is_rgb = shape[2] == 3 && !is_wide;
    if ((!is_wide && type != "'|u1'") || value_of(head, "'fortran_order'") != "False" || !is_shape ||
        (shape[2] != 1 && !is_rgb)) {
        return fail(Status::kInvalid, name,
                    "a NumPy array of type " + std::string(type.substr(0, 20)) + " and shape " +
                        std::string(value_of(head, "'shape'").substr(0, 40)) +
                        "); only rows of uint16 (depth) or uint8 (colour) are read: save depth as np.save(file, "
                        "np.rint(metres * 5000).astype(np.uint16)) and give --depth-units 5000.",
                    message);
    }
    header = {shape[1], shape[0], is_wide ? ImageKind::kGrey16 : is_rgb ? ImageKind::kRgb8 : ImageKind::kGrey8};
    if (pixels.empty()) return Status::kOk;
    const Bytes rest = bytes.subspan(head_at + head_size);
    if (rest.size() < pixels.size()) {
        return fail(Status::kCorrupt, name,
                    "the NumPy array is truncated; copy the recording again or remove this image from its list.",
                    message);
    }
    std::copy_n(rest.begin(), pixels.size(), pixels.begin());
    if (is_wide && (type[1] == '>') == (std::endian::native == std::endian::little)) {
        for (std::size_t i = 0; i + 1 < pixels.size(); i += 2) std::swap(pixels[i], pixels[i + 1]);
    }
    return Status::kOk;
}

// --- files -----------------------------------------------------------------------------------------------------------

// Its first bytes if `is_head`, else all. False: it cannot be read, which the PNG reader says.
[[nodiscard]] bool read_bytes(const std::string& file, bool is_head) {
    constexpr std::size_t kHeadBytes = 32;
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat about {};
    if (descriptor < 0) return false;
    bool is_read = ::fstat(descriptor, &about) == 0 && S_ISREG(about.st_mode);
    const auto size = static_cast<std::size_t>(is_read ? about.st_size : 0);
    file_bytes.resize(std::min(size, is_head ? kHeadBytes : kImageFileBytesMax));
    std::size_t at = 0;
    while (is_read && at < file_bytes.size()) {
        const ssize_t count = ::read(descriptor, file_bytes.data() + at, file_bytes.size() - at);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) break;
        at += static_cast<std::size_t>(count);
    }
    file_bytes.resize(at);
    static_cast<void>(::close(descriptor));
    return is_read;
}

[[nodiscard]] bool is_of_png_reader(const std::string& file) {
    if (!read_bytes(file, true)) return true;
    const auto is_known = [](const auto& format) { return begins_with(file_bytes, format.letters); };
    return is_png(file_bytes) || !(is_jpeg(file_bytes) || is_pnm(file_bytes) || is_npy(file_bytes) ||
                                   std::any_of(std::begin(kOtherFormats), std::end(kOtherFormats), is_known) ||
                                   std::any_of(std::begin(kStrangers), std::end(kStrangers), is_known));
}

}  // namespace

Status decode_other_image(std::span<const std::uint8_t> bytes, const std::string& name, ImageHeader& header,
                          std::span<std::uint8_t> pixels, std::string& message) {
    const ImageHeader expected = header;
    const auto decode = [&](std::span<std::uint8_t> into) {
        if (is_jpeg(bytes)) return decode_jpeg(bytes, name, header, into, message);
        if (is_pnm(bytes)) return decode_pnm(bytes, name, header, into, message);
        if (is_npy(bytes)) return decode_npy(bytes, name, header, into, message);
        for (const OtherFormat& format : kOtherFormats) {
            if (!begins_with(bytes, format.letters)) continue;
            return fail(
                Status::kInvalid, name,
                std::string("is ") + format.name + ", which is not read; convert: " + conversion(name, format) + ".",
                message);
        }
        for (const Stranger& stranger : kStrangers) {
            if (begins_with(bytes, stranger.letters)) return fail(Status::kInvalid, name, stranger.sentence, message);
        }
        return fail(Status::kCorrupt, name, "is no image that is known here.", message);
    };
    STILLMESH_TRY(decode({}));
    if (pixels.empty()) return Status::kOk;
    if (header.width != expected.width || header.height != expected.height || header.kind != expected.kind) {
        return fail(Status::kCorrupt, name,
                    "the image is " + std::to_string(header.width) + "x" + std::to_string(header.height) + ", " +
                        kind_text(header.kind) + ", expected " + std::to_string(expected.width) + "x" +
                        std::to_string(expected.height) + ", " + kind_text(expected.kind) +
                        "; all images of a stream must be of one size and kind.",
                    message);
    }
    if (pixels.size() != std::size_t{header.width} * header.height * bytes_per_pixel(header.kind)) {
        return fail(Status::kCorrupt, name, "the image does not fit its buffer.", message);
    }
    return decode(pixels);
}

Status read_image_header(const std::string& file, ImageHeader& header, std::string& message) {
    if (is_of_png_reader(file)) return read_png_header(file, header, message);
    static_cast<void>(read_bytes(file, false));
    return decode_other_image(file_bytes, file, header, {}, message);
}

Status read_image(const std::string& file, const ImageHeader& expected, std::span<std::uint8_t> pixels,
                  std::string& message) {
    if (is_of_png_reader(file)) return read_png(file, expected, pixels, message);
    static_cast<void>(read_bytes(file, false));
    ImageHeader header = expected;
    return decode_other_image(file_bytes, file, header, pixels, message);
}

}  // namespace stillmesh
