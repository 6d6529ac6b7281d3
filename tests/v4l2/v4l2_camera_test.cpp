// The camera over an emulated RealSense D435: what it chooses, what it gives, what it does about everything that goes
// wrong.
#include "hal/v4l2/v4l2_camera.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "hal/live/reconnecting_camera.hpp"
#include "hal/v4l2/frame_conversion.hpp"
#include "hal/v4l2/survey.hpp"
#include "tests/v4l2/emulated_device.hpp"

namespace stillmesh::v4l2_camera_test {
namespace {

using test::EmulatedDevice;

struct Rig {
    std::shared_ptr<EmulatedDevice> device = std::make_shared<EmulatedDevice>();
    std::unique_ptr<V4l2Camera> camera;

    explicit Rig(V4l2Options options = {}) {
        options.has_thread = false;
        camera = std::make_unique<V4l2Camera>(std::move(options), device);
    }
    ~Rig() {
        camera.reset();
        EXPECT_EQ(device->open_now(), 0) << "a node was left open";
        EXPECT_EQ(device->mapped_now(), 0) << "a buffer was left mapped";
        EXPECT_EQ(device->misuse, "");
    }
    // The next frame, waiting for it in simulated time.
    [[nodiscard]] Status next(Frame& frame, int tries = 100) {
        Status status = Status::kTimedOut;
        for (int i = 0; i < tries && status == Status::kTimedOut; ++i) {
            static_cast<void>(camera->wait(20));
            status = camera->poll(frame);
        }
        return status;
    }
};

// Depth of the same size and, as the test says, in the colour camera's view: pixels can be told apart.
[[nodiscard]] V4l2Options plain() {
    V4l2Options options;
    options.is_registered = true;
    return options;
}
void offer_640x480_only(EmulatedDevice& device) {
    std::erase_if(device.depth().modes, [](const test::EmulatedMode& mode) { return mode.width != 640; });
}

[[nodiscard]] std::uint32_t depth_number(const Frame& frame) {
    return frame.depth.at(0, 0);
}

void expect_image(const Frame& frame, std::uint32_t number) {
    for (std::uint32_t y = 0; y < 480; y += 37) {
        for (std::uint32_t x = 1; x < 640; x += 41) {
            ASSERT_EQ(frame.depth.at(x, y), test::depth_pixel(number, x, y));
        }
    }
}

// Promise: depth of 848x480 at 30 images/s and colour of 640x480 at 30, of the nodes that have them; the camera's own
// calibration and unit; said in words.
TEST(V4l2Camera, OpensAsItShould) {
    Rig rig;
    ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
    EXPECT_EQ(rig.camera->device(),
              "RealSense D435 (8086:0b07), serial 012345, YUYV 640x480@30, depth Z16 848x480@30, registered here");
    EXPECT_EQ(rig.camera->calibration_source(), "the camera's own");
    EXPECT_TRUE(rig.camera->notes().empty());
    const CameraInfo& info = rig.camera->info();
    EXPECT_EQ(info.depth_units_per_m, 1000);
    EXPECT_EQ(info.frames_per_s, 30);
    EXPECT_EQ(info.model.width, 640U);
    EXPECT_EQ(info.model.height, 480U);
    // From 16:9 to 4:3 the image is cut at its sides.
    EXPECT_NEAR(info.model.fx, 1.4375 * (4.0 / 3) * 320, 1e-3);
    EXPECT_NEAR(info.model.fy, 2.53125 * 240, 1e-3);
    EXPECT_NEAR(info.model.cx, (1 + 0.015625 * 4 / 3) * 320, 1e-3);
    EXPECT_NEAR(info.model.cy, (1 - 0.03125) * 240, 1e-3);
    EXPECT_EQ(info.model.k1, 0.125);
    EXPECT_EQ(info.model.p2, -0.0009765625);
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk) << rig.camera->message();
    EXPECT_EQ(frame.format, PixelFormat::kRgb8);
    EXPECT_EQ(frame.colour.width, 640U);
    EXPECT_EQ(frame.depth.height, 480U);
    EXPECT_EQ(rig.device->controls[0x009a0901], 3) << "exposure is automatic";
}

// Promise: what comes out is what DepthRegistration makes of the images, with the device's own lenses and place.
TEST(V4l2Camera, DepthIsRegistered) {
    Rig rig;
    ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk);
    v4l2::CameraPair cameras;
    const auto numbers = test::depth_numbers(3);
    cameras.depth = {
        .width = 848, .height = 480, .fx = numbers[0], .fy = numbers[1], .cx = numbers[2], .cy = numbers[3]};
    cameras.colour = rig.camera->info().model;
    cameras.colour_from_depth.translation_m[0] = 0.001 * 14.75;
    cameras.colour_from_depth.translation_m[1] = 0.001 * 0.25;
    cameras.colour_from_depth.translation_m[2] = -0.001 * 0.5;
    const V4l2Format format{v4l2::kGrey, 640, 480, 640, 640 * 480};
    v4l2::FrameConversion conversion(cameras, format);
    const auto number = static_cast<std::uint32_t>(rig.device->now_ns() / 33'333'333);
    test::Bytes grey(640 * 480), depth(848 * 480 * 2);
    for (std::uint32_t y = 0; y < 480; ++y) {
        for (std::uint32_t x = 0; x < 848; ++x) {
            const std::uint16_t value = test::depth_pixel(number, x, y);
            depth[2 * (y * 848 + x)] = static_cast<std::uint8_t>(value);
            depth[2 * (y * 848 + x) + 1] = static_cast<std::uint8_t>(value >> 8);
        }
    }
    Frame expected;
    std::string message;
    ASSERT_EQ(conversion.convert(grey, depth, 848 * 2, expected, message), Status::kOk);
    std::uint32_t measured = 0;
    for (std::uint32_t y = 0; y < 480; ++y) {
        for (std::uint32_t x = 0; x < 640; ++x) {
            ASSERT_EQ(frame.depth.at(x, y), expected.depth.at(x, y)) << x << " " << y;
            measured += frame.depth.at(x, y) != 0 ? 1U : 0U;
        }
    }
    EXPECT_GT(measured, 640U * 480 * 9 / 10);
}

