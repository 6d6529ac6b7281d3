// Every pixel format: what is whole, and that each conversion is exact.
#include "hal/v4l2/pixel_formats.hpp"

#include <gtest/gtest.h>
#ifdef STILLMESH_HAS_JPEG
#include <turbojpeg.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace stillmesh::v4l2::pixel_formats_test {
namespace {

using Bytes = std::vector<std::uint8_t>;

[[nodiscard]] Bytes convert(const V4l2Format& format, const Bytes& bytes, Status expected = Status::kOk) {
    Bytes pixels(std::size_t{format.width} * format.height * channels_of(engine_format(format.fourcc)));
    std::string message;
    EXPECT_EQ(convert_colour(format, bytes, pixels, message), expected) << message;
    EXPECT_EQ(message.empty(), expected == Status::kOk);
    return pixels;
}

// Promise: codes are V4L2's, and come back as text.
TEST(PixelFormats, Codes) {
    EXPECT_EQ(kYuyv, 0x56595559U);
    EXPECT_EQ(kZ16, 0x2036315aU);
    EXPECT_EQ(fourcc_text(kZ16), "Z16");
    EXPECT_EQ(fourcc_text(kMjpg), "MJPG");
    EXPECT_EQ(fourcc_text(0x00010203), "????");
}

// Promise: an image is whole from its last pixel to the end of its buffer; not one byte less, not one more.
TEST(PixelFormats, Whole) {
    const V4l2Format padded{kYuyv, 10, 4, 32, 128};
    EXPECT_FALSE(is_whole(padded, 3 * 32 + 19));
    EXPECT_TRUE(is_whole(padded, 3 * 32 + 20));
    EXPECT_TRUE(is_whole(padded, 128));
    EXPECT_FALSE(is_whole(padded, 129));
    EXPECT_FALSE(is_whole({kYuyv, 10, 4, 19, 128}, 128)) << "lines shorter than their pixels";
    EXPECT_FALSE(is_whole({kGrey, 0, 4, 32, 128}, 128));
    EXPECT_TRUE(is_whole({kMjpg, 10, 4, 0, 128}, 1));
    EXPECT_FALSE(is_whole({kMjpg, 10, 4, 0, 128}, 0));
    EXPECT_FALSE(is_whole({kMjpg, 10, 4, 0, 128}, 129));
}

// Promise: YUV becomes BT.601's RGB, each channel within one and a half of the real number for every Y, U and V that
// cameras send, with black, white and the primaries exact; the same from either order of bytes, with padding, with an
// odd width.
TEST(PixelFormats, Yuv) {
    struct Case {
        std::array<std::uint8_t, 3> yuv, rgb;
    };
    for (const Case& c : {Case{{16, 128, 128}, {0, 0, 0}}, Case{{235, 128, 128}, {255, 255, 255}},
                          Case{{126, 128, 128}, {128, 128, 128}}, Case{{82, 90, 240}, {255, 1, 0}}}) {
        const Bytes bytes{c.yuv[0], c.yuv[1], c.yuv[0], c.yuv[2]};
        const Bytes pixels = convert({kYuyv, 2, 1, 4, 4}, bytes);
        for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(pixels[i], c.rgb[i % 3]);
    }
    for (int y = 16; y <= 235; y += 3) {
        for (int u = 16; u <= 240; u += 7) {
            for (int v = 16; v <= 240; v += 7) {
                const auto byte = [](int value) { return static_cast<std::uint8_t>(value); };
                const Bytes pixels = convert({kYuyv, 2, 1, 4, 4}, {byte(y), byte(u), byte(y), byte(v)});
                const Bytes other = convert({kUyvy, 2, 1, 4, 4}, {byte(u), byte(y), byte(v), byte(y)});
                ASSERT_EQ(pixels, other);
                const double luma = 255.0 / 219 * (y - 16);
                const double real[3] = {luma + 255.0 / 224 * 1.402 * (v - 128),
                                        luma - 255.0 / 224 * (0.344136 * (u - 128) + 0.714136 * (v - 128)),
                                        luma + 255.0 / 224 * 1.772 * (u - 128)};
                for (std::size_t i = 0; i < 3; ++i) {
                    ASSERT_NEAR(pixels[i], std::clamp(real[i], 0.0, 255.0), 1.5) << y << " " << u << " " << v;
                    ASSERT_EQ(pixels[i], pixels[i + 3]);
                }
            }
        }
    }
    // Two rows of three pixels in lines of eight bytes; the last pixel has a U and no V.
    const Bytes odd{100, 90, 110, 200, 120, 90, 0, 0, 100, 90, 110, 200, 120, 90};
    const Bytes pixels = convert({kYuyv, 3, 2, 8, 16}, odd);
    const Bytes pair = convert({kYuyv, 2, 1, 4, 4}, {100, 90, 110, 200});
    EXPECT_TRUE(std::equal(pair.begin(), pair.end(), pixels.begin()));
    EXPECT_TRUE(std::equal(pair.begin(), pair.end(), pixels.begin() + 9));
    // Each pixel has its own Y.
    const Bytes second = convert({kYuyv, 2, 1, 4, 4}, {110, 90, 110, 200});
    EXPECT_TRUE(std::equal(pair.begin() + 3, pair.end(), second.begin()));
    EXPECT_NE(pair[0], pair[3]);
}

// Promise: RGB and grey are copied without their padding; of two interleaved infrared images the left one is taken.
TEST(PixelFormats, Copies) {
    EXPECT_EQ(convert({kRgb3, 2, 2, 8, 16}, {1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12}),
              (Bytes{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
    EXPECT_EQ(convert({kGrey, 3, 2, 4, 8}, {1, 2, 3, 0, 4, 5, 6}), (Bytes{1, 2, 3, 4, 5, 6}));
    EXPECT_EQ(convert({kY8i, 2, 2, 4, 8}, {1, 101, 2, 102, 3, 103, 4, 104}), (Bytes{1, 2, 3, 4}));
}

#ifdef STILLMESH_HAS_JPEG
[[nodiscard]] Bytes jpeg_of(const Bytes& pixels, int width, int height, bool is_grey) {
    const tjhandle encoder = tjInitCompress();
    unsigned char* made = nullptr;
    unsigned long size = 0;
    EXPECT_EQ(tjCompress2(encoder, pixels.data(), width, 0, height, is_grey ? TJPF_GRAY : TJPF_RGB, &made, &size,
                          is_grey ? TJSAMP_GRAY : TJSAMP_444, 100, TJFLAG_ACCURATEDCT),
              0);
    Bytes bytes(made, made + size);
    tjFree(made);
    tjDestroy(encoder);
    return bytes;
}

// Promise: a JPEG becomes its picture, a grey one in all channels; one of another size, cut off or no JPEG at all is
// refused with a sentence.
TEST(PixelFormats, Jpeg) {
    ASSERT_TRUE(has_jpeg());
    std::mt19937 random(1);
    Bytes picture(48 * 32 * 3), grey(48 * 32);
    for (std::size_t i = 0; i < picture.size(); ++i) picture[i] = static_cast<std::uint8_t>(i / 30);
    for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<std::uint8_t>(i / 10);
    const Bytes colour_jpeg = jpeg_of(picture, 48, 32, false), grey_jpeg = jpeg_of(grey, 48, 32, true);
    const V4l2Format format{kMjpg, 48, 32, 0, 48 * 32 * 2};
    const Bytes pixels = convert(format, colour_jpeg);
    for (std::size_t i = 0; i < pixels.size(); ++i) ASSERT_NEAR(pixels[i], picture[i], 4);
    const Bytes spread = convert(format, grey_jpeg);
    for (std::size_t i = 0; i < spread.size(); ++i) ASSERT_NEAR(spread[i], grey[i / 3], 4);
    static_cast<void>(convert({kMjpg, 32, 48, 0, 48 * 32 * 2}, colour_jpeg, Status::kCorrupt));
    Bytes cut = colour_jpeg;
    cut.resize(cut.size() / 2);
    static_cast<void>(convert(format, cut, Status::kCorrupt));
    static_cast<void>(convert(format, Bytes(100, 7), Status::kCorrupt));
}
#endif

}  // namespace
}  // namespace stillmesh::v4l2::pixel_formats_test
