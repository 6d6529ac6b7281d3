// What `stillmesh cameras` concludes, over a scripted bus: every verdict and its advice.
#include "hal/usb/camera_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "platform/cli/cameras_command.hpp"
#include "tests/usb/scripted_usb_link.hpp"

namespace stillmesh::camera_check_test {
namespace {

[[nodiscard]] CameraSurroundings everything_installed() {
    CameraSurroundings surroundings;
    surroundings.has_openni2 = surroundings.has_freenect = true;
    surroundings.plug_in_folder = "/usr/lib/OpenNI2/Drivers";
    surroundings.plug_ins = {"libOniFile.so.0", "libPS1080.so.0", "libPSLink.so.0", "liborbbec.so.0"};
    return surroundings;
}

struct Checked {
    std::vector<CameraReport> reports;
    std::string text;
};

[[nodiscard]] Checked check(test::ScriptedUsbLink& link,
                            const CameraSurroundings& surroundings = everything_installed()) {
    Checked checked;
    EXPECT_EQ(check_cameras(link, surroundings, checked.reports), UsbStatus::kOk);
    EXPECT_EQ(link.open_now, 0) << "a device was left open";
    checked.text = cameras_text(checked.reports);
    // Every problem has an advice, a sentence each, and what cannot stream has a problem.
    for (const CameraReport& report : checked.reports) {
        EXPECT_EQ(report.problem.empty(), report.verdict == CameraVerdict::kReady);
        EXPECT_EQ(report.problem.empty(), report.advice.empty());
        EXPECT_FALSE(report.problem.ends_with('.') || report.advice.ends_with('.'));
        // One thing to do. What to try if that does not help comes behind a semicolon.
        const std::string first = report.advice.substr(0, report.advice.find(';'));
        EXPECT_EQ(first.find(", or "), std::string::npos) << report.advice;
        EXPECT_LT(report.advice.size(), 200U) << report.advice;
        EXPECT_LE(report.commands.size(), 3U);
    }
    return checked;
}

void expect_one(const Checked& checked, CameraVerdict verdict, const char* problem, const char* advice) {
    ASSERT_EQ(checked.reports.size(), 1U) << checked.text;
    EXPECT_STREQ(verdict_name(checked.reports[0].verdict), verdict_name(verdict)) << checked.text;
    EXPECT_NE(checked.text.find(problem), std::string::npos) << checked.text;
    EXPECT_NE(checked.text.find(advice), std::string::npos) << checked.text;
}

// Promise: a camera that nothing is wrong with can stream, and the command to start is given.
TEST(CameraCheck, Ready) {
    test::ScriptedUsbLink link;
    link.plug_hub("usb1", UsbSpeed::kHigh, true);
    link.plug(0x1d27, 0x0601, "1-1");
    expect_one(check(link), CameraVerdict::kReady, "streams   yes", "stillmesh run --camera auto");
    // Claiming is the whole of what was done to it.
    EXPECT_EQ(link.log, (std::vector<std::string>{"open 1-1", "claim 1-1", "close 1-1"}));
}

// Promise: an empty bus, or one with mice only, says that no camera is there, and which could be.
TEST(CameraCheck, NothingPluggedIn) {
    test::ScriptedUsbLink link;
    link.plug_hub("usb1", UsbSpeed::kHigh, true);
    link.plug(0x046d, 0xc077, "1-3");
    const Checked checked = check(link);
    EXPECT_TRUE(checked.reports.empty());
    EXPECT_NE(checked.text.find("No depth camera is plugged in"), std::string::npos);
    EXPECT_NE(checked.text.find("Xtion"), std::string::npos);
    EXPECT_TRUE(link.log.empty()) << "other people's devices were opened";
}

// Promise: without permission the missing rule is named with the exact commands; with the rules there, applying them;
// with the group, joining it.
TEST(CameraCheck, Denied) {
    test::ScriptedUsbLink link;
    test::ScriptedDevice& camera = link.plug(0x1d27, 0x0601, "1-1");
    camera.open = UsbStatus::kDenied;
    camera.node.is_open_to_us = false;
    expect_one(check(link), CameraVerdict::kDenied, "the udev rules are missing",
               "stillmesh cameras --udev-rules | sudo tee /etc/udev/rules.d/60-stillmesh.rules");
    CameraSurroundings with_rules = everything_installed();
    with_rules.rule_files = {"/usr/lib/udev/rules.d/60-stillmesh.rules"};
    expect_one(check(link, with_rules), CameraVerdict::kDenied, "have not been applied",
               "sudo udevadm trigger --subsystem-match=usb");
    camera.node.group = "video";
    camera.node.mode = 0660;
    expect_one(check(link, with_rules), CameraVerdict::kDenied, "which the group 'video' may",
               "sudo usermod -aG video \"$USER\"");
    // The group without write permission does not help.
    camera.node.mode = 0640;
    expect_one(check(link, with_rules), CameraVerdict::kDenied, "have not been applied", "udevadm");
}

// Promise: a camera somebody uses is named with the program; a kernel driver with how to unload it.
TEST(CameraCheck, Held) {
    test::ScriptedUsbLink link;
    link.plug(0x1d27, 0x0601, "1-1");
    link.devices[0].claim = UsbStatus::kBusy;
    link.devices[0].driver = "usbfs";
    link.devices[0].holders = {{4711, "NiViewer"}};
    expect_one(check(link), CameraVerdict::kHeld, "NiViewer (process 4711)", "kill 4711");
    link.devices[0].holders.clear();
    expect_one(check(link), CameraVerdict::kHeld, "another user's program", "sudo stillmesh cameras");
    link.devices[0].driver = "uvcvideo";
    expect_one(check(link), CameraVerdict::kHeld, "the kernel's driver uvcvideo", "sudo modprobe -r uvcvideo");
    // libfreenect sends the kernel's driver away by itself.
    test::ScriptedUsbLink kinect;
    kinect.plug(0x045e, 0x02ae, "1-1");
    kinect.devices[0].claim = UsbStatus::kBusy;
    kinect.devices[0].driver = "gspca_kinect";
    expect_one(check(kinect), CameraVerdict::kReady, "streams   yes", "stillmesh run --camera freenect");
}

// Promise: a RealSense is served by the kernel's video nodes: what keeps each of them from streaming is said, with the
// one thing to do; USB 2 leaves it its smaller modes; nothing of it is claimed, for somebody may stream from it.
TEST(CameraCheck, RealSense) {
    test::ScriptedUsbLink link;
    link.plug(0x8086, 0x0b07, "2-1").device.speed = UsbSpeed::kSuper;
    CameraSurroundings surroundings = everything_installed();
    surroundings.has_v4l2 = false;
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing, "built without V4L2",
               "-DSTILLMESH_WITH_V4L2=ON");
    surroundings.has_v4l2 = true;
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing, "no video node for it",
               "sudo modprobe uvcvideo");
    link.devices[0].driver = "usbfs";
    link.devices[0].holders = {{4711, "realsense-viewer"}};
    expect_one(check(link, surroundings), CameraVerdict::kHeld, "realsense-viewer (process 4711)", "kill 4711");
    const VideoNodes fine{.usb_port = "2-1",
                          .paths = {"/dev/video0", "/dev/video4"},
                          .absent = {},
                          .denied = {},
                          .busy = {},
                          .broken = {},
                          .depth_modes = "848x480@30",
                          .colour_modes = "640x480@30"};
    surroundings.video_nodes = {fine};
    expect_one(check(link, surroundings), CameraVerdict::kReady,
               "modes     depth 848x480@30; colour 640x480@30\n  streams   yes", "stillmesh run --camera v4l2");
    VideoNodes& nodes = surroundings.video_nodes[0];
    nodes.colour_modes.clear();
    expect_one(check(link, surroundings), CameraVerdict::kNoAnswer, "offers no modes of colour", "--reset 2-1");
    nodes.broken = "/dev/video2";
    expect_one(check(link, surroundings), CameraVerdict::kNoAnswer, "/dev/video2 does not answer", "--reset 2-1");
    nodes.busy = "/dev/video4";
    expect_one(check(link, surroundings), CameraVerdict::kHeld, "another program streams from /dev/video4",
               "sudo fuser -v /dev/video4");
    nodes.denied = "/dev/video0";
    expect_one(check(link, surroundings), CameraVerdict::kDenied, "this user may not open /dev/video0",
               "sudo usermod -aG video \"$USER\"");
    nodes.absent = "/dev/video0";
    expect_one(check(link, surroundings), CameraVerdict::kNoNode, "/dev/video0 is not there, as in a container",
               "docker run --device /dev/video0");
    nodes = fine;
    link.devices[0].device.speed = UsbSpeed::kHigh;
    expect_one(check(link, surroundings), CameraVerdict::kSlowBus, "yes, but it is connected as USB 2",
               "with a USB 3 cable");
    EXPECT_TRUE(link.log.empty()) << "it was opened";
    // Two are told apart by their serial numbers.
    link.devices[0].device.speed = UsbSpeed::kSuper;
    link.devices[0].device.serial = "111";
    link.plug(0x8086, 0x0b5c, "2-2").device.speed = UsbSpeed::kSuper;
    link.devices[1].device.serial = "222";
    surroundings.video_nodes.push_back(fine);
    surroundings.video_nodes[1].usb_port = "2-2";
    EXPECT_NE(check(link, surroundings).text.find("stillmesh run --camera v4l2:222"), std::string::npos);
}

