#include "platform/cli/live_view.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/support/heap_calls.hpp"

namespace stillmesh::live_view_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

// Shows a mesh and keyframes of any number.
class ShownSession final : public TrackingSession {
public:
    std::vector<TrackedFeature> features;
    std::vector<TrackedEdge> edges;
    std::vector<std::uint8_t> explained_by;
    std::uint32_t keyframes = 0, links = 0;

    Status submit(const Frame&, SessionFrame&, std::string&) override { return Status::kOk; }
    void account(RunRecord&) override {}
    bool look(SessionLook& look, std::span<KeyframePose> room, std::span<KeyframeLink> room_of_links) override {
        look.tracking = {features, edges, explained_by};
        look.keyframes_written = static_cast<std::uint32_t>(std::min<std::size_t>(keyframes, room.size()));
        for (std::uint32_t i = 0; i < look.keyframes_written; ++i) room[i].id = i;
        look.links_written = static_cast<std::uint32_t>(std::min<std::size_t>(links, room_of_links.size()));
        for (std::uint32_t i = 0; i < look.links_written; ++i) room_of_links[i] = {0, i + 1, i};
        return true;
    }
};

struct Pixels {
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    Frame frame;

    Pixels(std::uint32_t width, std::uint32_t height, PixelFormat format, std::uint8_t value)
        : colour(std::size_t{width} * height * channels_of(format), value), depth(std::size_t{width} * height, 5000) {
        frame.time_ns = kSecond_ns;
        frame.format = format;
        frame.colour = {colour.data(), width, height, std::size_t{width} * channels_of(format)};
        frame.depth = {depth.data(), width, height, width};
    }
};

[[nodiscard]] CameraModel pinhole(std::uint32_t width, std::uint32_t height) {
    CameraModel camera;
    camera.width = width;
    camera.height = height;
    camera.fx = camera.fy = width;
    camera.cx = width / 2.0;
    camera.cy = height / 2.0;
    return camera;
}

// Promise: a picture of any size and format that the engine takes becomes one of at most 320 px, as bright as it was.
TEST(LiveView, APictureOfAnySize) {
    const struct {
        std::uint32_t width, height;
    } kSizes[] = {{33, 33}, {320, 240}, {321, 240}, {640, 480}, {1280, 720}, {1919, 1079}, {100, 2047}};
    for (const auto& size : kSizes) {
        for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kRgb8, PixelFormat::kBgr8}) {
            ViewFeed feed;
            feed.come();
            ShownSession session;
            const Pixels pixels(size.width, size.height, format, 77);
            LiveView view(&feed, nullptr, pinhole(size.width, size.height), 33'000'000);
            view.frame({0, 1, kSecond_ns, 5}, pixels.frame, {}, session);
            ViewSnapshot seen;
            ASSERT_TRUE(feed.take(seen));
            EXPECT_EQ(seen.image_width, size.width);
            EXPECT_LE(seen.picture_width, kViewWidthMax);
            EXPECT_GT(seen.picture_width, 0U);
            EXPECT_LE(seen.grey.size(), kViewPixelsMax);
            EXPECT_EQ(seen.grey, std::vector<std::uint8_t>(std::size_t{seen.picture_width} * seen.picture_height, 77));
        }
    }
}

