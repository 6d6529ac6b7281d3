// The stock libusb on an emulated bus (umockdev): what is plugged in, who may open it, who has it, stalls and resets,
// unplugging and plugging in again, two cameras at once, and what `stillmesh cameras` says about each.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "hal/usb/camera_check.hpp"
#include "hal/usb/libusb_link.hpp"
#include "platform/cli/cameras_command.hpp"
#include "tests/support/temporary_folder.hpp"
#include "tests/usb/emulated_bus.hpp"
#ifdef STILLMESH_OPENNI2_REAL
#include "tests/openni2/rig.hpp"
#endif

namespace stillmesh::emulated_bus_test {
namespace {

using Clock = std::chrono::steady_clock;

[[nodiscard]] double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

[[nodiscard]] CameraSurroundings everything_installed() {
    CameraSurroundings surroundings;
    surroundings.has_openni2 = surroundings.has_freenect = true;
    surroundings.plug_in_folder = "/usr/lib/OpenNI2/Drivers";
    surroundings.plug_ins = {"libPS1080.so.0", "libPSLink.so.0"};
    return surroundings;
}

// Another process on the same bus (usb_neighbour.cpp). Ends with the object.
class Neighbour {
public:
    explicit Neighbour(const std::string& arguments) {
        int to[2];
        int from[2];
        EXPECT_EQ(::pipe(to), 0);
        EXPECT_EQ(::pipe(from), 0);
        pid_ = ::fork();
        if (pid_ == 0) {
            static_cast<void>(::dup2(to[0], 0));
            static_cast<void>(::dup2(from[1], 1));
            for (const int file : {to[0], to[1], from[0], from[1]}) static_cast<void>(::close(file));
            const std::string command = std::string("exec ") + STILLMESH_USB_NEIGHBOUR + " " + arguments;
            ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
            ::_exit(127);
        }
        static_cast<void>(::close(to[0]));
        static_cast<void>(::close(from[1]));
        to_ = to[1];
        from_ = from[0];
    }
    ~Neighbour() {
        static_cast<void>(::close(to_));
        int status = 0;
        static_cast<void>(::waitpid(pid_, &status, 0));
        static_cast<void>(::close(from_));
    }
    Neighbour(const Neighbour&) = delete;
    Neighbour& operator=(const Neighbour&) = delete;

    // What it says up to `end`, or until it stops talking.
    [[nodiscard]] std::string read_until(char end) const {
        std::string text;
        for (char letter = 0; ::read(from_, &letter, 1) == 1 && letter != end;) text += letter;
        return text;
    }
    [[nodiscard]] int pid() const { return pid_; }

private:
    int to_ = -1;
    int from_ = -1;
    pid_t pid_ = -1;
};

// What `stillmesh ARGUMENTS` prints, and its exit code; OpenNI2 is loaded from `libraries`, if that is given.
struct Said {
    int code = -1;
    std::string text;
};
[[nodiscard]] Said says(const std::string& arguments, const std::string& libraries = {}) {
    const std::string before = libraries.empty() ? std::string() : "LD_LIBRARY_PATH=" + libraries + " ";
    std::FILE* const pipe = ::popen((before + STILLMESH_PROGRAM + " " + arguments).c_str(), "r");
    Said said;
    char buffer[512];
    while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) said.text += buffer;
    const int status = ::pclose(pipe);
    if (WIFEXITED(status)) said.code = WEXITSTATUS(status);
    return said;
}

class EmulatedBusTest : public ::testing::Test {
protected:
    [[nodiscard]] std::vector<CameraReport> check() {
        LibusbLink link;
        std::vector<CameraReport> reports;
        EXPECT_EQ(check_cameras(link, everything_installed(), reports), UsbStatus::kOk);
        return reports;
    }
    void expect_one(CameraVerdict verdict, const std::string& sentence) {
        const std::vector<CameraReport> reports = check();
        const std::string text = cameras_text(reports);
        ASSERT_EQ(reports.size(), 1U) << text;
        EXPECT_STREQ(verdict_name(reports[0].verdict), verdict_name(verdict)) << text;
        EXPECT_NE(text.find(sentence), std::string::npos) << text;
        // The program itself, with what is installed here.
#ifndef STILLMESH_HAS_OPENNI2
        if (reports[0].camera->driver != CameraDriver::kFreenect) return;
#endif
#ifndef STILLMESH_HAS_FREENECT
        if (reports[0].camera->driver == CameraDriver::kFreenect) return;
#endif
        const Said said = says("cameras");
        EXPECT_NE(said.text.find(sentence), std::string::npos) << said.text;
        EXPECT_EQ(said.code, can_stream(verdict) ? 0 : 1) << said.text;
    }
    // The device with these ids on the bus as `link` sees it.
    [[nodiscard]] static UsbDevice find_device(UsbLink& link, std::uint16_t product_id = 0x0601) {
        std::vector<UsbDevice> devices;
        EXPECT_EQ(link.enumerate(devices), UsbStatus::kOk);
        for (const UsbDevice& device : devices) {
            if (device.product_id == product_id) return device;
        }
        ADD_FAILURE() << "not on the bus";
        return {};
    }