// Promise: every pair is colour and depth of one instant, also where one stream lies behind the other; times are the
// driver's stamps.
TEST(V4l2Camera, PairsAreOfOneInstant) {
    for (const std::uint32_t delay_us : {0U, 3'000U, 12'000U}) {
        Rig rig(plain());
        offer_640x480_only(*rig.device);
        rig.device->colour().delay_us = delay_us;
        ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        std::uint32_t last = 0;
        for (int i = 0; i < 20; ++i) {
            Frame frame;
            ASSERT_EQ(rig.next(frame), Status::kOk);
            const std::uint32_t number = depth_number(frame);
            expect_image(frame, number);
            EXPECT_EQ(frame.time_ns - frame.depth_time_ns, std::int64_t{delay_us} * 1000);
            if (i > 0) {
                EXPECT_EQ(number, last + 1);
            }
            last = number;
        }
        const LiveCounts counts = rig.camera->counts();
        EXPECT_EQ(counts.dropped, 0U);
        EXPECT_EQ(counts.pairing.lag_max_us, -static_cast<std::int64_t>(delay_us));
    }
}

// Promise: whoever polls late gets the newest pair that there can be, and what was overtaken is counted.
TEST(V4l2Camera, NewestWins) {
    Rig rig(plain());
    offer_640x480_only(*rig.device);
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk);
    const std::uint32_t first = depth_number(frame);
    rig.device->advance_ns(100'000'000);  // three more
    ASSERT_EQ(rig.camera->poll(frame), Status::kOk);
    EXPECT_EQ(depth_number(frame), first + 3);
    expect_image(frame, first + 3);
    EXPECT_EQ(rig.camera->counts().dropped, 2U);
    EXPECT_EQ(rig.camera->poll(frame), Status::kTimedOut);
}

