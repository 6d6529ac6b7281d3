// One opening of a live camera: what the thread that polls sees of what the thread that serves brings.
#include "hal/live/live_session.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace stillmesh::live::live_session_test {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kPeriod_us = 33'333;

// An image that says when it goes back.
using Image = std::shared_ptr<int>;
using Session = LiveSession<Image>;

void bring(Session& session, bool is_colour, Image image, std::int64_t stamp_us) {
    const std::lock_guard lock(session.mutex);
    bool is_pair = false;
    static_cast<void>(session.add(is_colour, std::move(image), stamp_us, stamp_us * 1000 + 5 * kMs, is_pair));
}

void bring_pair(Session& session, int number) {
    const std::int64_t stamp_us = 1'000'000 + number * kPeriod_us;
    bring(session, false, std::make_shared<int>(-number), stamp_us);
    bring(session, true, std::make_shared<int>(number), stamp_us + 1000);
}

// Promise: the newest pair is given out, older ones are dropped and counted, and what was given out stays until the
// next poll that has one.
TEST(LiveSession, GivesTheNewestPair) {
    Session session;
    session.begin(kPeriod_us, 0);
    std::string why;
    EXPECT_EQ(session.take(why), Status::kTimedOut);
    for (int i = 1; i <= 3; ++i) bring_pair(session, i);
    ASSERT_EQ(session.take(why), Status::kOk);
    EXPECT_EQ(*session.given->colour, 3);
    EXPECT_EQ(*session.given->depth, -3);
    EXPECT_EQ(session.given->colour_us - session.given->depth_us, 1000);
    EXPECT_EQ(session.take(why), Status::kTimedOut);
    EXPECT_EQ(*session.given->colour, 3);
    bring(session, true, std::make_shared<int>(4), 2'000'000);
    const LiveCounts counts = session.counted();
    EXPECT_EQ(counts.pairing.pairs, 3U);
    EXPECT_EQ(counts.dropped, 2U);
    EXPECT_EQ(counts.images_colour, 4U);
    EXPECT_EQ(counts.images_depth, 3U);
}

// Promise: a pair that came before the camera went is still given out; then it is gone, and how.
TEST(LiveSession, TheLastPairComesBeforeTheNews) {
    Session session;
    session.begin(kPeriod_us, 0);
    bring_pair(session, 1);
    session.gone_why = "unplugged";
    std::string why;
    EXPECT_EQ(session.wait(0), Status::kOk);
    EXPECT_EQ(session.take(why), Status::kOk);
    EXPECT_EQ(session.wait(60'000), Status::kUnavailable);
    EXPECT_EQ(session.take(why), Status::kUnavailable);
    EXPECT_EQ(why, "unplugged");
}

// Promise: nothing holds an image any more once they are released, wherever it was; what was counted stays counted.
TEST(LiveSession, ReleasesEveryImage) {
    Session session;
    session.begin(kPeriod_us, 0);
    std::vector<std::weak_ptr<int>> images;
    std::string why;
    for (int i = 1; i <= 5; ++i) {
        const auto image = std::make_shared<int>(i);
        images.push_back(image);
        bring(session, i % 2 == 0, image, 1'000'000 + (i / 2) * kPeriod_us + 7);
        if (i == 3) {
            ASSERT_EQ(session.take(why), Status::kOk);
        }
    }
    session.release_images();
    for (const auto& image : images) EXPECT_TRUE(image.expired());
    EXPECT_EQ(session.counted().pairing.pairs, 2U);
    EXPECT_EQ(session.take(why), Status::kTimedOut);
}

// Promise: no call waits longer than it says for a thread that hangs, and that thread is told to end.
TEST(LiveSession, LeavesAHangingThreadBehind) {
    Session session;
    EXPECT_FALSE(session.answers_within(1));
    EXPECT_TRUE(session.is_closing);
    EXPECT_FALSE(session.closes_within(1));
    std::thread late([&session] {
        const std::lock_guard lock(session.mutex);
        session.is_closed = true;
        session.changed.notify_all();
    });
    EXPECT_TRUE(session.closes_within(60'000));
    late.join();
    EXPECT_TRUE(session.answers_within(0));
}

// Promise: a silence is of the stream that is silent; images that cannot be used explain it for half a second.
TEST(LiveSession, SaysWhichStreamIsSilent) {
    Session session;
    session.begin(kPeriod_us, 0);
    EXPECT_STREQ(session.silent_stream(), "");
    bring(session, true, std::make_shared<int>(1), 600'000);
    EXPECT_STREQ(session.silent_stream(), "colour images come, depth images do not");
    bring(session, false, std::make_shared<int>(1), 1'300'000);
    EXPECT_STREQ(session.silent_stream(), "depth images come, colour images do not");
    EXPECT_FALSE(session.has_unusable(0));
    session.unusable_ns = 1300 * kMs;
    EXPECT_TRUE(session.has_unusable(1700 * kMs));
    EXPECT_FALSE(session.has_unusable(1900 * kMs));
}

// Promise: the next pair is expected a period after the last was taken, and as late as the fastest came; one that waits
// came when it came; before the first, a period from now.
TEST(LiveSession, ExpectsTheNextPair) {
    Session session;
    session.begin(kPeriod_us, 0);
    EXPECT_EQ(session.next_due_ns(1000 * kMs), 1000 * kMs + kPeriod_us * 1000);
    bring_pair(session, 1);
    const std::int64_t came_ns = session.slot->complete_ns;
    EXPECT_EQ(session.next_due_ns(0), came_ns);
    std::string why;
    ASSERT_EQ(session.take(why), Status::kOk);
    EXPECT_EQ(session.next_due_ns(0), came_ns + kPeriod_us * 1000);
}

// Promise: stamps go by the camera's clock from where it began, whatever is said later; counts of several openings add
// up, lags as the widest.
TEST(LiveCounts, AddUp) {
    TimeOfDay time;
    time.begin(5'000'000, 100 * kMs);
    EXPECT_EQ(time.unix_ns(5'000'000), unix_minus_monotonic_ns() + 100 * kMs);
    time.begin(0, 0);
    EXPECT_EQ(time.unix_ns(5'000'010), unix_minus_monotonic_ns() + 100 * kMs + 10'000);
    LiveCounts sum, one;
    one = {.pairing = {.pairs = 2, .lag_min_us = -3, .lag_max_us = 4},
           .images_colour = 1,
           .images_depth = 2,
           .images_missing = 3,
           .images_unusable = 4,
           .dropped = 5,
           .reader_cpu_ns = 6,
           .poll_cpu_ns = 7};
    sum.add(one);
    sum.add(one);
    EXPECT_EQ(sum.pairing.pairs, 4U);
    EXPECT_EQ(sum.pairing.lag_min_us, -3);
    EXPECT_EQ(sum.images_colour + sum.images_depth + sum.images_missing + sum.images_unusable + sum.dropped, 30U);
    EXPECT_EQ(sum.reader_cpu_ns + sum.poll_cpu_ns, 26);
}

}  // namespace
}  // namespace stillmesh::live::live_session_test
