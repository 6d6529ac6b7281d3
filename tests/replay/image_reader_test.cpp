#include "hal/replay/image_reader.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>

#include "engine/base/random.hpp"
#include "hal/replay/replay_camera.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/replay/small_jpeg.hpp"

namespace stillmesh::image_reader_test {
namespace {

using Bytes = std::vector<std::uint8_t>;

[[nodiscard]] Bytes bytes_of(const std::string& text) {
    return {text.begin(), text.end()};
}
[[nodiscard]] Bytes with(Bytes head, const Bytes& body) {
    head.insert(head.end(), body.begin(), body.end());
    return head;
}
[[nodiscard]] Bytes npy(const std::string& type, const std::string& shape, const Bytes& body) {
    std::string head = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }";
    head.resize(118, ' ');
    return with(bytes_of(std::string("\x93NUMPY\x01\0v\0", 10) + head), body);
}
// Each image is 4x2: pixel n of grey is 30 n, of RGB (30 n, 30 n + 1, 30 n + 2), of 16 bits 1000 n + 7.
[[nodiscard]] Bytes grey() {
    return {0, 30, 60, 90, 120, 150, 180, 210};
}
[[nodiscard]] Bytes rgb(std::size_t extra = 0) {
    Bytes out;
    for (const std::uint8_t value : grey()) {
        for (std::uint8_t channel = 0; channel < 3; ++channel)
            out.push_back(static_cast<std::uint8_t>(value + channel));
        out.insert(out.end(), extra, 9);
    }
    return out;
}
[[nodiscard]] Bytes wide(bool is_big_endian) {
    Bytes out;
    for (std::uint32_t n = 0; n < 8; ++n) {
        const std::uint32_t value = 1000 * n + 7;
        out.push_back(static_cast<std::uint8_t>(is_big_endian ? value >> 8U : value));
        out.push_back(static_cast<std::uint8_t>(is_big_endian ? value : value >> 8U));
    }
    return out;
}
[[nodiscard]] Bytes native_wide() {
    return wide(std::endian::native == std::endian::big);
}

struct Written {
    const char* what;
    Bytes file;
    ImageKind kind;
    Bytes pixels;
};

[[nodiscard]] std::vector<Written> all_kinds() {
    Bytes grey_alpha, grey_as_rgb, wide_rgb;  // the high bytes of the last are those of rgb()
    for (const std::uint8_t value : grey()) {
        grey_alpha.insert(grey_alpha.end(), {value, 200});
        grey_as_rgb.insert(grey_as_rgb.end(), 3, value);
    }
    for (const std::uint8_t value : rgb()) wide_rgb.insert(wide_rgb.end(), {value, value});
    const auto png = [](std::uint8_t colour_type, std::uint8_t bits, const Bytes& pixels) {
        return test::encode_png(4, 2, colour_type, bits, pixels);
    };
    return {{"PNG grey", png(SPNG_COLOR_TYPE_GRAYSCALE, 8, grey()), ImageKind::kGrey8, grey()},
            {"PNG 16", png(SPNG_COLOR_TYPE_GRAYSCALE, 16, native_wide()), ImageKind::kGrey16, native_wide()},
            {"PNG RGB", png(SPNG_COLOR_TYPE_TRUECOLOR, 8, rgb()), ImageKind::kRgb8, rgb()},
            {"PNG RGBA", png(SPNG_COLOR_TYPE_TRUECOLOR_ALPHA, 8, rgb(1)), ImageKind::kRgb8, rgb()},
            {"PNG RGB 16", png(SPNG_COLOR_TYPE_TRUECOLOR, 16, wide_rgb), ImageKind::kRgb8, rgb()},
            {"PNG alpha", png(SPNG_COLOR_TYPE_GRAYSCALE_ALPHA, 8, grey_alpha), ImageKind::kRgb8, grey_as_rgb},
            {"PGM", with(bytes_of("P5\n# by hand\n4 2\n255\n"), grey()), ImageKind::kGrey8, grey()},
            {"PGM 16", with(bytes_of("P5 4 2 65535\n"), wide(true)), ImageKind::kGrey16, native_wide()},
            {"PPM", with(bytes_of("P6\n4 2\n255\n"), rgb()), ImageKind::kRgb8, rgb()},
            {"NumPy 16", npy("<u2", "(2, 4)", wide(false)), ImageKind::kGrey16, native_wide()},
            {"NumPy 16, big end", npy(">u2", "(2, 4)", wide(true)), ImageKind::kGrey16, native_wide()},
            {"NumPy 16, a channel", npy("<u2", "(2, 4, 1)", wide(false)), ImageKind::kGrey16, native_wide()},
            {"NumPy RGB", npy("|u1", "(2, 4, 3)", rgb()), ImageKind::kRgb8, rgb()}};
}

// Promise: each kind of file gives its pixels, whatever it is called; alpha is left out, of 16-bit RGB the high byte
// counts. Another size, kind or buffer than expected and a file that was cut off are kCorrupt.
TEST(ImageReader, ReadsWhatPeopleHave) {
    test::TemporaryFolder folder;
    for (const Written& written : all_kinds()) {
        const std::string file = folder.path() + "/image.png";
        test::write_bytes(file, written.file);
        ImageHeader header;
        std::string message;
        ASSERT_EQ(read_image_header(file, header, message), Status::kOk) << written.what << message;
        EXPECT_EQ(header.width, 4U) << written.what;
        EXPECT_EQ(header.height, 2U) << written.what;
        ASSERT_EQ(header.kind, written.kind) << written.what;
        Bytes pixels(written.pixels.size());
        ASSERT_EQ(read_image(file, header, pixels, message), Status::kOk) << written.what << message;
        EXPECT_EQ(pixels, written.pixels) << written.what;
        ImageHeader other = header;
        other.width = 5;
        EXPECT_EQ(read_image(file, other, pixels, message), Status::kCorrupt) << written.what;
        other = header;
        other.kind = header.kind == ImageKind::kRgb8 ? ImageKind::kGrey8 : ImageKind::kRgb8;
        EXPECT_EQ(read_image(file, other, pixels, message), Status::kCorrupt) << written.what;
        Bytes shorter(pixels.size() - 1);
        EXPECT_EQ(read_image(file, header, shorter, message), Status::kCorrupt) << written.what;
        test::write_bytes(file, Bytes(written.file.begin(), written.file.end() - (written.file[0] == 0x89 ? 20 : 1)));
        EXPECT_EQ(read_image(file, header, pixels, message), Status::kCorrupt) << written.what;
        EXPECT_EQ(message.find(file), 0U) << message;
    }
}

// A PNG whose pixel n is the entry n (of as many as fit into the bits) of a palette, and what it looks like.
[[nodiscard]] Bytes encode_palette(std::uint8_t bits, std::uint32_t entries, bool is_clear, Bytes& looks) {
    spng_plte palette{};
    palette.n_entries = entries;
    for (std::uint32_t i = 0; i < entries; ++i) {
        palette.entries[i].red = static_cast<std::uint8_t>(255 - 31 * i);
        palette.entries[i].green = static_cast<std::uint8_t>(17 * i);
        palette.entries[i].blue = static_cast<std::uint8_t>(90 + i);
    }
    Bytes packed(2 * ((4U * bits + 7) / 8), 0);
    looks.clear();
    for (std::uint32_t n = 0; n < 8; ++n) {
        const std::uint32_t index = n % (1U << bits), bit = n % 4 * bits;
        packed[n / 4 * (packed.size() / 2) + bit / 8] |= static_cast<std::uint8_t>(index << (8 - bits - bit % 8));
        const spng_plte_entry& entry = palette.entries[index];
        looks.insert(looks.end(), {entry.red, entry.green, entry.blue});
    }
    spng_ctx* const context = spng_ctx_new(SPNG_CTX_ENCODER);
    spng_ihdr ihdr{};
    ihdr.width = 4;
    ihdr.height = 2;
    ihdr.color_type = SPNG_COLOR_TYPE_INDEXED;
    ihdr.bit_depth = bits;
    spng_trns clear{};
    clear.n_type3_entries = 1;  // the first is transparent
    EXPECT_EQ(spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1), 0);
    EXPECT_EQ(spng_set_ihdr(context, &ihdr), 0);
    EXPECT_EQ(spng_set_plte(context, &palette), 0);
    EXPECT_EQ(is_clear ? spng_set_trns(context, &clear) : 0, 0);
    EXPECT_EQ(spng_encode_image(context, packed.data(), packed.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE), 0);
    std::size_t size = 0;
    int error = 0;
    auto* const bytes = static_cast<std::uint8_t*>(spng_get_png_buffer(context, &size, &error));
    Bytes file(bytes, bytes + size);
    std::free(bytes);
    spng_ctx_free(context);
    return file;
}

