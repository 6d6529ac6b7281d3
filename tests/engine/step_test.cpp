#include <gtest/gtest.h>

#include <cstdint>

#include "tests/engine/engine_rig.hpp"

namespace stillmesh::step_test {
namespace {

using test::EngineRig;

// Promise: step() between frames changes no pose that is given out in the same frame, is counted, is seen by the hash,
// gives the same bits in any parts, and reset() forgets it.
TEST(Step, IsCountedHashedAndForgotten) {
    const test::Sequence scene = test::rendered("static_xyz", 6, 160, 120);
    EngineRig whole(Limits::tiny(), scene.camera);
    EngineRig cut(Limits::tiny(), scene.camera);
    const std::uint64_t fresh = whole->state_hash();
    for (const test::KeptFrame& kept : scene.frames) {
        ASSERT_EQ(whole->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(cut->submit(kept.frame()), Status::kOk);
        const std::uint64_t before = whole->state_hash();
        static_cast<void>(whole->step(1000));
        ASSERT_NE(whole->state_hash(), before);
        ASSERT_EQ(whole->pose().time_ns, kept.time_ns);
        for (const std::uint32_t part : {0U, 1U, 499U, 500U, 0U}) static_cast<void>(cut->step(part));
        ASSERT_EQ(cut->state_hash(), whole->state_hash());
    }
    EXPECT_EQ(whole->statistics().schedule.units_granted, 6000U);
    EXPECT_EQ(whole->statistics().schedule.steps, 6U);
    EXPECT_EQ(cut->statistics().schedule.steps, 30U);
    whole->reset();
    EXPECT_EQ(whole->state_hash(), fresh);
    EXPECT_EQ(whole->statistics().schedule.units_granted, 0U);
}

}  // namespace
}  // namespace stillmesh::step_test
