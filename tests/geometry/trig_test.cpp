#include "engine/geometry/trig.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"
#include "tests/support/check_message.hpp"

namespace stillmesh::trig_test {
namespace {

// The oracle is the C library in extended precision; where long double is no wider than double it is no oracle.
constexpr bool kHasOracle = std::numeric_limits<long double>::digits >= 64;
constexpr double kUlpMax = 4.0;
constexpr int kPoints = 1'000'000;

// |got - want| in units of the last place of `want`.
double ulp_error(double got, long double want) {
    int exponent = 0;
    static_cast<void>(std::frexp(static_cast<double>(want), &exponent));
    const double ulp = std::ldexp(1.0, std::max(exponent - 53, -1074));
    return static_cast<double>(std::fabs(static_cast<long double>(got) - want) / ulp);
}

double any_scale(Random& random, std::uint32_t exponents) {
    const double mantissa = random.uniform(-1.0, 1.0);  // two statements: arguments have no order of evaluation
    return std::ldexp(mantissa, -static_cast<int>(random.below(exponents)));
}

// Promise: sin and cos are at most 4 ulp off everywhere in +-1e5 rad, also right beside the multiples of pi/2.
TEST(Trig, SinCosWithin4Ulp) {
    if (!kHasOracle) GTEST_SKIP() << "long double is no wider than double here";
    Random random(1);
    double worst = 0;
    const auto check = [&](double x) {
        const SinCos got = sin_cos(x);
        const double error = std::max(ulp_error(got.sin, std::sin(static_cast<long double>(x))),
                                      ulp_error(got.cos, std::cos(static_cast<long double>(x))));
        worst = std::max(worst, error);
        ASSERT_LE(error, kUlpMax) << std::hexfloat << x;
    };
    for (int i = 0; i < kPoints; ++i) {
        ASSERT_NO_FATAL_FAILURE(check(random.uniform(-1e5, 1e5)));
        ASSERT_NO_FATAL_FAILURE(check(random.uniform(-7.0, 7.0)));
        ASSERT_NO_FATAL_FAILURE(check(any_scale(random, 300)));
    }
    // Every multiple of pi/4 in range, its double and the two beside it: the reduction cancels nearly everything.
    const long double quarter = 0.25L * 3.14159265358979323846264338327950288L;
    for (int multiple = -127000; multiple <= 127000; ++multiple) {
        const auto x = static_cast<double>(multiple * quarter);
        ASSERT_NO_FATAL_FAILURE(check(x));
        ASSERT_NO_FATAL_FAILURE(check(std::nextafter(x, 1e9)));
        ASSERT_NO_FATAL_FAILURE(check(std::nextafter(x, -1e9)));
    }
    for (const double x : {1e5, -1e5, 0.0, 0x1p-1074, 0x1p-1022}) ASSERT_NO_FATAL_FAILURE(check(x));
    std::printf("sin, cos: worst %.2f ulp\n", worst);
}

// Promise: atan2 is at most 4 ulp off in all quadrants and at all ratios.
TEST(Trig, ArcTan2Within4Ulp) {
    if (!kHasOracle) GTEST_SKIP() << "long double is no wider than double here";
    Random random(2);
    double worst = 0;
    const auto check = [&](double y, double x) {
        const double error =
            ulp_error(arc_tan2(y, x), std::atan2(static_cast<long double>(y), static_cast<long double>(x)));
        worst = std::max(worst, error);
        ASSERT_LE(error, kUlpMax) << std::hexfloat << y << " " << x;
    };
    for (int i = 0; i < kPoints; ++i) {
        ASSERT_NO_FATAL_FAILURE(check(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)));
        ASSERT_NO_FATAL_FAILURE(check(any_scale(random, 60), any_scale(random, 60)));
        // Beside the borders of the octants and of the reduction.
        const double x = random.uniform(0.1, 10.0);
        const double border = i % 2 == 0 ? 1.0 : 0.41421356237309503;
        ASSERT_NO_FATAL_FAILURE(check(x * border * (1.0 + any_scale(random, 53)), i % 4 < 2 ? x : -x));
    }
    for (const double big : {1e300, 1e308, 1.0, 1e-290, 1e-300}) {
        for (const double ratio : {1.0, 0.5, 0.3, 1e-10, 0.999, 3.0}) {
            ASSERT_NO_FATAL_FAILURE(check(big * std::min(ratio, 1.0), big / std::max(ratio, 1.0)));
            ASSERT_NO_FATAL_FAILURE(check(-big / std::max(ratio, 1.0), -big * std::min(ratio, 1.0)));
        }
    }
    std::printf("atan2: worst %.2f ulp\n", worst);
}

// Promise: the axes give exact values, with the interval (-pi, pi]; nothing is NaN.
TEST(Trig, Axes) {
    constexpr double kPi = 0x1.921fb54442d18p+1;
    EXPECT_EQ(arc_tan2(0.0, 0.0), 0.0);
    EXPECT_EQ(arc_tan2(0.0, 5.0), 0.0);
    EXPECT_EQ(arc_tan2(0.0, -5.0), kPi);
    EXPECT_EQ(arc_tan2(-0.0, -5.0), kPi) << "never -pi";
    EXPECT_EQ(arc_tan2(5.0, 0.0), kPi / 2);
    EXPECT_EQ(arc_tan2(-5.0, 0.0), -kPi / 2);
    EXPECT_EQ(arc_tan2(2.0, 2.0), kPi / 4);
    EXPECT_EQ(arc_tan2(2.0, -2.0), 3 * kPi / 4);
    EXPECT_EQ(sin_cos(0.0).sin, 0.0);
    EXPECT_EQ(sin_cos(0.0).cos, 1.0);
}

// Promise: symmetries hold to the bit: sin is odd, cos even, atan2 odd in y.
TEST(Trig, Symmetries) {
    Random random(4);
    for (int i = 0; i < 200'000; ++i) {
        const double x = random.uniform(-100.0, 100.0);
        ASSERT_EQ(sin_cos(-x).sin, -sin_cos(x).sin);
        ASSERT_EQ(sin_cos(-x).cos, sin_cos(x).cos);
        const double y = random.uniform(-100.0, 100.0);
        if (y != 0.0) {
            ASSERT_EQ(arc_tan2(-y, x), -arc_tan2(y, x));
        }
        ASSERT_LE(std::fabs(sin_cos(x).sin), 1.0);
        ASSERT_LE(std::fabs(sin_cos(x).cos), 1.0);
    }
}

// Promise: the same bits on every processor, compiler and optimisation level: this number is committed.
TEST(Trig, GoldenBits) {
    Random random(5);
    StateHash hash;
    for (int i = 0; i < 100'000; ++i) {
        const double x = any_scale(random, 30) * 1e5;
        const double y = random.uniform(-1.0, 1.0);
        hash.add(sin_cos(x).sin);
        hash.add(sin_cos(x).cos);
        hash.add(arc_tan2(x, y));
    }
    EXPECT_EQ(hash.value(), 0x0684dddf0142883cULL) << std::hex << hash.value();
}

// Promise: what has no answer is our bug: NaN, infinity, angles beyond 1e5.
TEST(TrigDeathTest, NonsenseIsChecked) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_DEATH(static_cast<void>(sin_cos(nan)), "angle_rad");
    EXPECT_DEATH(static_cast<void>(sin_cos(1.1e5)), "angle_rad");
    EXPECT_DEATH(static_cast<void>(sin_cos(-infinity)), "angle_rad");
    EXPECT_DEATH(static_cast<void>(arc_tan2(nan, 1.0)), "kInfinity");
    EXPECT_DEATH(static_cast<void>(arc_tan2(1.0, infinity)), "kInfinity");
}

}  // namespace
}  // namespace stillmesh::trig_test
