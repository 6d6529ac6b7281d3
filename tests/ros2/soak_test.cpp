// Ten minutes of a robot: images from Fast DDS at 30 Hz, poses back to it. STILLMESH_SOAK_S: other than ten minutes.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/program.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::soak_test {
namespace {

using test::Program;
using test::within;
namespace fast = test::fast;

constexpr std::uint32_t kWidth = 640, kHeight = 480, kPictures = 60;
constexpr std::int64_t kPeriod_ns = 33'333'333;
constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000;

struct Messages {
    std::vector<fast::Image> colour, depth;
    fast::CameraInfo info;
};

[[nodiscard]] Messages rendered_messages() {
    const test::Sequence sequence = test::rendered("walking_xyz", kPictures, kWidth, kHeight);
    Messages out;
    const CameraModel& model = sequence.camera;
    out.info.width = kWidth;
    out.info.height = kHeight;
    out.info.distortion_model = "plumb_bob";
    out.info.d = {model.k1, model.k2, model.p1, model.p2, model.k3};
    out.info.k = {model.fx, 0, model.cx, 0, model.fy, model.cy, 0, 0, 1};
    for (const test::KeptFrame& frame : sequence.frames) {
        const std::uint32_t channels = channels_of(frame.format);
        out.colour.push_back(
            {{}, kHeight, kWidth, channels == 1 ? "mono8" : "rgb8", 0, kWidth * channels, frame.colour});
        fast::Image depth{{}, kHeight, kWidth, "16UC1", 0, kWidth * 2, {}};
        depth.data.resize(frame.depth.size() * 2);
        for (std::size_t i = 0; i < frame.depth.size(); ++i) {
            const auto mm = static_cast<std::uint16_t>(frame.depth[i] * 1000 / frame.depth_units_per_m + 0.5);
            std::memcpy(&depth.data[2 * i], &mm, 2);
        }
        out.depth.push_back(std::move(depth));
    }
    return out;
}

// Publishes at 30 Hz, there and back again, and knows when it sent what.
class Driver {
public:
    Driver() : thread_([this](const std::stop_token& stop) { run(stop); }) {}
    void stop() {
        thread_.request_stop();
        thread_.join();
    }
    [[nodiscard]] std::size_t sent() const {
        const std::lock_guard lock(mutex_);
        return sent_ns_.size();
    }
    // When the colour image of that stamp was given to DDS; 0: it was not.
    [[nodiscard]] std::int64_t sent_ns(std::int64_t stamp_ns) const {
        const std::lock_guard lock(mutex_);
        const auto found = sent_ns_.find(stamp_ns);
        return found == sent_ns_.end() ? 0 : found->second;
    }

private:
    void run(const std::stop_token& stop) {
        Messages messages = rendered_messages();
        auto due = std::chrono::steady_clock::now();
        for (std::int64_t i = 0; !stop.stop_requested(); ++i) {
            std::int64_t index = i % (2 * (kPictures - 1));
            if (index >= kPictures) index = 2 * (kPictures - 1) - index;
            const std::int64_t stamp_ns = kBegin_ns + i * kPeriod_ns;
            const fast::Header header{static_cast<std::int32_t>(stamp_ns / 1'000'000'000),
                                      static_cast<std::uint32_t>(stamp_ns % 1'000'000'000),
                                      "camera_color_optical_frame"};
            fast::Image& colour = messages.colour[static_cast<std::size_t>(index)];
            fast::Image& depth = messages.depth[static_cast<std::size_t>(index)];
            colour.header = depth.header = messages.info.header = header;
            {
                const std::lock_guard lock(mutex_);
                sent_ns_[stamp_ns] = test::now_ns();
            }
            EXPECT_TRUE(colour_.write(colour) && depth_.write(depth) && info_.write(messages.info));
            std::this_thread::sleep_until(due += std::chrono::nanoseconds(kPeriod_ns));
        }
    }

    fast::Node node_;
    fast::Node::Writer<fast::Image> colour_{node_, "/camera/color/image_raw", {.is_reliable = false, .depth = 4}};
    fast::Node::Writer<fast::Image> depth_{
        node_, "/camera/aligned_depth_to_color/image_raw", {.is_reliable = false, .depth = 4}};
    fast::Node::Writer<fast::CameraInfo> info_{node_, "/camera/color/camera_info", {.is_reliable = false, .depth = 4}};
    mutable std::mutex mutex_;
    std::map<std::int64_t, std::int64_t> sent_ns_;
    std::jthread thread_;
};

// Stamps of the frames with a pose, as the run has written them down, from `first` on.
[[nodiscard]] std::set<std::int64_t> stamps_of(const std::string& poses, std::int64_t first, std::size_t& frames) {
    std::set<std::int64_t> stamps;
    std::ifstream lines(poses);
    for (std::string line; std::getline(lines, line);) {
        const std::size_t at = line.find("\"time_ns\":");
        if (at == std::string::npos || line.find("\"type\":\"pose\"") == std::string::npos) continue;
        ++frames;
        const std::int64_t stamp = std::atoll(line.c_str() + at + 10);
        if (stamp >= first && line.find("\"state\":\"none\"") == std::string::npos) stamps.insert(stamp);
    }
    return stamps;
}

[[nodiscard]] long resident_kib(pid_t pid) {
    const std::string status = test::text_of("/proc/" + std::to_string(pid) + "/status");
    const std::size_t at = status.find("VmRSS:");
    return at == std::string::npos ? 0 : std::atol(status.c_str() + at + 6);
}

// Without what lies in the blocks of fixed size that the program takes at its start (the engine's, and the copy of the
// map that its points are read from, which a growing map fills).
[[nodiscard]] long resident_outside_blocks_kib(pid_t pid) {
    constexpr long kBlock_kib = 16 * 1024;  // and larger
    std::ifstream lines("/proc/" + std::to_string(pid) + "/smaps");
    long size = 0, all = 0;
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with("Size:")) size = std::atol(line.c_str() + 5);
        if (line.starts_with("Rss:") && size < kBlock_kib) all += std::atol(line.c_str() + 4);
    }
    return all;
}

struct Resident {
    long all_kib = 0, outside_kib = 0;
    void look(pid_t pid) { *this = {resident_kib(pid), resident_outside_blocks_kib(pid)}; }
};

// Promise: for ten minutes at 30 Hz every pose that the run gave out comes on /odom and on /tf, from the first that was
// heard on, with the stamp of its image; and outside the blocks that it took at its start the program's memory stays
// where it was after a minute.
TEST(RosSoak, TenMinutesAtThirtyHz) {
    const char* const wished = std::getenv("STILLMESH_SOAK_S");
    const std::int64_t seconds = wished != nullptr ? std::atoll(wished) : 600;
    const test::TemporaryFolder scratch;
    fast::Node node;
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", {.depth = 1000});
    fast::Node::Reader<fast::Tf> tf(node, "/tf", {.depth = 1000});
    fast::Node::Reader<fast::PointCloud> points(node, "/stillmesh/points", {.is_latched = true, .depth = 1});
    Driver driver;
    Program run(STILLMESH_PROGRAM, "",
                "run --camera ros2 --wait --publish ros2 --poses " + scratch.path("poses") + " --json", scratch);
    std::vector<double> latencies_ms;
    std::set<std::int64_t> on_odom, on_tf;
    std::size_t clouds = 0;
    const auto take = [&] {
        for (const fast::Odometry& got : odometry.take()) {
            const std::int64_t sent_ns = driver.sent_ns(got.header.time_ns());
            EXPECT_GT(sent_ns, 0) << "a stamp that no image had";
            latencies_ms.push_back(static_cast<double>(test::now_ns() - sent_ns) * 1e-6);
            on_odom.insert(got.header.time_ns());
        }
        for (const fast::Tf& got : tf.take()) on_tf.insert(got.transforms.at(0).header.time_ns());
        clouds += points.take().size();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };
    ASSERT_TRUE(within(120'000, [&] {
        take();
        return !on_odom.empty() && !on_tf.empty();
    })) << run.err();
    const std::int64_t begin_ns = test::now_ns();
    Resident early, late;
    std::int64_t looked_ns = 0;
    while (test::now_ns() - begin_ns < seconds * 1'000'000'000 && run.wait(0) == -1) {
        take();
        const bool is_early = test::now_ns() - begin_ns < std::min<std::int64_t>(60, seconds / 2) * 1'000'000'000;
        if (!is_early || test::now_ns() - looked_ns < 500'000'000) continue;
        early.look(run.pid());
        looked_ns = test::now_ns();
    }
    late.look(run.pid());
    driver.stop();
    for (int i = 0; i < 1500; ++i) take();  // what is on the way
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(60'000), 130) << run.err();
    for (int i = 0; i < 500; ++i) take();

    ASSERT_FALSE(on_odom.empty() || on_tf.empty());
    std::size_t frames = 0;
    const std::int64_t first = std::max(*on_odom.begin(), *on_tf.begin());
    const std::set<std::int64_t> given = stamps_of(scratch.path("poses"), first, frames);
    on_odom.erase(on_odom.begin(), on_odom.lower_bound(first));
    on_tf.erase(on_tf.begin(), on_tf.lower_bound(first));
    EXPECT_EQ(on_odom, given);
    EXPECT_EQ(on_tf, given);
    EXPECT_EQ(run.err().find("samples were lost"), std::string::npos) << run.err();
    EXPECT_GT(clouds, 0U);
    EXPECT_GT(early.outside_kib, 0);
    EXPECT_LT(late.outside_kib - early.outside_kib, 4096);
    std::sort(latencies_ms.begin(), latencies_ms.end());
    const auto at = [&](double share) {
        return latencies_ms[static_cast<std::size_t>(share * static_cast<double>(latencies_ms.size() - 1))];
    };
    std::printf(
        "%lld s: %zu frames sent, %zu tracked, %zu poses given, %zu on /odom, %zu on /tf, %zu clouds; image to /odom "
        "%.1f ms median, %.1f p99, %.1f max; resident %ld KiB after the first minute, %ld at the end; outside the "
        "blocks "
        "%ld, %ld\n%s\n",
        static_cast<long long>(seconds), driver.sent(), frames, given.size(), on_odom.size(), on_tf.size(), clouds,
        at(0.5), at(0.99), latencies_ms.back(), early.all_kib, late.all_kib, early.outside_kib, late.outside_kib,
        run.out().substr(0, 900).c_str());
}

}  // namespace
}  // namespace stillmesh::soak_test

int main(int argc, char** argv) {
    stillmesh::test::enter_own_ros_domain();
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
