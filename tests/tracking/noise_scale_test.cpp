#include "engine/tracking/noise_scale.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::noise_scale_test {
namespace {

constexpr Limits kLimits = Limits::tiny();

// Points two metres ahead, each seen off its place by `sigmas` deviations of the model.
class Points {
public:
    Points(std::uint32_t count, double sigmas) {
        for (std::uint32_t i = 0; i < count; ++i) {
            Correspondence c;
            c.p_world = Vector3(0.01 * i - 0.3, 0.02 * (i % 7), 2.0);
            c.var_pixel = 1e-6;
            c.var_z = 1e-4;
            c.has_depth = true;
            c.normalised = Vector2(c.p_world.x() / 2.0 + sigmas * 1e-3, c.p_world.y() / 2.0);
            c.p_camera = Vector3(c.normalised.x() * 2.0, c.normalised.y() * 2.0, 2.0 + sigmas * 1e-2);
            correspondences_.push_back(c);
            chosen_.push_back(static_cast<std::uint16_t>(i));
        }
    }
    // The first `count` are as wrong as can be...
    void spoil(std::uint32_t count) {
        for (std::uint32_t i = 0; i < count; ++i) correspondences_[i].p_world += Vector3(1, 1, 1);
    }
    // ... without depth...
    void blind(std::uint32_t count) {
        for (std::uint32_t i = 0; i < count; ++i) correspondences_[i].has_depth = false;
    }
    // ... or, at the other end, behind the camera.
    void put_behind(std::uint32_t count) {
        for (std::uint32_t i = 0; i < count; ++i) correspondences_[correspondences_.size() - 1 - i].p_world.z() = -2;
    }
    void teach(NoiseScale& noise) const { noise.adapt(correspondences_, chosen_, SE3{}); }

private:
    std::vector<Correspondence> correspondences_;
    std::vector<std::uint16_t> chosen_;
};

class NoiseScaleTest : public testing::Test {
protected:
    NoiseScaleTest() : memory_(planned()) {
        Arena arena(memory_.span());
        noise_.create(arena, kLimits, parameters_);
        for (std::uint32_t i = 0; i < parameters_.young_frames; ++i) noise_.count_frame();
    }
    [[nodiscard]] double pixel() const { return noise_.factors().pixel; }

    NoiseParameters parameters_;
    NoiseScale noise_;

