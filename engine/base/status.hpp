// Status and Result: what the world did. A closed list; each function's comment says which of them it returns.
#pragma once

#include <cstdint>

#include "engine/base/check.hpp"

namespace stillmesh {

enum class [[nodiscard]] Status : std::uint8_t{
    kOk = 0,
    kFull,         // a fixed container or pool has no room; nothing changed
    kTimedOut,     // nothing came within the time allowed
    kUnavailable,  // the device or file is not there (any more)
    kCorrupt,      // bytes that do not mean what they must
    kInvalid,      // an argument or a configuration value out of its range
    kDegenerate,   // geometry without a solution (all points on one line, no depth, ...)
    kNotFound,     // looked for and absent
    kEnd,          // no more frames will come
};

[[nodiscard]] constexpr const char* status_name(Status status) noexcept {
    switch (status) {
        case Status::kOk: return "ok";
        case Status::kFull: return "full";
        case Status::kTimedOut: return "timed out";
        case Status::kUnavailable: return "unavailable";
        case Status::kCorrupt: return "corrupt";
        case Status::kInvalid: return "invalid";
        case Status::kDegenerate: return "degenerate";
        case Status::kNotFound: return "not found";
        case Status::kEnd: return "end";
    }
    return "unknown";
}

// Either a value (status kOk) or the status that says why there is none. T must be default constructible and cheap.
template <typename T>
class [[nodiscard]] Result {
public:
    constexpr Result(T value) noexcept : value_(value), status_(Status::kOk) {}
    constexpr Result(Status status) noexcept : status_(status) { STILLMESH_CHECK(status != Status::kOk); }

    [[nodiscard]] constexpr bool is_ok() const noexcept { return status_ == Status::kOk; }
    [[nodiscard]] constexpr Status status() const noexcept { return status_; }
    [[nodiscard]] constexpr const T& value() const noexcept {
        STILLMESH_CHECK(is_ok());
        return value_;
    }

private:
    T value_{};
    Status status_;
};

}  // namespace stillmesh

// Returns the status of `expression` from the enclosing function unless it is kOk.
#define STILLMESH_TRY(expression)                                                                        \
    do {                                                                                                 \
        if (const ::stillmesh::Status try_status = (expression); try_status != ::stillmesh::Status::kOk) \
            return try_status;                                                                           \
    } while (false)
