#include "engine/tracking/late_depth.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <span>
#include <vector>

#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::late_depth_test {
namespace {

// A wall that slopes along x, and features on it.
class LateDepthOf : public testing::Test {
protected:
    LateDepthOf() : world_(test::small_parameters()), frame_(*world_) {
        for (std::uint32_t i = 0; i < 60; ++i)
            frame_.add(30 + 10 * (i % 10), 30 + 10 * (i / 10), 2.0, test::descriptor_of(i));
        for (std::uint32_t y = 0; y < world_->camera.height; ++y) {
            for (std::uint32_t x = 0; x < world_->camera.width; ++x)
                frame_.depth()[y * world_->camera.width + x] = static_cast<std::uint16_t>(8'000 + 40 * x);
        }
        say(0.012);
        frame_.measure();
        late_.begin_frame();
    }
    void say(double lag_s) {
        frame_.frame().time_ns = 1'000'000'000;
        frame_.frame().depth_time_ns = 1'000'000'000 + static_cast<std::int64_t>(lag_s * 1e9);
    }
    static Vector6 turning(double rad_s) { return (Vector6() << 0, 0, 0, 0, rad_s, 0).finished(); }
    [[nodiscard]] double depth(std::size_t i) const { return frame_.measured[i].z_m; }

    test::SmallWorld world_;
    test::SmallFrame frame_;
    LateDepth late_;
};

// Promise: depth is looked up where the stamps and the motion say that the camera looked when it was taken, in the
// unit of stamps and with their sign; a frame that begins anew starts from its own pixels.
TEST_F(LateDepthOf, StampsSayWhere) {
    const double before = depth(25);
    for (const double lag_s : {0.012, -0.012}) {
        say(lag_s);
        frame_.measure();
        late_.begin_frame();
        ASSERT_TRUE(late_.expect(frame_.measured, turning(1.5), world_->parameters));
        EXPECT_TRUE(late_.is_asked());
        EXPECT_NEAR(late_.turn().y(), 1.5 * lag_s, 1e-12);
        // A camera that turns to the right has what it saw farther left, where the wall is nearer.
        EXPECT_LT((depth(25) - before) * (lag_s > 0 ? 1 : -1), -0.005);
    }
    ASSERT_TRUE(late_.expect(frame_.measured, turning(0), world_->parameters));
    EXPECT_EQ(depth(25), before);
}

// Promise: no bit changes where stamps are the same, absent, or of two clocks, while the camera hardly turns, where it
// is switched off, and for the paper's method.
TEST_F(LateDepthOf, IsNotAskedWithoutReason) {
    const double before = depth(25);
    const auto expect_nothing = [&](double rad_s, const Parameters& parameters) {
        EXPECT_FALSE(late_.expect(frame_.measured, turning(rad_s), parameters));
        EXPECT_FALSE(late_.is_asked());
        EXPECT_EQ(late_.turn().norm(), 0.0);
        EXPECT_EQ(depth(25), before);
    };
    expect_nothing(0.05, world_->parameters);
    Parameters off = world_->parameters;
    off.pose.depth_trust = 0;
    expect_nothing(1.5, off);
    Parameters paper = world_->parameters;
    paper.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    expect_nothing(1.5, paper);
    say(0);
    expect_nothing(1.5, world_->parameters);
    say(0.15);
    expect_nothing(1.5, world_->parameters);
    frame_.frame().depth_time_ns = 0;
    expect_nothing(1.5, world_->parameters);
}

// Promise: matches say how far off the stamps are; too few say nothing, and what is found beyond any camera's turn is
// not believed.
TEST_F(LateDepthOf, MatchesSayWhatStampsDoNot) {
    ASSERT_TRUE(late_.expect(frame_.measured, turning(1.5), world_->parameters));
    Random random(3);
    std::vector<Correspondence> matches;
    // Points where a turn of .03 finds them; the stamps say .018.
    const Vector3 truth(0, 0.03, 0);
    frame_.measured.look_up_depth(truth);
    for (std::uint32_t i = 0; i < 60; ++i) {
        const Vector3 p = frame_.measured[i].point();
        matches.push_back(test::measure(p, p, {}, random));
        matches.back().feature = i;
    }
    frame_.measured.look_up_depth(late_.turn());
    for (Correspondence& c : matches) c.p_camera = frame_.measured[c.feature].point();
    const std::vector<std::uint16_t> all = test::all_of(matches);
    const std::span<const std::uint16_t> few = std::span(all).first(29);
    EXPECT_FALSE(late_.measure(matches, few, SE3{}, 11.34, frame_.measured));
    ASSERT_TRUE(late_.measure(matches, all, SE3{}, 11.34, frame_.measured));
    EXPECT_NEAR(late_.turn().y(), truth.y(), 0.003);
    EXPECT_NEAR(depth(25), matches[25].p_world.z(), 0.01);
}

}  // namespace
}  // namespace stillmesh::late_depth_test
