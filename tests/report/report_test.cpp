#include "platform/report/report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "platform/cli/run_loop.hpp"
#include "platform/report/report_data.hpp"
#include "platform/view/view_files.hpp"
#include "tests/platform/story_session.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::report_test {
namespace {

using Json = nlohmann::json;
using test::StoryCamera;
using test::StorySession;

struct Story {
    RunRecord record;
    RunFilm film{20};
    ViewFeed feed;
};

// A run with each state, a gap and something said, and its truth.
void play(Story& story) {
    StoryCamera camera;
    camera.frames = 100;
    StorySession session;
    session.state_of = [](std::uint64_t i) {
        if (i >= 40 && i < 50) return PoseState::kNone;
        if (i >= 50 && i < 55) return PoseState::kPredicted;
        return i >= 20 && i < 30 ? PoseState::kUnsure : PoseState::kTracked;
    };
    RunLoopOptions options;
    options.keep_trajectory = true;
    options.show_progress = false;
    options.frames_max = 100;
    options.view = &story.feed;
    options.film = &story.film;
    options.camera.width = 64;
    options.camera.height = 48;
    options.camera.fx = options.camera.fy = 50;
    int news = 0;
    options.news = [&news] { return ++news == 30 ? std::string("the camera <b>coughed</b>.") : std::string(); };
    story.record.input = "<script>alert(1)</script>";
    story.record.command = "stillmesh run --report </script><script>alert(2)</script>";
    static_cast<void>(run_loop(
        camera, [] { return std::string(); }, session, options, story.record));
    story.record.truth = story.record.estimate;
    for (TrajectoryPose& pose : story.record.truth) pose.t[1] += 0.01 * std::sin(pose.t[0] * 9);
    story.record.evaluation = evaluate(story.record.truth, story.record.estimate);
}

[[nodiscard]] std::string part_of(const std::string& html, const std::string& id) {
    const std::string begin = "<script type=\"application/json\" id=\"" + id + "\">";
    const std::size_t at = html.find(begin);
    if (at == std::string::npos) return {};
    return html.substr(at + begin.size(), html.find("</script>", at) - at - begin.size());
}

template <typename T>
[[nodiscard]] std::vector<T> numbers_of(const Json& base64) {
    const std::string text = base64.get<std::string>();
    static const std::string kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string bytes;
    for (std::size_t i = 0; i + 3 < text.size(); i += 4) {
        std::uint32_t word = 0;
        int known = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            const std::size_t letter = kLetters.find(text[i + k]);
            word = word << 6U | static_cast<std::uint32_t>(letter == std::string::npos ? 0 : letter);
            known += text[i + k] == '=' ? 0 : 1;
        }
        for (int k = 0; k < known - 1; ++k) bytes += static_cast<char>(word >> (16 - 8 * k));
    }
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return values;
}

// Promise: the report is one page that fetches nothing, and no name in it can break out.
TEST(Report, IsSelfContained) {
    Story story;
    play(story);
    std::string html = report_html(story.record, story.film);
    EXPECT_EQ(html.find("<script>alert"), std::string::npos);
    EXPECT_EQ(html.find("<b>coughed"), std::string::npos);
    EXPECT_NE(html.find("default-src 'none'"), std::string::npos);
    if (const std::string_view three = page_parts().three; !three.empty()) {
        const std::size_t at = html.find(three);
        ASSERT_NE(at, std::string::npos);
        html.erase(at, three.size());  // it names what it knows of XML
    }
    for (const char* const from_elsewhere :
         {"http://", "https://", " src=", "@import", "url(", "fetch(", "EventSource"}) {
        EXPECT_EQ(html.find(from_elsewhere), std::string::npos) << from_elsewhere;
    }
    for (const char* const part : {"Error of the path", "map points", "static region", "id=\"slider\"", "id=\"camera\"",
                                   "id=\"map\"", "id=\"curves\""}) {
        EXPECT_NE(html.find(part), std::string::npos) << part;
    }
    EXPECT_NE(report_html(RunRecord(), RunFilm(0)).find("No frame was tracked"), std::string::npos);
}