// Promise: damaged images, those of a wrong length and those in buffers that are none are dropped and counted, and the
// next ones come.
TEST(V4l2Camera, BrokenImagesAreDropped) {
    Rig rig(plain());
    offer_640x480_only(*rig.device);
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk);
    std::uint64_t broken = 0;
    for (const auto fault : {&EmulatedDevice::Node::broken, &EmulatedDevice::Node::cut_off,
                             &EmulatedDevice::Node::overlong, &EmulatedDevice::Node::misnumbered}) {
        for (EmulatedDevice::Node* const node : {&rig.device->depth(), &rig.device->colour()}) {
            const std::uint32_t before = depth_number(frame);
            node->*fault = 1;
            ASSERT_EQ(rig.next(frame), Status::kOk);
            EXPECT_EQ(depth_number(frame), before + 2);
            EXPECT_EQ(rig.camera->counts().images_unusable, ++broken);
        }
    }
    EXPECT_EQ(rig.camera->silence(), "images come, but damaged or cut off");
}

// Promise: images that the driver lost are counted by their numbers.
TEST(V4l2Camera, LostImagesAreCounted) {
    Rig rig(plain());
    offer_640x480_only(*rig.device);
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk);
    rig.device->advance_ns(400'000'000);  // twelve images, six buffers
    ASSERT_EQ(rig.next(frame), Status::kOk);
    ASSERT_EQ(rig.next(frame), Status::kOk);
    EXPECT_GE(rig.camera->counts().images_missing, 12U);
}

// Promise: unplugged is said at once; plugged in again under other names it is the same camera, also where it is a
// moment without permission; another camera is not taken.
TEST(V4l2Camera, UnplugAndReplug) {
    Rig rig;
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    const CameraModel model = rig.camera->info().model;
    Frame frame;
    ASSERT_EQ(rig.next(frame), Status::kOk);
    rig.device->unplug();
    EXPECT_EQ(rig.camera->wait(1000), Status::kUnavailable);
    ASSERT_EQ(rig.next(frame), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "unplugged");
    EXPECT_EQ(rig.camera->open(), Status::kUnavailable);
    rig.device->plug(8);
    rig.device->depth().open_error = EACCES;
    EXPECT_EQ(rig.camera->open(), Status::kUnavailable);
    EXPECT_NE(rig.camera->message().find("may not open /dev/video8"), std::string::npos) << rig.camera->message();
    rig.device->depth().open_error = 0;
    ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
    EXPECT_EQ(rig.camera->info().model, model);
    ASSERT_EQ(rig.next(frame), Status::kOk);
    rig.camera->close();
    for (auto& node : rig.device->devices) node.node.serial = "other";
    EXPECT_EQ(rig.camera->open(), Status::kUnavailable);
    EXPECT_NE(rig.camera->message().find("of before is not plugged in"), std::string::npos);
}

// Promise: a camera without a serial number is known by its place or as the only one of its kind.
TEST(V4l2Camera, KnownWithoutASerial) {
    Rig rig;
    for (auto& node : rig.device->devices) node.node.serial.clear();
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    rig.camera->close();
    for (auto& node : rig.device->devices) node.node.usb_port = "2-4";
    EXPECT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
}

// Promise: nodes by name, the serial number of sysfs and that on the label; the rest is refused with what there is.
TEST(V4l2Camera, ChoosesByName) {
    for (const char* const name : {"/dev/video0,/dev/video4", "012345", "0123456789ab"}) {
        Rig rig({.device = name});
        EXPECT_EQ(rig.camera->open(), Status::kOk) << name << ": " << rig.camera->message();
    }
    struct Case {
        const char* name;
        Status status;
        const char* words;
    };
    for (const Case& c :
         {Case{"/dev/video0", Status::kInvalid, "name two nodes"},
          Case{"/dev/video0,/dev/video9", Status::kUnavailable, "there is no /dev/video9"},
          Case{"/dev/video4,/dev/video0", Status::kInvalid, "/dev/video4: has no depth images"},
          Case{"/dev/video0,/dev/video1", Status::kInvalid, "/dev/video1: has no images in a format"},
          Case{"987", Status::kUnavailable, "with serial number 987 is plugged in (there is: RealSense"}}) {
        Rig rig({.device = c.name});
        EXPECT_EQ(rig.camera->open(), c.status) << c.name;
        EXPECT_NE(rig.camera->message().find(c.words), std::string::npos) << rig.camera->message();
    }
}