    test::EmulatedBus bus_;
};

// Promise: every device is there with its ids, place, speed, power, endpoints and strings.
TEST_F(EmulatedBusTest, Enumerates) {
    bus_.plug(
        {.port = "1-4", .vendor_id = 0x1d6b, .product_id = 0x0002, .address = 5, .power_ma = 100, .is_hub = true});
    bus_.plug({.port = "1-4.2", .address = 7, .serial = "ABC"});
    LibusbLink link;
    std::vector<UsbDevice> devices;
    ASSERT_EQ(link.enumerate(devices), UsbStatus::kOk);
    ASSERT_EQ(devices.size(), 3U);
    EXPECT_EQ(port_text(devices[0].port), "usb1");
    EXPECT_TRUE(devices[0].is_self_powered);
    EXPECT_EQ(port_text(devices[1].port), "1-4");
    EXPECT_EQ(devices[1].device_class, kUsbClassHub);
    EXPECT_FALSE(devices[1].is_self_powered);
    const UsbDevice& camera = devices[2];
    EXPECT_EQ(port_text(camera.port), "1-4.2");
    EXPECT_EQ(camera.vendor_id, 0x1d27);
    EXPECT_EQ(camera.product_id, 0x0601);
    EXPECT_EQ(camera.address, 7);
    EXPECT_EQ(camera.speed, UsbSpeed::kHigh);
    EXPECT_TRUE(camera.is_configured);
    EXPECT_EQ(camera.power_ma, 500U);
    EXPECT_EQ(camera.interfaces, 1);
    EXPECT_EQ(camera.endpoints_in[0], 0x81);
    EXPECT_EQ(camera.endpoints_in[2], 0x83);
    EXPECT_EQ(camera.endpoints_in[3], 0);
    EXPECT_EQ(camera.product, "Xtion PRO Live (emulated)");
    EXPECT_EQ(camera.serial, "ABC");
    const UsbNode node = link.node(camera);
    EXPECT_EQ(node.path, "/dev/bus/usb/001/007");
    EXPECT_TRUE(node.exists && node.is_open_to_us);
    EXPECT_TRUE(link.holders(camera).empty());
    EXPECT_TRUE(link.kernel_driver(camera).empty());
}

// Promise: 1: a camera in order can stream.
TEST_F(EmulatedBusTest, Ready) {
    test::EmulatedDevice& camera = bus_.plug({});
    expect_one(CameraVerdict::kReady,
               "ASUS Xtion PRO Live (1d27:0601), serial SYN0001\n  at        USB port 1-1, high "
               "speed (480 Mbit/s), asks for 500 mA\n");
    expect_one(CameraVerdict::kReady, "streams   yes");
    EXPECT_EQ(camera.resets(), 0);
}

// Promise: 2: with nothing but a mouse plugged in, none is found.
TEST_F(EmulatedBusTest, NoCamera) {
    bus_.plug({.vendor_id = 0x046d, .product_id = 0xc077, .speed_mbit = 12, .product = "Mouse"});
    const std::vector<CameraReport> reports = check();
    EXPECT_TRUE(reports.empty());
    EXPECT_NE(cameras_text(reports).find("No depth camera is plugged in"), std::string::npos);
    const Said said = says("cameras");
    EXPECT_NE(said.text.find("No depth camera is plugged in"), std::string::npos) << said.text;
    EXPECT_EQ(said.code, 1);
}

// Promise: 3: a user without permission is told of the udev rule.
TEST_F(EmulatedBusTest, PermissionDenied) {
    const test::EmulatedDevice& camera = bus_.plug({});
    bus_.let_others_in();
    struct stat facts {};
    ASSERT_EQ(::stat(camera.file().c_str(), &facts), 0);
    ASSERT_EQ(::chmod(camera.file().c_str(), (facts.st_mode & ~0777U) | 0600U), 0);
    // Root may open anything: become somebody else. Somebody else becomes nobody's friend.
    const bool is_root = ::geteuid() == 0;
    if (!is_root) {
        ASSERT_EQ(::chmod(camera.file().c_str(), facts.st_mode & ~0777U), 0);
    }
    const Neighbour user(is_root ? "check 65534" : "check");
    const std::string text = user.read_until('\0');
    EXPECT_NE(text.find("no: this user may not open /dev/bus/usb/001/002: the udev rules are missing"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("stillmesh cameras --udev-rules | sudo tee"), std::string::npos) << text;
}

// Promise: 4: another process that has claimed it is named.
TEST_F(EmulatedBusTest, HeldByAnotherProcess) {
    test::EmulatedDevice& camera = bus_.plug({});
    {
        const Neighbour neighbour("hold 1-1");
        ASSERT_EQ(neighbour.read_until('\n'), "held");
        EXPECT_EQ(camera.open_now(), 1);
        expect_one(CameraVerdict::kHeld,
                   "another program uses it: usb_neighbour (process " + std::to_string(neighbour.pid()) + ")");
        std::string message;
        LibusbLink link;
        EXPECT_EQ(reset_camera(link, "", message), UsbStatus::kBusy);
        EXPECT_EQ(camera.resets(), 0) << "a reset tore the camera from another program";
    }
    expect_one(CameraVerdict::kReady, "streams   yes");
}

// Promise: 5: USB 1 is too slow.
TEST_F(EmulatedBusTest, WrongSpeed) {
    bus_.plug({.speed_mbit = 12});
    expect_one(CameraVerdict::kTooSlow, "no: it is connected at full speed (12 Mbit/s), too slow for images");
}

// Promise: 6: a camera that its hub cannot feed.
TEST_F(EmulatedBusTest, NotEnoughPower) {
    bus_.plug(
        {.port = "1-4", .vendor_id = 0x1d6b, .product_id = 0x0002, .address = 5, .power_ma = 100, .is_hub = true});
    bus_.plug({.port = "1-4.2", .address = 6, .is_configured = false});
    expect_one(CameraVerdict::kNoPower,
               "no: it is switched off: it asks for 500 mA and the hub at 1-4 has no power supply of its own");
}

// Promise: 7: two cameras at once: both are seen and can be opened, and the shared bus is told; nobody mixes them up.
TEST_F(EmulatedBusTest, TwoCameras) {
    test::EmulatedDevice& first = bus_.plug({.serial = "A"});
    test::EmulatedDevice& second =
        bus_.plug({.port = "1-2", .product_id = 0x0609, .address = 3, .product = "Carmine", .serial = "B"});
    const std::vector<CameraReport> reports = check();
    ASSERT_EQ(reports.size(), 2U);
    EXPECT_EQ(reports[0].verdict, CameraVerdict::kSharedBus);
    EXPECT_EQ(reports[0].device.serial, "A");
    EXPECT_EQ(reports[1].device.serial, "B");
    EXPECT_NE(cameras_text(reports).find("yes, but it shares a USB 2 bus with the camera at 1-2"), std::string::npos);

    LibusbLink link;
    UsbHandle handles[2];
    ASSERT_EQ(link.open(reports[0].device, handles[0]), UsbStatus::kOk);
    ASSERT_EQ(link.open(reports[1].device, handles[1]), UsbStatus::kOk);
    EXPECT_EQ(link.claim(handles[0], 0), UsbStatus::kOk);
    EXPECT_EQ(link.claim(handles[1], 0), UsbStatus::kOk);
    EXPECT_EQ(link.reset(handles[1]), UsbStatus::kOk);
    EXPECT_EQ(first.resets(), 0);
    EXPECT_EQ(second.resets(), 1);
    link.close(handles[0]);
}

// Promise: 8: a camera that has halted, and one that answers nothing, are stuck; the reset that is advised helps; the
// silent one costs half a second, not for ever.
TEST_F(EmulatedBusTest, StallAndReset) {
    test::EmulatedDevice& camera = bus_.plug({});
    std::string message;
    camera.halt();
    expect_one(CameraVerdict::kNoAnswer, "it is stuck: it has halted its image stream");
    {
        LibusbLink link;
        EXPECT_EQ(reset_camera(link, "1-1", message), UsbStatus::kOk) << message;
    }
    EXPECT_EQ(camera.resets(), 1);
    expect_one(CameraVerdict::kReady, "streams   yes");

    camera.hang();
    const Clock::time_point begin = Clock::now();
    expect_one(CameraVerdict::kNoAnswer, "stillmesh cameras --reset 1-1");
    EXPECT_LT(seconds_since(begin), 2.0);
    {
        LibusbLink link;
        EXPECT_EQ(reset_camera(link, "", message), UsbStatus::kOk) << message;
    }
    EXPECT_EQ(camera.resets(), 2);
    expect_one(CameraVerdict::kReady, "streams   yes");
}

// Promise: 9: a Kinect whose power brick is not plugged in.
TEST_F(EmulatedBusTest, KinectMotorAlone) {
    bus_.plug({.port = "1-4", .vendor_id = 0x0409, .product_id = 0x005a, .address = 5, .is_hub = true});
    bus_.plug({.port = "1-4.2", .vendor_id = 0x045e, .product_id = 0x02b0, .address = 6, .product = "Xbox NUI Motor"});
    expect_one(CameraVerdict::kNoCamera, "the Kinect's own power supply");
    bus_.plug({.port = "1-4.1", .vendor_id = 0x045e, .product_id = 0x02ae, .address = 7, .product = "Xbox NUI Camera"});
    expect_one(CameraVerdict::kReady, "stillmesh run --camera freenect");
}

// Promise: 10: an Astra without Orbbec's driver, and one in its boot loader.
TEST_F(EmulatedBusTest, Astra) {
    test::EmulatedDevice& camera = bus_.plug({.vendor_id = 0x2bc5, .product_id = 0x0401, .product = "Astra"});
    expect_one(CameraVerdict::kDriverMissing, "liborbbec.so.0, is not in");
    bus_.unplug(camera);
    bus_.plug({.vendor_id = 0x2bc5, .product_id = 0x0300, .address = 3, .product = "Astra"});
    expect_one(CameraVerdict::kBootloader, "waits in its boot loader");
}

// Promise: 11: cameras that will never do here, and which would.
TEST_F(EmulatedBusTest, WrongCameras) {
    test::EmulatedDevice& pro = bus_.plug({.vendor_id = 0x2bc5, .product_id = 0x0403, .product = "Astra Pro"});
    expect_one(CameraVerdict::kDepthOnly, "do        use a camera with both behind one driver");
    bus_.unplug(pro);
    bus_.plug({.vendor_id = 0x045e, .product_id = 0x097c, .address = 3, .product = "Azure Kinect"});
    expect_one(CameraVerdict::kUnsupported, "do        use an ASUS Xtion PRO Live");
}

// Promise: 12: whether the driver is installed is asked of the OpenNI2 that the program runs with: a driver that is not
// there, a link to nothing and a file of another processor are three ways of having none.
TEST_F(EmulatedBusTest, DriverOfTheOpenNi2AtHand) {
#ifndef STILLMESH_OPENNI2_REAL
    GTEST_SKIP() << "this build has no OpenNI2";
#else
    bus_.plug({});
    const std::filesystem::path library = STILLMESH_OPENNI2_REAL;
    const test::TemporaryFolder own;
    const std::string folder = own.path("OpenNI2/Drivers");
    std::filesystem::create_directories(folder);
    std::filesystem::create_symlink(library, own.path("libOpenNI2.so.0"));
    const std::string driver = folder + "/libPS1080.so.0";
    const auto expect = [&own](int code, const std::string& sentence) {
        const Said said = says("cameras", own.path());
        EXPECT_EQ(said.code, code) << said.text;
        EXPECT_NE(said.text.find(sentence), std::string::npos) << said.text;
    };
    expect(1, "no: OpenNI2's driver for it, libPS1080.so.0, is not in " + folder + "\n  do        install OpenNI2");
    const Said run = says("run --camera auto --wait 2>&1", own.path());
    EXPECT_EQ(run.code, 2) << "waiting would not help";
    EXPECT_NE(run.text.find("OpenNI2 does not start (Found no files matching '" + folder +
                            "/lib*.so.0'); if its drivers are missing, install it again: sudo apt-get install "
                            "--reinstall libopenni2-0\n"),
              std::string::npos)
        << run.text;
    std::filesystem::create_symlink(own.path("nothing"), driver);
    expect(1, "libPS1080.so.0, is damaged or for another processor, in " + folder);
    std::filesystem::remove(driver);
    std::filesystem::copy_file(library.parent_path() / "OpenNI2/Drivers/libPS1080.so.0", driver);
    expect(0, "streams   yes\n  do        stillmesh run --camera auto\n");
    std::fstream(driver, std::ios::in | std::ios::out | std::ios::binary).seekp(18).put(8);  // a MIPS
    expect(1, "libPS1080.so.0, is damaged or for another processor, in " + folder);
#endif
}

// Promise: a camera that falls silent while the program tracks it is reset on the USB bus, the one that OpenNI2 has by
// its URI and no other, and opened again; when it speaks, it is tracked again.
TEST_F(EmulatedBusTest, AStalledCameraIsReset) {
#ifndef STILLMESH_OPENNI2_REAL
    GTEST_SKIP() << "this build has no OpenNI2";
#else
    test::EmulatedDevice& other = bus_.plug({.port = "1-2", .address = 5});
    test::EmulatedDevice& camera = bus_.plug({});
    test::CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().address = 2;
    rig.camera().is_plugged = 1;
    const test::TemporaryFolder scratch;
    const std::string path = scratch.path("path.txt");
    test::Program run(STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2, "run --camera auto --trajectory " + path, scratch);
    const auto says_again = [&](const char* sentence, std::size_t from) {
        return test::within(20'000, [&] { return run.err().find(sentence, from) != std::string::npos; });
    };
    ASSERT_TRUE(test::within(30'000, [&] { return test::text_of(path).size() > 1000; })) << run.err();
    for (int stalls = 1; stalls <= 2; ++stalls) {
        const std::size_t heard = run.err().size();
        rig.camera().is_stalled = 1;
        ASSERT_TRUE(says_again("the camera is reset and opened again", heard)) << run.err();
        EXPECT_EQ(camera.resets(), stalls) << run.err();
        rig.camera().is_stalled = 0;
        ASSERT_TRUE(says_again("the camera is back after", heard)) << run.err();
        const std::size_t before = test::text_of(path).size();
        ASSERT_TRUE(test::within(10'000, [&] { return test::text_of(path).size() > before + 1000; })) << run.err();
    }
    EXPECT_EQ(other.resets(), 0);
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(10'000), 130) << run.err();
#endif
}

// Promise: unplugging and plugging in again are heard, with ids and place, within a second; calls on a device that is
// gone say so; a device back at its place has the same port.
TEST_F(EmulatedBusTest, UnplugAndReplug) {
    LibusbLink link;
    UsbEvent event;
    EXPECT_EQ(link.wait_event(event, 1), UsbStatus::kTimedOut);
    test::EmulatedDevice* camera = &bus_.plug({});
    for (std::uint8_t round = 0; round < 5; ++round) {
        ASSERT_EQ(link.wait_event(event, 1000), UsbStatus::kOk);
        EXPECT_EQ(event.kind, UsbEvent::Kind::kArrived);
        EXPECT_EQ(event.vendor_id, 0x1d27);
        EXPECT_EQ(port_text(event.port), "1-1");
        const UsbDevice device = find_device(link);
        UsbHandle handle;
        ASSERT_EQ(link.open(device, handle), UsbStatus::kOk);
        ASSERT_EQ(link.claim(handle, 0), UsbStatus::kOk);

        bus_.unplug(*camera);
        std::uint8_t answer[2];
        std::size_t count = 0;
        EXPECT_EQ(link.control_in(handle, 0x80, 0, 0, 0, answer, count, 500), UsbStatus::kGone);
        EXPECT_EQ(link.reset(handle), UsbStatus::kGone);
        ASSERT_EQ(link.wait_event(event, 1000), UsbStatus::kOk);
        EXPECT_EQ(event.kind, UsbEvent::Kind::kLeft);
        EXPECT_EQ(event.product_id, 0x0601);
        EXPECT_EQ(link.open(device, handle), UsbStatus::kGone);
        std::vector<UsbDevice> devices;
        ASSERT_EQ(link.enumerate(devices), UsbStatus::kOk);
        EXPECT_EQ(devices.size(), 1U);

        const Clock::time_point begin = Clock::now();
        EXPECT_EQ(link.wait_event(event, 100), UsbStatus::kTimedOut);
        EXPECT_LT(seconds_since(begin), 1.0);
        camera = &bus_.plug({.address = static_cast<std::uint8_t>(3 + round)});
    }
}

// Promise: more events than anybody takes are no leak and no lie: what was lost is said.
TEST_F(EmulatedBusTest, EventsAreBounded) {
    LibusbLink link;
    UsbEvent event;
    EXPECT_EQ(link.wait_event(event, 1), UsbStatus::kTimedOut);
    // Udev tells in its own time, and libusb forgets a device that left before it was looked at.
    const auto comes_or_goes = [&link](std::uint8_t address, bool is_coming) {
        std::vector<UsbDevice> devices;
        for (int i = 0; i < 1000; ++i) {
            EXPECT_EQ(link.enumerate(devices), UsbStatus::kOk);
            const bool is_there = std::any_of(devices.begin(), devices.end(),
                                              [address](const UsbDevice& device) { return device.address == address; });
            if (is_there == is_coming) return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        return false;
    };
    for (std::uint8_t address = 10; address < 22; ++address) {
        test::EmulatedDevice& plugged = bus_.plug({.address = address});
        ASSERT_TRUE(comes_or_goes(address, true));
        bus_.unplug(plugged);
        ASSERT_TRUE(comes_or_goes(address, false));
    }
    std::size_t count = 0;
    UsbStatus status = UsbStatus::kOk;
    while ((status = link.wait_event(event, 200)) == UsbStatus::kOk) ++count;
    EXPECT_LE(count, UsbLink::kEventsMax);
    EXPECT_EQ(status, UsbStatus::kFull) << usb_status_name(status) << ", " << count;
}

// Promise: kOpenMax devices can be open; one more is refused, and room is made by closing.
TEST_F(EmulatedBusTest, OpenDevicesAreBounded) {
    bus_.plug({});
    LibusbLink link;
    const UsbDevice device = find_device(link);
    std::vector<UsbHandle> handles(UsbLink::kOpenMax);
    for (UsbHandle& handle : handles) ASSERT_EQ(link.open(device, handle), UsbStatus::kOk);
    UsbHandle another;
    EXPECT_EQ(link.open(device, another), UsbStatus::kFull);
    link.close(handles[3]);
    EXPECT_EQ(link.open(device, another), UsbStatus::kOk);
    // A claim belongs to the handle that made it.
    EXPECT_EQ(link.claim(handles[0], 0), UsbStatus::kOk);
    EXPECT_EQ(link.claim(handles[1], 0), UsbStatus::kBusy);
}

// Promise: the program itself says the same, and its JSON can be read; its exit code tells whether a camera can stream.
TEST_F(EmulatedBusTest, TheProgram) {
    const auto run = [](const std::string& arguments, int& code) {
        const Said said = says(arguments);
        code = said.code;
        return said.text;
    };
    int code = -1;
    EXPECT_NE(run("cameras", code).find("No depth camera"), std::string::npos);
    EXPECT_EQ(code, 1);
    test::EmulatedDevice& camera = bus_.plug({.speed_mbit = 12});
    const nlohmann::json slow = nlohmann::json::parse(run("cameras --json", code));
    EXPECT_EQ(code, 1);
    EXPECT_EQ(slow["cameras"][0]["verdict"], "too_slow");
    EXPECT_EQ(slow["cameras"][0]["can_stream"], false);
    bus_.unplug(camera);
    test::EmulatedDevice& fast = bus_.plug({.address = 9});
    const nlohmann::json json = nlohmann::json::parse(run("cameras --json", code));
#ifdef STILLMESH_HAS_OPENNI2
    EXPECT_EQ(json["cameras"][0]["verdict"], "ready") << json;
    EXPECT_EQ(code, 0);
#else
    EXPECT_EQ(json["cameras"][0]["verdict"], "driver_missing") << json;
    EXPECT_EQ(code, 1);
#endif
    EXPECT_EQ(json["cameras"][0]["openni2_uri"], "1d27/0601@1/9");
    EXPECT_EQ(run("cameras --reset", code), "the camera at 1-1 was reset.\n");
    EXPECT_EQ(code, 0);
    EXPECT_EQ(fast.resets(), 1);
    run("cameras --reset 1-2 2>/dev/null", code);
    EXPECT_EQ(code, 1);
}

}  // namespace
}  // namespace stillmesh::emulated_bus_test

// umockdev works by standing before the C library: start again with it there.
int main(int argc, char** argv) {
    if (std::getenv("STILLMESH_IS_SECOND_START") == nullptr) {
        const char* const others = std::getenv("LD_PRELOAD");
        const std::string preload = std::string("libumockdev-preload.so.0") + (others != nullptr ? ":" : "") +
                                    (others != nullptr ? others : "");
        static_cast<void>(::setenv("LD_PRELOAD", preload.c_str(), 1));
        static_cast<void>(::setenv("STILLMESH_IS_SECOND_START", "1", 1));
        ::execv("/proc/self/exe", argv);
        std::perror("execv");
        return 1;
    }
    ::testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
