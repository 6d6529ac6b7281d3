#include "platform/view/view_commands.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <vector>

#include "platform/cli/run_control.hpp"
#include "platform/cli/view_of_run.hpp"
#include "platform/view/view_message.hpp"

namespace stillmesh::view_commands_test {
namespace {

// Promise: the commands there are, and nothing that only looks like one.
TEST(ViewCommands, AreParsed) {
    using enum ViewVerb;
    EXPECT_EQ(parse_view_command("pause")->verb, kPause);
    EXPECT_EQ(parse_view_command("resume")->verb, kResume);
    EXPECT_EQ(parse_view_command("step")->verb, kStep);
    EXPECT_EQ(parse_view_command("reset")->verb, kReset);
    EXPECT_EQ(parse_view_command("speed=0.25")->value, 0.25);
    EXPECT_EQ(parse_view_command("speed=0")->value, 0);
    EXPECT_EQ(parse_view_command("saving=1")->value, 1);
    EXPECT_EQ(parse_view_command("saving=0")->value, 0);
    EXPECT_EQ(parse_view_command("save_map")->verb, kSaveMap);
    EXPECT_EQ(parse_view_command("localise=1")->verb, kLocaliseOnly);
    EXPECT_EQ(parse_view_command("localise=1")->value, 1);
    EXPECT_EQ(parse_view_command("localise=0")->value, 0);
    for (const std::string_view wrong : {"",          "Pause",       "pause ",     "pause\n",   "speed",
                                         "speed=",    "speed=-1",    "speed=nan",  "speed=inf", "speed=1e9",
                                         "speed=1x",  "speed= 1",    "saving=2",   "saving=",   "reset=1",
                                         "exit",      "pause;reset", "save_map=a", "save_map ", "localise",
                                         "localise=", "localise=2"}) {
        EXPECT_FALSE(parse_view_command(wrong)) << wrong;
    }
    std::string bytes(1000, 'a');
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i);
    EXPECT_FALSE(parse_view_command(bytes));
}

// Promise: a queue that is full refuses, and keeps what it has in order.
TEST(ViewCommands, AreBounded) {
    ViewCommands commands;
    EXPECT_FALSE(commands.take());
    for (std::size_t i = 0; i < ViewCommands::kCommandsMax; ++i) {
        EXPECT_TRUE(commands.put({ViewVerb::kSpeed, static_cast<double>(i)}));
    }
    EXPECT_FALSE(commands.put({ViewVerb::kPause}));
    for (std::size_t i = 0; i < ViewCommands::kCommandsMax; ++i) {
        const auto command = commands.take();
        ASSERT_TRUE(command);
        EXPECT_EQ(command->value, static_cast<double>(i));
    }
    EXPECT_FALSE(commands.take());
}

// Promise: however many put at a time, each command that was accepted is taken once.
TEST(ViewCommands, FromManyThreads) {
    ViewCommands commands;
    std::atomic<int> accepted{0};
    std::atomic<int> left{4};
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
        threads.emplace_back([&] {
            for (int i = 0; i < 5000; ++i) accepted += commands.put({ViewVerb::kStep}) ? 1 : 0;
            --left;
        });
    }
    int taken = 0;
    while (left > 0) taken += commands.take() ? 1 : 0;
    for (std::thread& thread : threads) thread.join();
    while (commands.take()) ++taken;
    EXPECT_EQ(taken, accepted);
}

// Promise: a run that is paused holds; each step lets one frame through; going on lets all.
TEST(RunControl, PausesAndSteps) {
    ViewFeed feed;
    RunControl control(&feed, {true, true, true});
    EXPECT_FALSE(control.holds());
    ASSERT_TRUE(feed.commands().put({ViewVerb::kPause}));
    EXPECT_TRUE(control.holds());
    EXPECT_TRUE(control.holds());
    EXPECT_TRUE(feed.commands().standing().is_paused);
    ASSERT_TRUE(feed.commands().put({ViewVerb::kStep}));
    ASSERT_TRUE(feed.commands().put({ViewVerb::kStep}));
    for (int frame = 0; frame < 2; ++frame) {
        EXPECT_FALSE(control.holds());
        EXPECT_FALSE(control.is_early(frame));
        control.frame_is_done();
    }
    EXPECT_TRUE(control.holds());
    ASSERT_TRUE(feed.commands().put({ViewVerb::kResume}));
    EXPECT_FALSE(control.holds());
    EXPECT_FALSE(feed.commands().standing().is_paused);
}

