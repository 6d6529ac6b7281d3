#include "platform/library/step_pacer.hpp"

#include <gtest/gtest.h>

namespace stillmesh::step_pacer_test {
namespace {

constexpr std::int64_t kMs = 1'000'000;

// A frame's background work on a machine where a unit costs `ns_per_unit`: when it ended, and how many units it was.
struct Work {
    std::int64_t end_ns = 0;
    std::uint64_t units = 0;
    std::uint32_t calls = 0;
};
Work work(StepPacer& pacer, std::int64_t now_ns, std::int64_t until_ns, double ns_per_unit) {
    Work out{now_ns, 0, 0};
    for (;; ++out.calls) {
        const std::uint32_t units = pacer.next_grant(out.end_ns, until_ns, out.calls);
        if (units == 0) return out;
        const auto ns = static_cast<std::int64_t>(units * ns_per_unit);
        pacer.measured(units, ns);
        out.end_ns += ns;
        out.units += units;
    }
}

// Promise: whatever a unit costs, once it is measured the work ends before the next frame, and uses the time up to the
// margin; before, it is late by less than one slice.
TEST(StepPacer, EndsBeforeTheNextFrame) {
    for (const double ns_per_unit : {1.0, 10.0, 100.0, 1000.0, 5000.0}) {
        StepPacer pacer(2000);
        for (int frame = 0; frame < 100; ++frame) {
            const std::int64_t until_ns = 33 * kMs;
            const Work done = work(pacer, 10 * kMs, until_ns, ns_per_unit);
            if (frame > 0) {
                ASSERT_LE(done.end_ns, until_ns) << ns_per_unit << ", frame " << frame;
            }
            if (frame == 99 && done.calls < StepPacer::kCallsMax) {
                ASSERT_GE(static_cast<double>(done.end_ns),
                          static_cast<double>(until_ns - StepPacer::kMargin_ns) - 1.3 * 250 * ns_per_unit);
            }
        }
    }
}

// Promise: a frame that leaves no time is still followed by one small grant, and by no more; calls are bounded.
TEST(StepPacer, NeverStarvesAndNeverFloods) {
    StepPacer pacer(2000);
    for (int frame = 0; frame < 10; ++frame) {
        const Work done = work(pacer, 50 * kMs, 33 * kMs, 100);
        EXPECT_EQ(done.units, 2000U / StepPacer::kParts);
        EXPECT_EQ(done.calls, 1U);
    }
    EXPECT_EQ(work(pacer, 0, std::int64_t{1} << 60, 0).calls, StepPacer::kCallsMax);
    StepPacer smallest(1);
    EXPECT_EQ(work(smallest, 1, 0, 1).units, 1U);
}

// Promise: a machine that becomes slower is noticed within two calls, one that becomes faster within some tens.
TEST(StepPacer, FollowsTheMachine) {
    StepPacer pacer(2000);
    for (int i = 0; i < 100; ++i) pacer.measured(2000, 2000 * 10);
    EXPECT_NEAR(pacer.ns_per_unit(), 10, 2);
    pacer.measured(2000, 2000 * 100);
    pacer.measured(2000, 2000 * 100);
    EXPECT_GT(pacer.ns_per_unit(), 70);
    for (int i = 0; i < 60; ++i) pacer.measured(2000, 2000 * 10);
    EXPECT_LT(pacer.ns_per_unit(), 20);
    const double before = pacer.ns_per_unit();
    pacer.measured(0, 1'000'000);
    EXPECT_EQ(pacer.ns_per_unit(), before) << "idle time measures nothing";
}

}  // namespace
}  // namespace stillmesh::step_pacer_test
