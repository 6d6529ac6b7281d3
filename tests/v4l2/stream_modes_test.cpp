// Which modes are chosen, and what is made of drivers that list nonsense.
#include "hal/v4l2/stream_modes.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/sysfs_nodes.hpp"
#include "tests/v4l2/emulated_device.hpp"

namespace stillmesh::v4l2::stream_modes_test {
namespace {

[[nodiscard]] Mode mode(std::uint32_t code, std::uint32_t width, std::uint32_t height, std::uint32_t rate) {
    return {code, {width, height}, {1, rate}};
}
[[nodiscard]] std::string best(const std::vector<Mode>& depth, const std::vector<Mode>& colour,
                               const ModeWishes& wishes = {}) {
    const std::vector<ModePair> pairs = rank_modes(depth, colour, wishes);
    return pairs.empty() ? "none" : mode_text(pairs[0].depth) + " + " + mode_text(pairs[0].colour);
}

// Promise: 848x480 and 640x480 at 30; rates before sizes; Z16 before Y16, RGB before YUV before JPEG before grey; never
// beyond the limits; the sizes of before come first.
TEST(StreamModes, BestFirst) {
    const std::vector<Mode> depth{mode(kZ16, 1280, 720, 30), mode(kZ16, 848, 480, 90), mode(kZ16, 848, 480, 30),
                                  mode(kZ16, 640, 480, 30), mode(kY16, 848, 480, 30)};
    const std::vector<Mode> colour{mode(kMjpg, 640, 480, 30), mode(kYuyv, 1280, 720, 30), mode(kYuyv, 640, 480, 60),
                                   mode(kYuyv, 640, 480, 30), mode(kGrey, 640, 480, 30)};
    EXPECT_EQ(best(depth, colour), "Z16 848x480@30 + YUYV 640x480@30");
    // A D435 at a USB 2 port.
    EXPECT_EQ(best({mode(kZ16, 640, 480, 15), mode(kZ16, 480, 270, 30), mode(kZ16, 848, 480, 6)},
                   {mode(kYuyv, 640, 480, 15), mode(kYuyv, 424, 240, 30)}),
              "Z16 480x270@30 + YUYV 424x240@30");
    EXPECT_EQ(best({mode(kY16, 640, 480, 30)}, {mode(kRgb3, 640, 480, 30), mode(kYuyv, 640, 480, 30)}),
              "Y16 640x480@30 + RGB3 640x480@30");
    ModeWishes wishes;
    wishes.width_max = 500;
    EXPECT_EQ(best(depth, colour, wishes), "none");
    wishes = {};
    wishes.depth_first = {640, 480};
    EXPECT_EQ(best(depth, colour, wishes), "Z16 640x480@30 + YUYV 640x480@30");
    wishes = {};
    wishes.has_jpeg = false;
    EXPECT_EQ(best(depth, {mode(kMjpg, 640, 480, 30)}, wishes), "none");
    wishes.has_y16_depth = false;
    EXPECT_EQ(best({mode(kY16, 640, 480, 30)}, colour, wishes), "none");
    wishes = {};
    wishes.is_one_view = true;
    EXPECT_EQ(best(depth, colour, wishes), "Z16 640x480@30 + GREY 640x480@30");
    wishes = {};
    wishes.has_infrared_colour = false;
    EXPECT_EQ(best(depth, {mode(kGrey, 640, 480, 30)}, wishes), "none");
}

// Promise: what both streams move, and words for a message.
TEST(StreamModes, Says) {
    const ModePair pair{mode(kZ16, 848, 480, 30), mode(kYuyv, 640, 480, 30)};
    EXPECT_EQ(pair.bytes_per_s(), 848.0 * 480 * 2 * 30 + 640.0 * 480 * 2 * 30);
    const std::vector<Mode> modes{pair.depth, pair.depth, pair.colour};
    EXPECT_EQ(modes_text(modes, true), "848x480@30");
    EXPECT_EQ(modes_text(modes, false), "640x480@30");
    EXPECT_EQ(modes_text({}, false), "none");
}

// Promise: endless lists end, sizes and rates that make no sense are left out, formats that are not understood too.
TEST(StreamModes, Nonsense) {
    test::EmulatedDevice device;
    auto& modes = device.depth().modes;
    modes.clear();
    for (std::uint32_t i = 0; i < 400; ++i) modes.push_back({kZ16, 100 + i, 100, std::vector<std::uint32_t>(50, 30)});
    int handle = -1;
    std::vector<Mode> listed;
    ASSERT_EQ(device.open("/dev/video0", handle), 0);
    EXPECT_EQ(list_modes(device, handle, listed), 0);
    EXPECT_EQ(listed.size(), kModesMax);
    modes = {{kZ16, 0, 480, {30}}, {kZ16, 70'000, 480, {30}}, {kZ16, 640, 480, {0, 1, 30, 1000}}, {7, 640, 480, {30}}};
    EXPECT_EQ(list_modes(device, handle, listed), 0);
    ASSERT_EQ(listed.size(), 1U);
    EXPECT_EQ(mode_text(listed[0]), "Z16 640x480@30");
    device.close(handle);
}

// Promise: nodes and the USB devices behind them as sysfs has them, by number; others without a device; nothing where
// there is no sysfs.
TEST(SysfsNodes, ReadsTheTree) {
    namespace fs = std::filesystem;
    const fs::path root = fs::path(testing::TempDir()) / "stillmesh_sysfs";
    fs::remove_all(root);
    const auto write = [](const fs::path& file, const char* text) { std::ofstream(file) << text << "\n"; };
    const fs::path usb = root / "devices/pci0000:00/usb2/2-1.4";
    fs::create_directories(root / "class/video4linux");
    for (const char* const name : {"video10", "video2"}) {
        const bool is_depth = std::string(name) == "video2";
        const fs::path interface = usb / (is_depth ? "2-1.4:1.0" : "2-1.4:1.3");
        fs::create_directories(interface / "video4linux" / name);
        write(interface / "bInterfaceNumber", is_depth ? "00" : "03");
        fs::create_directory_symlink(interface, interface / "video4linux" / name / "device");
        fs::create_directory_symlink(interface / "video4linux" / name, root / "class/video4linux" / name);
    }
    write(usb / "idVendor", "8086");
    write(usb / "idProduct", "0b07");
    write(usb / "serial", "018322070337");
    write(usb / "product", "Intel(R) RealSense(TM) Depth Camera 435 ");
    write(usb / "speed", "5000");
    fs::create_directories(root / "devices/platform/csi/video4linux/video0");
    fs::create_directory_symlink(root / "devices/platform/csi",
                                 root / "devices/platform/csi/video4linux/video0/device");
    fs::create_directory_symlink(root / "devices/platform/csi/video4linux/video0", root / "class/video4linux/video0");
    fs::create_directories(root / "class/video4linux/v4l-subdev0");
    fs::create_directories(root / "class/video4linux/video1x");
    const std::vector<V4l2Node> nodes = nodes_of_sysfs(root.string(), "/dev");
    ASSERT_EQ(nodes.size(), 3U);
    EXPECT_EQ(nodes[0].path, "/dev/video0");
    EXPECT_EQ(nodes[0].usb_port + nodes[0].serial, "");
    EXPECT_EQ(nodes[1].path, "/dev/video2");
    EXPECT_EQ(nodes[1].usb_port, "2-1.4");
    EXPECT_EQ(nodes[1].serial, "018322070337");
    EXPECT_EQ(nodes[1].product, "Intel(R) RealSense(TM) Depth Camera 435");
    EXPECT_EQ(nodes[1].vendor_id, 0x8086);
    EXPECT_EQ(nodes[1].product_id, 0x0b07);
    EXPECT_EQ(nodes[1].speed_mbit_per_s, 5000U);
    EXPECT_EQ(nodes[1].interface, 0);
    EXPECT_EQ(nodes[2].path, "/dev/video10");
    EXPECT_EQ(nodes[2].interface, 3);
    fs::remove_all(root);
    EXPECT_TRUE(nodes_of_sysfs(root.string(), "/dev").empty());
}

}  // namespace
}  // namespace stillmesh::v4l2::stream_modes_test
