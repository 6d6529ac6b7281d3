// Which names ROS 2 allows for topics and namespaces.
#pragma once

#include <string_view>

namespace stillmesh {

// Letters, digits and _ between single slashes, no part beginning with a digit; one slash at the begin is allowed.
[[nodiscard]] constexpr bool is_ros_name(std::string_view name) noexcept {
    if (!name.empty() && name.front() == '/') name.remove_prefix(1);
    bool is_begin = true;
    for (const char c : name) {
        const bool is_digit = c >= '0' && c <= '9';
        const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
        if (c == '/' ? is_begin : !is_letter && (!is_digit || is_begin)) return false;
        is_begin = c == '/';
    }
    return !name.empty() && !is_begin;
}

}  // namespace stillmesh
