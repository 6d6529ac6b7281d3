#include "platform/poses/body_frames.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>

namespace stillmesh {
namespace {

constexpr double kUnsure = 0.1;           // m, rad: another explanation lies about as far away
constexpr double kUnmeasuredSpeed = 0.5;  // m/s, rad/s, that a motion carried on may be wrong by
constexpr std::size_t kSix = 6;

// a m a^T
[[nodiscard]] Covariance6 carried(const Covariance6& a, const Covariance6& m) {
    Covariance6 half{};
    Covariance6 out{};
    for (std::size_t i = 0; i < kSix; ++i) {
        for (std::size_t k = 0; k < kSix; ++k) {
            for (std::size_t j = 0; j < kSix; ++j) half[kSix * i + j] += a[kSix * i + k] * m[kSix * k + j];
        }
    }
    for (std::size_t i = 0; i < kSix; ++i) {
        for (std::size_t j = 0; j < kSix; ++j) {
            for (std::size_t k = 0; k < kSix; ++k) out[kSix * i + j] += half[kSix * i + k] * a[kSix * j + k];
        }
    }
    return out;
}

[[nodiscard]] Covariance6 unknown() {
    Covariance6 out{};
    for (std::size_t i = 0; i < kSix; ++i) out[(kSix + 1) * i] = kUnknownVariance;
    return out;
}

[[nodiscard]] bool is_finite(const Covariance6& covariance) {
    return std::all_of(covariance.begin(), covariance.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

BodyFrames::BodyFrames(const RigidTransform& base_from_camera_link)
    : base_from_optical_(compose(base_from_camera_link, kLinkFromOptical)),
      optical_from_base_(inverse_of(base_from_optical_)) {}

RigidTransform BodyFrames::of_base(const RigidTransform& of_camera) const {
    return compose(compose(base_from_optical_, of_camera), optical_from_base_);
}

std::array<double, 3> BodyFrames::point(const double (&in_map)[3]) const {
    return transformed(base_from_optical_, {in_map[0], in_map[1], in_map[2]});
}

// The adjoint of B: [R, [t]x R; 0, R].
Covariance6 BodyFrames::of_base(const double (&of_camera)[36]) const {
    const RotationMatrix r = matrix_of(base_from_optical_.rotation_xyzw);
    const double(&t)[3] = base_from_optical_.translation_m;
    Covariance6 adjoint{};
    for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t i = 0; i < 3; ++i) adjoint[kSix * i + j] = adjoint[kSix * (i + 3) + j + 3] = r[3 * i + j];
        adjoint[j + 3] = t[1] * r[6 + j] - t[2] * r[3 + j];
        adjoint[kSix + j + 3] = t[2] * r[j] - t[0] * r[6 + j];
        adjoint[2 * kSix + j + 3] = t[0] * r[3 + j] - t[1] * r[j];
    }
    Covariance6 measured{};
    std::copy(std::begin(of_camera), std::end(of_camera), measured.begin());
    return is_finite(measured) ? carried(adjoint, measured) : unknown();
}

Velocity BodyFrames::of_base(const Velocity& of_camera) const {
    const double(&t)[3] = base_from_optical_.translation_m;
    const double(&v)[3] = of_camera.linear_m_s;
    const double(&w)[3] = of_camera.angular_rad_s;
    const std::array<double, 3> linear = rotated(base_from_optical_, {v[0], v[1], v[2]});
    const std::array<double, 3> angular = rotated(base_from_optical_, {w[0], w[1], w[2]});
    return {{linear[0] + t[1] * angular[2] - t[2] * angular[1], linear[1] + t[2] * angular[0] - t[0] * angular[2],
             linear[2] + t[0] * angular[1] - t[1] * angular[0]},
            {angular[0], angular[1], angular[2]}};
}

Covariance6 in_parent(const Covariance6& in_child, const RigidTransform& parent_from_child) {
    const RotationMatrix r = matrix_of(parent_from_child.rotation_xyzw);
    Covariance6 turned{};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) turned[kSix * i + j] = turned[kSix * (i + 3) + j + 3] = r[3 * i + j];
    }
    return carried(turned, in_child);
}

Covariance6 with_doubt(const Covariance6& measured, PoseState state, double seconds_unmeasured) {
    if (!is_finite(measured)) return unknown();
    Covariance6 out = measured;
    if (state == PoseState::kTracked) return out;
    const double doubt = kUnsure + (state == PoseState::kUnsure ? 0 : kUnmeasuredSpeed * seconds_unmeasured);
    for (std::size_t i = 0; i < kSix; ++i) out[(kSix + 1) * i] += doubt * doubt;
    return out;
}

bool parse_pose(std::string_view text, RigidTransform& pose) {
    std::array<double, 7> numbers{0, 0, 0, 0, 0, 0, 1};
    std::size_t count = 0;
    for (;; ++count) {
        const std::size_t comma = std::min(text.find(','), text.size());
        const std::string_view word = text.substr(0, comma);
        if (count == numbers.size()) return false;
        const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), numbers[count]);
        if (error != std::errc() || stop != word.data() + word.size() || !std::isfinite(numbers[count])) return false;
        if (comma == text.size()) break;
        text.remove_prefix(comma + 1);
    }
    const auto& [x, y, z, qx, qy, qz, qw] = numbers;
    const double length = std::sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
    if ((count != 2 && count != 6) || length < 1e-6 || !std::isfinite(length)) return false;
    pose = {{qx / length, qy / length, qz / length, qw / length}, {x, y, z}};
    return true;
}

}  // namespace stillmesh