// Promise: time is judged by the camera's own period; where that is not known, by that of 30 frames a second.
TEST(Report, TimeIsOfTheCamera) {
    const struct {
        double period_ms;
        const char *period, *grade;
    } kCases[] = {{66.7, "67 ms", "good"}, {16.7, "17 ms", "bad"}, {0, "33 ms", "bad"}};
    for (const auto& wanted : kCases) {
        Story story;
        play(story);
        story.record.frame_ms = {};
        for (int i = 0; i < 10; ++i) story.record.frame_ms.add(50);
        story.record.frame_period_ms = wanted.period_ms;
        const std::string html = report_html(story.record, story.film);
        const std::size_t card = html.find("Time per frame");
        ASSERT_NE(card, std::string::npos);
        const std::string text = html.substr(card, html.find("</div>", card) - card);
        EXPECT_NE(text.find(std::string("<em class=\"") + wanted.grade), std::string::npos) << text;
        EXPECT_NE(text.find(std::string("after ") + wanted.period), std::string::npos) << text;
        EXPECT_NE(html.find(std::string("far below the ") + wanted.period), std::string::npos) << wanted.period;
    }
}

// Promise: each frame's numbers are in the page as the run had them: state, reason, place, counts and error.
TEST(Report, HoldsEachFrame) {
    Story story;
    play(story);
    const std::string html = report_html(story.record, story.film);
    const Json run = Json::parse(part_of(html, "run"));
    const Json& columns = run["columns"];
    const auto states = numbers_of<std::uint8_t>(columns["state"]);
    const auto numbers = numbers_of<std::uint32_t>(columns["frame"]);
    const auto times = numbers_of<std::int64_t>(columns["time"]);
    const auto poses = numbers_of<float>(columns["pose"]);
    const auto errors = numbers_of<float>(columns["error"]);
    ASSERT_EQ(states.size(), 100U);
    ASSERT_EQ(poses.size(), 700U);
    ASSERT_EQ(errors.size(), 100U);
    for (std::size_t i = 0; i < states.size(); ++i) {
        const int expected = i >= 40 && i < 50 ? 0 : i >= 50 && i < 55 ? 1 : i >= 20 && i < 30 ? 2 : 3;
        EXPECT_EQ(states[i], expected) << i;
        EXPECT_EQ(numbers[i], i);
        EXPECT_FLOAT_EQ(poses[7 * i], 0.01F * static_cast<float>(i));
        EXPECT_EQ(std::isnan(errors[i]), expected < 2) << i;  // what was not measured is not compared
        if (i > 0) {
            EXPECT_GT(times[i], times[i - 1]);
        }
    }
    double sum = 0;
    std::size_t count = 0;
    for (const float error : errors) {
        if (std::isnan(error)) continue;
        sum += static_cast<double>(error) * static_cast<double>(error);
        ++count;
    }
    ASSERT_EQ(count, story.record.evaluation->pairs.size());
    EXPECT_NEAR(std::sqrt(sum / static_cast<double>(count)), story.record.evaluation->ate_rmse_m, 1e-6);
    ASSERT_EQ(run["events"].size(), 1U);
    EXPECT_EQ(run["events"][0][1], "the camera <b>coughed</b>.");
    EXPECT_EQ(run["input"], story.record.input);
    const Json film = Json::parse(part_of(html, "film"));
    EXPECT_LE(film["pictures"].size(), 20U);
    EXPECT_GE(film["pictures"].size(), 10U);
    const auto places = numbers_of<std::int16_t>(film["pictures"][0]["at"]);
    const auto kept = numbers_of<std::uint16_t>(film["pictures"][0]["kept"]);
    EXPECT_GT(kept.size(), 100U);
    for (const std::uint16_t end : kept) EXPECT_LT(end, places.size() / 2);
}

// Promise: how much of the surface the motion chosen and its rival explain is in the page, frame by frame.
TEST(Report, TellsOfTheRival) {
    RunFilm film(0);
    for (std::uint8_t i = 0; i < 10; ++i) {
        FilmFrame frame;
        frame.number = i;
        frame.chosen_percent = static_cast<std::uint8_t>(100 - i);
        frame.rival_percent = i;
        film.add(frame);
    }
    const Json columns = Json::parse(run_data(RunRecord(), film))["columns"];
    const auto chosen = numbers_of<std::uint8_t>(columns["chosen"]), rival = numbers_of<std::uint8_t>(columns["rival"]);
    ASSERT_EQ(chosen.size(), 10U);
    ASSERT_EQ(rival.size(), 10U);
    for (int i = 0; i < 10; ++i) {
        EXPECT_EQ(chosen[static_cast<std::size_t>(i)], 100 - i);
        EXPECT_EQ(rival[static_cast<std::size_t>(i)], i);
    }
}

