#include "hal/replay/mask_folder.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "hal/live/half_camera.hpp"
#include "hal/replay/replay_camera.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::mask_folder_test {
namespace {

using test::TemporaryFolder;
using test::write_recording;

constexpr std::uint32_t kWidth = 64, kHeight = 48;

// White in its first row and grey 127 elsewhere, of so many channels.
void write_mask(const std::string& file, std::uint32_t channels, std::uint32_t height = kHeight) {
    std::vector<std::uint8_t> pixels(std::size_t{kWidth} * height * channels, 127);
    for (std::uint32_t x = 0; x < kWidth; ++x) pixels[x * channels + channels - 1] = 255;  // of colours: blue
    const auto colour_type = static_cast<std::uint8_t>(channels == 3 ? 2 : 0);
    test::write_bytes(file, test::encode_png(kWidth, height, colour_type, 8, pixels));
}

// Promise: each frame has the mask of its picture's name, grey or in colour, and none where there is none; at half the
// size a pixel is covered that any of its four is. `none` leaves the folder alone; another folder may be named.
TEST(MaskFolder, OfThePicturesName) {
    const TemporaryFolder folder;
    write_recording(folder.path());
    write_mask(folder.path("mask/0.png"), 1);
    write_mask(folder.path("mask/2.png"), 3);
    write_mask(folder.path("others/1.png"), 1);
    const auto rows_of = [&](const std::string& masks, bool is_half) {
        ReplayCamera whole({.folder = folder.path(), .calibration = "", .masks = masks});
        EXPECT_EQ(whole.open(), Status::kOk) << whole.message();
        HalfCamera half(whole);
        DepthCamera& camera = is_half ? static_cast<DepthCamera&>(half) : whole;
        std::vector<int> covered;  // rows of each frame; -1: no mask
        Frame frame;
        while (camera.poll(frame) == Status::kOk) {
            covered.push_back(frame.mask.data == nullptr ? -1 : 0);
            if (frame.mask.data == nullptr) continue;
            EXPECT_EQ(frame.mask.width, frame.colour.width);
            EXPECT_EQ(frame.mask.height, frame.colour.height);
            for (std::uint32_t y = 0; y < frame.mask.height; ++y) {
                int count = 0;
                for (std::uint32_t x = 0; x < frame.mask.width; ++x) count += frame.mask.at(x, y) >= 128 ? 1 : 0;
                EXPECT_TRUE(count == 0 || count == static_cast<int>(frame.mask.width)) << y;
                covered.back() += count > 0 ? 1 : 0;
            }
        }
        return covered;
    };
    EXPECT_EQ(rows_of("", false), (std::vector{1, -1, 1}));
    EXPECT_EQ(rows_of("", true), (std::vector{1, -1, 1}));
    EXPECT_EQ(rows_of("none", false), (std::vector{-1, -1, -1}));
    EXPECT_EQ(rows_of(folder.path("others"), false), (std::vector{-1, 1, -1}));
}

// Promise: what is no folder, or holds nothing of a picture's name, is refused with what to do; a mask of another size
// makes its frame a broken one, by name, and the next comes as ever.
TEST(MaskFolder, WrongOnesAreNamed) {
    const TemporaryFolder folder;
    write_recording(folder.path());
    write_mask(folder.path("odd/frame0.png"), 1);
    for (const auto& [masks, words] : {std::pair{"rgb.txt", "is no folder of masks"}, {"odd", "holds no PNG named"}}) {
        ReplayCamera camera({.folder = folder.path(), .calibration = "", .masks = folder.path(masks)});
        EXPECT_EQ(camera.open(), Status::kInvalid);
        EXPECT_NE(camera.message().find(words), std::string::npos) << camera.message();
    }
    write_mask(folder.path("mask/1.png"), 1, kHeight / 2);
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_EQ(camera.poll(frame), Status::kCorrupt);
    EXPECT_NE(camera.message().find("1.png: is 64x24 in 8-bit grey"), std::string::npos) << camera.message();
    EXPECT_EQ(camera.poll(frame), Status::kOk);
}

}  // namespace
}  // namespace stillmesh::mask_folder_test