// Promise: a PNG with a palette of 1, 2, 4 or 8 bits is colour: each pixel is its entry, a transparent one too; an
// index that the palette does not have never gives another pixel's bytes.
TEST(ImageReader, Palettes) {
    test::TemporaryFolder folder;
    const std::string file = folder.path() + "/image.png";
    for (const std::uint8_t bits : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{4}, std::uint8_t{8}}) {
        for (const bool is_clear : {false, true}) {
            Bytes looks;
            test::write_bytes(file, encode_palette(bits, std::min(8U, 1U << bits), is_clear, looks));
            ImageHeader header;
            std::string message;
            ASSERT_EQ(read_image_header(file, header, message), Status::kOk) << message;
            EXPECT_EQ(header.kind, ImageKind::kRgb8);
            Bytes pixels(24);
            ASSERT_EQ(read_image(file, header, pixels, message), Status::kOk) << message;
            EXPECT_EQ(pixels, looks) << int{bits} << is_clear;
        }
    }
    Bytes looks;
    test::write_bytes(file, encode_palette(8, 4, false, looks));  // its entries from the fifth on are black
    ImageHeader header;
    std::string message;
    ASSERT_EQ(read_image_header(file, header, message), Status::kOk) << message;
    Bytes pixels(24, 77);
    const Status status = read_image(file, header, pixels, message);
    EXPECT_TRUE(status == Status::kCorrupt || pixels == looks) << status_name(status);
}

