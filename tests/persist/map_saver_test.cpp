#include "platform/record/map_saver.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

#include "tests/persist/map_rig.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::map_saver_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

// Promise: that saves fail is said when the first does and once a minute from then on, however many fail between; and
// the end names them although by then they go well.
TEST(MapSaver, SaysOnceAMinuteThatSavesFail) {
    const test::Sequence sequence = test::rendered("static_xyz", 3, 160, 120, 3);
    test::EngineRig engine(Limits::tiny(), sequence.camera);
    test::run(*engine, sequence, 0, 3);
    const test::TemporaryFolder folder;
    const std::string room = folder.path("maps");
    std::filesystem::create_directory(room);
    MapSaver saver;
    std::string message;
    ASSERT_TRUE(saver.open(room + "/room.map", Limits::tiny(), 0, kSecond_ns, message)) << message;
    std::filesystem::remove_all(room);

    const auto says_at = [&](std::int64_t s, int wait_ms) {  // a disk takes its time
        saver.work(*engine, s * kSecond_ns, 1'000'000);
        for (int i = 0; i < wait_ms; ++i) {
            if (!saver.take_news(s * kSecond_ns).empty()) return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return false;
    };
    for (std::int64_t s = 100; !says_at(s, 100); ++s) ASSERT_LT(s, 110) << "nothing said";
    for (std::int64_t s = 115; s < 160; ++s) EXPECT_FALSE(says_at(s, 10)) << s;
    for (std::int64_t s = 180; !says_at(s, 100); ++s) ASSERT_LT(s, 190) << "nothing said a minute later";
    std::filesystem::create_directory(room);
    const std::string end = saver.finish(*engine);
    EXPECT_NE(end.find("saves failed while it ran; at the end the map was written"), std::string::npos) << end;
    EXPECT_TRUE(std::filesystem::exists(room + "/room.map"));
}

}  // namespace
}  // namespace stillmesh::map_saver_test