// Promise: USB 1 is too slow, and the hub that makes it so is named; USB 3 is not.
TEST(CameraCheck, TooSlow) {
    test::ScriptedUsbLink link;
    link.plug_hub("usb1", UsbSpeed::kHigh, true);
    link.plug_hub("1-4", UsbSpeed::kHigh, true);
    link.plug(0x1d27, 0x0601, "1-4.2").device.speed = UsbSpeed::kFull;
    expect_one(check(link), CameraVerdict::kTooSlow, "full speed (12 Mbit/s), too slow", "another cable");
    link.devices[1].device.speed = UsbSpeed::kFull;
    expect_one(check(link), CameraVerdict::kTooSlow, "too slow", "the hub at 1-4 is USB 1");
    link.devices[2].device.speed = UsbSpeed::kSuper;
    expect_one(check(link), CameraVerdict::kReady, "streams   yes", "stillmesh run");
}

// Promise: a camera the kernel has left off for want of power is told apart by its hub.
TEST(CameraCheck, NotEnoughPower) {
    test::ScriptedUsbLink link;
    link.plug_hub("usb1", UsbSpeed::kHigh, true);
    link.plug_hub("1-4", UsbSpeed::kHigh, false);
    link.plug(0x1d27, 0x0601, "1-4.2").device.is_configured = false;
    expect_one(check(link), CameraVerdict::kNoPower,
               "asks for 500 mA and the hub at 1-4 has no power supply of its own", "straight into the computer");
    link.devices[1].device.is_self_powered = true;
    expect_one(check(link), CameraVerdict::kNoPower, "does not give that much", "a hub with its own power supply");
    EXPECT_TRUE(link.log.empty()) << "a device that is off was opened";
}

