#include "platform/view/view_feed.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <string>
#include <thread>

namespace stillmesh::view_feed_test {
namespace {

constexpr std::int64_t kMillisecond_ns = 1'000'000;

// Promise: nobody looks, nothing is due; somebody does, at most ten snapshots a second are.
TEST(ViewFeed, IsDueOnlyForWhoLooks) {
    ViewFeed feed;
    for (std::int64_t ms = 1; ms < 1000; ms += 33) EXPECT_FALSE(feed.is_due(ms * kMillisecond_ns));
    feed.come();
    int due = 0;
    for (std::int64_t ms = 1000; ms < 3000; ms += 7) due += feed.is_due(ms * kMillisecond_ns) ? 1 : 0;
    EXPECT_GE(due, 18);
    EXPECT_LE(due, 20);
    feed.leave();
    EXPECT_FALSE(feed.is_due(9000 * kMillisecond_ns));
    EXPECT_EQ(feed.last_frame_ns(), 9000 * kMillisecond_ns);
}

// Promise: what was handed over is taken once, and only the newest.
TEST(ViewFeed, GivesTheNewestOnce) {
    ViewFeed feed;
    ViewSnapshot seen;
    EXPECT_FALSE(feed.take(seen));
    for (const std::uint64_t frame : {7U, 8U}) {
        feed.draft().frame = frame;
        feed.hand_over();
    }
    ASSERT_TRUE(feed.take(seen));
    EXPECT_EQ(seen.frame, 8U);
    EXPECT_FALSE(feed.take(seen));
}

// Promise: with readers that take and look as fast as they can, what is taken is whole, and numbers go up.
TEST(ViewFeed, IsWholeBetweenThreads) {
    ViewFeed feed;
    std::atomic<bool> is_over{false};
    std::atomic<std::uint64_t> taken{0};
    std::thread reader([&] {
        ViewSnapshot seen;
        ViewCursor cursor;
        ViewNews news;
        std::uint64_t last = 0;
        while (!is_over.load()) {
            feed.look(cursor, news);
            for (const ViewCloud& cloud : news.clouds) EXPECT_EQ(cloud.count, cloud.keyframe % 100);
            if (!feed.take(seen)) continue;
            taken.fetch_add(1);
            EXPECT_GT(seen.frame, last);
            last = seen.frame;
            EXPECT_EQ(seen.features.size(), seen.frame % kViewFeaturesMax);
            for (const ShownFeature& feature : seen.features)
                ASSERT_EQ(feature.x, static_cast<std::int16_t>(seen.frame % 30000));
        }
    });
    ViewCloud cloud;
    std::uint64_t frame = 0;
    while (taken.load() < 200 && frame < 50'000'000) {
        ++frame;
        ViewSnapshot& draft = feed.draft();
        draft.frame = frame;
        const auto x = static_cast<std::int16_t>(frame % 30000);
        draft.features.assign(frame % kViewFeaturesMax, ShownFeature{x, 0, 0, ShownFeature::kStatic});
        feed.hand_over();
        cloud.keyframe = frame;
        cloud.count = static_cast<std::uint32_t>(frame % 100);
        feed.cloud(cloud);
    }
    is_over.store(true);
    reader.join();
    EXPECT_GE(taken.load(), 200U);
}

// Promise: the path of a run of any length is bounded, spread over all of it, and told in parts that fit together.
TEST(ViewFeed, ThePathIsBounded) {
    ViewFeed feed;
    ViewCursor cursor;
    ViewNews news;
    std::vector<ViewPlace> shown;
    const auto follow = [&] {
        feed.look(cursor, news);
        ASSERT_LE(news.places_begin, shown.size());
        shown.resize(news.places_begin);
        shown.insert(shown.end(), news.places.begin(), news.places.end());
    };
    constexpr int kFrames = 60'000;  // 33 ms apart
    for (int i = 0; i < kFrames; ++i) {
        feed.place(std::int64_t{i} * 33 * kMillisecond_ns, {static_cast<float>(i), 0, 0, 3});
        if (i % 1000 == 0) follow();
    }
    follow();
    EXPECT_LE(shown.size(), kViewPlacesMax);
    EXPECT_GE(shown.size(), kViewPlacesMax / 2);
    EXPECT_EQ(shown.front().x, 0);
    EXPECT_GT(shown.back().x, 0.99F * kFrames);
    for (std::size_t i = 1; i < shown.size(); ++i) ASSERT_GT(shown[i].x, shown[i - 1].x);
    ViewCursor late;  // who comes later sees the same
    feed.look(late, news);
    ASSERT_EQ(news.places.size(), shown.size());
    for (std::size_t i = 0; i < shown.size(); ++i) ASSERT_EQ(news.places[i].x, shown[i].x);
}

// Promise: what keyframes saw comes in parts of bounded size, each once, the oldest forgotten when there are too many.
TEST(ViewFeed, CloudsComeInParts) {
    ViewFeed feed;
    ViewCloud cloud;
    constexpr std::uint64_t kMade = kViewCloudsMax + 30;
    for (cloud.keyframe = 0; cloud.keyframe < kMade; ++cloud.keyframe) feed.cloud(cloud);
    ViewCursor cursor;
    ViewNews news;
    std::uint64_t next = kMade - kViewCloudsMax;
    for (feed.look(cursor, news); !news.clouds.empty(); feed.look(cursor, news)) {
        EXPECT_LE(news.clouds.size(), kViewCloudsAtOnce);
        for (const ViewCloud& seen : news.clouds) EXPECT_EQ(seen.keyframe, next++);
    }
    EXPECT_EQ(next, kMade);
}

// Promise: events are kept for who comes later, the last of them, none longer than its limit.
TEST(ViewFeed, EventsAreKeptAndBounded) {
    ViewFeed feed;
    for (std::size_t i = 0; i < kViewEventsMax + 5; ++i) feed.event("event " + std::to_string(i));
    feed.event(std::string(10'000, 'x'));
    ViewCursor cursor;
    ViewNews news;
    feed.look(cursor, news);
    ASSERT_EQ(news.events.size(), kViewEventsMax);
    EXPECT_EQ(news.events.front(), "event 6");
    EXPECT_EQ(news.events.back().size(), kViewEventBytesMax);
    feed.look(cursor, news);
    EXPECT_TRUE(news.events.empty());
}

// Promise: with a new map, path and points of the one before are told no more, to who was there and who comes.
TEST(ViewFeed, ANewMapBeginsAnew) {
    ViewFeed feed;
    ViewCloud cloud;
    ViewCursor cursor;
    ViewNews news;
    feed.place(0, {1, 0, 0, 3});
    feed.cloud(cloud);
    feed.look(cursor, news);
    EXPECT_TRUE(news.is_new_map);
    EXPECT_EQ(news.places.size(), 1U);
    feed.begin_map();
    feed.place(1, {2, 0, 0, 3});  // at once, whatever the time between
    for (ViewCursor who : {cursor, ViewCursor{}}) {
        feed.look(who, news);
        EXPECT_TRUE(news.is_new_map);
        EXPECT_EQ(news.places_begin, 0U);
        ASSERT_EQ(news.places.size(), 1U);
        EXPECT_EQ(news.places[0].x, 2);
        EXPECT_TRUE(news.clouds.empty());
        feed.look(who, news);
        EXPECT_FALSE(news.is_new_map);
    }
}

// Promise: a gap in the path stays one: where the place behind it is not kept, or goes when the path is thinned out,
// the next one that is kept says it; and no other does.
TEST(ViewFeed, GapsStay) {
    ViewFeed feed;
    constexpr std::int64_t kStep_ns = 120'000'000;
    const auto put = [&feed](std::int64_t time_ns, bool is_behind_gap) {
        feed.place(time_ns,
                   {static_cast<float>(time_ns / kStep_ns), 0, 0, 3.0F + (is_behind_gap ? kViewPlaceGap : 0.0F)});
    };
    for (std::int64_t i = 0; i < 100; ++i) {
        put(i * kStep_ns, false);
        if (i == 40) put(i * kStep_ns + 1'000'000, true);  // too soon to be kept
    }
    put(100 * kStep_ns, true);
    put(101 * kStep_ns, true);
    const auto gaps = [&feed] {
        std::vector<ViewPose> poses;
        feed.poses(poses);
        std::vector<int> at;
        for (const ViewPose& pose : poses) {
            if (pose.place.state >= kViewPlaceGap) at.push_back(static_cast<int>(pose.place.x));
        }
        return at;
    };
    EXPECT_EQ(gaps(), (std::vector<int>{41, 100, 101}));
    for (std::int64_t i = 102; i < static_cast<std::int64_t>(kViewPlacesMax) + 2; ++i) put(i * kStep_ns, false);
    EXPECT_EQ(gaps(), (std::vector<int>{42, 100, 102}));  // every second one is gone
}

}  // namespace
}  // namespace stillmesh::view_feed_test
