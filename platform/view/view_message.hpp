// What goes to the page, as JSON: a snapshot, and what is new of the history. Arrays of numbers are base64 of little
// endian. At most kViewMessageBytesMax each. Cost: some 3 ms, most of it the picture's PNG; never on the
// engine's thread.
#pragma once

#include <string>
#include <vector>

#include "platform/view/view_feed.hpp"

namespace stillmesh {

inline constexpr int kViewSchema = 1;
inline constexpr std::size_t kViewMessageBytesMax = 512 * 1024;

// `text` is replaced by one line.
void compose_view_frame(const ViewSnapshot& snapshot, std::string& text);
// Empty: nothing is new.
void compose_view_news(const ViewNews& news, std::string& text);
// What can be asked of the run, and how it stands.
void compose_view_control(const ViewCommands& commands, const ViewDownloads& downloads, bool may_steer,
                          std::string& text);
// To be taken home: lines of CSV with the state, or a trajectory in TUM format of what was measured.
void compose_view_poses(const std::vector<ViewPose>& poses, bool is_csv, std::string& text);

}  // namespace stillmesh
