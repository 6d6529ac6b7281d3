#include "platform/view/view_message.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "platform/report/picture_writer.hpp"

namespace stillmesh::view_message_test {
namespace {

[[nodiscard]] std::size_t bytes_in(const nlohmann::json& base64) {
    const std::string text = base64.get<std::string>();
    std::size_t padding = 0;
    while (padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
    return text.size() / 4 * 3 - padding;
}

[[nodiscard]] ViewSnapshot small_snapshot() {
    ViewSnapshot s;
    s.frame = 41;
    s.time_ns = 1'500'000'000;
    s.state = PoseState::kUnsure;
    s.reason = "few points";
    s.map_from_camera = {{0, 0, 0.6, 0.8}, {1, -2, 3.25}};
    s.image_width = 640;
    s.image_height = 480;
    s.picture_width = 4;
    s.picture_height = 3;
    s.grey.assign(12, 100);
    s.kept = {{8, 16, 24, 32}, {1, 2, 3, 4}};
    s.cut = {{5, 6, 7, 8}};
    s.features = {{8, 16, 0, ShownFeature::kStatic | ShownFeature::kByRival}};
    s.statistics.chosen_share = 0.084;
    s.statistics.rival_share = 0.61;
    s.keyframes = {{12, kNoKeyframe, {{0, 0, 0, 1}, {0.5, 0, 0}}}};
    s.keyframe_pool = {1, 2, 256};
    return s;
}

// Promise: a snapshot is one line of JSON with its numbers in it.
TEST(ViewMessage, AFrameIsJson) {
    std::string text;
    compose_view_frame(small_snapshot(), text);
    EXPECT_EQ(text.find('\n'), std::string::npos);
    const nlohmann::json j = nlohmann::json::parse(text);
    EXPECT_EQ(j["schema"], kViewSchema);
    EXPECT_EQ(j["frame"], 41);
    EXPECT_EQ(j["state"], "unsure");
    EXPECT_EQ(j["reason"], "few points");
    EXPECT_EQ(j["pose"], nlohmann::json({1, -2, 3.25, 0, 0, 0.6, 0.8}));
    EXPECT_EQ(j["image"], nlohmann::json({640, 480}));
    EXPECT_EQ(j["picture"].get<std::string>().rfind("iVBORw0KGgo", 0), 0U);  // the eight bytes that PNG begins with
    EXPECT_EQ(bytes_in(j["kept"]), 16U);
    EXPECT_EQ(bytes_in(j["cut"]), 8U);
    const std::uint8_t kFeature[] = {8, 0, 16, 0, 0, 0, 9, 0};  // static, and the rival alone explains it
    EXPECT_EQ(j["features"], base64(kFeature));
    EXPECT_EQ(j["chosen_percent"], 8);
    EXPECT_EQ(j["rival_percent"], 61);
    EXPECT_EQ(j["keyframes"][0][0], 12);
    EXPECT_EQ(j["keyframes"][0][1][0], 0.5);
    EXPECT_EQ(j["stages"].size(), kStages);
    EXPECT_EQ(j["pools"][0]["most"], 2);
    EXPECT_EQ(j["pools"][0]["limit"], 256);
}

// Promise: the graph is pairs of places in the list of keyframes, covisible ones and loops apart; a link to a keyframe
// that is not in the list is left out.
TEST(ViewMessage, LinksArePairsOfPlaces) {
    ViewSnapshot s = small_snapshot();
    s.keyframes = {{70, kNoKeyframe, {}}, {12, kNoKeyframe, {}}, {800, 12, {}}};
    const auto loop = KeyframeLinkKind::kLoop;
    s.links = {{12, 800, 0, loop}, {12, 70, 30}, {70, 800, 40}, {13, 70, 50}, {70, 801, 60}, {1, 800, 0, loop}};
    std::string text;
    compose_view_frame(s, text);
    const nlohmann::json j = nlohmann::json::parse(text);
    const std::uint8_t kCovisible[] = {1, 0, 0, 0, 0, 0, 2, 0}, kLoops[] = {1, 0, 2, 0};
    EXPECT_EQ(j["covisible"], base64(kCovisible));
    EXPECT_EQ(j["loops"], base64(kLoops));
}

// Promise: without a pose there is none in it, and a number that is none breaks nothing.
TEST(ViewMessage, NoPoseAndNoNumber) {
    ViewSnapshot s = small_snapshot();
    s.keyframes[0].map_from_camera.translation_m[1] = std::numeric_limits<double>::quiet_NaN();
    s.state = PoseState::kNone;
    s.grey.clear();
    std::string text;
    compose_view_frame(s, text);
    const nlohmann::json j = nlohmann::json::parse(text);
    EXPECT_TRUE(j["pose"].is_null());
    EXPECT_TRUE(j["picture"].is_null());
}

// Promise: the largest snapshot and the largest news stay below the limit of a message.
TEST(ViewMessage, IsBounded) {
    ViewSnapshot s = small_snapshot();
    s.picture_width = s.picture_height = 320;
    s.grey.resize(kViewPixelsMax);
    std::uint32_t noise = 1;  // that no compression makes smaller
    for (std::uint8_t& pixel : s.grey)
        pixel = static_cast<std::uint8_t>((noise = noise * 1664525U + 1013904223U) >> 24U);
    s.kept.assign(kViewEdgesMax, {});  // an edge is kept or cut: three to a feature in all
    s.features.assign(kViewFeaturesMax, {});
    s.keyframes.assign(
        kViewKeyframesMax,
        {123456789012, 0, {{-0.123456789, -0.123456789, -0.123456789, -0.9}, {-12.3456789, -12.3456789, -12.3456789}}});
    s.links.assign(kViewLinksMax, {123456789012, 123456789012, 100});
    std::string text;
    compose_view_frame(s, text);
    EXPECT_LT(text.size(), kViewMessageBytesMax);
    EXPECT_GT(text.size(), kViewPixelsMax);
    ViewNews news;
    news.places.resize(kViewPlacesMax);
    news.clouds.resize(kViewCloudsAtOnce);
    for (ViewCloud& cloud : news.clouds) cloud.count = ViewCloud::kPointsMax;
    news.events.assign(kViewEventsMax, std::string(kViewEventBytesMax, '\x01'));  // six letters each
    compose_view_news(news, text);
    EXPECT_LT(text.size(), kViewMessageBytesMax);
    EXPECT_EQ(bytes_in(nlohmann::json::parse(text)["clouds"][0]["points"]), ViewCloud::kPointsMax * 8);
}

// Promise: news are JSON whatever a sentence holds, and empty when there are none.
TEST(ViewMessage, NewsOfAnySentence) {
    ViewNews news;
    std::string text = "before";
    compose_view_news(news, text);
    EXPECT_TRUE(text.empty());
    news.events = {"a \"quote\"\nand \xff a broken letter", "second"};
    news.places = {{1, 2, 3, 2}};
    news.places_begin = 9;
    compose_view_news(news, text);
    EXPECT_EQ(text.find('\n'), std::string::npos);
    const nlohmann::json j = nlohmann::json::parse(text);
    EXPECT_EQ(j["events"][1], "second");
    EXPECT_EQ(j["path_begin"], 9);
    EXPECT_EQ(bytes_in(j["path"]), 16U);
    EXPECT_EQ(j["new_map"], false);
}

}  // namespace
}  // namespace stillmesh::view_message_test