// Promise: no permission, busy, no room on the bus, a mode that is not what was asked for, too few buffers: each said
// with its node; a full bus gets the next smaller modes.
TEST(V4l2Camera, RefusalsSayWhy) {
    struct Case {
        void (*spoil)(EmulatedDevice&);
        Status status;
        const char* words;
    };
    for (const Case& c : {
             Case{[](EmulatedDevice& d) { d.depth().open_error = EACCES; }, Status::kUnavailable,
                  "this user may not open /dev/video0: join the group video"},
             Case{[](EmulatedDevice& d) { d.colour().is_held = true; }, Status::kUnavailable,
                  "/dev/video4: another program streams from it"},
             Case{[](EmulatedDevice& d) { d.bytes_per_s_max = 1e6; }, Status::kUnavailable,
                  "the USB bus has no room for it"},
             Case{[](EmulatedDevice& d) { d.depth().ignores_mode = true; }, Status::kInvalid,
                  "/dev/video0: the driver sets another mode than"},
             Case{[](EmulatedDevice& d) { d.colour().buffers_max = 2; }, Status::kInvalid, "its buffers"},
             Case{
                 [](EmulatedDevice& d) { d.unplug(); }, Status::kUnavailable,
                 "no depth camera of the USB Video Class is plugged in, or the kernel's driver uvcvideo is not loaded"},
             Case{[](EmulatedDevice& d) { d.colour().modes.clear(), d.infrared().modes.clear(); }, Status::kUnavailable,
                  "has no colour images"},
             Case{[](EmulatedDevice& d) {
                      d.depth().modes = {{v4l2::kZ16, 8, 8, {30}}};
                  },
                  Status::kUnavailable, "has no depth images"},
         }) {
        Rig rig;
        c.spoil(*rig.device);
        EXPECT_EQ(rig.camera->open(), c.status) << c.words;
        EXPECT_NE(rig.camera->message().find(c.words), std::string::npos) << rig.camera->message();
    }
    Rig narrow;
    narrow.device->bytes_per_s_max = 3e7;
    int starts = 0;
    narrow.device->fault = [&starts](const char* call) {
        starts += std::string(call) == "set_streaming" ? 1 : 0;
        return 0;
    };
    ASSERT_EQ(narrow.camera->open(), Status::kOk) << narrow.camera->message();
    EXPECT_EQ(narrow.camera->device().find("848x480@30"), std::string::npos) << narrow.camera->device();
    EXPECT_LE(starts, 12) << "modes that need as much are not tried";
    narrow.device->fault = {};
}

// Promise: a calibration that cannot be right, or is refused, is a sentence and no camera; with a given one it goes on,
// and says how.
TEST(V4l2Camera, WithoutACalibration) {
    struct Case {
        void (*spoil)(EmulatedDevice&);
        const char* words;
    };
    const std::string file = testing::TempDir() + "stillmesh_v4l2_camera.toml";
    std::ofstream(file) << "width = 640\nheight = 480\nfx = 500.0\nfy = 500.0\ncx = 320.0\ncy = 240.0\n";
    for (const Case& c : {Case{[](EmulatedDevice& d) { d.answers[25 * 256 + 0x15][300] ^= 1; }, "another checksum"},
                          Case{[](EmulatedDevice& d) { d.answers[32 * 256 + 0x15][100] ^= 1; }, "another checksum"},
                          Case{[](EmulatedDevice& d) { d.answers.erase(25 * 256 + 0x15); }, "refuses to be asked"},
                          Case{[](EmulatedDevice& d) { d.answers[32 * 256 + 0x15][0] = 0xff; }, "is answered with"}}) {
        Rig rig;
        c.spoil(*rig.device);
        EXPECT_EQ(rig.camera->open(), Status::kInvalid);
        EXPECT_NE(rig.camera->message().find(c.words), std::string::npos) << rig.camera->message();
        EXPECT_NE(rig.camera->message().find("--calibration FILE"), std::string::npos);
        Rig given({.calibration = file});
        c.spoil(*given.device);
        ASSERT_EQ(given.camera->open(), Status::kOk) << given.camera->message();
        EXPECT_EQ(given.camera->info().model.fx, 500);
        ASSERT_EQ(given.camera->notes().size(), 1U);
        EXPECT_NE(given.camera->notes()[0].find("data sheet"), std::string::npos);
        Frame frame;
        EXPECT_EQ(given.next(frame), Status::kOk);
    }
    std::filesystem::remove(file);
}