// Promise: two cameras on one USB 2 bus are told, also when another program holds one; on two buses, or on USB 3, both
// are ready, and the command names the one meant.
TEST(CameraCheck, SharedBus) {
    test::ScriptedUsbLink link;
    link.plug(0x1d27, 0x0601, "1-1");
    link.plug(0x1d27, 0x0609, "1-2");
    Checked checked = check(link);
    ASSERT_EQ(checked.reports.size(), 2U);
    EXPECT_EQ(checked.reports[0].verdict, CameraVerdict::kSharedBus);
    EXPECT_EQ(checked.reports[1].verdict, CameraVerdict::kSharedBus);
    EXPECT_TRUE(can_stream(checked.reports[0].verdict));
    EXPECT_NE(checked.text.find("yes, but it shares a USB 2 bus with the camera at 1-2: together they need 62 MB/s"),
              std::string::npos)
        << checked.text;
    link.devices[1].claim = UsbStatus::kBusy;
    checked = check(link);
    EXPECT_EQ(checked.reports[0].verdict, CameraVerdict::kSharedBus);
    EXPECT_EQ(checked.reports[1].verdict, CameraVerdict::kHeld);
    link.devices[1].claim = UsbStatus::kOk;
    link.devices[1].device.port.bus = 3;
    checked = check(link);
    EXPECT_EQ(checked.reports[0].verdict, CameraVerdict::kReady);
    EXPECT_EQ(checked.reports[1].verdict, CameraVerdict::kReady);
    EXPECT_NE(checked.text.find("stillmesh run --camera openni2:1d27/0601@1/2\n"), std::string::npos) << checked.text;
    link.devices[1].device.port.bus = 1;
    link.devices[0].device.speed = link.devices[1].device.speed = UsbSpeed::kSuper;
    checked = check(link);
    EXPECT_EQ(checked.reports[0].verdict, CameraVerdict::kReady);
}