// Promise: the truth in the page lies where the run's own map has it: brought back by the alignment, it is as far from
// the poses as the error says.
TEST(Report, TruthLiesInTheMap) {
    Story story;
    play(story);
    for (TrajectoryPose& pose : story.record.truth) {  // another world: turned about z by 90 degrees, and moved
        const auto t = pose.t;
        pose.t = {-t[1] + 5, t[0] - 3, t[2] + 1};
    }
    story.record.evaluation = evaluate(story.record.truth, story.record.estimate);
    ASSERT_TRUE(story.record.evaluation);
    const Json run = Json::parse(run_data(story.record, story.film));
    const auto truth = numbers_of<float>(run["truth"]);
    ASSERT_EQ(truth.size(), 3 * story.record.truth.size());
    double sum = 0;
    for (const PosePair& pair : story.record.evaluation->pairs) {
        for (std::size_t k = 0; k < 3; ++k) {
            const double off =
                static_cast<double>(truth[3 * pair.truth_index + k]) - story.record.estimate[pair.estimate_index].t[k];
            sum += off * off;
        }
    }
    const double rmse = std::sqrt(sum / static_cast<double>(story.record.evaluation->pairs.size()));
    EXPECT_NEAR(rmse, story.record.evaluation->ate_rmse_m, 1e-5);
}

// Promise: what one report wrote is read again for a comparison; a page that is none, cut off or of another hand is
// refused with a sentence; nothing in one breaks out of the comparison.
TEST(Report, IsComparedWithOthers) {
    Story story;
    play(story);
    const test::TemporaryFolder folder;
    const std::string html = report_html(story.record, story.film);
    test::write_text(folder.path() + "/index.html", html);
    ComparedRun run;
    std::string message;
    ASSERT_EQ(read_report(folder.path() + "/", run, message), Status::kOk) << message;
    EXPECT_EQ(Json::parse(run.data), Json::parse(part_of(html, "run")));
    ComparedRun file;
    ASSERT_EQ(read_report(folder.path() + "/index.html", file, message), Status::kOk) << message;
    run.name = "</script><script>alert(3)</script>";
    const std::string page = comparison_html({run, file});
    EXPECT_EQ(page.find("<script>alert"), std::string::npos);
    const Json runs = Json::parse(part_of(page, "runs"));
    ASSERT_EQ(runs.size(), 2U);
    EXPECT_EQ(runs[0]["name"], run.name);
    EXPECT_EQ(runs[1]["data"]["numbers"], Json::parse(run.data)["numbers"]);
    const std::string begin = std::string(kRunDataBegin);
    for (const std::string& wrong : {std::string(), std::string("<html>"), begin, begin + "{}" + std::string(kDataEnd),
                                     begin + "[1]" + std::string(kDataEnd), html.substr(0, html.find(begin) + 500),
                                     begin + R"({"schema":1,"input":1})" + std::string(kDataEnd)}) {
        test::write_text(folder.path() + "/index.html", wrong);
        message.clear();
        EXPECT_EQ(read_report(folder.path(), run, message), Status::kInvalid) << wrong.substr(0, 100);
        EXPECT_NE(message.find("index.html"), std::string::npos) << message;
    }
    // Nested without end, in an otherwise right one: read, and what is too deep is left out.
    std::string deep = part_of(html, "run");
    deep.insert(1, "\"more\":" + std::string(300'000, '[') + std::string(300'000, ']') + ",");
    test::write_text(folder.path() + "/index.html", begin + deep + std::string(kDataEnd));
    EXPECT_EQ(read_report(folder.path(), run, message), Status::kOk) << message;
    EXPECT_LT(run.data.size(), deep.size() - 500'000);
    EXPECT_EQ(read_report(folder.path() + "/none", run, message), Status::kUnavailable);
}

}  // namespace
}  // namespace stillmesh::report_test
