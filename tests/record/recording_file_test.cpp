#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <thread>

#include "hal/replay/replay_camera.hpp"
#include "platform/record/frame_folder_writer.hpp"
#include "platform/record/recording_reader.hpp"
#include "platform/record/recording_writer.hpp"
#include "tests/record/recordings.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::recording_file_test {
namespace {

using test::ByteVector;

void write_file(const std::string& file, std::span<const std::byte> bytes) {
    test::write_text(file, std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

struct Reading {
    Status opened = Status::kOk;
    std::uint64_t frames = 0;
    bool is_whole = false;
    std::string words;  // message or ending
};

Reading read(const std::string& file) {
    Reading out;
    RecordingReader reader;
    out.opened = reader.open(file);
    out.words = reader.message();
    if (out.opened != Status::kOk) return out;
    RecordedFrame frame;
    while (reader.next(frame) == Status::kOk) {
        EXPECT_EQ(test::frame_bytes(frame), test::frame_bytes(test::some_frame(out.frames)));
        ++out.frames;
    }
    EXPECT_EQ(reader.next(frame), Status::kEnd) << "the end is the end";
    out.is_whole = reader.is_whole();
    out.words = reader.ending();
    return out;
}

// Promise: cut after any byte, a recording gives its whole frames and says that it is torn, or refuses its header; only
// all of it is whole.
TEST(RecordingFile, CutAnywhere) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path() + "/r";
    const ByteVector all = test::recording_of(5);
    const std::size_t header_size = test::header_bytes(test::some_header()).size();
    const std::size_t frame_size = test::frame_bytes(test::some_frame(0)).size();
    // Inside the header now and then: format_test goes through all of it.
    for (std::size_t size = 0; size <= all.size(); size += size + 211 < header_size ? 211 : 1) {
        write_file(file, std::span(all).first(size));
        const Reading reading = read(file);
        if (size < header_size) {
            ASSERT_NE(reading.opened, Status::kOk) << size;
            ASSERT_NE(reading.words.find(file + ": "), std::string::npos);
            continue;
        }
        ASSERT_EQ(reading.opened, Status::kOk) << size;
        ASSERT_EQ(reading.frames, std::min<std::uint64_t>((size - header_size) / frame_size, 5)) << size;
        ASSERT_EQ(reading.is_whole, size == all.size());
        ASSERT_EQ(reading.words.empty(), size == all.size()) << reading.words;
    }
}

// Promise: with any byte changed, a recording is refused, or gives exactly the frames before the damage and says so.
TEST(RecordingFile, ChangedAnywhere) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path() + "/r";
    const ByteVector all = test::recording_of(4);
    const std::size_t header_size = test::header_bytes(test::some_header()).size();
    const std::size_t frame_size = test::frame_bytes(test::some_frame(0)).size();
    for (std::size_t i = 0; i < all.size(); i += i + 211 < header_size ? 211 : 1) {
        ByteVector bytes = all;
        bytes[i] ^= std::byte{static_cast<unsigned char>(1 + i % 255)};
        write_file(file, bytes);
        const Reading reading = read(file);
        if (i < header_size) {
            ASSERT_NE(reading.opened, Status::kOk) << i;
            continue;
        }
        ASSERT_EQ(reading.frames, std::min<std::uint64_t>((i - header_size) / frame_size, 4)) << i;
        ASSERT_FALSE(reading.is_whole) << i;
        ASSERT_FALSE(reading.words.empty()) << i;
    }
}

// Promise: a frame that is missing or there twice ends the recording, though its CRC is right; bytes behind the end
// mark are told.
TEST(RecordingFile, FramesOutOfPlace) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path() + "/r";
    for (const std::uint64_t second : {0U, 2U}) {
        ByteVector bytes = test::header_bytes(test::some_header());
        test::append(bytes, test::frame_bytes(test::some_frame(0)));
        test::append(bytes, test::frame_bytes(test::some_frame(second)));
        write_file(file, bytes);
        EXPECT_EQ(read(file).frames, 1U);
        EXPECT_NE(read(file).words.find("damaged"), std::string::npos);
    }
    ByteVector bytes = test::recording_of(2);
    test::append(bytes, test::frame_bytes(test::some_frame(2)));
    write_file(file, bytes);
    EXPECT_EQ(read(file).frames, 2U);
    EXPECT_NE(read(file).words.find("behind its end mark"), std::string::npos);
}

