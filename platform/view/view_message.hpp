// What goes to the page, as JSON: a snapshot, and what is new of the history. Arrays of numbers are base64 of little
// endian. At most kViewMessageBytesMax each. Cost: some 3 ms, most of it the picture's PNG; never on the
// engine's thread.
#pragma once

#include <string>

#include "platform/view/view_feed.hpp"

namespace stillmesh {

inline constexpr int kViewSchema = 1;
inline constexpr std::size_t kViewMessageBytesMax = 512 * 1024;

// `text` is replaced by one line.
void compose_view_frame(const ViewSnapshot& snapshot, std::string& text);
// Empty: nothing is new.
void compose_view_news(const ViewNews& news, std::string& text);

}  // namespace stillmesh