// Promise: a missing library or plug-in is named with what installs it; for Orbbec's, where it comes from.
TEST(CameraCheck, DriverMissing) {
    test::ScriptedUsbLink link;
    link.plug(0x2bc5, 0x0401, "1-1");
    CameraSurroundings surroundings = everything_installed();
    surroundings.plug_ins.pop_back();
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing,
               "liborbbec.so.0, is not in /usr/lib/OpenNI2/Drivers",
               "sudo cp liborbbec.so /usr/lib/OpenNI2/Drivers/liborbbec.so.0");
    link.devices[0].device.vendor_id = 0x1d27;
    link.devices[0].device.product_id = 0x0601;
    surroundings.plug_ins.clear();
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing, "libPS1080.so.0", "--reinstall libopenni2-0");
    surroundings.unusable_plug_ins = {"libPS1080.so.0"};
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing,
               "libPS1080.so.0, is damaged or for another processor, in /usr/lib/OpenNI2/Drivers",
               "--reinstall libopenni2-0");
    surroundings.has_openni2 = false;
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing, "built without OpenNI2", "libopenni2-dev");
    link.devices[0].device.vendor_id = 0x045e;
    link.devices[0].device.product_id = 0x02ae;
    surroundings.has_freenect = false;
    expect_one(check(link, surroundings), CameraVerdict::kDriverMissing, "built without libfreenect",
               "-DSTILLMESH_WITH_FREENECT=ON");
    EXPECT_TRUE(link.log.empty());
}

// Promise: an Astra in its boot loader, one whose colour is a webcam, a camera without colour, and cameras nothing here
// serves are called that.
TEST(CameraCheck, WrongCameras) {
    test::ScriptedUsbLink link;
    link.plug(0x2bc5, 0x0400, "1-1");
    expect_one(check(link), CameraVerdict::kBootloader, "waits in its boot loader", "unplug it for ten seconds");
    link.devices[0].device.product_id = 0x0403;
    expect_one(check(link), CameraVerdict::kDepthOnly, "a webcam of its own (UVC)", "use a camera with both");
    link.devices[0].device.vendor_id = 0x1d27;
    link.devices[0].device.product_id = 0x0600;
    expect_one(check(link), CameraVerdict::kDepthOnly, "it has no colour camera", "use a camera with both");
    link.devices[0].device.vendor_id = 0x045e;
    link.devices[0].device.product_id = 0x097c;
    expect_one(check(link), CameraVerdict::kUnsupported, "cannot use it", "use an ASUS Xtion PRO Live");
}

// Promise: a Kinect without its power brick shows its motor and no camera; with it, the motor is not spoken of, be it
// beside the camera (1414) or its hub (1473, Windows).
TEST(CameraCheck, KinectWithoutPowerSupply) {
    test::ScriptedUsbLink link;
    link.plug_hub("1-1", UsbSpeed::kHigh, false);
    link.plug(0x045e, 0x02b0, "1-1.2");
    expect_one(check(link), CameraVerdict::kNoCamera, "its motor is there but its camera is not",
               "the Kinect's own power supply");
    link.plug(0x045e, 0x02ad, "1-1.3");
    link.plug(0x045e, 0x02ae, "1-1.1");
    expect_one(check(link), CameraVerdict::kReady, "Kinect for Xbox 360", "--camera freenect");
    // A second Kinect's motor, elsewhere, is alone.
    link.plug(0x045e, 0x02b0, "1-3.2");
    EXPECT_EQ(check(link).reports.size(), 2U);

    test::ScriptedUsbLink later;
    later.plug(0x045e, 0x02c2, "2-1");
    expect_one(check(later), CameraVerdict::kNoCamera, "gets no power", "power supply");
    later.plug(0x045e, 0x02bf, "2-1.3");
    expect_one(check(later), CameraVerdict::kReady, "Kinect for Windows", "--camera freenect");
}

