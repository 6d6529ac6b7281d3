#include "platform/report/run_film.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

namespace stillmesh::run_film_test {
namespace {

// A picture with a mesh whose edges end at its features.
[[nodiscard]] ViewSnapshot snapshot_of(std::uint32_t seed, std::size_t features = 200) {
    ViewSnapshot snapshot;
    snapshot.image_width = 640;
    snapshot.image_height = 480;
    snapshot.picture_width = 320;
    snapshot.picture_height = 240;
    snapshot.grey.resize(std::size_t{320} * 240);
    std::uint32_t state = seed * 2654435761U + 1;
    const auto next = [&state] { return (state = state * 1664525U + 1013904223U) >> 8U; };
    for (std::uint8_t& pixel : snapshot.grey) pixel = static_cast<std::uint8_t>(next());
    for (std::size_t i = 0; i < features; ++i) {
        const auto x = static_cast<std::int16_t>(next() % 5120), y = static_cast<std::int16_t>(next() % 3840);
        const auto group = static_cast<std::int16_t>(static_cast<int>(i % 4) - 1);
        const auto kind = static_cast<std::int16_t>(i % 3 + i % 5 % 4 * ShownFeature::kByChoice);
        snapshot.features.push_back({x, y, group, kind});
    }
    for (std::size_t i = 1; i < features; ++i) {
        const ShownFeature &a = snapshot.features[i - 1], &b = snapshot.features[i];
        (i % 5 == 0 ? snapshot.cut : snapshot.kept).push_back({a.x, a.y, b.x, b.y});
    }
    return snapshot;
}

void play(RunFilm& film, std::uint32_t number, const ViewSnapshot& snapshot) {
    if (film.wants_picture()) film.take(snapshot);
    FilmFrame frame;
    frame.number = number;
    frame.time_ns = std::int64_t{number} * 33'333'333;
    frame.state = PoseState::kTracked;
    film.add(frame);
}

// Promise: pictures are at most as many as were asked for, whatever the run's length, at least half of them once there
// were so many, evenly spread from the first frame to the last, and their bytes are bounded by their number.
TEST(RunFilm, PicturesAreBounded) {
    const ViewSnapshot snapshot = snapshot_of(1);
    for (const std::uint32_t most : {1U, 2U, 7U, 50U}) {
        RunFilm film(most);
        std::uint32_t taken = 0;
        for (std::uint32_t number = 0; number < 3000; ++number) {
            taken += film.wants_picture() ? 1U : 0U;
            play(film, number, snapshot);
            const auto& pictures = film.pictures();
            ASSERT_LE(pictures.size(), most) << number;
            ASSERT_GE(pictures.size(), std::min<std::size_t>(number + 1, most / 2)) << number;
            if (number % 97 != 0 || pictures.size() < 2) continue;
            const std::uint32_t stride = pictures[1].frame - pictures[0].frame;
            for (std::size_t i = 0; i < pictures.size(); ++i) ASSERT_EQ(pictures[i].frame, i * stride);
            ASSERT_LT(number - pictures.back().frame, 2 * stride);
        }
        EXPECT_LE(taken, most + (most / 2 + 1) * 12);  // the first, then half of them for each doubling, 2^12 > 3000
        std::size_t bytes = 0;
        for (const FilmPicture& picture : film.pictures()) bytes += picture.size_bytes();
        EXPECT_LE(bytes, most * std::size_t{80'000});  // of noise, the worst there is for JPEG
    }
}

// Promise: the first picture of each stretch that a rival motion made unsure is kept, kFilmRivalsMax of them at most,
// and lies among the others in the end, none of them twice; others are as many as without.
TEST(RunFilm, ARivalLeavesAPicture) {
    const ViewSnapshot snapshot = snapshot_of(4, 20);
    for (const std::uint32_t most : {0U, 3U, 40U}) {
        RunFilm film(most);
        std::set<std::uint32_t> wanted;
        std::size_t stretches = 0;
        for (std::uint32_t number = 0; number < 1500; ++number) {
            FilmFrame frame;
            frame.number = number;
            const bool is_rival = number % 50 >= 47;
            frame.state = is_rival ? PoseState::kUnsure : PoseState::kTracked;
            frame.reason = is_rival ? static_cast<std::uint8_t>(UnsureReason::kRival) : std::uint8_t{0};
            if (film.wants_picture(is_rival)) film.take(snapshot, is_rival);
            film.add(frame);
            if (most > 0 && number % 50 == 47 && stretches++ < kFilmRivalsMax) wanted.insert(number);
        }
        for (const FilmPicture& picture : film.pictures()) wanted.insert(picture.frame);
        EXPECT_LE(film.pictures().size(), most);
        film.finish({}, {}, {});
        ASSERT_EQ(film.pictures().size(), wanted.size()) << most;
        auto frame = wanted.begin();
        for (const FilmPicture& picture : film.pictures()) EXPECT_EQ(picture.frame, *frame++);
    }
}

// Promise: without pictures none is wanted, and the frames are there.
TEST(RunFilm, WithoutPictures) {
    RunFilm film(0);
    const ViewSnapshot snapshot = snapshot_of(2);
    for (std::uint32_t number = 0; number < 10; ++number) {
        EXPECT_FALSE(film.wants_picture());
        film.take(snapshot);  // all the same
        play(film, number, snapshot);
    }
    EXPECT_TRUE(film.pictures().empty());
    EXPECT_EQ(film.frames().size(), 10U);
}

// Promise: a run of any length keeps at most kFilmFramesMax frames, evenly spread, in memory that was taken at the
// start.
TEST(RunFilm, FramesAreBounded) {
    RunFilm film(0);
    const FilmFrame* const place = film.frames().data();
    const ViewSnapshot snapshot;
    for (std::uint32_t number = 0; number < 10 * kFilmFramesMax + 17; ++number) play(film, number, snapshot);
    EXPECT_LE(film.frames().size(), kFilmFramesMax);
    EXPECT_GE(film.frames().size(), kFilmFramesMax / 2);
    EXPECT_EQ(film.frames().data(), place);
    for (std::size_t i = 0; i < film.frames().size(); ++i) {
        ASSERT_EQ(film.frames()[i].number, i * film.frame_stride());
    }
}

// Promise: of the events the first are kept, and the others are counted.
TEST(RunFilm, EventsAreBounded) {
    RunFilm film(0);
    for (std::size_t i = 0; i < kFilmEventsMax + 5; ++i) film.event(static_cast<std::int64_t>(i), std::to_string(i));
    ASSERT_EQ(film.events().size(), kFilmEventsMax);
    EXPECT_EQ(film.events().back().sentence, std::to_string(kFilmEventsMax - 1));
    EXPECT_EQ(film.events_left_out(), 5U);
}

using Ends = std::pair<std::pair<int, int>, std::pair<int, int>>;

// Promise: the mesh comes out as it went in: each edge between the same places, features with their group and kind; an
// edge that ends at no feature is left out.
TEST(RunFilm, TheMeshIsKept) {
    ViewSnapshot snapshot = snapshot_of(3);
    std::multiset<Ends> wanted;
    for (const ShownEdge& edge : snapshot.kept) wanted.insert({{edge.x0, edge.y0}, {edge.x1, edge.y1}});
    snapshot.kept.push_back({-1, -1, snapshot.features[0].x, snapshot.features[0].y});
    snapshot.features[5].group = 300;
    RunFilm film(4);
    play(film, 0, snapshot);
    ASSERT_EQ(film.pictures().size(), 1U);
    const FilmPicture& picture = film.pictures()[0];
    std::multiset<Ends> seen;
    const auto at = [&picture](std::uint16_t i) {
        return std::pair<int, int>(picture.features.at(i).x, picture.features.at(i).y);
    };
    for (const FilmPicture::Edge& edge : picture.kept) seen.insert({at(edge.from), at(edge.to)});
    EXPECT_EQ(seen, wanted);
    EXPECT_EQ(picture.cut.size(), snapshot.cut.size());
    ASSERT_EQ(picture.kinds.size(), snapshot.features.size());
    for (std::size_t i = 0; i < snapshot.features.size(); ++i) {
        const int group = snapshot.features[i].group;
        EXPECT_EQ(picture.kinds[i].group, group < 0 || group > 254 ? 255 : group);
        EXPECT_EQ(picture.kinds[i].kind, snapshot.features[i].kind);
    }
    EXPECT_EQ(picture.image_width, 640U);
    ASSERT_GT(picture.picture.size(), 4U);
    EXPECT_EQ(picture.picture[0], picture.is_jpeg ? 0xff : 0x89);
}

// Promise: each reason has a name of its own.
TEST(RunFilm, ReasonsHaveNames) {
    std::set<std::string> names;
    for (std::uint8_t i = 0; i < kFilmReasons; ++i) names.insert(film_reason_name(i));
    EXPECT_EQ(names.size(), std::size_t{kFilmReasons});
    EXPECT_STREQ(film_reason_name(255), "none");
}

}  // namespace
}  // namespace stillmesh::run_film_test
