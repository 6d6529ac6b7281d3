#include "engine/adjust/reduced_system.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::reduced_system_test {
namespace {

constexpr std::uint32_t kW = ReducedSystem::kWidth;

// Promise: solves random positive definite systems of every size to the precision of double, in the planned memory.
TEST(ReducedSystem, SolvesEverySize) {
    test::InMemory<ReducedSystem> system(ReducedSystem::kBlocksMax);
    EXPECT_EQ(system.used_bytes(), system.planned_bytes());
    Random random(5);
    for (std::uint32_t blocks = 1; blocks <= ReducedSystem::kBlocksMax; ++blocks) {
        const std::uint32_t n = blocks * kW;
        std::vector<double> factor(n * n, 0.0), matrix(n * n, 0.0), truth(n), right(n, 0.0);
        for (std::uint32_t i = 0; i < n; ++i) {
            for (std::uint32_t j = 0; j <= i; ++j) factor[i * n + j] = random.uniform(-1, 1) + (i == j ? 4.0 : 0.0);
            truth[i] = random.uniform(-1, 1);
        }
        for (std::uint32_t i = 0; i < n; ++i) {
            for (std::uint32_t j = 0; j < n; ++j) {
                for (std::uint32_t k = 0; k < n; ++k) matrix[i * n + j] += factor[i * n + k] * factor[j * n + k];
                right[i] += matrix[i * n + j] * truth[j];
            }
        }
        system->clear(blocks);
        for (std::uint32_t i = 0; i < n; ++i) {
            system->vector(i / kW)[i % kW] = right[i];
            for (std::uint32_t j = 0; j <= i; ++j) {
                system->block(i / kW, j / kW)[(i % kW) * kW + j % kW] = matrix[i * n + j];
            }
        }
        std::uint32_t products = 0;
        for (std::uint32_t k = 0; k < blocks; ++k) {
            products += system->products_of_column(k);
            ASSERT_TRUE(system->factor_column(k));
        }
        EXPECT_EQ(products, blocks * (blocks + 1) * (blocks + 2) / 6);
        system->solve();
        for (std::uint32_t i = 0; i < n; ++i) EXPECT_NEAR(system->vector(i / kW)[i % kW], truth[i], 1e-11) << blocks;
    }
}

// Promise: a singular, an indefinite and a NaN matrix are refused.
TEST(ReducedSystem, RefusesWhatIsNotPositiveDefinite) {
    test::InMemory<ReducedSystem> system(std::uint32_t{2});
    for (const double last : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
        system->clear(2);
        for (std::uint32_t b = 0; b < 2; ++b) {
            for (std::uint32_t i = 0; i < kW; ++i) system->block(b, b)[i * kW + i] = 1.0;
        }
        system->block(1, 1)[kW * kW - 1] = last;
        EXPECT_TRUE(system->factor_column(0));
        EXPECT_FALSE(system->factor_column(1)) << last;
    }
    // Two equal rows: rank one too few.
    system->clear(2);
    for (std::uint32_t b = 0; b < 2; ++b) {
        for (std::uint32_t i = 0; i < kW; ++i) system->block(b, b)[i * kW + i] = 1.0;
    }
    system->block(1, 0)[0] = 1.0;
    EXPECT_TRUE(system->factor_column(0));
    EXPECT_FALSE(system->factor_column(1));
}

}  // namespace
}  // namespace stillmesh::reduced_system_test