// Promise: a camera that does not answer, cannot be opened or has halted is stuck, and its reset is the advice; one
// that refuses a request answers.
TEST(CameraCheck, Stuck) {
    test::ScriptedUsbLink link;
    link.plug(0x1d27, 0x0601, "1-1");
    for (const UsbStatus status : {UsbStatus::kTimedOut, UsbStatus::kFailed}) {
        link.devices[0].answer = status;
        expect_one(check(link), CameraVerdict::kNoAnswer, usb_status_name(status), "stillmesh cameras --reset 1-1");
    }
    link.devices[0].answer = UsbStatus::kStalled;
    expect_one(check(link), CameraVerdict::kReady, "streams   yes", "run");
    link.devices[0].answer = UsbStatus::kOk;
    link.devices[0].is_halted = true;
    expect_one(check(link), CameraVerdict::kNoAnswer, "halted its image stream", "--reset 1-1");
    link.devices[0].is_halted = false;
    link.devices[0].claim = UsbStatus::kFailed;
    expect_one(check(link), CameraVerdict::kNoAnswer, "claiming it says", "--reset 1-1");
    link.devices[0].open = UsbStatus::kFailed;
    expect_one(check(link), CameraVerdict::kNoAnswer, "opening it says", "--reset 1-1");
}

// Promise: in a container without the device's file, that is what is said.
TEST(CameraCheck, InAContainer) {
    test::ScriptedUsbLink link;
    link.plug(0x1d27, 0x0601, "1-1").node.exists = false;
    expect_one(check(link), CameraVerdict::kNoNode, "as in a container", "--device /dev/bus/usb");
    link.bus = UsbStatus::kUnsupported;
    std::vector<CameraReport> reports;
    EXPECT_EQ(check_cameras(link, everything_installed(), reports), UsbStatus::kUnsupported);
    EXPECT_TRUE(reports.empty());
}

// Promise: whatever is plugged in, with whatever faults, there is one report per camera, nothing stays open, and the
// JSON can be read.
TEST(CameraCheck, AnyBus) {
    std::uint32_t random = 1;
    const auto below = [&](std::size_t limit) {
        random = random * 1664525U + 1013904223U;
        return static_cast<std::size_t>(random >> 8U) % limit;
    };
    const std::span<const SupportedCamera> known = supported_cameras();
    for (int round = 0; round < 2000; ++round) {
        test::ScriptedUsbLink link;
        std::size_t cameras = 0;
        const std::size_t count = below(6);
        for (std::size_t i = 0; i < count; ++i) {
            const bool is_ours = below(4) != 0;
            const SupportedCamera& camera = known[below(known.size())];
            const std::string port = std::to_string(1 + below(2)) + "-" + std::to_string(i + 1);
            test::ScriptedDevice& plugged = is_ours ? link.plug(camera.vendor_id, camera.product_id, port.c_str())
                                                    : link.plug(0x1234, 0x5678, port.c_str());
            plugged.device.speed = static_cast<UsbSpeed>(below(5));
            plugged.device.is_configured = below(8) != 0;
            plugged.open = static_cast<UsbStatus>(below(16) < 9 ? 0 : below(9));
            plugged.claim = static_cast<UsbStatus>(below(16) < 9 ? 0 : below(9));
            plugged.answer = static_cast<UsbStatus>(below(16) < 9 ? 0 : below(9));
            plugged.is_halted = below(8) == 0;
            plugged.node.exists = below(8) != 0;
            plugged.device.serial = below(2) == 0 ? "\xff\xfe\"" : "";
            cameras += is_ours && camera.role != CameraRole::kKinectPart && camera.role != CameraRole::kKinectMotor;
        }
        const Checked checked = check(link);
        EXPECT_GE(checked.reports.size(), cameras);
        const std::string json = cameras_json(checked.reports);
        EXPECT_EQ(json.find("{\n  \"cameras\": ["), 0U);
        EXPECT_EQ(std::count(json.begin(), json.end(), '\xff'), 0);
    }
}

