#include "engine/pose/agreeing.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/pose/residual.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::agreeing_test {
namespace {

// Promise: weighted are those with a weight, agreeing ones are weighted within both thresholds, each in its order; what
// was in the list before is gone.
TEST(Agreeing, EqualsItsDefinition) {
    test::InMemory<FixedVector<std::uint16_t>> chosen(std::size_t{200});
    std::size_t agreeing = 0, weighted = 0;
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        std::vector<Correspondence> all = test::measure_scene(200, pose, {1e-3, 2e-3, 0}, random);
        for (Correspondence& c : all) {
            c.weight = random.below(3) == 0 ? 0.0 : random.uniform();
            c.p_anchor += test::random_vector(random, 0.01);
        }
        const double chi2_max = random.uniform(1, 12), chi2_anchor_max = random.uniform(1, 50);
        std::vector<std::uint16_t> wanted, wanted_weighted;
        for (std::uint16_t i = 0; i < all.size(); ++i) {
            if (all[i].weight == 0) continue;
            wanted_weighted.push_back(i);
            if (chi2_of(all[i], pose.inverse()) <= chi2_max &&
                chi2_of_anchor(all[i], pose.inverse()) <= chi2_anchor_max) {
                wanted.push_back(i);
            }
        }
        choose_weighted(all, *chosen);
        EXPECT_EQ(std::vector<std::uint16_t>(chosen->begin(), chosen->end()), wanted_weighted);
        choose_agreeing(all, pose, chi2_max, chi2_anchor_max, *chosen);
        EXPECT_EQ(std::vector<std::uint16_t>(chosen->begin(), chosen->end()), wanted);
        agreeing += wanted.size();
        weighted += wanted_weighted.size();
    }
    EXPECT_GT(agreeing, 500U);
    EXPECT_LT(agreeing, weighted);
}

}  // namespace
}  // namespace stillmesh::agreeing_test