// Promise: at a speed, frames come no earlier than that many times as fast as they were taken; without one at once.
TEST(RunControl, KeepsTheSpeed) {
    ViewFeed feed;
    RunControl control(&feed, {true, false, false});
    EXPECT_FALSE(control.is_early(5'000'000'000));
    ASSERT_TRUE(feed.commands().put({ViewVerb::kSpeed, 2}));
    EXPECT_FALSE(control.holds());
    const std::int64_t begin_ns = monotonic_ns();
    for (std::int64_t i = 0; i <= 4; ++i) {
        while (control.is_early(i * 40'000'000)) {
        }
        control.frame_is_done();
    }
    EXPECT_GE(monotonic_ns() - begin_ns, 80'000'000);  // 160 ms of frames
}

// Promise: what a run cannot do is not done, whatever is asked: a camera's clock is not stopped, a map that is only
// localised in is not laid aside.
TEST(RunControl, DoesWhatItMay) {
    ViewFeed feed;
    RunControl control(&feed, {false, false, false});
    for (const ViewCommand command :
         {ViewCommand{ViewVerb::kPause}, ViewCommand{ViewVerb::kStep}, ViewCommand{ViewVerb::kSpeed, 0.25},
          ViewCommand{ViewVerb::kSaving, 0}, ViewCommand{ViewVerb::kReset}}) {
        ASSERT_TRUE(feed.commands().put(command));
    }
    EXPECT_FALSE(control.holds());
    EXPECT_FALSE(control.is_early(0));
    EXPECT_FALSE(control.is_early(9'000'000'000'000));
    EXPECT_TRUE(control.is_saving());
    EXPECT_FALSE(control.takes_reset());
    RunControl none(nullptr, {true, true, true});
    EXPECT_FALSE(none.holds());
    EXPECT_TRUE(none.is_saving());
}

// A session that notes what it is asked.
struct AskedSession final : TrackingSession {
    std::string asked;
    Status submit(const Frame&, SessionFrame&, std::string&) override { return Status::kOk; }
    std::string save_map() override {
        asked += "save ";
        return "it is saved";
    }
    std::string localise_only(bool is_wanted) override {
        asked += is_wanted ? "only " : "all ";
        return "it is used otherwise";
    }
    void account(RunRecord&) override {}
};

// Promise: what ROS 2 wants of the map is carried out once, between two frames, also where no page is; the last word on
// how the map is used counts.
TEST(RunControl, CarriesOutWishes) {
    ViewCommands wishes;
    RunControl control(nullptr, {false, false, true}, &wishes);
    AskedSession session;
    EXPECT_EQ(control.carry_out(session), "");
    for (const ViewCommand command :
         {ViewCommand{ViewVerb::kSaveMap}, ViewCommand{ViewVerb::kLocaliseOnly, 0}, ViewCommand{ViewVerb::kSaveMap},
          ViewCommand{ViewVerb::kLocaliseOnly, 1}, ViewCommand{ViewVerb::kReset}}) {
        ASSERT_TRUE(wishes.put(command));
    }
    EXPECT_EQ(session.asked, "") << "nothing is done before the run looks";
    EXPECT_FALSE(control.holds());
    EXPECT_EQ(control.carry_out(session), "as ROS 2 asked: it is saved; it is used otherwise.");
    EXPECT_EQ(session.asked, "save only ");
    EXPECT_EQ(control.carry_out(session), "");
    EXPECT_TRUE(control.takes_reset());
    EXPECT_STREQ(control.wisher(), "by ROS 2");
}

// Promise: what the page wants of the map goes the same way, and the page is told how the map is used: as the run
// began, as it was wished, and that a new map is added to; not so where the run cannot.
TEST(RunControl, ThePageWishesAlike) {
    ViewFeed feed;
    RunControl control(&feed, {.can_save_map = true, .can_localise = true}, nullptr, true);
    AskedSession session;
    EXPECT_TRUE(feed.commands().controls().can_save_map);
    EXPECT_TRUE(feed.commands().standing().is_localising);
    ASSERT_TRUE(feed.commands().put({ViewVerb::kLocaliseOnly, 0}));
    EXPECT_FALSE(control.holds());
    EXPECT_TRUE(feed.commands().standing().is_localising) << "it is not done yet";
    EXPECT_EQ(control.carry_out(session), "as was asked on the page: it is used otherwise.");
    EXPECT_FALSE(feed.commands().standing().is_localising);
    ASSERT_TRUE(feed.commands().put({ViewVerb::kSaveMap}));
    ASSERT_TRUE(feed.commands().put({ViewVerb::kLocaliseOnly, 1}));
    EXPECT_FALSE(control.holds());
    EXPECT_EQ(control.carry_out(session), "as was asked on the page: it is saved; it is used otherwise.");
    EXPECT_EQ(session.asked, "all save only ");
    EXPECT_TRUE(feed.commands().standing().is_localising);
    control.map_is_new();
    EXPECT_FALSE(feed.commands().standing().is_localising);

    ViewFeed other;
    RunControl cannot(&other, {.can_reset = true});
    ASSERT_TRUE(other.commands().put({ViewVerb::kLocaliseOnly, 1}));
    EXPECT_FALSE(cannot.holds());
    EXPECT_NE(cannot.carry_out(session), "") << "the session says why";
    EXPECT_FALSE(other.commands().standing().is_localising);
}

// Promise: a reset is taken once, saving is as it was said last.
TEST(RunControl, ResetsOnce) {
    ViewFeed feed;
    RunControl control(&feed, {true, true, true});
    ASSERT_TRUE(feed.commands().put({ViewVerb::kReset}));
    ASSERT_TRUE(feed.commands().put({ViewVerb::kSaving, 0}));
    EXPECT_FALSE(control.holds());
    EXPECT_TRUE(control.takes_reset());
    EXPECT_FALSE(control.takes_reset());
    EXPECT_FALSE(control.is_saving());
    EXPECT_FALSE(feed.commands().standing().is_saving);
}

// Promise: what is taken home is the path as it is kept: times to the nanosecond, what was not measured only where its
// state stands beside it.
TEST(ViewCommands, PosesAreTakenHome) {
    ViewFeed feed;
    feed.place(1'000'000'007, {1, 2, 3, 3}, {0, 0, 0, 1});
    feed.place(2'000'000'000, {4, 5, 6, 1}, {0.5F, 0.5F, 0.5F, 0.5F});
    feed.place(3'000'000'000, {7, 8, 9, 2 + kViewPlaceGap}, {0, 0, 1, 0});
    std::vector<ViewPose> poses;
    feed.poses(poses);
    std::string text;
    compose_view_poses(poses, true, text);
    EXPECT_EQ(text,
              "time_s,state,x_m,y_m,z_m,qx,qy,qz,qw\n1.000000007,tracked,1,2,3,0,0,0,1\n"
              "2.000000000,predicted,4,5,6,0.5,0.5,0.5,0.5\n3.000000000,unsure,7,8,9,0,0,1,0\n");
    compose_view_poses(poses, false, text);
    EXPECT_EQ(text.substr(text.find('\n') + 1), "1.000000007 1 2 3 0 0 0 1\n3.000000000 7 8 9 0 0 1 0\n");
}

// Promise: the token is in no report, however it was typed.
TEST(ViewOfRun, TheTokenIsNotKept) {
    const char* const apart[] = {"stillmesh", "run", "--view-token", "secret-secret", "--view", "0"};
    EXPECT_EQ(command_without_token(6, apart), "stillmesh run --view-token ... --view 0");
    const char* const joined[] = {"stillmesh", "run", "--view-token=secret-secret", "--view", "0"};
    EXPECT_EQ(command_without_token(5, joined), "stillmesh run --view-token=... --view 0");
}

}  // namespace
}  // namespace stillmesh::view_commands_test