// Promise: JPEG is read where the build has it, and named with two ways out where it has not; a cut one is never taken
// for a whole one.
TEST(ImageReader, Jpeg) {
    const std::span<const std::uint8_t> jpeg(test::kSmallJpeg);
    ImageHeader header;
    std::string message;
    const Status status = decode_other_image(jpeg, "colour/1.jpg", header, {}, message);
    if (status == Status::kInvalid) {
        EXPECT_NE(message.find("-DSTILLMESH_WITH_JPEG=ON"), std::string::npos) << message;
        EXPECT_NE(message.find("mogrify -format png 'colour'"), std::string::npos) << message;
        return;
    }
    ASSERT_EQ(status, Status::kOk) << message;
    EXPECT_EQ(header.width, 16U);
    EXPECT_EQ(header.kind, ImageKind::kRgb8);
    Bytes pixels(std::size_t{16} * 16 * 3);
    ASSERT_EQ(decode_other_image(jpeg, "x", header, pixels, message), Status::kOk) << message;
    const std::uint8_t* const left = &pixels[std::size_t{4 * 16 + 2} * 3];
    const std::uint8_t* const right = &pixels[std::size_t{4 * 16 + 13} * 3];
    EXPECT_NEAR(left[0], 200, 12);
    EXPECT_NEAR(left[2], 40, 12);
    EXPECT_NEAR(right[0], 30, 12);
    EXPECT_NEAR(right[2], 200, 12);
    for (std::size_t size = 3; size + 4 < jpeg.size(); size += 7) {
        EXPECT_EQ(decode_other_image(jpeg.first(size), "x", header, pixels, message), Status::kCorrupt) << size;
        header = {16, 16, ImageKind::kRgb8};
    }
}

// Promise: what is not read is named, with a command that converts the folder.
TEST(ImageReader, NamesOtherFormats) {
    ImageHeader header;
    std::string message;
    for (const auto& [begin, name] :
         {std::pair{"II*", "is TIFF"}, {"MM", "is TIFF"}, {"RIFF", "is WebP"}, {"BM", "is BMP"}}) {
        Bytes bytes = bytes_of(begin);
        bytes.resize(64);
        EXPECT_EQ(decode_other_image(bytes, "depth/1.tif", header, {}, message), Status::kInvalid);
        EXPECT_NE(message.find(name), std::string::npos) << message;
        EXPECT_NE(message.find("mogrify -format png -define png:bit-depth=16 'depth'/*.tif"), std::string::npos)
            << message;
    }
    // What stands in an image's place when it was never fetched.
    for (const auto& [text, name] :
         {std::pair{"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
                    "is a pointer of Git LFS, not the image itself; fetch it: git lfs pull"},
          {"<!DOCTYPE html><html><head>", "is a page of the web, not an image; download it again"},
          {"<html>", "is a page of the web"}}) {
        EXPECT_EQ(decode_other_image(bytes_of(text), "rgb/1.png", header, {}, message), Status::kInvalid);
        EXPECT_NE(message.find(name), std::string::npos) << message;
        const test::TemporaryFolder folder;
        test::write_text(folder.path("1.png"), text);
        EXPECT_EQ(read_image_header(folder.path("1.png"), header, message), Status::kInvalid);
        EXPECT_NE(message.find(name), std::string::npos) << message;
    }
    EXPECT_EQ(decode_other_image(npy("<f4", "(2, 4)", Bytes(32)), "a.npy", header, {}, message), Status::kInvalid);
    EXPECT_NE(message.find("a NumPy array of type '<f4' and shape (2, 4)"), std::string::npos) << message;
}

