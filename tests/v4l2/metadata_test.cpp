// What the camera says of its images: the bytes, the clock made of them, and the camera that goes by it.
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <random>

#include "hal/v4l2/image_clock.hpp"
#include "hal/v4l2/realsense_metadata.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#include "tests/v4l2/emulated_device.hpp"

namespace stillmesh::metadata_test {
namespace {

using test::EmulatedDevice;
using v4l2::ImageClock;
using v4l2::ImageFacts;
using v4l2::parse_metadata;

[[nodiscard]] std::int64_t draw(std::mt19937& random, std::uint32_t below) {
    return static_cast<std::int64_t>(random() % below);
}

// Promise: the middle of the exposure on the camera's clock, the exposure, the projector, in each version of the
// layout; of a header alone, as the kernel hands it out for cameras it does not know, its time.
TEST(Metadata, IsReadInEachVersion) {
    for (const std::uint32_t version : {1U, 2U, 3U}) {
        for (const bool is_on : {false, true}) {
            ImageFacts facts;
            const test::Bytes bytes = test::metadata({.time_us = 3'000,
                                                      .optical_us = 5'000,
                                                      .exposure_us = 9'999,
                                                      .is_laser_on = is_on,
                                                      .version = version});
            ASSERT_EQ(parse_metadata(bytes, facts), Status::kOk) << version;
            EXPECT_EQ(facts.device_us, static_cast<std::uint32_t>(-2'000)) << "it wraps";
            EXPECT_EQ(facts.exposure_us, 9'999U);
            EXPECT_EQ(facts.is_laser_on, is_on);
        }
    }
    test::Bytes header = test::metadata({.time_us = 123'456});
    header.resize(22);
    ImageFacts facts;
    ASSERT_EQ(parse_metadata(header, facts), Status::kOk);
    EXPECT_EQ(facts.device_us, 123'456U);
    EXPECT_FALSE(facts.exposure_us || facts.is_laser_on);
}

// Promise: bytes that are cut off anywhere, blocks that reach past the end or are too short for what they are,
// exposures that no image has, a header without a time or with its error bit are refused and touch nothing.
TEST(Metadata, WhatDoesNotFitIsRefused) {
    const test::Bytes good = test::metadata({.time_us = 1'000'000});
    for (std::size_t size = 0; size < good.size(); ++size) {
        if (size == 22) continue;  // the standard header
        ImageFacts facts;
        EXPECT_EQ(parse_metadata({good.data(), size}, facts), Status::kCorrupt) << size;
        EXPECT_FALSE(facts.device_us);
    }
    struct Fault {
        std::size_t at;
        std::uint32_t value;
    };
    for (const Fault& fault : {Fault{26, 39}, Fault{26, 4}, Fault{26, 400}, Fault{66, 52}, Fault{66, 0x80000000},
                               Fault{42, 2'000'000}, Fault{50, 2'000'000}}) {
        test::Bytes bytes = good;
        test::put_u32(bytes, fault.at, fault.value);
        ImageFacts facts;
        EXPECT_EQ(parse_metadata(bytes, facts), Status::kCorrupt) << fault.at;
        EXPECT_FALSE(facts.device_us || facts.exposure_us || facts.is_laser_on);
    }
    for (const int flags : {0x88, 0xcc}) {
        test::Bytes bytes = good;
        bytes[11] = static_cast<std::uint8_t>(flags);
        ImageFacts facts;
        EXPECT_EQ(parse_metadata(bytes, facts), Status::kCorrupt);
    }
}

// Promise: whatever the jitter of the driver's stamps, images of one instant have one time, to the microsecond, and
// time goes as the camera's clock does, over its wrap; images without metadata lie within the jitter of theirs.
TEST(ImageClock, GoesAsTheCameras) {
    ImageClock clock(33'333, 33'333);
    std::mt19937 random(7);
    std::int64_t first_us = 0;
    for (std::int64_t i = 0; i < 40'000; ++i) {
        const std::int64_t true_us = 5'000'000'000 + i * 33'333;
        const auto device_us = static_cast<std::uint32_t>(4'294'000'000U + i * 33'335);  // 60 ppm faster
        const bool is_bare = i > 0 && draw(random, 50) == 0;
        const std::int64_t depth_us = clock.stamp_us(false, true_us + 2'000 + draw(random, 4'000), device_us);
        const std::int64_t colour_us = clock.stamp_us(true, true_us + 9'000 + draw(random, 6'000),
                                                      is_bare ? std::nullopt : std::optional(device_us));
        if (i < 2) {
            first_us = depth_us - i * 33'335;
            continue;  // the first has none before it that it could follow
        }
        ASSERT_EQ(depth_us, first_us + i * 33'335) << i;
        if (is_bare) {
            ASSERT_LE(std::abs(colour_us - depth_us), 6'500) << i;
        } else {
            ASSERT_EQ(colour_us, depth_us) << i;
        }
    }
    EXPECT_TRUE(clock.is_device_clock());
}

// Promise: a damaged time moves one image by no more than the jitter of the driver's stamps, or 2 ms, and no other; a
// clock that is set anew is followed after three images, and time never jumps.
TEST(ImageClock, DoubtsWhatDoesNotFit) {
    ImageClock clock(33'333, 33'333);
    std::mt19937 random(9);
    std::uint32_t shift = 0;
    int exact = 0;
    for (std::int64_t i = 0; i < 3'000; ++i) {
        const std::int64_t true_us = 5'000'000'000 + i * 33'333;
        if (i % 1'000 == 999) shift = static_cast<std::uint32_t>(random());
        auto device_us = static_cast<std::uint32_t>(true_us) + shift;
        const bool is_damaged = i == 0 || i % 5 == 3;
        if (is_damaged) device_us ^= 1U << draw(random, 32);
        const std::int64_t stamp_us = clock.stamp_us(false, true_us + 1'000 + draw(random, 3'000), device_us);
        ASSERT_LE(std::abs(stamp_us - true_us), 12'000) << i << (is_damaged ? " damaged" : "");
        static std::int64_t last_us = 0;
        exact += stamp_us - last_us == 33'333;
        ASSERT_GT(stamp_us, last_us);
        last_us = stamp_us;
    }
    EXPECT_GT(exact, 1'700) << "four of five are undamaged";
}

struct Rig {
    std::shared_ptr<EmulatedDevice> device = std::make_shared<EmulatedDevice>();
    std::unique_ptr<V4l2Camera> camera;

    Rig() {
        V4l2Options options;
        options.has_thread = false;
        options.is_registered = true;
        camera = std::make_unique<V4l2Camera>(options, device);
        device->depth().modes = {{v4l2::kZ16, 64, 48, {30}}};
        device->colour().modes = {{v4l2::kGrey, 64, 48, {30}}};
        device->infrared().modes.clear();
        device->clock_us = 4'200'000'000U;
        device->clock_ppm = 50;
        device->depth().way_us = 3'000;
        device->colour().way_us = 7'000;
        device->colour().delay_us = 1'000;
    }
    ~Rig() {
        camera.reset();
        EXPECT_EQ(device->open_now(), 0);
        EXPECT_EQ(device->mapped_now(), 0);
        EXPECT_EQ(device->misuse, "");
    }
    [[nodiscard]] Status next(Frame& frame) {
        Status status = Status::kTimedOut;
        for (int i = 0; i < 100 && status == Status::kTimedOut; ++i) {
            static_cast<void>(camera->wait(20));
            status = camera->poll(frame);
        }
        return status;
    }
};

// Promise: pairs and stamps go by the camera's clock, although the driver's stamps of colour jitter by 14 ms; what it
// says of the exposure is counted.
TEST(V4l2Metadata, GivesTheTimes) {
    Rig rig;
    ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
    EXPECT_TRUE(rig.camera->notes().empty());
    Frame frame;
    for (int i = 0; i < 6; ++i) ASSERT_EQ(rig.next(frame), Status::kOk);
    std::int64_t last_ns = frame.time_ns;
    for (int i = 0; i < 200; ++i) {
        ASSERT_EQ(rig.next(frame), Status::kOk);
        EXPECT_NEAR(static_cast<double>(frame.time_ns - frame.depth_time_ns), 1'000'000, 2'000);
        EXPECT_NEAR(static_cast<double>(frame.time_ns - last_ns), 33'335'000, 2'000);
        last_ns = frame.time_ns;
    }
    EXPECT_EQ(rig.camera->counts().exposure_sum_us, 8'000 * rig.camera->counts().images_exposed);
    EXPECT_GT(rig.camera->counts().images_exposed, 400U);
    EXPECT_EQ(rig.camera->remark(), "");
}

// Promise: of a kernel that hands out the standard header alone the times are the camera's, too; that the rest is
// missing is said with what to do, and turns, which need it, are refused with the same words.
TEST(V4l2Metadata, OfHeadersAloneHasTheTimes) {
    Rig rig;
    for (auto* const node : {&rig.device->depth(), &rig.device->colour()}) {
        rig.device->metadata_of(*node).modes = {{v4l2::kUvcMetadata, 0, 0, {}}};
    }
    ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
    ASSERT_EQ(rig.camera->notes().size(), 1U);
    const char* const remedy = "echo 8086 0b07 e 8086 0b03 | sudo tee /sys/bus/usb/drivers/uvcvideo/new_id";
    EXPECT_NE(rig.camera->notes()[0].find(remedy), std::string::npos) << rig.camera->notes()[0];
    Frame frame;
    for (int i = 0; i < 6; ++i) ASSERT_EQ(rig.next(frame), Status::kOk);
    for (std::int64_t i = 0, last_ns = frame.time_ns; i < 60; ++i, last_ns = frame.time_ns) {
        ASSERT_EQ(rig.next(frame), Status::kOk);
        EXPECT_NEAR(static_cast<double>(frame.time_ns - last_ns), 33'335'000, 2'000);
    }
    EXPECT_EQ(rig.camera->counts().images_exposed, 0U);

    V4l2Options options;
    options.has_thread = false;
    options.device = "alternate";
    const auto device = std::make_shared<EmulatedDevice>();
    device->metadata_of(device->infrared()).modes = {{v4l2::kUvcMetadata, 0, 0, {}}};
    V4l2Camera turns(options, device);
    EXPECT_EQ(turns.open(), Status::kInvalid);
    EXPECT_NE(turns.message().find(remedy), std::string::npos) << turns.message();
}

// Promise: without a node, without permission for it, or with another format: a note, and the driver's stamps; with
// nothing but damaged metadata: a remark, once, and the driver's stamps.
TEST(V4l2Metadata, WithoutItTheDriversStampsServe) {
    struct Case {
        void (*spoil)(EmulatedDevice&);
        const char* words;
    };
    for (const Case& c :
         {Case{[](EmulatedDevice& d) { d.metadata_of(d.depth()).capabilities = kV4l2Streaming; },
               "no node of metadata"},
          Case{[](EmulatedDevice& d) { d.metadata_of(d.colour()).open_error = EACCES; }, "/dev/video5: Permission"},
          Case{[](EmulatedDevice& d) { d.metadata_of(d.depth()).modes.clear(); }, "no node of metadata"},
          Case{[](EmulatedDevice& d) {
                   d.metadata_of(d.depth()).is_silent = d.metadata_of(d.colour()).is_silent = true;
               },
               nullptr},
          Case{[](EmulatedDevice& d) { d.metadata_of(d.depth()).cut_off = d.metadata_of(d.colour()).cut_off = 1'000; },
               nullptr}}) {
        Rig rig;
        c.spoil(*rig.device);
        ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        ASSERT_EQ(rig.camera->notes().size(), c.words != nullptr ? 1U : 0U);
        if (c.words != nullptr) {
            EXPECT_NE(rig.camera->notes()[0].find(c.words), std::string::npos) << rig.camera->notes()[0];
        }
        int remarks = 0;
        std::int64_t apart_ns = 0;
        for (int i = 0; i < 60; ++i) {
            Frame frame;
            ASSERT_EQ(rig.next(frame), Status::kOk);
            apart_ns = std::max(apart_ns, frame.time_ns - frame.depth_time_ns);
            remarks += !rig.camera->remark().empty();
        }
        EXPECT_EQ(apart_ns, 9'000'000) << "colour's stamp is late by up to 14 ms, depth's by up to 6";
        EXPECT_EQ(remarks, c.words != nullptr ? 0 : 1);
    }
}

}  // namespace
}  // namespace stillmesh::metadata_test