// Promise: what is more than a snapshot holds is left out; what is in it is what the session showed.
TEST(LiveView, AMeshOfAnySize) {
    ViewFeed feed;
    feed.come();
    ShownSession session;
    const Pixels pixels(640, 480, PixelFormat::kGrey8, 9);
    LiveView view(&feed, nullptr, pinhole(640, 480), 33'000'000);
    session.features = {
        {10.5F, 20.25F, 3, true, true, false}, {1, 2, -1, true, false, true}, {3, 4, 0, false, false, false}};
    session.edges = {{1, 2, 3, 4, true}, {5, 6, 7, 8, false}};
    session.keyframes = 5;
    session.links = 4;
    view.frame({0, 1, kSecond_ns, 5}, pixels.frame, {}, session);
    ViewSnapshot seen;
    ASSERT_TRUE(feed.take(seen));
    ASSERT_EQ(seen.features.size(), 3U);
    EXPECT_EQ(seen.features[0].x, 84);
    EXPECT_EQ(seen.features[0].y, 162);
    EXPECT_EQ(seen.features[0].group, 3);
    EXPECT_EQ(seen.features[0].kind, ShownFeature::kStatic);
    EXPECT_EQ(seen.features[1].kind, ShownFeature::kMoving);
    EXPECT_EQ(seen.features[2].kind, ShownFeature::kNeither);
    session.explained_by = {TrackingView::kByChoice, TrackingView::kByRival,
                            TrackingView::kByChoice | TrackingView::kByRival};
    view.frame({1, 1, 2 * kSecond_ns, 5}, pixels.frame, {}, session);
    ASSERT_TRUE(feed.take(seen));
    EXPECT_EQ(seen.features[0].kind, ShownFeature::kStatic | ShownFeature::kByChoice);
    EXPECT_EQ(seen.features[1].kind, ShownFeature::kMoving | ShownFeature::kByRival);
    EXPECT_EQ(seen.features[2].kind, ShownFeature::kNeither | ShownFeature::kByChoice | ShownFeature::kByRival);
    ASSERT_EQ(seen.kept.size(), 1U);
    ASSERT_EQ(seen.cut.size(), 1U);
    EXPECT_EQ(seen.cut[0].x0, 40);
    EXPECT_EQ(seen.keyframes.size(), 5U);
    ASSERT_EQ(seen.links.size(), 4U);
    EXPECT_EQ(seen.links[3].newer_id, 4U);
    session.features.assign(3 * kViewFeaturesMax, {});
    session.edges.assign(3 * kViewEdgesMax, {});
    session.keyframes = 4000;
    session.links = 100'000;
    view.frame({2, 1, 3 * kSecond_ns, 5}, pixels.frame, {}, session);
    ASSERT_TRUE(feed.take(seen));
    EXPECT_EQ(seen.features.size(), kViewFeaturesMax);
    EXPECT_EQ(seen.cut.size(), kViewEdgesMax);
    EXPECT_EQ(seen.keyframes.size(), kViewKeyframesMax);
    EXPECT_EQ(seen.links.size(), kViewLinksMax);
}

// Promise: what a keyframe saw to stand still is kept even when nobody looks, in metres before its camera; what moves,
// has no verdict or no depth is not.
TEST(LiveView, AKeyframeLeavesWhatStoodStill) {
    ViewFeed feed;
    ShownSession session;
    Pixels pixels(640, 480, PixelFormat::kGrey8, 9);
    pixels.depth[std::size_t{480 - 1} * 640 + 639] = 0;
    pixels.frame.depth_units_per_m = 2500;  // two metres everywhere else
    LiveView view(&feed, nullptr, pinhole(640, 480), 33'000'000);
    session.features = {{480, 240, 0, true, true, false},
                        {480, 240, 0, true, false, true},
                        {480, 240, 0, false, false, false},
                        {639, 479, 0, true, true, false}};
    SessionFrame out;
    out.state = PoseState::kTracked;
    out.statistics.frame = 77;
    view.frame({0, 1, kSecond_ns, 5}, pixels.frame, out, session);  // no keyframe
    out.statistics.is_keyframe = true;
    view.frame({1, 1, 2 * kSecond_ns, 5}, pixels.frame, out, session);
    ViewCursor cursor;
    ViewNews news;
    feed.look(cursor, news);
    ASSERT_EQ(news.clouds.size(), 1U);
    EXPECT_EQ(news.clouds[0].keyframe, 77U);
    ASSERT_EQ(news.clouds[0].count, 1U);
    EXPECT_EQ(news.clouds[0].points[0].x, 500);  // (480 - 320) / 640 of two metres
    EXPECT_EQ(news.clouds[0].points[0].y, 0);
    EXPECT_EQ(news.clouds[0].points[0].z, 2000);
    EXPECT_EQ(news.clouds[0].points[0].grey, 9);
    EXPECT_EQ(news.places.size(), 1U);  // of one time: the second is no other place
    ViewSnapshot seen;
    EXPECT_FALSE(feed.take(seen));
}