// Promise: any bytes are a sentence or an image, in a buffer of its size.
TEST(ImageReader, AnyBytesAreSafe) {
    Random random(4);
    for (const Written& written : all_kinds()) {
        for (int i = 0; i < 300; ++i) {
            Bytes bytes = written.file;
            for (std::uint32_t k = 1 + random.below(4); k > 0; --k) {
                bytes[random.below(static_cast<std::uint32_t>(bytes.size()))] =
                    static_cast<std::uint8_t>(random.below(256));
            }
            ImageHeader header;
            std::string message;
            if (decode_other_image(bytes, "x", header, {}, message) != Status::kOk) {
                EXPECT_FALSE(message.empty());
                continue;
            }
            const std::size_t size = std::size_t{header.width} * header.height * bytes_per_pixel(header.kind);
            Bytes pixels(std::min<std::size_t>(size, std::size_t{1} << 20U));
            if (!pixels.empty()) static_cast<void>(decode_other_image(bytes, "x", header, pixels, message));
        }
    }
}

[[nodiscard]] Bytes depth_png(std::uint32_t width, std::uint32_t height) {
    Bytes pixels(std::size_t{width} * height * 2);
    for (std::size_t i = 0; i < pixels.size() / 2; ++i) {
        const auto value = static_cast<std::uint16_t>(1000 + 100 * (i / width) + i % width);
        std::memcpy(&pixels[2 * i], &value, 2);
    }
    return test::encode_png(width, height, SPNG_COLOR_TYPE_GRAYSCALE, 16, pixels);
}

// Promise: depth in larger or smaller pixels than colour is carried over, pixel by pixel; other ratios are refused.
TEST(ReplayImages, DepthOfAnotherWholeRatio) {
    for (const auto& [width, height] : {std::pair{32U, 24U}, {16U, 12U}, {128U, 96U}}) {
        test::TemporaryFolder folder;
        test::write_recording(folder.path());
        for (const char* const name : {"0", "1", "2"}) {
            test::write_bytes(folder.path() + "/depth/" + name + ".png", depth_png(width, height));
        }
        ReplayCamera camera({.folder = folder.path(), .calibration = ""});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_EQ(camera.counts().depth_width, width);
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
        ASSERT_EQ(frame.depth.width, 64U);
        for (std::uint32_t y = 0; y < 48; ++y) {
            for (std::uint32_t x = 0; x < 64; ++x) {
                const std::uint32_t value = 1000 + 100 * (y * height / 48) + x * width / 64;
                ASSERT_EQ(frame.depth.row(y)[x], value) << x << " " << y << " of " << width;
            }
        }
    }
    for (const auto& [width, height] : {std::pair{48U, 36U}, {32U, 48U}, {320U, 120U}}) {
        test::TemporaryFolder folder;
        test::write_recording(folder.path());
        test::write_bytes(folder.path() + "/depth/0.png", depth_png(width, height));
        ReplayCamera camera({.folder = folder.path(), .calibration = ""});
        EXPECT_EQ(camera.open(), Status::kInvalid);
        EXPECT_NE(camera.message().find("register depth to colour"), std::string::npos) << camera.message();
    }
}

// Promise: of colour in 16-bit grey the high byte is given out.
TEST(ReplayImages, WideGreyColour) {
    test::TemporaryFolder folder;
    test::write_recording(folder.path());
    for (const char* const name : {"0", "1", "2"}) {
        test::write_bytes(folder.path() + "/rgb/" + name + ".png", depth_png(64, 48));
    }
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_TRUE(camera.counts().is_colour_wide);
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
    EXPECT_EQ(frame.format, PixelFormat::kGrey8);
    EXPECT_EQ(frame.colour.row(47)[63], (1000 + 4700 + 63) / 256);
}

}  // namespace
}  // namespace stillmesh::image_reader_test
