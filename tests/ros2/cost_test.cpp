// What giving everything out at once costs the thread that tracks, beside nothing: printed, of runs in pairs.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include "tests/ros2/fast_dds.hpp"
#include "tests/support/program.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::cost_test {
namespace {

using test::Program;
using test::within;
namespace fast = test::fast;

[[nodiscard]] sockaddr_in loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}
[[nodiscard]] std::uint16_t free_port() {
    const int probe = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::bind(probe, reinterpret_cast<const sockaddr*>(&address), size), 0);
    EXPECT_EQ(::getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size), 0);
    ::close(probe);
    return ntohs(address.sin_port);
}

// Connects as soon as somebody listens, asks, and reads until the end.
class SocketReader {
public:
    SocketReader(std::uint16_t port, std::string question)
        : thread_([this, port, question = std::move(question)](const std::stop_token& stop) {
              const sockaddr_in address = loopback(port);
              int reader = -1;
              while (!stop.stop_requested()) {
                  reader = ::socket(AF_INET, SOCK_STREAM, 0);
                  if (::connect(reader, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) break;
                  ::close(reader);
                  reader = -1;
                  std::this_thread::sleep_for(std::chrono::milliseconds(5));
              }
              if (reader < 0) return;
              const timeval patience{1, 0};
              ::setsockopt(reader, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
              static_cast<void>(::send(reader, question.data(), question.size(), MSG_NOSIGNAL));
              char bytes[65536];
              for (ssize_t size = 1; size != 0 && !stop.stop_requested();) {
                  size = ::recv(reader, bytes, sizeof(bytes), 0);
                  if (size > 0) bytes_ += static_cast<std::size_t>(size);
              }
              ::close(reader);
          }) {}
    [[nodiscard]] std::size_t bytes() const { return bytes_; }

private:
    std::atomic<std::size_t> bytes_ = 0;
    std::jthread thread_;
};

// The number behind `key`, behind `section`.
[[nodiscard]] double number_of(const std::string& json, const std::string& section, const std::string& key) {
    const std::size_t begin = json.find("\"" + section + "\": {");
    const std::size_t at = begin == std::string::npos ? begin : json.find("\"" + key + "\": ", begin);
    EXPECT_NE(at, std::string::npos) << section << ' ' << key;
    return at == std::string::npos ? 0 : std::atof(json.c_str() + at + key.size() + 4);
}

// Promise: with every topic of ROS 2 subscribed, a grid, poses into a file and to a reader on a socket, and a page that
// looks on, all of them get what they are due. What it costs is printed.
TEST(RosCost, OfEverythingAtOnce) {
    const std::string kRun = "run --simulate walking_xyz:1 --frames 300 --realtime --no-check-camera --json";
    const test::TemporaryFolder scratch;
    fast::Node node;
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", {});
    fast::Node::Reader<fast::Tf> tf(node, "/tf", {});
    fast::Node::Reader<fast::PoseWithCovarianceStamped> pose(node, "/stillmesh/pose", {});
    fast::Node::Reader<fast::Path> path(node, "/stillmesh/path", {.is_latched = true});
    fast::Node::Reader<fast::PointCloud> points(node, "/stillmesh/points", {.is_latched = true, .depth = 1});
    fast::Node::Reader<fast::OccupancyGrid> grid(node, "/map", {.is_latched = true, .depth = 1});
    fast::Node::Reader<fast::DiagnosticArray> diagnostics(node, "/diagnostics", {});
    for (int pair = 0; pair < 3; ++pair) {
        std::string json[2];
        for (const int which : {pair % 2, 1 - pair % 2}) {
            const std::uint16_t lines_port = free_port(), page_port = free_port();
            const std::string all = " --publish ros2 --grid " + scratch.path("grid") + " --poses " +
                                    scratch.path("poses") + " --poses tcp:" + std::to_string(lines_port) + " --view " +
                                    std::to_string(page_port);
            Program run(STILLMESH_PROGRAM, "", which == 0 ? kRun : kRun + all, scratch);
            const SocketReader lines(lines_port, ""),
                page(page_port, "GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
            std::size_t poses = 0, others = 0, grids = 0, clouds = 0;
            EXPECT_TRUE(within(200'000, [&] {
                poses += odometry.take().size();
                grids += grid.take().size();
                clouds += points.take().size();
                others += tf.take().size() + pose.take().size() + path.take().size() + diagnostics.take().size();
                return run.wait(0) != -1;
            }));
            EXPECT_GE(run.wait(1), 0) << run.err();
            json[which] = run.out();
            if (which == 0) continue;
            EXPECT_GT(poses, 100U);
            EXPECT_GT(others, 200U);
            EXPECT_GT(grids, 0U);
            EXPECT_GT(clouds, 0U);
            EXPECT_GT(lines.bytes(), 100'000U);
            EXPECT_GT(page.bytes(), 100'000U);
        }
        std::printf("pair %d:", pair);
        for (const int which : {0, 1}) {
            const std::string& text = json[which];
            const double frames_at = std::atof(text.c_str() + text.find("\"frames\": ") + 10);
            std::printf(" %s: %.0f frames, outputs %.3f ms median, %.3f p99; tracking %.2f median, %.2f p99;",
                        which == 0 ? "none" : "everything", frames_at, number_of(text, "outputs", "ms_median"),
                        number_of(text, "outputs", "ms_p99"),
                        std::atof(text.c_str() + text.find("\n  \"ms_median\": ") + 16),
                        std::atof(text.c_str() + text.find("\n  \"ms_p99\": ") + 13));
        }
        std::printf("\n");
    }
}

}  // namespace
}  // namespace stillmesh::cost_test
