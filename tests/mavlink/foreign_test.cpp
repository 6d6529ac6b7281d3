// Our messages read by node-mavlink, which npm installs into the build folder. Where npm or its registry cannot be
// reached this fails, and does not skip; CI leaves it to `./run test -L longest`.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "platform/mavlink/mavlink_messages.hpp"
#include "tests/mavlink/mavlink_reader.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::foreign_test {
namespace {

using Json = nlohmann::json;

// "pose_covariance" is poseCovariance there, "q" q.
[[nodiscard]] std::string camel(const std::string& name) {
    std::string out;
    for (std::size_t i = 0; i < name.size(); ++i) {
        if (name[i] == '_' && i + 1 < name.size())
            out += static_cast<char>(std::toupper(static_cast<unsigned char>(name[++i])));
        else
            out += name[i];
    }
    return out;
}

[[nodiscard]] std::vector<std::string> random_messages() {
    std::mt19937 random(5);
    const auto fill = [&random](auto& numbers) {
        for (float& x : numbers) x = std::normal_distribution<float>(0, 10)(random);
    };
    MavlinkMessages messages(42);
    std::vector<std::string> out;
    for (int i = 0; i < 300; ++i) {  // longer than the sequence numbers
        MavlinkOdometry odometry;
        odometry.time_us = 1'700'000'000'000'000U + random();
        fill(odometry.position_m), fill(odometry.rotation_wxyz), fill(odometry.velocity_m_s), fill(odometry.turn_rad_s);
        fill(odometry.pose_covariance), fill(odometry.velocity_covariance);
        odometry.reset_counter = static_cast<std::uint8_t>(i);
        odometry.quality_percent = static_cast<std::int8_t>(i % 102 - 1);
        MavlinkVision vision;
        vision.time_us = odometry.time_us;
        fill(vision.position_m), fill(vision.roll_pitch_yaw_rad);
        if (i % 2 == 0) fill(vision.covariance);
        vision.reset_counter = odometry.reset_counter;
        out.emplace_back(messages.heartbeat());
        out.emplace_back(messages.odometry(odometry));
        out.emplace_back(messages.vision(vision));
    }
    return out;
}

// Promise: the library of another hand, with the fields of the public definitions, reads every number of every message
// as our own decoder does.
TEST(ForeignMavlink, ReadsEveryField) {
    const std::string folder = STILLMESH_NPM_FOLDER;
    const std::string install = "cp " STILLMESH_FOREIGN "/* " + folder + " && cd " + folder +
                                " && timeout 300 npm install --no-audit --no-fund --silent";
    ASSERT_EQ(std::system(install.c_str()), 0) << install;
    const test::TemporaryFolder scratch;
    const std::vector<std::string> messages = random_messages();
    std::ofstream file(scratch.path("bytes"), std::ios::binary);
    for (const std::string& message : messages) file << message;
    file.close();
    const std::string read = "cd " + folder + " && timeout 100 node read_mavlink.mjs " + scratch.path("bytes") + " > " +
                             scratch.path("lines");
    ASSERT_EQ(std::system(read.c_str()), 0) << read;
    std::ifstream lines(scratch.path("lines"));
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line); ++count) {
        const Json theirs = Json::parse(line);
        ASSERT_LT(count, messages.size());
        std::string why;
        const auto ours = test::read_mavlink(messages[count], why);
        ASSERT_TRUE(ours.has_value()) << why;
        EXPECT_EQ(theirs["number"], ours->number);
        EXPECT_EQ(theirs["system"], ours->system);
        EXPECT_EQ(theirs["component"], ours->component);
        for (const auto& [name, values] : ours->fields) {
            const Json& field = theirs["fields"][camel(name)];
            ASSERT_FALSE(field.is_null()) << name << ": " << line;
            for (std::size_t i = 0; i < values.size(); ++i) {
                const Json& number = field.is_array() ? field.at(i) : field;
                ASSERT_TRUE(number.is_number()) << name << ": " << line;
                EXPECT_EQ(number.get<double>(), values[i]) << name << " of message " << count;
            }
        }
    }
    EXPECT_EQ(count, messages.size());
}

}  // namespace
}  // namespace stillmesh::foreign_test
