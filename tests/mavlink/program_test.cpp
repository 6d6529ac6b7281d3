// The program beside an autopilot.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/mavlink/mavlink_reader.hpp"
#include "tests/mavlink/udp_reader.hpp"
#include "tests/support/answer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::program_test {
namespace {

using Json = nlohmann::json;

// Promise: `run --mavlink` sends, of every frame that has a pose and one before it, the pose that --poses writes: the
// same time, place and state, x forward, y right, z down from where the camera is mounted; and it changes no pose.
TEST(MavlinkProgram, SendsThePosesOfTheRun) {
    const test::TemporaryFolder scratch;
    const test::UdpReader reader;
    const std::string run = "run --simulate walking_xyz:1 --frames 90 --limits pocket --json ";
    const test::Answer alone = test::stillmesh_says(run + "--state-hashes " + scratch.path("alone"));
    const test::Answer answer = test::stillmesh_says(run + "--state-hashes " + scratch.path("hashes") + " --poses " +
                                                     scratch.path("poses") + " --mavlink " + reader.destination() +
                                                     " --mavlink-system 9 --base-from-camera 0.1,0.2,0.3");
    ASSERT_EQ(answer.code, 0) << answer.text;
    ASSERT_EQ(alone.code, 0) << alone.text;
    std::vector<test::MavlinkRead> messages;
    int heartbeats = 0;
    for (const std::string& datagram : reader.datagrams()) {
        std::string why;
        const auto message = test::read_mavlink(datagram, why);
        ASSERT_TRUE(message.has_value()) << why;
        EXPECT_EQ(message->system, 9);
        heartbeats += message->number == 0 ? 1 : 0;
        if (message->number == 331) messages.push_back(*message);
    }
    EXPECT_EQ(heartbeats, 3);  // of 90 frames at 30 a second
    std::ifstream lines(scratch.path("poses"));
    std::size_t at = 0;
    bool has_last = false;
    for (std::string line; std::getline(lines, line);) {
        const Json json = Json::parse(line);
        if (json["type"] != "pose") continue;
        const bool has_pose = json["state"] != "none", is_sent = has_pose && has_last;
        has_last = has_pose;
        if (!is_sent) continue;
        ASSERT_LT(at, messages.size());
        const test::MavlinkRead& message = messages[at++];
        EXPECT_EQ(message.at("time_usec"), std::floor(json["time_ns"].get<double>() / 1000));
        EXPECT_EQ(message.at("quality"), json["state"] == "tracked" ? 100 : json["state"] == "unsure" ? 30 : 10);
        // The camera looks where the base looks, so that both turn alike and a point of the one is carried by the
        // other.
        const auto p = json["map_from_camera"]["p"].get<std::vector<double>>();
        const auto q = json["map_from_camera"]["q"].get<std::vector<double>>();
        EXPECT_NEAR(std::abs(message.at("q", 0)), std::abs(q[3]), 1e-6);
        // base at rest = mount; base_now = mount + R (p) - R_now(mount), all in FRD: x = z_camera, y = x, z = y.
        const double x = message.at("q", 1), y = message.at("q", 2), z = message.at("q", 3), w = message.at("q", 0);
        const double m[3] = {0.1, -0.2, -0.3};
        const double turned[3] = {
            (1 - 2 * (y * y + z * z)) * m[0] + 2 * (x * y - z * w) * m[1] + 2 * (x * z + y * w) * m[2],
            2 * (x * y + z * w) * m[0] + (1 - 2 * (x * x + z * z)) * m[1] + 2 * (y * z - x * w) * m[2],
            2 * (x * z - y * w) * m[0] + 2 * (y * z + x * w) * m[1] + (1 - 2 * (x * x + y * y)) * m[2]};
        EXPECT_NEAR(message.at("x"), m[0] + p[2] - turned[0], 1e-5);
        EXPECT_NEAR(message.at("y"), m[1] + p[0] - turned[1], 1e-5);
        EXPECT_NEAR(message.at("z"), m[2] + p[1] - turned[2], 1e-5);
    }
    EXPECT_EQ(at, messages.size());
    EXPECT_GT(at, 80U);
    const auto text = [](const std::string& file) {
        std::ifstream stream(file);
        return std::string(std::istreambuf_iterator<char>(stream), {});
    };
    EXPECT_EQ(text(scratch.path("alone")), text(scratch.path("hashes")));
}

// Promise: where no autopilot listens the run goes on to its end, the summary says what was lost, and the exit code is
// 1; what is misspelt is refused before the first frame.
TEST(MavlinkProgram, GoesOnAlone) {
    test::UdpReader gone;
    const std::string destination = gone.destination();
    gone.close();
    const std::string run = "run --simulate static_xyz:1 --frames 20 --limits pocket --json ";
    const test::Answer answer = test::stillmesh_says(run + "--mavlink " + destination);
    EXPECT_EQ(answer.code, 1) << answer.text;
    EXPECT_TRUE(answer.says("nobody listens there")) << answer.text;
    EXPECT_TRUE(answer.says("\"frames\": 20")) << answer.text;
    for (const char* const wrong :
         {"--mavlink tcp:1", "--mavlink udp:127.0.0.1", "--mavlink-system 0 --mavlink udp:127.0.0.1:9",
          "--mavlink-message odometry", "--base-from-camera 0,0,0"}) {
        EXPECT_EQ(test::stillmesh_says(run + wrong).code, 2) << wrong;
    }
}

}  // namespace
}  // namespace stillmesh::program_test