// Promise: what is no file or no recording is refused with its name and a remedy.
TEST(RecordingFile, BadFiles) {
    const test::TemporaryFolder folder;
    EXPECT_NE(read(folder.path() + "/none").words.find("cannot be read"), std::string::npos);
    EXPECT_NE(read(folder.path()).opened, Status::kOk);
    test::write_text(folder.path() + "/text", "poses of yesterday, and more of them\n");
    EXPECT_NE(read(folder.path() + "/text").words.find("is no recording"), std::string::npos);
    test::write_text(folder.path() + "/empty", "");
    EXPECT_NE(read(folder.path() + "/empty").words.find("is empty"), std::string::npos);
}

// Promise: what the writer is given is read back, whole; a long run passes through a small ring.
TEST(RecordingWriter, RoundTrip) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path() + "/r";
    RecordingWriter writer(4);
    std::string message;
    ASSERT_TRUE(writer.open(file, test::some_header(), message)) << message;
    for (std::uint64_t i = 0; i < 2000; ++i) {
        RecordedFrame frame = test::some_frame(i);
        writer.wait_for_room(std::chrono::seconds(10));
        writer.add(frame);
    }
    EXPECT_EQ(writer.close(), "");
    const Reading reading = read(file);
    EXPECT_EQ(reading.frames, 2000U);
    EXPECT_TRUE(reading.is_whole) << reading.words;
}

// Promise: when the disk is too slow for the ring, the maker does not wait, the recording ends there, without a hole
// and with an end mark that says why, and close() has a sentence.
TEST(RecordingWriter, OverflowEndsCleanly) {
    const test::TemporaryFolder folder;
    const std::string pipe = folder.path() + "/pipe";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    // A pipe that nobody empties until later is a disk that stands still: 64 KiB, some 600 records.
    const int reading_end = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
    ASSERT_GE(reading_end, 0);
    RecordingWriter writer(4);
    std::string message;
    ASSERT_TRUE(writer.open(pipe, test::some_header(), message)) << message;
    constexpr std::uint64_t kFrames = 5000;
    for (std::uint64_t i = 0; i < kFrames; ++i) {
        RecordedFrame frame = test::some_frame(i);
        writer.add(frame);
    }
    EXPECT_LT(writer.frames(), kFrames);
    // Now the disk moves again.
    std::string bytes;
    std::jthread reader([&] {
        char buffer[4096];
        static_cast<void>(::fcntl(reading_end, F_SETFL, 0));
        for (;;) {
            const ssize_t count = ::read(reading_end, buffer, sizeof(buffer));
            if (count <= 0) break;
            bytes.append(buffer, static_cast<std::size_t>(count));
        }
    });
    const std::string sentence = writer.close();
    reader.join();
    static_cast<void>(::close(reading_end));
    EXPECT_NE(sentence.find("too slow"), std::string::npos) << sentence;
    EXPECT_NE(sentence.find(std::to_string(kFrames - writer.frames()) + " later ones"), std::string::npos) << sentence;
    test::write_text(folder.path() + "/r", bytes);
    const Reading reading = read(folder.path() + "/r");
    EXPECT_EQ(reading.frames, writer.frames());
    EXPECT_TRUE(reading.is_whole);
    EXPECT_NE(reading.words.find("too slow"), std::string::npos);
}

