// Times are int64 nanoseconds of one clock; how far apart two of them are is said in seconds.
#pragma once

#include <cstdint>

namespace stillmesh {

inline constexpr double kSecond_ns = 1e9;

[[nodiscard]] constexpr double seconds_between(std::int64_t from_ns, std::int64_t to_ns) noexcept {
    return static_cast<double>(to_ns - from_ns) / kSecond_ns;
}

}  // namespace stillmesh
