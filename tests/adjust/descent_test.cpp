#include "engine/adjust/descent.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>

namespace stillmesh::descent_test {
namespace {

Descent at(double cost, double candidate_cost, double predicted) {
    Descent descent;
    descent.begin(1e-3);
    descent.cost = cost;
    descent.candidate_cost = candidate_cost;
    descent.predicted = predicted;
    return descent;
}

// Promise: a candidate counts only when it is better and the model said so; the cost is then its own.
TEST(Descent, TakesWhatIsBetter) {
    struct Case {
        double candidate_cost, predicted;
        bool is_taken;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const Case& c : {Case{60, 50, true}, Case{100, 50, false}, Case{130, 50, false}, Case{60, -50, false},
                          Case{60, 0, false}, Case{nan, 50, false}, Case{60, nan, false}}) {
        Descent descent = at(100, c.candidate_cost, c.predicted);
        EXPECT_EQ(descent.judge(1e-4, 0.0), c.is_taken) << c.candidate_cost << " " << c.predicted;
        EXPECT_EQ(descent.cost, c.is_taken ? c.candidate_cost : 100);
    }
}

// Promise: damping falls to a third where the model was right, rises where it was half wrong, and rises faster with
// every refusal.
TEST(Descent, DampingFollowsTheModel) {
    Descent right = at(100, 50, 50);
    EXPECT_TRUE(right.judge(1e-4, 0.0));
    EXPECT_NEAR(right.damping_of(1.0, 0.0), 1e-4, 1e-18);  // 1 - (2 - 1)^3, a tenth at least
    Descent fair = at(100, 75, 50);
    EXPECT_TRUE(fair.judge(1e-4, 0.0));
    EXPECT_NEAR(fair.damping_of(1.0, 0.0), 1e-3, 1e-18);  // 1 - (1 - 1)^3
    Descent poor = at(100, 95, 50);
    EXPECT_TRUE(poor.judge(1e-4, 0.0));
    EXPECT_NEAR(poor.damping_of(1.0, 0.0), 1e-3 * (1.0 + 0.8 * 0.8 * 0.8), 1e-18);
    Descent refused = at(100, 100, 50);
    double before = 1e-3;
    for (const double growth : {2.0, 4.0, 8.0, 16.0}) {
        EXPECT_FALSE(refused.judge(1e-4, 0.0));
        EXPECT_NEAR(refused.damping_of(1.0, 0.0), growth * before, 1e-15);
        before = refused.damping_of(1.0, 0.0);
    }
    EXPECT_EQ(refused.damping_of(4.0, 0.5), 4.0 * before);
    EXPECT_EQ(refused.damping_of(0.0, 0.5), 0.5 * before);
}

// Promise: converged where a step hardly lowers the cost, where the cost is as good as exact, and where the model
// promises as little as the step was worth; not where the model expects worse.
TEST(Descent, ConvergesWhereNothingIsLeft) {
    Descent small = at(100, 99.995, 0.004);
    EXPECT_TRUE(small.judge(1e-4, 0.0));
    EXPECT_TRUE(small.has_converged());
    Descent exact = at(100, 1e-12, 100);
    EXPECT_TRUE(exact.judge(1e-4, 1e-10));
    EXPECT_TRUE(exact.has_converged());
    Descent idle = at(100, 100.001, 0.009);
    EXPECT_FALSE(idle.judge(1e-4, 0.0));
    EXPECT_TRUE(idle.has_converged());
    Descent wrong = at(100, 100.001, -5);
    EXPECT_FALSE(wrong.judge(1e-4, 0.0));
    EXPECT_FALSE(wrong.has_converged());
    for (Descent* over : {&small, &exact, &idle}) {
        EXPECT_TRUE(over->is_over());
        over->begin(1e-3);
        EXPECT_FALSE(over->is_over());
    }
}

// Promise: refused again and again it is over within a dozen tries, and has not converged.
TEST(Descent, GivesUp) {
    Descent descent = at(100, 200, 50);
    std::uint32_t tries = 0;
    for (; tries < 100 && !descent.is_over(); ++tries) descent.refuse();
    EXPECT_GT(tries, 5U);
    EXPECT_LT(tries, 13U);
    EXPECT_FALSE(descent.has_converged());
}

}  // namespace
}  // namespace stillmesh::descent_test
