#include "engine/geometry/trig.hpp"

#include "engine/base/check.hpp"

// The polynomials and the pieces of pi/2 come from toolchains/trig_coefficients.py (Remez exchange, 70 digits).
namespace stillmesh {
namespace {

constexpr double kPi = 0x1.921fb54442d18p+1;
constexpr double kPiLow = 0x1.1a62633145c07p-53;  // pi - kPi

// A sum kept in two numbers: high is the rounded sum, low what rounding took away, exactly (Knuth).
struct Pair {
    double high;
    double low;
};

Pair exact_difference(double a, double b) noexcept {
    const double high = a - b;
    const double b_seen = a - high;
    const double a_seen = high + b_seen;
    return {high, (a - a_seen) + (b_seen - b)};
}

// x (and its tail) in [-pi/4, pi/4]; the tail is below half an ulp of x.
double sin_near_zero(double x, double tail) noexcept {
    const double u = x * x;
    const double p = polynomial(u, 0x1.5d944541dfb87p-33, -0x1.ae5e6b02635d2p-26, 0x1.71de357e879a5p-19,
                                -0x1.a01a019c1aa21p-13, 0x1.111111110f8d1p-7, -0x1.5555555555549p-3);
    return x + (x * (u * p) + tail * (1.0 - 0.5 * u));
}

double cos_near_zero(double x, double tail) noexcept {
    const double u = x * x;
    const double p = polynomial(u, -0x1.8fbdbbc483fa7p-37, 0x1.1eea0ba328cf6p-29, -0x1.27e4f83d4acb5p-22,
                                0x1.a01a019d01484p-16, -0x1.6c16c16c15523p-10, 0x1.555555555554ep-5);
    // 1 - u/2 rounds; what it loses is known exactly and goes into the small terms.
    const double half = 0.5 * u;
    const double head = 1.0 - half;
    return head + (((1.0 - head) - half) + (u * u * p - x * tail));
}

// |x| <= tan(pi/8).
double atan_near_zero(double x) noexcept {
    const double u = x * x;
    const double p =
        polynomial(u, -0x1.26f07d2c11bbbp-6, 0x1.38919f1dde324p-5, -0x1.9d21326f3140dp-5, 0x1.df21de1d8ab71p-5,
                   -0x1.10ed175446228p-4, 0x1.3b113a984f815p-4, -0x1.745cfaed1e9f9p-4, 0x1.c71c70fa8e881p-4,
                   -0x1.24924922e937ep-3, 0x1.99999999963a5p-3, -0x1.5555555555543p-2);
    return x + x * (u * p);
}

}  // namespace

SinCos sin_cos(double angle_rad) noexcept {
    STILLMESH_CHECK(angle_rad >= -1e5 && angle_rad <= 1e5);  // false for NaN too
    // The nearest multiple of pi/2. Adding 1.5 * 2^52 leaves no bits behind the point: rounds half to even.
    constexpr double kRounder = 0x1.8p+52;
    const double multiple = (angle_rad * 0x1.45f306dc9c883p-1 + kRounder) - kRounder;
    // |multiple| < 2^16, so its product with a piece of 33 bits is exact, and so is the first difference (Cody &
    // Waite). Doubles up to 1e5 come as near to a multiple of pi/2 as 2^-60; the pieces reach 2^-155.
    const Pair second = exact_difference(angle_rad - multiple * 0x1.921fb54400000p+0, multiple * 0x1.0b4611a600000p-34);
    const Pair third = exact_difference(second.high, multiple * 0x1.3198a2e000000p-69);
    const double rest = (second.low + third.low) - multiple * 0x1.b839a252049c1p-104;
    const double x = third.high + rest;
    const double tail = (third.high - x) + rest;

    const double sin_x = sin_near_zero(x, tail);
    const double cos_x = cos_near_zero(x, tail);
    switch (static_cast<int>(multiple) & 3) {  // two's complement: right for negative multiples
        case 0: return {sin_x, cos_x};
        case 1: return {cos_x, -sin_x};
        case 2: return {-sin_x, -cos_x};
        default: return {-cos_x, sin_x};
    }
}

double arc_tan2(double y, double x) noexcept {
    const double ay = y < 0 ? -y : y;
    const double ax = x < 0 ? -x : x;
    constexpr double kInfinity = __builtin_huge_val();
    STILLMESH_CHECK(ax < kInfinity && ay < kInfinity);  // false for NaN too
    if (ay == 0.0) return x < 0 ? kPi : 0.0;
    if (ax == 0.0) return y < 0 ? -0.5 * kPi : 0.5 * kPi;

    // First octant first: t = smaller / larger in [0, 1]; beyond tan(pi/8) turned back by pi/4.
    const bool is_steep = ay > ax;
    double larger = is_steep ? ay : ax;
    double smaller = is_steep ? ax : ay;
    if (larger > 0x1p+1000) {  // the sum below must not overflow
        larger *= 0x1p-100;
        smaller *= 0x1p-100;
    } else if (larger < 0x1p-900) {  // nor the quotient lose bits to subnormal numbers
        larger *= 0x1p+120;
        smaller *= 0x1p+120;
    }
    const bool is_turned = smaller > 0x1.a827999fcef32p-2 * larger;  // sqrt(2) - 1
    const double part =
        is_turned ? atan_near_zero((smaller - larger) / (smaller + larger)) : atan_near_zero(smaller / larger);
    // angle = head + part (or head - part): the tails of head's multiple of pi/4 are added to the small number first.
    // In quarter turns of pi/4: first octant 0 or 1, steep 2 - that, left half plane 4 - that.
    int eighths = is_turned ? 1 : 0;
    double sign = 1.0;
    if (is_steep) {
        eighths = 2 - eighths;
        sign = -sign;
    }
    if (x < 0) {
        eighths = 4 - eighths;
        sign = -sign;
    }
    const double turns = 0.25 * static_cast<double>(eighths);
    const double angle = eighths == 0 ? part : turns * kPi + (sign * part + turns * kPiLow);
    return y < 0 ? -angle : angle;
}

}  // namespace stillmesh
