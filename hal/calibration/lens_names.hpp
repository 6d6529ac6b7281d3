// What the lenses of camera files are called. Inner.
#pragma once

#include <cstdint>
#include <string_view>

namespace stillmesh {

enum class LensName : std::uint8_t {
    kUnsaid,
    kPinhole,     // whatever its distortion
    kBrown,       // k1 k2 p1 p2 k3
    kRational,    // and k4 k5 k6
    kFisheye,     // k1 k2 k3 k4 of the angle
    kOtherBrown,  // librealsense's inverse and modified one: known without distortion alone
    kUnknown
};

inline constexpr const char* kKnownLenses = "plumb_bob or radtan, rational_polynomial, equidistant or fisheye";

// Capital letters, blanks, "-" and "_" are no difference.
[[nodiscard]] LensName lens_named(std::string_view name);

}  // namespace stillmesh