// Promise: no line of the path leads over a stretch without a pose, nor over one without frames: a quarter of a second,
// or three frames of a slow camera.
TEST(LiveView, GapsOfThePathAreSeen) {
    constexpr std::int64_t kMs_ns = 1'000'000;
    const auto gaps_of = [](std::int64_t period_ns, const std::vector<std::int64_t>& times_ms) {
        ViewFeed feed;
        ShownSession session;
        Pixels pixels(64, 48, PixelFormat::kGrey8, 9);
        LiveView view(&feed, nullptr, pinhole(64, 48), period_ns);
        for (const std::int64_t time_ms : times_ms) {
            SessionFrame out;  // below 0: without a pose
            out.state = time_ms < 0 ? PoseState::kNone : PoseState::kTracked;
            pixels.frame.time_ns = std::abs(time_ms) * kMs_ns;
            view.frame({0, 1, pixels.frame.time_ns, 5}, pixels.frame, out, session);
        }
        ViewCursor cursor;
        ViewNews news;
        feed.look(cursor, news);
        std::vector<int> gaps;
        for (const ViewPlace& place : news.places) gaps.push_back(place.state >= kViewPlaceGap ? 1 : 0);
        return gaps;
    };
    using Gaps = std::vector<int>;
    EXPECT_EQ(gaps_of(100 * kMs_ns, {1000, 1100, 1300, 1400}), (Gaps{1, 0, 0, 0}));
    EXPECT_EQ(gaps_of(100 * kMs_ns, {1000, 1100, -1200, 1300}), (Gaps{1, 0, 1}));
    EXPECT_EQ(gaps_of(100 * kMs_ns, {1000, 1100, 1450, 1550}), (Gaps{1, 0, 1, 0}));
    EXPECT_EQ(gaps_of(33 * kMs_ns, {1000, 1200, 1460, 1600}), (Gaps{1, 0, 1, 0}));
    EXPECT_EQ(gaps_of(200 * kMs_ns, {1000, 1200, 1700, 2400}), (Gaps{1, 0, 0, 1}));
}

// Promise: the engine's thread calls no heap for a page that looks on, once it has begun: not for frames, keyframes,
// events or a new map.
TEST(LiveView, CallsNoHeap) {
    if (!test::heap_calls_are_counted()) GTEST_SKIP() << "not under sanitizers";
    ViewFeed feed;
    feed.come();
    ShownSession session;
    session.features.assign(1000, {100, 100, 0, true, true, false});
    session.edges.assign(3000, {});
    session.keyframes = 256;
    session.links = 800;
    const Pixels pixels(640, 480, PixelFormat::kRgb8, 9);
    LiveView view(&feed, nullptr, pinhole(640, 480), 33'000'000);
    SessionFrame out;
    out.state = PoseState::kTracked;
    out.statistics.is_keyframe = true;
    const std::string sentence(100, 'x');
    ViewSnapshot seen;
    seen.reserve();
    int taken = 0;
    const std::uint64_t before = test::heap_calls();
    for (std::int64_t i = 1; i <= 50; ++i) {
        out.statistics.frame = static_cast<std::uint64_t>(i);
        view.frame({0, 1, i * kSecond_ns, 5}, pixels.frame, out, session);
        view.event(sentence);
        if (i % 20 == 0) view.begin_map();
        if (feed.take(seen)) ++taken;
    }
    EXPECT_EQ(test::heap_calls(), before);
    EXPECT_EQ(taken, 50);
}

// Promise: without a feed nothing is asked of the session.
TEST(LiveView, WithoutAFeedThereIsNone) {
    ShownSession session;
    const Pixels pixels(64, 64, PixelFormat::kGrey8, 9);
    LiveView view(nullptr, nullptr, pinhole(64, 64), 0);
    SessionFrame out;
    out.statistics.is_keyframe = true;
    view.frame({}, pixels.frame, out, session);
    view.no_pose({}, pixels.frame, "old pictures");
    view.event("nothing");
    view.begin_map();
}

}  // namespace
}  // namespace stillmesh::live_view_test