// Promise: a full disk ends the recording with a sentence, and whoever waits for room is not held.
TEST(RecordingWriter, FullDisk) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    RecordingWriter writer;
    std::string message;
    EXPECT_FALSE(writer.open("/dev/full", test::some_header(), message));
    EXPECT_NE(message.find("/dev/full: cannot be written"), std::string::npos);
    EXPECT_FALSE(writer.open("/none/r", test::some_header(), message));
    EXPECT_EQ(writer.close(), "");
}

struct Picture {
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    Frame frame;
    Picture(std::uint32_t index, PixelFormat format) {
        const std::size_t stride = std::size_t{70} * channels_of(format);
        colour.resize(stride * 48);
        depth.resize(std::size_t{66} * 48);
        for (std::size_t i = 0; i < colour.size(); ++i) colour[i] = test::colour_byte(index, i);
        for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = test::depth_value(index, i);
        frame.time_ns = 1305031229'528748123LL + index * 33'333'333LL;
        frame.depth_time_ns = frame.time_ns + 2'000'001;
        frame.format = format;
        frame.colour = {colour.data(), 64, 48, stride};
        frame.depth = {depth.data(), 64, 48, 66};
        frame.depth_units_per_m = 1000.0 / 3;
    }
};

// Promise: frames come back from their folder with the same digest and time, grey or colour (of either order of
// channels), however they were padded.
TEST(FrameFolder, ComesBackBitForBit) {
    for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kRgb8, PixelFormat::kBgr8}) {
        const test::TemporaryFolder folder;
        const std::string out = folder.path() + "/frames";
        CameraInfo info;
        info.model = {64, 48, 52.123456789, 52.5, 31.5, 23.5};
        info.depth_units_per_m = 1000.0 / 3;
        FrameFolderWriter writer(3);
        std::string message;
        ASSERT_TRUE(writer.open(out, info, message)) << message;
        for (std::uint32_t i = 0; i < 12; ++i) {
            writer.wait_for_room(std::chrono::seconds(10));
            writer.add(Picture(i, format).frame);
        }
        EXPECT_EQ(writer.close(), "");
        ReplayCamera camera({.folder = out, .calibration = ""});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_EQ(camera.info().model.fx, info.model.fx);
        for (std::uint32_t i = 0; i < 12; ++i) {
            Frame frame;
            ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
            const Picture picture(i, format);
            EXPECT_EQ(frame.time_ns, picture.frame.time_ns);
            EXPECT_EQ(frame_digest(frame), frame_digest(picture.frame)) << i;
        }
        // Nobody's frames are overwritten.
        FrameFolderWriter second;
        EXPECT_FALSE(second.open(out, info, message));
        EXPECT_NE(message.find("is not empty"), std::string::npos);
    }
}

// Promise: when the ring is full the maker does not wait; the folder ends there, without a hole, and says so.
TEST(FrameFolder, OverflowEndsCleanly) {
    const test::TemporaryFolder folder;
    const std::string out = folder.path() + "/frames";
    CameraInfo info;
    info.model = {64, 48, 52.5, 52.5, 31.5, 23.5};
    FrameFolderWriter writer(1);
    std::string message;
    ASSERT_TRUE(writer.open(out, info, message)) << message;
    constexpr std::uint32_t kFrames = 400;
    const Picture picture(0, PixelFormat::kGrey8);
    for (std::uint32_t i = 0; i < kFrames; ++i) {
        Frame frame = picture.frame;
        frame.time_ns += i * 33'333'333LL;
        frame.depth_time_ns = frame.time_ns;
        writer.add(frame);
    }
    ASSERT_LT(writer.frames(), kFrames) << "a disk faster than a copy";
    const std::string sentence = writer.close();
    EXPECT_NE(sentence.find("too slow"), std::string::npos) << sentence;
    ReplayCamera camera({.folder = out, .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_EQ(camera.counts().frames, writer.frames());
}

}  // namespace
}  // namespace stillmesh::recording_file_test
