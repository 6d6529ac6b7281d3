#include "engine/tracking/noise_scale.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/memory.hpp"

namespace stillmesh {
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

private:
    static std::size_t planned() {
        ArenaPlan plan;
        NoiseScale::plan(plan, kLimits);
        return plan.used_bytes();
    }
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

}  // namespace
}  // namespace stillmesh
