#include "platform/camera_check/self_calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "platform/camera_check/rigidity.hpp"
#include "tests/camera_check/synthetic_views.hpp"

namespace stillmesh::self_calibration_test {
namespace {

using test::looking_around;
using test::seen;
using test::usual_camera;
using test::ViewPair;

CameraCorrection fitted(const std::vector<ViewPair>& pairs, const CameraModel& given, double factor,
                        std::uint64_t seed) {
    SelfCalibration calibration(given);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        const std::vector<ViewMatch> matches = seen(pairs[i], usual_camera(), given, factor, 100 * seed + i);
        calibration.add(matches, std::vector<bool>(matches.size(), true));
    }
    return calibration.estimate();
}

// Promise: a right calibration is left alone, whatever the room and the noise; how far it may be off is said.
TEST(SelfCalibration, LeavesWhatIsRight) {
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        const CameraCorrection c = fitted(looking_around(seed), usual_camera(), 1, seed);
        ASSERT_TRUE(c.is_known);
        EXPECT_EQ(c.pairs, 8U);
        for (std::size_t i = 0; i < 4; ++i)
            EXPECT_LT(std::abs(c.value[i]), 5 * c.sigma[i]) << "seed " << seed << " number " << i;
        for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(std::abs(c.value[i]), 0.05) << "seed " << seed;
        for (std::size_t i = 2; i < 4; ++i) EXPECT_LT(std::abs(c.value[i]), 25) << "seed " << seed;
        EXPECT_GT(c.cost, 0.95 * c.cost_before) << "seed " << seed;
    }
}

// Promise: halved, doubled and swapped numbers are found, each by name and to some hundredths, and the corrected camera
// explains what was seen; whatever the depth unit is, which changes nothing.
TEST(SelfCalibration, FindsWhatIsWrong) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        for (const double factor : {1.0, 5.0, 0.2}) {
            for (const auto& [fx, fy, cx, cy] :
                 {std::array{264.0, 264.0, 159.5, 119.5}, std::array{1056.0, 1056.0, 319.5, 239.5},
                  std::array{319.5, 528.0, 528.0, 239.5}, std::array{528.0, 528.0, 239.5, 319.5},
                  std::array{528.0, 264.0, 319.5, 239.5}}) {
                CameraModel given = usual_camera();
                given.fx = fx;
                given.fy = fy;
                given.cx = cx;
                given.cy = cy;
                const CameraCorrection c = fitted(looking_around(seed), given, factor, seed);
                ASSERT_TRUE(c.is_known);
                EXPECT_NEAR(fx * std::exp(c.value[0]), 528, 30) << "given " << fx << " " << fy << " seed " << seed;
                EXPECT_NEAR(fy * std::exp(c.value[1]), 528, 30) << "given " << fx << " " << fy << " seed " << seed;
                EXPECT_NEAR(cx + c.value[2], 319.5, 30) << "given " << cx << " " << cy << " seed " << seed;
                EXPECT_NEAR(cy + c.value[3], 239.5, 30) << "given " << cx << " " << cy << " seed " << seed;
                EXPECT_LT(c.cost, 0.5 * c.cost_before);
            }
        }
    }
}

// Promise: who does not turn learns nothing of the focal lengths, and is told so by their deviation.
TEST(SelfCalibration, AStraightWayTellsNoFocalLength) {
    std::vector<ViewPair> pairs(8);
    for (std::size_t i = 0; i < pairs.size(); ++i)
        pairs[i].way = {i % 2 == 0 ? 0.15 : 0.0, i % 2 == 0 ? 0.0 : 0.15, 0.0};
    CameraModel given = usual_camera();
    given.fx = given.fy = 264;
    const CameraCorrection c = fitted(pairs, given, 1, 1);
    ASSERT_TRUE(c.is_known);
    EXPECT_LT(std::abs(c.value[0]), 6 * c.sigma[0]);
    EXPECT_GT(c.sigma[0], 0.1);
}

// Promise: no pairs, no answer.
TEST(SelfCalibration, KnowsNothingOfNothing) {
    EXPECT_FALSE(SelfCalibration(usual_camera()).estimate().is_known);
}

// Promise: one motion explains a room with any calibration and depth unit; a third that walks away does not count as
// depth that does not belong; depth of another place does.
TEST(Rigidity, TellsStrangersFromPeople) {
    Rigidity rigidity;
    ViewPair pair;
    pair.turn = {0.02, 0.06, 0};
    pair.way = {0.1, 0, 0.05};
    ViewPair walker = pair;
    walker.way = {-0.2, 0.05, 0.1};
    CameraModel wrong = usual_camera();
    wrong.fx = 264;
    wrong.cx = 528;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        std::vector<ViewMatch> matches = seen(pair, usual_camera(), usual_camera(), 1, seed);
        measure_rigidity(matches, 528, rigidity);
        EXPECT_GT(rigidity.with_depth, 0.9);
        measure_rigidity(seen(pair, usual_camera(), wrong, 5, seed), wrong.fx, rigidity);
        EXPECT_GT(rigidity.with_depth, 0.85);

        const std::vector<ViewMatch> walking = seen(walker, usual_camera(), usual_camera(), 1, seed + 50, 75);
        matches.insert(matches.end(), walking.begin(), walking.end());
        measure_rigidity(matches, 528, rigidity);
        EXPECT_GT(rigidity.with_depth, 0.6);

        matches = seen(pair, usual_camera(), usual_camera(), 1, seed);
        Random random(seed);
        for (ViewMatch& m : matches) {
            m.a.inverse_depth = static_cast<float>(random.uniform(0.25, 1.2));
            m.b.inverse_depth = m.a.inverse_depth * static_cast<float>(random.uniform(0.9, 1.1));
        }
        measure_rigidity(matches, 528, rigidity);
        EXPECT_LT(rigidity.with_depth, 0.5);
        EXPECT_GT(rigidity.by_picture, 0.8);
    }
}

}  // namespace
}  // namespace stillmesh::self_calibration_test
