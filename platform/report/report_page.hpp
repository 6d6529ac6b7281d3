// What every page of this room begins and ends with, and what it takes from the live page.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

namespace stillmesh {

[[nodiscard]] std::string page_head(std::string_view title);
[[nodiscard]] std::string page_tail(std::initializer_list<std::string_view> scripts);
// What stands behind "<!-- part NAME" in a page, to the next such mark or the end.
[[nodiscard]] std::string_view part_of(std::string_view page, std::string_view name);

}  // namespace stillmesh