    static std::size_t planned() {
        ArenaPlan plan;
        NoiseScale::plan(plan, kLimits);
        return plan.used_bytes();
    }

private:
    test::Memory memory_;
};

// Promise: what a frame guessed and nothing confirmed is gone with it, however many such frames there are. (It stayed,
// and after three frames of doubt, at 88 times the variance, people who walked agreed with the room.)
TEST_F(NoiseScaleTest, AGuessIsNotPassedOn) {
    const double before = pixel();
    for (int frame = 0; frame < 10; ++frame) {
        noise_.begin_frame();
        noise_.raise();
        noise_.raise();
        EXPECT_GT(pixel(), 5.0 * before);
        noise_.undo();
    }
    EXPECT_EQ(pixel(), before);
}

// Promise: too few residuals confirm nothing, but a frame that is sure may keep its guess; kept ones do not pile up.
TEST_F(NoiseScaleTest, GuessesDoNotPileUp) {
    const double before = pixel();
    const std::uint32_t few = parameters_.residuals_min - 1;
    for (int frame = 0; frame < 10; ++frame) {
        noise_.begin_frame();
        for (std::uint32_t i = 0; i < noise_.tries_max(); ++i) noise_.raise();
        Points(few, 0.3).teach(noise_);
    }
    EXPECT_GT(pixel(), before);
    EXPECT_LE(pixel(), before * std::pow(parameters_.pixel_try_factor, parameters_.tries) * (1 + 1e-12));
}

// Promise: residuals that the frame's own pose leaves tell at once how much of a guess was too much; without one the
// noise follows them slowly.
TEST_F(NoiseScaleTest, AGuessIsMeasuredInItsOwnFrame) {
    const Points calm(60, 0.3);  // of variance .09
    noise_.begin_frame();
    noise_.raise();
    noise_.raise();
    const double raised = pixel();
    calm.teach(noise_);
    EXPECT_LT(pixel(), 0.2 * raised);
    const double measured = pixel();
    noise_.begin_frame();
    calm.teach(noise_);
    EXPECT_GE(pixel(), parameters_.fall * measured);
}

// Promise: after a camera was believed somewhere else for some calm frames and was not there, a guess is still more
// noise than there was, not less.
TEST_F(NoiseScaleTest, AGuessAfterAReturnIsMore) {
    noise_.restore({10.0, 10.0});
    for (int frame = 0; frame < 40; ++frame) {
        noise_.begin_frame();
        Points(60, 0.3).teach(noise_);
    }
    EXPECT_LT(pixel(), 1.0);
    noise_.restore({10.0, 10.0});
    noise_.begin_frame();
    noise_.raise();
    EXPECT_GT(pixel(), 10.0);
}

// Promise: a jerk whose residuals are as large as was guessed keeps the guess.
TEST_F(NoiseScaleTest, AGuessThatIsRightStays) {
    noise_.begin_frame();
    noise_.raise();
    noise_.raise();
    const double raised = pixel();
    Points(60, 1.5).teach(noise_);
    EXPECT_GE(pixel(), raised);
}

// Promise: a factor follows the median of its residuals over that of noise, at most by `fall` and `rise` in a frame,
// by `fall_young` and `depth_try_factor` in the first young_frames, and stays between its least and `max`.
TEST_F(NoiseScaleTest, FollowsTheMedianWithinItsLimits) {
    constexpr double kMedian2 = 1.386, kMedian1 = 0.455;
    for (const bool is_other : {false, true}) {
        NoiseParameters p;
        if (is_other) {
            p = {.pixel_start = 0.5,
                 .depth_start = 0.7,
                 .pixel_min = 0.2,
                 .depth_min = 0.4,
                 .max = 5,
                 .young_frames = 2,
                 .depth_try_factor = 3,
                 .fall_young = 0.5,
                 .fall = 0.8,
                 .rise = 1.5};
        }
        for (const double sigmas : {0.0, 0.3, 0.7, 1.0, 1.2, 2.0, 30.0}) {
            const Points points(60, sigmas);
            NoiseScale noise;
            test::Memory memory(planned());
            Arena arena(memory.span());
            noise.create(arena, kLimits, p);
            double pixel = p.pixel_start, depth = p.depth_start;
            for (std::uint32_t frame = 0; frame < p.young_frames + 20; ++frame) {
                const bool is_young = frame < p.young_frames;
                EXPECT_EQ(noise.is_young(), is_young);
                EXPECT_EQ(noise.frames(), frame);
                const double least = is_young ? p.fall_young : p.fall, most = is_young ? p.depth_try_factor : p.rise;
                noise.begin_frame();
                points.teach(noise);
                noise.count_frame();
                pixel = std::clamp(pixel * std::clamp(sigmas * sigmas / kMedian2, least, most), p.pixel_min, p.max);
                depth = std::clamp(depth * std::clamp(sigmas * sigmas / kMedian1, least, most), p.depth_min, p.max);
                EXPECT_NEAR(noise.factors().pixel, pixel, 1e-5 * pixel) << sigmas << ' ' << frame;
                EXPECT_NEAR(noise.factors().depth, depth, 1e-5 * depth) << sigmas << ' ' << frame;
            }
            noise.reset();
            EXPECT_EQ(noise.factors().pixel, p.pixel_start);
            EXPECT_EQ(noise.factors().depth, p.depth_start);
            EXPECT_EQ(noise.frames(), 0U);
        }
    }
}

// Promise: residuals_min residuals change the noise, one fewer does not; half of them may be as wrong as they like.
TEST_F(NoiseScaleTest, TheMedianOfEnough) {
    for (const std::uint32_t least : {10U, 30U}) {
        parameters_.residuals_min = least;
        noise_.reset();
        for (std::uint32_t i = 0; i < parameters_.young_frames; ++i) noise_.count_frame();
        Points(least - 1, 5).teach(noise_);
        EXPECT_EQ(pixel(), parameters_.pixel_start);
        Points(least, 5).teach(noise_);
        EXPECT_NEAR(pixel(), parameters_.pixel_start * parameters_.rise, 1e-12);
    }
    Points calm(60, 1.0);
    calm.spoil(29);
    const double before = pixel();
    calm.teach(noise_);
    EXPECT_NEAR(pixel(), before * parameters_.fall, 1e-12) << "1 sigma is less than the median of noise";
}

// Promise: what has no depth, or would be behind the camera, is no residual.
TEST_F(NoiseScaleTest, OnlyWhatHasBothTells) {
    Points points(60, 5.0);
    points.blind(31);
    points.teach(noise_);
    EXPECT_EQ(pixel(), parameters_.pixel_start);
    points.put_behind(10);
    points.teach(noise_);
    EXPECT_EQ(pixel(), parameters_.pixel_start);
}

// Promise: a try raises the pixel variance by pixel_try_factor and the depth's by depth_try_factor, at most to `max`;
// there are `tries`, and twice as many in the first frame, and no more than so many add up.
TEST_F(NoiseScaleTest, TriesAreConfigured) {
    for (const bool is_other : {false, true}) {
        if (is_other) {
            parameters_.tries = 1;
            parameters_.pixel_try_factor = 1.5;
            parameters_.depth_try_factor = 4;
            parameters_.max = 4;
        }
        const NoiseParameters& p = parameters_;
        for (const bool is_first : {true, false}) {
            noise_.reset();
            if (!is_first) noise_.count_frame();
            EXPECT_EQ(noise_.tries_max(), is_first ? 2 * p.tries : p.tries);
            noise_.begin_frame();
            for (std::uint32_t i = 1; i <= noise_.tries_max() + 2; ++i) {
                noise_.raise();
                const std::uint32_t raised = std::min(i, noise_.tries_max());
                EXPECT_NEAR(pixel(), std::min(p.pixel_start * std::pow(p.pixel_try_factor, raised), p.max), 1e-9);
                EXPECT_NEAR(noise_.factors().depth,
                            std::min(p.depth_start * std::pow(p.depth_try_factor, raised), p.max), 1e-9);
            }
            noise_.undo();
            EXPECT_EQ(pixel(), p.pixel_start);
            EXPECT_EQ(noise_.factors().depth, p.depth_start);
        }
    }
}

// Promise: what moves with a motion of its own is no noise when each group is measured under its own motion; under the
// room's it would be.
TEST(NoiseScaleByGroup, BodiesAreNoNoise) {
    const Limits limits = test::limits_of(400);
    test::InMemory<StaticRegion> region(limits);
    Random random(1);
    SE3 motion;
    motion.translation = Vector3(0.2, 0, 0);
    const test::Scene scene = test::room_and_body(100, 150, SE3{}, motion, random);
    const Parameters parameters;
    const RegionContext context = test::context_at(SE3{});
    region->build(scene.correspondences, scene.keypoints, parameters.region, context);
    const RegionChoice choice = region->choose(scene.correspondences, parameters, context, random);
    ASSERT_TRUE(choice.is_valid);
    const auto measured = [&](bool is_by_group) {
        NoiseScale noise;
        ArenaPlan plan;
        NoiseScale::plan(plan, limits);
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        noise.create(arena, limits, parameters.noise);
        noise.restore({1, 1});
        for (int frame = 0; frame < 5; ++frame) {
            noise.begin_frame();
            noise.adapt(scene.correspondences, region->weighted(), SE3{}, is_by_group ? &*region : nullptr);
        }
        return noise.factors();
    };
    EXPECT_GT(measured(false).pixel, 10.0) << "of the two the body has more points";
    // Every frame anew: the residuals do not shrink with the factor.
    EXPECT_LT(measured(true).pixel, 2.0);
    EXPECT_LT(measured(true).depth, 2.0);
}

}  // namespace
}  // namespace stillmesh::noise_scale_test
