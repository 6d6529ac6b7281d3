#include <gtest/gtest.h>

#include <cstdint>

#include "tests/engine/engine_rig.hpp"

namespace stillmesh::numbers_test {
namespace {

struct Change {
    const char* name;
    void (*make)(Parameters&);
};

// A walk among people, seen by an engine with one number changed: its state hash at the end.
std::uint64_t hash_with(const test::Sequence& sequence, const Change& change) {
    Parameters parameters = test::fitting(Limits::tiny());
    parameters.keyframes.gap_min = 2;
    change.make(parameters);
    const test::EngineRig engine(Limits::tiny(), sequence.camera, parameters);
    EXPECT_EQ(engine.status(), Status::kOk) << change.name;
    for (const test::KeptFrame& kept : sequence.frames) {
        EXPECT_EQ(engine->submit(kept.frame()), Status::kOk);
        for (int i = 0; i < 20; ++i) static_cast<void>(engine->step(1000));
    }
    return engine->state_hash();
}

// Promise: each of these numbers decides something: with another value the same frames come to another state. (Of the
// others a test of their own module says what they decide.)
TEST(Numbers, EachDecidesSomething) {
    const test::Sequence sequence = test::rendered("walking_xyz", 60, 160, 120);
    const std::uint64_t usual = hash_with(sequence, {"as it is", [](Parameters&) {}});
    const Change changes[] = {
        {"anchor_chi2_share", [](Parameters& p) { p.region.anchor_chi2_share = 5; }},
        {"agreement_floor", [](Parameters& p) { p.region.agreement_floor = 20; }},
        {"agreement_base", [](Parameters& p) { p.region.agreement_base = 300; }},
        {"sample_chi2_max", [](Parameters& p) { p.pose.sample_chi2_max = 2; }},
        {"coarse_passes_max", [](Parameters& p) { p.pose.coarse_passes_max = 1; }},
        {"final_passes_max", [](Parameters& p) { p.pose.final_passes_max = 1; }},
        {"first_iterations_max", [](Parameters& p) { p.mapping.first_iterations_max = 1; }},
        {"explained_min", [](Parameters& p) { p.noise.explained_min = 1; }},
    };
    for (const Change& change : changes) EXPECT_NE(hash_with(sequence, change), usual) << change.name;
}

}  // namespace
}  // namespace stillmesh::numbers_test
