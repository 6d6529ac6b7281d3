// What ROS 2 may want of a run, published by Fast DDS.
#include "platform/ros2/ros_wishes.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "tests/ros2/fast_dds.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::wishes_test {
namespace {

using test::within;
namespace fast = test::fast;

constexpr std::int64_t kPatience_ms = 30'000;

// Promise: each topic's message becomes its wish, once, in the run's queue; a full queue drops what comes and goes on.
TEST(RosWishes, AreHeard) {
    const std::string own = "wishes" + std::to_string(::getpid());
    RosWishes wishes;
    std::string message;
    ASSERT_TRUE(wishes.open(own, message)) << message;
    fast::Node node;
    fast::Node::Writer<fast::Empty> save(node, "/" + own + "/stillmesh/save_map", {});
    fast::Node::Writer<fast::Empty> reset(node, "/" + own + "/stillmesh/reset", {});
    fast::Node::Writer<fast::Bool> localise(node, "/" + own + "/stillmesh/localize_only", {});
    ASSERT_TRUE(within(kPatience_ms, [&] { return save.is_matched() && reset.is_matched() && localise.is_matched(); }));
    std::vector<ViewCommand> heard;
    const auto hears = [&](std::size_t count) {
        return within(kPatience_ms, [&] {
            while (const auto command = wishes.commands().take()) heard.push_back(*command);
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
            return heard.size() >= count;
        });
    };
    // The reader's side may be matched a moment later than the writer's: until one is heard.
    ASSERT_TRUE(within(kPatience_ms, [&] {
        EXPECT_TRUE(save.write({}));
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        return wishes.commands().take().has_value();
    }));
    EXPECT_TRUE(reset.write({}));
    ASSERT_TRUE(hears(1));
    EXPECT_TRUE(localise.write({true}));
    ASSERT_TRUE(hears(2));
    EXPECT_TRUE(localise.write({false}));
    ASSERT_TRUE(hears(3));
    EXPECT_EQ(heard[0].verb, ViewVerb::kReset);
    EXPECT_EQ(heard[1].verb, ViewVerb::kLocaliseOnly);
    EXPECT_EQ(heard[1].value, 1);
    EXPECT_EQ(heard[2].verb, ViewVerb::kLocaliseOnly);
    EXPECT_EQ(heard[2].value, 0);

    for (std::size_t i = 0; i < 3 * ViewCommands::kCommandsMax; ++i) {
        EXPECT_TRUE(save.write({}));
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    heard.clear();
    ASSERT_TRUE(hears(1));
    while (const auto command = wishes.commands().take()) heard.push_back(*command);
    EXPECT_LE(heard.size(), ViewCommands::kCommandsMax + 1);
    EXPECT_TRUE(reset.write({}));
    ASSERT_TRUE(within(kPatience_ms, [&] {
        while (const auto command = wishes.commands().take()) heard.push_back(*command);
        return heard.back().verb == ViewVerb::kReset;
    }));
}

}  // namespace
}  // namespace stillmesh::wishes_test