// Promise: the depth unit is the camera's; where it cannot be read, that is said.
TEST(V4l2Camera, DepthUnit) {
    Rig fine;
    fine.device->answers[9 * 256 + 0x2c] = test::answer(0x2c, test::depth_unit(100));
    ASSERT_EQ(fine.camera->open(), Status::kOk);
    EXPECT_EQ(fine.camera->info().depth_units_per_m, 10'000);
    Rig silent;
    silent.device->answers.erase(9 * 256 + 0x2c);
    ASSERT_EQ(silent.camera->open(), Status::kOk);
    EXPECT_EQ(silent.camera->info().depth_units_per_m, 1000);
    ASSERT_EQ(silent.camera->notes().size(), 1U);
    EXPECT_NE(silent.camera->notes()[0].find("depth unit cannot be read"), std::string::npos);
}

// Promise: a camera nobody knows needs a calibration, and is then taken as registered, in its unit; one of both cameras
// registers depth, also a RealSense's, whose own is then not asked for.
TEST(V4l2Camera, OtherCameras) {
    V4l2Options options;
    Rig rig(options);
    for (auto& node : rig.device->devices) node.node.vendor_id = 0x1234;
    EXPECT_EQ(rig.camera->open(), Status::kInvalid);
    EXPECT_NE(rig.camera->message().find("nothing is known of its lens"), std::string::npos) << rig.camera->message();
    Rig given({.calibration = "tum-fr1"});
    offer_640x480_only(*given.device);
    for (auto& node : given.device->devices) node.node.vendor_id = 0x1234;
    ASSERT_EQ(given.camera->open(), Status::kOk) << given.camera->message();
    EXPECT_EQ(given.camera->info().depth_units_per_m, 5000);
    Frame frame;
    ASSERT_EQ(given.next(frame), Status::kOk);
    expect_image(frame, depth_number(frame));

    const std::string file = testing::TempDir() + "stillmesh_v4l2_pair.toml";
    std::ofstream(file) << "width = 640\nheight = 480\nfx = 600.0\nfy = 600.0\ncx = 320.0\ncy = 240.0\n[depth]\n"
                        << "width = 848\nheight = 480\nfx = 430.0\nfy = 430.0\ncx = 424.0\ncy = 240.0\n"
                        << "tx = 0.015\nty = 0.0\ntz = 0.0\nqx = 0.0\nqy = 0.0\nqz = 0.0\nqw = 1.0\n";
    for (const bool is_realsense : {false, true}) {
        Rig pair({.calibration = file});
        pair.device->answers.erase(25 * 256 + 0x15);
        for (auto& node : pair.device->devices) node.node.vendor_id = is_realsense ? 0x8086 : 0x1234;
        ASSERT_EQ(pair.camera->open(), Status::kOk) << pair.camera->message();
        EXPECT_TRUE(pair.camera->notes().empty());
        EXPECT_NE(pair.camera->device().find("registered here"), std::string::npos) << pair.camera->device();
        EXPECT_EQ(pair.next(frame), Status::kOk);
    }
    std::filesystem::remove(file);
}

// Promise: the left infrared camera for colour: one lens, depth as it comes, the projector off; the same when it is
// opened again; whoever takes colour next has the projector on. A camera without says so.
TEST(V4l2Camera, Infrared) {
    for (const char* const name : {"ir", "012345,ir"}) {
        Rig rig({.device = name});
        ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        EXPECT_NE(
            rig.camera->device().find("GREY 640x480@30, depth Z16 640x480@30, in the left infrared camera's view"),
            std::string::npos)
            << rig.camera->device();
        EXPECT_EQ(rig.device->emitter, 0);
        const auto numbers = test::depth_numbers(2);
        EXPECT_EQ(rig.camera->info().model.fx, numbers[0]);
        EXPECT_EQ(rig.camera->info().model.cy, numbers[3]);
        EXPECT_EQ(rig.camera->info().model.k1, 0);
        Frame frame;
        for (int opening = 0; opening < 2; ++opening) {
            ASSERT_EQ(rig.next(frame), Status::kOk);
            EXPECT_EQ(frame.format, PixelFormat::kGrey8);
            expect_image(frame, depth_number(frame));
            EXPECT_EQ(frame.colour.row(9)[7], test::colour_byte(depth_number(frame), 7, 9));
            rig.device->unplug();
            EXPECT_EQ(rig.next(frame), Status::kUnavailable);
            rig.device->plug(3);
            ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        }
    }
    Rig colour;
    ASSERT_EQ(colour.camera->open(), Status::kOk);
    EXPECT_EQ(colour.device->emitter, 1);
    Rig without({.device = "ir"});
    without.device->infrared().modes.clear();
    EXPECT_EQ(without.camera->open(), Status::kUnavailable);
    EXPECT_NE(without.camera->message().find("has no infrared images"), std::string::npos) << without.camera->message();
}

// Promise: with a projector that takes turns, every picture is one without dots, of 30 a second, with depth of the
// image just before, which had them; also when it is opened again; whoever opens the camera otherwise next ends the
// turns.
TEST(V4l2Camera, TheProjectorTakesTurns) {
    for (const char* const name : {"alternate", "012345,alternate"}) {
        Rig rig({.device = name});
        ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        EXPECT_NE(rig.camera->device().find("GREY 640x480@60, depth Z16 640x480@60, in the left infrared camera's "
                                            "view, its projector takes turns"),
                  std::string::npos)
            << rig.camera->device();
        EXPECT_TRUE(rig.device->is_alternating);
        EXPECT_EQ(rig.device->emitter, 1);
        EXPECT_EQ(rig.camera->info().frames_per_s, 30);
        Frame frame;
        for (int opening = 0; opening < 2; ++opening) {
            ASSERT_EQ(rig.next(frame), Status::kOk);
            std::int64_t last_ns = frame.time_ns;
            for (int i = 0; i < 10; ++i) {
                ASSERT_EQ(rig.next(frame), Status::kOk);
                const std::uint32_t number = depth_number(frame);
                EXPECT_EQ(number % 2, 1U) << "depth without the projector";
                expect_image(frame, number);
                EXPECT_EQ(frame.colour.row(9)[7], test::colour_byte(number + 1, 7, 9)) << "dots, or another instant";
                EXPECT_NEAR(static_cast<double>(frame.time_ns - frame.depth_time_ns), 1e9 / 60, 2'000);
                EXPECT_NEAR(static_cast<double>(frame.time_ns - last_ns), 1e9 / 30, 2'000);
                last_ns = frame.time_ns;
            }
            rig.device->unplug();
            EXPECT_EQ(rig.next(frame), Status::kUnavailable);
            rig.device->plug(3);
            ASSERT_EQ(rig.camera->open(), Status::kOk) << rig.camera->message();
        }
        EXPECT_EQ(rig.camera->remark(), "");
        rig.camera->close();
        V4l2Options options;
        options.has_thread = false;
        V4l2Camera other(options, rig.device);
        ASSERT_EQ(other.open(), Status::kOk) << other.message();
        EXPECT_FALSE(rig.device->is_alternating);
    }
}

// Promise: a camera that refuses to take turns, or whose metadata cannot be read, is refused with the reason and with
// what will do; one that does not do as it was told says so, once, and no picture with dots is given out.
TEST(V4l2Camera, ATurnThatIsNotTaken) {
    struct Case {
        void (*spoil)(EmulatedDevice&);
        const char* words;
    };
    for (const Case& c :
         {Case{[](EmulatedDevice& d) { d.answers.erase(256 + 0x77); }, "cannot take turns with the images"},
          Case{[](EmulatedDevice& d) { d.metadata_of(d.infrared()).open_error = EACCES; },
               "which images have the projector's dots is not known"}}) {
        Rig rig({.device = "alternate"});
        c.spoil(*rig.device);
        EXPECT_EQ(rig.camera->open(), Status::kInvalid);
        EXPECT_NE(rig.camera->message().find(c.words), std::string::npos) << rig.camera->message();
        EXPECT_NE(rig.camera->message().find("--camera v4l2:ir"), std::string::npos);
    }
    Rig rig({.device = "alternate"});
    rig.device->does_alternate = false;
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    Frame frame;
    EXPECT_EQ(rig.next(frame), Status::kTimedOut);
    EXPECT_NE(rig.camera->remark().find("does not take turns"), std::string::npos);
    EXPECT_EQ(rig.camera->remark(), "");
}

// Promise: it is said which stream is silent; the camera behind ReconnectingCamera is then reset and opened again, and
// goes on.
TEST(V4l2Camera, AStallIsReset) {
    Rig rig;
    int resets = 0;
    ReconnectOptions options;
    options.now_ns = [&] { return rig.device->now_ns(); };
    options.sleep_until_ns = [&](std::int64_t until_ns) {
        rig.device->advance_ns(std::max<std::int64_t>(until_ns - rig.device->now_ns(), 0));
    };
    options.source_message = [&] { return rig.camera->message(); };
    options.silence = [&] { return rig.camera->silence(); };
    options.reset = [&] {
        EXPECT_EQ(rig.device->open_now(), 0) << "a reset is for a device that nobody uses";
        rig.device->depth().is_silent = false;
        return ++resets > 0;
    };
    options.times = rig.camera.get();
    ReconnectingCamera lasting(*rig.camera, options);
    ASSERT_EQ(lasting.open(), Status::kOk);
    const auto run = [&](int polls) {
        int frames = 0;
        for (int i = 0; i < polls; ++i) {
            Frame frame;
            static_cast<void>(lasting.wait(20));
            if (lasting.poll(frame) == Status::kOk) ++frames;
        }
        return frames;
    };
    EXPECT_GT(run(30), 10);
    rig.device->depth().is_silent = true;
    run(100);
    EXPECT_EQ(resets, 1);
    EXPECT_GT(run(30), 10);
    EXPECT_NE(lasting.take_news().find("colour images come, depth images do not"), std::string::npos);
    EXPECT_EQ(lasting.counts().stalls, 1U);
    // And unplugged: gone, then back.
    rig.device->unplug();
    run(10);
    EXPECT_EQ(lasting.life(), CameraLife::kAway);
    rig.device->plug(2);
    run(60);
    EXPECT_EQ(lasting.life(), CameraLife::kStreaming);
    EXPECT_EQ(lasting.counts().unplugs, 1U);
    lasting.close();
}

// Promise: a queue that has failed is a camera that is gone, not a busy loop.
TEST(V4l2Camera, AFailedQueueIsGone) {
    Rig rig;
    ASSERT_EQ(rig.camera->open(), Status::kOk);
    rig.device->depth().is_silent = rig.device->depth().has_failed = true;
    Frame frame;
    EXPECT_EQ(rig.next(frame), Status::kUnavailable);
    EXPECT_EQ(rig.camera->message(), "its driver reports an error");
}

// Promise: the same with the thread that reads, by the host's clock: frames, an unplug, a second opening; ending in the
// middle leaves nothing behind.
TEST(V4l2Camera, WithItsThread) {
    auto device = std::make_shared<EmulatedDevice>();
    device->is_real_time = true;
    bool did_begin = false;
    {
        V4l2Options options;
        options.thread_begins = [&did_begin] { did_begin = true; };
        V4l2Camera camera(options, device);
        const auto frames = [&camera](int count) {
            Frame frame;
            for (int i = 0; i < 1000 && count > 0; ++i) {
                static_cast<void>(camera.wait(50));
                const Status status = camera.poll(frame);
                if (status == Status::kUnavailable) break;
                if (status == Status::kOk) --count;
            }
            return count == 0;
        };
        for (int opening = 0; opening < 3; ++opening) {
            ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
            EXPECT_TRUE(frames(5));
            EXPECT_GT(camera.next_due_ns(), 0);
            device->unplug();
            EXPECT_FALSE(frames(1000));
            device->plug(opening);
        }
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_TRUE(frames(1));
    }
    EXPECT_TRUE(did_begin);
    EXPECT_EQ(device->open_now(), 0);
    EXPECT_EQ(device->mapped_now(), 0);
    EXPECT_EQ(device->misuse, "");
}

// Promise: a driver that hangs while it is opened, or while it streams and is closed, is left behind: nobody waits
// longer than was asked for; when it comes back, everything is given back.
TEST(V4l2Camera, AHangIsLeftBehind) {
    for (const char* const where : {"query_capability", "set_streaming", "extension_get", "dequeue"}) {
        auto device = std::make_shared<EmulatedDevice>();
        device->is_real_time = true;
        std::atomic<bool> hangs = true;
        std::atomic<bool> is_caught = false;
        device->fault = [&, where = std::string(where)](const char* call) {
            while (hangs && where == call) {
                is_caught = true;
                std::this_thread::sleep_for(std::chrono::milliseconds(2));
            }
            return 0;
        };
        V4l2Options options;
        options.open_max_ms = 300;
        {
            V4l2Camera camera(options, device);
            if (std::string(where) == "dequeue") {
                // On a busy machine opening may take longer than that.
                for (int i = 0; i < 50 && camera.open() != Status::kOk; ++i) {
                }
            } else {
                EXPECT_EQ(camera.open(), Status::kUnavailable);
                EXPECT_EQ(camera.message(), "the camera does not answer; unplug it and plug it in again.");
            }
            for (int i = 0; i < 5000 && !is_caught; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            EXPECT_TRUE(is_caught) << where;
        }
        hangs = false;
        // Until the thread that was left behind has let go of the device; in between it opens and closes it.
        for (int i = 0; i < 20'000 && device.use_count() > 1; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        EXPECT_EQ(device.use_count(), 1) << where;
        EXPECT_EQ(device->open_now(), 0) << where;
        EXPECT_EQ(device->mapped_now(), 0) << where;
        EXPECT_EQ(device->misuse, "");
        device->fault = {};
    }
}

// Promise: `stillmesh cameras` hears what the nodes say, and nobody who streams is disturbed by it.
TEST(V4l2Survey, SaysWhatIsThere) {
    EmulatedDevice device;
    std::vector<VideoNodes> seen = v4l2::survey(device);
    ASSERT_EQ(seen.size(), 1U);
    EXPECT_EQ(seen[0].usb_port, "2-1");
    EXPECT_EQ(seen[0].paths.size(), 6U);
    EXPECT_EQ(seen[0].colour_modes.substr(0, 23), "1280x720@30 1280x720@15");
    EXPECT_NE(seen[0].depth_modes.find("848x480@30"), std::string::npos);
    EXPECT_EQ(seen[0].denied + seen[0].busy + seen[0].broken + seen[0].absent, "");
    device.depth().open_error = EACCES;
    device.colour().is_held = true;
    device.infrared().open_error = EIO;
    device.devices[1].open_error = ENOENT;
    seen = v4l2::survey(device);
    EXPECT_EQ(seen[0].denied, "/dev/video0");
    EXPECT_EQ(seen[0].absent, "/dev/video1");
    EXPECT_EQ(seen[0].broken, "/dev/video2");
    EXPECT_EQ(seen[0].busy, "/dev/video4");
    EXPECT_EQ(device.open_now(), 0);
    device.unplug();
    EXPECT_TRUE(v4l2::survey(device).empty());
}

}  // namespace
}  // namespace stillmesh::v4l2_camera_test