// Promise: a reset goes to the one camera meant, by port or OpenNI2's name, never to one in use, and says what came of
// it.
TEST(CameraReset, OneCamera) {
    test::ScriptedUsbLink link;
    std::string message;
    EXPECT_EQ(reset_camera(link, "", message), UsbStatus::kGone);
    EXPECT_EQ(message, "there is no camera to reset");
    link.plug(0x046d, 0xc077, "1-3");
    link.plug(0x1d27, 0x0601, "1-1");
    EXPECT_EQ(reset_camera(link, "1-3", message), UsbStatus::kGone) << "a mouse was reset";
    EXPECT_TRUE(link.log.empty());
    for (const char* where : {"", "1-1", "1d27/0601@1/3"}) {
        link.log.clear();
        EXPECT_EQ(reset_camera(link, where, message), UsbStatus::kOk) << where;
        EXPECT_EQ(link.log, (std::vector<std::string>{"open 1-1", "claim 1-1", "reset 1-1"}));
        EXPECT_EQ(message, "the camera at 1-1 was reset");
    }
    link.devices[1].claim = UsbStatus::kBusy;
    link.log.clear();
    EXPECT_EQ(reset_camera(link, "1-1", message), UsbStatus::kBusy);
    EXPECT_EQ(link.log, (std::vector<std::string>{"open 1-1", "claim 1-1", "close 1-1"}));
    link.devices[1].claim = UsbStatus::kOk;
    link.devices[1].reset = UsbStatus::kGone;
    EXPECT_EQ(reset_camera(link, "1-1", message), UsbStatus::kGone);
    EXPECT_NE(message.find("did not come back"), std::string::npos);
    link.plug(0x1d27, 0x0601, "1-2");
    EXPECT_EQ(reset_camera(link, "", message), UsbStatus::kBusy);
    EXPECT_NE(message.find("several cameras: name the port, such as 1-1"), std::string::npos) << message;
    EXPECT_EQ(link.open_now, 0);
}

// Promise: ports are written and read as the kernel does, and nothing else is read.
TEST(UsbPortText, RoundTrip) {
    for (const char* text : {"usb1", "usb255", "1-1", "2-4.3", "1-1.2.3.4.5.6.7"}) {
        UsbPort port;
        ASSERT_TRUE(parse_port(text, port)) << text;
        EXPECT_EQ(port_text(port), text);
    }
    UsbPort port;
    for (const char* text : {"", "1", "1-", "1-0", "-1", "1.1", "1-1.", "1-1-1", "1-256", "usb", "usb0", "usb1-1",
                             "1-1 ", "1-1.2.3.4.5.6.7.8", "a-1", "+1-1"}) {
        EXPECT_FALSE(parse_port(text, port)) << text;
    }
    EXPECT_EQ(port, UsbPort());
    ASSERT_TRUE(parse_port("2-4.3", port));
    EXPECT_EQ(port_text(hub_of(port)), "2-4");
    EXPECT_EQ(port_text(hub_of(hub_of(port))), "usb2");
    EXPECT_EQ(port_text(hub_of(hub_of(hub_of(port)))), "usb2");
}

// Promise: the table names every device once, with all that its role needs.
TEST(SupportedCameras, TableIsSound) {
    std::set<std::pair<std::uint16_t, std::uint16_t>> seen;
    for (const SupportedCamera& camera : supported_cameras()) {
        EXPECT_TRUE(seen.emplace(camera.vendor_id, camera.product_id).second) << camera.name;
        EXPECT_EQ(find_supported_camera(camera.vendor_id, camera.product_id), &camera);
        EXPECT_EQ(camera.driver == CameraDriver::kNone, camera.role == CameraRole::kUnsupported) << camera.name;
        const bool needs_remark = camera.role == CameraRole::kDepthOnly || camera.role == CameraRole::kUnsupported;
        EXPECT_EQ(std::string(camera.remark).empty(), !needs_remark) << camera.name;
    }
    EXPECT_EQ(find_supported_camera(0x1d6b, 0x0002), nullptr);
}

// Promise: the rules file that is installed is the table's.
TEST(SupportedCameras, RulesFileIsTheTables) {
    std::ifstream file(STILLMESH_RULES_FILE);
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_EQ(text.str(), udev_rules()) << "make it again: stillmesh cameras --udev-rules > hal/usb/60-stillmesh.rules";
    EXPECT_NE(udev_rules().find("ATTR{idVendor}==\"1d27\", ATTR{idProduct}==\"0601\", MODE=\"0660\", GROUP=\"video\", "
                                "TAG+=\"uaccess\"\n"),
              std::string::npos);
    EXPECT_EQ(udev_rules().find("097c"), std::string::npos) << "nothing here serves it";
}

}  // namespace
}  // namespace stillmesh::camera_check_test
