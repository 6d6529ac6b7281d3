#include "engine/tracking/rival_motion.hpp"

#include <gtest/gtest.h>

#include <cstdint>

#include "tests/support/synthetic.hpp"

namespace stillmesh::rival_motion_test {
namespace {

constexpr std::int64_t kGap_ns = 40'000'000;

SE3 step_of(Random& random) {
    SE3 out;
    out.translation = test::random_vector(random, 0.02);
    out.rotation = so3_exp(test::random_vector(random, 0.01));
    return out;
}

// A camera that stands at the origin, and a body that leaves it by the same step each frame.
struct Rig {
    void show(const SE3* rival, bool is_carried_on) {
        Contest contest;
        if (rival != nullptr) {
            contest.hypothesis = 1;
            contest.world_from_camera = *rival;
            contest.is_carried_on = is_carried_on;
        }
        motion.learn(contest, camera, time_ns, parameters);
        motion.end_frame(time_ns);
        camera.move_to(camera.world_from_camera());
        camera.set_has_velocity(true);
        camera.end_frame(time_ns);
        time_ns += kGap_ns;
    }
    [[nodiscard]] SE3 predict() const { return motion.predict(time_ns, parameters); }

    PredictionParameters parameters;
    MotionModel camera = [] {
        MotionModel out;
        out.begin_after(0);
        return out;
    }();
    RivalMotion motion;
    std::int64_t time_ns = kGap_ns;
};

void expect_same(const SE3& a, const SE3& b) {
    EXPECT_LT(test::metres_between(a, b), 1e-9);
    EXPECT_LT((a.rotation - b.rotation).cwiseAbs().maxCoeff(), 1e-9);
}

// Promise: nothing is carried until something contradicts; it parts from where the camera was, and goes on as it did.
TEST(RivalMotion, PartsFromTheCameraAndGoesOn) {
    Random random(1);
    for (int round = 0; round < 20; ++round) {
        Rig rig;
        EXPECT_FALSE(rig.motion.is_carried());
        rig.show(nullptr, false);
        EXPECT_FALSE(rig.motion.is_carried());
        const SE3 step = step_of(random);
        SE3 rival;
        for (int frame = 0; frame < 5; ++frame) {
            rival = rival * step;
            rig.show(&rival, frame > 0);
            ASSERT_TRUE(rig.motion.is_carried());
            expect_same(rig.predict(), rival * step);
        }
        // Another one parts anew: its step is from the camera's place, not from that of the one before.
        const SE3 other = step_of(random);
        rig.show(&other, false);
        expect_same(rig.predict(), other * other);
    }
}

// Promise: what is not seen goes on by itself for five frames, is found again where it is then, and is forgotten after.
TEST(RivalMotion, IsForgottenAfterFiveFramesUnseen) {
    Random random(2);
    Rig rig;
    const SE3 step = step_of(random);
    SE3 rival = step;
    rig.show(&rival, false);
    for (int again = 0; again < 2; ++again) {
        for (int frame = 0; frame < 5; ++frame) {
            rig.show(nullptr, false);
            rival = rival * step;
            ASSERT_TRUE(rig.motion.is_carried());
            expect_same(rig.predict(), rival * step);
        }
        if (again == 0) {
            rival = rival * step;
            rig.show(&rival, true);
            expect_same(rig.predict(), rival * step);
        }
    }
    rig.show(nullptr, false);
    EXPECT_FALSE(rig.motion.is_carried());
}

// Promise: where the map under the camera moves, it moves along; reset, it is none.
TEST(RivalMotion, MovesWithTheMap) {
    Random random(3);
    Rig rig;
    const SE3 step = step_of(random);
    rig.show(&step, false);
    const SE3 correction = test::random_motion(random, 2, 1);
    rig.motion.follow(correction);
    expect_same(rig.predict(), correction * step * step);
    rig.motion.reset();
    EXPECT_FALSE(rig.motion.is_carried());
}

}  // namespace
}  // namespace stillmesh::rival_motion_test
